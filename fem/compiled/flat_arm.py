"""An arm as plain arrays for compiled loops: one frame a joint, constant compliances about its origin.

Frame F_j has its origin and its z axis on joint j and moves with it. Its x axis is turned so that the way from one
frame to the next is a shift and two plane rotations, ``T(F_j-1, F_j) = shift(t_j) Rot_x(alpha_j) Rot_z(angle_j)``,
``angle_j = theta_j + constant`` (the constant rotation between two joints is split into Euler angles z, x, z). All
that is fixed in a body (links, the joint's bearing, the next joint's housing, the tool) adds up to one constant matrix.

The parallelogram adds ``column N`` to what a part carries, N = row . w being the bar's force. The bar's direction u is
constant in the upper arm, its pin in the forearm, so the columns need one rotation only (:mod:`fem.statics.transfers`).
All parts of the upper arm carry it, with the driven joint's housing and the bearing of the crank's joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.model import ArmModel, LinkPart
from fem.springs import ConstantSpring, SpringLaw
from fem.statics.transfers import FLAT_SINE
from robots.arrays import Array
from robots.frames import rotation_rpy

# Sines and cosines of fixed angles this near to 0 or 1 are meant to be; they come from degrees and products of cosines.
SNAP = 4.0 * np.finfo(np.float64).eps


@dataclass(frozen=True)
class FlatPart:
    """A part's compliance in a frame: ``frame`` j is F_j, -1 the base; about the frame's origin, in its axes.

    In the forearm the bar's force N u adds to what a part carries, and the part stores the strain energy
    ``0.5 (s . K s + 2 N s . at_pin u + N^2 u . pin u)`` under a wrench s; ``at_pin`` (6, 3), ``pin`` (3, 3).
    """

    frame: int
    K: Array
    at_pin: Array | None = None
    pin: Array | None = None


@dataclass(frozen=True)
class FlatLaw:
    """One compliance that varies with the pose: force along (``turns`` False) or moment about ``axis`` in F_j."""

    frame: int
    axis: Array
    turns: bool
    law: SpringLaw


@dataclass(frozen=True)
class FlatLoop:
    """The parallelogram: ``driven`` j, u (3,) in F_crank, the pin (3,) in F_driven from its origin; ``bar`` m/N.

    ``least``: smallest lever at which it is not yet flat, m. ``housing`` (6, 6): of the crank's joint, about it, in the
    axes of the frame F before it.
    """

    driven: int
    u: Array
    pin: Array
    least: float
    bar: float
    housing: Array


@dataclass(frozen=True)
class FlatArm:
    """An arm in the frames of this module.

    ``turn`` (dof, 2): cos and sin of alpha_j; ``shift`` (dof, 3) m; ``sign``, ``offset`` (dof,):
    angle_j = sign q + offset; ``turn_base`` (2,): F_-1 turned about z to the base; ``R_tool`` (3, 3), ``t_tool`` (3,):
    points of the flange frame in F of the last joint. Of parts with ``frame`` -1, K is about the base, in its axes.
    """

    turn: Array
    shift: Array
    sign: Array
    offset: Array
    turn_base: Array
    R_tool: Array
    t_tool: Array
    parts: tuple[FlatPart, ...]
    laws: tuple[FlatLaw, ...]
    axial: tuple[SpringLaw, ...]
    loop: FlatLoop | None

    def axial_compliance(self, q: Array) -> Array:
        """Compliances (1, dof), or (n, dof) if one varies, about the joints' axes, rad/(N m)."""
        if all(isinstance(spring, ConstantSpring) for spring in self.axial):
            q = q[:1]
        return np.stack([spring.compliance(q) for spring in self.axial], axis=1)

    def law_compliance(self, q: Array) -> Array:
        """Compliances of the laws across the axes (laws, n)."""
        if not self.laws:
            return np.zeros((0, len(q)))
        return np.stack([law.law.compliance(q) for law in self.laws])


def why_not_flat(model: ArmModel) -> str | None:
    """What in the model has no place in a flat arm; None if all of it has."""
    p = model.robot.parallelogram
    if model.bar is None or p is None:
        return None
    if model.bar.crank is not None and model.bar.crank.body != p.driven + 1:
        return "a crank that is not described in the forearm's axes"
    for link in model.links:
        if "pin" in link.element.interfaces and link.body != p.driven + 1:
            return f"link {link.name}: a pin on a body that the parallelogram does not drive"
    return None


def flat_arm(model: ArmModel) -> FlatArm:
    """Turn a model into arrays; :func:`why_not_flat` must have nothing against it."""
    robot = model.robot
    dof = robot.dof
    phi, alpha, psi = np.zeros(dof + 1), np.zeros((dof, 2)), np.zeros(dof)
    for j in range(dof):
        before = np.eye(3) if j == 0 else robot.R_post[j - 1]
        phi[j], alpha[j], psi[j] = _euler(before @ robot.T_pre[j, :3, :3])
    # From body axes into those of its frame.
    into = [_about_z(-phi[j + 1]) @ robot.R_post[j] for j in range(dof)]
    shift = np.stack([(_about_z(-phi[0]) if j == 0 else into[j - 1]) @ robot.T_pre[j, :3, 3] for j in range(dof)])
    flange = robot.T_last_flange
    loop = _loop(model, into, shift, phi[0])
    return FlatArm(
        turn=alpha,
        shift=shift,
        sign=robot.sign.astype(np.float64),
        offset=robot.offset + psi + phi[1:],
        turn_base=np.array([np.cos(phi[0]), np.sin(phi[0])]),
        R_tool=into[-1] @ flange[:3, :3],
        t_tool=into[-1] @ flange[:3, 3],
        parts=tuple(_parts(model, into, phi, loop)),
        laws=tuple(_laws(model, phi)),
        axial=tuple(joint.axial for joint in model.joints),
        loop=loop,
    )


def _euler(G: Array) -> tuple[float, Array, float]:
    """Split a rotation into z, x, z: the first angle, cos and sin of the second, the last angle."""
    first = float(np.arctan2(G[0, 2], -G[1, 2])) if np.hypot(G[0, 2], G[1, 2]) > SNAP else 0.0
    # Better no turn about z than half of one: quarter turns about x either way are as cheap.
    if abs(first) > 0.5 * np.pi + SNAP:
        first -= np.copysign(np.pi, first)
    rest = _about_z(-first) @ G
    x = np.array([rest[2, 2], -rest[1, 2]])
    x /= np.hypot(*x)
    x[np.abs(x) < SNAP] = 0.0
    x[1 - np.abs(x) < SNAP] = np.sign(x[1 - np.abs(x) < SNAP])
    last = rotation_rpy(np.array([-np.arctan2(x[1], x[0]), 0.0, 0.0])) @ rest
    return first, x, float(np.arctan2(last[1, 0], last[0, 0]))


def _about_z(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _cross_matrix(v: Array) -> Array:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _to_origin(t: Array) -> Array:
    """X (6, 6): the wrench at t from that at the origin, same axes."""
    X = np.eye(6)
    X[3:, :3] = -_cross_matrix(t)
    return X


def _turned(R: Array, C: Array) -> Array:
    """A compliance (6, 6) in other axes, R from its own to those."""
    both = np.kron(np.eye(2), R)
    return np.asarray(both @ C @ both.T)


def _moved(R: Array, t: Array, C: Array) -> Array:
    """A compliance at t, in its own axes; R turns them to those of t, about whose origin the result is."""
    X = _to_origin(t)
    return np.asarray(X.T @ _turned(R, C) @ X)


def _parts(model: ArmModel, into: list[Array], phi: Array, loop: FlatLoop | None) -> list[FlatPart]:
    """All parts but the springs that vary."""
    robot = model.robot
    out = [FlatPart(-1, model.base)]
    out += [_link(link, into, loop) for link in model.links]
    for part in model.joints:
        j = part.joint
        K = _turned(_about_z(-phi[j + 1]), part.bearing)
        if loop is not None and j == loop.driven:
            Y = np.vstack([np.eye(3), _cross_matrix(loop.pin)])
            out.append(FlatPart(j, K, K @ Y, Y.T @ K @ Y))
        else:
            out.append(FlatPart(j, K))
        R, pre = np.eye(3) if j == 0 else into[j - 1], robot.T_pre[j]
        out.append(FlatPart(j - 1, _moved(R @ pre[:3, :3], R @ pre[:3, 3], part.housing)))
    T = robot.T_last_flange @ robot.T_flange_tool
    out.append(FlatPart(robot.dof - 1, _moved(into[-1] @ robot.T_last_flange[:3, :3], into[-1] @ T[:3, 3], model.tool)))
    if loop is not None and model.bar is not None and model.bar.crank is not None:
        C = _turned(into[loop.driven], model.bar.crank.element.flexibility)
        out.append(FlatPart(loop.driven, np.zeros((6, 6)), np.zeros((6, 3)), C[:3, :3]))
    return out


def _link(link: LinkPart, into: list[Array], loop: FlatLoop | None) -> FlatPart:
    j, F = link.body - 1, link.element.flexibility
    R = np.eye(3) if j < 0 else into[j]
    tip = R @ link.element.points[1]
    K = _moved(R, tip, F[:6, :6])
    if loop is None or "pin" not in link.element.interfaces:
        return FlatPart(j, K)
    at_pin = _to_origin(tip).T @ np.kron(np.eye(2), R) @ F[:6, 6:9] @ R.T
    return FlatPart(j, K, at_pin, R @ F[6:9, 6:9] @ R.T)


def _laws(model: ArmModel, phi: Array) -> list[FlatLaw]:
    out = []
    for part in model.joints:
        for row, law in part.laws:
            axis = _about_z(-phi[part.joint + 1])[:, row % 3]
            out.append(FlatLaw(part.joint, axis, row >= 3, law))
    return out


def _loop(model: ArmModel, into: list[Array], shift: Array, first: float) -> FlatLoop | None:
    p = model.robot.parallelogram
    if model.bar is None or p is None:
        return None
    pre = model.robot.T_pre[p.crank_about]
    R = _about_z(-first) if p.crank_about == 0 else into[p.crank_about - 1]
    return FlatLoop(
        driven=p.driven,
        u=shift[p.driven] / np.linalg.norm(shift[p.driven]),
        pin=into[p.driven] @ p.pin,
        least=FLAT_SINE * float(np.linalg.norm(p.pin)),
        bar=model.bar.compliance,
        housing=_turned(R @ pre[:3, :3], model.joints[p.crank_about].housing),
    )
