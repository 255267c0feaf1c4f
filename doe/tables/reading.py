"""Measurement tables in files: read with every fault named, and written."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Final

import numpy as np

from doe.tables.checks import (
    check_duplicates,
    check_labels,
    check_limits,
    check_loads,
    check_read,
    joint_keys,
    plausibility_notes,
)
from doe.tables.columns import DISPLACEMENTS, LOADS, PHASES, POINT, RawTable, read_table
from doe.tables.measurements import Measurements
from doe.tables.schema import (
    LOAD_COLUMNS,
    READ_COLUMNS,
    SIGMA,
    STEP,
    TIMES,
    WHOLE_POINT,
    Cells,
    Column,
    angle_columns,
    as_cells,
    kept,
    one_of,
)
from robots import InputError, Robot, require_one_of
from robots.arrays import Array, Bools
from robots.errors import line_ranges
from robots.faults import Faults
from robots.files.csv_text import write_rows
from robots.files.written import written_whole

UNUSED: Final = "unknown columns, kept but not used"
COLUMNS: Final = (
    *LOAD_COLUMNS,
    *READ_COLUMNS,
    *(Column(name, "the tool point") for name in POINT),
    SIGMA,
    STEP,
    *TIMES,
    Column(
        "pose",
        words=re.compile(r"(?s).+"),
        allowed="a label in each row",
        remedy="name the pose, or leave the column out",
    ),
    Column(
        "repeat",
        words=re.compile(r"\d{0,9}", re.ASCII),
        allowed="a whole number, or an empty cell",
        remedy="count the repeats 1, 2, 3 ...",
    ),
    Column(
        "phase",
        words=(*PHASES, ""),
        allowed=f"{', '.join(PHASES)}, or an empty cell",
        remedy="use one of these words",
    ),
    Column("session"),
)


def read_measurements(path: str | Path, robot: Robot, *, check_reach: bool = True) -> Measurements:
    """Read a measurement table (CSV or XLSX, first sheet) for ``robot``.

    Empty joint and load cells are faults, an empty reading is "not read"; wholly blank lines, and rows of a sheet
    that nothing was read in yet, are skipped with a note. With ``check_reach`` each pose must keep the robot's
    limits and couplings.

    Raises
    ------
    InputErrors
        Faults in the header or the rows, all of them, each with line, column, value and remedy.
    InputError
        The file as a whole cannot be read.
    """
    return measurements_of(read_table(Path(path)), robot, check_reach=check_reach)


def measurements_of(table: RawTable, robot: Robot, *, check_reach: bool = True) -> Measurements:
    """Readings of a table of text, as :func:`read_measurements`."""
    m, cells = _checked(table, robot, check_reach, (check_read, check_loads, check_labels, check_duplicates))
    unread = np.asarray(~m.used.any(axis=1), dtype=np.bool_)
    notes = (*cells.remarks(robot, loads=True, unused=UNUSED), *_unread_notes(m, unread))
    m = m.select(~unread)
    return replace(m, notes=(*notes, *plausibility_notes(m)))


def read_set_ups(path: str | Path, robot: Robot) -> tuple[Measurements, tuple[str, ...]]:
    """Every row of a measurement table or of a sheet to fill in, read or not, and its deflection columns.

    Raises
    ------
    InputError
        As :func:`read_measurements`; a sheet in which nothing was read yet is none.
    """
    table = read_table(Path(path))
    m, cells = _checked(table, robot, True, (check_loads, check_labels, check_duplicates))
    notes = tuple(cells.remarks(robot, loads=True, unused=UNUSED))
    return replace(m, notes=notes), tuple(name for name in DISPLACEMENTS if name in cells.known)


def _checked(
    table: RawTable, robot: Robot, check_reach: bool, checks: Sequence[Callable[[Measurements, Faults], None]]
) -> tuple[Measurements, Cells]:
    faults = Faults(table.name)
    angles = angle_columns(robot)
    needs = (
        one_of(f"joint column of {robot.name}", robot.angle_names, table.hint),
        one_of("load column", LOADS, table.hint),
        one_of("deflection column", DISPLACEMENTS, table.hint),
        WHOLE_POINT,
    )
    cells = Cells.of(table, (*angles, *COLUMNS), needs, faults, robot)
    header_fits = not faults.count
    m = _assemble(cells.whole_rows(), robot)
    if header_fits and m.n:
        for check in checks:
            check(m, faults)
        if check_reach:
            check_limits(m.q, m.pose, m.row_numbers, robot, faults)
    faults.raise_if_any("measurements")
    return m, cells


def _assemble(cells: Cells, robot: Robot) -> Measurements:
    """All cells as columns; rows with a fault are left out, so that later checks see numbers only."""
    q = cells.angles(robot)
    numbers = {
        "wrench": cells.numbers(*LOADS),
        "displacement": cells.numbers(*DISPLACEMENTS),
        "point": cells.numbers(*POINT),
        "sigma": cells.numbers("sigma_mm")[:, 0],
        "step": cells.numbers("step")[:, 0],
        "time": cells.numbers("time_s")[:, 0],
        "temperature": cells.numbers("temperature_C")[:, 0],
    }
    pose, repeat, phase, session = map(cells.words, ("pose", "repeat", "phase", "session"))
    good = cells.good()
    return Measurements(
        source=cells.table.name,
        sha256=cells.table.sha256,
        q=q[good],
        pose=kept(pose, good) if "pose" in cells.known else _labels(q[good]),
        repeat=tuple(int(text) if text else None for text in kept(repeat, good)),
        phase=tuple(text or None for text in kept(phase, good)),
        row_numbers=kept(cells.table.lines, good),
        extra={name: kept(tuple(row[i] for row in cells.table.rows), good) for name, i in cells.unknown.items()},
        notes=(),
        session=kept(session, good),
        **{name: kept(values, good) for name, values in numbers.items()},
    )


def _labels(q: Array) -> tuple[str, ...]:
    found: dict[tuple[float, ...], str] = {}
    return tuple(found.setdefault(key, f"P{len(found) + 1}") for key in joint_keys(q))


def _unread_notes(m: Measurements, unread: Bools) -> Iterator[str]:
    """Name the rows without any reading, neighbours as one range."""
    rows = np.array(m.row_numbers)[unread]
    if rows.size:
        yield f"{rows.size} row(s) without any reading skipped: {line_ranges(rows.tolist())}"


def write_measurements(m: Measurements, path: str | Path, robot: Robot, *, to_fill: tuple[str, ...] = ()) -> None:
    """Write the CSV contract, whole or not at all; an existing file is replaced.

    All joint and load columns are written, of the others those that hold something, and ``to_fill``: displacement
    columns of a sheet that is still empty. Numbers carry 15 significant digits in the file's units, so what was
    read from such a file comes back the same.

    Raises
    ------
    InputError
        Not a ``.csv`` path, no such folder, or another robot's number of joints.
    """
    path = Path(path)
    if path.suffix.lower() != ".csv" or not path.parent.is_dir():
        raise InputError(
            "measurement file to write", code="B004", value=str(path), allowed="a .csv in an existing folder"
        )
    if m.q.shape[1] != robot.dof:
        raise InputError("measurements: joints", code="A010", value=m.q.shape[1], allowed=f"{robot.dof} ({robot.name})")
    columns = _text_columns(m, robot, to_fill)
    with written_whole(path) as draft, draft.open("w", encoding="utf-8", newline="") as stream:
        write_rows(stream, [columns, *zip(*columns.values(), strict=True)])


def _text_columns(m: Measurements, robot: Robot, to_fill: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    # A sheet is filled in at the pendant: it shows the angles of its controller too.
    shown = robot.controller if to_fill else None
    more = () if shown is None else tuple(name for name in shown.names if name not in robot.coordinates)
    needed = ("pose", *more, *robot.coordinates, *LOADS, *to_fill)
    names = (*robot.coordinates, *LOADS, *DISPLACEMENTS, *POINT, "sigma_mm", "step", "time_s", "temperature_C")
    values = np.column_stack([m.q, m.wrench, m.displacement, m.point, m.sigma, m.step, m.time, m.temperature]).T
    columns = {"pose": m.pose}
    if shown is not None:
        columns |= {n: as_cells(n, v) for n, v in zip(shown.names, shown.controller(m.q).T, strict=True) if n in more}
    columns |= {name: as_cells(name, v) for name, v in zip(names, values, strict=True)}
    columns["repeat"] = tuple("" if number is None else str(number) for number in m.repeat)
    columns["phase"] = tuple(phase or "" for phase in m.phase)
    columns["session"] = m.session
    return {name: cells for name, cells in columns.items() if name in needed or any(cells)} | m.extra


def bundled_data(name: str) -> Path:
    """Path of the measurements bundled for a robot, by the robot's name.

    Raises
    ------
    InputError
        No measurements are bundled for that name.
    """
    files = {"fanuc-r2000ic": "fanuc_r2000ic.csv", "xr701": "xr701_gotlih.csv"}
    require_one_of("bundled measurements", name, files, code="A011")
    return Path(str(resources.files("doe").joinpath("data", files[name])))
