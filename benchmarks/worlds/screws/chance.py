"""What laws are drawn from: a generator, the arm, what the campaign asks of each joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arms import Arm
from .campaign import Campaign
from .mechanics import Situation
from .screws import Array


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
