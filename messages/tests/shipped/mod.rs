//! The messages that this crate ships, for tests about all of them.

/// `every_message!(check)` is `check::<Axis>(); check::<BaseState>(); …`
macro_rules! every_message {
    ($check:ident) => {
        every_message!($check: Axis BaseState Beam Command Contact CoordinatorState Done FreeSectors GovernorState Image InputCursor
            MotionState NodeStatistics Notice Odometry Proposal Ranges Sound StepInputs SupervisorState Switch Trigger Truth Twist)
    };
    ($check:ident: $($message:ident)*) => {
        [$($check::<messages::$message>()),*]
    };
}
pub(crate) use every_message;
