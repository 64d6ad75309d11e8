//! Plane geometry: points, poses, rays, cones and convex outlines.
//!
//! All lengths in metres, angles in radians, counter-clockwise positive. Only square roots and `runtime::math` are
//! used, so that the same input gives the same bits on every CPU.

mod cone;
mod fan;
mod footprint;
mod point;
mod shape;

pub use cone::{Cone, ConeHit};
pub use fan::Fan;
pub(crate) use fan::{bearing_rad, sides_rad};
pub use footprint::{Footprint, MAX_CORNERS, Placed};
pub use point::{Point, Pose};
pub use shape::{Circle, Segment};
