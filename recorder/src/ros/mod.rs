//! Copies of samples as messages that ROS 2 tools know by name.
//!
//! | ours | ROS 2 | what is not carried over |
//! |---|---|---|
//! | `Odometry` | nav_msgs/Odometry | the count of origins |
//! | `Twist`, `Command` | geometry_msgs/TwistStamped | how long a command is valid |
//! | `Image` | sensor_msgs/Image, a JPEG sensor_msgs/CompressedImage | – |
//! | `LaserScan` | sensor_msgs/LaserScan | – |
//! | `BaseState` | sensor_msgs/BatteryState | all but the battery |
//!
//! A copy is for eyes; what is replayed is the exact sample.

mod definitions;
mod laser;

pub use definitions::definition;
pub(crate) use definitions::{INCIDENT, INCIDENT_TYPE};

use crate::cdr::Cdr;
use laser::LaserFields;
use messages::{BaseState, Command, Encoding, Image, Message, Odometry, Schema, Twist, bytemuck};

/// Which ROS 2 message a channel is copied as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RosType {
    /// nav_msgs/msg/Odometry.
    Odometry,
    /// geometry_msgs/msg/TwistStamped, from a `Twist`.
    Twist,
    /// geometry_msgs/msg/TwistStamped, from a `Command`.
    Command,
    /// sensor_msgs/msg/Image.
    Image,
    /// sensor_msgs/msg/CompressedImage.
    CompressedImage,
    /// sensor_msgs/msg/LaserScan.
    LaserScan,
    /// sensor_msgs/msg/BatteryState.
    BatteryState,
}

/// How the samples of one channel are copied.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Copier {
    /// Always as this type.
    Plain(RosType),
    /// As a picture, or as a compressed one: each says which it is.
    Image,
    /// As a laser scan, whose fields are found by their names.
    Laser(LaserFields),
}

impl Copier {
    /// How samples with this schema are copied, if they are.
    pub fn of(schema: &Schema) -> Option<Copier> {
        let is = |hash: u64| schema.hash() == hash;
        match schema.name.as_str() {
            "Odometry" if is(Odometry::layout_hash()) => Some(Copier::Plain(RosType::Odometry)),
            "Twist" if is(Twist::layout_hash()) => Some(Copier::Plain(RosType::Twist)),
            "Command" if is(Command::layout_hash()) => Some(Copier::Plain(RosType::Command)),
            "BaseState" if is(BaseState::layout_hash()) => Some(Copier::Plain(RosType::BatteryState)),
            "Image" if is(Image::layout_hash()) => Some(Copier::Image),
            "LaserScan" => LaserFields::of(schema).map(Copier::Laser),
            _ => None,
        }
    }

    /// Writes the copy and says what it is; `None` where the bytes are not what they should be. `ns` is the stamp on the
    /// file's clock.
    pub fn encode(&self, ns: u64, fixed: &[u8], tail: &[u8], into: &mut Cdr) -> Option<RosType> {
        into.clear();
        match self {
            Copier::Laser(fields) => fields.encode(ns, fixed, tail, into).map(|()| RosType::LaserScan),
            Copier::Plain(kind) => kind.encode(ns, fixed, tail, into).map(|()| *kind),
            Copier::Image => {
                let jpeg = read::<Image>(fixed)?.encoding == Encoding::Jpeg as u32;
                let kind = if jpeg { RosType::CompressedImage } else { RosType::Image };
                kind.encode(ns, fixed, tail, into).map(|()| kind)
            }
        }
    }
}

impl RosType {
    /// The message's full name.
    pub fn name(self) -> &'static str {
        match self {
            RosType::Odometry => "nav_msgs/msg/Odometry",
            RosType::Twist | RosType::Command => "geometry_msgs/msg/TwistStamped",
            RosType::Image => "sensor_msgs/msg/Image",
            RosType::CompressedImage => "sensor_msgs/msg/CompressedImage",
            RosType::LaserScan => "sensor_msgs/msg/LaserScan",
            RosType::BatteryState => "sensor_msgs/msg/BatteryState",
        }
    }

    fn encode(self, ns: u64, fixed: &[u8], tail: &[u8], into: &mut Cdr) -> Option<()> {
        match self {
            RosType::Odometry => read(fixed).map(|message| odometry(ns, &message, into)),
            RosType::Twist => read(fixed).map(|message| twist(into.header(ns, "base_link"), &message)),
            RosType::Command => {
                read::<Command>(fixed).map(|message| twist(into.header(ns, "base_link"), &message.velocity))
            }
            RosType::Image => read(fixed).map(|message| image(ns, &message, tail, into)),
            RosType::CompressedImage => {
                into.header(ns, "camera").string("jpeg").u32(tail.len() as u32).raw(tail);
                Some(())
            }
            RosType::BatteryState => read(fixed).map(|message| battery(ns, &message, into)),
            // Found by its fields' names, see `Copier::Laser`.
            RosType::LaserScan => None,
        }
    }
}

fn read<M: Message>(fixed: &[u8]) -> Option<M> {
    bytemuck::try_pod_read_unaligned(fixed).ok()
}

fn twist(into: &mut Cdr, twist: &Twist) {
    into.f64s(&[twist.linear_x_m_s, twist.linear_y_m_s, 0.0, 0.0, 0.0, twist.angular_z_rad_s]);
}

fn odometry(ns: u64, odometry: &Odometry, into: &mut Cdr) {
    let half = odometry.heading_rad / 2.0;
    into.header(ns, "odom").string("base_link");
    into.f64s(&[odometry.x_m, odometry.y_m, 0.0, 0.0, 0.0, runtime::math::sin(half), runtime::math::cos(half)]);
    into.f64s(&spatial(&odometry.pose_covariance));
    twist(into, &odometry.velocity);
    into.f64s(&spatial(&odometry.velocity_covariance));
}

/// Covariance of (x, y, rotation about z) among (x, y, z, rotation about x, y, z).
fn spatial(planar: &[f64; 9]) -> [f64; 36] {
    const PLACES: [usize; 3] = [0, 1, 5];
    let mut spatial = [0.0; 36];
    for (row, place) in PLACES.iter().enumerate() {
        for (column, other) in PLACES.iter().enumerate() {
            spatial[place * 6 + other] = planar[row * 3 + column];
        }
    }
    spatial
}

fn image(ns: u64, image: &Image, tail: &[u8], into: &mut Cdr) {
    let encoding = match image.encoding {
        mono if mono == Encoding::Mono8 as u32 => "mono8",
        rgb if rgb == Encoding::Rgb8 as u32 => "rgb8",
        bgr if bgr == Encoding::Bgr8 as u32 => "bgr8",
        _ => "yuv422_yuy2",
    };
    into.header(ns, "camera").u32(image.height_px).u32(image.width_px).string(encoding);
    into.u8(0).u32(image.step_bytes).u32(tail.len() as u32).raw(tail);
}

/// Status, health and technology as sensor_msgs/BatteryState numbers them.
const UNKNOWN: u8 = 0;
const DISCHARGING: u8 = 2;

fn battery(ns: u64, state: &BaseState, into: &mut Cdr) {
    into.header(ns, "base_link").f32(state.battery_v as f32);
    // Temperature, current, charge, capacity, design capacity: not measured.
    for _ in 0..5 {
        into.f32(f32::NAN);
    }
    into.f32(state.charge as f32).u8(DISCHARGING).u8(UNKNOWN).u8(UNKNOWN).u8(1);
    // No cells, no location, no serial number.
    into.u32(0).u32(0).string("").string("");
}
