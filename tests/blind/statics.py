"""Which torque or force each compliant coordinate feels, and how the tool point moves with it.

A coordinate is a row of six numbers ``t``: the torque it feels is t . w for a wrench w (force, moment) at the
tool point, and by virtual work the tool point moves by t * theta when it gives way by theta.
"""

from __future__ import annotations

import numpy as np

from .arm import Arm, Array
from .kinematics import Frames


def rotation_row(axis: Array, point: Array, tool: Array) -> Array:
    """Rows (n, 6) of a rotation about ``axis`` through ``point``: moment of the wrench about that line."""
    return np.concatenate([np.cross(axis, tool - point), axis], axis=-1)


def joint_rows(arm: Arm, at: Frames) -> Array:
    """Rows (n, 6, 6), one a joint.

    With the parallelogram the upper arm turns while the bar keeps the forearm's direction: joint 2 moves the
    elbow only, so its row is the shoulder's rotation less the elbow's. Actuator 3 turns the forearm.
    """
    signs = arm.signs[:, None]
    rows = rotation_row(at.axes, at.origins[:, 1:], at.tool[:, None])
    if arm.parallelogram:
        rows = rows.copy()
        rows[:, 1] -= rows[:, 2]
    return rows * signs


def bar_row(arm: Arm, at: Frames) -> Array:
    """Row (n, 6) of the bar's axial force (tension positive), from the forearm's balance about the elbow's axis."""
    if arm.bar is None:
        raise ValueError(f"{arm.name} has no parallelogram")
    elbow, shoulder = at.origins[:, 3], at.origins[:, 2]
    along = elbow - shoulder
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    lever = at.rotations[:, 3] @ arm.bar.pin
    # A bar in tension pulls the pin towards the crank: -along.
    arm_of_bar = np.einsum("ni,ni->n", np.cross(lever, -along), at.axes[:, 2])
    return -rotation_row(at.axes[:, 2], elbow, at.tool) / arm_of_bar[:, None]


def tilt_rows(at: Frames, joint: int) -> Array:
    """Rows (n, 2, 6) of the two rotations across joint ``joint`` (0 to 5), about axes fixed in its housing."""
    axis = at.axes[:, joint]
    side = at.housings[:, joint] @ (
        np.array([1.0, 0, 0]) if abs(axis[0] @ at.housings[0, joint] @ [1.0, 0, 0]) < 0.9 else np.array([0, 0, 1.0])
    )
    side = side - np.einsum("ni,ni->n", side, axis)[:, None] * axis
    side = side / np.linalg.norm(side, axis=1, keepdims=True)
    across = np.stack([side, np.cross(axis, side)], 1)
    return rotation_row(across, at.origins[:, joint + 1][:, None], at.tool[:, None])


def base_rows(at: Frames) -> Array:
    """Rows (n, 3, 6): tilt of the base about x and y at the floor, and its sinking along z."""
    n = len(at.tool)
    x = rotation_row(np.tile([1.0, 0, 0], (n, 1)), np.zeros((n, 3)), at.tool)
    y = rotation_row(np.tile([0, 1.0, 0], (n, 1)), np.zeros((n, 3)), at.tool)
    z = np.tile([0, 0, 1.0, 0, 0, 0], (n, 1))
    return np.stack([x, y, z], 1)


def tool_rows(at: Frames) -> Array:
    """Rows (n, 3, 6): the tool point's shifts along the flange's x, y and z."""
    R = at.rotations[:, 6]
    return np.concatenate([np.swapaxes(R, 1, 2), np.zeros_like(R)], axis=2)
