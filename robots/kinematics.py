"""Forward kinematics and Jacobian, batched over poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.arrays import Array
from robots.errors import InputError
from robots.frames import framed
from robots.robot import Robot


@dataclass(frozen=True)
class BodyFrames:
    """Frames of all bodies in the base frame, for n poses.

    ``R`` (n, dof+1, 3, 3) and ``p`` (n, dof+1, 3): body 0 is the base, body i moves with joint i.
    ``R_flange`` (n, 3, 3), ``p_flange`` (n, 3). ``axis`` (n, dof, 3): the joint axes, unit vectors.
    A joint's origin is the origin of its body. The arrays are views whose poses are contiguous in memory.
    """

    R: Array
    p: Array
    axis: Array
    R_flange: Array
    p_flange: Array

    @property
    def T_flange(self) -> Array:  # noqa: N802 - a transform
        """The flange (n, 4, 4), m."""
        return framed(self.R_flange, self.p_flange)


def as_poses(robot: Robot, q: Array) -> Array:
    """Check a batch of poses and return it as float (n, dof).

    Raises
    ------
    InputError
        Wrong shape, or a value that is not finite.
    """
    poses = robot.pose_batch(q)
    if not np.isfinite(poses).all():
        row = int(np.flatnonzero(~np.isfinite(poses).all(axis=1))[0])
        raise InputError(
            f"pose {row} for {robot.name}",
            code="B001",
            value=poses[row].tolist(),
            allowed="finite joint angles (rad)",
            remedy="remove or complete that pose",
        )
    return poses


def forward_kinematics(robot: Robot, q: Array) -> BodyFrames:
    """Frames of every body and of the flange; q (n, dof) rad. Limits are not checked here."""
    q = as_poses(robot, q)
    n, dof = q.shape
    # Computed with the poses along the last axis: each step is then one pass over contiguous memory.
    theta = np.ascontiguousarray((robot.sign * q + robot.offset).T)
    cos, sin = np.cos(theta), np.sin(theta)
    R = np.empty((dof + 1, 3, 3, n))
    p = np.empty((dof + 1, 3, n))
    axis = np.empty((dof, 3, n))
    R[0], p[0] = np.eye(3)[:, :, None], 0.0
    for i in range(dof):
        pre = robot.T_pre[i]
        p[i + 1] = p[i] + pre[:3, 3] @ R[i]
        frame = _times(R[i], pre[:3, :3])
        x, y = frame[:, 0], frame[:, 1]
        turned = np.empty_like(frame)
        turned[:, 0] = cos[i] * x + sin[i] * y
        turned[:, 1] = cos[i] * y - sin[i] * x
        turned[:, 2] = axis[i] = frame[:, 2]
        R[i + 1] = _times(turned, robot.R_post[i])
    R_flange = _times(R[dof], robot.T_last_flange[:3, :3])
    p_flange = p[dof] + robot.T_last_flange[:3, 3] @ R[dof]
    return BodyFrames(*(np.moveaxis(a, -1, 0) for a in (R, p, axis, R_flange, p_flange)))


def moving_frames(robot: Robot, q: Array) -> tuple[Array, Array]:
    """Rotations (n, f, 3, 3) and origins (n, f, 3) m of all that drawn and solid bodies move with; q (n, dof) rad.

    Frames 0 to dof are the bodies', dof + 1 the flange's; a parallelogram adds the crank's and the bar's. Crank and
    lever stay parallel, so the crank has the driven body's orientation at its own joint; the bar stays parallel to the
    body between, and begins at the crank's pin.
    """
    frames = forward_kinematics(robot, q)
    R, p = [frames.R, frames.R_flange[:, None]], [frames.p, frames.p_flange[:, None]]
    para = robot.parallelogram
    if para is not None:
        own, driven = para.crank_about + 1, para.driven + 1
        pin = frames.p[:, own] + frames.R[:, driven] @ para.pin
        R += [frames.R[:, driven, None], frames.R[:, own, None]]
        p += [frames.p[:, own, None], pin[:, None]]
    return np.concatenate(R, axis=1), np.concatenate(p, axis=1)


def _times(R: Array, matrix: Array) -> Array:
    """``R matrix`` for rotations R (3, 3, n), poses last, and one constant matrix (3, 3)."""
    if np.array_equal(matrix, np.eye(3)):
        return R
    return np.asarray(matrix.T @ R)


def tool_position(robot: Robot, frames: BodyFrames, point: Array | None = None) -> Array:
    """Tool point, or ``point`` given in the flange frame ((3,) or (n, 3) m), in the base frame (n, 3)."""
    local = robot.T_flange_tool[:3, 3] if point is None else np.asarray(point, dtype=np.float64)
    return np.asarray(
        frames.p_flange + np.einsum("nij,...j->ni" if local.ndim == 1 else "nij,nj->ni", frames.R_flange, local)
    )


def stretched_length(robot: Robot, point: Array | None = None) -> float:
    """Length (m) of the stretched arm from axis 1 to the tool point, from joint to joint, whatever the angles allow.

    ``point`` (3,) m in the flange frame instead of the robot's tool point. No pose brings the point farther from any
    joint's axis.
    """
    last = robot.T_flange_tool[:3, 3] if point is None else point
    steps = [*robot.T_pre[1:, :3, 3], robot.T_last_flange[:3, 3], last]
    return float(sum(np.linalg.norm(step) for step in steps))


def jacobian(robot: Robot, q: Array, point: Array | None = None) -> Array:
    """Geometric Jacobian (n, 6, dof) of the tool point with respect to the joint *coordinates*.

    Rows: linear velocity (m/rad), angular velocity (rad/rad), base frame. ``point`` as in
    :func:`tool_position`. For a coordinate with ``sign = -1`` the column is minus the axis's.
    """
    frames = forward_kinematics(robot, q)
    return jacobian_at(robot, frames, tool_position(robot, frames, point))


def jacobian_at(robot: Robot, frames: BodyFrames, point: Array) -> Array:
    """:func:`jacobian` of points (n, 3) m that are given in the base frame, at frames that are known already."""
    r = point[:, None, :] - frames.p[:, 1:]
    z = frames.axis * robot.sign[None, :, None]
    return np.concatenate([np.swapaxes(np.cross(z, r), 1, 2), np.swapaxes(z, 1, 2)], axis=1)
