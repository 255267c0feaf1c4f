"""Relative displacements and twists between neighbouring arms under loads at the flange: the table in memory.

And the cells that its two kinds of files share, of joint twists and of reflector coordinates.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from doe.tables.checks import joint_keys
from doe.tables.columns import DISPLACEMENTS, LOADS, PHASES, POINT, RawTable
from doe.tables.measurements import check_columns, columns_of, load_size, selected, stacked
from doe.tables.schema import (
    LOAD_COLUMNS,
    READ_COLUMNS,
    SIGMA,
    STEP,
    WHOLE_POINT,
    Cells,
    Column,
    angle_columns,
    one_of,
)
from robots import InputError, Robot, forward_kinematics
from robots.arrays import Array, Bools, Indices
from robots.faults import Faults

# Per row, of translations and of rotations.
SIGMAS: Final = ("sigma_mm", "sigma_twist_mrad")
LOADED: Final = ("x_mm", "y_mm", "z_mm")
UNLOADED: Final = ("x0_mm", "y0_mm", "z0_mm")
# One row a reflector: which reading it belongs to, on which arm it sits, its name.
REFLECTOR: Final = ("reading", "arm", "reflector", *UNLOADED, *LOADED)
ARMS: Final = ("before", "behind")
AXES: Final = ("flange", "base")
SYNTHETIC: Final = "synthetic"


def _word(name: str, words: tuple[str, ...], remedy: str) -> Column:
    return Column(name, words=words, allowed=", ".join(words), remedy=remedy, code="J003")


COMMON: Final = (
    *LOAD_COLUMNS,
    *(Column(name, missing=0.0) for name in POINT),
    STEP,
    _word("axes", AXES, "say in which axes the load is given"),
    _word("phase", PHASES, "use one of these words"),
    *(Column(name) for name in ("pose", "repeat", "origin")),
)
TWIST_COLUMNS: Final = (*READ_COLUMNS, *(Column(name, "not known", positive=True) for name in SIGMAS))
REFLECTOR_COLUMNS: Final = (
    *(Column(name) for name in ("reading", "reflector", *UNLOADED, *LOADED)),
    _word("arm", ARMS, "say whether the reflector sits on the arm before or behind the joint"),
    SIGMA,
)


@dataclass(frozen=True, eq=False)
class TwistReadings:
    """Readings of n loads, each of one joint; SI.

    ``q`` (n, dof) rad; ``joint`` (n,) index of the joint watched; ``wrench`` (n, 6) N, N m at ``point``, flange axes;
    ``point`` (n, 3) m, flange frame. ``twist`` (n, 6): displacement (m) and rotation (rad) of the arm behind the joint
    against the arm before it, in the joint's modified DH frame (Z along the gear axis, turning with the arm behind the
    joint), at that frame's origin; NaN = not read. ``sigma`` (n, 6): their standard deviations, NaN = not given.
    ``phase`` (n,): loading or unloading. ``setup`` (n,): label of the set-up. ``row_numbers``: lines of the file.
    ``synthetic``: the table says that it was made up.

    Raises
    ------
    InputError
        A field has another length than ``q``.
    """

    source: str
    sha256: str
    q: Array
    joint: Indices
    wrench: Array
    point: Array
    twist: Array
    sigma: Array
    phase: tuple[str, ...]
    setup: tuple[str, ...]
    row_numbers: tuple[int, ...]
    synthetic: bool
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        check_columns("twist readings", columns_of(self), self.q, wrench=6, point=3, twist=6, sigma=6)

    @property
    def n(self) -> int:
        """Number of readings."""
        return len(self.q)

    @property
    def load(self) -> Array:
        """Size of the load (n,): of the force, or of the moment where there is no force."""
        return load_size(self.wrench)

    @property
    def is_loading(self) -> Bools:
        """Which readings were taken on the way up (n,)."""
        return np.array([phase == "loading" for phase in self.phase], dtype=np.bool_)

    def select(self, mask: Bools) -> TwistReadings:
        """The readings where ``mask`` (n,) is true."""
        return replace(self, **selected(self, mask))  # type: ignore[arg-type]


def joined(tables: Sequence[TwistReadings]) -> TwistReadings:
    """Several tables of one robot as one; set-ups of different files stay apart.

    Raises
    ------
    InputError
        No table, the same file twice, or synthetic and measured tables together.
    """
    if not tables:
        raise InputError("tables of joint twists", code="J003", value=0, allowed="1 or more")
    if len(tables) == 1:
        return tables[0]
    if len({t.sha256 for t in tables}) < len(tables):
        raise InputError("tables of joint twists: the same file twice", code="J003", remedy="leave one of them out")
    if len({t.synthetic for t in tables}) > 1:
        raise InputError(
            "tables of joint twists: synthetic and measured ones together",
            code="J003",
            value=", ".join(t.source for t in tables if t.synthetic),
            allowed="either kind",
            remedy="leave the synthetic ones out",
        )
    apart = [replace(t, setup=tuple(f"{label} ({t.source})" for label in t.setup)) for t in tables]
    return replace(
        tables[0],
        **stacked(apart),  # type: ignore[arg-type]
        source=" + ".join(t.source for t in tables),
        sha256=hashlib.sha256("".join(t.sha256 for t in tables).encode()).hexdigest(),
        notes=tuple(f"{t.source}: {note}" for t in tables for note in t.notes),
    )


def is_reflector_table(table: RawTable) -> bool:
    """Whether the header is one of reflector coordinates: one row a reflector."""
    return "reflector" in table.header or any(name in table.header for name in (*LOADED, *UNLOADED))


def sorted_header(table: RawTable, robot: Robot, faults: Faults) -> Cells:
    """The table's cells by column; what is wrong with the header goes to ``faults``."""
    needed: dict[str, Sequence[str]] = {f"joint column of {robot.name}": robot.angle_names, "load column": LOADS}
    needed |= {"column joint": ("joint",), "column phase": ("phase",)}
    if is_reflector_table(table):
        columns, needed = REFLECTOR_COLUMNS, needed | {f"column {name}": (name,) for name in REFLECTOR}
    else:
        columns, needed = TWIST_COLUMNS, needed | {"column of a displacement or twist": DISPLACEMENTS}
    joint = Column(
        "joint",
        words=joints_by_name(robot),
        allowed=f"{', '.join(robot.joint_names)}, or 1 to {robot.dof}",
        remedy=f"name the joint of {robot.name} between the two arms watched",
        code="J003",
    )
    needs = (*(one_of(what, names, table.hint) for what, names in needed.items()), WHOLE_POINT)
    return Cells.of(table, (*angle_columns(robot), joint, *COMMON, *columns), needs, faults, robot)


def joints_by_name(robot: Robot) -> dict[str, int]:
    """Places of the joints by what a table calls them: number or name."""
    return {str(k + 1): k for k in range(robot.dof)} | {name: k for k, name in enumerate(robot.joint_names)}


def common_columns(cells: Cells, robot: Robot) -> dict[str, Any]:
    """What either kind of table says of each row: pose, joint, load in flange axes, phase, set-up."""
    q, wrench = cells.angles(robot), cells.numbers(*LOADS)
    point, _ = cells.numbers(*POINT), cells.numbers("step")
    watched, axes, phase = cells.words("joint"), cells.words("axes", "flange"), cells.words("phase")
    known = joints_by_name(robot)
    joint = np.array([known.get(text, -1) for text in watched], dtype=np.intp)
    turned = np.flatnonzero(np.isfinite(q).all(axis=1) & np.array([text == "base" for text in axes], dtype=np.bool_))
    if turned.size:
        R = forward_kinematics(robot, q[turned]).R_flange
        wrench[turned] = np.einsum("nji,nkj->nki", R, wrench[turned].reshape(-1, 2, 3)).reshape(-1, 6)
    setup = _setups(q, joint, cells.texts("pose"), cells.texts("repeat"))
    return {"q": q, "joint": joint, "wrench": wrench, "point": point, "phase": phase, "setup": setup}


def _setups(q: Array, joint: Indices, pose: Sequence[str], repeat: Sequence[str]) -> tuple[str, ...]:
    """One label for each set-up: joint watched, pose and repeat."""
    number: dict[object, int] = {}
    out = []
    for key, label, j, again in zip(joint_keys(np.nan_to_num(q)), pose, joint.tolist(), repeat, strict=True):
        place = number.setdefault((key, label, j, again), len(number) + 1)
        out.append(f"{label or f'set-up {place}'}/{j + 1}" + (f"/{again}" if again else ""))
    return tuple(out)
