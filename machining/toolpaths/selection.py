"""Some operations, or some tools, of a tool path: their moves, and the commands that belong to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from machining.toolpaths.events import ordered
from machining.toolpaths.motions import Event, Motions, Note
from robots import InputError
from robots.arrays import Bools, Integers
from robots.errors import listed

# Commands that begin an operation: what stands before them belongs to the one before.
BEGINS = ("operation", "tool")


def select(motions: Motions, *, operations: Sequence[str] = (), tool_numbers: Sequence[int] = ()) -> Motions:
    """The moves of some operations (by name, in any case) and of some tools; both where both are given.

    Commands stay with their operation: those before its first move from its tool or name on, those behind its last move
    up to the next one's. Coolant that was switched on before is switched on, and spindle and coolant are stopped behind
    the last move where moves that follow are left out. Where an operation begins at feed, it is entered by a rapid move
    to the point before.

    Raises
    ------
    InputError
        An operation or a tool that the tool path does not have, or nothing left.
    """
    if not operations and not tool_numbers:
        return motions
    keep = _named(motions, operations) & _numbered(motions, tool_numbers)
    if not keep.any():
        raise InputError(
            f"tool path {motions.source}: the operations and tools chosen have no move",
            code="P006",
            allowed=f"operations {_operations(motions)}; tools {_numbers(motions)}",
            remedy="leave out --operation or --tool-number (operations=, tool_numbers= in Python)",
        )
    starts = np.flatnonzero(keep & ~np.append(False, keep[:-1]))
    entered = starts[(starts > 0) & ~motions.rapid[starts]] - 1
    rapid, owner = motions.rapid.copy(), np.arange(motions.n)
    rapid[entered], owner[entered] = True, entered + 1
    own = keep.copy()
    keep[entered] = True
    rows = np.flatnonzero(keep)
    notes = motions.notes
    if len(entered):
        notes += (Note(0, f"{len(entered)} operations begin at feed: they are entered by a rapid move to that point"),)
    return replace(
        motions,
        points=motions.points[rows],
        axes=motions.axes[rows],
        rapid=rapid[rows],
        feed=np.where(rapid, np.nan, motions.feed)[rows],
        line=motions.line[rows],
        tool=motions.tool[owner][rows],
        spindle=motions.spindle[owner][rows],
        dwell=motions.dwell[rows],
        operation=motions.operation[owner][rows],
        events=_events(motions, own, keep),
        notes=notes,
    )


def _named(motions: Motions, wanted: Sequence[str]) -> Bools:
    if not wanted:
        return np.ones(motions.n, dtype=np.bool_)
    known = [name.strip().lower() for name in motions.operations]
    missing = [name for name in wanted if name.strip().lower() not in known]
    if missing:
        raise InputError(
            "operation of the tool path",
            code="P006",
            value=listed(missing),
            allowed=_operations(motions),
            remedy="give its name",
        )
    names = {name.strip().lower() for name in wanted}
    return np.asarray(np.isin(motions.operation, [i for i, name in enumerate(known) if name in names]))


def _numbered(motions: Motions, wanted: Sequence[int]) -> Bools:
    if not wanted:
        return np.ones(motions.n, dtype=np.bool_)
    missing = [str(number) for number in wanted if number not in [tool.number for tool in motions.tools]]
    if missing:
        raise InputError(
            "tool number of the tool path",
            code="P006",
            value=listed(missing),
            allowed=_numbers(motions),
            remedy="give one of them",
        )
    return np.asarray(np.isin(motions.tool, [i for i, tool in enumerate(motions.tools) if tool.number in wanted]))


def _operations(motions: Motions) -> str:
    return listed([repr(name) for name in motions.operations if name.strip()]) or "none: the file names no operation"


def _numbers(motions: Motions) -> str:
    return listed([str(t.number) for t in motions.tools if t.number is not None]) or "none: the file numbers no tool"


def _events(motions: Motions, own: Bools, keep: Bools) -> tuple[Event, ...]:
    """Events of the moves (n,) of the choice, before their new places.

    ``keep`` (n,): these, and moves that lead to where one begins, whose events come before.
    """
    n, count = motions.n, int(keep.sum())
    place: Integers = np.cumsum(keep) - keep - (own & ~np.append(False, own[:-1]) & np.append(False, keep[:-1]))
    gaps: dict[int, list[Event]] = {}
    for event in ordered(motions):
        gaps.setdefault(event.move, []).append(event)
    out: list[Event] = []
    source, made = _Running(), _Running()
    # Ends of runs are places too: what runs there may have to be stopped.
    edges = np.flatnonzero(np.diff(np.concatenate([[False], own, [False]]).astype(np.int8)))
    last = int(edges[-1])
    for move in sorted({*gaps, *edges.tolist()}):
        left, right = move > 0 and bool(own[move - 1]), move < n and bool(own[move])
        here, at = gaps.get(move, []), int(place[move]) if move < n else count
        first = next((i for i, event in enumerate(here) if event.kind in BEGINS), len(here))
        before, behind = here[:first], here[first:]
        if left:
            out += [made.taken(replace(event, move=at)) for event in before]
        for event in before:
            source.taken(event)
        if right and not left:
            out += [made.taken(replace(event, move=at)) for event in source.missing(made, at, _line(motions, move))]
            out += [] if behind else [made.taken(replace(event, move=at)) for event in before]
        for event in behind:
            source.taken(event)
        if right or (left and move == n):
            out += [made.taken(replace(event, move=at)) for event in behind]
        if move == last < n:
            out += [made.taken(event) for event in made.stops(at, _line(motions, move))]
    return tuple(out)


def _line(motions: Motions, move: int) -> int:
    return int(motions.line[min(move, motions.n - 1)])


class _Running:
    """What runs after the events taken so far."""

    def __init__(self) -> None:
        self.coolants: dict[str, None] = {}
        self.turning = False

    def taken(self, event: Event) -> Event:
        if event.kind == "coolant":
            if event.text == "off":
                self.coolants.clear()
            else:
                self.coolants[event.text] = None
        elif event.kind == "spindle":
            self.turning = event.value != 0.0
        return event

    def missing(self, made: _Running, move: int, line: int) -> list[Event]:
        """Coolant that is on here and not there."""
        return [Event(line, move, "COOLNT", kind, "coolant") for kind in self.coolants if kind not in made.coolants]

    def stops(self, move: int, line: int) -> list[Event]:
        """What stops all that runs."""
        out = [Event(line, move, "SPINDL", "OFF", "spindle", 0.0)] if self.turning else []
        return out + ([Event(line, move, "COOLNT", "off", "coolant")] if self.coolants else [])
