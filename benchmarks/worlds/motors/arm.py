"""Motors (dual quaternions), arms as their description files state them, and laws of springs that remember."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..shared import description, si

Array = NDArray[np.float64]
ONE = np.eye(8)[0]


def _product() -> Array:
    """Of quaternions, w first: (a b)_k = a_i b_j P_ijk."""
    P = np.zeros((4, 4, 4))
    for i in range(4):
        P[0, i, i] = P[i, 0, i] = 1
    P[1:, 1:, 0] -= np.eye(3)
    for i, j, k in ((1, 2, 3), (2, 3, 1), (3, 1, 2)):
        P[i, j, k], P[j, i, k] = 1, -1
    return P


_P = _product().reshape(4, 16)


def _times(a: Array, b: Array) -> Array:
    return np.asarray((b[..., None, :] @ (a @ _P).reshape(*a.shape[:-1], 4, 4))[..., 0, :])


def then(a: Array, b: Array) -> Array:
    """Motion ``b`` in the frame that ``a`` gives."""
    a, b = np.broadcast_arrays(a, b)
    real = _times(a[..., :4], b[..., :4])
    return np.concatenate([real, _times(a[..., :4], b[..., 4:]) + _times(a[..., 4:], b[..., :4])], axis=-1)


def turn(about: Array, through: Array, angle: Array | float) -> Array:
    """About a line of unit direction (3,) through a point (3,), by angles (...) in rad."""
    half = np.asarray(angle, dtype=float)[..., None] / 2
    c, s = np.cos(half), np.sin(half)
    return np.concatenate([c, s * about, 0 * c, s * np.cross(through, about)], axis=-1)


def shift(by: Array) -> Array:
    """By (..., 3) in m."""
    out = np.zeros((*by.shape[:-1], 8))
    out[..., 0], out[..., 5:] = 1, by / 2
    return out


def cross(a: Array, b: Array) -> Array:
    """Of (..., 3), faster than numpy's for small arrays."""
    x, y, z = (a[..., k] for k in range(3))
    u, v, w = (b[..., k] for k in range(3))
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def direct(m: Array, v: Array) -> Array:
    """Directions (..., 3) turned by motors (..., 8)."""
    m, v = np.broadcast_arrays(m, np.concatenate([v, np.zeros((*v.shape[:-1], 5))], axis=-1))
    v, u = v[..., :3], m[..., 1:4]
    t = 2 * cross(u, v)
    return np.asarray(v + m[..., :1] * t + cross(u, t))


def origin(m: Array) -> Array:
    """Where motors (..., 8) bring the origin to: 2 d r*."""
    w, u, dw, du = m[..., :1], m[..., 1:4], m[..., 4:5], m[..., 5:]
    return np.asarray(2 * (w * du - dw * u + cross(u, du)))


def at(m: Array, point: Array) -> Array:
    """Points (..., 3) moved by motors (..., 8)."""
    return direct(m, point) + origin(m)


G = 9.81
# N m/rad: near published values or of the class.
SPRINGS: dict[str, tuple[float, ...]] = {
    "xr701": (1.7e6, 1.4e6, 0.76e6, 1.1e6, 4e5, 2.5e5),
    "kr60-3": (2.1977e6, 0.8994e6, 1.1118e6, 6.44e4, 2.54e4, 2.0e4),
    "tx200": (1.5e6, 1.3e6, 9e5, 2.2e5, 1.4e5, 7e4),
}


@dataclass(frozen=True)
class Casing:
    """A link as a beam: stiffness against bending and torsion, N m2, at its root and its end."""

    name: str
    body: int
    bending: tuple[float, float]
    torsion: tuple[float, float]


@dataclass(frozen=True)
class Arm:
    """A serial arm of n joints. Body 0 is the base, body i hangs behind joint i. m, deg, kg, N."""

    name: str
    joints: tuple[str, ...]
    columns: tuple[str, ...]
    fixed: Array  # (n, 8) from the body before to the joint's frame
    about: Array  # (n, 3) unit
    signs: Array
    offsets: Array
    low: Array
    high: Array
    flange: Array
    tool: Array
    couplings: tuple[tuple[Array, float, float, float], ...]  # factors, offset, lowest, highest
    masses: Array  # (n + 1,) of the bodies
    casings: tuple[Casing, ...]
    payload: float
    pin: Array | None

    @property
    def ends(self) -> Array:
        """Where each body meets what follows, in its own frame (n + 1, 3)."""
        return np.vstack([origin(self.fixed), self.flange])

    @property
    def reach(self) -> float:
        """Of all bodies but the base in a row."""
        return float(np.linalg.norm(self.ends[1:], axis=1).sum())

    @property
    def size(self) -> float:
        """Torques of this arm over those of one of 130 kg, at most a little more."""
        return min(self.payload * self.reach / 3900, 1.2)

    def rad(self, q: Array) -> Array:
        """Turns of the joints' frames at stated angles (..., n) in deg."""
        return np.radians(self.signs * q + self.offsets)

    def allows(self, q: Array) -> NDArray[np.bool_]:
        """Which angles (..., n) are within the limits, coupled ones too."""
        good = np.all((q >= self.low - 1e-9) & (q <= self.high + 1e-9), axis=-1)
        for factors, offset, low, high in self.couplings:
            good &= (offset + q @ factors >= low) & (offset + q @ factors <= high)
        return np.asarray(good)

    def off(self, lengths: Array, zeros: Array) -> Arm:
        """Ends of bodies off by (n + 1, 3) in m, zeros by (n,) in deg."""
        fixed = np.array([then(shift(d), m) for d, m in zip(lengths, self.fixed, strict=False)])
        return replace(self, fixed=fixed, flange=self.flange + lengths[-1], offsets=self.offsets + zeros)

    def lines(self, q: Array) -> tuple[Array, Array, Array]:
        """Points and directions (..., n, 3) of the axes at angles (..., n) in deg, and the flange (..., 8)."""
        here, points, ways = ONE, [], []
        for fixed, about, angle in zip(self.fixed, self.about, np.moveaxis(self.rad(q), -1, 0), strict=True):
            here = then(here, fixed)
            here = then(here, turn(about, np.zeros(3), angle))
            points.append(origin(here))
            ways.append(direct(here, about))
        return np.stack(points, axis=-2), np.stack(ways, axis=-2), then(here, shift(self.flange))

    def levers(self, q: Array, point: Array) -> Array:
        """What a point of the flange frame (..., 3) moves by for 1 rad of each joint, (..., n, 3)."""
        points, ways, flange = self.lines(q)
        tip = origin(then(flange, shift(point)))
        return cross(ways, tip[..., None, :] - points)


def _joint(joint: dict[str, Any]) -> tuple[Array, Array]:
    """Motor to a joint at zero, and its axis there."""
    if "frame" in joint:
        return shift(si(joint["frame"]["xyz"])), np.array(joint["frame"]["axis"], dtype=float)
    alpha, a, d = (float(si(joint["dh"][key])) for key in ("alpha", "a", "d"))
    tilt = then(shift(np.array([a, 0, 0])), turn(np.eye(3)[0], np.zeros(3), np.radians(alpha)))
    return then(tilt, shift(np.array([0, 0, d]))), np.eye(3)[2]


def _beam(section: dict[str, Any], material: dict[str, Any]) -> tuple[float, float]:
    """Of thin walls: bending (mean of both ways) and torsion after Bredt, N m2."""
    E, t = float(si(material["youngs_modulus"])), float(si(section["wall"]))
    shear = E / (2 + 2 * float(si(material["poissons_ratio"])))
    if section["kind"] == "tube":
        r = (float(si(section["diameter"])) - t) / 2
        return E * np.pi * r**3 * t, shear * 2 * np.pi * r**3 * t
    b, h = (float(si(section[side])) - t for side in ("width", "height"))
    both = [t * y**2 * (y + 3 * x) / 6 for x, y in ((b, h), (h, b))]
    return E * sum(both) / 2, shear * 2 * t * (b * h) ** 2 / (b + h)


def _casing(link: dict[str, Any], materials: dict[str, Any], bodies: list[str]) -> Casing:
    made = materials[link["material"]]
    root, end = (_beam(link.get(key, link["section"]), made) for key in ("section", "section_end"))
    return Casing(link["name"], bodies.index(link["body"]), (root[0], end[0]), (root[1], end[1]))


@cache
def load(name: str) -> Arm:
    """One of ``SPRINGS`` by its name."""
    raw = tomllib.loads(description(name))
    joints = raw["joint"]
    columns = tuple(joint["coordinate"] for joint in joints)
    bodies = ["base", *(joint["name"] for joint in joints)]
    frames, axes = zip(*(_joint(joint) for joint in joints), strict=True)
    limits = np.array([si(joint["limits"]) for joint in joints])
    masses = np.zeros(len(bodies))
    for link in raw["link"]:
        masses[bodies.index(link["body"])] += si(link["mass"])
    couplings = []
    for one in raw.get("coupling", []):
        terms = {term["coordinate"]: float(term["factor"]) for term in one["terms"]}
        factors = np.array([terms.get(c, 0.0) for c in columns])
        couplings.append((factors, float(si(one["offset"])), *map(float, si(one["limits"]))))
    return Arm(
        name=name,
        joints=tuple(bodies[1:]),
        columns=columns,
        fixed=np.array(frames),
        about=np.array(axes),
        signs=np.array([joint.get("sign", 1) for joint in joints], dtype=float),
        offsets=np.array([si(joint["offset"]) if "offset" in joint else 0.0 for joint in joints]),
        low=limits[:, 0],
        high=limits[:, 1],
        flange=si(raw["flange"]["xyz"]),
        tool=si(raw["tool"]["xyz"]) if "tool" in raw else np.zeros(3),
        couplings=tuple(couplings),
        masses=masses,
        casings=tuple(_casing(link, raw["materials"], bodies) for link in raw["link"]),
        payload=G * float(si(raw["payload"])),
        pin=si(raw["parallelogram"]["pin"]) if "parallelogram" in raw else None,
    )


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
