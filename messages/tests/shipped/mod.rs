//! The messages that this crate ships, for tests about all of them.

/// `every_message!(check)` is `check::<Axis>(); check::<BaseState>(); …`
macro_rules! every_message {
    ($check:ident) => {
        every_message!($check:
            Axis
            BaseState
            Beam
            Command
            Contact
            CoordinatorState
            Detour
            Done
            FreeSectors
            GotoGoal
            GotoPath
            GotoProgress
            GotoResult
            Governance
            Image
            InputCursor
            LaserScan
            LaserState
            Load
            ModeState
            MotionState
            MoveProgress
            MoveRequest
            NodeLoad
            NodePeriod
            NodeStatistics
            Notice
            Odometry
            Periods
            Proposal
            ProtectiveStop
            RangerVerdict
            Ranges
            Room
            ScanBeam
            Segment
            Segments
            SetMode
            SetPose
            Sound
            StepEvents
            StepInputs
            SupervisorState
            Switch
            Track
            Tracks
            Trigger
            Truth
            Twist
            WheelVelocities
        )
    };
    ($check:ident: $($message:ident)*) => {
        [$($check::<messages::$message>()),*]
    };
}
pub(crate) use every_message;
