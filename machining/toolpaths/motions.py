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
# Kinds of commands among the words that are no motion ("": none), and what a coolant can be.
KINDS = ("", "operation", "tool", "spindle", "coolant", "dwell", "stop", "optional stop", "probe")
COOLANTS = ("flood", "mist", "through", "off")


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
    """A word that is no motion: source ``line``, ``move`` it comes before (n: after the last), ``word``, ``text``.

    ``kind`` of a command to the machine, "" for words that ask nothing of it; ``value`` of it:

    - "operation", "tool": index into the motions' table of them
    - "spindle": rad/s, positive clockwise, 0 stops it; NaN where the speed is not known, then ``text`` is "CLW" or
      "CCLW"
    - "coolant": ``text`` is one of :data:`COOLANTS`; each is switched on by itself, "off" is for all
    - "dwell": s; "stop", "optional stop": none; "probe": 1 on, 0 off
    """

    line: int
    move: int
    word: str
    text: str
    kind: str = ""
    value: float = math.nan

    def same(self, other: Event) -> bool:
        """Whether another is the same event, its value within rounding."""
        mine, others = ((e.line, e.move, e.word, e.text, e.kind) for e in (self, other))
        both_unknown = math.isnan(self.value) and math.isnan(other.value)
        return mine == others and (both_unknown or math.isclose(self.value, other.value, rel_tol=1e-9, abs_tol=1e-9))


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
    events : words that are no motion, commands to the machine among them, in the order of the file; what ``tool``,
        ``spindle``, ``dwell`` and ``operation`` say beyond them :func:`machining.toolpaths.events.ordered` adds
    notes : what was odd
    source : name of the file

    Raises
    ------
    InputError
        Shapes that do not fit, coordinates, feeds, spindle speeds and dwells that cannot be
        (:mod:`machining.magnitudes`), axes that are not unit vectors, indices out of their tables, events
        before no move or with values that cannot be.
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
                raise InputError(
                    f"motions, {name}", code="B001", value=f"shape {shape}", allowed=f"shape {wanted.get(name, (n,))}"
                )
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
                raise InputError(f"motions, {name}", code="B001", allowed=allowed)
        for event in self.events:
            self._check(event)

    def _check(self, event: Event) -> None:
        """Raise InputError for an event that no machine could follow."""
        value, where = event.value, f"motions, {event.kind or 'event'} of line {event.line}"
        sizes = {"tool": len(self.tools), "operation": len(self.operations), "probe": 2}
        if event.kind not in KINDS:
            raise InputError(where, code="B001", allowed=", ".join(KINDS[1:]))
        if not 0 <= event.move <= self.n:
            raise InputError(where, code="B001", value=f"before move {event.move}", allowed=f"0 to {self.n}")
        if event.kind in sizes and not (0.0 <= value < sizes[event.kind] and value == int(value)):
            raise InputError(where, code="B001", value=value, allowed=f"a whole number below {sizes[event.kind]}")
        if event.kind == "spindle" and (
            abs(value) > limits.FASTEST_TURN or (math.isnan(value) and event.text not in ("CLW", "CCLW"))
        ):
            raise InputError(
                where, code="B001", value=value, allowed=f"up to {limits.FASTEST_TURN:g} rad/s, or CLW or CCLW"
            )
        if event.kind == "dwell" and not 0.0 <= value <= limits.LONGEST_REST:
            raise InputError(where, code="B001", value=value, allowed=f"0 to {limits.LONGEST_REST:g} s")
        if event.kind == "coolant" and event.text not in COOLANTS:
            raise InputError(where, code="B001", value=event.text, allowed=", ".join(COOLANTS))

    @property
    def n(self) -> int:
        """Number of moves."""
        return len(self.points)

    @property
    def changes(self) -> Bools:
        """Moves (n,) that are the first with another tool than the move before had."""
        return np.append(np.zeros(min(1, self.n), dtype=np.bool_), np.diff(self.tool) != 0)

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
