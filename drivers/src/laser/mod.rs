//! What all laser drivers share: where the scanner is mounted, the paths that they write, and which faults they say.

pub mod conformance;
mod mount;
mod paths;
mod said;

pub use mount::Mount;
pub use paths::{MAX_BEAMS, News, Paths, Sweep};
pub use said::SaidOnce;
