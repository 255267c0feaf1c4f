"""Which torque or force each compliant coordinate feels, and how the tool point moves with it.

A coordinate is a row of six numbers ``t``: the torque it feels is t . w for a wrench w (force, moment) at the
tool point, and by virtual work the tool point moves by t * theta when it gives way by theta.
"""

from __future__ import annotations

import numpy as np

from rehearsal.arm import Arm, Bar
from rehearsal.kinematics import Frames, z_to
from robots.arrays import Array


def rotation_row(axis: Array, point: Array, tool: Array) -> Array:
    """Rows (n, 6) of a rotation about ``axis`` through ``point``: moment of the wrench about that line."""
    return np.concatenate([np.cross(axis, tool - point), axis], axis=-1)


def joint_rows(arm: Arm, at: Frames) -> Array:
    """Rows (n, dof, 6), one a joint.

    With the parallelogram the upper arm turns while the bar keeps the forearm's direction: joint 2 moves the
    elbow only, so its row is the shoulder's rotation less the elbow's. Actuator 3 turns the forearm.
    """
    signs = arm.signs[:, None]
    rows = rotation_row(at.axes, at.origins[:, 1:], at.tool[:, None])
    bar = arm.bar_at_work
    if bar is not None:
        rows = rows.copy()
        rows[:, bar.crank_about] -= rows[:, bar.driven]
    return np.asarray(rows * signs)


def elbow_and_shoulder(bar: Bar, at: Frames) -> tuple[Array, Array]:
    """Where the bar's two joints are (n, 3)."""
    return at.origins[:, bar.driven + 1], at.origins[:, bar.crank_about + 1]


def bar_row(arm: Arm, at: Frames) -> Array:
    """Row (n, 6) of the bar's axial force (tension positive), from the forearm's balance about the elbow's axis."""
    if arm.bar is None:
        raise ValueError(f"{arm.name} has no parallelogram")
    elbow, shoulder = elbow_and_shoulder(arm.bar, at)
    along = elbow - shoulder
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    axis = at.axes[:, arm.bar.driven]
    lever = at.rotations[:, arm.bar.driven + 1] @ arm.bar.pin
    # A bar in tension pulls the pin towards the crank: -along.
    arm_of_bar = np.einsum("ni,ni->n", np.cross(lever, -along), axis)
    return np.asarray(-rotation_row(axis, elbow, at.tool) / arm_of_bar[:, None])


def skew(v: Array) -> Array:
    """Matrices (..., 3, 3) with skew(v) @ x = v x x."""
    zero = np.zeros_like(v[..., 0])
    rows = [[zero, -v[..., 2], v[..., 1]], [v[..., 2], zero, -v[..., 0]], [-v[..., 1], v[..., 0], zero]]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def transfer(here: Array, there: Array) -> Array:
    """(n, 6, 6): the wrench seen at ``here`` (n, 3) of a wrench given at ``there``."""
    T = np.tile(np.eye(6), (len(here), 1, 1))
    T[:, 3:, :3] = skew(there - here)
    return T


def pull_of_bar(arm: Arm, bar: Bar, at: Frames) -> tuple[Array, Array]:
    """The bar's pull on the forearm (n, 6, 6) per wrench at the tool, and the pin (n, 3) where it acts."""
    elbow, shoulder = elbow_and_shoulder(bar, at)
    along = elbow - shoulder
    along = along / np.linalg.norm(along, axis=1)[:, None]
    N = bar_row(arm, at)
    pull = np.zeros((len(along), 6, 6))
    pull[:, :3] = -along[:, :, None] * N[:, None, :]
    return pull, elbow + at.rotations[:, bar.driven + 1] @ bar.pin


def bearing_rows(arm: Arm, at: Frames, joint: int) -> Array:
    """Rows (n, 6, 6) of what a joint's bearing carries in its frame: z along the axis, turning with the joint."""
    here = at.origins[:, joint + 1]
    load = transfer(here, at.tool)
    bar = arm.bar_at_work
    if bar is not None and joint in (bar.crank_about, bar.driven):
        # From the bar's pin on the forearm down to the shoulder; what the crank takes goes to the body before.
        pull, pin = pull_of_bar(arm, bar, at)
        load = load + transfer(here, pin) @ pull
    axes = np.swapaxes(at.rotations[:, joint + 1] @ z_to(arm.axes[joint]), 1, 2)
    return np.concatenate([axes @ load[:, :3], axes @ load[:, 3:]], axis=1)


def tilt_rows(at: Frames, joint: int) -> Array:
    """Rows (n, 2, 6) of the two rotations across a joint (from 0), about axes fixed in its housing."""
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
    R = at.hand
    return np.concatenate([np.swapaxes(R, 1, 2), np.zeros_like(R)], axis=2)


def hand_rows(at: Frames) -> Array:
    """Rows (n, 6, 6) of what the tool carries at the model's tool point, in the flange's axes."""
    load, axes = transfer(at.point, at.tool), np.swapaxes(at.hand, 1, 2)
    return np.concatenate([axes @ load[:, :3], axes @ load[:, 3:]], axis=1)
