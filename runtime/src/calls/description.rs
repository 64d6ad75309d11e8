//! What a node can be asked, as `describe` answers it: enough to call it without its compiled types.

use serde::{Deserialize, Serialize};

use super::stage::{CommandKind, Shape, Stage};

/// The commands of a node.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Commands {
    /// The node's path.
    pub node: String,
    /// Its own commands, in the order of their declaration.
    pub commands: Vec<CommandName>,
    /// What every node answers without a step.
    pub built_in: Vec<String>,
}

/// One line of [`Commands`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CommandName {
    /// The command.
    pub name: String,
    /// Whether it is answered within a step, or a long order.
    pub kind: CommandKind,
}

/// All about one command.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Command {
    /// The command.
    pub name: String,
    /// Whether it is answered within a step, or a long order.
    pub kind: CommandKind,
    /// What it takes.
    pub request: Layout,
    /// What a long order reports on its way.
    pub progress: Option<Layout>,
    /// What it answers.
    pub answer: Layout,
}

/// Layout of a message.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Layout {
    /// Its [`Schema`](messages::Schema) as text; [`Schema::from_text`](messages::Schema::from_text) reads it.
    pub schema: String,
    /// The schema's hash.
    pub hash: u64,
    /// Length of the message [byte].
    pub bytes: usize,
}

impl Command {
    pub(super) fn of(stage: &Stage) -> Command {
        Command {
            name: stage.command.into(),
            kind: stage.kind,
            request: Layout::of(&stage.request),
            progress: stage.progress.as_ref().map(Layout::of),
            answer: Layout::of(&stage.answer),
        }
    }
}

impl Layout {
    fn of(shape: &Shape) -> Layout {
        Layout { schema: (shape.schema)().to_text(), hash: shape.hash, bytes: shape.bytes }
    }
}
