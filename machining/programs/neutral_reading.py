"""Neutral programs read back: JSON to a whole :class:`JointProgram`, CSV to one without its tables."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from machining import magnitudes as limits
from machining.cell import Cell
from machining.programs.neutral import FRAME, SCHEMA, columns
from machining.programs.orientation import from_quaternions
from machining.programs.program import JointProgram
from machining.toolpaths.motions import Event, Motions, Note, Tool
from robots import InputError, Robot
from robots.arrays import Array, Integers
from robots.constants import MM_MIN, RPM
from robots.files.reading import parse_json
from robots.frames import framed
from robots.inverse.branches import BRANCH_NAMES
from robots.inverse.singularities import branch_of
from robots.inverse.spherical_wrist import why_not_spherical

# Degrees, and mm of external axes.
LARGEST_ANGLE = limits.FARTHEST * 1e3
_WHOLE = ("line", "inserted", "rapid", "tool", "operation", "branch")
_RANGES = {
    **dict.fromkeys(("line", "tool", "operation", "branch"), (-1.0, float(limits.LARGEST_NUMBER))),
    **dict.fromkeys(("inserted", "rapid"), (0.0, 1.0)),
    "feed_mm_min": (limits.SLOWEST / MM_MIN, limits.FASTEST / MM_MIN),
    "spindle_rpm": (-limits.FASTEST_TURN / RPM, limits.FASTEST_TURN / RPM),
    "dwell_s": (0.0, limits.LONGEST_REST),
}
# Quaternions farther from length 1 than this are a fault of the file, not of rounding.
UNIT = 1e-6


def program_from_json(text: str, robot: Robot, cell: Cell, where: str = "program") -> JointProgram:
    """A whole program from JSON, for the robot and cell that it was written for.

    Raises
    ------
    InputError
        No JSON, another schema, another robot, other axes; a missing key or column, a value of the wrong kind.
    """
    data = _object(text, where)
    for key, value, wanted in (
        ("robot", _get(data, "robot", where), robot.name),
        ("joints", _get(data, "joints", where), robot.dof),
        ("linear_axes", len(_list(data, "linear_axes", where)), len(cell.linear_axes)),
        ("turntable", _get(data, "turntable", where), cell.turntable is not None),
    ):
        if value != wanted:
            raise InputError(f"{where}, {key}", value=str(value)[:80], allowed=str(wanted))
    table = _table(data, robot.dof, len(cell.linear_axes), where)
    T = _frames(table, where)
    try:
        motions = _motions(data, table, T, where)
        branch = _integers(table["branch"])
    except InputError:
        raise
    except (TypeError, ValueError, KeyError, OverflowError) as error:
        raise InputError(f"{where}: {type(error).__name__}: {error}", remedy="write the file again") from error
    names = tuple(str(name) for name in _list(data, "branches", where))
    return _program(robot, cell, motions, T, table, branch, names)


def program_from_csv(text: str, robot: Robot, cell: Cell, where: str = "program") -> JointProgram:
    """A program from CSV: tables of tools and operations are not in it, branches are told from the joints.

    Errors as :func:`moves_from_csv`.
    """
    table = moves_from_csv(text, robot.dof, len(cell.linear_axes), where)
    T = _frames(table, where)
    none = np.zeros(len(T), dtype=np.int64)
    motions = _moves(table, T, tool=none, operation=none, source=where)
    named = why_not_spherical(robot) is None
    q = _joints(table, robot)
    branch, names = (branch_of(robot, q), BRANCH_NAMES) if named else (none, ())
    return _program(robot, cell, motions, T, table, branch, names)


def _program(
    robot: Robot,
    cell: Cell,
    motions: Motions,
    T: Array,
    table: Mapping[str, Array],
    branch: Integers,
    names: tuple[str, ...],
) -> JointProgram:
    axes = len(cell.linear_axes)
    travel = np.array([table[f"e{i + 1}_mm"] for i in range(axes)]).reshape(axes, len(T)).T
    return JointProgram(
        robot=robot,
        cell=cell,
        motions=motions,
        T_part_tool=T,
        q=_joints(table, robot),
        travel=travel * 1e-3,
        table=np.radians(table["table_deg"]),
        gamma=np.radians(table["gamma_deg"]),
        branch=branch,
        names=names,
        inserted=table["inserted"] != 0.0,
    )


def _joints(table: Mapping[str, Array], robot: Robot) -> Array:
    return np.radians(np.stack([table[f"q{i + 1}_deg"] for i in range(robot.dof)], axis=1))


def moves_from_csv(text: str, dof: int, linear: int, where: str = "program") -> dict[str, Array]:
    """Columns (n,) of a CSV program by name, as numbers; tool, operation and branch are left out.

    Raises
    ------
    InputError
        Another schema or other columns, a row of another length, a field that is no finite number.
    """
    lines = text.splitlines()
    if not lines or lines[0].strip() != f"# {SCHEMA}":
        raise InputError(f"{where}, first line", value=lines[0][:80] if lines else "", allowed=f"# {SCHEMA}")
    try:
        records = list(csv.reader(lines[1:]))
    except csv.Error as error:
        raise InputError(f"{where} is not valid CSV ({error})", remedy="write the program again") from error
    wanted = columns(dof, linear)
    if not records or records[0] != wanted:
        raise InputError(f"{where}, names of columns", allowed=",".join(wanted))
    words = {"tool", "operation", "branch"}
    kept = [i for i, name in enumerate(wanted) if name not in words]
    rows = []
    for i, record in enumerate(records[1:], 3):
        if len(record) != len(wanted):
            raise InputError(f"{where}, line {i}", value=f"{len(record)} fields", allowed=f"{len(wanted)}")
        try:
            rows.append([float(record[k] or "nan") for k in kept])
        except ValueError as error:
            raise InputError(f"{where}, line {i}: {error}", allowed="numbers") from error
    table = _columns([wanted[i] for i in kept], rows, where)
    _frames(table, where)
    return table


def _object(text: str, where: str) -> Mapping[str, Any]:
    data = parse_json(text, where, remedy="write the file again")
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        found = data.get("schema") if isinstance(data, dict) else type(data).__name__
        raise InputError(f"{where}, schema", value=str(found)[:80], allowed=SCHEMA)
    return data


def _get(data: Mapping[str, Any], key: str, where: str) -> Any:
    if key not in data:
        raise InputError(f"{where}: no {key}", remedy="write the file again")
    return data[key]


def _list(data: Mapping[str, Any], key: str, where: str) -> list[Any]:
    value = _get(data, key, where)
    if not isinstance(value, list):
        raise InputError(f"{where}, {key}", value=type(value).__name__, allowed="a list")
    return value


def _table(data: Mapping[str, Any], dof: int, linear: int, where: str) -> dict[str, Array]:
    wanted = columns(dof, linear)
    if _list(data, "columns", where) != wanted:
        raise InputError(f"{where}, columns", allowed=", ".join(wanted))
    rows = _list(data, "moves", where)
    for i, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != len(wanted):
            raise InputError(f"{where}, move {i + 1}", allowed=f"a list of {len(wanted)} values")
        if not all(v is None or isinstance(v, int | float) for v in row):
            raise InputError(f"{where}, move {i + 1}", allowed="numbers, true, false or null")
    return _columns(wanted, [[np.nan if v is None else float(v) for v in row] for row in rows], where)


def _columns(names: Sequence[str], rows: Sequence[Sequence[float]], where: str) -> dict[str, Array]:
    values = np.array(rows, dtype=np.float64).reshape(len(rows), len(names))
    table = dict(zip(names, values.T.copy(), strict=True))
    for name, column in table.items():
        least, most = _RANGES.get(name, (-LARGEST_ANGLE, LARGEST_ANGLE))
        good = (column >= least) & (column <= most)
        if name in ("feed_mm_min", "spindle_rpm"):
            good |= np.isnan(column)
        elif name in _WHOLE:
            good &= column == np.rint(column)
        if not good.all():
            row = int(np.argmin(good))
            allowed = f"a {'whole' if name in _WHOLE else 'finite'} number from {least:g} to {most:g}"
            value = "none" if np.isnan(column[row]) else f"{column[row]:g}"
            raise InputError(f"{where}, move {row + 1}, {name}", value=value, allowed=allowed)
    return table


def _frames(table: Mapping[str, Array], where: str) -> Array:
    values = np.stack([table[name] for name in FRAME], axis=1)
    off = np.abs(np.linalg.norm(values[:, 3:], axis=1) - 1.0)
    if (off > UNIT).any():
        raise InputError(f"{where}, move {int(np.argmax(off > UNIT)) + 1}, qw to qz", allowed="a unit quaternion")
    return framed(from_quaternions(values[:, 3:]), values[:, :3] * 1e-3)


def _motions(data: Mapping[str, Any], table: Mapping[str, Array], T: Array, where: str) -> Motions:
    tools = tuple(
        Tool(
            None if tool["number"] is None else int(tool["number"]),
            str(tool["name"]),
            *(_metres(tool[key]) for key in ("diameter_mm", "corner_radius_mm", "length_mm")),
        )
        for tool in _list(data, "tools", where)
    )
    events = tuple(
        Event(int(e["line"]), int(e["before_move"]), str(e["word"]), str(e["text"]))
        for e in _list(data, "events", where)
    )
    notes = tuple(Note(int(n["line"]), str(n["text"]), int(n["count"])) for n in _list(data, "notes", where))
    return _moves(
        table,
        T,
        tool=_integers(table["tool"]),
        operation=_integers(table["operation"]),
        tools=tools,
        operations=tuple(str(name) for name in _list(data, "operations", where)),
        events=events,
        notes=notes,
        source=str(_get(data, "source", where)),
    )


def _moves(table: Mapping[str, Array], T: Array, **others: Any) -> Motions:
    """Moves along tool frames T (n, 4, 4) m; ``others``: fields of :class:`Motions` that are no columns of numbers."""
    return Motions(
        points=np.ascontiguousarray(T[:, :3, 3]),
        # The tool frame's z leads out of the holder through the tip.
        axes=np.ascontiguousarray(-T[:, :3, 2]),
        rapid=table["rapid"] != 0.0,
        feed=table["feed_mm_min"] * MM_MIN,
        line=_integers(table["line"]),
        spindle=table["spindle_rpm"] * RPM,
        dwell=table["dwell_s"],
        **others,
    )


def _metres(value: float | None) -> float:
    return np.nan if value is None else float(value) * 1e-3


def _integers(column: Array) -> Integers:
    return np.asarray(np.rint(column), dtype=np.int64)
