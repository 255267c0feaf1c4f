"""Motions: what a tool path file says the tool does, as arrays over the moves."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from machining import magnitudes as limits
from robots import InputError
from robots.arrays import Array, Bools, Integers

# Longest text (characters) that an event or a name keeps, so that a file cannot fill messages and reports.
TEXT_LIMIT = 200
Per = Literal["minute", "turn"]


@dataclass(frozen=True)
class Tool:
    """Tool as the file names it.

    ``number`` None and ``name`` "" where the file gives none; ``diameter``, ``corner_radius`` and ``length`` m, NaN
    where the file gives none.
    """

    number: int | None = None
    name: str = ""
    diameter: float = np.nan
    corner_radius: float = np.nan
    length: float = np.nan


@dataclass(frozen=True)
class Feed:
    """Feed as programmed: ``value`` m per minute or per turn (NaN: none), by ``per``."""

    value: float = math.nan
    per: Per = "minute"

    def speed(self, spindle: float) -> float:
        """Speed in m/s at a spindle speed in rad/s; NaN where feed or the spindle it needs is not known or stands."""
        if self.per == "minute":
            return self.value / 60.0
        speed = self.value * abs(spindle) / (2.0 * math.pi)
        return speed if speed > 0.0 else math.nan


@dataclass(frozen=True)
class Event:
    """A word that is no motion: source ``line``, ``move`` it comes before (n: after the last), ``word``, ``text``."""

    line: int
    move: int
    word: str
    text: str


@dataclass(frozen=True)
class Note:
    """Something odd that did not stop the reading: first ``line`` (0: the whole file), ``text``, ``count``."""

    line: int
    text: str
    count: int = 1

    def __str__(self) -> str:
        where = f"line {self.line}: " if self.line else ""
        return f"{where}{self.text}" + (f" ({self.count} times)" if self.count > 1 else "")


@dataclass(frozen=True, eq=False)
class Motions:
    """n moves; move i leads from point i - 1 to point i, straight.

    Attributes
    ----------
    points : (n, 3) m, tool tip in the frame of the program
    axes : (n, 3) unit vectors, tool axis from the tip into the holder, at the end of the move
    rapid : (n,) bool
    feed : (n,) m/s, NaN for rapid moves and where it is not known
    line : (n,) source line
    tool : (n,) index into ``tools``
    spindle : (n,) rad/s, positive clockwise seen from the holder towards the tip (M3, CLW); 0 stopped, NaN unknown
    dwell : (n,) s of rest after the move
    operation : (n,) index into ``operations``
    tools, operations : tables
    events : words that are no motion, in the order of the file
    notes : what was odd
    source : name of the file

    Raises
    ------
    InputError
        Shapes that do not fit, coordinates, feeds, spindle speeds and dwells that cannot be
        (:mod:`machining.magnitudes`), axes that are not unit vectors, indices out of their tables.
    """

    points: Array
    axes: Array
    rapid: Bools
    feed: Array
    line: Integers
    tool: Integers
    spindle: Array
    dwell: Array
    operation: Integers
    tools: tuple[Tool, ...] = (Tool(),)
    operations: tuple[str, ...] = ("",)
    events: tuple[Event, ...] = field(default=())
    notes: tuple[Note, ...] = field(default=())
    source: str = ""

    def __post_init__(self) -> None:
        n = len(self.points)
        wanted = {"points": (n, 3), "axes": (n, 3)}
        for name in ("points", "axes", "rapid", "feed", "line", "tool", "spindle", "dwell", "operation"):
            shape = getattr(self, name).shape
            if shape != wanted.get(name, (n,)):
                raise InputError(f"motions, {name}", value=f"shape {shape}", allowed=f"shape {wanted.get(name, (n,))}")
        checks = (
            ("points", bool((np.abs(self.points) <= limits.FARTHEST).all()), limits.PLACES),
            ("axes", (np.abs(np.linalg.norm(self.axes, axis=1) - 1.0) < 1e-9).all(), "unit vectors"),
            ("feed", bool(limits.feeds(self.feed).all()), f"{limits.FEEDS}, or none"),
            ("spindle", not (np.abs(self.spindle) > limits.FASTEST_TURN).any(), f"up to {limits.FASTEST_TURN:g} rad/s"),
            ("dwell", _within(self.dwell, limits.LONGEST_REST), f"0 to {limits.LONGEST_REST:g} s"),
            ("tool", _within(self.tool, len(self.tools)), "indices into tools"),
            ("operation", _within(self.operation, len(self.operations)), "indices into operations"),
        )
        for name, good, allowed in checks:
            if not good:
                raise InputError(f"motions, {name}", allowed=allowed)

    @property
    def n(self) -> int:
        """Number of moves."""
        return len(self.points)

    @property
    def cutting(self) -> Bools:
        """Moves (n,) at feed; the first point has no move that leads to it, so it is not one of them."""
        out = ~self.rapid
        out[:1] = False
        return out


def _within(index: Integers | Array, size: float) -> bool:
    return bool(((index >= 0) & (index < size)).all())


def clean(text: str) -> str:
    """Text fit for a message: one line, no control or hidden characters, at most ``TEXT_LIMIT`` characters."""
    text = text.strip()
    cut = text[:TEXT_LIMIT]
    if not cut.isprintable():
        cut = "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in cut)[:TEXT_LIMIT]
    return cut + "..." if len(text) > TEXT_LIMIT else cut
