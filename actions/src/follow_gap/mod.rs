//! Takes the robot through clutter to a goal: a local planner that judges whole swept plans.
pub mod candidates;
pub mod clearance;
pub mod config;
pub mod guide;
pub mod memory;
pub mod planner;
pub mod pose;
pub mod rollout;
pub use config::FollowGapConfig;
