"""An independent client, hokuyolx (PyPI), reads our simulated UST-10LX over TCP.

    sinew run tests/peers/scanner &
    pip install hokuyolx==0.9.0; python tests/peers/read_with_hokuyolx.py
"""

from hokuyolx import HokuyoLX

BEAMS, SCANS = 1081, 10

laser = HokuyoLX(addr=("127.0.0.1", 11940))
_, ranges = laser.get_dist()
assert len(ranges) == BEAMS, len(ranges)
# The run-up's side walls stand 2.1 m to either side of the start, their faces 0.075 m nearer.
assert 2000 < ranges[180] < 2200, ranges[180]
scans = list(laser.iter_dist(SCANS))
assert len(scans) == SCANS, len(scans)
stamps = [scan[1] for scan in scans]
assert all(a < b for a, b in zip(stamps, stamps[1:])), stamps
# A counted stream ends with the laser off.
laser.activate()
_, both = laser.get_intens()
assert len(both) == BEAMS, len(both)
laser.close()
print(f"hokuyolx: {BEAMS} beams, {SCANS} streamed scans, intensities")
