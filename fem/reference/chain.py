"""The arm's parts from base to tool in the order in which they are fastened to one another.

For solvers that build the arm up of stiffnesses, and for what moves where. :mod:`fem.statics.transfers` asks what each
part carries instead and never walks along the chain: the two know nothing of each other but the model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Generic, Literal, Protocol, TypeVar

import numpy as np

from fem.elements.couplings import rigid_motion
from fem.model import ArmModel, JointPart, LinkPart, independent_springs
from robots.arrays import Array, Integers
from robots.kinematics import BodyFrames, tool_position

Motion = TypeVar("Motion")
Where = Literal["base", "housing", "axis", "elbow", "bearing", "law", "tool"]

# Turns about the z axis of a joint's frame.
ABOUT_Z = np.eye(6)[:, 5:]


@dataclass(frozen=True)
class Springs:
    """Springs between what is before them and what is behind, at n poses.

    ``where``: what gives way ("elbow": a joint that turns freely, its actuator sits at the crank), of ``joint`` where
    it is one's. ``at`` (n, 3) m in the base frame; ``R`` (n, 3, 3): axes of ``directions`` (6, k) or (n, 6, k);
    ``stiffness`` (n, k) N/m or N m/rad, 0 where it is free.
    """

    where: Where
    joint: int | None
    at: Array
    R: Array
    directions: Array
    stiffness: Array

    @property
    def turned(self) -> Array:
        """The directions in base axes (n, 6, k)."""
        return np.concatenate([self.R @ self.directions[..., :3, :], self.R @ self.directions[..., 3:, :]], axis=-2)


class Builder(Protocol[Motion]):
    """What a solver makes of the parts; a motion is how a point moves by its unknowns."""

    def ground(self) -> Motion:
        """The motion of what stands still."""
        ...

    def carried(self, motion: Motion, r: Array) -> Motion:
        """The motion of a point rigidly connected, r (n, 3) m away."""
        ...

    def sprung(self, motion: Motion, springs: Springs) -> Motion:
        """The motion behind springs."""
        ...

    def linked(self, link: LinkPart, root: Motion, R: Array, origin: Array) -> Mapping[str, Motion]:
        """Fasten a link, axes R (n, 3, 3) and origin (n, 3) m of its body; motions of its other interfaces by name."""
        ...


@dataclass(frozen=True)
class Node:
    """A point's motion as a combination of the unknowns: u = G x[freedoms]; G (n, 6, k)."""

    freedoms: Integers
    G: Array

    def over(self, size: int) -> Array:
        """G over all unknowns (n, 6, size)."""
        G = np.zeros((*self.G.shape[:2], size))
        G[:, :, self.freedoms] = self.G
        return G


@dataclass
class Unknowns:
    """A builder whose motions are nodes of n poses: rigid connections add no unknown, a spring its relative motions.

    ``springs``: these unknowns and their stiffnesses (n, k).
    """

    n: int
    size: int = 0
    springs: list[tuple[Integers, Array]] = field(default_factory=list)

    def new(self, count: int) -> Integers:
        """So many unknowns more."""
        self.size += count
        return np.arange(self.size - count, self.size)

    def ground(self) -> Node:
        """See :class:`Builder`."""
        return Node(np.zeros(0, dtype=np.int64), np.zeros((self.n, 6, 0)))

    def carried(self, motion: Node, r: Array) -> Node:
        """See :class:`Builder`."""
        return Node(motion.freedoms, rigid_motion(r) @ motion.G)

    def sprung(self, motion: Node, springs: Springs) -> Node:
        """See :class:`Builder`."""
        new = self.new(springs.stiffness.shape[1])
        self.springs.append((new, springs.stiffness))
        return Node(np.concatenate([motion.freedoms, new]), np.concatenate([motion.G, springs.turned], axis=2))


@dataclass(frozen=True)
class Chain(Generic[Motion]):
    """Motions of the loaded point and of the bar's ends, ``pins`` crank then forearm, ``span`` (n, 3) m apart."""

    tool: Motion
    pins: tuple[Motion, Motion] | None
    span: Array


def build_chain(model: ArmModel, frames: BodyFrames, q: Array, tool: Array, builder: Builder[Motion]) -> Chain[Motion]:
    """Hand every part of the arm to a builder, but for the bar, which ties two of the motions returned.

    q (n, dof) rad; ``tool`` (n, 3) m: the loaded point in the base frame.
    """
    robot = model.robot
    links = {link.body: link for link in model.links}
    p = robot.parallelogram if model.bar is not None else None
    R, origin = np.ascontiguousarray(frames.R), frames.p
    at = origin[:, 0]
    motion = _sprung(builder, builder.ground(), "base", None, at, R[:, 0], *independent_springs(model.base))
    crank = pin = None
    for body in range(robot.dof + 1):
        if body > 0:
            part = model.joints[body - 1]
            motion = builder.carried(motion, origin[:, body] - at)
            if p is not None and part.joint == p.crank_about:
                crank = _crank(model, R, origin[:, body], q, motion, builder)
            R_before = R[:, body - 1] @ robot.T_pre[part.joint][:3, :3]
            R_behind = R[:, body] @ robot.R_post[part.joint].T
            free = p is not None and part.joint == p.driven
            motion = _joint(builder, motion, part, origin[:, body], (R_before, R_behind), q, free=free)
        link = links.get(body)
        ends = {} if link is None else builder.linked(link, motion, R[:, body], origin[:, body])
        if p is not None and body == p.driven + 1:
            pin = ends["pin"] if "pin" in ends else builder.carried(motion, R[:, body] @ p.pin)
        at = frames.p_flange if body == robot.dof else origin[:, body + 1]
        motion = ends["tip"] if "tip" in ends else builder.carried(motion, at - origin[:, body])
    own = tool_position(robot, frames)
    motion = builder.carried(motion, own - at)
    R_flange = np.ascontiguousarray(frames.R_flange)
    motion = _sprung(builder, motion, "tool", None, own, R_flange, *independent_springs(model.tool))
    motion = builder.carried(motion, tool - own)
    if p is None or crank is None or pin is None:
        return Chain(motion, None, np.zeros((len(q), 3)))
    return Chain(motion, (crank, pin), origin[:, p.driven + 1] - origin[:, p.crank_about + 1])


def _sprung(
    builder: Builder[Motion],
    motion: Motion,
    where: Where,
    joint: int | None,
    at: Array,
    R: Array,
    directions: Array,
    stiffness: Array,
) -> Motion:
    if stiffness.size == 0:
        return motion
    each = np.broadcast_to(stiffness, (len(R), stiffness.shape[-1]))
    return builder.sprung(motion, Springs(where, joint, at, R, directions, each))


def _joint(
    builder: Builder[Motion],
    motion: Motion,
    part: JointPart,
    at: Array,
    axes: tuple[Array, Array],
    q: Array,
    *,
    free: bool,
) -> Motion:
    """A joint: its housing in the axes before it, then spring and bearing in those behind it."""
    before, behind = axes
    j = part.joint
    motion = _sprung(builder, motion, "housing", j, at, before, *independent_springs(part.housing))
    if part.is_coupled:
        motion = _sprung(builder, motion, "bearing", j, at, behind, *_coupled(part, q))
    else:
        motion = _turned(builder, motion, part, at, behind, q, free=free)
        motion = _sprung(builder, motion, "bearing", j, at, behind, *part.springs())
    for row, law in part.laws:
        stiffness = 1.0 / law.compliance(q)[:, None]
        motion = _sprung(builder, motion, "law", j, at, behind, np.eye(6)[:, [row]], stiffness)
    return motion


def _turned(
    builder: Builder[Motion], motion: Motion, part: JointPart, at: Array, R: Array, q: Array, *, free: bool = False
) -> Motion:
    """A turn about the joint's axis against its spring, or freely as a parallelogram's elbow does."""
    if free:
        return _sprung(builder, motion, "elbow", part.joint, at, R, ABOUT_Z, np.zeros(1))
    compliance = part.axial.compliance(q)
    if not compliance.any():
        return motion
    return _sprung(builder, motion, "axis", part.joint, at, R, ABOUT_Z, 1.0 / compliance[:, None])


def _coupled(part: JointPart, q: Array) -> tuple[Array, Array]:
    """A joint whose axis and bearing are coupled: eigenvectors (n, 6, k) of its compliance, stiffnesses (n, k)."""
    C = np.repeat(part.bearing[None], len(q), axis=0)
    C[:, 5, 5] = part.axial.compliance(q)
    size = np.sqrt(np.maximum(np.diagonal(C, axis1=1, axis2=2), 1e-300))
    values, vectors = np.linalg.eigh(C / (size[:, :, None] * size[:, None, :]))
    gives = values > 1e-12
    kept = gives.any(axis=0)
    directions = np.where(gives[:, None, :], size[:, :, None] * vectors, 0.0)
    return directions[:, :, kept], np.where(gives, 1.0 / np.where(gives, values, 1.0), 1.0)[:, kept]


def _crank(model: ArmModel, R: Array, at: Array, q: Array, motion: Motion, builder: Builder[Motion]) -> Motion:
    """The crank's pin: the actuator turns the crank against the body before the joint that it sits at."""
    p = model.robot.parallelogram
    assert model.bar is not None and p is not None  # noqa: S101, PT018 - the caller knows
    forearm = R[:, p.driven + 1]
    turned = _turned(builder, motion, model.joints[p.driven], at, forearm @ model.robot.R_post[p.driven].T, q)
    crank = model.bar.crank
    if crank is None:
        return builder.carried(turned, forearm @ p.pin)
    return builder.linked(crank, turned, R[:, crank.body], at)["tip"]
