"""Read tables of joint twists (CSV, XLSX), one row a reading, or one row a reflector, with every fault named."""

from __future__ import annotations

from dataclasses import replace
from itertools import compress
from pathlib import Path

import numpy as np

from doe.joint_twists.readings import (
    SIGMAS,
    Cells,
    TwistReadings,
    find_columns,
    is_reflector_table,
    read_cells,
)
from doe.joint_twists.reflectors import assemble_reflectors
from doe.tables import columns as mc
from doe.tables.checks import check_limits
from doe.tables.columns import DISPLACEMENTS, LOADS, POINT, Columns, RawTable
from doe.tables.reading import column_notes
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
    table = mc.read_table(Path(path))
    faults = Faults(table.name)
    columns = find_columns(table, robot, faults)
    faults.raise_if_any("measurements")  # cells of columns that mean something else would only hide it
    table = mc.drop_ragged(table, faults)
    cells = read_cells(table, columns, robot, faults)
    if is_reflector_table(table):
        faults.raise_if_any("measurements")
        readings = assemble_reflectors(table, columns, cells, robot, faults)
    else:
        readings = _assemble(table, columns, cells, faults)
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
    made_up = ("synthetic readings: made up, nobody measured them",) if readings.synthetic else ()
    return replace(readings, notes=(*made_up, *column_notes(table, columns, robot), *readings.notes))


def _assemble(table: RawTable, columns: Columns, cells: Cells, faults: Faults) -> TwistReadings:
    both = (table, columns)
    twist = mc.numbers(*both, DISPLACEMENTS, faults, empty="not read")
    sigma = np.repeat(mc.numbers(*both, SIGMAS, faults, empty="not known", positive=True), 3, axis=1)
    for line, row in zip(table.lines, twist, strict=True):
        if np.isnan(row).all() and line not in faults.lines:
            faults.add(
                line,
                "nothing was read",
                code="T006",
                allowed=f"at least one of {', '.join(DISPLACEMENTS)}",
                remedy="fill in the readings, or remove the row",
            )
    good = np.array([line not in faults.lines for line in table.lines], dtype=np.bool_)
    return TwistReadings(
        table.name,
        table.sha256,
        cells.q[good],
        cells.joint[good],
        cells.wrench[good],
        cells.point[good],
        twist[good],
        sigma[good],
        tuple(compress(cells.phase, good)),
        tuple(compress(cells.setup, good)),
        tuple(compress(table.lines, good)),
        cells.synthetic,
        (),
    )


def write_twists(t: TwistReadings, path: str | Path, robot: Robot) -> None:
    """Write a table that :func:`read_twists` reads back the same, whole or not at all.

    A synthetic table says so in the column ``origin`` of every row.
    """
    path = Path(path)
    names = (*robot.coordinates, *LOADS, *POINT, *DISPLACEMENTS, *SIGMAS)
    values = np.column_stack([t.q, t.wrench, t.point, t.twist, t.sigma[:, [0, 3]]])
    columns: dict[str, list[str]] = {
        "pose": [label.split("/")[0] for label in t.setup],
        "joint": [robot.joint_names[j] for j in t.joint.tolist()],
        "phase": list(t.phase),
    }
    for name, column in zip(names, values.T, strict=True):
        cells = ["" if np.isnan(v) else f"{v:.15g}" for v in (column / mc.si_factor(name)).tolist()]
        needed = name in robot.coordinates or name in LOADS[:3] or (name in POINT and t.point.any())
        if needed or any(cell not in ("", "0") for cell in cells):
            columns[name] = cells
    if t.synthetic:
        columns["origin"] = ["synthetic"] * t.n
    with written_whole(path) as draft, draft.open("w", encoding="utf-8", newline="") as stream:
        write_rows(stream, [columns, *zip(*columns.values(), strict=True)])
