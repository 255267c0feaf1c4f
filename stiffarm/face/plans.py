"""Plans: which set-ups to measure next, and what they will tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from robots import InputError
from stiffarm.face.arms import Arm
from stiffarm.face.calls import called, numbers, words_of
from stiffarm.face.readings import AnyReadings, table_of
from stiffarm.face.shown import Shown, frame

if TYPE_CHECKING:
    import pandas as pd

    from stiffarm.commands.plan.step import Planned


@dataclass(frozen=True, repr=False)
class Plan(Shown):
    """Set-ups to measure next, in order; ``sentences``: what they will tell of each parameter."""

    arm: Arm
    sentences: tuple[str, ...]
    found: Planned

    def title(self) -> str:
        """How many set-ups, and for which robot."""
        return f"Plan for {self.arm.name}: {len(self.found.made.q)} set-ups"

    def to_frame(self) -> pd.DataFrame:
        """One row a set-up: label, joint coordinates in degrees, direction of the load in base axes."""
        made = self.found.made
        columns: dict[str, object] = {"pose": self.found.labels}
        columns |= {name: np.degrees(made.q[:, k]) for k, name in enumerate(self.arm.coordinates)}
        columns |= {f"load_{axis}": made.direction[:, k] for k, axis in enumerate("xyz")}
        return frame(columns)

    def save(self, file: str | Path) -> Path:
        """Write the measurement sheet (CSV) to fill in and read back; returns the path."""
        from stiffarm.commands.plan.results import plan_sheet
        from stiffarm.commands.plan.sheets import write_table

        path = Path(file)
        if path.suffix.lower() != ".csv":
            raise InputError(
                "measurement sheet", code="B004", value=str(path), allowed="a name ending in .csv", remedy="add .csv"
            )
        with called():
            write_table(plan_sheet(self.arm, None, self.found), path)
        return path


def plan(
    arm: Arm,
    readings: AnyReadings | None = None,
    *,
    poses: int = 3,
    free: Sequence[str] | str | None = None,
    forces_N: Sequence[float] | None = None,
    repeats: int = 3,
    seed: int = 0,
) -> Plan:
    """Choose the set-ups that tell most beyond the readings so far.

    Parameters
    ----------
    arm : the arm
    readings : measured so far; None to plan from scratch
    poses : how many set-ups to choose
    free : names of the parameters to identify; default: the springs that readings can see
    forces_N : load magnitudes; default: those of the readings, else usual ones for the arm
    repeats : of each reading
    seed : of the random numbers

    Raises
    ------
    InputError
        Unknown parameters, or no reading moves with any of them.

    Examples
    --------
    >>> import stiffarm as sa
    >>> arm = sa.load("xr701")
    >>> data = sa.read_readings(sa.bundled("xr701"), arm)
    >>> len(sa.plan(arm, data, poses=2, free=["j2.stiffness", "j3.stiffness"]).to_frame())
    2
    """
    from stiffarm.commands.plan.step import Request, make_plan

    request = Request(
        poses,
        free=words_of(free, "free"),
        forces=numbers(forces_N, "forces_N"),
        repeats=repeats,
        seed=seed,
    )
    with called():
        found = make_plan(arm, None if readings is None else table_of(readings, arm), request)
    return Plan(arm, tuple(found.sentences), found)
