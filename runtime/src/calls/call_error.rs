//! Why a blocking call was not done.

use super::target::TargetError;

/// Why a call was not done.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CallError {
    /// Nobody answers at the path.
    #[error("{node} does not run; `sinew ls` shows what does")]
    NodeNotRunning {
        /// The node's path.
        node: String,
    },
    /// The node ended during the call.
    #[error("{node} ended during \"{command}\": whether it was done is not known; look at its state and call again")]
    Died {
        /// The node's path.
        node: String,
        /// The command.
        command: String,
    },
    /// No answer in time.
    #[error("\"{command}\" of {node}: {reason}")]
    TimedOut {
        /// The node's path.
        node: String,
        /// The command.
        command: String,
        /// What the node was doing, if it said so.
        reason: String,
    },
    /// The node, or its queue, said no.
    #[error("\"{command}\" of {node} refused: {reason}")]
    Refused {
        /// The node's path.
        node: String,
        /// The command.
        command: String,
        /// Why.
        reason: String,
    },
    /// A long order was begun and could not be done.
    #[error("\"{command}\" of {node} failed: {reason}")]
    Failed {
        /// The node's path.
        node: String,
        /// The command.
        command: String,
        /// Why.
        reason: String,
    },
    /// The call was cancelled.
    #[error("\"{command}\" of {node} was cancelled")]
    Cancelled {
        /// The node's path.
        node: String,
        /// The command.
        command: String,
    },
    /// The node has no such command.
    #[error("{reason}")]
    Unknown {
        /// The command.
        command: String,
        /// The command whose name is nearest.
        nearest: String,
        /// The whole message.
        reason: String,
    },
    /// One side means another message.
    #[error("{reason}")]
    WrongLayout {
        /// The hash that the receiver expects.
        expected_hash: u64,
        /// The whole message.
        reason: String,
    },
    /// The path cannot be called.
    #[error(transparent)]
    Target(#[from] TargetError),
    /// The kernel refuses the connection.
    #[error("{node} cannot be called: {reason}")]
    Connection {
        /// The node's path.
        node: String,
        /// The kernel's reason.
        reason: String,
    },
}
