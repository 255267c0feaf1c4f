"""Columns of a table of joint twists, or of reflector coordinates, and the cells that both kinds share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from doe.tables import columns as mc
from doe.tables.checks import joint_keys
from doe.tables.columns import DISPLACEMENTS, LOADS, PHASES, POINT, Columns, RawTable
from robots import Robot, forward_kinematics
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
    """What each row of either kind of table says: pose, joint, load, phase, labels. NaN or "" where faulty."""

    q: Array
    joint: Indices
    wrench: Array
    point: Array
    in_base: Bools
    phase: tuple[str, ...]
    pose: tuple[str, ...]
    repeat: tuple[str, ...]
    synthetic: bool


def read_cells(table: RawTable, columns: Columns, robot: Robot, faults: Faults) -> Cells:
    """Parse the columns that both kinds of table have."""
    cells = (table, columns)
    known = columns.known
    q = mc.numbers(*cells, robot.coordinates, faults, missing=0.0)
    wrench = mc.numbers(*cells, LOADS, faults, missing=0.0)
    point = mc.numbers(*cells, POINT, faults, missing=0.0)
    mc.numbers(*cells, ("step",), faults, empty="not known")

    def words(name: str) -> tuple[str, ...]:
        return mc.texts(table, known.get(name))

    axes = tuple(text or "flange" for text in words("axes"))
    _check(table, axes, AXES, "axes", "say in which axes the load is given", faults)
    _check(table, words("phase"), PHASES, "phase", "use one of these words", faults)
    return Cells(
        q, _joints(table, words("joint"), robot, faults), wrench, point,
        np.array([text == "base" for text in axes], dtype=np.bool_), words("phase"), words("pose"), words("repeat"),
        any(SYNTHETIC in text.lower() for text in words("origin")),
    )  # fmt: skip


def _check(
    table: RawTable, texts: Sequence[str], allowed: Sequence[str], name: str, remedy: str, faults: Faults
) -> None:
    for line, text in zip(table.lines, texts, strict=True):
        if text not in allowed:
            problem = f"column {name}" + ("" if text else " is empty")
            faults.add(line, problem, value=text or None, allowed=", ".join(allowed), remedy=remedy)


def _joints(table: RawTable, texts: Sequence[str], robot: Robot, faults: Faults) -> Indices:
    """Index of the joint watched, by name or number from 1."""
    known = {name: k for k, name in enumerate(robot.joint_names)}
    known = {str(k + 1): k for k in range(robot.dof)} | known
    out = np.full(len(texts), -1, dtype=np.intp)
    for i, text in enumerate(texts):
        if text in known:
            out[i] = known[text]
        else:
            faults.add(table.lines[i], "column joint" + ("" if text else " is empty"), value=text or None,
                       allowed=f"{', '.join(robot.joint_names)}, or 1 to {robot.dof}",
                       remedy=f"name the joint of {robot.name} between the two arms watched")  # fmt: skip
    return out


def in_flange_axes(robot: Robot, cells: Cells) -> Array:
    """Loads (n, 6) in flange axes."""
    out = cells.wrench.copy()
    rows = np.flatnonzero(cells.in_base & np.isfinite(cells.q).all(axis=1))
    if rows.size:
        R = forward_kinematics(robot, cells.q[rows]).R_flange
        out[rows] = np.einsum("nji,nkj->nki", R, out[rows].reshape(-1, 2, 3)).reshape(-1, 6)
    return out


def setup_labels(cells: Cells) -> tuple[str, ...]:
    """One label for each set-up: joint watched, pose and repeat."""
    keys = joint_keys(np.nan_to_num(cells.q))
    number: dict[object, int] = {}
    out = []
    for key, pose, joint, repeat in zip(keys, cells.pose, cells.joint.tolist(), cells.repeat, strict=True):
        place = number.setdefault((key, pose, joint, repeat), len(number) + 1)
        out.append(f"{pose or f'set-up {place}'}/{joint + 1}" + (f"/{repeat}" if repeat else ""))
    return tuple(out)
