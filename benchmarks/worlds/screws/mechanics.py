"""Campaigns, what an arm answers in them, what laws are drawn by, and instruments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .arm import Arm, Array, Flags, Whole, adjoint, axes_at, body_motions, carried, displacement, wrench_at

HANDLING_S = 15.0  # so long a load hangs before it is read
ZERO, NOTHING = -1, -2


@dataclass(frozen=True)
class Campaign:
    """Readings in the order of time: angles (n, joints) in deg, forces (n, 3) in N, points (n, 3) in flange axes in m.

    ``setup`` is the pose's number, ``visit`` the stretch over which a load history goes on, ``cycle`` the loading cycle
    at whose start the gauge was zeroed, ``stay`` the stretch at one pose without leaving it (it shares one scatter).
    """

    q_deg: Array
    force: Array
    point: Array
    setup: Whole
    repeat: Whole
    visit: Whole
    cycle: Whole
    stay: Whole
    unloading: Flags
    time_s: Array
    session: Whole
    air_celsius: Array
    rested: bool = False

    def __len__(self) -> int:
        return len(self.setup)

    def joined(self, later: Campaign) -> Campaign:
        """Both campaigns as one; the later one's groups are its own, its poses' numbers too."""
        shifted = replace(
            later,
            visit=later.visit + self.visit.max() + 1,
            cycle=later.cycle + self.cycle.max() + 1,
            stay=later.stay + self.stay.max() + 1,
            setup=later.setup + self.setup.max() + 1,
        )
        names = [f for f in self.__dataclass_fields__ if f != "rested"]
        both: dict[str, Any] = {f: np.concatenate([getattr(self, f), getattr(shifted, f)]) for f in names}
        return replace(self, **both)


def histories(c: Campaign) -> Whole:
    """Events (visits, longest): row numbers, ``ZERO`` where a cycle starts unloaded, ``NOTHING`` after."""
    lines: list[list[int]] = []
    for rows in np.split(np.arange(len(c)), np.flatnonzero(np.diff(c.visit)) + 1):
        line: list[int] = []
        for i in rows.tolist():
            if not line or c.cycle[i] != c.cycle[i - 1]:
                line.append(ZERO)
            line.append(i)
        lines.append(line)
    longest = max(len(line) for line in lines)
    return np.array([line + [NOTHING] * (longest - len(line)) for line in lines], np.int64)


def along_history(c: Campaign, signal: Array, law: Callable[[Array], Array]) -> Array:
    """What ``law``, which keeps its own state a visit, answers to ``signal`` (n,), less its value at the cycle's zero.

    The law is called event by event with the inputs of all visits at once; each visit starts from the law's own rest.
    """
    events = histories(c)
    answer, held, zero = np.zeros(len(c)), np.zeros(len(events)), np.zeros(len(events))
    for column in events.T:
        held = np.where(column >= 0, signal[np.maximum(column, 0)], np.where(column == ZERO, 0.0, held))
        out = law(held)
        zero = np.where(column == ZERO, out, zero)
        real = column >= 0
        answer[column[real]] = (out - zero)[real]
    return answer


def lagging(c: Campaign, drive: Array, lag_s: float) -> Array:
    """Solution of ``lag dx/dt = drive - x`` at the readings less at the cycle's zero; no drive between cycles."""
    if c.rested:
        return np.zeros(len(c))
    x, now, zero, held, answer = 0.0, -1e9, 0.0, 0.0, np.zeros(len(c))
    decay = float(np.exp(-HANDLING_S / lag_s))
    for i, (t, aim) in enumerate(zip(c.time_s.tolist(), drive.tolist(), strict=True)):
        starts = i == 0 or c.cycle[i] != c.cycle[i - 1]
        held = 0.0 if starts else held
        x = held + (x - held) * float(np.exp(-max(t - HANDLING_S - now, 0.0) / lag_s))
        zero = x if starts else zero
        x = aim + (x - aim) * decay
        now, held = t, aim
        answer[i] = x - zero
    return answer


def heated(c: Campaign, power: Array, lag_s: float) -> Array:
    """Solution of ``lag dy/dt = power - y`` from cold at the start; motors are off between sessions."""
    if c.rested:
        return np.zeros(len(c))
    y, now, answer = 0.0, 0.0, np.zeros(len(c))
    for i, (t, heat) in enumerate(zip(c.time_s.tolist(), power.tolist(), strict=True)):
        off = i > 0 and c.session[i] != c.session[i - 1]
        aim = 0.0 if off else heat
        y = aim + (y - aim) * float(np.exp(-max(t - now, 0.0) / lag_s))
        now, answer[i] = t, y
    return answer


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


@dataclass(frozen=True)
class Chance:
    """A draw: generator, arm, its true springs, the campaign and the situation of its readings without any effect."""

    rng: np.random.Generator
    arm: Arm
    soft: Array
    campaign: Campaign
    bare: Situation
    path: float

    def between(self, low: float, high: float) -> float:
        """Uniform."""
        return float(self.rng.uniform(low, high))

    def spread(self, low: float, high: float) -> float:
        """Uniform in the logarithm."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def sign(self) -> float:
        """One or minus one."""
        return float(self.rng.choice([-1.0, 1.0]))

    def direction(self, flat: bool = False) -> Array:
        """Unit vector (3,), horizontal if flat."""
        v = self.rng.normal(size=3) * np.array([1.0, 1.0, 0.0 if flat else 1.0])
        return np.asarray(v / np.linalg.norm(v))

    def top(self, joint: int) -> float:
        """Largest torque of a joint in the campaign, N m."""
        return float(np.abs(self.bare.torque[:, joint]).max()) + 1e-9

    def shares(self) -> Array:
        """Share (joints,) that each joint has in the work of the loads."""
        work = np.sqrt(np.mean(self.bare.torque**4, axis=0)) * self.soft
        return np.asarray(work / work.sum())

    def joint(self, least: float = 0.04, among: tuple[int, ...] | None = None) -> int:
        """A joint that does at least so much of the work; the busiest if none does."""
        shares = self.shares()
        numbers = range(self.arm.size) if among is None else among
        busy = [j for j in numbers if shares[j] >= least]
        return int(self.rng.choice(busy)) if busy else int(max(numbers, key=lambda j: shares[j]))

    def swinging(self) -> tuple[int, ...]:
        """Joints whose torque has both signs in the campaign, the lesser a sixth of the larger at least; else all."""
        t = self.bare.torque
        up, down = t.max(axis=0), -t.min(axis=0)
        both = np.minimum(up, down) > np.maximum(up, down) / 6.0
        return tuple(np.flatnonzero(both).tolist()) or tuple(range(self.arm.size))

    def moved(self) -> tuple[int, ...]:
        """Joints that the campaign moves."""
        return tuple(np.flatnonzero(np.ptp(self.campaign.q_deg, axis=0) > 1.0).tolist())

    def large(self) -> tuple[int, ...]:
        """Joints that lift the arm: horizontal axes ahead of the wrist."""
        flat = [j for j in range(self.arm.size) if abs(self.arm.screws[2, j]) < 0.5]
        return tuple(flat[:2])

    def name(self, joint: int) -> str:
        """The joint's name."""
        return self.arm.joints[joint]


def at(s: Situation, joint: int, angle: Array) -> Array:
    """Extra angles (n, joints) that are ``angle`` (n,) at one joint."""
    extra = np.zeros_like(s.torque)
    extra[:, joint] = angle
    return extra


KINDS = ("share-of-component", "share-of-vector", "load", "white", "by-axis", "heavy-tailed", "session")


@dataclass(frozen=True)
class Instrument:
    """An instrument: kind, its size (a share, or m; m a metre for the tracker), floor, place (3,), session's offset."""

    kind: str
    size: float
    floor: float
    place: tuple[float, float, float]
    offset: float
    resolution: float

    def covariance(self, d: Array, point: Array, force: Array, full: float) -> Array:
        """Covariance (n, 3, 3) of independent noise of each reading, with that of rounding."""
        square = np.full_like(d, self.size**2)
        if self.kind == "share-of-component":
            square = self.floor**2 + (self.size * d) ** 2
        elif self.kind == "share-of-vector":
            square = self.floor**2 + self.size**2 * np.sum(d**2, axis=1, keepdims=True) * np.ones(3)
        elif self.kind == "load":
            square = self.floor**2 + (self.size * np.linalg.norm(force, axis=1, keepdims=True) / full) ** 2 * np.ones(3)
        out = square[:, :, None] * np.eye(3)
        if self.kind == "by-axis":
            beam = point - np.asarray(self.place)
            away = np.linalg.norm(beam, axis=1)
            along = beam / away[:, None]
            across = np.eye(3) - along[:, :, None] * along[:, None, :]
            out = (
                self.floor**2 * along[:, :, None] * along[:, None, :] + (self.size * away[:, None, None]) ** 2 * across
            )
        return np.asarray(out + self.resolution**2 / 12.0 * np.eye(3))

    def noise(self, rng: np.random.Generator, covariance: Array, session: Whole) -> Array:
        """Noise (n, 3) with that covariance; heavy tails by a common divisor of a reading's axes; session's offset."""
        rows = len(covariance)
        rounding = self.resolution**2 / 12.0 * np.eye(3)
        root = np.linalg.cholesky(covariance - rounding + 1e-24 * np.eye(3))
        draw = rng.normal(size=(rows, 3))
        if self.kind == "heavy-tailed":
            draw = draw / np.sqrt(rng.chisquare(3.0, size=(rows, 1)))  # t with 3 degrees of freedom, of variance 1
        out = np.einsum("nij,nj->ni", root, draw)
        if self.offset > 0.0:
            names, where = np.unique(session, return_inverse=True)
            out = out + rng.normal(scale=self.offset, size=(len(names), 3))[where]
        return np.asarray(out)

    def rounded(self, d: Array) -> Array:
        """Readings as the display shows them."""
        return np.asarray(np.round(d / self.resolution) * self.resolution)


def instrument(kind: str, rng: np.random.Generator, reach: float) -> Instrument:
    """An instrument of that kind with drawn sizes; a tracker stands 2 to 6 m away from the arm's base."""
    um = 1e-6
    size = {
        "share-of-component": rng.uniform(0.01, 0.03),
        "share-of-vector": rng.uniform(0.01, 0.03),
        "load": rng.uniform(8, 25) * um,
        "white": rng.uniform(5, 30) * um,
        "by-axis": rng.uniform(1.5, 5.0) * um,
        "heavy-tailed": rng.uniform(5, 20) * um,
        "session": rng.uniform(5, 15) * um,
    }[kind]
    floor = rng.uniform(2, 5) * um
    heading, away = rng.uniform(-1.0, 1.0), reach + rng.uniform(1.0, 4.0)
    place = (away * float(np.cos(heading)), away * float(np.sin(heading)), float(rng.uniform(0.5, 1.8)))
    offset = float(rng.uniform(8, 25)) * um if kind == "session" else 0.0
    return Instrument(kind, float(size), float(floor), place, offset, float(rng.choice([1e-6, 1e-6, 1e-5])))
