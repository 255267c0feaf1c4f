"""Speed of calibration and of screening against the plain way on the same model, as ratios in one run.

    python benchmarks/calibration/calibration_speed.py [--json] [--write]

Calibration: ten stiffnesses (six springs about the axes, joint 2's two tilts, the base's two) from 1000 readings of Z
or of X, Y and Z, with white noise, kr60-3 with beam links. The plain way is ``scipy.optimize.least_squares`` (trust
region, bounds, numerical derivatives, logarithms of the stiffnesses) on ``fem.deflection`` of the model with the
numbers put in. Against it: ``doe.estimation.estimate`` with the same known noise, which is the same job; with noise and
outliers estimated too; and that with intervals, statuses and profile likelihoods. Every repeat sets out from the
readings: nothing is kept from the one before.

Screening: the runs of a Sobol study of the ten stiffnesses at 27 loaded poses, all at once against one
``fem.deflection`` of the model with the numbers put in after the other (a share of them, scaled).

The ways take turns, so that a busy machine slows all; medians of the processor time are compared. ``--write`` writes
benchmarks/calibration/results/calibration_speed.json, and its table into docs/performance/calibration.md.
"""

from __future__ import annotations

import json
import re
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from SALib.sample import sobol
from scipy.optimize import least_squares

from benchmarks.asked import asked
from doe.certainty.uncertainty import certainty
from doe.estimation.estimate import Estimate, estimate
from doe.estimation.noise import Noise
from doe.estimation.problem import Problem
from doe.planning.screening import evaluate_runs, inner
from fem import ArmModel, build_model, deflection
from fem.free.model import FreeModel, LoadedPoses
from fem.free.parameters import parameter
from robots import load_description
from robots.arrays import Array

RESULTS = Path(__file__).parent / "results" / "calibration_speed.json"
PAGE = Path(__file__).resolve().parents[2] / "docs" / "performance" / "calibration.md"
ROBOT = "kr60-3"
SPRINGS = tuple(f"j{k}" for k in range(1, 7))
NAMES = (*(f"{joint}.stiffness" for joint in SPRINGS), "j2.rx", "j2.ry", "base.rx", "base.ry")
TRUTH = np.array([2.2e6, 9e5, 1.1e6, 2e5, 1.5e5, 1e5, 3e6, 2e6, 2e7, 3e7])  # N m/rad
START = np.full(10, 1e6)
LOWER, UPPER = 1e3, 1e9
NOISE = Noise(white=(1e-5, 1e-5))  # m, rad
GAUGE = (1e-6, 1e-6)  # m, rad
READINGS = ((1000, (2,)), (1000, (0, 1, 2)), (500, (2,)), (500, (0, 1, 2)))
REPEATS, ONE_BY_ONE = 15, 200
SAMPLES, SCREENED = 1024, 27


@dataclass(frozen=True)
class Race:
    """Two ways to the same result: milliseconds (medians), their ratio, and how well they agree."""

    name: str
    fast_ms: float
    plain_ms: float
    ratio: float
    relative_difference: float


def with_numbers(model: ArmModel, values: Array) -> ArmModel:
    """The model with ten stiffnesses put in, in the order of NAMES."""
    base = np.zeros((6, 6))
    base[[3, 4], [3, 4]] = 1.0 / values[8:]
    bearing = np.zeros((6, 6))
    bearing[[3, 4], [3, 4]] = 1.0 / values[6:8]
    made = model.with_springs(dict(zip(SPRINGS, values[:6].tolist(), strict=True)))
    joints = tuple(replace(j, bearing=bearing) if j.name == "j2" else j for j in made.joints)
    return replace(made, joints=joints, base=base)


def loaded(model: ArmModel, n: int, seed: int) -> LoadedPoses:
    """Loads (n) in random directions, three in a row in one pose, beside the last axis."""
    rng = np.random.default_rng(seed)
    low, high = model.robot.limits.T
    q = np.repeat(rng.uniform(0.8 * low, 0.8 * high, (-(-n // 3), model.robot.dof)), 3, axis=0)[:n]
    force = rng.normal(size=(n, 3))
    force *= rng.uniform(150.0, 600.0, (n, 1)) / np.linalg.norm(force, axis=1, keepdims=True)
    point = model.robot.T_flange_tool[:3, 3] + np.array([0.15, 0.0, 0.1])
    return LoadedPoses(q, np.hstack([force, 0.0 * force]), np.tile(point, (n, 1)))


def readings(model: ArmModel, n: int, components: tuple[int, ...]) -> Problem:
    at = loaded(model, n, seed=1)
    free = FreeModel(model, tuple(parameter(model, name) for name in NAMES), at)
    exact = deflection(with_numbers(model, TRUTH), at.q, at.wrench, at.point)[:, components].ravel()
    value = exact + NOISE.white[0] * np.random.default_rng(2).normal(size=exact.shape)
    row, component = np.repeat(np.arange(n), len(components)), np.tile(components, n)
    pose = row // 3
    labels = tuple(f"P{k}" for k in range(int(pose.max()) + 1))
    return Problem(free, value, row, component, pose, labels, np.arange(len(value)), np.full(len(value), np.nan))


def plain(model: ArmModel, p: Problem) -> Array:
    """Stiffnesses by numerical derivatives."""
    at = p.free.at

    def residual(x: Array) -> Array:
        moved = deflection(with_numbers(model, np.exp(x)), at.q, at.wrench, at.point)
        return (p.value - moved[p.row, p.component]) / NOISE.white[0]

    bounds = (float(np.log(LOWER)), float(np.log(UPPER)))
    return np.exp(least_squares(residual, np.log(START), bounds=bounds, xtol=1e-10, ftol=1e-10).x)


def anew(p: Problem) -> Problem:
    """The same problem without anything that was worked out before."""
    return replace(p, free=replace(p.free))


def seconds(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def medians(*ways: Callable[[], object]) -> list[float]:
    """Median milliseconds of ways that take turns."""
    rounds = [[seconds(way) for way in ways] for _ in range(REPEATS)]
    return [1e3 * statistics.median(times) for times in zip(*rounds, strict=True)]


def apart(a: Array, b: Array) -> float:
    return float(np.max(np.abs(a / b - 1.0)))


def calibration(model: ArmModel, n: int, components: tuple[int, ...]) -> list[Race]:
    p = readings(model, n, components)

    def known() -> Estimate:
        return estimate(anew(p), NOISE.white, fixed_noise=NOISE, robust=False)

    def with_noise() -> Estimate:
        return estimate(anew(p), GAUGE)

    expected = plain(model, p)
    slow, *fast = medians(lambda: plain(model, p), known, with_noise, lambda: certainty(with_noise()))
    words = f"{n} readings of {'XYZ'[components[0] : components[-1] + 1]}"
    # Z does not move with joint 1, whose axis is vertical.
    seen = known().seen
    same, also = (apart(way().values[seen], expected[seen]) for way in (known, with_noise))
    rows = (("noise known", same), ("noise estimated", also), ("noise and intervals", also))
    return [Race(f"{words}, {r[0]}", t, slow, slow / t, r[1]) for r, t in zip(rows, fast, strict=True)]


def screening(model: ArmModel) -> Race:
    at = loaded(model, SCREENED, seed=3)
    parameters = tuple(parameter(model, name).between(1e5, 1e7) for name in NAMES)
    study = {"num_vars": 10, "names": list(NAMES), "bounds": [[0.0, 1.0]] * 10}
    u = inner(parameters, sobol.sample(study, SAMPLES, calc_second_order=False, seed=0))
    some = u[:: len(u) // ONE_BY_ONE][:ONE_BY_ONE]

    def at_once() -> Array:
        return evaluate_runs(FreeModel(model, parameters, at), u, 2)

    def one_by_one() -> Array:
        return np.array([deflection(with_numbers(model, 1.0 / v), at.q, at.wrench, at.point)[:, 2] for v in some])

    fast, slow = medians(at_once, one_by_one)
    exact = one_by_one()
    difference = np.abs(at_once()[:: len(u) // ONE_BY_ONE][:ONE_BY_ONE] - exact).max() / np.abs(exact).max()
    slow *= len(u) / len(some)
    return Race(f"Sobol study, {len(u)} runs", fast, slow, slow / fast, float(difference))


# What the page calls a race.
WORDS = (
    ("XYZ", "X, Y and Z"),
    ("noise estimated", "noise and outliers estimated"),
    ("noise and intervals", "and intervals"),
    ("12288 runs", "12 288 runs of 27 loaded poses"),
)


def table(races: list[Race]) -> str:
    """The rows of the page: what has 1000 readings, and the screening."""
    lines = ["| job | time, ms | plain, ms | ratio | differ |", "|---|---|---|---|---|"]
    for r in races:
        name = r.name
        for one, other in WORDS:
            name = name.replace(one, other)
        if not name.startswith("500"):
            plain, ratio = (f"{float(f'{x:.3g}'):.0f}" for x in (r.plain_ms, r.ratio))
            differ = f"{r.relative_difference:.0e}".replace("e-0", "e-")
            lines.append(f"| {name} | {r.fast_ms:.1f} | {plain} | {ratio} | {differ} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    arguments = asked(__doc__, json=False, write=False)
    model = build_model(load_description(ROBOT))
    races = [r for n, read in READINGS for r in calibration(model, n, read)] + [screening(model)]
    head = {"robot": ROBOT, "parameters": len(NAMES), "repeats": REPEATS}
    text = json.dumps({**head, "races": [asdict(r) for r in races]}, indent=2) + "\n"
    if arguments.write:
        RESULTS.write_text(text, encoding="utf-8")
        page = PAGE.read_text(encoding="utf-8")
        page = re.sub(r"^\| job \|.*\n(?:\|.*\n)+", table(races), page, flags=re.MULTILINE)
        PAGE.write_text(page, encoding="utf-8")
    if arguments.json:
        sys.stdout.write(text)
        return
    sys.stdout.write(f"{ROBOT}, beam links, {len(NAMES)} stiffnesses, medians of {REPEATS}\n")
    for r in races:
        sys.stdout.write(
            f"{r.name:44} {r.fast_ms:9.2f} ms, plain {r.plain_ms:10.1f} ms, ratio {r.ratio:7.1f}, "
            f"differ by {r.relative_difference:.1e}\n"
        )


if __name__ == "__main__":
    main()
