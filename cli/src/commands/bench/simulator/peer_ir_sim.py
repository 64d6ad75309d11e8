# 50 robots with 180 beams each in IR-SIM, no display: steps of 0.1 s, as many as fit into the time.
import json
import os
import resource
import sys
import time

WORLD = """
world:
  height: 50
  width: 50
  step_time: 0.1
  collision_mode: 'stop'
robot:
  - number: 50
    distribution: {name: 'random', range_low: [2, 2, -3.14], range_high: [48, 48, 3.14]}
    kinematics: {name: 'diff'}
    shape: {name: 'circle', radius: 0.22}
    behavior: {name: 'dash'}
    goal: [25, 25, 0]
    sensors:
      - name: 'lidar2d'
        range_min: 0
        range_max: 10
        angle_range: 3.14
        number: 180
obstacle:
  - shape: {name: 'linestring', vertices: [[0, 0], [50, 0], [50, 50], [0, 50], [0, 0]]}
"""

seconds = float(sys.argv[1])
with open("world.yaml", "w") as file:
    file.write(WORLD)
import irsim

try:
    world = irsim.make("world.yaml", display=False, log_level="ERROR")
except TypeError:
    world = irsim.make("world.yaml", display=False)
world.step()
times = []
begin, begin_core = time.perf_counter(), time.process_time()
while len(times) < 5 or time.perf_counter() - begin < seconds:
    before = time.perf_counter()
    world.step()
    times.append((time.perf_counter() - before) * 1e6)
wall, core = time.perf_counter() - begin, time.process_time() - begin_core
times.sort()
n = len(times)
print(json.dumps({
    "realtime_factor": 0.1 * n / wall,
    "realtime_factor_core": 0.1 * n / core,
    "rss_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    "threads": 1,
    "step_us": [times[n // 2], times[min(n - 1, int(n * 0.99))], times[-1]],
    "n": n,
}))
