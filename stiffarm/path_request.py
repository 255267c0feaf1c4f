"""What is asked of an arm in its cell, and of a tool path in it: the fields that the machining commands share.

:class:`CellRequest` has the cell, :class:`FramesRequest` frames in place of one, :class:`PathRequest` a tool path that
is cut there and how its file is read, :class:`CourseRequest` all of it with a course of postures along the path.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, TypeVar

import numpy as np

import machining.cell as cells
from fem.arm import Arm
from machining.posture.drive import Drive
from machining.setup import Setup
from machining.toolpaths import ReadOptions
from robots import InputError, ModelDescription, Robot
from robots.arrays import Array
from stiffarm.request import ANY_PATH, DIRECTION, FRAME, Kind, Request, argument, numbers_of, option, row, word
from stiffarm.session.parsing import parse_numbers
from stiffarm.session.stated import at_load, stated_words
from stiffarm.session.table_kinds import PATH, expect
from stiffarm.session.task_options import gammas_of, parse_range

if TYPE_CHECKING:
    from machining.cutting import Cut
    from machining.toolpaths.conversion import GivenPath
    from machining.toolpaths.motions import Motions, Note

Given = TypeVar("Given", bound=Arm)
Axes = Literal["base", "part", "process"]
Frame = Sequence[float] | Array

TOOL_FORCE: Final = row(3, allowed="three finite numbers x,y,z, not all zero: N", example="0,60,-80", zero=False)
# Remarks of a reader that a result has.
NOTES_SHOWN: Final = 10


def _pair(text: str) -> float | str | tuple[float, ...]:
    """One number, or some between colons; text where it is neither."""
    values = parse_numbers(text, ":")
    return text if values is None else values[0] if len(values) == 1 else values


def _colons(value: Any) -> str:
    return ":".join(f"{v:g}" for v in np.atleast_1d(value))


def _gamma(value: Any, name: str) -> Any:
    gammas_of(value)
    return value


# Angles gamma in deg: first, last and step, or one.
GAMMA: Final = Kind("FROM:TO:STEP", lambda text, name: parse_range(text, name, "deg", "-180:180:5"), _gamma, _colons)


def _speed(value: Any, name: str) -> tuple[float, ...]:
    allowed = "one number above 0, or one for each joint separated by commas"
    found = numbers_of(value, name, allowed)
    if not found or min(found) <= 0.0:
        raise InputError(name, code="A004", value=value, allowed=allowed, remedy="correct it")
    return found


SPEED: Final = replace(row(allowed="joint speeds in deg/s", example="120"), metavar="DEG/S", checked=_speed)


def _floor(value: Any, name: str) -> float | Literal["none"]:
    if isinstance(value, str) and value.strip().lower() == "none":
        return "none"
    found = (value,) if isinstance(value, int | float) else parse_numbers(str(value))
    if found is None or len(found) != 1 or not np.isfinite(found[0]):
        raise InputError(name, code="A002", value=value, allowed="a height in mm, or none", remedy=f"as in {name} -600")
    return float(found[0])


FLOOR: Final = Kind("MM|none", lambda text, name: text, _floor)


def _whole(text: str, name: str) -> int:
    if not text.strip().isdecimal():
        raise InputError(name, code="A004", value=text, allowed="a whole number, 0 or more", remedy=f"as in {name} 1")
    return int(text)


@dataclass(frozen=True, kw_only=True)
class CellRequest(Request):
    """An arm in its cell."""

    cell: Path | str | None = option(
        "Cell file (TOML): tool, part, fixtures, floor, linear axes and joint speeds.", ANY_PATH, metavar="CELL.toml"
    )
    beam_radius: float | None = option(
        "Radius of the capsules that stand for bodies whose shape is not known, in mm; 0 for none. Default: the "
        "cell's or the model's, otherwise from the arm's size.",
        metavar="MM",
        least=0.0,
    )

    def described(self, robot: Robot) -> cells.Cell:
        """The cell of the file; errors as :func:`machining.cell.read_cell`."""
        assert self.cell is not None  # noqa: S101 - required, or frames stand for it
        found = cells.read_cell(Path(self.cell))
        return found if self.beam_radius is None else replace(found, beam_radius=1e-3 * self.beam_radius)

    def setup(self, arm: Arm) -> Setup:
        """The cell with the arm's bodies in it."""
        found = self.described(arm.robot)
        return Setup(found, bodies_of(arm.source, arm.description, found))


def bodies_of(source: str, description: ModelDescription, cell: cells.Cell) -> cells.ArmBodies:
    """The bodies of an arm that was read from ``source``, in this cell."""
    return cells.arm_of(source, description, beam_radius=cell.beam_radius)


@dataclass(frozen=True, kw_only=True)
class FramesRequest(CellRequest):
    """An arm in a cell, or with nothing about it but a tool, a part and a floor."""

    tool: Frame | None = option(
        "Tool frame on the flange, in mm and deg (a, b, c about the fixed axes x, y, z in this order); its z axis "
        "points out of the holder through the tip. Default: the model's tool.",
        FRAME,
    )
    part: Frame | None = option("Part frame in the base frame, in mm and deg. Default: the base frame.", FRAME)
    floor: float | str | None = option(
        "Height of the floor over the robot's base (without --cell), in mm, or none. Default: the plane that the robot "
        "stands on, z = 0 of its base.",
        FLOOR,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        given = {"--tool": self.tool, "--part": self.part, "--floor": self.floor}
        for name in (name for name, value in given.items() if value is not None and self.cell is not None):
            raise InputError(
                f"{name} with --cell", code="A002", allowed="one of the two", remedy="the cell file holds that"
            )

    def described(self, robot: Robot) -> cells.Cell:
        """The cell of the file, or one with nothing in it but the frames and a floor."""
        if self.cell is not None:
            return super().described(robot)
        return cells.Cell(
            T_world_part0=np.eye(4) if self.part is None else np.asarray(self.part),
            tool=cells.Tool(robot.T_flange_tool if self.tool is None else np.asarray(self.tool)),
            floor=1e-3 * self.floor if isinstance(self.floor, float) else None,
            stands=self.floor is None,
            beam_radius=None if self.beam_radius is None else 1e-3 * self.beam_radius,
        )


@dataclass(frozen=True, kw_only=True)
class PathRequest(CellRequest):
    """A tool path that is cut in a cell."""

    path: Path | str = argument(
        "Tool path: APT, CLS, G-code, or CSV with the columns x_mm,y_mm,z_mm,nx,ny,nz.",
        ANY_PATH,
        metavar="PATH",
        required=True,
    )
    force: Sequence[float] | None = option(
        "Cutting force on the tool, in N, in the axes of --force-axes; predicts the resulting surface error.",
        TOOL_FORCE,
    )
    force_axes: Axes = option(
        "Axes of --force: base, part, or process (feed, cross-feed, tool axis).", word(Axes), default="base"
    )
    milling: Path | str | None = option(
        "Milling file (TOML) with end mill, cut and coefficients; replaces --force.", ANY_PATH, metavar="MILLING.toml"
    )
    speed: float | Sequence[float] | None = option(
        "Maximum joint speeds in deg/s: one for all joints, or one per joint separated by commas. Default: the cell's.",
        SPEED,
    )
    singular: float = option(
        "Least distance to keep from singularities, 0 to 1.", default=Drive.singular_least, least=0.0, most=1.0
    )
    kind: str | None = option("Format of the tool-path file: apt, gcode, heidenhain or csv. Default: by its name.")
    units: str | None = option("Length unit of the tool-path file (mm or inch), if the file does not state it.")
    rotary: str = option("Rotary axes of the machine for G-code: none, or as in table-AC or head-BC.", default="none")
    tcp: bool = option(
        "G-code coordinates are the tool tip from the first line on, without G43.4 or TRAORI.", default=False
    )
    read: str | Sequence[str] = option(
        "How the tool-path file is read: frames=one|written|absolute, unknown_motion=error|report, "
        "start=X,Y,Z (mm), G54=X,Y,Z (mm), arc_absolute=yes|no, circle_axis=auto|right|left, dwell_unit=s|ms, "
        "skip_deleted=yes|no, compensation=error|centre, rotary_reversed=A|B|C|AC|BC, pivot=X,Y,Z (mm), "
        "retract=MM, ignore=WORD,WORD (words that change nothing), rotation=absolute|added, rotary_feed=linear|vector, "
        "chord_tolerance_um=N, arc_tolerance_um=N, max_moves=N or max_bytes=N. May be repeated.",
        Kind("KEY=VALUE", lambda text, name: text),
        several=True,
    )
    operation: str | Sequence[str] = option(
        "Take this operation of the tool-path file only. May be repeated. Default: all of them.",
        Kind("NAME", lambda text, name: text),
        several=True,
    )
    tool_number: int | Sequence[int] = option(
        "Take the operations of this tool number only. May be repeated. Default: all of them.",
        Kind("N", _whole),
        several=True,
    )
    at_load: float | None = option(
        "Load in N at which stiffness is stated, for a model with effects that are not linear in the load, such as "
        "backlash. Default: of the loads it was calibrated with, the one nearest to the rated load.",
        metavar="N",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.force is not None and self.milling is not None:
            raise InputError("--force and --milling", code="K004", value="both", allowed="one of the two")

    def at_its_load(self, arm: Given) -> Given:
        """The arm with its effects at the load that is asked for."""
        return at_load(arm, self.at_load)

    def _file(self) -> dict[str, Any]:
        expect(Path(self.path), PATH)
        return {"kind": self.kind, "options": read_options(self.read, self.units, self.rotary, tcp=self.tcp)}

    @property
    def _choice(self) -> dict[str, Any]:
        # Whole numbers in a row are taken for one value.
        return {"operations": self.operation, "tool_numbers": tuple(np.ravel(self.tool_number).tolist())}

    def given_path(self) -> GivenPath:
        """The cuts of the file; errors as :func:`machining.toolpaths.read_given_path`."""
        from machining.toolpaths import read_given_path

        return read_given_path(Path(self.path), **self._file(), **self._choice)

    def motions(self) -> Motions:
        """All moves of the file that are asked for; errors as :func:`machining.toolpaths.read_toolpath`."""
        from machining.toolpaths import read_toolpath
        from machining.toolpaths.selection import select

        return select(read_toolpath(Path(self.path), **self._file()), **self._choice)

    def cut(self, cell: cells.Cell, motions: Motions | None, sd: float | None = None) -> Cut | None:
        """The cutting force that is given, else that of the cell's milling files; None: there is none.

        ``sd``: standard deviation (N) of the components of a force that was measured.

        Raises
        ------
        InputError
            A milling file that cannot be read, or a tool that the cell does not have.
        """
        # Forces bring the uncertainty of calibrations with them.
        from machining.cutting import ConstantForce, Cut, read_milling

        if self.milling is not None:
            return read_milling(Path(self.milling))
        if self.force is not None:
            spread = None if sd is None else sd**2 * np.eye(3)
            return Cut(ConstantForce(np.asarray(self.force), self.force_axes, covariance=spread))
        if motions is None or not any(tool.milling for tool in cell.tools):
            return None
        from machining.tool_cuts import cut_of_tools

        return cut_of_tools(cell, motions)

    def limits(self, robot: Robot, **more: Any) -> Drive:
        """What joints may do along the path: the fields of a :class:`machining.Drive` that the request names."""
        speed = None if self.speed is None else np.radians(self.speed)
        if speed is not None and len(speed) not in (1, robot.dof):
            raise InputError(
                "--speed",
                code="A004",
                value=f"{len(speed)} numbers",
                allowed=f"one number above 0, or {robot.dof} separated by commas",
                remedy="correct it",
            )
        speed = None if speed is None else np.broadcast_to(speed, (robot.dof,)).copy()
        return Drive(speed=speed, singular_least=self.singular, **more)


@dataclass(frozen=True, kw_only=True)
class CourseRequest(PathRequest, FramesRequest):
    """A course of postures along a tool path."""

    reference: Sequence[float] | None = option(
        "Direction in the part frame from which gamma is measured. Default: x, or y if the tool axis comes close to x.",
        DIRECTION,
    )
    turn_gain: float = option(
        "Where the tool axis is constant, gamma stays constant too, unless turning it along the path gains more than "
        "this share of the quantity; 0 to turn it for any gain.",
        metavar="PERCENT",
        default=10.0,
        least=0.0,
    )

    @property
    def counts_from(self) -> Array | None:
        """Direction (3,) in the part frame that gamma counts from; None for the usual one."""
        return None if self.reference is None else np.asarray(self.reference)


def effects_left_out(arm: Arm) -> list[str]:
    """Codes of the arm's effects that no posture, program or placement has in it: they go by the clock or a session."""
    return [] if arm.model.secants is None else [e.effect.code for e in arm.model.secants.left_out]


def path_remarks(arm: Arm, setup: Setup | None, notes: Sequence[Note]) -> list[str]:
    """What must be known of the arm at its load, of its bodies, and of the tool path's file."""
    out = [*filter(None, [stated_words(arm.model)]), *(() if setup is None else setup.notes)]
    more = len(notes) - NOTES_SHOWN
    return [*out, *map(str, notes[:NOTES_SHOWN]), *([f"{more} more remarks on the tool path"] if more > 0 else [])]


# How a file is read, --read KEY=VALUE: the field of the reader's options by key, its values, and an example.
_WORDS: Final = "frames unknown_motion circle_axis dwell_unit compensation rotary_reversed rotation rotary_feed"
_LENGTH_MM, _LENGTH_UM = (1e-3, 1, "a number, mm", "10"), (1e-6, 1, "a number, um", "10")
_POINT: Final = (1e-3, 3, "X,Y,Z in mm", "0,0,100")
NUMBERS: Final = {
    "start": ("start", *_POINT),
    "pivot": ("pivot", *_POINT),
    "retract": ("retract", *_LENGTH_MM),
    "chord_tolerance_um": ("chord_tolerance", *_LENGTH_UM),
    "arc_tolerance_um": ("arc_tolerance", *_LENGTH_UM),
}
OFFSET: Final = re.compile(r"G5[4-9](?:\.[123])?")
SWITCHES: Final = ("arc_absolute", "skip_deleted")
COUNTS: Final = ("max_moves", "max_bytes")
KEYS: Final = (*_WORDS.split(), "ignore", *SWITCHES, *NUMBERS, "G54 to G59.3", *COUNTS)


def read_options(
    read: Sequence[str] = (), units: str | None = None, rotary: str = "none", *, tcp: bool = False
) -> ReadOptions:
    """How a tool path file is read, from KEY=VALUE texts.

    Raises
    ------
    InputError
        A key that is not known or given twice, or a value that does not fit.
    """
    given: dict[str, Any] = {}
    offsets: dict[str, tuple[float, float, float]] = {}
    for text in read:
        key, _, value = (part.strip() for part in text.partition("="))
        if not value:
            raise InputError(
                "--read", code="A004", value=text, allowed="KEY=VALUE", remedy="as in --read frames=written"
            )
        is_offset = OFFSET.fullmatch(key.upper()) is not None
        where: dict[str, Any] = offsets if is_offset else given
        name, *_ = (key.upper(),) if is_offset else NUMBERS.get(key, (key,))
        if name in where:
            raise InputError(f"--read {key}", code="A004", value=value, allowed="each key once", remedy="leave one out")
        where[name] = _value(key, value, is_offset=is_offset)
    return ReadOptions(units=units, rotary=rotary, tcp=tcp, offsets=offsets, **given)


def _value(key: str, text: str, *, is_offset: bool) -> Any:
    """A value of ``--read``: text, a switch, a whole number, or lengths in m."""
    if key in _WORDS.split():
        return text
    if key == "ignore":
        return tuple(filter(None, (part.strip().upper() for part in text.split(","))))
    allowed, example = ("yes or no", "yes") if key in SWITCHES else ("a whole number", "1000000")
    if key in SWITCHES and text in ("yes", "no"):
        return text == "yes"
    if key in COUNTS and text.isascii() and text.isdecimal() and len(text) < 16:
        return int(text)
    if is_offset or key in NUMBERS:
        factor, many, allowed, example = _POINT if is_offset else NUMBERS[key][1:]
        numbers = parse_numbers(text) or ()
        if len(numbers) == many:
            return numbers[0] * factor if many == 1 else tuple(v * factor for v in numbers)
    elif key not in (*SWITCHES, *COUNTS):
        raise InputError("--read", code="A004", value=key, allowed=", ".join(KEYS), remedy="choose one of them")
    raise InputError(f"--read {key}", code="A004", value=text, allowed=allowed, remedy=f"as in --read {key}={example}")
