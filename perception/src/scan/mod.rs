//! One scan taken apart: beams → points → segments → circles. Pure, and without allocation once it has begun.

pub mod circles;
pub mod points;
pub mod segments;
pub mod sight;
