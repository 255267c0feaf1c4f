"""What a hidden effect is here: a law of one of four kinds, how its sizes are drawn, and along what it acts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from benchmarks.worlds.shopfloor.arms import Floats, Ints, Robot
from benchmarks.worlds.shopfloor.campaign import Timeline
from benchmarks.worlds.shopfloor.statics import Postures

Sizes = Mapping[str, float]


@dataclass(frozen=True)
class Scene:
    """All that laws may look at: (n,) or (n, ...) over the events of a timeline.

    wrench is at the tool in base axes (N, N m); torque and weight are those of the springs (N m); clock and warm are
    what slow laws see, which in a rested state differ from the timeline's.
    """

    arm: Robot
    at: Postures
    line: Timeline
    q: Floats
    wrench: Floats
    torque: Floats
    weight: Floats
    compliance: Floats
    clock: Floats
    warm: Floats
    air: Floats
    span: float
    fresh: bool = False

    @property
    def pose(self) -> Ints:
        """Pose of each event."""
        return self.line.pose

    def turned(self, joint: int, angle: Floats) -> Floats:
        """Displacement of the tool (n, 6) where a spring gives way by ``angle`` (n,) rad."""
        return np.asarray(self.at.turns[self.pose, joint] * angle[:, None])

    def part(self, index: int, flexibility: Floats) -> Floats:
        """Displacement (n, 6) by a 6x6 flexibility of a part in its frame; -2 is the base and -1 the tool."""
        x = self.at.parts[self.pose, index]
        carried = np.einsum("nji,nj->ni", x, self.wrench)
        return np.asarray(np.einsum("nij,nj->ni", x, carried @ flexibility.T))

    def carried(self, index: int) -> Floats:
        """Wrench (n, 6) that a part carries, in its frame."""
        return np.asarray(np.einsum("nji,nj->ni", self.at.parts[self.pose, index], self.wrench))

    def by_visit(self, law: Callable[[Floats, Floats], Floats], torque: Floats) -> Floats:
        """A law with memory, set-up by set-up: given torques and times (m,) since the drive, it gives (m,)."""
        out = np.zeros(len(torque))
        edges = np.flatnonzero(np.diff(self.line.visit)) + 1
        for rows in np.split(np.arange(len(torque)), edges):
            out[rows] = law(torque[rows], self.line.time[rows] - self.line.time[rows[0]])
        return out


@dataclass(frozen=True)
class Rig:
    """What stands and pulls in truth, before statics: laws of the table and of the load change it.

    q : (n_pose, dof) rad; force : (n, 3) N over events; moment_arm in flange axes (m); ``loop`` is the load path
    """

    q: Floats
    force: Floats
    shift: Floats
    arm_of_force: Floats
    frame: Floats
    loop: bool


@dataclass(frozen=True)
class Law:
    """One family of effects.

    draw gives the sizes (SI) of one at a place of an arm; exactly one of rig, gives, theta and reads is set:
    rig changes a :class:`Rig`, gives returns a displacement (n, 6), theta a further turn of the joint (n,) rad,
    reads turns displacements (n, 3) into what the gauge shows.
    """

    family: str
    axis: tuple[str, ...]
    places: Callable[[Robot], tuple[str, ...]]
    draw: Callable[[np.random.Generator, Robot, int], dict[str, float]]
    rig: Callable[[Rig, Timeline, int, Sizes], Rig] | None = None
    gives: Callable[[Scene, int, Sizes], Floats] | None = None
    theta: Callable[[Scene, int, Sizes], Floats] | None = None
    reads: Callable[[Scene, Floats, Sizes], Floats] | None = None
    slow: bool = False
    steady: bool = True


@dataclass(frozen=True)
class Hidden:
    """An effect of one set: its law, where it sits, and its sizes."""

    law: Law
    place: str
    joint: int
    sizes: dict[str, float] = field(default_factory=dict)

    @property
    def code(self) -> str:
        """As the catalogue names it."""
        return self.law.family if self.law.family in PLAIN else f"{self.law.family}:{self.place}"


# Codes that name no place.
PLAIN = frozenset(
    {
        "payload",
        "base-tilt",
        "base-vertical",
        "parallelogram-bar",
        "load-path",
        "tool-compliance",
        "load-point-offset",
        "load-misalignment",
        "gauge-zero",
        "gauge-scale",
        "drift",
        "wrist-coupling",
        "turned-frame",
        "tool-point-offset",
        "partial-load-path",
        "loose-base",
        "cable-package",
    }
)


def at_joints(*which: int) -> Callable[[Robot], tuple[str, ...]]:
    """Places: these joints, or all."""
    return lambda arm: tuple(arm.names[k] for k in (which or range(arm.dof)) if k < arm.dof)


def at(place: str) -> Callable[[Robot], tuple[str, ...]]:
    return lambda arm: (place,)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def either(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def rating(arm: Robot, joint: int) -> float:
    """Torque (N m) of 60 % of the payload at the stretched rest of the arm: what a gear is bought for, weight apart."""
    lengths = [float(np.linalg.norm(a.xyz)) for a in arm.axes[joint + 1 :]] + [float(np.linalg.norm(arm.flange))]
    return 0.6 * arm.payload * 9.81 * sum(lengths)
