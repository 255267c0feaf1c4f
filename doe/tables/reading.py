"""Measurement tables in files: read with every fault named, and written."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib import resources
from itertools import compress
from pathlib import Path

import numpy as np

from doe.tables import columns as mc
from doe.tables.checks import (
    check_duplicates,
    check_labels,
    check_limits,
    check_loads,
    check_read,
    joint_keys,
    plausibility_notes,
)
from doe.tables.columns import DISPLACEMENTS, LOADS, POINT, Columns, RawTable
from doe.tables.measurements import Measurements
from robots import InputError, Robot, require_one_of
from robots.arrays import Array, Bools
from robots.errors import line_ranges, listed
from robots.faults import Faults
from robots.files.csv_text import write_rows
from robots.files.written import written_whole


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
    return measurements_of(mc.read_table(Path(path)), robot, check_reach=check_reach)


def measurements_of(table: RawTable, robot: Robot, *, check_reach: bool = True) -> Measurements:
    """Readings of a table of text, as :func:`read_measurements`."""
    m, columns = _checked(table, robot, check_reach, (check_read, check_loads, check_labels, check_duplicates))
    unread = np.asarray(~m.used.any(axis=1), dtype=np.bool_)
    notes = (*column_notes(table, columns, robot), *_unread_notes(m, unread))
    m = m.select(~unread)
    return replace(m, notes=(*notes, *plausibility_notes(m)))


def read_set_ups(path: str | Path, robot: Robot) -> tuple[Measurements, tuple[str, ...]]:
    """Every row of a measurement table or of a sheet to fill in, read or not, and its deflection columns.

    Raises
    ------
    InputError
        As :func:`read_measurements`; a sheet in which nothing was read yet is none.
    """
    table = mc.read_table(Path(path))
    m, columns = _checked(table, robot, True, (check_loads, check_labels, check_duplicates))
    notes = tuple(column_notes(table, columns, robot))
    return replace(m, notes=notes), tuple(name for name in DISPLACEMENTS if name in columns.known)


def _checked(
    table: RawTable, robot: Robot, check_reach: bool, checks: Sequence[Callable[[Measurements, Faults], None]]
) -> tuple[Measurements, Columns]:
    faults = Faults(table.name)
    columns = mc.find_columns(table, robot, faults)
    header_fits = not faults.count
    m = _assemble(mc.drop_ragged(table, faults), columns, robot, faults)
    if header_fits and m.n:
        for check in checks:
            check(m, faults)
        if check_reach:
            check_limits(m.q, m.pose, m.row_numbers, robot, faults)
    faults.raise_if_any("measurements")
    return m, columns


def _assemble(table: RawTable, columns: Columns, robot: Robot, faults: Faults) -> Measurements:
    """Parse all cells; rows with a fault are recorded and left out, so that later checks see numbers only."""
    cells = (table, columns)
    q = mc.joint_angles(*cells, robot, faults)
    wrench = mc.numbers(*cells, LOADS, faults, missing=0.0)
    displacement = mc.numbers(*cells, DISPLACEMENTS, faults, empty="not read")
    point = mc.numbers(*cells, POINT, faults, empty="the tool point")
    sigma = mc.numbers(*cells, ("sigma_mm",), faults, empty="not known", positive=True)[:, 0]
    step = mc.numbers(*cells, ("step",), faults, empty="not known")[:, 0]
    time, temperature = mc.numbers(*cells, ("time_s", "temperature_C"), faults, empty="not known").T
    mc.check_words(table, columns, faults)
    good = np.array([line not in faults.lines for line in table.lines], dtype=np.bool_)

    def words(index: int | None) -> tuple[str, ...]:
        return tuple(compress(mc.texts(table, index), good))

    known = columns.known
    return Measurements(
        source=table.name,
        sha256=table.sha256,
        q=q[good],
        wrench=wrench[good],
        displacement=displacement[good],
        point=point[good],
        sigma=sigma[good],
        step=step[good],
        pose=words(known["pose"]) if "pose" in known else _labels(q[good]),
        repeat=tuple(int(text) if text else None for text in words(known.get("repeat"))),
        phase=tuple(text or None for text in words(known.get("phase"))),
        row_numbers=tuple(compress(table.lines, good)),
        extra={name: words(index) for name, index in columns.unknown.items()},
        notes=(),
        time=time[good],
        temperature=temperature[good],
        session=words(known.get("session")),
    )


def _labels(q: Array) -> tuple[str, ...]:
    found: dict[tuple[float, ...], str] = {}
    return tuple(found.setdefault(key, f"P{len(found) + 1}") for key in joint_keys(q))


def column_notes(table: RawTable, columns: Columns, robot: Robot) -> Iterator[str]:
    """Say which columns are missing, and which are not used."""
    shown = () if robot.controller is None else robot.controller.names
    joints = shown if any(name in columns.known and name not in robot.coordinates for name in shown) else ()
    for kind, group in (("joint", joints or robot.coordinates), ("load", LOADS)):
        if missing := [name for name in group if name not in columns.known]:
            yield f"{kind} columns missing, taken as 0: {', '.join(missing)}"
    if columns.unknown:
        yield f"unknown columns, kept but not used: {listed(columns.unknown)}"
    yield from table.notes


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
    def column(name: str, values: Array) -> tuple[str, ...]:
        return tuple("" if np.isnan(v) else f"{v:.15g}" for v in (values / mc.si_factor(name) + 0.0).tolist())

    # A sheet is filled in at the pendant: it shows the angles of its controller too.
    shown = robot.controller if to_fill else None
    more = () if shown is None else tuple(name for name in shown.names if name not in robot.coordinates)
    needed = ("pose", *more, *robot.coordinates, *LOADS, *to_fill)
    names = (*robot.coordinates, *LOADS, *DISPLACEMENTS, *POINT, "sigma_mm", "step", "time_s", "temperature_C")
    values = np.column_stack([m.q, m.wrench, m.displacement, m.point, m.sigma, m.step, m.time, m.temperature]).T
    columns = {"pose": m.pose}
    if shown is not None:
        columns |= {n: column(n, v) for n, v in zip(shown.names, shown.controller(m.q).T, strict=True) if n in more}
    columns |= {name: column(name, v) for name, v in zip(names, values, strict=True)}
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
