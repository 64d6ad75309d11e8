//! Follows what stands and moves around the body.
//!
//! Reads `ranges` (any ranger in the body frame) and `odometry`; writes `tracks` and `segments`, both with the scan's
//! stamp. Each scan goes through all of it in one step: points → segments → circles ([`crate::scan`]) → association
//! ([`association`]) → filters ([`polar`] or [`cartesian`]) → still or moving ([`entry`]) → birth and death
//! ([`tracker`]). The stages are not nodes of their own: a stage takes some 10 µs, a hop between processes more.
//!
//! Without odometry at the scan's time it writes nothing: its readers then see that it is silent. When the odometry
//! frame's zero moves, all tracks begin anew.
//!
//! ```toml
//! [nodes.tracks]
//! type = "tracks"
//! trigger = "ranges"
//! deadline_ms = 20
//! priority = 62
//! reads.ranges = "/perception/ranges/ranges"
//! reads.odometry = "/perception/odometry/pose"
//! config = { filter = "cartesian", segments = { noise_m = 0.1 } }
//!
//! [nodes.avoid]
//! type = "avoid"
//! trigger = "tracks"
//! reads.tracks = "/perception/tracks/tracks"
//! ```

pub mod association;
pub mod cartesian;
pub mod config;
pub mod entry;
pub mod measurement;
pub mod polar;
pub mod tracker;

use crate::place::{Place, place_at};
use config::TracksConfig;
use messages::{Odometry, Ranges, Segments, Track, Twist};
use runtime::{Fault, Layer, Node, OpenError, Ports, Reader, Time, Writer};
use tracker::Tracker;

/// The node.
pub struct Tracks {
    ranges: Reader<Ranges>,
    odometry: Reader<Odometry>,
    tracks: Writer<messages::Tracks>,
    segments: Writer<Segments>,
    tracker: Tracker,
    path_step_s: f64,
    /// Generation and origin of the odometry frame.
    frame: Option<(u64, u64)>,
}

impl Node for Tracks {
    const TYPE: &'static str = "tracks";
    const LAYER: Layer = Layer::Perception;
    type Config = TracksConfig;

    fn open(ports: &mut Ports, config: TracksConfig) -> Result<Tracks, OpenError> {
        config.check().map_err(OpenError::config)?;
        Ok(Tracks {
            ranges: ports.reader("ranges")?,
            odometry: ports.reader("odometry")?,
            tracks: ports.writer_with_tail("tracks", config.most_tracks)?,
            segments: ports.writer_with_tail("segments", config.segments.most_segments)?,
            tracker: Tracker::new(config),
            path_step_s: config.path_step_s,
            frame: None,
        })
    }

    fn step(&mut self, _now: Time) -> Result<(), Fault> {
        while let Some(scan) = self.ranges.next_unread() {
            let Some((place, body)) = body_at(&mut self.odometry, scan.stamp) else { continue };
            if self.frame.replace(body.frame).is_some_and(|frame| frame != body.frame) {
                self.tracker.begin_anew();
            }
            if self.tracker.take(scan.stamp, scan.tail, &place, &body.velocity) {
                let (stamp, beams) = (scan.stamp, scan.tail.len());
                self.publish(stamp, beams, &place, &body);
            }
        }
        Ok(())
    }
}

/// What the odometry says at a scan's time, beside the place.
#[derive(Debug, Clone, Copy)]
struct Body {
    heading_rad: f64,
    velocity: Twist,
    frame: (u64, u64),
}

fn body_at(odometry: &mut Reader<Odometry>, time: Time) -> Option<(Place, Body)> {
    let place = place_at(odometry, time)?;
    let newest = odometry.at(time)?;
    let heading_rad = runtime::math::atan2(place.sin, place.cos);
    Some((place, Body { heading_rad, velocity: newest.velocity, frame: (newest.generation, newest.origin) }))
}

impl Tracks {
    fn publish(&mut self, stamp: Time, beams: usize, place: &Place, body: &Body) {
        let segmenter = self.tracker.segmenter();
        let head = Segments {
            beams: beams as u32,
            points: segmenter.points().all().len() as u32,
            no_room: segmenter.no_room(),
        };
        self.segments.write_with_tail(stamp, &head, segmenter.segments());
        let head = messages::Tracks {
            body_x_m: place.x_m,
            body_y_m: place.y_m,
            body_heading_rad: body.heading_rad,
            body_velocity: body.velocity,
            origin: body.frame.1,
            path_step_s: self.path_step_s,
            no_room: self.tracker.no_room(),
        };
        let tracks: &[Track] = self.tracker.tracks();
        self.tracks.write_with_tail(stamp, &head, tracks);
    }
}
