"""Speed of the fast path against the direct stiffness assembly of the same parts, in one run.

    python benchmarks/statics/fast_path.py [--json]

100 000 random reachable poses of the xr701 with beam links, joint springs and the parallelogram. The fast
path does all of them; the direct solve, timed at the batch size it likes best, does a stated subset and is
scaled per pose. The two take turns, so that a busy machine slows both; medians are compared.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.asked import asked
from fem import ArmModel, build_model
from fem.reference import direct
from fem.statics import flexibility
from robots import Robot, load_description
from robots.arrays import Array

POSES = 100_000
SUBSET = 8_192
REPEATS = 7
BATCHES = (64, 128, 256, 512)
SPRINGS = {"j1": 2e6, "j2": 1.4e6, "j3": 0.76e6, "j4": 1.4e6, "j5": 1e6, "j6": 5e5}  # N m/rad
WRENCH = np.array([100.0, -50.0, -650.0, 10.0, 20.0, 5.0])  # N, N m


@dataclass(frozen=True)
class Race:
    """Two ways to the same result: microseconds a pose (medians), their ratio, and how well they agree."""

    name: str
    fast_us: float
    direct_us: float
    direct_batch: int
    ratio: float
    relative_difference: float


def random_poses(robot: Robot, n: int, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    q = rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (4 * n, robot.dof))
    q = q[robot.reachable(q)]
    assert len(q) >= n
    return q[:n]


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def best_batch(work: Callable[[], object]) -> int:
    """Batch size at which the direct solve is fastest here, and set it."""
    times = {}
    for size in BATCHES:
        direct.CHUNK = size
        times[size] = min(seconds(work) for _ in range(3))
    direct.CHUNK = min(times, key=lambda size: times[size])
    return direct.CHUNK


def race(name: str, fast: Callable[[Array], Array], slow: Callable[[Array], Array], q: Array) -> Race:
    some = q[:SUBSET]
    batch = best_batch(lambda: slow(some[:2048]))
    a, b = fast(some), slow(some)
    pairs = [(seconds(lambda: fast(q)), seconds(lambda: slow(some))) for _ in range(REPEATS)]
    fast_us = 1e6 * statistics.median(t for t, _ in pairs) / len(q)
    direct_us = 1e6 * statistics.median(t for _, t in pairs) / len(some)
    difference = float(np.abs(a - b).max() / np.abs(b).max())
    return Race(name, fast_us, direct_us, batch, direct_us / fast_us, difference)


def run(model: ArmModel) -> list[Race]:
    q = random_poses(model.robot, POSES, seed=0)
    return [
        race(
            "deflection",
            lambda q: flexibility.deflection(model, q, WRENCH),
            lambda q: direct.deflection(model, q, WRENCH),
            q,
        ),
        race("compliance", lambda q: flexibility.compliance(model, q), lambda q: direct.compliance(model, q), q),
    ]


def main() -> None:
    arguments = asked(__doc__, json=False)
    races = run(build_model(load_description("xr701")).with_springs(SPRINGS))
    if arguments.json:
        results = {
            r.name: {
                "fast_us_per_pose": r.fast_us,
                "direct_us_per_pose": r.direct_us,
                "direct_batch": r.direct_batch,
                "ratio": r.ratio,
                "relative_difference": r.relative_difference,
            }
            for r in races
        }
        head = {"robot": "xr701", "poses": POSES, "direct_poses": SUBSET, "repeats": REPEATS}
        json.dump({**head, **results}, sys.stdout, indent=2)
        sys.stdout.write("\n")
        return
    sys.stdout.write(f"xr701, beam links: {POSES} poses fast, {SUBSET} direct, median of {REPEATS}\n")
    for r in races:
        sys.stdout.write(
            f"{r.name:12} fast {r.fast_us:6.2f} us/pose, direct {r.direct_us:6.2f} us/pose "
            f"(batches of {r.direct_batch}), ratio {r.ratio:5.1f}, differ by {r.relative_difference:.1e}\n"
        )


if __name__ == "__main__":
    main()
