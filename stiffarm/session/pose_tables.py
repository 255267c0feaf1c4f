"""Poses from a table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from doe.tables.columns import drop_ragged, numbers, read_table, sorted_columns, texts
from robots import InputError
from robots.arrays import Array
from robots.errors import listed
from robots.faults import Faults
from stiffarm.session.table_kinds import POSES, expect


def read_pose_table(
    names: tuple[str, ...], fixed_deg: Mapping[str, float], file: Path
) -> tuple[Array, list[str], list[str]]:
    """Coordinates (n, k) in deg from a CSV or XLSX, the labels of its ``pose`` column, and remarks.

    A missing joint column is taken as 0 and remarked upon; so are other columns, which are not used.

    Raises
    ------
    InputErrors
        Every cell that is no finite number, a column twice, without a name or in another unit, and a coordinate of
        ``fixed_deg`` that is elsewhere in the table; each with row and column.
    InputError
        The file is missing, or cannot be read.
    """
    if not file.is_file():
        raise InputError(
            "pose table", code="A007", value=str(file), allowed="an existing CSV or XLSX file", remedy="check the path"
        )
    expect(file, POSES)
    table = read_table(file, "table of poses", "pose")
    faults = Faults(table.name)
    columns, _ = sorted_columns(table, (*names, *fixed_deg, "pose"), faults)
    table = drop_ragged(table, faults)
    missing = [name for name in names if name not in columns.known]
    if len(missing) == len(names):
        faults.add(1, "no joint column", code="T003", allowed=", ".join(names), remedy="name the columns exactly so")
    values = numbers(table, columns, (*names, *fixed_deg), faults, missing=0.0, si=False)
    for name, column in zip(fixed_deg, values[:, len(names) :].T, strict=True):
        other = np.flatnonzero(np.abs(column - fixed_deg[name]) > 1e-9)
        if other.size and name in columns.known:
            faults.add(
                table.lines[other[0]],
                f"column {name}",
                code="S002",
                value=f"{column[other[0]]:g}",
                allowed=f"{fixed_deg[name]:g}, where the surrogate was fitted",
                remedy=f"fit a surrogate with {name} among its inputs, or leave the column out",
            )
    faults.raise_if_any("pose table")
    remarks = [f"{file}: column {name} is missing and taken as 0" for name in missing]
    remarks += [f"{file}: columns not used: {listed(columns.unknown)}"] if columns.unknown else []
    remarks += [f"{file}: {note}" for note in table.notes]
    at = columns.known.get("pose")
    labels = [str(i + 1) for i in range(len(values))] if at is None else list(texts(table, at))
    return values[:, : len(names)], labels, remarks
