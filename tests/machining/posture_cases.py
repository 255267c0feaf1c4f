"""What the tests of posture share: a spindle across the flange of the KR60, and short paths within its reach."""

from __future__ import annotations

import numpy as np
from rigid_frames import rigid_frame

from machining.task import Task, ToolPath, tool_path
from robots.arrays import Array

# Where gamma counts from on the curved paths: angles about 0 are within reach.
ALONG_Y = np.array([0.0, 1.0, 0.0])
# Joint speeds of the KR60, rad/s.
SPEED = np.radians([128.0, 102.0, 128.0, 260.0, 245.0, 322.0])


def spindle() -> Array:
    """Tool frame: axis across the flange's, tip 200 mm to the side and 80 mm ahead."""
    return rigid_frame((0.2, 0.0, 0.08), [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


def part(x: float = 1.2, y: float = 0.2, z: float = 0.6) -> Array:
    return rigid_frame((x, y, z))


def dome(n: int, length: float = 0.7, feed: float | None = None) -> ToolPath:
    """A curved path with normals that tilt along it."""
    u = np.linspace(0.0, 1.0, n)
    wave = 2.0 * np.pi * u
    points = np.stack([length * (u - 0.5), 0.15 * np.sin(wave), 0.08 * np.cos(wave)], axis=1)
    normals = np.stack([0.35 * np.sin(wave), 0.25 * np.cos(0.5 * wave), np.ones(n)], axis=1)
    return tool_path(points, normals, feed=feed)


def dome_task(n: int, length: float = 0.7, feed: float | None = None) -> Task:
    return Task(dome(n, length, feed), spindle(), part(), ALONG_Y)
