"""What machining commands share: the path, the cell or the frames that stand for one, the cutting force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer

from fem import compliance
from machining import Drive, Task, ToolPath, read_path
from machining.cell import ArmBodies, Cell, Tool, arm_of, clearance, clearance_of, middle_pose, read_cell, scene_of
from machining.cutting import ConstantForce, CuttingForce, ToolBending, read_milling
from machining.toolpaths import Motions, ReadOptions, read_toolpath, to_tool_path
from robots import InputError, Robot
from robots.arrays import Array
from stiffarm.session.console import say
from stiffarm.session.inputs import ModelInput
from stiffarm.session.parsing import parse_frame, parse_joint_figures, parse_vector

CellOpt = Annotated[
    Path | None,
    typer.Option(
        "--cell",
        metavar="CELL.toml",
        help="Cell file (TOML): tool, part, fixtures, floor, linear axes and joint speeds.",
    ),
]
ForceOpt = Annotated[
    str | None,
    typer.Option(
        "--force",
        metavar="X,Y,Z",
        help="Cutting force on the tool, in N, in the axes of --force-axes; predicts the resulting surface error.",
    ),
]
ForceAxesOpt = Annotated[
    str, typer.Option("--force-axes", help="Axes of --force: base, part, or process (feed, cross-feed, tool axis).")
]
MillingOpt = Annotated[
    Path | None,
    typer.Option(
        "--milling",
        metavar="MILLING.toml",
        help="Milling file (TOML) with end mill, cut and coefficients; replaces --force.",
    ),
]
KindOpt = Annotated[
    str | None, typer.Option("--kind", help="Format of the tool-path file: apt, gcode or csv. Default: by its name.")
]
UnitsOpt = Annotated[
    str | None,
    typer.Option("--units", help="Length unit of the tool-path file (mm or inch), if the file does not state it."),
]
RotaryOpt = Annotated[
    str, typer.Option("--rotary", help="Rotary axes of the machine for G-code: none, or as in table-AC or head-BC.")
]
TcpOpt = Annotated[
    bool,
    typer.Option("--tcp", help="G-code coordinates are the tool tip from the first line on, without G43.4 or TRAORI."),
]
# Remarks of a reader on the screen.
NOTES_SHOWN = 10
# Clearance is weighed from this many times the safety distance on, and from this far at least, m.
ZONE = 3.0
LEAST_ZONE = 0.02


@dataclass(frozen=True, eq=False)
class Setup:
    """A cell, and the arm's bodies in it; ``arm`` is None where no surfaces are known, so nothing can collide."""

    cell: Cell
    arm: ArmBodies | None

    def drive(self, drive: Drive, *, clear: bool = True) -> Drive:
        """The drive with the cell's joint speeds and, if ``clear``, the arm's clearance with all axes at 0."""
        if drive.speed is None and self.cell.joint_speed is not None:
            drive = replace(drive, speed=self.cell.joint_speed)
        if self.arm is None:
            return drive
        drive = replace(drive, clearance_zone=self.zone, clearance_least=self.cell.safety)
        if not clear:
            return drive
        return replace(drive, clearance_of=clearance_of(self.cell, self.arm, within=self.zone))

    @property
    def zone(self) -> float:
        """Distance (m) from which on clearance is weighed."""
        return max(ZONE * self.cell.safety, LEAST_ZONE)

    def clearance(self, table: float = 0.0) -> Callable[[Array, Array], Array] | None:
        """Clearance (k,) m of poses (k, dof) rad with the linear axes at (k, axes) m; None without surfaces."""
        if self.arm is None:
            return None
        scene, zone = scene_of(self.cell, self.arm), self.zone
        return lambda q, e: clearance(scene, q, e, np.array([table]), within=zone).distance


def read_setup(model: str, robot: Robot, cell: Path | None, tool: str | None, part: str | None) -> Setup:
    """The cell of ``--cell``, or one without surfaces from ``--tool`` and ``--part``.

    Raises
    ------
    InputError
        A cell file together with a frame that it holds itself.
    """
    if cell is None:
        T_tool = robot.T_flange_tool if tool is None else parse_frame(tool, "--tool")
        T_part = np.eye(4) if part is None else parse_frame(part, "--part")
        return Setup(Cell(T_world_part0=T_part, tool=Tool(T_tool)), None)
    for option, value in (("--tool", tool), ("--part", part)):
        if value is not None:
            raise InputError(
                f"{option} with --cell", value=value, allowed="one of the two", remedy="the cell file holds that frame"
            )
    read = read_cell(cell)
    arm = arm_of(model)
    for note in scene_of(read, arm).notes:
        say(f"note: {note}")
    return Setup(read, arm)


@dataclass(frozen=True)
class PathOptions:
    """How a tool path file is read: what the file itself may leave open."""

    kind: str | None = None
    units: str | None = None
    rotary: str = "none"
    tcp: bool = False


def read_moves(file: Path, options: PathOptions | None = None) -> Motions:
    """The moves of a tool path file; what was odd about it is said."""
    asked = options or PathOptions()
    read = ReadOptions(units=asked.units, rotary=asked.rotary, tcp=asked.tcp)
    motions = read_toolpath(file, kind=asked.kind, options=read)
    for note in motions.notes[:NOTES_SHOWN]:
        say(f"note: {note}")
    if len(motions.notes) > NOTES_SHOWN:
        say(f"note: {len(motions.notes) - NOTES_SHOWN} more remarks on {file.name}")
    return motions


def read_tool_path(file: Path, options: PathOptions | None = None) -> ToolPath:
    """The cutting moves of a tool path file; surface normals are the tool axes where the file has none."""
    if file.suffix.lower() == ".csv" and (options is None or options.kind in (None, "csv")):
        return read_path(file)
    return to_tool_path(read_moves(file, options)).path


def task_in(setup: Setup, path: ToolPath, reference: Array | None = None) -> Task:
    """The path on the part where the cell has it, linear axes and turntable at 0; gamma counts from ``reference``."""
    T = setup.cell.T_base_part()[0]
    return Task(path, setup.cell.tool.T_flange_tool, T, reference)


def parse_reference(text: str | None) -> Array | None:
    """Direction of ``--reference`` in the part frame, None for the usual one."""
    return None if text is None else parse_vector(text, "--reference", "a direction in the part frame")


def effects_left_out(given: ModelInput) -> list[str]:
    """Codes of the model's effects that only readings know of: no posture, program or placement has them in it."""
    return [placed.effect.code for placed in given.effects]


def require_springs(given: ModelInput, what: str) -> None:
    """Refuse a model in which nothing gives way, before any work is done.

    Raises
    ------
    InputError
        No link, joint, base or tool has a compliance.
    """
    if not compliance(given.model, middle_pose(given.robot)[None]).any():
        raise InputError(
            f"{what} of {given.robot.name}: nothing in this model gives way",
            allowed="a model with joint springs or flexible links",
            remedy="give the joints a stiffness, or take --links beam",
        )


def parse_speed(robot: Robot, text: str | None) -> Array | None:
    """Joint speeds (dof,) rad/s of ``--speed``."""
    return None if text is None else np.radians(parse_joint_figures(robot, text, "--speed"))


@dataclass(frozen=True, eq=False)
class Cut:
    """The cutting force, and the tool's own bending where it is given."""

    force: CuttingForce
    tool: ToolBending | None = None


def read_cut(force: str | None, axes: str, milling: Path | None) -> Cut | None:
    """The cutting force of ``--force`` or ``--milling``, None without either.

    Raises
    ------
    InputError
        Both given, or unknown axes.
    """
    if force is not None and milling is not None:
        raise InputError("--force and --milling", value="both", allowed="one of the two")
    if milling is not None:
        read = read_milling(milling)
        return Cut(read.force, read.tool)
    if force is None:
        return None
    known: dict[str, Literal["base", "part", "process"]] = {"base": "base", "part": "part", "process": "process"}
    if axes not in known:
        raise InputError("--force-axes", value=axes, allowed=", ".join(known), remedy="choose one of them")
    return Cut(ConstantForce(parse_vector(force, "--force", "N"), known[axes]))
