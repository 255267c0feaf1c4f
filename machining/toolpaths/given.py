"""A path to machine from any tool path file: where the tool cuts, and which moves of the file that was."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from machining.task import ToolPath
from machining.toolpaths.conversion import to_tool_path
from machining.toolpaths.motions import Note
from machining.toolpaths.neutral import MARK
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.path_file import read_path
from machining.toolpaths.reading import read_toolpath
from machining.toolpaths.source import content
from robots.arrays import Bools, Integers


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
