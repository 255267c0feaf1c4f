"""Arms and targets for the tests of the inverse kinematics."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from rigid_frames import rigid_frame
from scipy.spatial.transform import Rotation

from robots import InverseSolutions, Robot, forward_kinematics, load_robot
from robots.arrays import Array

DATA = Path(__file__).parents[1] / "data"

# The promise of the issue. Measured: 2e-15 of some metres; next to the edge of reach 1e-10 is let through.
MAPS_BACK = 1e-9


def chain(alpha: Array, a: Array, d: Array, *, tool: Array | None = None) -> Robot:
    """Six joints by modified-DH figures (rad, m), with limits of +-180 deg and no couplings."""
    T = np.tile(np.eye(4), (6, 1, 1))
    for i in range(6):
        T[i, :3, :3] = Rotation.from_rotvec([alpha[i], 0.0, 0.0]).as_matrix()
        T[i, :3, 3] = a[i], -d[i] * np.sin(alpha[i]), d[i] * np.cos(alpha[i])
    return dataclasses.replace(
        load_robot("kr60-3"),
        name="made-up",
        T_pre=T,
        limits=np.tile([-np.pi, np.pi], (6, 1)),
        T_flange_tool=np.eye(4) if tool is None else tool,
    )


def transform(rng: np.random.Generator) -> Array:
    return rigid_frame(rng.normal(size=3), Rotation.random(random_state=rng).as_matrix())


def random_arm(rng: np.random.Generator, *, parallel: bool, right_angles: bool) -> Robot:
    """A spherical wrist on three axes; frames, signs, offsets, base, flange and tool are all at random."""
    alpha = np.pi / 2 * rng.choice([-1, 1], 6) if right_angles else rng.uniform(0.4, 2.7, 6) * rng.choice([-1, 1], 6)
    if parallel:
        alpha[2] = rng.choice([0.0, np.pi])
    a, d = np.r_[0.0, rng.normal(size=3), 0.0, 0.0], np.r_[rng.normal(size=4), 0.0, 0.0]
    robot = chain(alpha, a, d, tool=transform(rng))
    # Other frames for the same axes: the base anywhere, each joint frame turned about its axis, each body's at will.
    T_pre, R_post = robot.T_pre.copy(), Rotation.random(6, random_state=rng).as_matrix()
    about_axis = Rotation.from_rotvec(rng.uniform(-3.0, 3.0, (6, 1)) * [0.0, 0.0, 1.0]).as_matrix()
    T_pre[1:, :3] = np.swapaxes(R_post[:-1], 1, 2) @ T_pre[1:, :3]
    T_pre[0] = transform(rng) @ T_pre[0]
    T_pre[:, :3, :3] = T_pre[:, :3, :3] @ about_axis
    return dataclasses.replace(
        robot,
        T_pre=T_pre,
        R_post=R_post,
        sign=rng.choice([-1.0, 1.0], 6),
        offset=rng.uniform(-3.0, 3.0, 6),
        T_last_flange=transform(rng),
    )


def tool_frames(robot: Robot, q: Array) -> Array:
    """T_base_tool (n, 4, 4)."""
    frames = forward_kinematics(robot, q)
    T = np.tile(np.eye(4), (len(q), 1, 1))
    T[:, :3, :3], T[:, :3, 3] = frames.R_flange, frames.p_flange
    return T @ robot.T_flange_tool


def within_limits(robot: Robot, rng: np.random.Generator, n: int) -> Array:
    return rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (n, robot.dof))


def worst_error(solutions: InverseSolutions, targets: Array) -> float:
    """Largest error of any entry of any reached frame."""
    i, j = np.nonzero(solutions.reached)
    return float(np.abs(tool_frames(solutions.robot, solutions.q[i, j]) - targets[i]).max())


def apart(a: Array, b: Array) -> Array:
    """Largest difference of joint angles, whole turns aside, (...)."""
    return np.abs((a - b + np.pi) % (2.0 * np.pi) - np.pi).max(axis=-1)
