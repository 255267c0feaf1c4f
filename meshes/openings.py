"""Openings and rims of a casing: where element lines must lie, and which elements fall out.

A branch of a casing is a tube of rows (along the centre line) and columns (around the section). Lines along are
shares of the branch's centre line, 0 to 1. Lines around go once about the section, wall by wall in the order of
``SIDES``; on each wall they run from -0.5 to 0.5.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from robots import InputError
from robots.arrays import Array, Bools, Integers
from robots.errors import raise_any
from robots.schema.description import Opening, Rim

SIDES = ("-z", "+y", "+z", "-y")
# Lines nearer than this share of the length are one line: round-off of the file's decimals.
SAME = 1e-9
# Fewest elements across an opening, so that its edges can bend out of line.
LEAST_ACROSS = 2


@dataclass(frozen=True)
class Branch:
    """What the lines of one branch depend on.

    ``name``: for messages; ``length`` of the centre line, m; ``kinks``: share of the length of each, and how far
    along the centre line (m) its mitre reaches on the inner side; ``sides`` (4,): walls' smallest mid-surface widths
    in the order of ``SIDES``, m (a tube has four equal ones); ``wall``: thickest, m.
    """

    name: str
    length: float
    kinks: tuple[tuple[float, float], ...]
    sides: Array
    wall: float


@dataclass(frozen=True)
class Lines:
    """Lines of one branch.

    ``along`` (l,): shares, from 0 to 1; ``around``: of each wall, from -0.5 to 0.5; ``holes`` (h, 4): from and to
    along, from and to around; ``hole_walls`` (h,); ``rim``: share of the length at either end, ``rim_wall`` m.
    """

    along: Array
    around: tuple[Array, Array, Array, Array]
    holes: Array
    hole_walls: Integers
    rim: float
    rim_wall: float

    def removed(self, along: Array, wall: Integers, around: Array) -> Bools:
        """Which elements (rows, columns) lie in an opening, by their centres: (rows,), (columns,), (columns,)."""
        out = np.zeros((along.size, wall.size), dtype=bool)
        for (low, high, left, right), side in zip(self.holes, self.hole_walls, strict=True):
            column = (wall == side) & (left < around) & (around < right)
            out |= ((low < along) & (along < high))[:, None] & column
        return out

    def thickness(self, along: Array, wall: Array) -> Array:
        """Thickness of rows (rows,) from their centres and the casing's own wall there, m."""
        return np.where((along < self.rim) | (along > 1.0 - self.rim), self.rim_wall, wall)


def lines_of(branch: Branch, openings: Sequence[Opening], rim: Rim | None) -> Lines:
    """Lines of a branch with these openings and rims.

    Raises
    ------
    InputError
        Rims longer than half of the branch, thinner than the casing or so thick that they fill it; openings that
        overlap, touch, or reach into a rim; lines nearer to one another than the wall is thick. All faults at once.
    """
    faults = list(_rim_faults(branch, rim))
    if not faults:
        faults = [*_overlaps(branch, openings), *_reaching_rims(branch, openings, rim)]
    if not faults:
        faults = [*_near_along(branch, openings, rim), *_near_around(branch, openings)]
    raise_any(branch.name, faults)
    share = 0.0 if rim is None else rim.length.si / branch.length
    along = [0.0, 1.0, *(edge for opening in openings for edge in opening.along)]
    along += [] if rim is None else [share, 1.0 - share]
    holes = np.array([[*opening.along, *_around(opening)] for opening in openings]).reshape(-1, 4)
    walls = np.array([SIDES.index(opening.side) for opening in openings], dtype=np.int64)
    around = [_distinct(np.concatenate([[-0.5, 0.5], holes[walls == side, 2:].ravel()])) for side in range(4)]
    return Lines(
        _distinct(np.array(along)),
        (around[0], around[1], around[2], around[3]),
        holes,
        walls,
        share,
        0.0 if rim is None else rim.wall.si,
    )


def divided(lines: Array, length: float, size: float, holes: Array, least: int = 1) -> Array:
    """Grid from the first line to the last: each piece between lines divided evenly into elements up to ``size``.

    Parameters
    ----------
    lines : (l,) in any unit, ascending; ``length`` (m) is that of the whole, from the first to the last
    holes : (h, 2) from and to of the openings; pieces in one get two elements or more
    least : elements of the whole, at least
    """
    share = np.diff(lines) / (lines[-1] - lines[0])
    middle = 0.5 * (lines[1:] + lines[:-1])
    inside = ((holes[:, 0] < middle[:, None]) & (middle[:, None] < holes[:, 1])).any(axis=1)
    count = np.maximum(np.ceil(length * share / size).astype(int), np.where(inside, LEAST_ACROSS, 1))
    if count.sum() < least:
        count = -(-count * least // count.sum())
    pieces = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(lines[:-1], lines[1:], count, strict=True)]
    return np.concatenate([*pieces, lines[-1:]])


def _around(opening: Opening) -> tuple[float, float]:
    """Edges of an opening in the direction of going round: the far walls are walked against growing z or y."""
    low, high = opening.across
    return (low - 0.5, high - 0.5) if opening.side in ("-z", "+y") else (0.5 - high, 0.5 - low)


def _distinct(values: Array) -> Array:
    values = np.sort(values)
    return np.asarray(values[np.concatenate([[True], np.diff(values) > SAME])])


def _label(openings: Sequence[Opening], i: int) -> str:
    return f"opening {i + 1} ({openings[i].side})"


def _rim_faults(branch: Branch, rim: Rim | None) -> Iterator[InputError]:
    if rim is None:
        return
    if rim.length.si > 0.5 * branch.length * (1.0 + SAME):
        yield InputError(
            f"{branch.name}: length of the rims (m)",
            code="L009",
            value=rim.length.si,
            allowed=f"up to half of the centre line, {0.5 * branch.length:.4g}",
        )
    if not branch.wall <= rim.wall.si <= branch.sides.min():
        yield InputError(
            f"{branch.name}: wall of the rims (m)",
            code="L009",
            value=rim.wall.si,
            allowed=f"from the casing's wall, {branch.wall:.4g}, to the width of its mid-surface, "
            f"{branch.sides.min():.4g}",
        )


def _overlaps(branch: Branch, openings: Sequence[Opening]) -> Iterator[InputError]:
    for j, second in enumerate(openings):
        for i, first in enumerate(openings[:j]):
            if first.side != second.side:
                continue
            both = zip((first.along, first.across), (second.along, second.across), strict=True)
            if all(a[0] <= b[1] + SAME and b[0] <= a[1] + SAME for a, b in both):
                yield InputError(
                    f"{branch.name}: {_label(openings, i)} and {_label(openings, j)} overlap or touch",
                    code="L009",
                    value=f"along {list(first.along)} and {list(second.along)}, "
                    f"across {list(first.across)} and {list(second.across)}",
                    allowed="separate openings",
                    remedy="make them one opening, or leave a strip of wall between them",
                )


def _reaching_rims(branch: Branch, openings: Sequence[Opening], rim: Rim | None) -> Iterator[InputError]:
    if rim is None:
        return
    share = rim.length.si / branch.length
    for i, opening in enumerate(openings):
        if opening.along[0] < share - SAME or opening.along[1] > 1.0 - share + SAME:
            yield InputError(
                f"{branch.name}: {_label(openings, i)} reaches into a rim, along",
                code="L009",
                value=list(opening.along),
                allowed=f"from {share:.4g} to {1.0 - share:.4g} of the centre line (rims of {rim.length.si:.4g} m)",
                remedy="shorten the opening or the rims",
            )


class _Line(NamedTuple):
    """A line across a direction: its share, its name, how much room it takes (m), whether the mesh has it anyway."""

    share: float
    name: str
    room: float = 0.0
    fixed: bool = False


def _near_along(branch: Branch, openings: Sequence[Opening], rim: Rim | None) -> Iterator[InputError]:
    lines = [_Line(0.0, "the root", fixed=True), _Line(1.0, "the tip", fixed=True)]
    lines += [_Line(share, "a kink with its mitre", reach, fixed=True) for share, reach in branch.kinks]
    lines += [_Line(edge, _label(openings, i)) for i, opening in enumerate(openings) for edge in opening.along]
    if rim is not None:
        share = rim.length.si / branch.length
        lines += [_Line(share, "the rim at the root"), _Line(1.0 - share, "the rim at the tip")]
    yield from _near(branch, "along the centre line", lines, branch.length)


def _near_around(branch: Branch, openings: Sequence[Opening]) -> Iterator[InputError]:
    for side, width in zip(SIDES, branch.sides, strict=True):
        lines = [_Line(edge, "the edge of the wall", fixed=True) for edge in (0.0, 1.0)]
        lines += [
            _Line(edge, _label(openings, i))
            for i, opening in enumerate(openings)
            if opening.side == side
            for edge in opening.across
        ]
        yield from _near(branch, "across the wall", lines, float(width))


def _near(branch: Branch, direction: str, lines: list[_Line], length: float) -> Iterator[InputError]:
    """Lines that would leave a strip narrower than the wall is thick: no shell, and slivers for elements."""
    lines = sorted(lines)
    for a, b in pairwise(lines):
        least = (branch.wall + a.room + b.room) / length
        if not (a.fixed and b.fixed) and SAME < b.share - a.share < least * (1.0 - SAME):
            yield InputError(
                f"{branch.name}: {a.name} and {b.name} are close to each other {direction}, shares",
                code="L009",
                value=[round(a.share, 6), round(b.share, 6)],
                allowed=f"equal, or {least:.3g} apart ({1e3 * least * length:.3g} mm; the wall is "
                f"{1e3 * branch.wall:.3g} mm)",
                remedy="move them apart, or give both the same share",
            )
