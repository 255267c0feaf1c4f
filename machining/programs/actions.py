"""What a controller is told between moves, apart from its language: outputs, calls, rests and stops.

A command of the tool path becomes actions by the table ``[commands]`` of the cell file; a language writes and reads
actions. What is read back is compared with what was to be written, place by place between the moves.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from machining.cell.schema import CommandsTable
from machining.toolpaths.motions import Event, Motions
from robots import InputError
from robots.constants import RPM

# Keys of the table that are no outputs, inputs and routines.
FIGURES = {"spindle_full_rpm", "spindle_dwell_s"}
COOLANTS = ("flood", "mist", "through")
# How languages write that an output is on.
ON = ("true", "1", "on")
# Kinds of actions that are on or off.
ON_OFF = ("output", "coolant")
# Digits of a rest in s and of a share of full scale; half of the last one is what they may differ by, and rounding.
DIGITS = {"wait": 3, "analog": 5, "spindle": 3}
ROUNDING = 1e-9
_NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
# What the head of a program says of frames and weight.
HEAD = ("tool_frame", "base_frame", "payload")


@dataclass(frozen=True, slots=True)
class Action:
    """One thing that the controller does.

    ``kind``: "output" (``name``, ``on``), "analog" (``name``, ``value`` of it), "wait" (``value`` s), "call" (``name``,
    ``value``: number of a tool), "stop" (``name`` of the input that ends it, where the language has no stop),
    "optional_stop" (``name`` of the input that asks for it, ``value`` that of "stop"), "await" (``name`` of the input
    that says that the spindle is ready); "tool_frame", "base_frame" and "payload" of the head (``value``: figures,
    ``name`` of the data where the language has names); languages with
    commands of their own have "spindle" (``name`` "cw", "ccw" or "off", ``value`` rpm), "coolant" (``name``, ``on``)
    and "tool" (``value``); several tools make "tool_frame" (``name`` of the tool's data, or ``value``: its
    figures). ``value`` is text with the digits that are written.
    """

    kind: str
    name: str = ""
    value: str = ""
    on: bool = False

    @property
    def words(self) -> str:
        """What it is, for messages."""
        said = " ".join(part for part in (self.kind.replace("_", " "), self.name, self.value) if part)
        return said + (f" {'on' if self.on else 'off'}" if self.kind in ON_OFF else "")

    def same(self, other: Action) -> bool:
        """Whether it is the same action, its number within the last digit that is written."""
        alike = (self.kind, self.name.lower(), self.on) == (other.kind, other.name.lower(), other.on)
        if not alike or self.value == other.value:
            return alike
        mine, others = (list(map(float, _NUMBER.findall(one.value))) for one in (self, other))
        if len(mine) != len(others) or not mine:
            return False
        within = 0.5 * 10.0 ** -DIGITS.get(self.kind, 9) + ROUNDING
        return all(abs(a - b) <= within for a, b in zip(mine, others, strict=True))


def digits(kind: str, value: float) -> str:
    """The value of an action as text."""
    return f"{value:.{DIGITS[kind]}f}"


def by_table(
    event: Event, motions: Motions, table: CommandsTable, *, scaled: bool, stops: bool
) -> tuple[tuple[Action, ...], str]:
    """Actions of a command by the cell's table, and what of it the table does not define ("": nothing).

    ``scaled``: analog outputs take a share of full scale, else the speed itself in rpm; ``stops``: the language has a
    stop of its own.

    Raises
    ------
    InputError
        A spindle speed beyond full scale.
    """
    if event.kind == "spindle":
        return _spindle(event, table, scaled)
    if event.kind == "coolant":
        return _coolant(event.text, table)
    if event.kind == "dwell":
        return (Action("wait", value=digits("wait", event.value)),), ""
    if event.kind == "probe" and table.probe is not None:
        return (Action("output", _name(table.probe), on=event.value > 0.0),), ""
    if event.kind == "probe":
        return (), "probe"
    if event.kind == "stop":
        if stops or table.restart is not None:
            return (Action("stop", "" if stops else _name(table.restart)),), ""
        return (), "restart"
    if event.kind == "optional stop":
        missing = [key for key in ("optional_stop", *(() if stops else ("restart",))) if getattr(table, key) is None]
        if missing:
            return (), " and ".join(missing)
        return (Action("optional_stop", _name(table.optional_stop), "" if stops else _name(table.restart)),), ""
    if event.kind == "tool":
        number = motions.tools[int(event.value)].number
        if table.tool_change is None:
            return (), "tool_change"
        if number is None:
            return (), "a number of the tool in the tool path"
        return (Action("call", table.tool_change, str(number)),), ""
    return (), ""


def _name(terminal: int | str | None) -> str:
    return str(terminal)


def _spindle(event: Event, table: CommandsTable, scaled: bool) -> tuple[tuple[Action, ...], str]:
    ways = {1: table.spindle_clockwise, -1: table.spindle_counterclockwise}
    sense = 0 if event.value == 0.0 else 1 if event.value > 0.0 or event.text == "CLW" else -1
    named = {1: "spindle_clockwise", -1: "spindle_counterclockwise"}
    off = [Action("output", _name(way)) for key, way in ways.items() if way is not None and key != sense]
    if sense == 0:
        speed = (
            [] if table.spindle_speed is None else [Action("analog", _name(table.spindle_speed), digits("analog", 0.0))]
        )
        return (*off, *speed), "" if off else "spindle_clockwise"
    if ways[sense] is None:
        return (), named[sense]
    on = Action("output", _name(ways[sense]), on=True)
    ready = run_up(table)
    if table.spindle_speed is None or table.spindle_full_rpm is None:
        return (*off, on, *ready), "spindle_speed"
    if event.value != event.value:
        return (*off, on, *ready), "a spindle speed in the tool path"
    rpm = abs(event.value) / RPM
    if rpm > table.spindle_full_rpm * (1.0 + ROUNDING):
        raise InputError(
            f"spindle speed of line {event.line}",
            code="Q004",
            value=f"{rpm:g} rpm",
            allowed=f"up to {table.spindle_full_rpm:g} rpm, spindle_full_rpm of the cell file",
            remedy="post the tool path with another speed, or correct the cell file",
        )
    value = digits("analog", rpm / table.spindle_full_rpm if scaled else rpm)
    return (*off, Action("analog", _name(table.spindle_speed), value), on, *ready), ""


def run_up(table: CommandsTable) -> tuple[Action, ...]:
    """What a program waits for after a start of the spindle; nothing where the cell does not say."""
    if table.spindle_ready is not None:
        return (Action("await", _name(table.spindle_ready)),)
    rest = table.spindle_dwell_s
    return () if rest is None else (Action("wait", value=digits("wait", rest)),)


def _coolant(kind: str, table: CommandsTable) -> tuple[tuple[Action, ...], str]:
    keys = {name: getattr(table, f"coolant_{name}") for name in COOLANTS}
    if kind == "off":
        known = [Action("output", _name(key)) for key in keys.values() if key is not None]
        return tuple(known), "" if known else "coolant_flood, coolant_mist or coolant_through"
    key = keys[kind]
    return ((), f"coolant_{kind}") if key is None else ((Action("output", _name(key), on=True),), "")


@dataclass(frozen=True)
class Pattern:
    """How a language writes one kind of action; ``name`` and ``on`` where the line does not say them.

    ``line``: matches the code of a whole line, with the groups ``name``, ``value`` and ``on`` as far as it has them.
    """

    kind: str
    line: re.Pattern[str]
    name: str = ""
    on: bool = False


@dataclass(frozen=True)
class Reader:
    """Reads actions from lines of code.

    ``asks``: opens a condition on the input of optional stops. ``names``: outputs, inputs and routines that the cell
    defines (lower case); others are the shop's own. ``ready``: the input that says that the spindle is ready.
    """

    patterns: Sequence[Pattern]
    asks: re.Pattern[str] | None
    names: frozenset[str]
    ready: str = ""

    def found(self, code: str) -> Action | None:
        """The action of a line; None where there is none that is known."""
        for pattern in self.patterns:
            match = pattern.line.match(code)
            if match is not None:
                said: Mapping[str, str | None] = match.groupdict()
                name = said.get("name")
                if pattern.kind == "await" and name != self.ready:
                    continue
                if name is not None and pattern.kind not in ("stop", *HEAD) and name.lower() not in self.names:
                    return None
                on = (said.get("on") or "").lower() in ON if "on" in said else pattern.on
                return Action(pattern.kind, name or pattern.name, said.get("value") or "", on)
        return None

    def optional(self, code: str) -> str | None:
        """The input that a line asks before a stop; None where it asks for none that is known."""
        match = None if self.asks is None else self.asks.match(code)
        return match["name"] if match is not None and match["name"].lower() in self.names else None


def names_of(table: CommandsTable) -> frozenset[str]:
    """Outputs, inputs and routines of a table, in lower case."""
    given = table.model_dump(exclude=FIGURES).values()
    return frozenset(str(name).lower() for name in given if name is not None)


def difference(
    wanted: Iterable[tuple[int, Action]], found: Iterable[tuple[int, Action]], where: Sequence[str] = ()
) -> InputError | None:
    """What differs first between the actions wanted and those found, each with the move that it comes before.

    More rests and stops than wanted are the shop's own: they move and switch nothing. What the head says of frames and
    weight (:data:`HEAD`, before the first move) may stand in any order; frames may be left to the controller.
    ``where``: places of the moves in the program, for messages.
    """
    gaps: dict[int, tuple[list[Action], list[Action]]] = {}
    for i, actions in enumerate((wanted, found)):
        for move, action in actions:
            gaps.setdefault(move, ([], []))[i].append(action)
    for move in sorted(gaps):
        left, read = gaps[move]
        if move == 0:
            wrong = _head_difference(left, read, where)
            if wrong is not None:
                return wrong
            left, read = ([a for a in some if a.kind not in HEAD or not a.value] for some in (left, read))
        for action in read:
            if left and left[0].same(action):
                left = left[1:]
            elif action.kind not in ("wait", "stop", "optional_stop", "await") and not (
                action.kind == "tool_frame" and move == 0
            ):
                return _wrong(move, where, action, "not in the tool path there", [] if not left else left[:1])
        if left:
            return _wrong(move, where, left[0], "missing", [])
    return None


def _head_difference(wanted: list[Action], found: list[Action], where: Sequence[str]) -> InputError | None:
    """What differs first in the head; frames that it does not say at all stand on the controller."""
    said = {(action.kind, action.name.lower()): action for action in found if action.kind in HEAD and action.value}
    for action in wanted:
        if action.kind not in HEAD or not action.value:
            continue
        other = said.get((action.kind, action.name.lower()))
        if other is None and action.kind == "payload":
            return _wrong(0, where, action, "missing", [])
        if other is not None and not action.same(other):
            return _wrong(0, where, other, "another", [action])
    return None


def _wrong(move: int, where: Sequence[str], action: Action, how: str, instead: list[Action]) -> InputError:
    place = f"before {where[move]}" if move < len(where) else "after the last move"
    wanted = f" (wanted there: {instead[0].words})" if instead else ""
    return InputError(
        f"command {action.words} {place}",
        code="Q001",
        value=f"{how}{wanted}",
        allowed="the commands of the tool path, in their order",
        remedy="write it as the bundled template does",
    )
