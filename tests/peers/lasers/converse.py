"""Independent clients read our simulated lasers: hokuyolx (PyPI) over TCP, MRPT's rawlog-grabber over TCP and over a
pseudo-terminal.

    converse.py SINEW [FOLDER]      with a folder, the bytes of each conversation are kept in it
"""

import array
import contextlib
import fcntl
import gzip
import math
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import termios
import time
from pathlib import Path

from hokuyolx import HokuyoLX

from relay import Relay

HERE = Path(__file__).parent
BEAMS, SCANS = 1081, 10


def room_m(bearing_rad):
    """The distance of the wall or the post from the middle of the room of world.toml."""
    x, y = math.cos(bearing_rad), math.sin(bearing_rad)
    wall = min(4.0 / abs(x) if x else math.inf, 3.0 / abs(y) if y else math.inf)
    along, across = 2.0 * x + 1.0 * y, -2.0 * y + 1.0 * x
    if along > 0 and abs(across) < 0.2:
        return min(wall, along - math.sqrt(0.04 - across * across))
    return wall


def check_room(ranges_m, first_rad, increment_rad, worst_m):
    """Nearly all beams are where the room is; a beam in a hundred may hit an edge, or be lost."""
    off = 0
    for beam, range_m in enumerate(ranges_m):
        off += abs(range_m - room_m(first_rad + beam * increment_rad)) > worst_m
    assert off <= len(ranges_m) // 50, f"{off} of {len(ranges_m)} beams are not where the room is"


def answers(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@contextlib.contextmanager
def lasers(sinew, folder):
    """The robot with both lasers; gives where they answer."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    sick = folder / "line"
    text = (HERE / "robot.toml").read_text().replace("HOKUYO", str(port)).replace("SICK", str(sick))
    (folder / "robot.toml").write_text(text)
    shutil.copy(HERE / "world.toml", folder)
    places = {"SINEW_SHM": str(folder / "shm"), "SINEW_STATE": str(folder / "state")}
    for place in places.values():
        Path(place).mkdir()
    with open(folder / "robot.log", "wb") as log:
        robot = subprocess.Popen(
            [sinew, "run", folder, "--json", "--svg", "none"], env=os.environ | places, stdout=log, stderr=log
        )
    try:
        until = time.monotonic() + 30
        while not sick.exists() or not answers(port):
            assert robot.poll() is None and time.monotonic() < until, (folder / "robot.log").read_text()
            time.sleep(0.05)
        time.sleep(0.3)
        yield f"127.0.0.1:{port}", str(sick)
    finally:
        robot.send_signal(signal.SIGTERM)
        robot.wait(30)


def hokuyolx(address):
    relay = Relay(address)
    # A scan that a busy machine hands over 300 ms late would make it set its clock anew, in the middle of the stream.
    laser = HokuyoLX(addr=relay.address, tsync=False, info=False, activate=False, time_tolerance=3_600_000)
    count = array.array("i", [0])

    def unread():
        fcntl.ioctl(laser._sock, termios.FIONREAD, count)
        return count[0]

    try:
        relay.unread = unread
        laser.time_sync()
        laser.update_info()
        laser.activate()
        _, ranges = laser.get_dist()
        assert len(ranges) == BEAMS, len(ranges)
        check_room(ranges * 1e-3, -math.radians(135), math.radians(0.25), 0.06)
        scans = list(laser.iter_dist(SCANS))
        assert len(scans) == SCANS, f"{len(scans)} scans of {SCANS}"
        stamps = [scan[1] for scan in scans]
        assert all(a < b for a, b in zip(stamps, stamps[1:])), stamps
        # A counted stream ends with the laser off.
        laser.activate()
        _, both = laser.get_intens()
        assert len(both) == BEAMS, len(both)
    finally:
        laser.close()
        relay.close()
    print(f"hokuyolx: {BEAMS} beams where the room is, {SCANS} streamed scans, intensities")
    return relay


def grab(folder, relay, name, section, seconds):
    """Lets rawlog-grabber run and gives the scans that it has kept, as rows of metres."""
    place = folder / name
    place.mkdir()
    (place / "grab.ini").write_text(
        f"[global]\nrawlog_prefix = {place}/grabbed\ntime_between_launches = 10\nuse_sensoryframes = 0\n"
        f"[{name}]\nprocess_rate = 100\nsensorLabel = {name}\npose_x = 0\npose_y = 0\npose_z = 0\n"
        f"pose_yaw = 0\npose_pitch = 0\npose_roll = 0\n{section}"
    )
    log = place / "grab.log"
    with open(log, "wb") as words:
        grabber = subprocess.Popen(["rawlog-grabber", place / "grab.ini"], cwd=place, stdin=subprocess.PIPE, stdout=words, stderr=words)
    try:
        until = time.monotonic() + 40
        while len(relay.bytes("S>C")) < 40_000:
            assert grabber.poll() is None and time.monotonic() < until, log.read_text()[-2000:]
            time.sleep(0.1)
        time.sleep(seconds)
    finally:
        # Any key ends it.
        try:
            grabber.communicate(b"\n", timeout=15)
        except subprocess.TimeoutExpired:
            grabber.kill()
            grabber.wait()
        relay.close()
    rawlogs = list(place.glob("grabbed*.rawlog"))
    assert len(rawlogs) == 1, log.read_text()[-2000:]
    told = subprocess.run(
        ["rawlog-edit", "--export-2d-scans-txt", "-i", rawlogs[0]],
        cwd=place, capture_output=True, text=True,
    )
    assert told.returncode == 0, told.stdout + told.stderr
    # It writes beside the folder that it reads from.
    tables = list(folder.rglob(f"*grabbed*_{name}.txt"))
    assert tables, told.stdout + told.stderr + log.read_text()[-1500:]
    lines = [line.split() for line in tables[0].read_text().splitlines()]
    return [[float(word) for word in line] for line in lines if line and line[0] != "%"]


def mrpt(folder, relay, name, section, beams, first_deg, increment_deg, worst_m):
    rows = grab(folder, relay, name, section, 1.0)
    assert len(rows) >= 5, f"{name}: {len(rows)} scans"
    for row in rows:
        # The time, the ranges, and of each whether it holds.
        assert len(row) == 1 + 2 * beams, f"{name}: {len(row)} values: {row[:12]}"
        assert sum(row[1 + beams:]) >= 0.95 * beams, f"{name}: {sum(row[1 + beams:])} of {beams} hold"
        check_room(row[1:1 + beams], math.radians(first_deg), math.radians(increment_deg), worst_m)
    print(f"rawlog-grabber, {name}: {len(rows)} scans of {beams} beams where the room is")
    return relay


def main():
    sinew = Path(sys.argv[1]).resolve()
    kept = Path(sys.argv[2]) if len(sys.argv) > 2 else None
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        with lasers(sinew, folder) as (hokuyo, sick):
            relays = {"hokuyolx__ust-10lx": hokuyolx(hokuyo)}
            relay = Relay(hokuyo)
            host, port = relay.address
            section = f"driver = CHokuyoURG\nIP_DIR = {host}\nPORT_DIR = {port}\n"
            relays["mrpt__ust-10lx"] = mrpt(folder, relay, "hokuyo", section, BEAMS, -135, 0.25, 0.06)
            relay = Relay(sick)
            section = (
                f"driver = CSickLaserSerial\nCOM_port_LIN = {relay.address}\nCOM_baudRate = 38400\n"
                "mm_mode = 1\nresolution = 50\nFOV = 180\n"
            )
            relays["mrpt__lms200"] = mrpt(folder, relay, "sick", section, 361, -90, 0.5, 0.04)
    for name, relay in relays.items():
        if kept:
            (kept / f"{name}.txt.gz").write_bytes(gzip.compress(relay.text().encode(), 9, mtime=0))


main()
