//! Writes a recording whose every value is known, for readers that know nothing of this project: see `tests/peers`.
//!
//! `cargo run --release -p sinew-recorder --example for_peers FILE`

use messages::{BaseState, Command, Encoding, Image, Message, Odometry, Twist, bytemuck};
use recorder::{Facts, RecordError, RecordingWriter};
use runtime::channel::{Geometry, RawSample};
use std::path::Path;

/// A beam as lasers write it.
#[derive(Debug, Clone, Copy, Default, Message)]
#[repr(C)]
struct ScanBeam {
    /// Distance [m].
    range_m: f32,
    /// Strength of the echo.
    intensity: u16,
    /// See `messages::Echo`.
    #[message(values = "none value clear too_near off link_lost fault")]
    echo: u16,
}

/// A scan as lasers write it: copies find its fields by their names.
#[derive(Debug, Clone, Copy, Default, Message)]
#[repr(C)]
#[message(tail = ScanBeam)]
struct LaserScan {
    /// Direction of the first beam [rad].
    angle_min_rad: f32,
    /// From one beam to the next [rad].
    angle_increment_rad: f32,
    /// From one beam to the next [s].
    time_increment_s: f32,
    /// From one scan to the next [s].
    scan_time_s: f32,
    /// Shortest distance [m].
    range_min_m: f32,
    /// Longest distance [m].
    range_max_m: f32,
}

/// Samples per channel.
const SAMPLES: u64 = 25;
/// Half a second between samples [ns].
const SPACING_NS: u64 = 500_000_000;

struct Source {
    out: RecordingWriter,
}

impl Source {
    fn write<M: Message>(
        &mut self,
        path: &str,
        mut sample: impl FnMut(u64) -> (M, Vec<M::Tail>),
    ) -> Result<(), RecordError> {
        let schema = M::schema();
        let geometry = Geometry {
            type_name: M::NAME.into(),
            layout_hash: schema.hash(),
            schema: schema.to_text(),
            fixed_bytes: size_of::<M>(),
            tail_element_bytes: if M::HAS_TAIL { size_of::<M::Tail>() } else { 0 },
            tail_capacity: if M::HAS_TAIL { 4096 } else { 0 },
            depth: 8,
        };
        let key = self.out.channel(path, &geometry)?;
        for n in 0..SAMPLES {
            let (message, tail) = sample(n);
            let tail: &[u8] = if M::HAS_TAIL { bytemuck::cast_slice(&tail) } else { &[] };
            let raw = RawSample { sequence: n + 1, stamp_ns: n * SPACING_NS, generation: 1, tail_bytes: tail.len() };
            self.out.sample(key, &raw, bytemuck::bytes_of(&message), tail)?;
        }
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1).ok_or("name the file to write")?;
    let facts = Facts { robot: "known".into(), host: "simulated".into(), ..Facts::default() };
    let mut source = Source { out: RecordingWriter::create(Path::new(&file), &facts)? };
    source.write("/perception/odometry/pose", |n| {
        let velocity = Twist { linear_x_m_s: 0.25, linear_y_m_s: 0.0, angular_z_rad_s: -0.5 };
        let mut pose_covariance = [0.0; 9];
        pose_covariance[8] = 0.125;
        let heading_rad = std::f64::consts::FRAC_PI_2;
        (Odometry { x_m: n as f64, y_m: -1.5, heading_rad, velocity, pose_covariance, ..Odometry::default() }, vec![])
    })?;
    source.write("/coordinator/arbiter/velocity", |n| {
        (Twist { linear_x_m_s: n as f64 * 0.125, linear_y_m_s: 0.5, angular_z_rad_s: 2.0 }, vec![])
    })?;
    source.write("/motion/drive/command", |n| {
        let velocity = Twist { linear_x_m_s: n as f64, ..Twist::default() };
        (Command { velocity, valid_for_s: 0.3, enable: 1 }, vec![])
    })?;
    source.write("/drivers/base/state", |n| {
        (BaseState { battery_v: 12.5, charge: 0.75, packets: n as u32, ..BaseState::default() }, vec![])
    })?;
    source.write("/drivers/camera/image", |n| {
        let rgb = Encoding::Rgb8 as u32;
        (Image { height_px: 2, width_px: 3, step_bytes: 9, encoding: rgb }, (0..18).map(|k| k + n as u8).collect())
    })?;
    source.write("/drivers/camera/photo", |_| {
        let jpeg = Encoding::Jpeg as u32;
        (Image { height_px: 2, width_px: 3, step_bytes: 0, encoding: jpeg }, vec![0xff, 0xd8, 0xff, 0xd9])
    })?;
    source.write("/drivers/laser/scan", |n| {
        let scan = LaserScan {
            angle_min_rad: -1.5,
            angle_increment_rad: 0.5,
            time_increment_s: 0.001,
            scan_time_s: 0.1,
            range_min_m: 0.05,
            range_max_m: 8.0,
        };
        let beam = |range_m, echo| ScanBeam { range_m, intensity: 7, echo };
        (scan, vec![beam(1.0 + n as f32, 1), beam(0.0, 2), beam(0.0, 3), beam(0.0, 6), beam(2.5, 1)])
    })?;
    source.out.finish()?;
    Ok(())
}
