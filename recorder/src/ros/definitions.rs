//! The definitions of the ROS 2 messages that are written, without their comments (common_interfaces,
//! rcl_interfaces).

use super::RosType;

const HEADER: (&str, &str) = ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n");
const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
const VECTOR3: (&str, &str) = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
const POINT: (&str, &str) = ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n");
const QUATERNION: (&str, &str) = ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n");
const POSE: (&str, &str) =
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n");
const TWIST: (&str, &str) = ("geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n");
const POSE_COVARIANCE: (&str, &str) =
    ("geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n");
const TWIST_COVARIANCE: (&str, &str) =
    ("geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist\nfloat64[36] covariance\n");

const ODOMETRY: &str = "std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist
";
const TWIST_STAMPED: &str = "std_msgs/Header header
geometry_msgs/Twist twist
";
const IMAGE: &str = "std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
";
const COMPRESSED_IMAGE: &str = "std_msgs/Header header
string format
uint8[] data
";
const LASER_SCAN: &str = "std_msgs/Header header
float32 angle_min
float32 angle_max
float32 angle_increment
float32 time_increment
float32 scan_time
float32 range_min
float32 range_max
float32[] ranges
float32[] intensities
";
const BATTERY_STATE: &str = "uint8 POWER_SUPPLY_STATUS_UNKNOWN=0
uint8 POWER_SUPPLY_STATUS_CHARGING=1
uint8 POWER_SUPPLY_STATUS_DISCHARGING=2
uint8 POWER_SUPPLY_STATUS_NOT_CHARGING=3
uint8 POWER_SUPPLY_STATUS_FULL=4
uint8 POWER_SUPPLY_HEALTH_UNKNOWN=0
uint8 POWER_SUPPLY_TECHNOLOGY_UNKNOWN=0
std_msgs/Header header
float32 voltage
float32 temperature
float32 current
float32 charge
float32 capacity
float32 design_capacity
float32 percentage
uint8 power_supply_status
uint8 power_supply_health
uint8 power_supply_technology
bool present
float32[] cell_voltage
float32[] cell_temperature
string location
string serial_number
";

/// The definition of incidents: what the supervisor reports, as a sentence and as its JSON.
pub(crate) const INCIDENT: &str = "# What went wrong, as the supervisor reports it
uint64 stamp_ns # on the robot's clock [ns]
string node
string event
string message
string json
";
/// Name of the incidents' type.
pub(crate) const INCIDENT_TYPE: &str = "sinew_msgs/msg/Incident";

/// The message's definition, with those of all that it is made of.
pub fn definition(kind: RosType) -> String {
    let (own, parts): (&str, &[(&str, &str)]) = match kind {
        RosType::Odometry => {
            (ODOMETRY, &[HEADER, TIME, POSE_COVARIANCE, POSE, POINT, QUATERNION, TWIST_COVARIANCE, TWIST, VECTOR3])
        }
        RosType::Twist | RosType::Command => (TWIST_STAMPED, &[HEADER, TIME, TWIST, VECTOR3]),
        RosType::Image => (IMAGE, &[HEADER, TIME]),
        RosType::CompressedImage => (COMPRESSED_IMAGE, &[HEADER, TIME]),
        RosType::LaserScan => (LASER_SCAN, &[HEADER, TIME]),
        RosType::BatteryState => (BATTERY_STATE, &[HEADER, TIME]),
    };
    let mut text = own.to_owned();
    for (name, body) in parts {
        text.push_str(&format!("{}\nMSG: {name}\n{body}", "=".repeat(80)));
    }
    text
}
