"""What users call: ``stiffarm.calibrate`` of a table, against scipy's least squares with numerical derivatives.

    python benchmarks/calibration/public_calibration.py [--write]

Ten stiffnesses of the kr60-3 with beam links (those of ``calibration_speed.py``) from 1000 and 20 000 set-ups, each a
pose of its own. ``calibrate`` checks the readings, finds parameters, noise, outliers and intervals, leaves every pose
out once, and writes the new arm; scipy (trust region, bounds, numerical derivatives, logarithms of the stiffnesses, on
``fem.deflection``) finds the parameters for a noise that is known. Both get what has been read already; what reading
the table takes stands beside. Processor time of all threads, least of several rounds in which the ways take turns.
``--write`` writes benchmarks/calibration/results/public_calibration.json.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from calibration_speed import LOWER, NAMES, NOISE, ROBOT, START, TRUTH, UPPER, with_numbers
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

import stiffarm as sa
from benchmarks.asked import asked
from fem import deflection

RESULTS = Path(__file__).parent / "results" / "public_calibration.json"
CASES = ((1000, "Z", 7), (1000, "XYZ", 7), (20_000, "Z", 3), (20_000, "XYZ", 3))


def seconds(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def race(arm: sa.Arm, n: int, read: str, rounds: int) -> dict[str, float]:
    """Seconds of both ways, of reading the table, the ratio, and how far the parameters are apart."""
    model, rng = arm.model, np.random.default_rng(1)
    low, high = model.robot.limits.T
    q, force = rng.uniform(0.8 * low, 0.8 * high, (n, model.robot.dof)), rng.normal(size=(n, 3))
    force *= rng.uniform(150.0, 600.0, (n, 1)) / np.linalg.norm(force, axis=1, keepdims=True)
    wrench = np.hstack([force, 0.0 * force])
    point = np.tile(model.robot.T_flange_tool[:3, 3] + [0.15, 0.0, 0.1], (n, 1))
    columns = ["XYZ".index(axis) for axis in read]
    value = deflection(with_numbers(model, TRUTH), q, wrench, point)[:, columns]
    value += NOISE.white[0] * rng.normal(size=value.shape)
    table = pd.DataFrame(np.degrees(q), columns=model.robot.coordinates)
    table["pose"] = [f"P{i}" for i in range(n)]
    table[["fx_N", "fy_N", "fz_N"]], table[["px_mm", "py_mm", "pz_mm"]] = force, 1e3 * point
    table[[f"d{axis.lower()}_mm" for axis in read]] = 1e3 * value
    readings = sa.read_readings(table, arm)

    def residual(x: np.ndarray) -> np.ndarray:
        moved = deflection(with_numbers(model, np.exp(x)), q, wrench, point)[:, columns]
        return ((value - moved) / NOISE.white[0]).ravel()

    def plain() -> np.ndarray:
        bounds = (float(np.log(LOWER)), float(np.log(UPPER)))
        return np.exp(least_squares(residual, np.log(START), bounds=bounds, xtol=1e-10, ftol=1e-10).x)

    def ours() -> sa.Calibration:
        return sa.calibrate(arm, readings, free=list(NAMES))

    expected, found = plain(), ours()
    values = np.array([np.nan if p.value is None else p.value for p in found.parameters])
    times = [(seconds(plain), seconds(ours), seconds(lambda: sa.read_readings(table, arm))) for _ in range(rounds)]
    slow, fast, reading = (min(each) for each in zip(*times, strict=True))
    return {
        "scipy_s": slow,
        "calibrate_s": fast,
        "reading_s": reading,
        "ratio": slow / fast,
        "times_as_long": fast / slow,
        "relative_difference": float(np.nanmax(np.abs(values / expected - 1.0))),
    }


def main() -> None:
    arguments = asked(__doc__, write=False)
    threadpool_limits(1)
    arm = sa.load(ROBOT)
    found = {
        f"{n} set-ups, {read}": {key: float(f"{v:.2g}") for key, v in race(arm, n, read, rounds).items()}
        for n, read, rounds in CASES
    }
    text = json.dumps({"robot": ROBOT, "parameters": len(NAMES), "cases": found}, indent=2) + "\n"
    if arguments.write:
        RESULTS.write_text(text, encoding="utf-8")
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
