"""Held-out errors and the coverage of error bars of every basis, for each bundled robot.

    python benchmarks/surrogates/surrogate_accuracy.py [--robot xr701] [--quick] [--write]

Each arm as bundled or calibrated, with flexible links, and with springs that depend on joint angles. ``--write`` writes
docs/validation/surrogate_accuracy.md.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import fem
from benchmarks.asked import asked
from doe import bundled_campaign, bundled_data, read_measurements, select_loads
from doe.calibration.run import run_campaign
from fem.arm import Arm
from fem.springs import FourierBasis, PolynomialBasis, TableBasis
from stiffarm.session import inputs
from surrogate import Surrogate, scope_of, task_of, train, training
from surrogate.scope import Scope

HERE = Path(__file__).resolve().parent
PAGE = HERE.parents[1] / "docs" / "validation" / "surrogate_accuracy.md"
TEXT = HERE / "surrogate_accuracy_page.md"
BASES = ("polynomial", "trigonometric", "adaptive", "factored")
# Joints 2 to 5 where a robot file gives no springs, N m/rad: the class of these arms (robots/data, FACTS).
SPRINGS = {"j1": 2e6, "j2": 2e6, "j3": 1.5e6, "j4": 3e5, "j5": 2e5, "j6": 1.5e5}


@dataclass(frozen=True)
class Case:
    """An arm whose surrogates are judged."""

    robot: str
    what: str
    model: fem.ArmModel
    inputs: tuple[str, ...]
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)


@dataclass(frozen=True)
class Row:
    """One basis on one arm."""

    case: Case
    basis: str
    surrogate: Surrogate | None
    refused: str
    seconds: float


def springs_of(model: fem.ArmModel) -> fem.ArmModel:
    """Springs of the class where the robot file gives none."""
    none = np.zeros((1, model.robot.dof))
    missing = [j.name for j in model.joints if not j.axial.compliance(none).any()]
    return model.with_springs({name: SPRINGS[f"j{model.robot.joint_names.index(name) + 1}"] for name in missing})


def with_laws(model: fem.ArmModel) -> fem.ArmModel:
    """Springs of joints 2 to 5 that vary with their angle: two Fourier series, a sixth-degree polynomial, a table."""
    zero = np.zeros((1, model.robot.dof))
    low, high = model.robot.limits.T
    laws: dict[str, fem.SpringLaw | float] = {}
    for i, joint in enumerate(model.joints[1:5], start=1):
        level = -np.log(joint.axial.compliance(zero)[0])
        if i in (1, 3):
            laws[joint.name] = fem.LawSpring(FourierBasis(i, 2), np.array([level, 0.15, 0.1, 0.08, -0.05]))
        elif i == 2:
            middle, half = 0.5 * (low[i] + high[i]), 0.5 * (high[i] - low[i])
            powers = PolynomialBasis((i,), np.array([middle]), np.array([half]), np.arange(7)[:, None])
            laws[joint.name] = fem.LawSpring(powers, np.array([level, 0.2, -0.15, 0.1, 0.08, -0.06, 0.05]))
        else:
            nodes = np.linspace(low[i], high[i], 6)
            laws[joint.name] = fem.LawSpring(TableBasis(i, nodes), level + np.array([0.0, 0.15, 0.25, 0.1, 0.2, 0.05]))
    return model.with_springs(laws)


def cases(wanted: str | None) -> Iterator[Case]:
    for robot in ("xr701", "kr60-3", "tx200"):
        if wanted not in (None, robot):
            continue
        given = inputs.read_model(robot, "beam", None)
        names = given.robot.coordinates
        arm = springs_of(given.model)
        four, five = names[1:5], names[1:6]
        yield Case(robot, "constant springs, beam links", arm, four)
        yield Case(robot, "angle-dependent springs of four joints, beam links", with_laws(arm), four)
        if robot == "xr701":
            yield Case(robot, "published staged calibration (sixth-degree laws), beam links", _published(given), four)
            shells = with_laws(springs_of(inputs.read_model(robot, "shell", None).model))
            yield Case(robot, "angle-dependent springs of four joints, shell links", shells, four)
        else:
            tool = _with_tool(with_laws(arm))
            yield Case(robot, "the same with a tool 0.15 m off axis 6", tool, five)
        if robot == "kr60-3":
            yield Case(robot, "the same, load along (0.6, 0.2, -0.77), all joints", tool, names, (0.6, 0.2, -0.77))


def _with_tool(model: fem.ArmModel) -> fem.ArmModel:
    from dataclasses import replace

    T = np.eye(4)
    T[:3, 3] = (0.15, 0.05, 0.25)
    return replace(model, robot=replace(model.robot, T_flange_tool=T))


def _published(given: Arm) -> fem.ArmModel:
    scheme = bundled_campaign(given.robot.name)
    assert scheme is not None
    data = read_measurements(bundled_data(given.robot.name), given.robot)
    used = select_loads(data, scheme.loads_N)
    return run_campaign(given.description, lambda _: given.model, used, scheme).model


def judged(case: Case) -> Iterator[Row]:
    for basis in BASES:
        rng = np.random.default_rng(0)
        start = time.process_time()
        try:
            task = task_of(case.model, _scope(case), rng)
            one = train(task, rng, basis=basis).best
            yield Row(case, basis, one, "", time.process_time() - start)
        except ValueError as error:
            yield Row(case, basis, None, str(error), time.process_time() - start)


def _scope(case: Case) -> Scope:
    return scope_of(case.model.robot, "benchmark", case.inputs, direction=case.direction)


def percent(value: float) -> str:
    shown = 100.0 * value
    if shown >= 100.0:
        return f"{shown:.0f}"
    return f"{shown:.2g}" if shown >= 1e-4 else f"{shown:.0e}"


def table(rows: list[Row]) -> str:
    lines = [
        "| arm | basis | terms | runs | RMS % | worst % | worst with boundary % | 6 x 6 worst % | in 95 % bars "
        "| condition | fit s |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        name = f"{row.case.robot}, {len(row.case.inputs)} inputs: {row.case.what}"
        if row.surrogate is None:
            lines.append(f"| {name} | {row.basis} | {row.refused} | | | | | | | | |")
            continue
        e = row.surrogate.errors
        matrix = "" if e.matrix_max is None else percent(e.matrix_max)
        lines.append(
            f"| {name} | {e.basis} {e.degree} | {e.n_terms} | {e.n_train} | {percent(e.rms_interior)} "
            f"| {percent(e.max_interior)} | {percent(e.max_relative)} | {matrix} | {100 * e.coverage95:.1f} % "
            f"| {e.condition_number:.0e} | {row.seconds:.1f} |"
        )
    return "\n".join(lines)


def main() -> None:
    given = asked(__doc__, robot=("xr701", "kr60-3", "tx200"), quick=False, write=False)
    if given.quick:
        training.HELD_OUT_UNIFORM = 2000
    rows: list[Row] = []
    for case in cases(given.robot):
        for row in judged(case):
            rows.append(row)
            print(table([row]).splitlines()[-1], file=sys.stderr, flush=True)
    page = TEXT.read_text(encoding="utf-8").format(table=table(rows), worst=_worst(rows))
    if given.write:
        PAGE.write_text(page, encoding="utf-8")
    print(page)


def _worst(rows: list[Row]) -> str:
    """Largest figures of the default, the factored basis."""
    mine = [r.surrogate.errors for r in rows if r.surrogate is not None and r.surrogate.basis == "factored"]
    rms, worst = max(e.rms_interior for e in mine), max(e.max_relative for e in mine)
    return f"{percent(rms)} % RMS and {percent(worst)} % at worst"


if __name__ == "__main__":
    main()
