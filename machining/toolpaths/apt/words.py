"""APT statements and their parts: numbers, feeds, spindle speeds, tools; and which words sound like motion."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from machining.magnitudes import LARGEST
from machining.toolpaths.motions import Feed, Per, Tool, clean
from machining.toolpaths.options import UNITS, ReadOptions
from machining.toolpaths.recorder import Recorder, StatementError
from machining.toolpaths.source import lines, readable

INCH = 25.4e-3
# Feed words: metres in the unit of length (None: that of the file), and "turn" or "minute".
FEED_UNITS: dict[str, tuple[float | None, Per]] = {
    "MMPM": (1e-3, "minute"),
    "MMPR": (1e-3, "turn"),
    "IPM": (INCH, "minute"),
    "IPR": (INCH, "turn"),
    "FPM": (12.0 * INCH, "minute"),
    "PERMIN": (None, "minute"),
    "PERREV": (None, "turn"),
    "UPM": (None, "minute"),
    "UPR": (None, "turn"),
}
LENGTHS = {"MM": 1e-3, "MILLIMETERS": 1e-3, "INCH": INCH, "INCHES": INCH, "IN": INCH}
# Words that move the tool, or move or repeat other motion, in a way that is not read here.
MOTION = re.compile(
    r"^(?:GO[A-Z]*|[A-Z]*ARC|NURBS|[A-Z]*SPLINE?|HELIX|CYCLE\d*|DRILL|COPY|INDEX|TRACUT|CALL|CALLSUB|REPEAT|"
    r"THREAD|POCKET|SCURV|SMIL|CLIMB|MOVETO|MOVE|LINTO|ARCTO|PROBE)$"
)
# Rest of the line is free text; a dollar sign inside it is text.
TEXT_WORDS = ("PARTNO", "PPRINT", "TPRINT", "INSERT", "REMARK", "TITLE", "NOTE", "OPNAME", "DISPLAY", "LETTER")


@dataclass(frozen=True)
class Statement:
    """A major word in upper case, and what stands behind it."""

    word: str
    rest: str

    @cached_property
    def parts(self) -> list[str]:
        """Items between commas, upper case; empty ones at the end are left out."""
        return items(self.rest)

    def numbers(self, *allowed: int) -> list[float]:
        """As :func:`numbers`, all its items."""
        return numbers(self.parts, allowed)


def statement(text: str) -> Statement:
    """The word that a line starts with, and what stands behind it."""
    head, slash, rest = text.partition("/")
    first, _, behind = text.strip().partition(" ")
    if first.upper() in TEXT_WORDS or not slash:
        return Statement(first.upper(), behind)
    return Statement(" ".join(head.upper().split()).replace(", ", ",").replace(" ,", ","), rest)


def sounds_like_motion(word: str) -> bool:
    """Whether a word that is not read may hide a motion; labels and numbers before it do not hide it."""
    return any(MOTION.match(part) for part in re.findall(r"[A-Z]+\d*", word))


def items(rest: str) -> list[str]:
    """Items between commas, upper case; empty ones at the end are left out."""
    out = [item.strip().upper() for item in rest.split(",")]
    while out and not out[-1]:
        out.pop()
    return out


def as_number(text: str) -> float | None:
    """Number up to :data:`LARGEST`, or None. Fortran exponents (1.5D+02) are read, Python's forms (1_0) are not."""
    if not text or text[0] not in "+-.0123456789" or "_" in text:
        return None
    try:
        value = float(text.replace("D", "E").replace("d", "e"))
    except ValueError:
        return None
    return value if abs(value) <= LARGEST else None


def numbers(parts: list[str], allowed: tuple[int, ...]) -> list[float]:
    """All items as numbers; their count must be one of ``allowed``.

    Raises
    ------
    StatementError
        Items that are no numbers or beyond :data:`LARGEST`, another count of them.
    """
    out = [as_number(part) for part in parts]
    good = [value for value in out if value is not None]
    if len(good) != len(parts):
        bad = parts[out.index(None)]
        raise StatementError(
            f"{bad!r} where a number belongs", f"finite numbers of at most {LARGEST:g} in size", code="P020"
        )
    if len(good) not in allowed:
        raise StatementError(f"{len(good)} numbers", " or ".join(map(str, allowed)) + " numbers", code="P020")
    return good


def feed(parts: list[str], scale: float, last: Feed) -> Feed:
    """Feed from the items of ``FEDRAT/``: a number, and its unit before or behind it or that of the last feed.

    Raises
    ------
    StatementError
        No number, more than one, a feed that is not positive, a unit that is not known.
    """
    values = [v for v in map(as_number, parts) if v is not None]
    words = [part for part in parts if as_number(part) is None and part]
    unknown = [word for word in words if word not in FEED_UNITS]
    if unknown:
        raise StatementError(f"feed unit {unknown[0]!r}", ", ".join(FEED_UNITS), code="P004")
    if len(values) != 1 or len(words) > 1 or values[0] <= 0.0:
        raise StatementError(f"feed {', '.join(parts)!r}", "one number more than 0 and one unit", code="P004")
    return in_unit(values[0], words[0], scale) if words else Feed(values[0] * scale, last.per)


def in_unit(value: float, word: str, scale: float) -> Feed:
    """A feed by its number and the word of its unit; ``scale``: metres in the file's unit of length."""
    length, per = FEED_UNITS[word]
    return Feed(value * (scale if length is None else length), per)


@dataclass(frozen=True)
class Spindle:
    """Spindle as programmed: ``speed`` rad/s without sign (NaN unknown), ``sense`` 1 (CLW) or -1, ``on``."""

    speed: float = math.nan
    sense: int = 1
    on: bool = False

    @property
    def signed(self) -> float:
        """Speed in rad/s, positive clockwise seen from the holder; 0 when it stands."""
        return self.sense * self.speed if self.on else 0.0


def spindle(parts: list[str], last: Spindle) -> tuple[Spindle, str | None]:
    """Spindle from the items of ``SPINDL/``, and a remark.

    Raises
    ------
    StatementError
        A speed that is negative.
    """
    # Gear, largest speed and radius have a number of their own.
    own = [i for i, part in enumerate(parts[:-1]) if part in ("RANGE", "MAXRPM", "RADIUS") and as_number(parts[i + 1])]
    parts = [part for i, part in enumerate(parts) if i not in own and i - 1 not in own]
    values = [v for v in map(as_number, parts) if v is not None]
    words = [part for part in parts if as_number(part) is None]
    if len(values) > 1:
        raise StatementError(f"{len(values)} spindle speeds", "one number", code="P004")
    if not values and any(word in ("OFF", "STOP", "ORIENT", "LOCK") for word in words):
        return replace(last, on=False), None
    out = replace(last, on=True)
    if "CLW" in words or "CCLW" in words or "CCW" in words:
        out = replace(out, sense=1 if "CLW" in words else -1)
    if any(word in ("SFM", "SMM", "MPM", "CSS") for word in words):
        return replace(out, speed=math.nan), "spindle by cutting speed: its turns are not known"
    if values:
        if values[0] < 0.0:
            raise StatementError(
                f"spindle speed {values[0]:g}", "0 or more turns in a minute, and CLW or CCLW", code="P004"
            )
        out = replace(out, speed=values[0] * 2.0 * math.pi / 60.0)
        if out.speed == 0.0:
            out = replace(out, on=False)
    return out, None


def coolant(parts: list[str]) -> str | None:
    """Coolant of the items of ``COOLNT/``: "flood", "mist", "through" or "off"; None for others."""
    kinds = {"OFF": "off", "MIST": "mist", "THRU": "through", "TAPKUL": "through", "FLOOD": "flood", "ON": "flood"}
    # "ON" goes with the others.
    return next((kind for word, kind in kinds.items() if word in parts), None)


def tool_data(tool: Tool, parts: list[str], scale: float, word: str) -> Tool:
    """Tool with the geometry of ``CUTTER/d,r,e,f,a,b,h`` or ``TLDATA/kind,[module,]d,r,l,...``.

    Siemens NX writes diameter, lower radius and length; APT's seven-parameter cutter has the height last.
    """
    values = [v for v in map(as_number, parts) if v is not None]
    if word == "TLDATA" and parts[:1] not in (["MILL"], ["DRILL"], ["TCUTTER"], ["BARREL"]):
        return replace(tool, diameter=math.nan, corner_radius=math.nan, length=math.nan)

    def at(i: int) -> float:
        return values[i] * scale if len(values) > i and values[i] >= 0.0 else math.nan

    return replace(tool, diameter=at(0), corner_radius=at(1), length=at(2) if word == "TLDATA" else at(6))


def tool_number(parts: list[str]) -> int | None:
    """Whole number among the first two items (``LOADTL/5``, ``LOAD/TOOL,5``), or None."""
    for part in parts[:2]:
        value = as_number(part)
        if value is not None and value == int(value) and 0 <= value < 10**9:
            return int(value)
    return None


def name(text: str) -> str:
    """Name of a tool or an operation, fit for tables."""
    return clean(readable(text).strip().strip("'\""))


def length_unit(path: Path, options: ReadOptions, recorder: Recorder) -> float:
    """Metres in the unit of length: that of ``UNITS/`` before motion, else the option, else that of the feeds."""
    scale, moved = None if options.units is None else UNITS[options.units], False
    for number, raw in enumerate(lines(path, options.max_bytes), start=1):
        text = raw.lstrip()
        moved = moved or text.startswith("GOTO")
        if moved and scale is not None:
            return scale
        head = text[:6].upper()
        if head.startswith("UNIT") and not moved:
            parts = statement(text.split("$")[0]).parts
            if len(parts) == 1 and parts[0] in LENGTHS:
                return LENGTHS[parts[0]]
        elif head.startswith(("FEDRAT", "CYCLE")) and scale is None:
            found = [w for w in items(text.strip().replace("/", ",")) if FEED_UNITS.get(w, (None,))[0]]
            if found:
                unit = "mm" if FEED_UNITS[found[0]][0] == UNITS["mm"] else "inch"
                recorder.note(number, f"no UNITS in the file: taken as {unit} from the feed unit {found[0]}")
                scale = UNITS[unit]
    if scale is None:
        recorder.error(
            0,
            "no unit of length",
            code="P003",
            allowed="UNITS/MM or UNITS/INCHES",
            remedy="say it: --units mm or inch (units= in Python)",
        )
        return UNITS["mm"]
    return scale
