"""Reads recordings with readers that know nothing of Sinew: `mcap` with `mcap-ros2-support`, and `rosbags`.

    read.py known.mcap run.mcap info.json laser.mcap

`known.mcap` comes from the example `for_peers`: every value in it is known. `run.mcap` is any recording and `info.json`
what `sinew info --json` says about it: both readers must find the same topics, types and counts, and decode everything.
`laser.mcap` is a run of a robot with a laser: its copies for ROS 2 must say what its exact samples say.
"""

import json
import math
import sys
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader


def by_mcap(file):
    """Topic -> (type, messages), by mcap and mcap-ros2-support."""
    found = {}
    with open(file, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2", reader.get_header()
        for schema, channel, _, message in reader.iter_decoded_messages():
            assert schema.encoding == "ros2msg" and channel.message_encoding == "cdr", channel
            found.setdefault(channel.topic, (schema.name, []))[1].append(message)
    return found


def by_rosbags(file):
    """The same, by rosbags."""
    found = {}
    with AnyReader([Path(file)]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, (connection.msgtype, []))[1].append(message)
    return found


def near(one, other):
    assert math.isclose(one, other, rel_tol=1e-6, abs_tol=1e-12), (one, other)


def check_known(found, reader):
    def messages(topic, kind):
        name, messages = found[topic]
        assert name == kind, (topic, name)
        assert len(messages) == 25, (topic, len(messages))
        return messages

    for n, odometry in enumerate(messages("/ros/perception/odometry/pose", "nav_msgs/msg/Odometry")):
        near(odometry.pose.pose.position.x, n)
        near(odometry.pose.pose.position.y, -1.5)
        near(odometry.pose.pose.orientation.z, math.sin(math.pi / 4))
        near(odometry.pose.pose.orientation.w, math.cos(math.pi / 4))
        near(odometry.pose.covariance[35], 0.125)
        near(odometry.twist.twist.linear.x, 0.25)
        near(odometry.twist.twist.angular.z, -0.5)
        assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
        assert (odometry.header.stamp.sec, odometry.header.stamp.nanosec) == (n // 2, n % 2 * 500_000_000)
    for n, exact in enumerate(messages("/perception/odometry/pose", "sinew_msgs/msg/OdometryStamped")):
        near(exact.message.x_m, n)
        near(exact.message.heading_rad, math.pi / 2)
        assert (exact.sample.sequence, exact.sample.stamp_ns) == (n + 1, n * 500_000_000)
    for n, twist in enumerate(messages("/ros/coordinator/arbiter/velocity", "geometry_msgs/msg/TwistStamped")):
        near(twist.twist.linear.x, n * 0.125)
        near(twist.twist.linear.y, 0.5)
        near(twist.twist.angular.z, 2.0)
    for n, twist in enumerate(messages("/ros/motion/drive/command", "geometry_msgs/msg/TwistStamped")):
        near(twist.twist.linear.x, n)
    for battery in messages("/ros/drivers/base/state", "sensor_msgs/msg/BatteryState"):
        near(battery.voltage, 12.5)
        near(battery.percentage, 0.75)
        assert battery.present and math.isnan(battery.current) and len(battery.cell_voltage) == 0
    for n, image in enumerate(messages("/ros/drivers/camera/image", "sensor_msgs/msg/Image")):
        assert (image.height, image.width, image.step, image.encoding) == (2, 3, 9, "rgb8")
        assert bytes(image.data) == bytes(k + n for k in range(18))
    for photo in messages("/ros/drivers/camera/photo/compressed", "sensor_msgs/msg/CompressedImage"):
        assert (photo.format, bytes(photo.data)) == ("jpeg", b"\xff\xd8\xff\xd9")
    for n, scan in enumerate(messages("/ros/drivers/laser/scan", "sensor_msgs/msg/LaserScan")):
        near(scan.angle_min, -1.5)
        near(scan.angle_max, 0.5)
        near(scan.angle_increment, 0.5)
        near(scan.scan_time, 0.1)
        near(scan.range_max, 8.0)
        near(scan.ranges[0], 1.0 + n)
        assert scan.ranges[1] == math.inf and scan.ranges[2] == -math.inf and math.isnan(scan.ranges[3])
        near(scan.ranges[4], 2.5)
        assert list(scan.intensities) == [7.0] * 5
    for n, exact in enumerate(messages("/drivers/laser/scan", "sinew_msgs/msg/LaserScanStamped")):
        assert [beam.echo for beam in exact.tail] == [1, 2, 3, 6, 1]
        near(exact.tail[0].range_m, 1.0 + n)
    print(f"{reader}: all known values are right")


def check_run(found, told, reader):
    expected = {t["topic"]: (t["type"], t["count"]) for t in told["topics"] if t["count"] > 0}
    counted = {topic: (kind, len(messages)) for topic, (kind, messages) in found.items()}
    assert counted == expected, {k: (counted.get(k), expected.get(k)) for k in counted.keys() | expected.keys()
                                 if counted.get(k) != expected.get(k)}
    total = sum(count for _, count in counted.values())
    print(f"{reader}: {total} messages on {len(counted)} topics, the same types and counts as sinew info")


def check_copies(found, reader):
    """A run's copies for ROS 2 say what its exact samples say."""
    compared = {}
    for topic, (kind, copies) in found.items():
        exacts = found[topic.removeprefix("/ros")][1] if topic.startswith("/ros/") else []
        for copy, exact in zip(copies, exacts):
            if kind in COPIES:
                COPIES[kind](copy, exact)
                compared[kind] = compared.get(kind, 0) + 1
        assert not topic.startswith("/ros/") or len(copies) == len(exacts), topic
    assert {"nav_msgs/msg/Odometry", "geometry_msgs/msg/TwistStamped", "sensor_msgs/msg/LaserScan"} <= compared.keys(), compared
    assert BEAMS[0] > 10_000, BEAMS
    print(f"{reader}: copies of a run are its exact samples: " + ", ".join(f"{n} {k}" for k, n in compared.items()))


def odometry(copy, exact):
    near(copy.pose.pose.position.x, exact.message.x_m)
    near(copy.pose.pose.position.y, exact.message.y_m)
    near(2 * math.atan2(copy.pose.pose.orientation.z, copy.pose.pose.orientation.w), exact.message.heading_rad)
    near(copy.twist.twist.linear.x, exact.message.velocity.linear_x_m_s)


def twist(copy, exact):
    velocity = getattr(exact.message, "velocity", exact.message)
    near(copy.twist.linear.x, velocity.linear_x_m_s)
    near(copy.twist.angular.z, velocity.angular_z_rad_s)


def scan(copy, exact):
    near(copy.angle_min, exact.message.angle_min_rad)
    near(copy.angle_increment, exact.message.angle_increment_rad)
    # None at all before the laser's first scan has come.
    assert len(copy.ranges) == len(exact.tail)
    BEAMS[0] += len(exact.tail)
    for metres, beam in zip(copy.ranges, exact.tail):
        # See messages::Echo: a value, nothing within reach, too near, else no reading.
        expected = {1: beam.range_m, 2: math.inf, 3: -math.inf}.get(beam.echo, math.nan)
        assert metres == expected or math.isnan(metres) and math.isnan(expected), (metres, beam)


BEAMS = [0]
COPIES = {
    "nav_msgs/msg/Odometry": odometry,
    "geometry_msgs/msg/TwistStamped": twist,
    "sensor_msgs/msg/LaserScan": scan,
}


def main():
    known, run, told, laser = sys.argv[1:]
    told = json.loads(Path(told).read_text())
    for reader, read in [("mcap + mcap-ros2-support", by_mcap), ("rosbags", by_rosbags)]:
        check_known(read(known), reader)
        check_run(read(run), told, reader)
        check_copies(read(laser), reader)


main()
