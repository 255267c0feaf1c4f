"""Moves of a program in the making: with points put in between, where linear axes stand, and gamma."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from machining.cell import Cell
from machining.programs.subdivide import subdivided
from machining.task import REPEATED, Task, ToolPath
from machining.toolpaths.motions import Motions
from robots.arrays import Array, Bools, Integers


@dataclass(frozen=True, eq=False)
class PostState:
    """Moves with points put in, their travels (n, k), gamma (n,) once it is chosen, and postures (n, dof) wanted."""

    motions: Motions
    travel: Array
    inserted: Bools
    gamma: Array | None
    near: Array | None = None


def refined(state: PostState, pieces: Integers) -> PostState:
    """Split move i into ``pieces[i]`` equal ones; travel and gamma go evenly."""
    motions, inserted, move = subdivided(state.motions, pieces)
    last = np.cumsum(pieces) - 1
    share = (np.arange(len(move)) - (last - pieces + 1)[move] + 1) / pieces[move]
    before = np.maximum(move - 1, 0)

    def between(values: Array) -> Array:
        share_ = share if values.ndim == 1 else share[:, None]
        return np.asarray(values[before] + share_ * (values[move] - values[before]))

    gamma = None if state.gamma is None else between(np.unwrap(state.gamma))
    near = None if state.near is None else between(state.near)
    return PostState(motions, between(state.travel), inserted | state.inserted[move], gamma, near)


def places(motions: Motions) -> tuple[Integers, Integers]:
    """Moves (k,) that lead elsewhere, and the path point (n,) that each move leads to."""
    still = np.zeros(motions.n, dtype=np.bool_)
    still[1:] = (np.linalg.norm(np.diff(motions.points, axis=0), axis=1) < REPEATED) & (
        np.linalg.norm(np.diff(motions.axes, axis=0), axis=1) < REPEATED
    )
    return np.flatnonzero(~still), np.cumsum(~still) - 1


def task_of(cell: Cell, state: PostState, table: float, reference: Array | None) -> tuple[Task, Integers]:
    """The path as a task of the robot, and the path point (n,) of each move."""
    motions = state.motions
    kept, place = places(motions)
    # Linear axes shift the part against the base; they do not turn it.
    T = cell.T_base_part(state.travel[kept], np.full(len(kept), table))
    path = ToolPath(motions.points[kept], motions.axes[kept], motions.axes[kept], motions.feed[kept])
    shift = T[:, :3, 3] - T[0, :3, 3]
    task = Task(path, cell.tool.T_flange_tool, T[0], reference, shift if shift.any() else None)
    return task, place


def source_line(state: PostState, point: int) -> int:
    """Source line of a path point."""
    _, place = places(state.motions)
    return int(state.motions.line[np.searchsorted(place, point)])


def tool_frames(cell: Cell, state: PostState, table: float, reference: Array | None, gamma: Array) -> Array:
    """Tool frames (n, 4, 4) in the part frame."""
    motions = state.motions
    task, place = task_of(cell, state, table, reference)
    first = places(motions)[0]
    in_part = Task(task.path, cell.tool.T_flange_tool, np.eye(4), task.reference)
    T = in_part.tool_frames(gamma[first][:, None])[place, 0]
    T[:, :3, 3] = motions.points
    return np.asarray(T)
