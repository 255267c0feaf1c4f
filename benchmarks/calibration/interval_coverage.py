"""Do 95 % intervals hold the truth 95 % of the time? Calibrations of made-up readings with known parameters.

    python benchmarks/calibration/interval_coverage.py [--repeats 200] [--case NAME] [--robot NAME] [--json]
                                           [--write docs/validation/calibration_coverage.md]

Every repeat draws parameters, poses, load directions and noise anew, estimates parameters and noise, and looks
whether each interval holds what was drawn.

Springs about the joint axes are log-uniform in 1e5 to 3e6 N m/rad, tilting stiffnesses 5e5 to 5e6 N m/rad (RV
gearboxes and joints of this size), translations of joints 3e7 to 1e9 N/m (assumed), zero offsets have a standard
deviation of 0.5 deg, and springs vary by some 30 % over their angle.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np

from benchmarks.asked import asked
from doe.certainty.identifiability import trade_offs
from doe.certainty.uncertainty import Certainty, certainty
from doe.estimation.estimate import Estimate, estimate
from doe.estimation.noise import FEWEST_POSES, Noise
from doe.estimation.problem import Problem
from fem import ArmModel, build_model
from fem.free.model import FreeModel, LoadedPoses
from fem.free.parameters import FourierBasis, FreeLaw, Parameter, law_parameters, parameter
from robots import load_description
from robots.arrays import Array
from robots.constants import NORMAL_95

ROBOTS = ("xr701", "kr60-3", "tx200")
GAUGE = (1e-6, 1e-6)  # m, rad: resolution of a reading
WHITE = Noise(white=(1e-5, 2e-5))  # m, rad
SPRINGS = tuple(f"j{k}.rz" for k in range(1, 7))
ALL_STIFFNESSES = tuple(f"j{k}.{row}" for k in range(1, 7) for row in ("tx", "ty", "tz", "rx", "ry", "rz"))
ROTATION, TILT, SHIFT, ZERO, VARYING = (1e5, 3e6), (5e5, 5e6), (3e7, 1e9), np.radians(0.5), 0.3
STATUSES = ("determined", "one-sided", "at bound", "not identified")


@dataclass(frozen=True)
class Case:
    """What is read, with which scatter, and what is estimated.

    ``loads`` N, all in one direction per set-up; ``lever`` m: how far beside the last axis they act, in a direction
    drawn per set-up; ``outliers``: share of readings that are ten standard deviations off; ``known``: noise that the
    estimate takes for granted, "white" for white noise of the right size; ``law``: joint whose spring is a Fourier
    series over its angle.
    """

    name: str
    words: str
    names: tuple[str, ...] = SPRINGS
    poses: int = 20
    loads: tuple[float, ...] = (150.0, 375.0, 650.0)
    repeats: int = 2
    components: tuple[int, ...] = (0, 1, 2)
    vertical: bool = False
    lever: float = 0.15
    noise: Noise = WHITE
    outliers: float = 0.0
    robust: bool = True
    known: Noise | Literal["estimated", "white"] = "estimated"
    law: str | None = None
    robots: tuple[str, ...] = ROBOTS


SCATTER = replace(WHITE, share=0.02)
CASES = (
    Case("springs", "6 springs, X Y Z, 20 set-ups x 3 loads x 2 repeats, white noise"),
    Case(
        "36 stiffnesses",
        "all six stiffnesses of every joint, X Y Z and rotations, 60 set-ups",
        ALL_STIFFNESSES,
        poses=60,
        components=(0, 1, 2, 3, 4, 5),
        lever=0.3,
        robots=("tx200",),
    ),
    Case(
        "set-ups 1.5 %",
        "6 springs, set-ups scatter by 1.5 % of the deflection, readings by 2 %",
        noise=replace(SCATTER, pose_share=0.015),
    ),
    Case("set-ups 3 %", "6 springs, set-ups scatter by 3 %, readings by 2 %", noise=replace(SCATTER, pose_share=0.03)),
    Case("outliers", "6 springs, 2 % of the readings 10 standard deviations off, robust", outliers=0.02),
    Case("outliers, plain", "the same, all readings at full weight", outliers=0.02, robust=False),
    Case(
        "set-ups ignored",
        "set-ups scatter by 3 %, the noise is assumed white (and its size known)",
        noise=replace(WHITE, pose_share=0.03),
        known=WHITE,
        robust=False,
    ),
    Case(
        "set-ups as white",
        "set-ups scatter by 3 %, the noise is assumed white, as large as all scatter together",
        noise=replace(WHITE, pose_share=0.03),
        known="white",
        robust=False,
    ),
    Case(
        "nine readings",
        "springs 2 to 5, Z of 9 poses under one load",
        SPRINGS[1:5],
        poses=9,
        loads=(650.0,),
        repeats=1,
        components=(2,),
        vertical=True,
        noise=WHITE,
    ),
    Case(
        "nine set-ups",
        "springs 2 to 5, Z of 9 poses under one load, 3 repeats, set-ups scatter by 3 %",
        SPRINGS[1:5],
        poses=9,
        loads=(650.0,),
        repeats=3,
        components=(2,),
        vertical=True,
        noise=replace(WHITE, pose_share=0.03),
    ),
    Case(
        "law and zeros",
        "spring 2 a Fourier series, 5 springs, zero offsets of joints 2, 3 and 5",
        (*SPRINGS[:1], *SPRINGS[2:], "j2.zero", "j3.zero", "j5.zero"),
        law="j2",
    ),
)


@dataclass
class Tally:
    """Counts over the repeats of one case on one robot.

    ``together``: whether the intervals of combinations hold the truth, where parameters are seen only together.
    """

    covered: list[bool] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    statuses: dict[str, int] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)
    together: list[bool] = field(default_factory=list)

    def add(self, e: Estimate, c: Certainty, truth: Array) -> None:
        """Count one repeat."""
        for found, true in zip(c.estimates, truth, strict=True):
            self.statuses[found.status] = self.statuses.get(found.status, 0) + 1
            if found.status == "not identified":
                continue
            value = found.parameter.outer(float(true))
            self.covered.append(bool(found.interval[0] <= value <= found.interval[1]))
            if np.isfinite(found.sd):
                self.errors.append(float((found.parameter.inner(found.value) - true) / found.sd))
        if len(c.null):
            names = [q.name for q in e.problem.parameters]
            for one in (one for group in trade_offs(e, c) if group.missing for one in group.combinations):
                true = float(one.weights @ truth[[names.index(n) for n in one.names]])
                self.together.append(abs(one.value - true) < NORMAL_95 * one.sd)

    def row(self) -> dict[str, float]:
        """The row of the table."""
        n, total = len(self.covered), sum(self.statuses.values())
        share = float(np.mean(self.covered)) if n else np.nan
        return {
            "intervals": n,
            "coverage": share,
            "standard_error": standard_error(share, n),
            "bias_sd": float(np.mean(self.errors)) if self.errors else np.nan,
            **{s: self.statuses.get(s, 0) / total for s in STATUSES},
            "combinations": len(self.together),
            "coverage_of_combinations": float(np.mean(self.together)) if self.together else np.nan,
            "ms_per_fit": 1e3 * float(np.median(self.seconds)),
        }


def standard_error(share: float, n: int) -> float:
    return float(np.sqrt(share * (1.0 - share) / n)) if n else np.nan


@cache
def arm(robot: str) -> ArmModel:
    return build_model(load_description(robot))


def poses_of(model: ArmModel, n: int, rng: np.random.Generator) -> Array:
    limits = model.robot.limits
    out = np.zeros((0, model.robot.dof))
    while len(out) < n:
        q = rng.uniform(limits[:, 0], limits[:, 1], (4 * n, model.robot.dof))
        out = np.vstack([out, q[model.robot.reachable(q)]])
    return out[:n]


def drawn(p: Parameter, rng: np.random.Generator) -> float:
    """A plausible value, as the estimator's variable."""
    if p.kind.of_law:
        return float(np.log(10.0 ** rng.uniform(5.5, 6.3))) if p.index == (0,) else float(VARYING * rng.normal() / 1.5)
    if p.kind.shifts == "zero":
        return float(ZERO * rng.normal())
    low, high = ROTATION if p.index == (5,) else (TILT if p.index[0] > 2 else SHIFT)
    return p.inner(float(low * (high / low) ** rng.uniform()))


def free_model(model: ArmModel, case: Case, at: LoadedPoses) -> FreeModel:
    parameters, laws = [parameter(model, name) for name in case.names], []
    if case.law is not None:
        basis = FourierBasis(model.robot.joint_names.index(case.law), 1)
        laws.append(FreeLaw(case.law, basis, len(parameters)))
        parameters += law_parameters(model, case.law, basis)
    return FreeModel(model, tuple(parameters), at, tuple(laws))


def made_up(robot: str, case: Case, seed: int) -> tuple[Problem, Array]:
    """Readings with noise, and the true variables (p,)."""
    rng = np.random.default_rng([seed, *case.name.encode()])
    model = arm(robot)
    q, n = poses_of(model, case.poses, rng), case.poses
    pose, load, _ = (a.ravel() for a in np.indices((n, len(case.loads), case.repeats)))
    way = np.tile([0.0, 0.0, -1.0], (n, 1)) if case.vertical else rng.normal(size=(n, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    angle = rng.uniform(0.0, 2.0 * np.pi, n)
    lever = case.lever * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    force = way[pose] * np.array(case.loads)[load, None]
    points = model.robot.T_flange_tool[:3, 3] + lever[pose]
    free = free_model(model, case, LoadedPoses(q[pose], np.hstack([force, 0.0 * force]), points))
    truth = np.array([drawn(p, rng) for p in free.parameters])
    components = np.array(case.components)
    row, component = np.repeat(np.arange(len(pose)), len(components)), np.tile(components, len(pose))
    group = np.unique((len(case.loads) * pose + load)[row] * 6 + component, return_inverse=True)[1]
    exact = free.evaluate(truth)[0][row, component]
    p = Problem(
        free, exact, row, component, pose[row], tuple(f"P{k}" for k in range(n)), group, np.full(len(row), np.nan)
    )
    return replace(p, value=exact + scatter(p, exact, case, rng)), truth


def scatter(p: Problem, f: Array, case: Case, rng: np.random.Generator) -> Array:
    common, sd = case.noise.common(p, f), np.sqrt(case.noise.variance(p, f))
    draw = rng.normal(size=(len(p.poses), 6, 2))[p.pose, p.component]
    out = rng.normal(size=len(p)) * sd + np.sum(common * draw, axis=1)
    bad = rng.random(len(p)) < case.outliers
    return np.asarray(out + bad * 10.0 * sd * rng.choice([-1.0, 1.0], len(p)))


def known_noise(p: Problem, truth: Array, case: Case) -> Noise | None:
    if isinstance(case.known, Noise):
        return case.known
    if case.known == "estimated":
        return None
    f = p.evaluate(truth)[0]
    variance = case.noise.variance(p, f) + np.sum(case.noise.common(p, f) ** 2, axis=1)
    sd = [float(np.sqrt(variance[mine].mean())) if mine.any() else 1.0 for mine in (p.component < 3, p.component >= 3)]
    return Noise((sd[0], sd[1]))


def study(robot: str, case: Case, repeats: int, progress: Callable[[int], None] | None = None) -> Tally:
    """Coverage of one case on one robot; the same for the same number of repeats."""
    tally = Tally()
    for seed in range(repeats):
        p, truth = made_up(robot, case, seed)
        start = time.process_time()
        e = estimate(p, GAUGE, fixed_noise=known_noise(p, truth, case), robust=case.robust)
        c = certainty(e)
        tally.seconds.append(time.process_time() - start)
        tally.add(e, c, truth)
        if progress is not None:
            progress(seed + 1)
    return tally


# The section on `calibrate` itself: command_coverage.py made its figures.
COMMAND = Path(__file__).with_name("command_coverage_page.md")
HEADING = """# Coverage of calibration intervals

<!-- figures from: docs/validation/calibration_coverage.md -->
The estimator's 95 % intervals, with the noise estimated together with the scatter between set-ups, contain the true
value in 92 to 97 % of the estimator's cases below (standard errors of 0.4 to 0.9 %), and the estimates have hardly any
bias. If set-ups scatter and the noise model leaves this out, they contain it in only 14 to 18 %; if that scatter is
treated as white noise, in 56 to 61 %. All readings are simulated; real ones also contain errors of the model.

{command}## What the estimator covers

Written by `python benchmarks/calibration/interval_coverage.py --repeats {repeats} --write
docs/validation/calibration_coverage.md`.

The calibrations use simulated readings whose parameters are known, and count how often the 95 % intervals contain them.
Every repeat draws new parameters, poses, load directions and noise. Springs about the joint axes are drawn log-uniform
from 1e5 to 3e6 N m/rad, tilting stiffnesses from 5e5 to 5e6 N m/rad, translations of joints from 3e7 to 1e9 N/m,
zero offsets with a standard deviation of 0.5 deg. Noise and parameters are estimated together, from a start that
knows neither, except where the table states the noise that was assumed. White noise is {white:.0f} um and
{turn:.0f} urad.

*Coverage*: share of the intervals that contain the true value, with its binomial standard error; parameters that are
"not identified" have no interval. An interval with an open end counts like any other. *Bias*: mean error in standard
deviations of the estimate. *Time*: of one fit with intervals, one thread, median.

| robot | case | intervals | coverage, % | bias, sd | determined, % | one-sided | at bound | not identified | time, ms |
|---|---|---|---|---|---|---|---|---|---|
"""


def table(results: list[tuple[str, Case, dict[str, float]]], repeats: int) -> str:
    """The page: what was done, the table, what the cases are, what to know about them."""
    command = COMMAND.read_text(encoding="utf-8")
    out = [HEADING.format(command=command, repeats=repeats, white=1e6 * WHITE.white[0], turn=1e6 * WHITE.white[1])]
    for robot, case, r in results:
        shares = " | ".join(f"{100.0 * r[s]:.0f}" for s in STATUSES)
        out.append(
            f"| {robot} | {case.name} | {r['intervals']:.0f} | {100.0 * r['coverage']:.1f} +- "
            f"{100.0 * r['standard_error']:.1f} | {r['bias_sd']:+.2f} | {shares} | {r['ms_per_fit']:.0f} |\n"
        )
    out.append("\nThe cases:\n\n")
    for case in {case.name: case for _, case, _ in results}.values():
        out.append(f"- **{case.name}**: {case.words}.\n")
    for robot, case, r in results:
        if r["combinations"]:
            share, n = r["coverage_of_combinations"], int(r["combinations"])
            out.append(
                f"\nOf the {len(case.names)} stiffnesses ({robot}) most are seen only in combination; "
                f"{n / repeats:.0f} combinations of them are determined in every repeat, and their intervals "
                f"contain the true value in {100.0 * share:.1f} +- {100.0 * standard_error(share, n):.1f} %.\n"
            )
    return "".join([*out, NOTES.format(fewest=FEWEST_POSES)])


NOTES = """
What to know about them:

- **The noise model must include the scatter between set-ups.** If set-ups scatter by 3 % and the noise is assumed to
  be the gauge's alone, about 15 % of the intervals contain the true value. White noise as large as all scatter
  together does not help: about 60 %. Six readings of one set-up share its error, so they are not six independent
  readings. `calibrate` estimates this scatter if there are {fewest} poses with several readings of one component
  each, and says how much narrower the intervals would be without it. If the readings cannot determine it, `calibrate`
  says so.
- **Outliers.** With robust weights the intervals are right and stay narrow. At full weight they are right too, because
  outliers as evenly spread as these count as more noise, but they are wider: fewer parameters have both limits.
- **Nine readings** of four springs leave five degrees of freedom. The search for outliers costs a little there: among
  so few, a good reading at two or three standard deviations is sometimes taken for an outlier, and the estimated
  noise is then too small. Over 400 repeats the case gives 93.9 to 94.9 +- 0.6 %, with `--no-robust` 94.8 to 95.2 +-
  0.6 %; the rest is chance, because the intervals of one repeat share its noise.
- **Nine set-ups** are above 95 %, because a variance estimated as zero still counts as uncertain: with so few set-ups,
  readings can hardly show which kind of scatter there is (`doe/certainty/uncertainty.py`).
- **Open ends and bounds.** Stiffnesses cannot be negative, and an interval that is open towards rigid is certain to
  contain a very stiff joint; cases with many of them lie above 95 %.
- **All six stiffnesses of every joint.** Loads at one end of the arm turn its joints in similar ways, so most of the
  36 stiffnesses are seen only in combination. They are not identified and have no interval; the combinations are
  identified, and their intervals are counted below the cases.
- **Laws and zeros** are not linear: their intervals come from the profile likelihood, which takes most of the time.
"""


def main() -> None:
    arguments = asked(__doc__, repeats=200, case=[case.name for case in CASES], robot=[*ROBOTS], write=Path, json=False)
    results = []
    for case in CASES:
        for robot in case.robots:
            if (arguments.case and case.name not in arguments.case) or (
                arguments.robot and robot not in arguments.robot
            ):
                continue
            r = study(robot, case, arguments.repeats).row()
            results.append((robot, case, r))
            sys.stderr.write(
                f"{robot:8} {case.name:18} {100.0 * r['coverage']:5.1f} +- {100.0 * r['standard_error']:.1f} %\n"
            )
    if arguments.json:
        rows = [{"robot": robot, "case": case.name, **r} for robot, case, r in results]
        json.dump({"repeats": arguments.repeats, "rows": rows}, sys.stdout, indent=2)
        sys.stdout.write("\n")
    page = table(results, arguments.repeats)
    if arguments.write:
        arguments.write.write_text(page)
    elif not arguments.json:
        sys.stdout.write(page)


if __name__ == "__main__":
    main()
