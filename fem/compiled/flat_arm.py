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
from typing import NamedTuple

import numpy as np

from fem.elements.couplings import rigid_motion
from fem.model import ArmModel
from fem.springs import ConstantSpring, SpringLaw
from fem.statics.transfers import FLAT_SINE
from robots.arrays import Array, Integers
from robots.frames import rotation_rpy

# Sines and cosines of fixed angles this near to 0 or 1 are meant to be; they come from degrees and products of cosines.
SNAP = 4.0 * np.finfo(np.float64).eps
# Poses a pass. Each figure of theirs has a row of the work array; that stays in the cache.
BLOCK = 200
# Rows of the work array: translations by forces, by moments (row by row), rotations by moments; the lever; row and half
# of the column of the parallelogram's share; the bar's column in the upper arm.
A, B, D, P, ROW, HALF, COLUMN, ROWS = 0, 6, 15, 21, 24, 30, 36, 42
# Columns of a joint's constants: cos and sin of alpha, shift, and K in the order of the rows.
TURN, SHIFT, K, CONSTANTS = 0, 2, 5, 26
# How a frame is left about x.
STRAIGHT, QUARTER, ANY = 0, 1, 2


class Loop(NamedTuple):
    """The parallelogram: ``driven`` joint, -1 without one; ``bar`` m/N; ``least`` lever at which it is not yet flat, m.

    ``u`` (3,): the bar's direction in the axes of the driven joint at angle 0; ``pin`` (3,) m in F of the driven joint.
    In the forearm the bar's force N u adds to what a part carries, and all parts there store the strain energy
    ``0.5 (s . K s + 2 N s . at_pin u + N^2 u . own u)`` under a wrench s. Matrices (36,): ``at_pin`` and ``own``, whose
    columns 3 to 5 are zero, K of the ``upper`` arm's frame, the ``housing`` of the crank's joint, about it, in the axes
    of the frame before it, in which it is ``shift`` (3,) m away; ``housed``: whether that one gives way.
    """

    driven: int = -1
    bar: float = 0.0
    least: float = 0.0
    u: Array = np.zeros(3)
    pin: Array = np.zeros(3)
    at_pin: Array = np.zeros(36)
    own: Array = np.zeros(36)
    upper: Array = np.zeros(36)
    housing: Array = np.zeros(36)
    housed: bool = False
    shift: Array = np.zeros(3)


# Not to be renamed: what numba has stored of an earlier version asks for it by name.
class Figures(NamedTuple):
    """The arm's constants in contiguous arrays.

    ``joint`` (dof, CONSTANTS): cos and sin of alpha_j, shift t_j, K about the frame's origin in its axes; ``kind``
    (dof,) of turn, ``soft`` (dof,) if K is not zero; ``base`` (CONSTANTS,): K about the base, in its axes, shift and
    turn unused, ``base_soft``; ``turn_base`` (2,): cos and sin of the angle about z by which F_-1 is turned to the
    base. ``sign``, ``offset`` (dof,): angle_j = sign q + offset. ``R_tool`` (3, 3), ``t_tool`` (3,): points of the
    flange frame in F of the last joint. Compliances that vary with the pose, force along or (``law_turns``) moment
    about ``law_axis`` (laws, 3) in the frame ``law_frame`` (laws,).
    """

    joint: Array
    kind: Integers
    soft: Integers
    base: Array
    base_soft: bool
    turn_base: Array
    sign: Array
    offset: Array
    R_tool: Array
    t_tool: Array
    law_frame: Integers
    law_axis: Array
    law_turns: Integers
    loop: Loop


class Work(NamedTuple):
    """What a thread works on; rows of BLOCK poses, and the state with its rows one after the other."""

    state: Array
    angle: Array
    flat: Array
    tool: Array
    cos: Array
    sin: Array
    springs: Array
    laws: Array


@dataclass(frozen=True)
class FlatArm:
    """An arm for compiled loops: its constants, springs about the joints' axes, and ``laws`` across them."""

    figures: Figures
    axial: tuple[SpringLaw, ...]
    laws: tuple[SpringLaw, ...]

    def axial_compliance(self, q: Array) -> Array:
        """Compliances (1, dof), or (n, dof) if one varies, about the joints' axes, rad/(N m)."""
        if all(isinstance(spring, ConstantSpring) for spring in self.axial):
            q = q[:1]
        return np.stack([spring.compliance(q) for spring in self.axial], axis=1)

    def law_compliance(self, q: Array) -> Array:
        """Compliances of the laws across the axes (laws, n)."""
        return np.array([law.compliance(q) for law in self.laws]).reshape(-1, len(q))

    def work(self) -> Work:
        """Arrays for a thread to work on."""
        dof = len(self.axial)
        rows = [np.zeros((n, BLOCK)) for n in (3, dof, dof, dof, len(self.laws))]
        return Work(np.zeros(ROWS * BLOCK), np.zeros(BLOCK), np.zeros(BLOCK), *rows)


def why_not_flat(model: ArmModel) -> str | None:
    """What in the model has no place in a flat arm; None if all of it has."""
    p = model.robot.parallelogram
    if model.secants is not None and model.secants.further:
        return f"a part of its own that varies with the pose: {model.secants.further[0].name}"
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
    # From the axes of a joint's frame, and from those of a body, into those of the frame F that moves with it.
    turned = [_about_z(-angle) for angle in phi]
    into = [turned[0], *(R @ post for R, post in zip(turned[1:], robot.R_post, strict=True))]
    shift = np.stack([R @ pre[:3, 3] for R, pre in zip(into[:-1], robot.T_pre, strict=True)])
    fixed = _fixed(model, turned, into)
    constants = np.hstack([alpha, shift, _packed(fixed[1:])])
    base = np.concatenate([np.zeros(K), _packed(fixed[:1])[0]])
    laws = [(part.joint, row, law) for part in model.joints for row, law in part.laws]
    figures = Figures(
        joint=constants,
        kind=np.where(alpha[:, 0] == 0.0, QUARTER, np.where(alpha[:, 0] == 1.0, STRAIGHT, ANY)),
        soft=np.asarray(constants[:, K:].any(axis=1), dtype=np.int64),
        base=base,
        base_soft=bool(base.any()),
        turn_base=np.array([np.cos(phi[0]), np.sin(phi[0])]),
        sign=robot.sign.astype(np.float64),
        offset=robot.offset + psi + phi[1:],
        R_tool=np.ascontiguousarray(into[-1] @ robot.T_last_flange[:3, :3]),
        t_tool=into[-1] @ robot.T_last_flange[:3, 3],
        law_frame=np.array([joint for joint, _, _ in laws], dtype=np.int64),
        law_axis=np.array([turned[joint + 1][:, row % 3] for joint, row, _ in laws]).reshape(-1, 3),
        law_turns=np.array([row >= 3 for _, row, _ in laws], dtype=np.int64),
        loop=_loop(model, turned, into, shift, alpha, fixed),
    )
    return FlatArm(figures, tuple(joint.axial for joint in model.joints), tuple(law for _, _, law in laws))


def _fixed(model: ArmModel, turned: list[Array], into: list[Array]) -> Array:
    """Constant compliance (dof + 1, 6, 6) of all parts fixed in each body, in its frame F; of the base, in its own."""
    robot = model.robot
    out = np.zeros((robot.dof + 1, 6, 6))
    out[0] = model.base
    axes = [np.eye(3), *into[1:]]
    for link in model.links:
        R = axes[link.body]
        out[link.body] += _moved(R, R @ link.element.points[1], link.element.flexibility[:6, :6])
    for part in model.joints:
        out[part.joint + 1] += _turned(turned[part.joint + 1], part.bearing)
        R, pre = axes[part.joint], robot.T_pre[part.joint]
        out[part.joint] += _moved(R @ pre[:3, :3], R @ pre[:3, 3], part.housing)
    tool = robot.T_last_flange @ robot.T_flange_tool
    out[-1] += _moved(into[-1] @ robot.T_last_flange[:3, :3], into[-1] @ tool[:3, 3], model.tool)
    return out


def _loop(model: ArmModel, turned: list[Array], into: list[Array], shift: Array, alpha: Array, fixed: Array) -> Loop:
    """The parallelogram of :func:`flat_arm`; ``fixed``: as of :func:`_fixed`."""
    p = model.robot.parallelogram
    if model.bar is None or p is None:
        return Loop()
    R = into[p.driven + 1]
    pin = R @ p.pin
    bearing = _turned(turned[p.driven + 1], model.joints[p.driven].bearing)
    # The wrench at the origin from a force at the pin.
    Y = rigid_motion(pin[None])[0].T[:, :3]
    at_pin, own = np.zeros((6, 6)), np.zeros((6, 6))
    at_pin[:, :3], own[:3, :3] = bearing @ Y, Y.T @ bearing @ Y
    for link in model.links:
        if "pin" in link.element.interfaces:
            F, tip = link.element.flexibility, R @ link.element.points[1]
            at_pin[:, :3] += rigid_motion(-tip[None])[0] @ np.kron(np.eye(2), R) @ F[:6, 6:9] @ R.T
            own[:3, :3] += R @ F[6:9, 6:9] @ R.T
    if model.bar.crank is not None:
        own[:3, :3] += R @ model.bar.crank.element.flexibility[:3, :3] @ R.T
    housing = _turned(
        into[p.crank_about] @ model.robot.T_pre[p.crank_about][:3, :3], model.joints[p.crank_about].housing
    )
    c, s = alpha[p.driven]
    return Loop(
        driven=p.driven,
        bar=model.bar.compliance,
        least=FLAT_SINE * float(np.linalg.norm(p.pin)),
        u=np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]]) @ (shift[p.driven] / np.linalg.norm(shift[p.driven])),
        pin=pin,
        at_pin=at_pin.ravel(),
        own=own.ravel(),
        upper=fixed[p.driven].ravel(),
        housing=housing.ravel(),
        housed=bool(housing.any()),
        shift=shift[p.driven - 1],
    )


def _packed(matrices: Array) -> Array:
    """Symmetric matrices (k, 6, 6) as 21 numbers each, in the order of the work array's rows."""
    i, j = np.triu_indices(3)
    return np.concatenate([matrices[:, i, j], matrices[:, :3, 3:].reshape(-1, 9), matrices[:, 3 + i, 3 + j]], axis=1)


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


def _turned(R: Array, C: Array) -> Array:
    """A compliance (6, 6) in other axes, R from its own to those."""
    both = np.kron(np.eye(2), R)
    return np.asarray(both @ C @ both.T)


def _moved(R: Array, t: Array, C: Array) -> Array:
    """A compliance at t, in its own axes; R turns them to those of t, about whose origin the result is."""
    motion = rigid_motion(-t[None])[0]
    return np.asarray(motion @ _turned(R, C) @ motion.T)
