"""From motions, or a tool path file of any kind, to a :class:`machining.ToolPath`: where the tool cuts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from machining.task import REPEATED, ToolPath
from machining.toolpaths.motions import Motions, Note
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.reading import read_toolpath
from machining.toolpaths.source import content
from machining.toolpaths.tables import MARK, read_path
from robots import InputError
from robots.arrays import Array, Bools, Integers


@dataclass(frozen=True, eq=False)
class CuttingPath:
    """Path of the cutting moves and where it comes from.

    ``path``; ``moves`` (k,): move that ends at each of its k points; ``points`` (n,): point that each of the n moves
    ends at, -1 for moves that are not in the path.
    """

    path: ToolPath
    moves: Integers
    points: Integers


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
    moves : moves to take, ascending; None: all runs of :func:`cutting_runs`. One run at a time gives a path without
        joins; the segment that joins two runs is no motion of the tool, and its feed is NaN.

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
            raise InputError("tool path", value="no move at feed", remedy="check RAPID or G0 in the program")
        # Each run with the move before it, as in cutting_runs.
        chosen = np.flatnonzero(cutting | np.append(cutting[1:], False))
    else:
        chosen = np.asarray(moves, dtype=np.int64)
        if chosen.ndim != 1 or not len(chosen) or chosen.min() < 0 or chosen.max() >= motions.n:
            raise InputError("moves of the path", allowed=f"indices (k,) from 0 to {motions.n - 1}, k at least 1")
        if (np.diff(chosen) <= 0).any():
            raise InputError("moves of the path", allowed="ascending")
    normal = motions.axes if normals is None else np.broadcast_to(np.asarray(normals, dtype=np.float64), (motions.n, 3))
    first = _first_of_repeated(motions.points[chosen])
    last = np.append(first[1:], len(chosen)) - 1
    feed = motions.feed[chosen[first]].copy()
    # The move that ends here must also start at the point before it in the path.
    joined = np.append(True, np.diff(chosen)[first[1:] - 1] > 1)
    feed[joined] = np.nan
    ends = chosen[last]
    path = ToolPath(motions.points[chosen[first]], normal[ends], motions.axes[ends], feed)
    points = np.full(motions.n, -1, dtype=np.int64)
    points[chosen] = np.searchsorted(first, np.arange(len(chosen)), side="right") - 1
    return CuttingPath(path, ends, points)


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

    ``free`` (n - 1,): rapid moves between its runs; ``moves`` (n,) of the source that end at its points, ``count`` of
    them in all; ``notes``: what was odd about the file.
    """

    path: ToolPath
    free: Bools
    moves: Integers
    count: int
    notes: tuple[Note, ...] = ()


def read_given_path(file: Path, *, kind: str | None = None, options: ReadOptions | None = None) -> GivenPath:
    """A path from CSV with its surface normals, or the cutting moves of another tool path file.

    Without normals in the file the tool axes stand for them. ``kind``, ``options`` as in
    :func:`machining.toolpaths.read_toolpath`.

    Raises
    ------
    InputError
        As :func:`machining.read_path`, :func:`machining.toolpaths.read_toolpath` and
        :func:`machining.toolpaths.to_tool_path`.
    """
    is_table = kind == "csv" or (kind is None and file.suffix.lower() == ".csv")
    if is_table and not content(file).startswith(MARK.encode()):
        path = read_path(file)
        return GivenPath(path, np.zeros(path.n - 1, dtype=np.bool_), np.arange(path.n), path.n)
    motions = read_toolpath(file, kind=kind, options=options)
    cutting = to_tool_path(motions)
    return GivenPath(cutting.path, np.diff(cutting.moves) > 1, cutting.moves, motions.n, motions.notes)
