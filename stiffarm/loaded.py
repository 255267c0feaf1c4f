"""What Python loads once and hands to several capabilities: arms, and measured deflections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from doe import Measurements, bundled_data
from doe.tables.columns import DISPLACEMENTS, LOADS
from robots import InputError
from robots.arrays import Array
from stiffarm.arm import Arm, as_face
from stiffarm.capability import called
from stiffarm.request import readings_asked
from stiffarm.result import as_html, as_text
from stiffarm.session.inputs import read_model

if TYPE_CHECKING:
    import pandas as pd

# SI to the units of the columns: N, N m; mm, mrad.
_MILLI = 1e3


def load(
    model: str | Path,
    *,
    links: str | None = None,
    load_path: str | None = None,
    values: Mapping[str, float | str] | None = None,
) -> Arm:
    """A robot arm by bundled name, from a model TOML or from a URDF.

    Parameters
    ----------
    model : a bundled name (:func:`stiffarm.robots`) or a path
    links : "beam", "shell" or "rigid"; default: as the model was calibrated, else beam
    load_path : "parallelogram" or "serial"; default: the model's
    values : parameter name -> value in place of the model's, SI or text with a unit, as in ``{"j2.stiffness": 1.4e6}``

    Raises
    ------
    InputError
        No such model, a file that does not fit the schema, a parameter that the arm does not have, or an arm too soft
        for linear statics.

    Examples
    --------
    >>> import stiffarm as sa
    >>> sa.load("xr701", values={"j2.stiffness": 1.4e6}).name
    'xr701'
    """
    with called():
        return as_face(read_model(str(model), links, load_path, sets=values))


@dataclass(frozen=True, repr=False)
class Readings:
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
        import pandas as pd

        t = self.table
        columns: dict[str, Sequence[str] | Array] = {"pose": t.pose}
        columns |= {name: np.degrees(t.q[:, k]) for k, name in enumerate(self.coordinates)}
        columns |= {name: t.wrench[:, k] for k, name in enumerate(LOADS) if t.wrench[:, k].any()}
        columns |= {name: _MILLI * t.displacement[:, k] for k, name in enumerate(DISPLACEMENTS) if t.used[:, k].any()}
        return pd.DataFrame(columns)

    def __repr__(self) -> str:
        return as_text(self.title(), self.to_frame())

    def _repr_html_(self) -> str:
        return as_html(self.title(), self.to_frame())


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
    if isinstance(source, list | tuple) and not source:
        raise InputError("source", code="B003", value="nothing", allowed="one or more tables")
    with called():
        return Readings(readings_asked(arm, source, confirm_units=confirm_units), arm.coordinates)
