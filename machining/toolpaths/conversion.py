"""From motions, or a tool path file of any kind, to a :class:`machining.ToolPath`: where the tool cuts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from machining.cutting.each_tool import BendingOfEach, ForceOfEach
from machining.cutting.end_mill import Bending
from machining.cutting.force import ByRuns, CuttingForce, MillingForce
from machining.cutting.plunging import Thrust
from machining.task import REPEATED, ToolPath
from machining.toolpaths.engagement import mills
from machining.toolpaths.motions import Motions, Note
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.reading import read_toolpath
from machining.toolpaths.selection import select
from machining.toolpaths.source import content
from machining.toolpaths.tables import MARK, read_path
from robots import InputError
from robots.arrays import Array, Bools, Integers

# Tools of a file that a message names.


@dataclass(frozen=True, eq=False)
class CuttingPath:
    """Path of the cutting moves and where it comes from.

    ``path``; ``moves`` (k,): move that ends at each of its k points; ``points`` (n,): point that each of the n moves
    ends at, -1 for moves that are not in the path; ``free`` (k - 1,): segments that join two cuts, no move that mills.
    """

    path: ToolPath
    moves: Integers
    points: Integers
    free: Bools


def cutting_runs(motions: Motions) -> list[Integers]:
    """Moves of each unbroken run of moves at feed, with the move before it, which ends where the run starts."""
    cutting = motions.cutting
    starts = np.flatnonzero(cutting & ~np.append(False, cutting[:-1]))
    ends = np.flatnonzero(cutting & ~np.append(cutting[1:], False))
    return [np.arange(first - 1, last + 1) for first, last in zip(starts, ends, strict=True)]


def to_tool_path(motions: Motions, normals: ArrayLike | None = None, *, moves: ArrayLike | None = None) -> CuttingPath:
    """Path through the cutting moves.

    Parameters
    ----------
    motions : n moves
    normals : surface normals (n, 3) or one (3,) for all; None: the tool axis
    moves : moves to take, ascending; None: those that mill sideways (:mod:`machining.toolpaths.engagement`), each run
        with the move before it; where there are none, as in a file that only drills, all runs of :func:`cutting_runs`.
        The segment that joins two runs is no cut, and its feed is NaN.

    Points nearer than ``REPEATED`` to the one before are one point: it keeps the feed that leads to it and takes the
    tool axis of the last of them, so a turn on the spot is in the axis of the point behind it.

    Raises
    ------
    InputError
        No cutting move, moves that are not ascending indices, normals of another shape or of length zero.
    """
    if moves is None:
        cutting = motions.cutting
        if not cutting.any():
            raise InputError(
                "tool path", code="P002", value="no move at feed", remedy="check RAPID or G0 in the program"
            )
        milled = mills(motions.points, motions.axes, cutting)
        cutting = milled if milled.any() else cutting
        # Each run with the move before it, as in cutting_runs.
        chosen = np.flatnonzero(cutting | np.append(cutting[1:], False))
    else:
        cutting = np.ones(motions.n, dtype=np.bool_)
        chosen = np.asarray(moves, dtype=np.int64)
        if chosen.ndim != 1 or not len(chosen) or chosen.min() < 0 or chosen.max() >= motions.n:
            raise InputError(
                "moves of the path", code="P009", allowed=f"indices (k,) from 0 to {motions.n - 1}, k at least 1"
            )
        if (np.diff(chosen) <= 0).any():
            raise InputError("moves of the path", code="P009", allowed="ascending")
    normal = motions.axes if normals is None else np.broadcast_to(np.asarray(normals, dtype=np.float64), (motions.n, 3))
    first = _first_of_repeated(motions.points[chosen])
    last = np.append(first[1:], len(chosen)) - 1
    feed = motions.feed[chosen[first]].copy()
    # The move that ends here must also start at the point before it in the path.
    joined = np.append(True, (np.diff(chosen)[first[1:] - 1] > 1) | ~cutting[chosen[first[1:]]])
    feed[joined] = np.nan
    ends = chosen[last]
    path = ToolPath(motions.points[chosen[first]], normal[ends], motions.axes[ends], feed)
    points = np.full(motions.n, -1, dtype=np.int64)
    points[chosen] = np.searchsorted(first, np.arange(len(chosen)), side="right") - 1
    return CuttingPath(path, ends, points, joined[1:])


def _first_of_repeated(points: Array) -> Integers:
    """Indices of the points that stay; each is at least ``REPEATED`` from the one kept before it."""
    kept = np.arange(len(points))
    while True:
        far = np.linalg.norm(np.diff(points[kept], axis=0), axis=1) >= REPEATED
        if far.all():
            return kept
        kept = kept[np.append(True, far)]


@dataclass(frozen=True, eq=False)
class GivenPath:
    """A path and where it comes from.

    ``free`` (n - 1,): segments between its cuts: rapid moves, plunges, ramps; ``moves`` (n,) of the source that end at
    its points, ``count`` of them in all; ``notes``: what was odd about the file; ``drilled``: nothing mills sideways;
    ``motions``: the source, None for a table.
    """

    path: ToolPath
    free: Bools
    moves: Integers
    count: int
    notes: tuple[Note, ...] = ()
    drilled: bool = False
    motions: Motions | None = None

    def acting(self, force: CuttingForce) -> CuttingForce:
        """A cutting force along this path, cut by cut; errors as :meth:`drilling`."""
        found = self.drilling(force)
        if not self.free.any() or self.drilled:
            return found
        return found.at(found.tool, self.free) if isinstance(found, ForceOfEach) else ByRuns(found, self.free)

    def bending(self, tool: Bending | None) -> Bending | None:
        """Bending along this path: of each tool where it is."""
        if isinstance(tool, BendingOfEach) and self.motions is not None:
            return tool.at(self.motions.tool[self.moves])
        return tool

    def drilling(self, force: CuttingForce) -> CuttingForce:
        """A cutting force, of the end teeth where the tool only plunges and drills.

        Raises
        ------
        InputError
            A milling force without coefficients for plunging, where nothing is milled sideways.
        """
        if isinstance(force, ForceOfEach) and self.motions is not None:
            forces = tuple(None if one is None else self.drilling(one) for one in force.forces)
            return replace(force, forces=forces).at(self.motions.tool[self.moves])
        return Thrust(force) if self.drilled and isinstance(force, MillingForce) else force


def entered(motions: Motions) -> Motions:
    """The same, and where a tool's first move is at feed it is a rapid one: the tool comes from the changer.

    A note says so, with the lines.
    """
    at_feed = motions.changes & ~motions.rapid
    if not at_feed.any():
        return motions
    text = "a tool's first move is at feed: it is driven as a rapid one"
    return replace(
        motions,
        rapid=motions.rapid | at_feed,
        feed=np.where(at_feed, np.nan, motions.feed),
        notes=(*motions.notes, Note(int(motions.line[at_feed][0]), text, int(at_feed.sum()))),
    )


def read_given_path(
    file: Path,
    *,
    kind: str | None = None,
    options: ReadOptions | None = None,
    operations: Sequence[str] = (),
    tool_numbers: Sequence[int] = (),
) -> GivenPath:
    """A path from CSV with its surface normals, or the moves of another tool path file that mill.

    Without normals in the file the tool axes stand for them. ``kind``, ``options`` as in
    :func:`machining.toolpaths.read_toolpath`, ``operations``, ``tool_numbers`` as in
    :func:`machining.toolpaths.selection.select`.

    Raises
    ------
    InputError
        As :func:`machining.read_path`, :func:`machining.toolpaths.read_toolpath`,
        :func:`machining.toolpaths.selection.select` and :func:`machining.toolpaths.to_tool_path`.
    """
    is_table = kind == "csv" or (kind is None and file.suffix.lower() == ".csv")
    if is_table and not content(file).startswith(MARK.encode()):
        if operations or tool_numbers:
            raise InputError(
                f"{file.name} has neither operations nor tools", code="P009", remedy="leave out the choice of them"
            )
        return _milled_rows(read_path(file))
    motions = read_toolpath(file, kind=kind, options=options)
    motions = select(motions, operations=operations, tool_numbers=tool_numbers)
    motions = entered(motions)
    cutting, milled = to_tool_path(motions), mills(motions.points, motions.axes, motions.cutting)
    notes = (*motions.notes, *_left_out(int((motions.cutting & ~milled).sum()), bool(milled.any())))
    return GivenPath(cutting.path, cutting.free, cutting.moves, motions.n, notes, not milled.any(), motions)


def _left_out(count: int, any_milled: bool) -> tuple[Note, ...]:
    """A note of moves at feed that are not looked at."""
    text = f"{count} moves at feed plunge, drill, retract or ramp into a cut: no stiffness or error is judged there"
    return (Note(0, text),) if count and any_milled else ()


def _milled_rows(path: ToolPath) -> GivenPath:
    """The points of a table between which the tool mills sideways; all of them where it never does."""
    milled = mills(path.points, path.axes, np.arange(path.n) > 0)
    whole = not milled.any() or bool(milled[1:].all())
    rows = np.arange(path.n) if whole else np.flatnonzero(milled | np.append(milled[1:], False))
    free = np.zeros(path.n - 1, dtype=np.bool_) if whole else ~milled[rows[1:]]
    if not whole:
        feed = np.where(milled, path.feed, np.nan)[rows]
        path = ToolPath(path.points[rows], path.normals[rows], path.axes[rows], feed)
    drilled = len(milled) > 1 and not milled.any()
    return GivenPath(
        path, free, rows, len(milled), _left_out(int((~milled[1:]).sum()), not drilled and not whole), drilled
    )
