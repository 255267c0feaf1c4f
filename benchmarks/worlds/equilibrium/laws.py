"""Laws of single freedoms beyond the proportional one: what a gear gives more than its compliance times the torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .arm import Vector


@dataclass(frozen=True)
class Moment:
    """When something happens.

    Seconds since the campaign began, its share of the campaign (more than 1 on later visits; -1 before it), seconds
    since the day's work began, K by which the hall's air and heavy iron in it are warmer than at first, day of work,
    load cycles before, and their share of the campaign's.
    """

    time_s: float = 0.0
    progress: float = 0.0
    day_s: float = 0.0
    air: float = 0.0
    iron: float = 0.0
    session: int = 0
    cycle: int = 0
    used: float = 0.0


class Extra(Protocol):
    """A freedom's deflection beside the proportional one; those that remember are told when an equilibrium stands."""

    freedom: int

    def more(self, torque: float, moment: Moment) -> float:
        """Return the extra deflection under a torque."""
        ...

    def keep(self, torque: float, moment: Moment) -> None:
        """Remember an equilibrium."""
        ...

    def rest(self, torque: float, moment: Moment) -> None:
        """Begin a set-up: the drive has just moved here and holds the arm's weight."""
        ...


@dataclass
class Memoryless:
    """A law of the torque alone; ``kind`` names it."""

    freedom: int
    kind: str
    compliance: float
    size: float
    reference: float
    shape: float = 2.0

    def more(self, torque: float, moment: Moment) -> float:
        """Evaluate the derivative of the complementary potential, less its proportional part."""
        x = torque / self.reference
        if self.kind == "ramberg-osgood":  # gives more and more: c tau s |x|^(n - 1)
            return float(self.compliance * torque * self.size * abs(x) ** (self.shape - 1))
        if self.kind == "asinh":  # compliance falls from c to c (1 - s), as 1/sqrt(1 + x^2)
            return float(self.compliance * self.size * (self.reference * np.arcsinh(x) - torque))
        if self.kind == "two-teeth":  # a second pair of teeth comes to bear at the reference: a rounded kink
            over = np.logaddexp(0.0, 12 * (abs(x) - 1)) / 12
            return float(
                -self.compliance * self.size * self.reference * np.sign(x) * (over - np.log1p(np.exp(-12)) / 12)
            )
        if self.kind == "dead-zone":  # half of the clearance on either flank, the corner rounded by oil and tooth form
            return float(self.size / 2 * x / np.sqrt(1 + x * x))
        if self.kind == "lifting":  # a foot whose edge leaves the floor beyond the reference
            return float(self.compliance * self.size * self.reference * np.sign(x) * max(0.0, abs(x) - 1) ** 1.5)
        raise ValueError(f"law {self.kind!r}; known: ramberg-osgood, asinh, two-teeth, dead-zone, lifting")

    def keep(self, torque: float, moment: Moment) -> None:
        """Nothing to remember."""

    def rest(self, torque: float, moment: Moment) -> None:
        """Nothing to forget."""


@dataclass
class Dahl:
    """Friction beside the gear's spring, as Dahl's law has it: dT/dtheta = sigma (1 - sign(dtheta) T / limit).

    Integrated exactly from the last equilibrium to the next, as the way between two loads is monotonic. ``slips`` are
    factors on the limit by load cycle, for friction that lets go by chance (stick-slip).
    """

    freedom: int
    compliance: float
    limit: float
    stick: float
    slips: tuple[float, ...] = (1.0,)
    angle: float = 0.0
    friction: float = 0.0

    def _friction(self, angle: float, limit: float) -> tuple[float, float]:
        """Friction torque at an angle after moving there, and its slope."""
        way = angle - self.angle
        side = 1.0 if way >= 0 else -1.0
        fade = float(np.exp(-min(self.stick * abs(way) / limit, 600.0)))
        gap = min(max(self.friction, -limit), limit) - side * limit
        return side * limit + gap * fade, -gap * fade * side * self.stick / limit

    def _angle(self, torque: float, moment: Moment) -> tuple[float, float]:
        limit = self.limit * self.slips[moment.cycle % len(self.slips)]
        angle = self.angle
        low, high = (torque - limit) * self.compliance, (torque + limit) * self.compliance
        for _ in range(60):
            friction, slope = self._friction(angle, limit)
            off = angle / self.compliance + friction - torque
            low, high = (low, min(high, angle)) if off > 0 else (max(low, angle), high)
            step = angle - off / (1 / self.compliance + slope)
            if not low <= step <= high:
                step = (low + high) / 2
            if abs(step - angle) < 1e-15:
                break
            angle = step
        return angle, self._friction(angle, limit)[0]

    def more(self, torque: float, moment: Moment) -> float:
        """Solve spring and friction together for the angle under a torque."""
        return self._angle(torque, moment)[0] - self.compliance * torque

    def keep(self, torque: float, moment: Moment) -> None:
        """Go there."""
        self.angle, self.friction = self._angle(torque, moment)

    def rest(self, torque: float, moment: Moment) -> None:
        """Arrive from a motion that has let friction fade: the spring holds the weight."""
        self.angle, self.friction = self.compliance * torque, 0.0


@dataclass
class Creep:
    """Two Kelvin-Voigt elements in series with the gear: a fast and a slow one, which also recover."""

    freedom: int
    compliance: float
    shares: tuple[float, float]
    times_s: tuple[float, float]
    now: float = 0.0
    crept: tuple[float, float] = (0.0, 0.0)

    def _crept(self, torque: float, moment: Moment) -> tuple[float, float]:
        passed = max(moment.time_s - self.now, 0.0)
        fades = [float(np.exp(-passed / time)) for time in self.times_s]
        ends = [self.compliance * share * torque for share in self.shares]
        first, second = (end + (old - end) * f for end, old, f in zip(ends, self.crept, fades, strict=True))
        return first, second

    def more(self, torque: float, moment: Moment) -> float:
        """Deflection crept since the last equilibrium, under a torque that has stood since."""
        return sum(self._crept(torque, moment))

    def keep(self, torque: float, moment: Moment) -> None:
        """Let time pass."""
        self.crept, self.now = self._crept(torque, moment), moment.time_s

    def rest(self, torque: float, moment: Moment) -> None:
        """Long at rest under the arm's own weight."""
        first, second = (self.compliance * share * torque for share in self.shares)
        self.crept, self.now = (first, second), moment.time_s


@dataclass
class Step:
    """A fixture that has slipped once and for all: a deflection from some part of the campaign on."""

    freedom: int
    amount: float
    when: float

    def more(self, torque: float, moment: Moment) -> float:
        """All or nothing."""
        return self.amount if moment.progress >= self.when else 0.0

    def keep(self, torque: float, moment: Moment) -> None:
        """Nothing to remember."""

    def rest(self, torque: float, moment: Moment) -> None:
        """Nothing to forget."""


def bell(angle: float, centre: float, sharpness: float) -> float:
    """Rise and fall once a turn, between 0 and 1: von Mises' bell."""
    return float(np.exp(sharpness * (np.cos(angle - centre) - 1)))


def triangle(phase: float) -> float:
    """Triangular wave between -1 and 1, period 2 pi."""
    return float(2 / np.pi * np.arcsin(np.sin(phase)))


def linkage(angle: float, centre: float) -> float:
    """Stiffness of a spring that runs past a joint, scaled to between 0 and 1: arms 0.9 and 0.35 m, law of cosines."""

    def potential(x: float) -> float:
        run = np.sqrt(0.9**2 + 0.35**2 - 2 * 0.9 * 0.35 * np.cos(x))
        return float(0.5 * (run - 0.5) ** 2)

    step, turned = 1e-3, angle - centre
    bend = (potential(turned + step) - 2 * potential(turned) + potential(turned - step)) / step**2
    return float(np.clip((bend + 0.19) / 0.33, 0.0, 1.0))


def daily(hours: Vector, amplitude: float, peak: float) -> Vector:
    """Daily cycle of a hall: a wave with its second harmonic, as nights are longer than afternoons."""
    turn = 2 * np.pi * (hours - peak) / 24
    return np.asarray(amplitude * (np.cos(turn) + 0.25 * np.cos(2 * turn)))
