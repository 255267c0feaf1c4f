"""Surrogate against the fast path, in one run: scalar stiffness at the same poses, as ratios.

Run: ``python benchmarks/surrogate_query.py [--poses N] [--json]``
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable

import numpy as np

import fem
import robots
import surrogate
from surrogate.fit import space_filling_design

REPEATS = 5


def median_seconds(*functions: Callable[[], object]) -> list[float]:
    """Median time of each function over interleaved repeats, so that a drifting machine hits all alike."""
    times: list[list[float]] = [[] for _ in functions]
    for _ in range(REPEATS):
        for spent, function in zip(times, functions, strict=True):
            start = time.perf_counter()
            function()
            spent.append(time.perf_counter() - start)
    return [statistics.median(spent) for spent in times]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=100_000)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    description = robots.load_description("xr701")
    model = fem.build_model(description).with_springs({"j2": 1.45e6, "j3": 0.80e6, "j4": 0.84e6, "j5": 1e7})
    inputs = ("q2_deg", "q3real_deg", "q4_deg", "q5_deg")
    scope = surrogate.scope_of(model.robot, robots.content_hash(description), inputs)
    trained = surrogate.train(model, scope, np.random.default_rng(0))
    Q = space_filling_design(
        scope.lower, scope.upper, options.poses, np.random.default_rng(1), density="uniform", couplings=scope.couplings
    )
    q = surrogate.full_poses(model.robot, scope, Q)
    fitted = {s.basis.name: s for s in trained.surrogates}
    fast, *others = median_seconds(
        lambda: fem.directional_stiffness(model, q),
        *(lambda s=s: surrogate.query(s, Q) for s in fitted.values()),  # type: ignore[misc]
    )
    result = {"poses": options.poses, "fast_path_us_per_pose": fast / options.poses * 1e6} | {
        f"{name}_speed_over_fast_path": fast / spent for name, spent in zip(fitted, others, strict=True)
    }
    if options.json:
        print(json.dumps(result, indent=2))
        return
    for key, value in result.items():
        print(f"{key}: {value:.3g}")


if __name__ == "__main__":
    main()
