"""Do predictive intervals and the promises of `plan` hold where something is hidden? For docs/validation/forecasts.md.

``--only left-out > benchmarks/calibration/results/left_out.txt`` keeps the first table's figures (five minutes),
``--only plans > benchmarks/calibration/results/plans.txt`` those of promises on the test's arms (seven).

Readings are made by the independent world (package `rehearsal`): springs up to twice as soft or stiff as the model's,
bent links, wrong zeros and weights, noise of 3 % and 3 um, and an effect drawn from all that the arm can have; the
model that is calibrated knows nothing of it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.asked import asked
from doe import Measurements, bundled_data, read_measurements, write_measurements
from doe.certainty.left_out import leave_one_pose_out
from doe.certainty.predictive import Coverage
from doe.certainty.uncertainty import ParameterEstimate, certainty
from doe.estimation.estimate import estimate
from doe.estimation.problem import problem
from doe.planning.forecast import WITHIN
from doe.planning.protocol import new_labels, table_to_fill
from doe.tables.joined import join
from fem.arm import Arm
from fem.free.parameters import parameter
from rehearsal import World
from robots import ModelDescription, load_description
from stiffarm import load
from stiffarm.commands.plan.request import PlanRequest
from stiffarm.commands.plan.step import Planned, make_plan
from stiffarm.commands.rehearse.command import RehearseRequest
from stiffarm.commands.rehearse.sheet import SetUps, of_sheet
from stiffarm.commands.rehearse.step import made, prepared, set_ups_of

# Sizes against the KR60-3, and how far each length goes its own way (standard deviation of its logarithm).
SIZES, OWN_LENGTHS, OWN_SPRINGS = (0.5, 1.6), 0.25, 0.4
# Tool points lie up to so far (share of the reach) beside the flange in each direction.
TOOL = 0.15


def made_up(seed: int) -> Arm:
    """An arm of other lengths, springs and size; half of them without springs, without links, with a tool."""
    rng = np.random.default_rng([seed, 41])
    known = load_description("kr60-3").model_dump(mode="json", exclude_none=True, by_alias=True)
    size = float(np.exp(rng.uniform(*np.log(SIZES))))
    bare, rigid, tool = (bool(rng.random() < 0.5) for _ in range(3))
    known |= {"name": f"made-up-{seed}", "title": f"Made up, {seed}"}
    _times(known["payload"], size**3)
    _times(known["mass"], size**3)
    for joint in known["joint"]:
        for length in ("a", "d"):
            _times(joint["dh"][length], size * np.exp(OWN_LENGTHS * rng.normal()))
        _times(joint["stiffness"], size**3 * np.exp(OWN_SPRINGS * rng.normal()))
        if bare:
            del joint["stiffness"]
    _times(known["flange"]["xyz"], size * np.exp(OWN_LENGTHS * rng.normal()))
    for link in known["link"]:
        _scaled(link, size)
    if rigid:
        known |= {"link": [], "materials": {}}
    if tool:
        way = (rng.uniform(-TOOL, TOOL, 3) * 2.2 * size).tolist()
        known["tool"] = {"xyz": {"value": way, "unit": "m", "source": "assumed"}}
    return Arm.of(ModelDescription.model_validate(known), "rigid" if rigid else "beam")


def _times(quantity: dict[str, Any], factor: float) -> None:
    """A quantity in place, ``factor`` times as large."""
    value = quantity["value"]
    quantity["value"] = [factor * v for v in value] if isinstance(value, list) else factor * value


def _scaled(part: Any, size: float) -> None:
    """All lengths and masses of a link's table, in place, as of an arm ``size`` times as large."""
    if isinstance(part, dict) and {"value", "unit"} <= part.keys():
        _times(part, {"kg": size**3, "m": size, "mm": size}.get(part["unit"], 1.0))
    elif isinstance(part, dict | list):
        for value in part.values() if isinstance(part, dict) else part:
            _scaled(value, size)


ROBOTS = ("xr701", "kr60-3", "tx200", "fanuc-r2000ic")
# Those by which nothing was set, and the seed of their worlds.
TESTING, TEST_SEED = ("xr701", "tx200", "fanuc-r2000ic"), 1311
GAUGE = (1e-6, 1e-6)
DIRECTIONS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
FIRST, SET_UPS = 12, 20
# Promises beyond this factor are none ("still open").
OPEN = np.log(30.0)


@dataclass
class Tally:
    """Readings left out, and promised half widths beside those obtained."""

    inside: int = 0
    readings: int = 0
    per_campaign: list[float] = field(default_factory=list)
    kept: list[bool] = field(default_factory=list)
    near: list[bool] = field(default_factory=list)
    ratio: list[float] = field(default_factory=list)
    noise_alone: list[bool] = field(default_factory=list)
    conditional: list[bool] = field(default_factory=list)

    def add_left_out(self, given: Arm, data: Measurements) -> None:
        """Count the readings of poses left out."""
        names = [f"{joint}.stiffness" for joint in given.robot.joint_names]
        e = estimate(problem(given.model, data, [parameter(given.model, name) for name in names]), GAUGE)
        error, half, _ = leave_one_pose_out(e)
        one = Coverage.of(error, half)
        self.inside, self.readings = self.inside + one.inside, self.readings + one.readings
        self.per_campaign.append(one.share)

    def add_plan(self, given: Arm, planned: Planned, data: Measurements, world: World) -> None:
        """Compare what a plan promised with what its readings gave."""
        e = estimate(problem(given.model, data, list(planned.start.parameters)), GAUGE)
        for f, found in zip(planned.made.foresight, certainty(e).estimates, strict=True):
            if not f.seen or f.half95 is None or f.half95 >= OPEN:
                continue
            got, place = half_of(found), given.robot.joint_names.index(str(f.parameter.spring_of))
            true = -np.log(world.truth.compliance[place])
            self.kept.append(got <= f.half95)
            # What the promise is about: springs within a factor of the value planned for.
            if abs(np.log(f.planned_for) - true) <= np.log(WITHIN) + 1e-9:
                self.conditional.append(got <= f.half95)
            self.noise_alone.append(got <= 1.96 * f.after)
            self.ratio.append(got / f.half95)
            self.near.append(bool(abs(np.log(found.value) - true) <= f.half95))


def half_of(found: ParameterEstimate) -> float:
    """Half of ln(upper / lower) of a stiffness; infinite where the readings leave it open."""
    low, high = found.interval
    return float(0.5 * np.log(high / low)) if 0.0 < low <= high < np.inf else np.inf


def campaigns(given: Arm, code: str | None, draws: int) -> Iterator[tuple[SetUps, World]]:
    """Campaigns of 15 poses, each with something else hidden (or ``code``)."""
    arm = prepared(given)
    for k in range(draws):
        request = RehearseRequest(hide=code or "any", seed=17, poses=15, reads="xyz")
        set_ups = set_ups_of(given, arm, request, k)
        yield set_ups, made(given, arm, set_ups, request, k)


def planned_campaign(given: Arm, start: Measurements | None, n: int, seed: int, folder: Path) -> tuple[Planned, SetUps]:
    """A plan, and its sheet as set-ups for the world; with the ones before, which are measured first."""
    request = PlanRequest(poses=n, directions=DIRECTIONS, read="xyz", candidates=200, seed=seed)
    plan = make_plan(given, start, request)
    sheet = table_to_fill("sheet", plan.made.q, plan.made.direction, plan.labels, plan.made.protocol)
    path = folder / f"sheet_{n}_{seed}.csv"
    write_measurements(sheet, path, given.robot, to_fill=plan.made.protocol.columns)
    return plan, of_sheet(given, path, RehearseRequest())


def left_out(given: Arm, draws: int) -> dict[str, Tally]:
    """Readings at poses left out, with nothing hidden and with something."""
    out = {"nothing": Tally(), "an effect": Tally()}
    for case, code in (("nothing", "none"), ("an effect", None)):
        for set_ups, world in campaigns(given, code, draws):
            out[case].add_left_out(given, set_ups.filled(world.measured()))
    return out


def plans(given: Arm, draws: int, seed: int) -> dict[str, Tally]:
    """Promises of a first plan, and of one from 12 set-ups, in worlds with something hidden."""
    arm, out = prepared(given), {"first": Tally(), "next": Tally()}
    with TemporaryDirectory() as folder:
        plan, set_ups = planned_campaign(given, None, SET_UPS, 0, Path(folder))
        _, few = planned_campaign(given, None, FIRST, 1, Path(folder))
        for k in range(draws):
            request = RehearseRequest(hide="any", seed=seed)
            world = made(given, arm, set_ups, request, k)
            out["first"].add_plan(given, plan, set_ups.filled(world.measured()), world)
            begun = made(given, arm, few, request, k)
            following(given, few.filled(begun.measured()), begun, k, Path(folder), out["next"])
    return out


def training() -> dict[str, Tally]:
    """The campaigns by which the numbers of :mod:`doe.planning.lack_of_fit` were set."""
    out = {"first": Tally(), "next": Tally()}
    for arm, draws, seed in [(made_up(k), 4, 101 if k < 44 else 102) for k in range(74)] + [(load("kr60-3"), 16, 101)]:
        for case, tally in plans(arm, draws, seed).items():
            for name, values in vars(tally).items():
                if isinstance(values, list):
                    getattr(out[case], name).extend(values)
    return out


def following(given: Arm, data: Measurements, begun: World, seed: int, folder: Path, tally: Tally) -> None:
    """A plan from readings, of the same world, measured and put beside what it promised."""
    plan, set_ups = planned_campaign(given, data, FIRST, seed + 100, folder)
    world = replace(begun, readings=set_ups.readings, noise=set_ups.noise, read=set_ups.read)
    new = set_ups.filled(world.measured())
    new = replace(new, source="next", sha256="next", pose=relabelled(new.pose, data.pose))
    tally.add_plan(given, plan, join([data, new]), world)


def relabelled(pose: tuple[str, ...], taken: tuple[str, ...]) -> tuple[str, ...]:
    """The same set-ups under labels that nobody has."""
    names = list(dict.fromkeys(pose))
    return tuple(dict(zip(names, new_labels(len(names), "M", taken), strict=True))[one] for one in pose)


def bundled(name: str) -> Coverage:
    """Real readings at poses left out, springs of the joints that they can show."""
    given = load(name)
    data = read_measurements(bundled_data(name), given.robot)
    joints = ("j2", "j3", "j4", "j5") if name == "xr701" else given.robot.joint_names
    p = problem(given.model, data, [parameter(given.model, f"{j}.stiffness") for j in joints])
    error, half, _ = leave_one_pose_out(estimate(p, (1e-5, 1e-5)))
    return Coverage.of(error, half)


def percent(values: list[bool]) -> str:
    return f"{100.0 * float(np.mean(values)):.0f} ({len(values)})" if values else "-"


def left_out_row(name: str, case: str, t: Tally) -> str:
    """One row on readings left out."""
    low, middle = np.quantile(t.per_campaign, [0.1, 0.5])
    share = 100.0 * t.inside / t.readings
    return f"| {name} | {case} | {t.readings} | {share:.1f} | {100 * low:.0f}, {100 * middle:.0f} |"


def plan_row(name: str, case: str, t: Tally) -> str:
    """One row on promises."""
    low, middle, high = np.quantile(t.ratio, [0.1, 0.5, 0.9]) if t.ratio else (np.nan,) * 3
    shares = " | ".join(map(percent, (t.kept, t.conditional, t.noise_alone, t.near)))
    return f"| {name} | {case} | {shares} | {low:.2f}, {middle:.2f}, {high:.2f} |"


def main() -> None:
    given = asked(__doc__, draws=40, robot=[*ROBOTS], only=("left-out", "plans", "training"), seed=TEST_SEED)
    if given.only == "training":
        sys.stdout.writelines(plan_row("training", case, t) + "\n" for case, t in training().items())
        return
    for name in given.robot or (ROBOTS if given.only != "plans" else TESTING):
        if given.only != "plans":
            sys.stdout.writelines(left_out_row(name, c, t) + "\n" for c, t in left_out(load(name), given.draws).items())
        if given.only != "left-out":
            found = plans(load(name), given.draws, given.seed)
            sys.stdout.writelines(plan_row(name, case, t) + "\n" for case, t in found.items())
        sys.stdout.flush()
    if given.only != "plans":
        for name in ("fanuc-r2000ic", "xr701"):
            c = bundled(name)
            sys.stdout.write(f"{name}: {c.inside} of {c.readings} real readings, {100.0 * c.share:.1f} %\n")


if __name__ == "__main__":
    main()
