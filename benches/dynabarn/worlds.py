#!/usr/bin/env python3
"""Makes DynaBARN-like worlds from a seed: worlds.py SEED [PER_CLASS] > DIR/worlds.txt, then sinew barn --data DIR --dynamic.

The published 50 are what a planner is likely to be tuned on; these are others of the same kind. Numbers of cylinders, speeds
and turns are drawn as they lie in the published ones (read off them, nothing is copied): 5 to 14, 15 to 19 and 20 to 24
cylinders at 0.5 to 0.9, 1.0 to 1.4 and 1.5 to 1.9 m/s; each enters the yard at its border, passes some whole-metre points by
ascending or descending x on a smooth curve that is cut at every 2.22 m of x, and leaves at the border.
"""
import math
import random
import sys

CLASSES = [  # first index, cylinders, speed, way points, chance of a smooth curve
    (0, (5, 14), (0.50, 0.90), (0, 3), 0.8),
    (20, (15, 19), (1.02, 1.38), (1, 5), 0.6),
    (40, (20, 24), (1.52, 1.90), (2, 6), 0.5),
]
GRID = [-10 + 20 / 9 * k for k in range(10)]


def border(chance):
    along = chance.choice([float(chance.randint(-10, 10)), round(chance.uniform(-10, 10), 2)])
    return chance.choice([(-10.0, along), (10.0, along), (along, -10.0), (along, 10.0)])


def curve(points, smooth):
    """Points with what lies between them at the grid's x: cubic Hermite with Catmull-Rom slopes, or straight."""
    n = len(points)
    slope = []
    for k in range(n):
        (x0, y0), (x1, y1) = points[max(k - 1, 0)], points[min(k + 1, n - 1)]
        slope.append((y1 - y0) / (x1 - x0) if abs(x1 - x0) > 0.5 else 0.0)
    way = [points[0]]
    for k in range(n - 1):
        (x0, y0), (x1, y1) = points[k], points[k + 1]
        between = [x for x in GRID if min(x0, x1) + 0.05 < x < max(x0, x1) - 0.05]
        for x in between if x1 > x0 else reversed(between):
            s = (x - x0) / (x1 - x0)
            y = y0 + s * (y1 - y0)
            if smooth:
                h = x1 - x0
                y = ((1 + 2 * s) * y0 + s * h * slope[k]) * (1 - s) ** 2 + ((3 - 2 * s) * y1 + (s - 1) * h * slope[k + 1]) * s * s
            way.append((x, max(-10.0, min(10.0, y))))
        way.append((x1, y1))
    return way


def cylinder(chance, speeds, counts, smooth):
    first, last = border(chance), border(chance)
    while math.dist(first, last) < 6:
        last = border(chance)
    forward = last[0] >= first[0]
    low, high = sorted((first[0], last[0]))
    inner = [float(x) for x in range(-9, 10) if low + 0.4 < x < high - 0.4]
    xs = sorted(chance.sample(inner, min(len(inner), chance.randint(*counts))), reverse=not forward)
    points = [first] + [(x, float(chance.randint(-9, 9))) for x in xs] + [last]
    way = curve(points, chance.random() < smooth)
    speed, spread = chance.uniform(*speeds), abs(chance.gauss(0, 0.08))
    time, keys = 0.0, [(0.0, *way[0])]
    for a, b in zip(way, way[1:]):
        time += max(0.02, math.dist(a, b) / max(0.3, speed + chance.uniform(-spread, spread)))
        keys.append((time, *b))
    return keys


def main():
    seed, per_class = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 16
    for first, numbers, speeds, counts, smooth in CLASSES:
        for k in range(min(per_class, 20)):
            chance = random.Random(f"{seed} {first + k}")
            rounds = [cylinder(chance, speeds, counts, smooth) for _ in range(chance.randint(*numbers))]
            print(f"world {first + k} {len(rounds)}")
            for number, keys in enumerate(rounds):
                told = " ".join(f"{t:.2f},{x:.2f},{y:.2f}" for t, x, y in keys)
                print(f"made_{number} {keys[-1][0]:.2f} {len(keys)} {told}")


main()
