"""The arm under a load: situation of all readings at once, what effects add to it, readings as they come out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .arms import Arm
from .campaign import Campaign
from .screws import Array, adjoint, axes_at, body_motions, carried, displacement, wrench_at


@dataclass(frozen=True)
class Situation:
    """All readings at once: motions of bodies, screws of actuators (n, 6, joints), point, wrench, torques."""

    campaign: Campaign
    arm: Arm
    motions: Array
    flange: Array
    screws: Array
    point: Array
    force: Array
    wrench: Array
    torque: Array
    soft: Array

    def body(self, number: int) -> Array:
        """Motions (n, 4, 4) of a body from home: 0 the base, k what follows joint k."""
        return np.asarray(self.motions[:, number])

    def yielding(self, home_screw: Array, body: int) -> Array:
        """Twist (n, 6) a unit compliance about a screw that is fixed at home (6,) in a body."""
        return carried(np.outer(home_screw, home_screw), self.body(body), self.wrench)


Stage = Callable[[Situation], Array]


def nothing(s: Situation) -> Array:
    """No yielding."""
    return np.zeros(())


def as_read(s: Situation, d: Array) -> Array:
    """No error of the gauge, in m."""
    return np.zeros(())


@dataclass(frozen=True)
class Effect:
    """One thing that the model does not know of, as what it changes or adds at each stage.

    ``angles`` turns coordinates (n, joints) in rad into true ones; ``force`` adds to the force (n, 3); ``offset``
    shifts the load's point, ``point`` load's and gauge's, both (n, 3) in base or (3,) in flange axes; ``joint`` adds
    joint angles (n, joints), ``twist`` twists (n, 6), ``read`` what the gauge shows beside the displacement (n, 3).
    """

    code: str
    axis: tuple[str, ...]
    place: str
    parameters: dict[str, float]
    angles: Callable[[Array], Array] | None = None
    force: Stage = nothing
    offset: Stage = nothing
    joint: Stage = nothing
    twist: Stage = nothing
    read: Callable[[Situation, Array], Array] = as_read
    gauge_only: bool = False  # nothing of it is in a displacement without drift of the gauge
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    bar_path: float | None = None  # share of the forearm's moment that goes past joint 2
    softness: tuple[int, float] | None = None  # a joint held rigid by the model: number, true compliance
    links_softer: dict[str, float] = field(default_factory=dict)
    turned: tuple[float, float, float] = (0.0, 0.0, 0.0)  # frame of the table's forces and displacements, rad


@dataclass(frozen=True)
class World:
    """The true arm: as built, compliances of joints (n,), shares of links, errors of angles and loads."""

    arm: Arm
    soft: Array
    bar_path: float
    link_share: dict[str, float]
    zeros: Array
    load_scale: float = 1.0
    load_errors: dict[float, float] = field(default_factory=dict)


def actuators(arm: Arm, screws: Array, bar_path: float) -> Array:
    """Screws of the actuators (n, 6, joints): a bar takes a share of joint 3's moment past joint 2 to the base."""
    if bar_path == 0.0:
        return screws
    out = screws.copy()
    out[:, :, 1] -= bar_path * screws[:, :, 2]
    return out


def vector_turn(vectors: Array, angles: Array) -> Array:
    """Vectors (n, 3) turned about base axes by angles (3,) in rad, by Rodrigues' formula."""
    angle = float(np.linalg.norm(angles))
    if angle == 0.0:
        return vectors
    k = angles / angle
    along = np.outer(vectors @ k, k)
    return np.asarray(along + np.cos(angle) * (vectors - along) + np.sin(angle) * np.cross(k, vectors))


def situation(world: World, effects: Sequence[Effect], c: Campaign) -> Situation:
    """Geometry and loads of all readings, with what effects change of them."""
    arm, q = world.arm, np.deg2rad(c.q_deg)
    for effect in effects:
        if effect.angles is not None:
            q = effect.angles(q)
    motions = body_motions(arm.screws, arm.joint_angles(q + world.zeros))
    flange = motions[:, -1] @ arm.flange
    local = c.point + sum((np.asarray(e.point) for e in effects), np.zeros(3))
    point = np.einsum("nij,nj->ni", flange[:, :3, :3], local) + flange[:, :3, 3]
    path = next((e.bar_path for e in effects if e.bar_path is not None), world.bar_path)
    soft = world.soft.copy()
    for effect in effects:
        if effect.softness is not None:
            soft[effect.softness[0]] = effect.softness[1]
    errors = np.array([world.load_errors.get(round(float(f), 3), 0.0) for f in np.linalg.norm(c.force, axis=1)])
    force = c.force * (world.load_scale + errors)[:, None]
    for effect in effects:
        force = vector_turn(force, np.asarray(effect.turned))
    axes = actuators(arm, axes_at(arm.screws, motions), path)
    bare = Situation(c, arm, motions, flange, axes, point, force, np.zeros((len(c), 6)), np.zeros_like(q), soft)
    force = force + sum((e.force(bare) for e in effects), np.zeros(3))
    loaded = point + sum((e.offset(bare) for e in effects), np.zeros(3))
    wrench = wrench_at(force, loaded)
    return replace(bare, force=force, wrench=wrench, torque=np.einsum("nij,ni->nj", axes, wrench))


def link_twist(world: World, effects: Sequence[Effect], s: Situation) -> Array:
    """Twist (n, 6) of the links: their beams, each times its share and what an effect adds to that."""
    softer = {name: extra for e in effects for name, extra in e.links_softer.items()}
    twist = np.zeros((len(s.campaign), 6))
    for link in s.arm.links:
        share = world.link_share.get(link.name, 0.0) + softer.get(link.name, 0.0)
        if share > 0.0:
            twist += share * carried(link.compliance(), s.body(link.body), s.wrench)
    return twist


def readings(world: World, effects: Sequence[Effect], c: Campaign, *, gauge: bool = True) -> Array:
    """Displacements (n, 3) in m as the gauge's axes show them, without noise; ``gauge`` false: without its drift."""
    s = situation(world, effects, c)
    turns = s.torque * s.soft + sum((e.joint(s) for e in effects), np.zeros(s.torque.shape))
    twist = np.einsum("nij,nj->ni", s.screws, turns) + link_twist(world, effects, s)
    twist = twist + sum((e.twist(s) for e in effects), np.zeros(6))
    d = displacement(twist, s.point)
    for effect in effects:
        d = vector_turn(d, -np.asarray(effect.turned))
    return d + sum((e.read(s, d) for e in effects if gauge or not e.gauge_only), np.zeros(3))


def spring_columns(arm: Arm, c: Campaign, bar_path: float) -> Array:
    """Displacements (n, 3, joints) in m a unit compliance of each joint, as the model sees it."""
    world = World(arm, np.zeros(arm.size), bar_path, {}, np.zeros(arm.size))
    s = situation(world, (), c)
    lever = s.screws[:, 3:, :] + np.cross(s.screws[:, :3, :], s.point[:, :, None], axis=1)
    return np.asarray(lever * s.torque[:, None, :])


__all__ = ["Effect", "Situation", "World", "adjoint", "readings", "situation", "spring_columns"]
