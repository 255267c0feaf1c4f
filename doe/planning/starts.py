"""The tables that come with a new model: poses to read at the pendant, and a first sheet of deflections."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from doe import write_measurements
from doe.planning.protocol import Protocol, table_to_fill
from robots import ModelDescription, Robot, forward_kinematics, tool_position
from robots.arm_class import reach_of, usual_load
from robots.arrays import Array
from robots.files.csv_text import write_rows

PENDANT_POSES, SHEET_POSES = 10, 8
# Of the middle of each joint's range: poses far from its ends are easy to drive to. Wide turns are cut to +-120 deg.
SHARE, WIDEST_rad = 0.7, float(np.radians(120.0))
# Loads of a first sheet, shares of the payload; height of elbow and tool above the floor, share of the reach.
LOAD_SHARES, HEIGHT = (0.3, 0.6, 1.0), 0.1
DRAWN = 4000


def start_poses(robot: Robot, n: int) -> Array:
    """Poses (n, dof) rad in whole degrees that lie apart, with elbow and tool above the floor where there are such."""
    low, high = robot.limits.T
    middle = np.clip(0.5 * (low + high), -WIDEST_rad, WIDEST_rad)
    half = np.minimum(0.5 * SHARE * (high - low), WIDEST_rad)
    drawn = middle + half * np.random.default_rng(0).uniform(-1.0, 1.0, (DRAWN, robot.dof))
    q = np.radians(np.round(np.degrees(np.clip(drawn, low, high))))
    q = q[robot.reachable(q)]
    frames = forward_kinematics(robot, q)
    heights = np.column_stack([frames.p[:, 3:, 2], tool_position(robot, frames)[:, 2]])
    clear = q[(heights > HEIGHT * reach_of(robot)).all(axis=1)]
    return _apart(clear if len(clear) >= n else q, n, half)


def _apart(q: Array, n: int, half: Array) -> Array:
    """Of poses (m, dof) the n that lie farthest from one another, one after another."""
    unit = q / np.maximum(half, 1e-6)
    chosen = [int(np.argmin((unit**2).sum(axis=1)))] if len(q) else []
    nearest = np.full(len(q), np.inf)
    while len(chosen) < min(n, len(q)):
        nearest = np.minimum(nearest, ((unit - unit[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(np.argmax(nearest)))
    return q[chosen]


def pendant_table(robot: Robot) -> str:
    """Poses to drive to, as the controller counts the angles; what it shows there is to be filled in."""
    q, names = start_poses(robot, PENDANT_POSES), robot.coordinates
    if robot.controller is not None:
        names, q = robot.controller.names, robot.controller.controller(q)
    stream = io.StringIO()
    rows = [[f"P{i}", *(f"{v + 0.0:g}" for v in np.degrees(p).round(6)), "", "", ""] for i, p in enumerate(q, start=1)]
    write_rows(stream, [["pose", *names, "x_mm", "y_mm", "z_mm"], *rows])
    return stream.getvalue()


def first_loads(robot: Robot, description: ModelDescription) -> Array:
    """Sizes (k,) of the weights of a first sheet, N: round shares of the payload."""
    full = usual_load(robot, description)
    digit = 10.0 ** np.floor(np.log10(full)) / 20.0
    return np.unique(np.maximum(np.round(full * np.array(LOAD_SHARES) / digit) * digit, digit))


def write_sheet(path: Path, robot: Robot, description: ModelDescription) -> None:
    """A first sheet to fill in: poses under weights at the tool, read along z."""
    q, direction = start_poses(robot, SHEET_POSES), np.array([[0.0, 0.0, -1.0]])
    protocol = Protocol(forces=first_loads(robot, description), directions=direction, repeats=2)
    labels = tuple(f"S{i + 1}" for i in range(len(q)))
    table = table_to_fill(path.name, q, np.repeat(direction, len(q), axis=0), labels, protocol)
    write_measurements(table, path, robot, to_fill=protocol.columns)
