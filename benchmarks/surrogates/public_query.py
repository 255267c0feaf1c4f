"""What users call: ``Surrogate.query`` of a data frame, with error bars, against scikit-learn's pipeline without any.

    python benchmarks/surrogates/public_query.py [--write]

The kr60-3 with beam links, compliance along -Z over four joint angles: the sixth-degree polynomial, the same of a
calibrated arm (whose parameters widen the bars), and the factored basis, which is exact. The pipeline is the one of
``surrogate_query.py``: the same terms, fitted to as many runs, ``predict`` without any error bar. Processor time of all
threads, least of several rounds in which the ways take turns; memory is the peak of what Python and numpy
allocate during one query. ``--write`` writes benchmarks/surrogates/results/public_query.json.
"""

from __future__ import annotations

import json
import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import MinMaxScaler, PolynomialFeatures
from threadpoolctl import threadpool_limits

import stiffarm as sa
from benchmarks.asked import asked
from fem import deflection

RESULTS = Path(__file__).parent / "results" / "public_query.json"
ROBOT, DEGREE, RUNS, ROUNDS = "kr60-3", 6, 4096, 9
POSES, MANY = 100_000, 1_000_000
SPRINGS = {"j1": 2.2e6, "j2": 9e5, "j3": 1.1e6, "j4": 2e5, "j5": 1.5e5}  # N m/rad


def calibrated(arm: sa.Arm) -> sa.Arm:
    """The arm with five springs from 60 set-ups of X, Y and Z, with a gauge's noise of 10 um."""
    rng, model = np.random.default_rng(1), arm.model.with_springs(SPRINGS)
    low, high = model.robot.limits.T
    q, force = rng.uniform(0.8 * low, 0.8 * high, (60, 6)), rng.uniform(-400.0, 400.0, (60, 3))
    moved = deflection(model, q, np.hstack([force, 0.0 * force]))[:, :3] + 1e-5 * rng.normal(size=(60, 3))
    table = pd.DataFrame(np.degrees(q), columns=model.robot.coordinates)
    table[["fx_N", "fy_N", "fz_N"]], table[["dx_mm", "dy_mm", "dz_mm"]] = force, 1e3 * moved
    table["pose"] = [f"P{i}" for i in range(60)]
    return sa.calibrate(arm, sa.read_readings(table, arm), free=[f"{name}.stiffness" for name in SPRINGS]).arm


def seconds(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def poses(surrogate: sa.Surrogate, n: int) -> pd.DataFrame:
    low, high = np.degrees(surrogate.learned.lower), np.degrees(surrogate.learned.upper)
    Q = np.random.default_rng(0).uniform(low, high, (n, len(low)))
    return pd.DataFrame(Q, columns=surrogate.learned.inputs)


def race(surrogate: sa.Surrogate) -> dict[str, float]:
    """Answers a second of both ways, their ratio, bytes a pose, and answers a second with singularities."""
    few, many = poses(surrogate, POSES), poses(surrogate, MANY)
    training = few.to_numpy()[:RUNS]
    pipeline = make_pipeline(MinMaxScaler((-1, 1)), PolynomialFeatures(DEGREE), LinearRegression())
    pipeline.fit(training, surrogate.query(few.iloc[:RUNS]).values)
    Q = few.to_numpy()
    surrogate.query(few)
    rounds = [
        (
            seconds(lambda: pipeline.predict(Q)),
            seconds(lambda: surrogate.query(few)),
            seconds(lambda: surrogate.query(many)),
        )
        for _ in range(ROUNDS)
    ]
    plain, ours, bulk = (min(times) for times in zip(*rounds, strict=True))
    slow = seconds(lambda: surrogate.query(few, singularity=True))
    tracemalloc.start()
    surrogate.query(few)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return {
        "pipeline_million_per_s": 1e-6 * POSES / plain,
        "query_million_per_s": 1e-6 * POSES / ours,
        "query_of_a_million_poses_million_per_s": 1e-6 * MANY / bulk,
        "ratio": plain / ours,
        "bytes_a_pose": peak / POSES,
        "query_with_singularity_million_per_s": 1e-6 * POSES / slow,
    }


def main() -> None:
    arguments = asked(__doc__, write=False)
    threadpool_limits(1)
    arm = sa.load(ROBOT)
    inputs = ["q2_deg", "q3_deg", "q4_deg", "q5_deg"]
    cases = {
        "polynomial": sa.fit(arm, inputs=inputs, basis="polynomial", degree=DEGREE, runs=RUNS),
        "polynomial, calibrated arm": sa.fit(
            calibrated(arm), inputs=inputs, basis="polynomial", degree=DEGREE, runs=RUNS
        ),
        "factored": sa.fit(arm, inputs=inputs, basis="factored", runs=RUNS),
    }
    found = {name: {key: float(f"{v:.3g}") for key, v in race(one).items()} for name, one in cases.items()}
    text = json.dumps({"robot": ROBOT, "poses": POSES, "rounds": ROUNDS, "cases": found}, indent=2) + "\n"
    if arguments.write:
        RESULTS.write_text(text, encoding="utf-8")
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
