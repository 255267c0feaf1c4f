"""Options of the writers: names, speeds, zones, decimals, axis names, the arm's convention. TOML or JSON.

Defaults keep what was verified: moves are straight in the part frame, rapid ones too (``rapid = "linear"``, at
``rapid_mm_s``). A joint move between distant points leaves the straight line by centimetres, so ``rapid = "joint"`` is
only for moves whose sweep was checked by other means. The first move has no start; it is always a joint move.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, NonNegativeFloat, ValidationError, field_validator, model_validator

from machining.cell.schema import Positive, Strict
from machining.programs.convention import ConventionTable, fault, tuples
from robots.files.reading import parse_json, parse_toml, read_text

SCHEMA: Literal["stiffarm-post/1"] = "stiffarm-post/1"

Percent = Annotated[float, Field(gt=0.0, le=100.0)]
Digits = Annotated[int, Field(ge=0, le=15)]
# Words that mean something in one of the languages; a program of that name would not run.
_WORDS = """begin call def defdat do end endmodule endproc false for if lin loop main module movej movel proc ptp return
start stop sub then true wait while"""
RESERVED = frozenset(_WORDS.split())
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,15}")
AXIS = re.compile(r"[A-Z][A-Z0-9_]{0,15}")
# Address letters of SINUMERIK that are no axes.
NOT_AXES = frozenset("DEFGHLMNPRST")


class Decimals(Strict):
    """Digits after the point: lengths in mm, angles in deg, parts of quaternions.

    A tip 3 m from each of six axes moves by up to 6 x 3 m x half a digit: 1.6e-7 m with six decimals of a degree,
    1.6e-6 m with five. KRL and RAPID keep single precision, which alone is up to 1.2e-6 m for joint programs.
    """

    length: Digits = 5
    angle: Digits = 7
    quaternion: Digits = 9


class KrlOptions(Strict):
    """``tool`` and ``base``: numbers in TOOL_DATA and BASE_DATA, used where a frame is not declared in the program.

    ``ptp_blend_percent``: $APO.CPTP, zone of joint moves, which KRL does not take in mm.
    """

    tool: Annotated[int, Field(ge=1, le=128)] = 1
    base: Annotated[int, Field(ge=1, le=128)] = 1
    ptp_blend_percent: Percent = 50.0
    advance: Annotated[int, Field(ge=0, le=5)] = 3


class RapidOptions(Strict):
    """``tool_mass_kg``, ``tool_centre_mm``: load of the tool; without it the tooldata must stand on the controller."""

    tool_mass_kg: Positive | None = None
    tool_centre_mm: tuple[float, float, float] = (0.0, 0.0, 1.0)


class SinumerikOptions(Strict):
    """``feed``: "inverse_time" (G93, 1/min) or "per_minute" (G94, deg/min over all axes, mm counted as deg)."""

    axes: tuple[str, ...] = ("A1", "A2", "A3", "A4", "A5", "A6")
    linear: tuple[str, ...] = ("X1", "X2", "X3")
    table: str = "C1"
    feed: Literal["inverse_time", "per_minute"] = "inverse_time"

    @model_validator(mode="after")
    def _names(self) -> Self:
        names = (*self.axes, *self.linear, self.table)
        for name in names:
            if not AXIS.fullmatch(name) or name in NOT_AXES:
                raise ValueError(f"axis name {name!r} must be capitals and digits, and no address such as F or G")
        if len(set(names)) != len(names):
            raise ValueError("axis names must differ")
        return self


class WriteOptions(Strict):
    """All options; see the module and each table.

    Attributes
    ----------
    name : of the program and its files
    rapid : "linear" or "joint"; ``rapid_mm_s`` speed of rapid moves, of the first one too
    default_feed_mm_min : where the tool path has none; None: such a path is refused
    blend_mm : zone in which a corner may be cut; 0: an exact stop at each point
    rotation_deg_s : highest speed of the tool's orientation
    joint_percent : speed and acceleration of joint moves, in % of the axes' own
    moves_per_file : programs with more are split
    source_lines : write the lines of the tool path file as comments
    tool_name, frame_name : in RAPID and VAL3
    krl, abb, sinumerik : of one format only
    arm : how the controller counts the joints; None: the bundled convention of the robot
    """

    schema_version: Literal["stiffarm-post/1"] = Field(default=SCHEMA, alias="schema")
    name: str = "part"
    rapid: Literal["linear", "joint"] = "linear"
    rapid_mm_s: Positive = 250.0
    default_feed_mm_min: Positive | None = None
    blend_mm: NonNegativeFloat = 0.1
    rotation_deg_s: Positive = 90.0
    joint_percent: Percent = 20.0
    moves_per_file: Annotated[int, Field(ge=1)] = 5000
    source_lines: bool = False
    tool_name: str = "tCutter"
    frame_name: str = "fPart"
    decimals: Decimals = Decimals()
    krl: KrlOptions = KrlOptions()
    abb: RapidOptions = RapidOptions()
    sinumerik: SinumerikOptions = SinumerikOptions()
    arm: ConventionTable | None = None

    @field_validator("name", "tool_name", "frame_name")
    @classmethod
    def _identifier(cls, name: str) -> str:
        if not NAME.fullmatch(name) or name.lower() in RESERVED:
            raise ValueError(
                "must be up to 16 letters, digits and _, start with a letter, and be no word of a language"
            )
        return name


def read_options(path: str | Path) -> WriteOptions:
    """Options of a TOML file, or of a JSON file (by its suffix).

    Raises
    ------
    InputError
        The file cannot be read, or the first key that does not fit.
    """
    file = Path(path)
    text = read_text(file, "options")
    if file.suffix.lower() != ".json":
        return parse_options(parse_toml(text, str(file)), str(file))
    return parse_options(parse_json(text, str(file)), str(file))


def parse_options(data: object, where: str) -> WriteOptions:
    """Options from the table of a file; ``where`` names it in messages. Errors as :func:`read_options`."""
    try:
        return WriteOptions.model_validate(tuples(data))
    except ValidationError as error:
        raise fault(error, where) from error
