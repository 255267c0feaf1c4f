"""Laws of torque against turn, for many arms at once: what they pull with, and what they remember.

``pull`` is the slope of a potential that holds until the memory is brought up to date by ``keep``; it gives torque and
stiffness (B,) for turns (B,). Memories are arrays (B, ...). A slide has forces in N and m instead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Value = Array | float
TINY = 1e-9


@dataclass(frozen=True)
class Now:
    """When: all (B,). Seconds since the first reading, the session's start and the last step; cycles done."""

    time_s: Array
    since_s: Array
    step_s: Array
    cycles: NDArray[np.int_]


class Law:
    """No memory by default."""

    lasting = False  # what is remembered outlives the set-up

    def rest(self, came: Array) -> Array:
        """Memory of an arm that came to its pose with torques of this sign and size, -1 to 1 (B,)."""
        return np.zeros((len(came), 0))

    def again(self, kept: Array, came: Array) -> Array:
        """Memory of an arm that went away and came back."""
        return kept

    def pull(self, y: Array, kept: Array, now: Now) -> tuple[Array, Array]:
        """Torque and stiffness."""
        raise NotImplementedError

    def keep(self, y: Array, kept: Array, now: Now) -> Array:
        """Memory after a step that ended at ``y``."""
        return kept

    def snap(self, y: Array, kept: Array) -> Array:
        """Memory after what could not be held any more let go at ``y``."""
        return kept


@dataclass
class Spring(Law):
    """A spring, which time may soften."""

    k: Value
    softer: list[Callable[[Now], Array]] = field(default_factory=list)

    def pull(self, y: Array, kept: Array, now: Now) -> tuple[Array, Array]:
        k = np.broadcast_to(np.asarray(self.k, dtype=float), y.shape)
        for factor in self.softer:
            k = k / factor(now)
        return k * y, k


@dataclass
class Curve(Law):
    """Any rising function that gives torque and stiffness."""

    of: Callable[[Array], tuple[Array, Array]]

    def pull(self, y: Array, kept: Array, now: Now) -> tuple[Array, Array]:
        return self.of(y)


def hertz(at: Value, gives: Value) -> Curve:
    """A ball in its race: torque by the turn's power of 3/2; at the torque ``at`` it gives ``gives`` rad."""
    soft = 0.03 * gives
    c = at / (gives * (gives**2 + soft**2) ** 0.25)

    def of(y: Array) -> tuple[Array, Array]:
        s = y**2 + soft**2
        return c * y * s**0.25, c * s**0.25 * (1 + 0.5 * y**2 / s)

    return Curve(of)


def unloading(k: Value, at: Value, more: float) -> Curve:
    """A load zone that shrinks: k y (1 + b y^2)^-0.2; at the torque ``at`` it turns 1 + ``more`` times as far."""
    b = ((1 + more) ** (1 / 0.2) - 1) / ((1 + more) * at / k) ** 2

    def of(y: Array) -> tuple[Array, Array]:
        s = 1 + b * y**2
        return k * y * s**-0.2, k * s**-1.2 * (1 + 0.6 * b * y**2)

    return Curve(of)


def gap(k: Value, wide: float, off: float, soft: float) -> Curve:
    """Flanks ``wide`` apart, the middle ``off`` beside, that come to bear softly; a seal holds a hundredth."""
    w = max(soft * wide, TINY * 1e-3)

    def of(y: Array) -> tuple[Array, Array]:
        up, down = (y - off - wide / 2) / w, (off - wide / 2 - y) / w
        bears = np.logaddexp(0, up) - np.logaddexp(0, down)
        slope = 0.5 * (2 + np.tanh(up / 2) + np.tanh(down / 2))
        return k * (0.99 * w * bears + 0.01 * y), k * (0.99 * slope + 0.01)

    return Curve(of)


def clamped(k: Value, holds: Value, left: float) -> Curve:
    """A bolted joint: stiff until its clamping force is used up, then ``left`` of the stiffness."""

    def of(y: Array) -> tuple[Array, Array]:
        t = np.tanh(k * y / holds)
        return left * k * y + (1 - left) * holds * t, left * k + (1 - left) * k * (1 - t**2)

    return Curve(of)


@dataclass
class Kelvin(Law):
    """A spring and a chain of Kelvin elements: shares of the spring's turn that come by and by, and go again."""

    k: Value
    shares: Array
    times_s: Array

    def rest(self, came: Array) -> Array:
        return np.zeros((len(came), len(self.shares)))

    def _parts(self, kept: Array, now: Now) -> tuple[Array, Array]:
        stays = np.exp(-now.step_s[:, None] / self.times_s)
        return kept * stays, self.shares * (1 - stays)

    def pull(self, y: Array, kept: Array, now: Now) -> tuple[Array, Array]:
        old, new = self._parts(kept, now)
        k = self.k / (1 + new.sum(axis=1))
        return k * (y - old.sum(axis=1)), k

    def keep(self, y: Array, kept: Array, now: Now) -> Array:
        old, new = self._parts(kept, now)
        return old + new * (self.pull(y, kept, now)[0] / self.k)[:, None]


@dataclass
class Dahl(Law):
    """Bristles: friction that follows the turn like a spring at first and never exceeds ``holds``."""

    holds: float
    bristles: Value

    def rest(self, came: Array) -> Array:
        return np.stack([0 * came, self.holds * came], axis=1)

    def again(self, kept: Array, came: Array) -> Array:
        return np.stack([kept[:, 0], self.holds * came], axis=1)

    def pull(self, y: Array, kept: Array, now: Now) -> tuple[Array, Array]:
        way = np.where(y >= kept[:, 0], 1.0, -1.0)
        left = (kept[:, 1] - way * self.holds) * np.exp(-self.bristles * np.abs(y - kept[:, 0]) / max(self.holds, TINY))
        return way * self.holds + left, -way * left * self.bristles / max(self.holds, TINY)

    def keep(self, y: Array, kept: Array, now: Now) -> Array:
        return np.stack([y, self.pull(y, kept, now)[0]], axis=1)


@dataclass
class Brush(Law):
    """Contacts that stick, let go at their own torques, and stick again with a part of it."""

    holds: Array  # (m,) N m
    stiff: Array  # (m,) N m/rad or (B, m)
    left: float

    def rest(self, came: Array) -> Array:
        return np.asarray(-0.9 * came[:, None] * self.holds / self.stiff)

    def again(self, kept: Array, came: Array) -> Array:
        return self.rest(came)

    def pull(self, y: Array, kept: Array, now: Now) -> tuple[Array, Array]:
        stiff = np.broadcast_to(self.stiff, kept.shape)
        return (stiff * (y[:, None] - kept)).sum(axis=1), stiff.sum(axis=1)

    def snap(self, y: Array, kept: Array) -> Array:
        torque = self.stiff * (y[:, None] - kept)
        goes = np.abs(torque) > self.holds * (1 + TINY)
        return np.where(goes, y[:, None] - np.sign(torque) * self.left * self.holds / self.stiff, kept)


@dataclass
class Clamp(Law):
    """Holds up to a torque, then gives way and stays; from then on it holds what it was last pulled with."""

    holds: Value
    gives: Value  # rad per N m beyond
    lasting: bool = False

    def rest(self, came: Array) -> Array:
        return np.stack([0 * came, np.broadcast_to(np.asarray(self.holds, dtype=float), came.shape)], axis=1)

    def _slips(self, y: Array, kept: Array) -> tuple[Array, Array, Array, Array]:
        """Elastic stiffness, torque if it held, its sign, and by how much it slips."""
        stiff = 60 / np.maximum(np.broadcast_to(np.asarray(self.gives, dtype=float), y.shape), 1e-14)
        torque = stiff * (y - kept[:, 0])
        return stiff, torque, np.sign(torque), np.maximum(np.abs(torque) - kept[:, 1], 0) / (stiff * (1 + 1 / 60))

    def pull(self, y: Array, kept: Array, now: Now) -> tuple[Array, Array]:
        stiff, torque, way, slips = self._slips(y, kept)
        return torque - stiff * slips * way, np.where(slips > 0, stiff / 61, stiff)

    def keep(self, y: Array, kept: Array, now: Now) -> Array:
        stiff, _, way, slips = self._slips(y, kept)
        return np.stack([kept[:, 0] + way * slips, kept[:, 1] + stiff / 60 * slips], axis=1)


@dataclass
class Bingham(Law):
    """A spring behind a brake that flows beyond a torque, and does not come back."""

    k: Value
    holds: float
    flows: Value  # rad/s per N m beyond

    def rest(self, came: Array) -> Array:
        return np.zeros((len(came), 1))

    def again(self, kept: Array, came: Array) -> Array:
        return self.rest(came)

    def _gone(self, y: Array, kept: Array, now: Now) -> tuple[Array, Array]:
        a = self.k * self.flows * now.step_s
        torque = self.k * (y - kept[:, 0])
        return np.sign(torque) * np.maximum(np.abs(torque) - self.holds, 0) / self.k * a / (1 + a), a

    def pull(self, y: Array, kept: Array, now: Now) -> tuple[Array, Array]:
        gone, a = self._gone(y, kept, now)
        return self.k * (y - kept[:, 0] - gone), np.where(gone != 0, self.k / (1 + a), self.k)

    def keep(self, y: Array, kept: Array, now: Now) -> Array:
        return kept + self._gone(y, kept, now)[0][:, None]


@dataclass
class Heated(Law):
    """A spring that softens by the heat of the torque that it held: a motor's current, squared."""

    k: Value
    at: float
    more: float
    time_s: float

    def rest(self, came: Array) -> Array:
        return np.zeros((len(came), 1))

    def pull(self, y: Array, kept: Array, now: Now) -> tuple[Array, Array]:
        k = self.k / (1 + self.more * kept[:, 0])
        return k * y, k

    def keep(self, y: Array, kept: Array, now: Now) -> Array:
        stays = np.exp(-now.step_s / self.time_s)
        # No motor takes more than half again its rating for long.
        heat = np.minimum((self.pull(y, kept, now)[0] / self.at) ** 2, 2.25)
        return (kept[:, 0] * stays + (1 - stays) * heat)[:, None]
