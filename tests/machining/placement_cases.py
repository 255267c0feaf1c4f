"""What the tests of placement share: the KR60 with a spindle, a part before it, and linear axes."""

from __future__ import annotations

from typing import Any

import numpy as np
from posture_cases import part, spindle

import fem
from machining.cell import Cell, LinearAxis, Tool
from machining.cutting import ConstantForce
from machining.placement import Goal, Problem, space_of
from machining.posture.drive import Drive
from machining.posture.points import GammaRange
from machining.task import ToolPath, tool_path


def rail(name: str = "rail", direction: tuple[float, float, float] = (1.0, 0.0, 0.0), **more: Any) -> LinearAxis:
    limits = more.pop("limits", (-1.0, 1.0))
    return LinearAxis(name, np.array(direction), np.array(limits), **more)


def cell_of(*axes: LinearAxis, **more: Any) -> Cell:
    return Cell(T_world_part0=more.pop("part", part()), tool=Tool(spindle()), linear_axes=axes, **more)


def line(n: int = 12, length: float = 0.4, feed: float | None = None) -> ToolPath:
    """Along the part's x axis, tool upright."""
    points = np.zeros((n, 3))
    points[:, 0] = np.linspace(-0.5 * length, 0.5 * length, n)
    return tool_path(points, [0.0, 0.0, 1.0], feed=feed)


def problem_of(
    model: fem.ArmModel,
    cell: Cell,
    path: ToolPath,
    aim: Any = "mean",
    gamma: float | GammaRange = 0.3,
    force: tuple[float, float, float] = (0.0, 100.0, 0.0),
    ranges: dict[str, tuple[float, float]] | None = None,
    table: float | tuple[float, float] = 0.0,
    **more: Any,
) -> Problem:
    goal = Goal(aim, ConstantForce(np.array(force), "base"), more.pop("criterion", None), more.pop("by_length", False))
    drive = more.pop("drive", Drive())
    return Problem(model, space_of(cell, ranges, table=table), path, goal, gamma, drive, **more)
