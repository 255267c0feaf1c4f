"""What comes between the moves of a program: events of the tool path as templates see them, each with its actions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from machining.cell.schema import CommandsTable
from machining.programs.actions import Action
from machining.programs.source_text import SourceText
from machining.toolpaths.events import ordered
from machining.toolpaths.motions import Event, Motions
from robots import Remark
from robots.constants import RPM

KEYS = tuple(CommandsTable.model_fields)
# Of a spindle that is switched on all the same.
SPEEDS = ("spindle_speed", "a spindle speed in the tool path")
# Words for commands that the file has no word for.
_WORDS = {"coolant": "COOLNT", "dwell": "DELAY", "stop": "STOP", "optional stop": "OPSTOP", "probe": "PROBE"}


@dataclass(frozen=True)
class Happening:
    """What is not motion: ``kind`` is that of the event, "event" for a word; texts are :class:`SourceText`.

    Tool: ``number`` ("" without), ``name``, ``diameter_mm`` ("" without). Spindle: ``rpm`` ("0": stop), ``clockwise``.
    Operation: ``name``. Others: ``name`` the word, ``text``. ``line``: of the source. ``actions``: what the controller
    is told; none for a word, and where cell or language know no way.
    """

    kind: str
    name: SourceText = SourceText("")  # noqa: RUF009 - immutable
    text: SourceText = SourceText("")  # noqa: RUF009
    number: str = ""
    diameter_mm: str = ""
    rpm: str = ""
    clockwise: bool = True
    line: int = 0
    actions: tuple[Action, ...] = ()


@dataclass(frozen=True)
class Undefined:
    """A command that cell or language know no way for: ``what`` it is, how many there are, ``line`` of the first."""

    what: str
    count: int
    line: int

    @property
    def sentence(self) -> str:
        """What is missing where, and what stands in the program instead."""
        where = f"needed {self.count} times, first in" if self.count > 1 else "needed in"
        where += f" line {self.line}"
        is_key = self.what.replace(",", " ").split()[0] in KEYS
        what = f"[commands] of the cell file has no {self.what}" if is_key else f"missing: {self.what}"
        if self.what in SPEEDS:
            return f"{what}, {where}: the spindle is switched on at the speed that it has"
        return Remark(f"{what}, {where}: written as a comment only", code="W048")


@dataclass(frozen=True, eq=False)
class Between:
    """What comes before each move (after the last: under the number of moves), and what is not defined."""

    happenings: Mapping[int, tuple[Happening, ...]]
    undefined: tuple[Undefined, ...]

    @property
    def actions(self) -> list[tuple[int, Action]]:
        """All actions in order, each with the move that it comes before."""
        found = sorted(self.happenings.items())
        return [(move, action) for move, all_ in found for one in all_ for action in one.actions]


NOTHING = Between({}, ())
# The actions of an event, and what of it is not defined ("": nothing).
Means = Callable[[Event, Motions], tuple[tuple[Action, ...], str]]


def between(motions: Motions, means: Means) -> Between:
    """Everything between moves, in order; ``means`` says by which actions an event is carried out."""
    out: dict[int, list[Happening]] = {}
    undefined: dict[str, Undefined] = {}
    for event in ordered(motions):
        found, missing = means(event, motions) if event.kind else ((), "")
        if missing:
            known = undefined.get(missing, Undefined(missing, 0, event.line))
            undefined[missing] = replace(known, count=known.count + 1)
        out.setdefault(event.move, []).append(_happening(event, motions, found))
    return Between({move: tuple(found) for move, found in out.items()}, tuple(undefined.values()))


def _happening(event: Event, motions: Motions, actions: tuple[Action, ...]) -> Happening:
    name, text = SourceText(event.word or _WORDS.get(event.kind, "")), SourceText(event.text)
    whole = Happening(event.kind or "event", name, text, line=event.line, actions=actions)
    if event.kind == "operation":
        return replace(whole, name=SourceText(motions.operations[int(event.value)]), text=SourceText(""))
    if event.kind == "tool":
        tool = motions.tools[int(event.value)]
        diameter = f"{tool.diameter * 1e3:.6g}" if np.isfinite(tool.diameter) else ""
        number = "" if tool.number is None else str(int(tool.number))
        return replace(whole, name=SourceText(tool.name), number=number, diameter_mm=diameter)
    if event.kind == "spindle":
        rpm = "unknown" if np.isnan(event.value) else f"{abs(event.value) / RPM:.6g}"
        return replace(whole, rpm=rpm, clockwise=event.value > 0.0 or event.text == "CLW")
    if event.kind == "dwell":
        return replace(whole, text=SourceText(f"{event.value:.3f} s"))
    return whole
