"""A sheet for the static compliance test of ISO 9283:1998: loads along the base's axes in steps of the rated load.

The template has what makes the test comparable (both directions of each axis, 10 % steps to the rated load, three
repeats, displacements along all axes); the standard itself says under which conditions it is done.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from doe.planning.pose_designs import pose_design
from doe.planning.protocol import Protocol
from doe.planning.zones import Zone
from robots import Robot, forward_kinematics, tool_position
from robots.arrays import Array
from robots.quantities import rounded
from stiffarm.commands.plan.options import resting_pose
from stiffarm.commands.plan.sheets import Sheet
from surrogate import default_sweep

STEPS, REPEATS, COMPONENTS = 10, 3, (0, 1, 2)
DIRECTIONS = (
    ("+x", (1.0, 0.0, 0.0)),
    ("-x", (-1.0, 0.0, 0.0)),
    ("+y", (0.0, 1.0, 0.0)),
    ("-y", (0.0, -1.0, 0.0)),
    ("+z", (0.0, 0.0, 1.0)),
    ("-z", (0.0, 0.0, -1.0)),
)

# Poses the middle of the workspace is found from, and the cells (m) their tool points are counted in.
_POSES, _CELL = 2000, 0.05
_NEAREST = 20

RULES = (
    "This is a template after the static compliance test of ISO 9283:1998; the standard itself says under which "
    "conditions (mounting, warm-up, control, place of the load) the test is valid.",
    "Load along one axis of the base at a time, at the mechanical interface; x forward at q1 = 0, z up.",
    "Zero the gauges on the unloaded arm before each repeat; the load then rises in steps of 10 % of the rated load.",
    "The small number in a box is the row (column step) of measurement_sheet.csv. Displacements in mm, base axes.",
    "Static compliance is displacement per load, mm/N. A mass that hangs on the arm from the start is no load here.",
)


def protocol(rated_N: float) -> Protocol:
    """What the test does in each pose: six directions each, loads in steps of 10 % of the rated one."""
    forces = [float(f"{rated_N * k / STEPS:.4g}") for k in range(1, STEPS + 1)]
    return Protocol(np.array(forces), np.array([way for _, way in DIRECTIONS]), COMPONENTS, REPEATS)


def sheet(robot: Robot, title: str, poses: Array, rated_N: float, *, usual: bool) -> Sheet:
    """The sheet for poses (n, dof) rad; ``usual``: they are the default, not asked for."""
    middle = "tool in the middle of what it reaches ahead of the base in the plane of q1 = 0"
    facts = (
        ("robot", title),
        ("test", "static compliance, after ISO 9283:1998"),
        ("rated load", f"{rated_N:.5g} N, in {STEPS} steps, {REPEATS} times along each direction"),
        ("pose", middle if usual else "as given"),
    )
    done = protocol(rated_N)
    labels = tuple(f"P{i + 1}{name}" for i in range(len(poses)) for name, _ in DIRECTIONS)
    return Sheet(
        robot,
        f"Static compliance of {robot.name}",
        np.repeat(poses, len(DIRECTIONS), axis=0),
        np.tile(done.directions, (len(poses), 1)),
        labels,
        ("",) * len(labels),
        done,
        facts,
        RULES,
    )


def payload(robot: Robot, poses: Array, rated_N: float) -> dict[str, Any]:
    """plan.json of an ISO 9283 sheet."""
    return {
        "schema": "stiffarm-plan/1",
        "kind": "iso9283",
        "robot": robot.name,
        "rated_load_N": rounded(rated_N),
        "loads_N": [rounded(f) for f in protocol(rated_N).forces.tolist()],
        "directions": [name for name, _ in DIRECTIONS],
        "repeats": REPEATS,
        "poses": [
            {name: rounded(float(v)) for name, v in zip(robot.coordinates, np.degrees(q), strict=True)} for q in poses
        ],
    }


def middle_pose(robot: Robot, zone: Zone) -> Array:
    """A pose (dof,) rad with the tool in the middle of what it reaches in the plane of q1 = 0, in whole degrees.

    The middle is the centre of the cells ahead of the base that the tool point meets; of the poses nearest to it
    the one whose joints are farthest from their limits.

    Raises
    ------
    InputError
        No pose can be taken.
    """
    coordinates, _ = default_sweep(robot)
    poses = pose_design(
        robot, _POSES, coordinates=coordinates, fixed=resting_pose(robot, {}), zone=zone, rng=np.random.default_rng(0)
    )
    whole = np.radians(np.round(np.degrees(poses)))
    fits = robot.reachable(whole)
    fits[fits] = zone.free(robot, whole[fits])
    poses = whole[fits] if fits.any() else poses
    tool = tool_position(robot, forward_kinematics(robot, poses))[:, [0, 2]]
    # An arm that reaches over its own base has its middle there; nobody works there.
    ahead = tool[:, 0] > 0.0
    poses, tool = (poses[ahead], tool[ahead]) if ahead.any() else (poses, tool)
    middle = np.unique(np.round(tool / _CELL), axis=0).mean(axis=0) * _CELL
    near = np.argsort(np.linalg.norm(tool - middle, axis=1), kind="stable")[:_NEAREST]
    columns = [robot.coordinate_index(name) for name in coordinates]
    low, high = robot.limits[columns].T
    off = np.abs((poses[near][:, columns] - 0.5 * (low + high)) / (high - low)).max(axis=1)
    return np.asarray(poses[near[int(np.argmin(off))]])
