//! What all laser drivers share: where the scanner is mounted, and the paths that they write.

mod mount;
mod paths;

pub use mount::Mount;
pub use paths::{MAX_BEAMS, News, Paths, Sweep};
