"""Relative displacements and twists between neighbouring arms under loads at the flange: the table in memory.

And the cells that its two kinds of files share, of joint twists and of reflector coordinates.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from doe.tables import columns as mc
from doe.tables.checks import joint_keys
from doe.tables.columns import DISPLACEMENTS, LOADS, PHASES, POINT, Columns, RawTable
from doe.tables.measurements import check_columns, columns_of, load_size, selected, stacked
from robots import InputError, Robot, forward_kinematics
from robots.arrays import Array, Bools, Indices
from robots.faults import Faults

# Per row, of translations and of rotations.
SIGMAS: Final = ("sigma_mm", "sigma_twist_mrad")
COMMON: Final = ("joint", "axes", "phase", "step", "pose", "repeat", "origin", *POINT)
LOADED: Final = ("x_mm", "y_mm", "z_mm")
UNLOADED: Final = ("x0_mm", "y0_mm", "z0_mm")
# One row a reflector: which reading it belongs to, on which arm it sits, its name.
REFLECTOR: Final = ("reading", "arm", "reflector", *UNLOADED, *LOADED)
ARMS: Final = ("before", "behind")
AXES: Final = ("flange", "base")
SYNTHETIC: Final = "synthetic"


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


def find_columns(table: RawTable, robot: Robot, faults: Faults) -> Columns:
    """Sort the header into known columns and unknown ones; what is wrong with it goes to ``faults``."""
    needed: dict[str, Sequence[str]] = {"column joint": ("joint",), "column phase": ("phase",)}
    if is_reflector_table(table):
        needed |= {f"column {name}": (name,) for name in REFLECTOR}
        return mc.find_columns(table, robot, faults, (*COMMON, *REFLECTOR, "sigma_mm"), needed)
    needed["column of a displacement or twist"] = DISPLACEMENTS
    return mc.find_columns(table, robot, faults, (*COMMON, *DISPLACEMENTS, *SIGMAS), needed)


@dataclass(frozen=True)
class Cells:
    """What each row of either kind of table says: pose, joint, load, phase, set-up. NaN, -1 or "" where faulty.

    Loads (n, 6) are in flange axes.
    """

    q: Array
    joint: Indices
    wrench: Array
    point: Array
    phase: tuple[str, ...]
    setup: tuple[str, ...]
    synthetic: bool


def read_cells(table: RawTable, columns: Columns, robot: Robot, faults: Faults) -> Cells:
    """Parse the columns that both kinds of table have."""
    cells = (table, columns)
    q = mc.joint_angles(*cells, robot, faults)
    wrench = mc.numbers(*cells, LOADS, faults, missing=0.0)
    point = mc.numbers(*cells, POINT, faults, missing=0.0)
    mc.numbers(*cells, ("step",), faults, empty="not known")

    def words(name: str) -> tuple[str, ...]:
        return mc.texts(table, columns.known.get(name))

    axes, watched, phase = tuple(text or "flange" for text in words("axes")), words("joint"), words("phase")
    known = {str(k + 1): k for k in range(robot.dof)} | {name: k for k, name in enumerate(robot.joint_names)}
    names = f"{', '.join(robot.joint_names)}, or 1 to {robot.dof}"
    check_among(
        table, watched, known, names, "joint", f"name the joint of {robot.name} between the two arms watched", faults
    )
    check_among(table, axes, AXES, ", ".join(AXES), "axes", "say in which axes the load is given", faults)
    check_among(table, phase, PHASES, ", ".join(PHASES), "phase", "use one of these words", faults)
    joint = np.array([known.get(text, -1) for text in watched], dtype=np.intp)
    turned = np.flatnonzero(
        [text == "base" and bool(np.isfinite(row).all()) for text, row in zip(axes, q, strict=True)]
    )
    if turned.size:
        R = forward_kinematics(robot, q[turned]).R_flange
        wrench[turned] = np.einsum("nji,nkj->nki", R, wrench[turned].reshape(-1, 2, 3)).reshape(-1, 6)
    made_up = any(SYNTHETIC in text.lower() for text in words("origin"))
    return Cells(q, joint, wrench, point, phase, _setups(q, joint, words("pose"), words("repeat")), made_up)


def check_among(
    table: RawTable, texts: Sequence[str], known: Collection[str], allowed: str, name: str, remedy: str, faults: Faults
) -> None:
    """Record cells of the column ``name`` that are not among those ``known``."""
    for line, text in zip(table.lines, texts, strict=True):
        if text not in known:
            problem = f"column {name}" + ("" if text else " is empty")
            faults.add(line, problem, code="J003", value=text or None, allowed=allowed, remedy=remedy)


def _setups(q: Array, joint: Indices, pose: Sequence[str], repeat: Sequence[str]) -> tuple[str, ...]:
    """One label for each set-up: joint watched, pose and repeat."""
    number: dict[object, int] = {}
    out = []
    for key, label, j, again in zip(joint_keys(np.nan_to_num(q)), pose, joint.tolist(), repeat, strict=True):
        place = number.setdefault((key, label, j, again), len(number) + 1)
        out.append(f"{label or f'set-up {place}'}/{j + 1}" + (f"/{again}" if again else ""))
    return tuple(out)
