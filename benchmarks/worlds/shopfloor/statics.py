"""Statics of a chain by Pinocchio's spatial algebra: where parts stand, what they carry, what their yielding does.

A part (joint, base or tool) has a frame; its generalised stiffness is 6x6 in that frame (Dumas 2011; Klimchik and
Pashkevich). With ``X`` the action of the part's frame on motions, seen at the tool point in base axes, the part carries
``X^T w`` and its motion ``m`` moves the tool by ``X m``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from benchmarks.worlds.shopfloor.arms import Floats, Robot, urdf


@dataclass(frozen=True)
class Postures:
    """What a number of poses have in common.

    parts : (n, dof + 2, 6, 6) actions of joints, base and tool; linear before angular
    turns : (n, dof, 6) motion of the tool by a turn of a spring by 1 rad
    weight : (n, dof) torque of the links' weight in the springs, N m
    centres : (n, dof, 3) joint origins in base axes, m
    tool, flange_axes : (n, 3) m and (n, 3, 3)
    """

    parts: Floats
    turns: Floats
    weight: Floats
    centres: Floats
    tool: Floats
    flange_axes: Floats


def _springs(arm: Robot, turns: Floats, weight: Floats, loop: bool) -> tuple[Floats, Floats]:
    """With a parallelogram the third drive holds the forearm's direction, so the second moves the elbow alone."""
    if not loop:
        return turns, weight
    way = float(np.dot(arm.axes[1].axis, arm.axes[2].axis))
    turns, weight = turns.copy(), weight.copy()
    turns[:, 1] -= way * turns[:, 2]
    weight[:, 1] -= way * weight[:, 2]
    return turns, weight


def postures(arm: Robot, q: Floats, shift: Floats | None = None, loop: bool | None = None) -> Postures:
    """The arm at joint angles ``q`` (rad, (n, dof)); ``shift`` moves the tool point, in flange axes (m)."""
    model = pin.buildModelFromXML(urdf(arm))
    data = model.createData()
    seat = pin.SE3(np.eye(3), np.array(arm.flange) + (0.0 if shift is None else shift))
    n, dof = q.shape
    parts, centres = np.zeros((n, dof + 2, 6, 6)), np.zeros((n, dof, 3))
    weight, tool, axes = np.zeros((n, dof)), np.zeros((n, 3)), np.zeros((n, 3, 3))
    for i, angles in enumerate(q):
        pin.forwardKinematics(model, data, angles)
        weight[i] = -pin.computeGeneralizedGravity(model, data, angles)
        pin.forwardKinematics(model, data, angles)
        end = data.oMi[dof] * seat
        seen = pin.SE3(np.eye(3), end.translation).inverse()
        frames = [*(data.oMi[k + 1] for k in range(dof)), pin.SE3.Identity(), end]
        for k, frame in enumerate(frames):
            parts[i, k] = (seen * frame).toActionMatrix()
        centres[i] = [frame.translation for frame in frames[:dof]]
        tool[i], axes[i] = end.translation, end.rotation
    about = np.array([a.axis for a in arm.axes])
    turns = np.einsum("nkij,kj->nki", parts[:, :dof, :, 3:], about)
    turns, weight = _springs(arm, turns, weight, arm.parallelogram if loop is None else loop)
    return Postures(parts, turns, weight, centres, tool, axes)


def lateral(arm: Robot, joint: int) -> Floats:
    """Two unit axes across a joint's own, in its frame, (2, 3)."""
    axis = np.array(arm.axes[joint].axis)
    first = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first)])


def springs_only(at: Postures, pose: np.ndarray, wrench: Floats, compliance: Floats) -> Floats:
    """Displacement of the tool, (n, 6) m and rad, of readings at ``pose`` under ``wrench``, by linear springs alone."""
    turns = at.turns[pose]
    torque = np.einsum("nki,ni->nk", turns, wrench)
    return np.asarray(np.einsum("nki,nk,k->ni", turns, torque, compliance))
