//! What all laser drivers share: the node, the part of a session that no protocol changes, where the scanner is mounted, the
//! paths that they write, and which faults they say.

pub mod conformance;
mod mount;
mod node;
mod paths;
mod said;
mod session;
pub mod settings;
pub mod talk;

pub use mount::Mount;
pub use node::Scanner;
pub use paths::{MAX_BEAMS, News, Paths, Sweep};
pub use said::SaidOnce;
pub use session::{Event, Session, Settings};
