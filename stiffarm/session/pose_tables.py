"""Poses from a table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from doe.tables.columns import table_of_frame
from doe.tables.schema import Cells, Column, Need
from robots.arrays import Array
from robots.errors import listed
from robots.faults import Faults
from stiffarm.session.table_kinds import POSES, open_table

if TYPE_CHECKING:
    import pandas as pd


def read_pose_table(
    names: tuple[str, ...], fixed_deg: Mapping[str, float], file: Path | pd.DataFrame
) -> tuple[Array, list[str], list[str]]:
    """Coordinates (n, k) in deg from a CSV, an XLSX or a data frame, the labels of its ``pose`` column, and remarks.

    A missing joint column is taken as 0 and remarked upon; so are other columns, which are not used.

    Raises
    ------
    InputErrors
        Every cell that is no finite number, a column twice, without a name or in another unit, and a coordinate of
        ``fixed_deg`` that is elsewhere in the table; each with row and column.
    InputError
        The file is missing, or cannot be read.
    """
    table = (
        open_table(file, POSES, "table of poses", "pose", option="pose table")
        if isinstance(file, Path)
        else table_of_frame(file, "data frame of poses")
    )
    faults = Faults(table.name)
    coordinates = tuple(Column(name, missing=0.0) for name in (*names, *fixed_deg))
    joints = Need(names, "no joint column", ", ".join(names), "name the columns exactly so", rule="one")
    cells = Cells.of(table, (*coordinates, Column("pose")), (joints,), faults).whole_rows()
    values = cells.numbers(*names, *fixed_deg, si=False)
    for name, column in zip(fixed_deg, values[:, len(names) :].T, strict=True):
        other = np.abs(column - fixed_deg[name]) > 1e-9
        cells.check(
            other & (np.cumsum(other) == 1) & (name in cells.known),
            f"column {name}",
            code="S002",
            value=lambda i, column=column: f"{column[i]:g}",  # type: ignore[misc]
            allowed=f"{fixed_deg[name]:g}, where the surrogate was fitted",
            remedy=f"fit a surrogate with {name} among its inputs, or leave the column out",
        )
    faults.raise_if_any("pose table")
    remarks = [f"column {name} is missing and taken as 0" for name in names if name not in cells.known]
    remarks += [f"columns not used: {listed(cells.unknown)}"] if cells.unknown else []
    labels = cells.texts("pose") if "pose" in cells.known else map(str, range(1, len(values) + 1))
    return values[:, : len(names)], list(labels), [f"{table.name}: {remark}" for remark in (*remarks, *table.notes)]
