# The task that is written down in the file named first, in IR-SIM and without a display: steps of the task's length, as
# many as fit into the time.
import json
import resource
import sys
import time

with open(sys.argv[1]) as file:
    task = json.load(file)
seconds = float(sys.argv[2])

width, height = task["high"]
flow = lambda value: json.dumps(value)
lines = [
    "world:",
    f"  width: {width}",
    f"  height: {height}",
    f"  step_time: {task['step_s']}",
    "  collision_mode: 'stop'",
    "robot:",
]
for start in task["starts"]:
    lines += [
        "  - kinematics: {name: 'diff'}",
        f"    shape: {{name: 'circle', radius: {task['radius_m']}}}",
        f"    state: {flow(start)}",
        f"    goal: {flow([width / 2, height / 2, 0])}",
        f"    vel_max: {flow([task['speed_m_s'], task['turn_rad_s']])}",
        # Towards a goal that is drawn anew when it is reached: they go about as ours do.
        f"    behavior: {{name: 'dash', wander: True, range_low: [1, 1, -3.14], range_high: {flow([width - 1, height - 1, 3.14])}}}",
        "    sensors:",
        "      - name: 'lidar2d'",
        "        range_min: 0",
        f"        range_max: {task['reach_m']}",
        f"        angle_range: {task['wide_rad']}",
        f"        number: {task['rays']}",
        f"        offset: {flow(task['place'])}",
    ]
lines.append("obstacle:")
for wall in task["walls"]:
    lines.append(f"  - shape: {{name: 'linestring', vertices: {flow(wall)}}}")
for solid in task["solids"]:
    lines.append(f"  - shape: {{name: 'polygon', vertices: {flow(solid)}}}")
for x, y, radius in task["posts"]:
    lines += [f"  - shape: {{name: 'circle', radius: {radius}}}", f"    state: {flow([x, y, 0])}"]
with open("world.yaml", "w") as file:
    file.write("\n".join(lines) + "\n")

import irsim

try:
    world = irsim.make("world.yaml", display=False, log_level="ERROR")
except TypeError:
    world = irsim.make("world.yaml", display=False)
robots = world.robot_list
if len(robots) != len(task["starts"]):
    sys.exit(f"it has {len(robots)} robots instead of {len(task['starts'])}")
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
    "realtime_factor": task["step_s"] * n / wall,
    "realtime_factor_core": task["step_s"] * n / core,
    "rss_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    "threads": 1,
    "step_us": [times[n // 2], times[min(n - 1, int(n * 0.99))], times[-1]],
    "n": n,
    "first_ranges_m": [float(r) for r in robots[0].get_lidar_scan()["ranges"]],
}))
