"""What machining commands share: the path, the cell or the frames that stand for one, the cutting force."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import numpy as np
import typer

import machining.cell as cells
from fem.arm import Arm
from machining.setup import Setup
from machining.toolpaths.motions import Motions, Note
from robots import InputError, ModelDescription, Robot
from robots.arrays import Array
from stiffarm.session.console import say
from stiffarm.session.parsing import parse_frame, parse_joint_figures, parse_numbers, parse_vector, parse_word

if TYPE_CHECKING:
    from machining.cutting import Cut

SingularOpt = Annotated[
    float,
    typer.Option("--singular", help="Least distance to keep from singularities, 0 to 1.", min=0.0, max=1.0),
]
CellOpt = Annotated[
    Path | None,
    typer.Option(
        "--cell",
        metavar="CELL.toml",
        help="Cell file (TOML): tool, part, fixtures, floor, linear axes and joint speeds.",
    ),
]
BeamRadiusOpt = Annotated[
    float | None,
    typer.Option(
        "--beam-radius",
        metavar="MM",
        help="Radius of the capsules that stand for bodies whose shape is not known, in mm; 0 for none. Default: the "
        "cell's or the model's, otherwise from the arm's size.",
        min=0.0,
    ),
]
TurnGainOpt = Annotated[
    float,
    typer.Option(
        "--turn-gain",
        metavar="PERCENT",
        help="Where the tool axis is constant, gamma stays constant too, unless turning it along the path gains more "
        "than this share of the quantity; 0 to turn it for any gain.",
        min=0.0,
    ),
]
FloorOpt = Annotated[
    str | None,
    typer.Option(
        "--floor",
        metavar="MM|none",
        help="Height of the floor over the robot's base (without --cell), in mm, or none. Default: the plane that the "
        "robot stands on, z = 0 of its base.",
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
    str | None,
    typer.Option("--kind", help="Format of the tool-path file: apt, gcode, heidenhain or csv. Default: by its name."),
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


def read_setup(
    model: str,
    given: Arm,
    cell: Path | None,
    tool: str | None,
    part: str | None,
    floor: str | None = None,
    beam_radius: float | None = None,
) -> Setup:
    """The cell of ``--cell``, or one from ``--tool``, ``--part`` and ``--floor``, and the arm's bodies in it.

    Raises
    ------
    InputError
        A cell file together with a frame that it holds itself.
    """
    found = read_cell_or_frames(given.robot, cell, tool, part, floor)
    setup = Setup(found, bodies_of(model, given.description, found, beam_radius))
    for note in setup.notes:
        say(f"note: {note}")
    return setup


def bodies_of(
    model: str, description: ModelDescription, cell: cells.Cell, beam_radius: float | None
) -> cells.ArmBodies:
    """The arm's bodies; ``beam_radius`` (mm) of ``--beam-radius``, else the cell's or the model's."""
    radius = cell.beam_radius if beam_radius is None else beam_radius * 1e-3
    return cells.arm_of(model, description, beam_radius=radius)


def parse_floor(text: str | None) -> float | None:
    """Height (m) of ``--floor`` over the base; None: there is none."""
    if text is None or text.strip().lower() == "none":
        return None
    values = parse_numbers(text)
    if values is None or len(values) != 1:
        raise InputError(
            "--floor", code="A002", value=text, allowed="a height in mm, or none", remedy="as in --floor -600"
        )
    return values[0] * 1e-3


def read_cell_or_frames(
    robot: Robot, cell: Path | None, tool: str | None, part: str | None, floor: str | None = None
) -> cells.Cell:
    """The cell of ``--cell``, or one with nothing in it but the frames of ``--tool`` and ``--part`` and a floor.

    Raises
    ------
    InputError
        A cell file together with a frame that it holds itself.
    """
    if cell is None:
        T_tool = robot.T_flange_tool if tool is None else parse_frame(tool, "--tool")
        T_part = np.eye(4) if part is None else parse_frame(part, "--part")
        return cells.Cell(T_world_part0=T_part, tool=cells.Tool(T_tool), floor=parse_floor(floor), stands=floor is None)
    for option, value in (("--tool", tool), ("--part", part), ("--floor", floor)):
        if value is not None:
            raise InputError(
                f"{option} with --cell",
                code="A002",
                value=value,
                allowed="one of the two",
                remedy="the cell file holds that",
            )
    return cells.read_cell(cell)


def say_notes(notes: Sequence[Note], file: Path) -> None:
    """Say what was odd about a tool path file."""
    for note in notes[:NOTES_SHOWN]:
        say(f"note: {note}")
    if len(notes) > NOTES_SHOWN:
        say(f"note: {len(notes) - NOTES_SHOWN} more remarks on {file.name}")


def parse_reference(text: str | None) -> Array | None:
    """Direction of ``--reference`` in the part frame, None for the usual one."""
    return None if text is None else parse_vector(text, "--reference", "a direction in the part frame")


def effects_left_out(given: Arm) -> list[str]:
    """Codes of the arm's effects that no posture, program or placement has in it: they go by the clock or a session."""
    return [] if given.model.secants is None else [e.effect.code for e in given.model.secants.left_out]


def parse_speed(robot: Robot, text: str | None) -> Array | None:
    """Joint speeds (dof,) rad/s of ``--speed``."""
    return None if text is None else np.radians(parse_joint_figures(robot, text, "--speed"))


def cut_of(
    cell: cells.Cell,
    motions: Motions | None,
    force: str | None,
    axes: str,
    milling: Path | None,
    measured: float | None = None,
) -> Cut | None:
    """The cutting force of ``--force`` or ``--milling``, else that of the cell's milling files; None: there is none.

    Raises
    ------
    InputError
        As :func:`read_cut`, a milling file of a tool, or a tool that the cell does not have.
    """
    given = read_cut(force, axes, milling, measured)
    if given is not None or motions is None or not any(tool.milling for tool in cell.tools):
        return given
    from machining.tool_cuts import cut_of_tools

    return cut_of_tools(cell, motions)


def read_cut(force: str | None, axes: str, milling: Path | None, measured: float | None = None) -> Cut | None:
    """The cutting force of ``--force`` or ``--milling``, None without either.

    ``measured``: standard deviation (N) of the components of a force that was measured.

    Raises
    ------
    InputError
        Both given, unknown axes, or ``measured`` without a force.
    """
    # Forces bring the uncertainty of calibrations with them, which a verification does not ask for.
    from machining.cutting import ConstantForce, Cut, read_milling
    from machining.cutting.force import Axes

    if force is not None and milling is not None:
        raise InputError("--force and --milling", code="K004", value="both", allowed="one of the two")
    if measured is not None and force is None:
        raise InputError(
            "--force-measured without --force", code="K004", remedy="give the force that was measured with --force"
        )
    if milling is not None:
        return read_milling(milling)
    if force is None:
        return None
    known: tuple[Axes, ...] = get_args(Axes)
    spread = None if measured is None else measured**2 * np.eye(3)
    axes_known = parse_word(axes, known, "--force-axes")
    return Cut(ConstantForce(parse_vector(force, "--force", "N"), axes_known, covariance=spread))
