"""Neutral programs: everything of a :class:`JointProgram` as columns of moves; written without templates.

Schema ``stiffarm-program/2``. Each move has its source line; joint angles are the project's own (no controller's sign
or zero); lengths in mm, angles in deg, feeds in mm/min, speeds in rpm. Numbers have all their digits. What is not known
is null, or an empty field.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from machining import magnitudes as limits
from machining.cell import Cell
from machining.programs.orientation import from_quaternions, quaternions
from machining.programs.program import JointProgram
from machining.toolpaths.motions import Motions
from robots import InputError, Robot
from robots.arrays import Array, Integers
from robots.constants import MM_MIN, RPM
from robots.frames import framed

SCHEMA = "stiffarm-program/2"
BLOCK = 2000
# Columns between the fixed ones in front and the frame behind: q1_deg ..., e1_mm ..., table_deg.
FRONT = (
    "line",
    "inserted",
    "rapid",
    "feed_mm_min",
    "tool",
    "spindle_rpm",
    "dwell_s",
    "operation",
    "branch",
    "gamma_deg",
)
FRAME = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
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


def columns(robot: Robot, cell: Cell) -> list[str]:
    """Names of the columns of moves."""
    joints = [f"q{i + 1}_deg" for i in range(robot.dof)]
    return [*FRONT, *joints, *(f"e{i + 1}_mm" for i in range(len(cell.linear_axes))), "table_deg", *FRAME]


def rows(program: JointProgram, first: int, last: int) -> Iterator[list[object]]:
    """Rows of moves ``first`` to ``last`` (not with it); None where something is not known."""
    m, part = program.motions, slice(first, last)
    T = program.T_part_tool[part]
    data = (
        m.line[part],
        program.inserted[part],
        m.rapid[part],
        _nullable(m.feed[part] / MM_MIN),
        m.tool[part],
        _nullable(m.spindle[part] / RPM),
        m.dwell[part],
        m.operation[part],
        program.branch[part],
        np.degrees(program.gamma[part]),
        *np.degrees(program.q[part]).T,
        *(program.travel[part] * 1e3).T,
        np.degrees(program.table[part]),
        *(T[:, :3, 3] * 1e3).T,
        *quaternions(T[:, :3, :3]).T,
    )
    yield from map(list, zip(*(c if isinstance(c, list) else c.tolist() for c in data), strict=True))


def _nullable(column: Array) -> list[float | None]:
    return [v if math.isfinite(v) else None for v in column.tolist()]


def table_of(names: Sequence[str], rows: ArrayLike, where: str) -> dict[str, Array]:
    """Columns (n,) by name, NaN where not known. Raises InputError for a number that is out of its range."""
    values = np.asarray(rows, dtype=np.float64).reshape(-1, len(names))
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
            raise InputError(f"{where}, move {row + 1}, {name}", code="Q005", value=value, allowed=allowed)
    return table


def program_of(
    robot: Robot, cell: Cell, table: Mapping[str, Array], where: str, file_lines: Integers | None, **others: Any
) -> JointProgram:
    """The program of columns (n,); ``others``: fields of programs and motions that are no columns of numbers.

    Raises
    ------
    InputError
        A frame whose quaternion is none, and as :class:`Motions` and :class:`JointProgram`.
    """
    values = np.stack([table[name] for name in FRAME], axis=1)
    off = np.abs(np.linalg.norm(values[:, 3:], axis=1) - 1.0)
    if (off > UNIT).any():
        raise InputError(
            f"{where}, move {int(np.argmax(off > UNIT)) + 1}, qw to qz", code="Q005", allowed="a unit quaternion"
        )
    T = framed(from_quaternions(values[:, 3:]), values[:, :3] * 1e-3)
    of_program = {name: others.pop(name) for name in ("branch", "names")}
    axes = len(cell.linear_axes)
    motions = Motions(
        points=np.ascontiguousarray(T[:, :3, 3]),
        # The tool frame's z leads out of the holder through the tip.
        axes=np.ascontiguousarray(-T[:, :3, 2]),
        rapid=table["rapid"] != 0.0,
        feed=table["feed_mm_min"] * MM_MIN,
        line=integers(table["line"]),
        spindle=table["spindle_rpm"] * RPM,
        dwell=table["dwell_s"].copy(),
        **others,
    )
    return JointProgram(
        robot=robot,
        cell=cell,
        motions=motions,
        T_part_tool=T,
        q=joints_of(robot, table),
        travel=np.array([table[f"e{i + 1}_mm"] for i in range(axes)]).reshape(axes, len(T)).T * 1e-3,
        table=np.radians(table["table_deg"]),
        gamma=np.radians(table["gamma_deg"]),
        inserted=table["inserted"] != 0.0,
        file_lines=file_lines,
        **of_program,
    )


def joints_of(robot: Robot, table: Mapping[str, Array]) -> Array:
    """Joint angles (n, dof) rad of columns."""
    return np.radians(np.stack([table[f"q{i + 1}_deg"] for i in range(robot.dof)], axis=1))


def integers(column: Array) -> Integers:
    """A column of whole numbers as such."""
    return np.asarray(np.rint(column), dtype=np.int64)
