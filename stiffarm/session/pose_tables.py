"""Poses from a table."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from doe.tables.columns import RawTable, drop_ragged, parse_number, read_table, texts
from robots import InputError
from robots.arrays import Array
from robots.errors import listed
from robots.faults import Faults


def read_pose_table(
    names: tuple[str, ...], fixed_deg: Mapping[str, float], file: Path
) -> tuple[Array, list[str], list[str]]:
    """Coordinates (n, k) in deg from a CSV or XLSX, the labels of its ``pose`` column, and remarks.

    A missing joint column is taken as 0 and remarked upon; so are other columns, which are not used.

    Raises
    ------
    InputErrors
        Every cell that is no finite number, a column twice or in another unit, and a coordinate of
        ``fixed_deg`` that is elsewhere in the table; each with row and column.
    InputError
        The file is missing, or cannot be read.
    """
    if not file.is_file():
        raise InputError("pose table", value=str(file), allowed="an existing CSV or XLSX file", remedy="check the path")
    table = read_table(file)
    faults = Faults(table.name)
    columns = _pose_columns(table, (*names, *fixed_deg, "pose"), faults)
    table = drop_ragged(table, faults)
    missing = [name for name in names if name not in columns]
    if len(missing) == len(names):
        faults.add(1, "no joint column", allowed=", ".join(names), remedy="name the columns exactly so")
    values = np.zeros((len(table.rows), len(names)))
    for name, index in columns.items():
        if name == "pose":
            continue
        cells = _finite(table, name, index, faults)
        if name in names:
            values[:, names.index(name)] = cells
        elif (other := np.flatnonzero(np.abs(cells - fixed_deg[name]) > 1e-9)).size:
            faults.add(table.lines[other[0]], f"column {name}", value=f"{cells[other[0]]:g}",
                       allowed=f"{fixed_deg[name]:g}, where the surrogate was fitted",
                       remedy=f"fit a surrogate with {name} among its inputs, or leave the column out")  # fmt: skip
    faults.raise_if_any("pose table")
    unused = [name for name in table.header if name and name not in columns]
    remarks = [f"{file}: column {name} is missing and taken as 0" for name in missing]
    remarks += [f"{file}: columns not used: {listed(unused)}"] if unused else []
    remarks += [f"{file}: {note}" for note in table.notes]
    labels = texts(table, columns["pose"]) if "pose" in columns else [str(i + 1) for i in range(len(values))]
    return values, list(labels), remarks


def _pose_columns(table: RawTable, known: tuple[str, ...], faults: Faults) -> dict[str, int]:
    stems = {_stem(name): name for name in known if name != "pose"}
    found: dict[str, int] = {}
    for index, name in enumerate(table.header):
        if name in found:
            faults.add(1, f"column {name} stands there twice", allowed="each name once", remedy="remove one")
        elif name in known:
            found[name] = index
        elif right := stems.get(_stem(name)):
            faults.add(1, "column", value=name, allowed=right,
                       remedy=f"convert the values if need be and name the column {right}")  # fmt: skip
    return found


def _stem(name: str) -> str:
    """What a column is about, without its unit: ``q2`` of q2_deg, Q2 [rad]."""
    return re.split(r"[^a-z0-9]", name.lower(), maxsplit=1)[0]


def _finite(table: RawTable, name: str, index: int, faults: Faults) -> Array:
    out = np.full(len(table.rows), np.nan)
    for i, cell in enumerate(texts(table, index)):
        try:
            out[i] = parse_number(cell)
        except ValueError as error:
            faults.add(table.lines[i], f"column {name}", value=cell, allowed="a finite number", remedy=str(error))
    return out
