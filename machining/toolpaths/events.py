"""What a machine is told between moves, in order: the events of the file, and what only the moves' own columns say.

A reader keeps commands where they stood. Motions that come without them (tables, Python) have tools, spindle speeds,
rests and operations as columns of the moves; :func:`ordered` turns each change there that no event tells into one. So
do changes within a cycle of the file, such as the reversal of a tap.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from machining.toolpaths.motions import Event, Motions

# Word of an event that the file has no word for.
ADDED = ""
# Rests (s) and turns (rad/s) that differ by less are the same: rounding of decimals.
SAME = 1e-6


@dataclass(frozen=True)
class Told:
    """An event, and whether it is one of the motions' own (``given``) or added for what their columns say."""

    event: Event
    given: bool


def ordered(motions: Motions) -> tuple[Event, ...]:
    """All events in order: before the move ``move`` of each, those of one move as they follow each other."""
    return tuple(told.event for told in told_in_order(motions))


def added(motions: Motions) -> tuple[Event, ...]:
    """Commands that the moves' columns ask for and no event gives."""
    return tuple(told.event for told in told_in_order(motions) if not told.given)


def told_in_order(motions: Motions) -> Iterator[Told]:
    """As :func:`ordered`, and which of them are the motions' own."""
    n, given = motions.n, _by_move(motions)
    turns = np.nan_to_num(motions.spindle, nan=np.inf)
    places = {*given, *_changes(motions.operation), *_changes(motions.tool), *_changes(turns)}
    places |= set((np.flatnonzero(motions.dwell) + 1).tolist())
    walk = _Walk(motions)
    for move in sorted(places):
        yield from walk.at(move, given.get(move, ()), move < n)


class _Walk:
    """The state of the machine, from one place between moves to the next."""

    def __init__(self, motions: Motions) -> None:
        self.motions = motions
        self.operation = self.tool = -1
        self.spindle = 0.0

    def at(self, move: int, given: tuple[Event, ...] | list[Event], moves_on: bool) -> list[Told]:
        """Events before a move; ``moves_on``: there is one."""
        motions, own = self.motions, [self._own(event) for event in given]
        line = int(motions.line[min(move, motions.n - 1)])

        def more(kind: str, value: float, text: str = "") -> Told:
            return Told(Event(line, move, ADDED, text, kind, value), given=False)

        first: list[Told] = []
        rest = float(motions.dwell[move - 1]) if move else 0.0
        rest -= sum(event.value for event in given if event.kind == "dwell")
        if rest > SAME:
            first.append(more("dwell", rest))
        if not moves_on:
            return [*first, *own]
        operation, tool, spindle = int(motions.operation[move]), int(motions.tool[move]), float(motions.spindle[move])
        if operation != self.operation:
            self.operation = operation
            if motions.operations[operation].strip():
                first.append(more("operation", float(operation)))
        if tool != self.tool:
            self.tool = tool
            if motions.tools[tool].number is not None or motions.tools[tool].name.strip():
                first.append(more("tool", float(tool)))
        last: list[Told] = []
        if not math.isnan(spindle) and not abs(spindle - self.spindle) <= SAME:
            self.spindle = spindle
            last.append(more("spindle", spindle, "OFF" if spindle == 0.0 else "CLW" if spindle > 0.0 else "CCLW"))
        return [*first, *own, *last]

    def _own(self, event: Event) -> Told:
        """An event of the file; a change to the tool that is there already is no command."""
        if event.kind == "tool":
            if int(event.value) == self.tool:
                return Told(replace(event, kind="", value=math.nan), given=True)
            self.tool = int(event.value)
        elif event.kind == "operation":
            self.operation = int(event.value)
        elif event.kind == "spindle":
            self.spindle = event.value
        return Told(event, given=True)


def _by_move(motions: Motions) -> dict[int, list[Event]]:
    out: dict[int, list[Event]] = {}
    for event in motions.events:
        out.setdefault(event.move, []).append(event)
    return out


def _changes(values: NDArray[np.generic]) -> list[int]:
    """Moves whose value differs from the one before; the first counts."""
    if len(values) == 0:
        return []
    return [0, *(np.flatnonzero(values[1:] != values[:-1]) + 1).tolist()]
