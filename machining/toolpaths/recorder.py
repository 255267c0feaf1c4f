"""Recorder: collects moves into flat arrays while a file is read, and faults and remarks beside them."""

from __future__ import annotations

from array import array
from dataclasses import replace
from typing import Any

import numpy as np

from machining import magnitudes as limits
from machining.toolpaths.motions import Event, Motions, Note, Tool, clean
from machining.toolpaths.retracts import CLEARANCE, Retracts
from robots import InputError
from robots.arrays import Array, Bools, Integers
from robots.errors import listed
from robots.faults import Faults

Vector = tuple[float, float, float]

EVENTS = 100_000
NOTES = 1000
# Deviation of a tool axis from length 1 that is remarked on; four decimals leave at most 1e-4.
UNIT = 1e-3
# Cosine of the turn of the tool axis in one move at feed that is remarked on.
TURN = float(np.cos(np.radians(10.0)))


class StatementError(ValueError):
    """A statement that cannot be read: what is wrong, what is allowed, what to do, and its code."""

    def __init__(self, what: str, allowed: str | None = None, remedy: str | None = None, *, code: str) -> None:
        super().__init__(what)
        self.what, self.allowed, self.remedy, self.code = what, allowed, remedy, code


class Recorder:
    """Moves, state, events, notes and faults of one file; :meth:`motions` makes the result or raises."""

    def __init__(self, source: str, max_moves: int, retract: float | None = None) -> None:
        """``retract`` m: height of retracts (:mod:`machining.toolpaths.retracts`)."""
        self.source, self.max_moves = source, max_moves
        self.retracts = Retracts(retract)
        self.points, self.axes = array("d"), array("d")
        self.rapids, self.lines = array("b"), array("q")
        # First move, feed, spindle, tool and operation of one state after the other.
        self._states = array("d")
        self._dwells: dict[int, float] = {}
        self.tools: dict[Tool, int] = {}
        self.operations: dict[str, int] = {}
        self.events: list[Event] = []
        self._lost_events = 0
        # Event of a tool change whose tool is not known yet, and whether the file says it by a word of its own.
        self._change: tuple[int, bool] | None = None
        # Events of operations that may have no moves.
        self._begun: list[int] = []
        self._turning = self._cooled = False
        # Moves made when the spindle was told last.
        self._told_at = 0
        # First line, count and code by text.
        self._notes: dict[str, tuple[int, int, str]] = {}
        self.faults = Faults(self.source)

    def __len__(self) -> int:
        return len(self.lines)

    def state(self, feed: float, spindle: float, tool: Tool, operation: str) -> None:
        """Feed (m/s), spindle (rad/s), tool and operation of the moves from here on."""
        named = self.operations.setdefault(clean(operation), len(self.operations))
        kept = self.tools.setdefault(tool, len(self.tools))
        self._states.extend((len(self.lines), feed, spindle, kept, named))
        self._changed_to(tool)
        self._begins(named)

    def move(self, line: int, point: Vector, axis: Vector, rapid: bool) -> None:
        """One move to ``point`` (m) with tool axis ``axis`` of any length."""
        if self.retracts.away:
            self._back(line, point, axis)
        self.room(1)
        self.points.extend(point)
        self.axes.extend(axis)
        self.rapids.append(rapid)
        self.lines.append(line)

    def moves(self, line: int, points: Array, axes: Array, rapid: bool) -> None:
        """Moves (m, 3) of one statement."""
        if self.retracts.away and len(points):
            self._back(line, points[0].tolist(), axes[0].tolist())
        self.room(len(points))
        self.points.frombytes(np.ascontiguousarray(points).tobytes())
        self.axes.frombytes(np.ascontiguousarray(axes).tobytes())
        self.rapids.extend([rapid] * len(points))
        self.lines.extend([line] * len(points))

    def away(self, line: int, word: str) -> None:
        """The tool goes to a place of the machine, as ``word`` says: up along its axis, if it is in the part now.

        A tool that has not moved yet is at the changer.
        """
        if not len(self) or self.retracts.away:
            return
        last = np.array(self.points[-3:])
        self.retracts.begin(line, word, last)
        state = len(self._states) - 5
        while self._states[state] >= len(self):
            state -= 5
        if self._states[state + 3] == self._tool_now:
            self._raise(line, last, np.array(self.axes[-3:]))

    def across(self, line: int, point: Vector, axis: Vector) -> None:
        """While the tool is away, a rapid move to above ``point`` (m), whose height along ``axis`` is not known."""
        unit = _unit(axis)
        self._raise(line, self.retracts.level(np.array(point), unit), unit)

    def _back(self, line: int, point: Vector, axis: Vector) -> None:
        """The tool comes back into the part: across to above ``point``, from where the next move leads down."""
        place, unit = np.array(point), _unit(axis)
        if not self.retracts.above(place, unit, self._tool_now):
            self._raise(line, place, unit)
        self.retracts.away = False

    def _raise(self, line: int, point: Array, axis: Array) -> None:
        away, self.retracts.away = self.retracts.away, False
        for turned in self.retracts.steps(len(self), point, _unit(axis), self._tool_now):
            self.move(line, point.tolist(), turned.tolist(), True)
        self.retracts.away = away

    @property
    def _tool_now(self) -> int:
        return int(self._states[-2])

    def shorten(self, points: Array) -> None:
        """Let the last n moves lead to points (n, 3) m instead."""
        self.points[-points.size :] = array("d", points.ravel().tolist())

    def behind(self, line: int, move: int) -> None:
        """Let the commands of a line that stand before a move stand before the next one instead."""
        for i in range(len(self.events) - 1, -1, -1):
            if self.events[i].line != line or self.events[i].move != move:
                return
            self.events[i] = replace(self.events[i], move=len(self))

    def room(self, more: int) -> None:
        """Refuse more moves than the limit before memory is taken for them."""
        if len(self.lines) + more > self.max_moves:
            raise InputError(
                f"{self.source}: number of moves",
                code="P005",
                allowed=f"up to {self.max_moves}",
                remedy="split it, or allow more: --read max_moves=N, or coarser chords: --read chord_tolerance_um=10",
            )

    def dwell(self, line: int, seconds: float) -> None:
        """Rest after the last move."""
        last = len(self.lines) - 1
        whole = self._dwells.get(last, 0.0) + seconds
        if not 0.0 <= whole <= limits.LONGEST_REST:
            self.error(line, "dwell", code="P004", value=seconds, allowed=f"0 to {limits.LONGEST_REST:g} s")
            return
        if len(self.lines):
            self._dwells[last] = whole
        self.command(line, "dwell", seconds)

    def command(self, line: int, kind: str, value: float = float("nan"), text: str = "", word: str = "") -> None:
        """Keep a command to the machine where it stands (:class:`Event`); ``word``, ``text``: of the file."""
        self.events.append(Event(line, len(self.lines), clean(word or kind), clean(text), kind, value))
        if kind == "spindle":
            self._turning, self._told_at = value != 0.0, len(self.lines)
        elif kind == "coolant":
            self._cooled = text != "off"

    def operation(self, line: int, name: str, word: str) -> None:
        """An operation begins here; one that has no moves is no more than a word."""
        self._begun.append(len(self.events))
        self.command(line, "operation", text=name, word=word)

    def tool_change(self, line: int, word: str, text: str = "", *, number: int | None = None, stated: bool) -> None:
        """A change to the tool of the next move stands here; ``stated``: by a word that means nothing else.

        Before the next move the last word counts, and one that is stated before others. ``number``: where no move
        follows. A spindle that has turned for moves before is stopped for it, as by every control and postprocessor.
        """
        if stated and self._turning and self._told_at < len(self.lines):
            self.command(line, "spindle", 0.0, "OFF", "SPINDL")
        if self._change is not None:
            place, firm = self._change
            if firm and not stated:
                self.event(line, word, text)
                return
            self.events[place] = replace(self.events[place], kind="", value=float("nan"))
        self._change = len(self.events), stated
        self.events.append(
            Event(line, len(self.lines), clean(word), clean(text), "tool", -1.0 if number is None else number)
        )

    def _changed_to(self, tool: Tool) -> None:
        """What tool the change before the next move is to."""
        if self._change is not None:
            place, _ = self._change
            self.events[place] = replace(self.events[place], value=float(self.tools[tool]))
            self._change = None

    def _begins(self, operation: int | None) -> None:
        """Which of the operations named since the last state has the moves to come."""
        if not self._begun:
            return
        names, last = list(self.operations), self._begun[-1:]
        for place in self._begun:
            event = self.events[place]
            is_it = operation is not None and [place] == last and event.text == names[operation]
            self.events[place] = replace(
                event, kind="operation" if is_it else "", value=float(operation or 0) if is_it else float("nan")
            )
        self._begun.clear()

    def finish(self, line: int, word: str) -> None:
        """The end of a program, which stops spindle and coolant as a control does there."""
        if self._turning:
            self.command(line, "spindle", 0.0, "OFF", word)
        if self._cooled:
            self.command(line, "coolant", text="off", word=word)

    def event(self, line: int, word: str, text: str = "", note: str = "", *, code: str = "") -> None:
        """Keep a word that is no motion, and remark on it."""
        if note:
            self.note(line, note, code=code)
        if len(self.events) < EVENTS:
            self.events.append(Event(line, len(self.lines), clean(word), clean(text)))
        else:
            self._lost_events += 1

    def note(self, line: int, text: str, *, code: str = "") -> None:
        """Remark; the same text counts up."""
        text = clean(text)
        first, count, _ = self._notes.get(text, (line, 0, code))
        if count or len(self._notes) < NOTES:
            self._notes[text] = (first, count + 1, code)

    def error(self, line: int, what: str, *, code: str, **parts: Any) -> None:
        """Fault of a line; 0: of the file. ``parts``: as those of :class:`robots.InputError`."""
        if isinstance(parts.get("value"), str):
            parts["value"] = clean(parts["value"])
        where = f"{self.source}, line {line}: " if line else f"{self.source}: "
        self.faults.say(line, where + clean(what), code=code, **parts)

    def motions(self) -> Motions:
        """The result.

        Raises
        ------
        InputErrors
            All faults found, the first ones with their lines, and their number.
        """
        points, axes, line = self._checked()
        if self.retracts.raised and not self.faults:
            points = self._retracted(points, axes)
        if not self.faults and not len(line):
            self.error(0, "no motion in the file", code="P002", remedy="give the file of a tool path")
        self.faults.raise_if_any("tool path file")
        self._settle_change()
        self._begins(None)
        if self._lost_events:
            self.note(0, f"{self._lost_events} words that are no motion are not kept, beyond {EVENTS}")
        return self._table(points, axes, line)

    def _retracted(self, points: Array, axes: Array) -> Array:
        """Points (n, 3) m with the retracts at their heights, which are remarked on."""
        one = self.retracts
        points, heights, least = one.placed(points, axes, np.frombuffer(self.rapids, dtype=np.int8) == 0)
        if one.height is not None and one.height < least:
            self.error(
                0,
                "height of retracts, mm",
                code="P004",
                value=f"{one.height * 1e3:.6g}",
                allowed=f"at least {least * 1e3:.6g}: the highest point of the path at feed, along the tool axis",
                remedy="raise it: --read retract=MM (retract= in Python), or leave it out",
            )
        span = " to ".join(f"{v * 1e3:.6g}" for v in dict.fromkeys(np.round([heights.min(), heights.max()], 9)))
        how = "" if one.height is not None else f"{CLEARANCE * 1e3:g} mm above the path's highest point; "
        text = (
            f"retracts ({one.count}) for {listed(list(one.words))}: up along the tool axis to {span} mm, across and "
            f"down; {how}--read retract=MM sets the height"
        )
        self.note(one.line, text, code="W053")
        return points

    def _settle_change(self) -> None:
        """A tool change that no move follows is to a tool of its number, or no command."""
        if self._change is None:
            return
        place, _ = self._change
        number = self.events[place].value
        if number < 0.0:
            self.events[place] = replace(self.events[place], kind="", value=float("nan"))
            return
        tool = next((known for known in self.tools if known.number == number), Tool(number=int(number)))
        self.tools.setdefault(tool, len(self.tools))
        self._changed_to(tool)

    def _checked(self) -> tuple[Array, Array, Integers]:
        line = np.frombuffer(self.lines, dtype=np.int64) if len(self.lines) else np.zeros(0, dtype=np.int64)
        points = np.frombuffer(self.points, dtype=np.float64).reshape(-1, 3) if len(line) else np.zeros((0, 3))
        axes = np.frombuffer(self.axes, dtype=np.float64).reshape(-1, 3) if len(line) else np.zeros((0, 3))
        for i in np.flatnonzero(~(np.abs(points) <= limits.FARTHEST).all(axis=1)):
            value = ", ".join(f"{v * 1e3:g}" for v in points[i])
            self.error(int(line[i]), "coordinates, mm", code="P004", value=value, allowed=limits.PLACES)
        self._check_states(line)
        with np.errstate(over="ignore", invalid="ignore"):
            length = np.linalg.norm(axes, axis=1)
        bad = ~((length > 1e-9) & (length < 1e9))
        for i in np.flatnonzero(bad):
            allowed = "a direction from the tip into the holder"
            self.error(
                int(line[i]),
                "tool axis",
                code="P004",
                value=str(axes[i].tolist()),
                allowed=allowed,
                remedy="give i,j,k",
            )
        off = np.flatnonzero(~bad & (np.abs(length - 1.0) > UNIT))
        if len(off):
            text = f"tool axes of {len(off)} moves differ from length 1 by up to {np.abs(length[off] - 1).max():.2g}"
            self.note(int(line[off[0]]), text + "; made unit vectors")
        length[bad] = 1.0
        return points, axes / length[:, None], line

    def _check_states(self, line: Integers) -> None:
        """Faults of feeds and spindle speeds, each with the line of the first move that it holds for."""
        start, feed, spindle, *_ = self._state_columns()
        starts = np.append(start.astype(np.int64), len(line))
        rapid = np.append(np.array(self.rapids, dtype=bool), True)
        wrong = ~limits.feeds(feed), np.abs(spindle) > limits.FASTEST_TURN
        for i in np.flatnonzero(wrong[0] | wrong[1]):
            first, last = starts[i : i + 2]
            cutting = first + np.flatnonzero(~rapid[first:last])
            if wrong[0][i] and len(cutting):
                value = f"{float(feed[i]) * 6e4:g}"
                self.error(int(line[cutting[0]]), "feed, mm/min", code="P004", value=value, allowed=limits.FEEDS)
            if wrong[1][i] and last > first:
                value, allowed = (
                    f"{float(spindle[i]) * 30.0 / np.pi:g}",
                    f"up to {limits.FASTEST_TURN * 30.0 / np.pi:.3g}",
                )
                self.error(int(line[first]), "spindle speed, rpm", code="P004", value=value, allowed=allowed)

    def _state_columns(self) -> Array:
        """First move, feed, spindle, tool and operation of each state, as columns."""
        return np.array(self._states).reshape(-1, 5).T

    def _turns(self, axes: Array, rapid: Bools, line: Integers) -> None:
        """Remark on moves at feed that turn the tool far: how it turns on the way is the control's."""
        cosine = np.einsum("ij,ij->i", axes[1:], axes[:-1])
        cosine[rapid[1:]] = 1.0
        if len(cosine) and cosine.min() < TURN:
            worst = int(np.argmin(cosine))
            angle = np.degrees(np.arccos(np.clip(cosine[worst], -1.0, 1.0)))
            far = int((cosine < TURN).sum())
            self.note(
                int(line[worst + 1]),
                f"{far} moves at feed turn the tool by more than 10 deg, up to {angle:.4g}",
                code="W042",
            )

    def _table(self, points: Array, axes: Array, line: Integers) -> Motions:
        n = len(line)
        start, *columns = self._state_columns()
        counts = np.diff(np.append(start, n)).astype(np.int64)
        feed, spindle, tool, operation = (np.repeat(column, counts) for column in columns)
        rapid = np.frombuffer(self.rapids, dtype=np.int8).astype(bool)
        feed[rapid] = np.nan
        self._turns(axes, rapid, line)
        dwell = np.zeros(n)
        if self._dwells:
            dwell[list(self._dwells)] = list(self._dwells.values())
        unknown = np.flatnonzero(np.isnan(feed) & ~rapid)
        if len(unknown):
            self.note(int(line[unknown[0]]), f"{len(unknown)} moves at feed without a feed that is known", code="W043")
        notes = tuple(Note(first, text, count, code) for text, (first, count, code) in self._notes.items())
        return Motions(
            points=points,
            axes=axes,
            rapid=rapid,
            feed=feed,
            line=line,
            tool=tool.astype(np.int64),
            spindle=spindle,
            dwell=dwell,
            operation=operation.astype(np.int64),
            tools=tuple(self.tools),
            operations=tuple(self.operations),
            events=tuple(self.events),
            notes=tuple(sorted(notes, key=lambda note: note.line)),
            source=self.source,
        )


def _unit(axis: Vector | Array) -> Array:
    """A tool axis (3,) of any length as a unit vector; one without length is a fault that is told later."""
    length = float(np.linalg.norm(axis))
    return np.asarray(axis, dtype=np.float64) / (length if 0.0 < length < np.inf else 1.0)
