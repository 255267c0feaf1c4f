"""Measured deflections: from tables, files or data frames, checked as on the command line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from doe import Measurements, bundled_data
from doe.tables.columns import DISPLACEMENTS, LOADS, read_table, table_of_frame
from doe.tables.joined import join
from doe.tables.reading import measurements_of
from robots import InputError
from robots.arrays import Array
from stiffarm.face.arms import Arm
from stiffarm.face.calls import called
from stiffarm.face.shown import Shown, frame
from stiffarm.session.reading_checks import check_readings
from stiffarm.session.table_kinds import DEFLECTIONS, expect

if TYPE_CHECKING:
    import pandas as pd

# What functions take for readings: those read, or a table's file or data frame.
AnyReadings: TypeAlias = "Readings | str | Path | pd.DataFrame"
# SI to the units of the columns: N, N m; mm, mrad.
_MILLI = 1e3


@dataclass(frozen=True, repr=False)
class Readings(Shown):
    """Deflection readings: ``table`` in SI, with the names of the robot's joint coordinates.

    Made by :func:`stiffarm.read_readings`.
    """

    table: Measurements
    coordinates: tuple[str, ...]

    def __len__(self) -> int:
        return self.table.n

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the table, in words."""
        return self.table.notes

    def title(self) -> str:
        """Name of the table, with how many readings and poses it has."""
        return f"{self.table.source}: {self.table.n} readings in {len(self.table.pose_groups())} poses"

    def to_frame(self) -> pd.DataFrame:
        """One row a reading, with the columns of a measurement table that are not empty."""
        t = self.table
        columns: dict[str, Sequence[str] | Array] = {"pose": t.pose}
        columns |= {name: np.degrees(t.q[:, k]) for k, name in enumerate(self.coordinates)}
        columns |= {name: t.wrench[:, k] for k, name in enumerate(LOADS) if t.wrench[:, k].any()}
        columns |= {name: _MILLI * t.displacement[:, k] for k, name in enumerate(DISPLACEMENTS) if t.used[:, k].any()}
        return frame(columns)


def table_of(readings: AnyReadings, arm: Arm) -> Measurements:
    """The table of readings, which are read first where they are a file or a data frame."""
    return readings.table if isinstance(readings, Readings) else read_readings(readings, arm).table


def bundled(robot: str) -> Path:
    """The path of the measurement table that is bundled with a robot.

    Raises
    ------
    InputError
        None is bundled.

    Examples
    --------
    >>> import stiffarm as sa
    >>> sa.bundled("xr701").name
    'xr701_gotlih.csv'
    """
    return bundled_data(robot)


def read_readings(
    source: str | Path | pd.DataFrame | Sequence[str | Path | pd.DataFrame], arm: Arm, *, confirm_units: bool = False
) -> Readings:
    """Measured deflections of an arm, checked: units, signs, reach, and that a passive arm can move so.

    Parameters
    ----------
    source : a table (CSV or XLSX), a data frame with the same columns, or several of them, which become one
    arm : whose readings they are
    confirm_units : take a table whose figures look like other units than its columns say

    Raises
    ------
    InputError
        A table that cannot be read, or readings that no arm like this gives: each fault with row and column.

    Examples
    --------
    >>> import stiffarm as sa
    >>> len(sa.read_readings(sa.bundled("xr701"), sa.load("xr701")))
    27
    """
    several = [source] if isinstance(source, str | Path) or not isinstance(source, Sequence) else list(source)
    if not several:
        raise InputError("source", code="B003", value="nothing", allowed="one or more tables")
    with called():
        tables = [_read(one, k, arm) for k, one in enumerate(several, start=1)]
        for table in tables:
            check_readings(arm, table, confirm_units=confirm_units)
        return Readings(join(tables), arm.coordinates)


def _read(source: str | Path | pd.DataFrame, number: int, arm: Arm) -> Measurements:
    if isinstance(source, str | Path):
        expect(Path(source), DEFLECTIONS)
        return measurements_of(read_table(Path(source)), arm.robot)
    return measurements_of(table_of_frame(source, f"data frame {number}"), arm.robot)
