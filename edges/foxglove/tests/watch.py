"""Watches robots through `sinew live` with a client that knows nothing of Sinew: PyPI `websockets`, the protocol's JSON
and bytes by hand, `mcap-ros2-support` and `rosbags` to decode.

    watch.py SINEW KNOWN.mcap FOLDER

`KNOWN.mcap` comes from the recorder's example `for_peers`: every value in it is known. It is played, served and watched;
every message must have the recording's bytes. Then the built-in robot is run, recorded, served and watched at the same
time: what was watched must be in the recording, byte for byte, and what `sinew cat` prints.
"""

import asyncio
import json
import math
import os
import signal
import struct
import subprocess
import sys
from pathlib import Path

import websockets
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

SAMPLES = 25
sinew, known, folder = sys.argv[1:]
os.environ.update(SINEW_SHM=f"{folder}/shm", SINEW_STATE=f"{folder}/state", NO_COLOR="1")


def start(*arguments):
    return subprocess.Popen([sinew, *arguments], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def end(process):
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 0, (process.args, process.returncode, out)
    return out


def wait_for(path):
    """Until a robot has its folder, which is empty at first."""
    while not Path(path).is_dir() or not any(Path(path).iterdir()):
        assert not TIMEOUT.is_over(), f"{path} did not come"
        os.sched_yield()


class TIMEOUT:
    END = None

    @staticmethod
    def is_over():
        import time
        TIMEOUT.END = TIMEOUT.END or time.monotonic() + 120
        return time.monotonic() > TIMEOUT.END


class Client:
    """A subscriber of everything."""

    def __init__(self, url):
        self.url, self.channels, self.messages, self.info, self.statuses = url, {}, [], None, []

    async def watch(self, enough, say=None):
        async with websockets.connect(self.url, subprotocols=["foxglove.sdk.v1"], max_size=None, close_timeout=0.5) as socket:
            assert socket.subprotocol == "foxglove.sdk.v1"
            if say:
                await socket.send(json.dumps(say))
            async with asyncio.timeout(90):
                async for message in socket:
                    if isinstance(message, str):
                        await self.told(socket, json.loads(message))
                    else:
                        self.took(message)
                    if enough(self):
                        return

    async def told(self, socket, what):
        if what["op"] == "serverInfo":
            self.info = what
        elif what["op"] == "advertise":
            for channel in what["channels"]:
                self.channels[channel["id"]] = channel
            wanted = [{"id": c["id"], "channelId": c["id"]} for c in what["channels"]]
            await socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        elif what["op"] == "status":
            self.statuses.append(what)

    def took(self, message):
        kind, subscription, log_ns = struct.unpack_from("<BIQ", message)
        assert kind == 1, kind
        self.messages.append((self.channels[subscription]["topic"], log_ns, message[13:]))

    def counts(self):
        counts = {}
        for topic, _, _ in self.messages:
            counts[topic] = counts.get(topic, 0) + 1
        return counts


class Decoders:
    """Each message by two decoders that know the definition from the server alone; both must agree."""

    def __init__(self, channels):
        self.by_mcap, self.by_rosbags, self.types = {}, {}, {}
        store = get_typestore(Stores.EMPTY)
        factory = DecoderFactory()
        for channel in channels.values():
            name, text = channel["schemaName"], channel["schema"]
            schema = Schema(id=channel["id"], data=text.encode(), encoding=channel["schemaEncoding"], name=name)
            self.by_mcap[channel["topic"]] = factory.decoder_for(channel["encoding"], schema)
            types = get_types_from_msg(text, name)
            store.register({kind: parts for kind, parts in types.items() if kind not in store.types})
            self.types[channel["topic"]] = name
        self.store = store

    def decode(self, topic, data):
        one, other = self.by_mcap[topic](data), self.store.deserialize_cdr(data, self.types[topic])
        compare(one, other, topic)
        return one


def compare(one, other, where):
    """The same values, whatever classes two decoders put them in."""
    if hasattr(one, "__slots__") and not isinstance(one, (str, bytes, int, float)):
        for slot in one.__slots__:
            compare(getattr(one, slot), getattr(other, slot), f"{where}.{slot}")
    elif isinstance(one, (str, bool)):
        assert one == other, (where, one, other)
    elif isinstance(one, (int, float)):
        assert one == other or math.isnan(one) and math.isnan(other), (where, one, other)
    else:
        assert len(one) == len(other), (where, one, other)
        for k, (a, b) in enumerate(zip(one, other)):
            compare(a, b, f"{where}[{k}]")


def recorded(file):
    """Topic -> (type, definition, messages' bytes)."""
    topics = {}
    with open(file, "rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            entry = topics.setdefault(channel.topic, (schema.name, schema.data.decode(), channel.metadata, []))
            entry[3].append(message.data)
    return topics


def serve(robot, *more):
    server = start("live", robot, "--port", "0", "--json", *more)
    told = json.loads(server.stdout.readline())
    assert told["event"] == "serving" and told["robot"] == robot, told
    return server, told


def check_manners(server, told):
    """It listens on this machine's own address alone, reads the robot's memory only, and has no priority."""
    port = f"{told['port']:04X}"
    sockets = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    listening = [fields[1] for fields in sockets if fields[3] == "0A" and fields[1].endswith(f":{port}")]
    assert listening == [f"0100007F:{port}"], listening
    sixth = [line.split() for line in Path("/proc/net/tcp6").read_text().splitlines()[1:]]
    assert not [f for f in sixth if f[3] == "0A" and f[1].endswith(f":{port}")], "it listens on IPv6 too"
    maps = [line for line in Path(f"/proc/{server.pid}/maps").read_text().splitlines() if folder in line]
    assert len(maps) > 5 and all(line.split()[1].startswith("r-") for line in maps), maps
    for thread in os.listdir(f"/proc/{server.pid}/task"):
        assert os.sched_getscheduler(int(thread)) == os.SCHED_OTHER
    return len(maps)


def info_and_rest(data):
    return struct.unpack_from("<QQQ", data, 4), data[28:]


def watch_known():
    recording = recorded(known)
    player = start("play", known, "--name", "ghost", "--loop", "--rate", "4", "--json")
    wait_for(f"{folder}/shm/ghost")
    server, told = serve("ghost")
    maps = check_manners(server, told)
    client = Client(told["url"])
    wanted = set(recording)
    asyncio.run(client.watch(lambda c: c.counts().keys() == wanted and min(c.counts().values()) > 2 * SAMPLES))
    assert client.info["capabilities"] == [] and client.info["metadata"]["robot"] == "ghost", client.info
    decoders = Decoders(client.channels)
    for channel in client.channels.values():
        kind, definition, _, _ = recording[channel["topic"]]
        assert (channel["schemaName"], channel["schema"]) == (kind, definition), channel
        assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg"), channel
    # The number of a sample of an own topic, by its time: copies carry the time alone.
    numbers = {}
    for topic, log_ns, data in client.messages:
        if not topic.startswith("/ros/"):
            (_, sequence, _), rest = info_and_rest(data)
            numbers[topic, log_ns] = (sequence - 1) % SAMPLES
            _, known_rest = info_and_rest(recording[topic][3][(sequence - 1) % SAMPLES])
            assert rest == known_rest, (topic, sequence)
    values = {}
    for topic, log_ns, data in client.messages:
        own = topic.removeprefix("/ros").removesuffix("/compressed")
        n = numbers.get((own, log_ns))
        message = decoders.decode(topic, data)
        if n is not None and topic.startswith("/ros/"):
            values.setdefault(topic, []).append((n, message))
            assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == log_ns, topic
    check_values(values)
    refused = asyncio.run(refusals(told["url"]))
    end(player)
    out, _ = server.communicate(timeout=60)
    assert server.returncode == 0 and json.loads(out)["event"] == "over", out
    print(f"foxglove.sdk.v1: {len(client.messages)} messages on {len(client.channels)} topics have the recording's bytes; "
          f"two decoders agree on every value; {maps} maps, all read-only; {refused}")


def check_values(values):
    def near(one, other):
        assert math.isclose(one, other, rel_tol=1e-6, abs_tol=1e-12), (one, other)

    def of(topic, kind):
        assert len(values[topic]) > SAMPLES, (topic, len(values[topic]))
        return [(n, message) for n, message in values[topic] if kind in type(message).__name__ or True]

    for n, scan in of("/ros/drivers/laser/scan", "LaserScan"):
        near(scan.angle_min, -1.5)
        near(scan.ranges[0], 1.0 + n)
        assert scan.ranges[1] == math.inf and scan.ranges[2] == -math.inf and math.isnan(scan.ranges[3])
        assert list(scan.intensities) == [7.0] * 5
    for n, odometry in of("/ros/perception/odometry/pose", "Odometry"):
        near(odometry.pose.pose.position.x, n)
        near(odometry.pose.pose.orientation.z, math.sin(math.pi / 4))
        near(odometry.twist.twist.angular.z, -0.5)
    for n, twist in of("/ros/coordinator/arbiter/velocity", "TwistStamped"):
        near(twist.twist.linear.x, n * 0.125)
    for n, image in of("/ros/drivers/camera/image", "Image"):
        assert (image.height, image.width, image.encoding) == (2, 3, "rgb8")
        assert bytes(image.data) == bytes(k + n for k in range(18))
    for _, battery in of("/ros/drivers/base/state", "BatteryState"):
        near(battery.voltage, 12.5)


async def refusals(url):
    """A client of the protocol's old name is refused; one that wants to publish is told so."""
    try:
        async with websockets.connect(url, subprotocols=["foxglove.websocket.v1"]):
            raise AssertionError("a client of the old protocol was let in")
    except websockets.exceptions.InvalidStatus as refusal:
        status = refusal.response.status_code
    client = Client(url)
    publish = {"op": "advertise", "channels": [{"id": 1, "topic": "/motion/drive/command", "encoding": "cdr",
                                                "schemaName": "geometry_msgs/msg/Twist"}]}
    await client.watch(lambda c: c.statuses, say=publish)
    return f"the old protocol gets {status}, a publisher «{client.statuses[0]['message']}»"


def watch_run():
    file = f"{folder}/run.mcap"
    run = start("run", "--name", "watched", "--json", "--svg", "none", "--record", file)
    for line in run.stdout:
        if json.loads(line).get("nodes_up") == 8:
            break
    server, told = serve("watched")
    client = Client(told["url"])
    asyncio.run(client.watch(lambda c: c.counts().get("/drivers/base/odometry", 0) >= 40))
    path = "/perception/odometry/pose"
    printed = subprocess.run([sinew, "cat", path, "--history", "64", "--json", "--robot", "watched"],
                             capture_output=True, text=True, check=True).stdout
    run.send_signal(signal.SIGINT)
    run.communicate(timeout=120)
    server.communicate(timeout=60)
    assert server.returncode == 0
    recording = recorded(file)
    held = {(topic, info_and_rest(data)[0][1]): data for topic, (_, _, _, datas) in recording.items()
            if not topic.startswith("/ros/") and topic != "/supervisor/incidents" for data in datas}
    decoders = Decoders(client.channels)
    compared = copies = 0
    seen = {}
    for topic, _, data in client.messages:
        message = decoders.decode(topic, data)
        if topic.startswith("/ros/") or topic == "/supervisor/incidents":
            copies += 1
            continue
        (_, sequence, _), _ = info_and_rest(data)
        assert data == held[topic, sequence], (topic, sequence)
        compared += 1
        if topic == path:
            seen[sequence] = message.message
    both = 0
    for line in printed.splitlines():
        sample = json.loads(line)
        if sample["sequence"] in seen:
            message = seen[sample["sequence"]]
            assert (sample["message"]["x_m"], sample["message"]["heading_rad"]) == (message.x_m, message.heading_rad)
            both += 1
    assert both > 10 and compared > 500, (both, compared)
    print(f"a running robot: {compared} watched samples are in its recording byte for byte, {both} are what sinew cat "
          f"prints; {copies} copies for ROS 2")


watch_known()
watch_run()
