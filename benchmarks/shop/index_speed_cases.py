"""What the speed of k_fs is measured on: an arm, a path, and pinocchio as the peer."""

from __future__ import annotations

from typing import Any

import numpy as np

import fem
from machining.task import Task, tool_path
from robots import Robot, load_description
from robots.arrays import Array


def rigid_arm() -> fem.ArmModel:
    return fem.build_model(load_description("kr60-3"), links="rigid")


def curved_task(n: int) -> Task:
    """A path of 0.7 m whose normals tilt along it, in front of the arm; a spindle across the flange."""
    u = np.linspace(0.0, 1.0, n)
    wave = 2.0 * np.pi * u
    points = np.stack([0.7 * (u - 0.5), 0.15 * np.sin(wave), 0.08 * np.cos(wave)], axis=1)
    normals = np.stack([0.35 * np.sin(wave), 0.25 * np.cos(0.5 * wave), np.ones(n)], axis=1)
    place, tool = np.eye(4), np.eye(4)
    place[:3, 3] = 1.2, 0.2, 0.6
    tool[:3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    tool[:3, 3] = 0.2, 0.0, 0.08
    return Task(tool_path(points, normals), tool, place)


class Pinocchio:
    """The same arm in pinocchio; ``theta`` (n, 6) rad are its angles."""

    def __init__(self, pin: Any, robot: Robot, tip: Array) -> None:
        self.pin, self.model = pin, pin.Model()
        before = np.eye(4)
        for i in range(robot.dof):
            self.model.addJoint(i, pin.JointModelRZ(), pin.SE3(before @ robot.T_pre[i]), f"j{i + 1}")
            before[:3, :3] = robot.R_post[i]
        T = before @ robot.T_last_flange
        T[:3, 3] += T[:3, :3] @ tip
        self.tip = self.model.addFrame(pin.Frame("tip", robot.dof, 0, pin.SE3(T), pin.FrameType.OP_FRAME))
        self.data = self.model.createData()
        self.sign, self.offset = robot.sign, robot.offset

    def theta(self, q: Array) -> Array:
        """Angles of joint coordinates q."""
        return np.asarray(self.sign * q + self.offset)

    def one_by_one(self, theta: Array, normal: Array, compliance: Array) -> Array:
        """Jacobian, C_tt = J K^-1 J^T and k_fs of each pose in turn."""
        pin, model, data, tip, C = self.pin, self.model, self.data, self.tip, np.diag(compliance)
        axes, out = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, np.empty(len(theta))
        for i in range(len(theta)):
            J = pin.computeFrameJacobian(model, data, theta[i], tip, axes)[:3]
            out[i] = 1.0 / np.linalg.norm(J @ C @ J.T @ normal[i])
        return out

    def jacobians_first(self, theta: Array, normal: Array, compliance: Array) -> Array:
        """Jacobians in a loop, the rest for all poses at once and without forming C_tt."""
        pin, model, data, tip = self.pin, self.model, self.data, self.tip
        axes, J = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, np.empty((len(theta), 3, 6))
        for i in range(len(theta)):
            J[i] = pin.computeFrameJacobian(model, data, theta[i], tip, axes)[:3]
        torque = (normal[:, None, :] @ J)[:, 0] * compliance
        return np.asarray(1.0 / np.linalg.norm((J @ torque[:, :, None])[:, :, 0], axis=1))

    def newton(self, theta: Array) -> tuple[Array, float]:
        """Angles found again from some 0.2 rad off each, by Newton's method, NaN where not; mean iterations."""
        pin, model, data, tip = self.pin, self.model, self.data, self.tip
        out, steps = np.full_like(theta, np.nan), 0
        for i in range(len(theta)):
            pin.framesForwardKinematics(model, data, theta[i])
            goal, q = data.oMf[tip].copy(), theta[i] + 0.2 * np.cos(np.arange(6) + i)
            for _ in range(30):
                pin.framesForwardKinematics(model, data, q)
                error = pin.log6(data.oMf[tip].actInv(goal)).vector
                steps += 1
                if np.abs(error).max() < 1e-9:
                    out[i] = q
                    break
                J = pin.computeFrameJacobian(model, data, q, tip, pin.ReferenceFrame.LOCAL)
                q = q + np.linalg.solve(J, error)
        return out, steps / len(theta)
