"""What the tests of cutting share: a level path of a KR60 with a spindle, its wall to the right of the feed."""

from __future__ import annotations

import numpy as np
from posture_cases import part, spindle

import fem
from machining.cutting import EndMill, MillingForce, down_milling, published
from machining.posture.points import postures_at
from machining.stiffness.objective import Objective
from machining.task import Task, tool_path
from robots.arrays import Array

MILL = EndMill(0.010, 4, np.radians(30.0))
CHIP = 2.5e-5
# Two angles gamma at which the whole path can be reached, the first far softer across the wall than the second.
SOFT, STIFF = np.radians(120.0), np.radians(-90.0)


def wall_task(n: int = 7, feed: float | None = 0.02) -> Task:
    """Feed along +x, tool upright; down milling leaves the wall on the right, its normal along +y."""
    points = np.zeros((n, 3))
    points[:, 0] = np.linspace(-0.3, 0.3, n)
    return Task(tool_path(points, [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], feed), spindle(), part())


def wall_force(axial: float = 0.005, radial: float = 0.001, **options: object) -> MillingForce:
    settings = {"feed_per_tooth": CHIP, **options}
    return MillingForce(MILL, down_milling(MILL, axial, radial), published("al7075-t6"), **settings)  # type: ignore[arg-type]


def postures(model: fem.ArmModel, task: Task, gamma: float) -> Array:
    return postures_at(model, task, Objective("k_fs"), gamma).q
