"""What a model is missing: by deflections that were read under load, or by positions of targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from doe.diagnosis.nested import FOLDS
from doe.diagnosis.scatter import SETUP
from fem.arm import Arm
from robots import require_one_of
from stiffarm.capability import capability
from stiffarm.request import (
    BOX,
    HEIGHT,
    LOADS,
    NAMES,
    READINGS,
    Readings,
    Request,
    argument,
    option,
    readings_asked,
    seed,
)
from stiffarm.result import Result
from stiffarm.session.console import progress, say
from stiffarm.session.table_kinds import are_positions


@dataclass(frozen=True, kw_only=True)
class DiagnoseRequest(Request):
    """Find out what the model is missing, and how sure that is.

    Shows where the model disagrees with the readings, which physical effect explains it, and which set-ups to measure
    next. Writes diagnosis.json, the model with the identified effects and a report.

    Tables with x_mm, y_mm and z_mm hold absolute positions in a tracker's frame: geometry, frames and targets are
    then fitted together with every candidate.

    Examples
    --------
    >>> import stiffarm as sa
    >>> arm = sa.load("xr701", load_path="serial")
    >>> sa.diagnose(arm, sa.bundled("xr701"), loads=[650], next_poses=0, folds=0).effects
    ('load-path',)
    """

    data: Readings | Sequence[Readings] = argument(
        "One or more measurement tables (CSV/XLSX), combined. Pass a filled-in sheet together with the table it "
        "extends. Default: the robot's bundled table, also available as `bundled`.",
        READINGS,
        metavar="DATA",
        several=True,
    )
    holdout: Readings | None = option(
        "Measurement table of other poses (CSV/XLSX), kept out of the diagnosis to test its result.", READINGS
    )
    free: Sequence[str] | None = option(
        "Joints whose stiffness is fitted, separated by commas, as in j2,j3. Default: all joints with a spring.", NAMES
    )
    next_poses: int = option(
        "Number of further set-ups to propose if the readings leave something open; 0 for none.",
        default=3,
        spelled=("--next",),
        least=0,
        most=30,
    )
    floor_mm: float | None = option(
        "Height of the floor in mm: no part of the arm may be below it; or none.", HEIGHT, default=0.0
    )
    keep_out: Sequence[Sequence[float]] = option(
        "Box that the arm must keep out of, x0,y0,z0:x1,y1,z1, in mm. May be repeated.", BOX, several=True
    )
    clearance_mm: float | None = option(
        "Distance of wrist and tool from base and upper arm, in mm; 0 for no limit. Default: what the casings need.",
        least=0.0,
        most=1e4,
    )
    folds: int = option(
        "Number of parts into which the poses are split at random; for each part the diagnosis is repeated without it "
        "and then predicts it. Fewer than ten poses are left out one at a time; 0 for none.",
        default=FOLDS,
        least=0,
        most=50,
    )
    setup_percent: float = option(
        "Expected scatter between set-ups, in percent of the deflection. More than twice as much counts as an unknown "
        "effect.",
        default=100.0 * SETUP,
        least=0.05,
        most=20.0,
    )
    loads: tuple[float, ...] = option(
        "Loads to use, in N, separated by commas, as in 150,650, or all. Default: all.", LOADS, default=()
    )
    confirm_units: bool = option(
        "Accept the table although its values look like other units; use it after checking them.", default=False
    )
    seed: int = seed()


def answer(given: Arm, asked: DiagnoseRequest) -> Result:
    """What is missing by these readings; the result's ``found`` has everything behind it."""
    from stiffarm.commands.diagnose import step
    from stiffarm.commands.diagnose.result import result_of

    if are_positions(cast("Sequence[Readings]", asked.data)):
        from stiffarm.commands.diagnose import positions

        return positions.result_of(given, asked)
    for name in asked.free or ():
        remedy = "choose from these, separated by commas"
        require_one_of("--free", name, given.robot.joint_names, code="A001", remedy=remedy)
    table = readings_asked(given, asked.data, confirm_units=asked.confirm_units)
    other = None
    if asked.holdout is not None:
        other = readings_asked(given, asked.holdout, confirm_units=asked.confirm_units)
    with progress("this step of the diagnosis") as bar:
        found = step.diagnose(given, table, asked, holdout=other, say=say, progress=bar)
    return result_of(found)


diagnose = capability("diagnose", DiagnoseRequest, answer, own_effects=True)
