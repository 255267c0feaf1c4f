"""Options of the writers: names, speeds, zones, decimals, the arm's convention; each format has a table of its own.

Defaults keep what was verified: moves are straight in the part frame, rapid ones too (``rapid = "linear"``, at
``rapid_mm_s``). A joint move between distant points leaves the straight line by centimetres, so ``rapid = "joint"`` is
only for moves whose sweep was checked by other means. The first move has no start; it is always a joint move.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Collection, Mapping
from pathlib import PurePath
from typing import Annotated, Literal, Self, TypeVar

from pydantic import Field, NonNegativeFloat, PrivateAttr, field_validator

from machining.cell.schema import Positive, Strict
from machining.programs.convention import Convention
from machining.programs.source_text import plain_text

SCHEMA: Literal["stiffarm-post/1"] = "stiffarm-post/1"

Percent = Annotated[float, Field(gt=0.0, le=100.0)]
Digits = Annotated[int, Field(ge=0, le=15)]
LONGEST = 16
NAME = re.compile(rf"[A-Za-z][A-Za-z0-9_]{{0,{LONGEST - 1}}}")
_NOT_NAME = re.compile(r"[^A-Za-z0-9_]")
# Keys whose values are names in a program.
NAME_KEYS = ("name", "tool_name", "frame_name")
T = TypeVar("T", bound=Strict)


class Decimals(Strict):
    """Digits after the point: lengths in mm, angles in deg, parts of quaternions.

    A tip 3 m from each of six axes moves by up to 6 x 3 m x half a digit: 1.6e-7 m with six decimals of a degree,
    1.6e-6 m with five. KRL and RAPID keep single precision, which alone is up to 1.2e-6 m for joint programs.
    """

    length: Digits = 5
    angle: Digits = 7
    quaternion: Digits = 9


class WriteOptions(Strict):
    """All options; see the module and each table.

    Attributes
    ----------
    name : of the program and its files; ``post`` takes that of the tool path's file where none is given
    rapid : "linear" or "joint"; ``rapid_mm_s`` speed of rapid moves, of the first one too
    default_feed_mm_min : where the tool path has none; None: such a path is refused
    blend_mm : zone in which a corner may be cut; 0: an exact stop at each point
    rotation_deg_s : highest speed of the tool's orientation
    joint_percent : speed and acceleration of joint moves, in % of the axes' own
    moves_per_file : programs with more are split
    source_lines : write the lines of the tool path file as comments
    tool_name, frame_name : in languages that name them
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
    arm: Convention | None = None
    _tables: Mapping[str, Strict] = PrivateAttr(default_factory=dict)

    def named(self, source: str, ending: str, taken: Collection[str]) -> Self:
        """With the name of the tool path's file and ``ending``, where no name is given; ``taken``: words in lower case.

        Other characters become ``_``. A name that is too long is cut and told from others by a checksum of the whole.
        """
        if "name" in self.model_fields_set:
            return self
        stem = PurePath(source).stem
        name = _NOT_NAME.sub("_", plain_text(stem)) or "part"
        name = name if name[0].isalpha() else f"P{name}"
        room = LONGEST - len(ending)
        if len(name) > room:
            name = f"{name[: room - 5]}_{zlib.crc32(stem.encode()) & 0xFFFF:04x}"
        if (name + ending).lower() in {*taken, self.tool_name.lower(), self.frame_name.lower()}:
            name = f"{name[: room - 2]}_p"
        return self.model_copy(update={"name": name + ending})

    def own(self, table: type[T]) -> T:
        """The options of one format alone: those given, or the defaults."""
        return next((given for given in self._tables.values() if isinstance(given, table)), table())

    def with_tables(self, tables: Mapping[str, Strict]) -> Self:
        """The same with options of single formats, by their keys in the file."""
        made = self.model_copy()
        made._tables = dict(tables)
        return made

    @field_validator(*NAME_KEYS)
    @classmethod
    def _identifier(cls, name: str) -> str:
        if not NAME.fullmatch(name):
            raise ValueError("must be up to 16 letters, digits and _, and start with a letter")
        return name
