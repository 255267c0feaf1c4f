"""What `stiffarm verify` reads: the arm with its bodies, the cell, and a neutral program."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from machining.cell import ArmBodies, Cell, arm_bodies
from machining.programs.neutral import SCHEMA
from machining.programs.neutral_reading import moves_from_csv, program_from_json
from machining.programs.orientation import framed, from_quaternions
from machining.programs.program import JointProgram
from machining.toolpaths.motions import Motions
from robots import InputError, ModelDescription, Robot, load_description, read_urdf
from robots.constants import MM_MIN, RPM
from robots.files.reading import read_text
from robots.inverse.branches import BRANCH_NAMES
from robots.inverse.singularities import branch_of
from robots.inverse.spherical_wrist import why_not_spherical
from robots.urdf.xml import is_xml


@dataclass(frozen=True, eq=False)
class GivenProgram:
    """A program read from a file, and the line of the file that each move stands in, None where not known."""

    program: JointProgram
    lines: tuple[int, ...] | None


def read_arm(model: str) -> tuple[ModelDescription, ArmBodies]:
    """Description and bodies of a bundled robot, a model file or a URDF.

    Raises
    ------
    InputError
        As the readers; a model without any shape.
    """
    path = Path(model)
    if path.is_file() and is_xml(path):
        urdf = read_urdf(path)
        return urdf.description, arm_bodies(urdf.description, urdf)
    description = load_description(model)
    return description, arm_bodies(description)


def read_program(path: Path, robot: Robot, cell: Cell) -> GivenProgram:
    """A neutral program, JSON or CSV, for the robot and cell that it was written for.

    Raises
    ------
    InputError
        Another kind of file, and what the readers refuse.
    """
    kind = path.suffix.lower()
    if kind not in (".json", ".csv"):
        raise InputError(
            f"program {path.name}",
            value=kind or "no ending",
            allowed=f".json or .csv, {SCHEMA}",
            remedy="write the program with `stiffarm post` in one of these formats; controllers' own are not replayed",
        )
    text = read_text(path, "program")
    if kind == ".json":
        program = program_from_json(text, robot, cell, path.name)
        return GivenProgram(program, _lines_of_json(text, program.n))
    return _from_csv(text, robot, cell, path.name)


def _lines_of_json(text: str, n: int) -> tuple[int, ...] | None:
    """Lines of the rows of moves, where each stands in a line of its own."""
    lines = text.splitlines()
    first = next((i for i, line in enumerate(lines) if '"moves"' in line), None)
    if first is None:
        return None
    rows = [line.strip() for line in lines[first + 1 : first + 1 + n]]
    alone = len(rows) == n and all(row.startswith("[") and row.rstrip(",").endswith("]") for row in rows)
    return tuple(range(first + 2, first + 2 + n)) if alone else None


def _from_csv(text: str, robot: Robot, cell: Cell, where: str) -> GivenProgram:
    """A program from CSV: tables of tools and operations are not in it, branches are told from the joints."""
    linear = len(cell.linear_axes)
    table = moves_from_csv(text, robot.dof, linear, where)
    n = len(table["line"])
    frame = np.stack([table[k] for k in ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")], axis=1)
    T = framed(from_quaternions(frame[:, 3:]), frame[:, :3] * 1e-3)
    q = np.radians(np.stack([table[f"q{i + 1}_deg"] for i in range(robot.dof)], axis=1))
    none = np.zeros(n, dtype=np.int64)
    motions = Motions(
        points=np.ascontiguousarray(T[:, :3, 3]),
        axes=np.ascontiguousarray(-T[:, :3, 2]),
        rapid=table["rapid"] != 0.0,
        feed=table["feed_mm_min"] * MM_MIN,
        line=np.rint(table["line"]).astype(np.int64),
        tool=none,
        spindle=table["spindle_rpm"] * RPM,
        dwell=table["dwell_s"],
        operation=none,
        source=where,
    )
    named = why_not_spherical(robot) is None
    program = JointProgram(
        robot=robot,
        cell=cell,
        motions=motions,
        T_part_tool=T,
        q=q,
        travel=np.array([table[f"e{i + 1}_mm"] for i in range(linear)]).reshape(linear, n).T * 1e-3,
        table=np.radians(table["table_deg"]),
        gamma=np.radians(table["gamma_deg"]),
        branch=branch_of(robot, q) if named else none,
        names=BRANCH_NAMES if named else (),
        inserted=table["inserted"] != 0.0,
    )
    # The line of the schema and that of the names come first.
    return GivenProgram(program, tuple(range(3, 3 + n)))
