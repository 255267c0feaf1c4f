"""How a tool path file is read, and which of its operations: the options that all machining commands share."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import typer

from machining.toolpaths import ReadOptions
from robots import InputError
from stiffarm.session.parsing import parse_numbers

OperationOpt = Annotated[
    list[str] | None,
    typer.Option(
        "--operation",
        metavar="NAME",
        help="Take this operation of the tool-path file only. May be repeated. Default: all of them.",
    ),
]
ToolNumberOpt = Annotated[
    list[int] | None,
    typer.Option(
        "--tool-number",
        metavar="N",
        help="Take the operations of this tool number only. May be repeated. Default: all of them.",
    ),
]
ReadOpt = Annotated[
    list[str] | None,
    typer.Option(
        "--read",
        metavar="KEY=VALUE",
        help="How the tool-path file is read: frames=one|written|absolute, unknown_motion=error|report, "
        "start=X,Y,Z (mm), G54=X,Y,Z (mm), arc_absolute=yes|no, circle_axis=auto|right|left, dwell_unit=s|ms, "
        "skip_deleted=yes|no, compensation=error|centre, rotary_reversed=A|B|C|AC|BC, pivot=X,Y,Z (mm), "
        "retract=MM, ignore=WORD,WORD (words that change nothing), rotation=absolute|added, rotary_feed=linear|vector, "
        "chord_tolerance_um=N, arc_tolerance_um=N, max_moves=N or max_bytes=N. May be repeated.",
    ),
]
OFFSET = re.compile(r"G5[4-9](?:\.[123])?")
WORDS = (
    "frames",
    "unknown_motion",
    "circle_axis",
    "dwell_unit",
    "compensation",
    "rotary_reversed",
    "rotation",
    "rotary_feed",
)
LISTS = ("ignore",)
SWITCHES = ("arc_absolute", "skip_deleted")
LENGTHS_UM = ("chord_tolerance", "arc_tolerance")
LENGTHS_MM = ("retract",)
POINTS = ("start", "pivot")
COUNTS = ("max_moves", "max_bytes")
KEYS = (
    *WORDS,
    *LISTS,
    *SWITCHES,
    *POINTS,
    *LENGTHS_MM,
    "G54 to G59.3",
    *(f"{name}_um" for name in LENGTHS_UM),
    *COUNTS,
)


@dataclass(frozen=True)
class Reading:
    """How a tool path file is read: its ``kind``, the reader's ``options``, and what of it is taken."""

    kind: str | None
    options: ReadOptions
    operations: tuple[str, ...]
    tool_numbers: tuple[int, ...]

    @property
    def choice(self) -> Mapping[str, Any]:
        """What of the file is taken, as arguments of :func:`machining.toolpaths.selection.select`."""
        return {"operations": self.operations, "tool_numbers": self.tool_numbers}


def reading(
    kind: str | None,
    units: str | None,
    rotary: str,
    tcp: bool,
    read: Sequence[str] | None,
    operation: Sequence[str] | None,
    tool_number: Sequence[int] | None,
) -> Reading:
    """The options together.

    Raises
    ------
    InputError
        ``--read`` with a key that is not known or given twice, or a value that does not fit.
    """
    given: dict[str, Any] = {}
    offsets: dict[str, tuple[float, float, float]] = {}
    for text in read or ():
        key, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not value:
            raise InputError(
                "--read", code="A004", value=text, allowed="KEY=VALUE", remedy="as in --read frames=written"
            )
        if OFFSET.fullmatch(key.upper()):
            name, where = key.upper(), offsets
        else:
            name, where = key.removesuffix("_um") if key.removesuffix("_um") in LENGTHS_UM else key, given
        if name in where:
            raise InputError(f"--read {key}", code="A004", value=value, allowed="each key once", remedy="leave one out")
        where[name] = _point(key, value) if where is offsets else _value(key, value)
    options = ReadOptions(units=units, rotary=rotary, tcp=tcp, offsets=offsets, **given)
    return Reading(kind, options, tuple(operation or ()), tuple(tool_number or ()))


def _value(key: str, text: str) -> Any:
    if key in WORDS:
        return text
    if key in LISTS:
        return tuple(filter(None, (part.strip().upper() for part in text.split(","))))
    if key in SWITCHES:
        if text not in ("yes", "no"):
            raise InputError(
                f"--read {key}", code="A004", value=text, allowed="yes or no", remedy=f"as in --read {key}=yes"
            )
        return text == "yes"
    if key in POINTS:
        return _point(key, text)
    if key in LENGTHS_MM or (key.removesuffix("_um") in LENGTHS_UM and key.endswith("_um")):
        numbers, (unit, factor) = parse_numbers(text), ("mm", 1e-3) if key in LENGTHS_MM else ("um", 1e-6)
        if numbers is None or len(numbers) != 1:
            raise InputError(
                f"--read {key}", code="A004", value=text, allowed=f"a number, {unit}", remedy=f"as in --read {key}=10"
            )
        return numbers[0] * factor
    if key in COUNTS:
        if not (text.isascii() and text.isdecimal() and len(text) < 16):
            raise InputError(
                f"--read {key}", code="A004", value=text, allowed="a whole number", remedy=f"as in --read {key}=1000000"
            )
        return int(text)
    raise InputError("--read", code="A004", value=key, allowed=", ".join(KEYS), remedy="choose one of them")


def _point(key: str, text: str) -> tuple[float, float, float]:
    numbers = parse_numbers(text)
    if numbers is None or len(numbers) != 3:
        raise InputError(
            f"--read {key}", code="A004", value=text, allowed="X,Y,Z in mm", remedy=f"as in --read {key}=0,0,100"
        )
    return numbers[0] * 1e-3, numbers[1] * 1e-3, numbers[2] * 1e-3
