"""Read tables of joint twists (CSV, XLSX), one row a reading, or one row a reflector, with every fault named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from doe.joint_twists.readings import (
    SIGMAS,
    SYNTHETIC,
    TwistReadings,
    common_columns,
    is_reflector_table,
    sorted_header,
)
from doe.joint_twists.reflectors import reflector_columns
from doe.tables.checks import check_limits
from doe.tables.columns import DISPLACEMENTS, LOADS, POINT, read_table
from doe.tables.reading import UNUSED
from doe.tables.schema import Cells, as_cells, kept
from robots import Robot
from robots.faults import Faults
from robots.files.csv_text import write_rows
from robots.files.written import written_whole


def read_twists(path: str | Path, robot: Robot, *, check_reach: bool = True) -> TwistReadings:
    """Read a table of relative displacements and twists, or of reflector coordinates, for ``robot``.

    One row a reading: joint columns (``q1_deg`` ...; one that is missing is 0), ``joint`` (name or number of the joint
    between the two arms), the load ``fx_N ... mz_Nm`` in flange axes (``axes`` = base: in base axes) at the flange
    centre or at ``px_mm py_mm pz_mm`` (flange frame), ``phase`` (loading or unloading), and what was read: ``dx_mm
    dy_mm dz_mm rx_mrad ry_mrad rz_mrad`` of the arm behind the joint against the arm before it, in the joint's
    modified DH frame at its origin (Z along the gear axis, X along the common normal to the next axis, turning with
    the arm behind the joint); an empty cell was not read. Optional: ``pose`` (label), ``repeat``, ``step``,
    ``sigma_mm``, ``sigma_twist_mrad``, ``origin`` ("synthetic" for made-up tables). Loads of zero may stand at the
    start and the end of a cycle.
    One row a reflector: see :mod:`doe.joint_twists.reflectors`.

    Raises
    ------
    InputErrors
        Faults in the header or the rows, all of them, each with line, column, value and remedy.
    InputError
        The file as a whole cannot be read.
    """
    table = read_table(Path(path))
    faults = Faults(table.name)
    cells = sorted_header(table, robot, faults)
    faults.raise_if_any("measurements")  # cells of columns that mean something else would only hide it
    cells = cells.whole_rows()
    columns = common_columns(cells, robot)
    if is_reflector_table(table):
        faults.raise_if_any("measurements")
        read = reflector_columns(cells, columns, robot)
    else:
        read = _twist_columns(cells, columns)
    made_up = any(SYNTHETIC in text.lower() for text in cells.texts("origin"))
    readings = TwistReadings(source=table.name, sha256=table.sha256, synthetic=made_up, **read)
    if readings.n and not readings.wrench.any():
        faults.add(
            readings.row_numbers[0],
            "the load is zero in every component, here and in every row",
            code="T006",
            allowed="loads other than 0",
            remedy="give the forces: fx_N, fy_N, fz_N",
        )
    if readings.n and check_reach:
        check_limits(readings.q, readings.setup, readings.row_numbers, robot, faults)
    faults.raise_if_any("measurements")
    notes = ("synthetic readings: made up, nobody measured them",) if made_up else ()
    remarks = cells.remarks(robot, loads=True, unused=UNUSED)
    return replace(readings, notes=(*notes, *remarks, *readings.notes))


def _twist_columns(cells: Cells, columns: Mapping[str, Any]) -> dict[str, Any]:
    """The columns of the rows without a fault."""
    twist = cells.numbers(*DISPLACEMENTS)
    sigma = np.repeat(cells.numbers(*SIGMAS), 3, axis=1)
    cells.check(
        np.isnan(twist).all(axis=1) & cells.good(),
        "nothing was read",
        code="T006",
        allowed=f"at least one of {', '.join(DISPLACEMENTS)}",
        remedy="fill in the readings, or remove the row",
    )
    every = {**columns, "twist": twist, "sigma": sigma, "row_numbers": cells.table.lines}
    good = cells.good()
    return {name: kept(values, good) for name, values in every.items()} | {"notes": ()}


def write_twists(t: TwistReadings, path: str | Path, robot: Robot) -> None:
    """Write a table that :func:`read_twists` reads back the same, whole or not at all.

    A synthetic table says so in the column ``origin`` of every row.
    """
    path = Path(path)
    names = (*robot.coordinates, *LOADS, *POINT, *DISPLACEMENTS, *SIGMAS)
    values = np.column_stack([t.q, t.wrench, t.point, t.twist, t.sigma[:, [0, 3]]])
    columns: dict[str, Sequence[str]] = {
        "pose": [label.split("/")[0] for label in t.setup],
        "joint": [robot.joint_names[j] for j in t.joint.tolist()],
        "phase": list(t.phase),
    }
    for name, column in zip(names, values.T, strict=True):
        cells = as_cells(name, column)
        needed = name in robot.coordinates or name in LOADS[:3] or (name in POINT and t.point.any())
        if needed or any(cell not in ("", "0") for cell in cells):
            columns[name] = cells
    if t.synthetic:
        columns["origin"] = ["synthetic"] * t.n
    with written_whole(path) as draft, draft.open("w", encoding="utf-8", newline="") as stream:
        write_rows(stream, [columns, *zip(*columns.values(), strict=True)])
