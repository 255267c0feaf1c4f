"""An arm at rest under loads, what a set is made from, and what a row of the tables of laws says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import shared
from ..shared import Effect, direction
from .arm import ONE, Arm, G, Law, Now, Spring, at, cross, direct, load, origin, shift, then, turn

Array = NDArray[np.float64]
Air = dict[str, float]
STIFF = 1e13
ROUNDS, LET_GO = 80, 40


@dataclass(frozen=True)
class Freedom:
    """A turn about, or a slide along, a line that is fixed to a body; none of both has no body (-1)."""

    body: int
    through: Array = field(default_factory=lambda: np.zeros(3))
    way: Array = field(default_factory=lambda: np.zeros(3))
    slides: bool = False


@dataclass
class Part:
    """A law over a sum of unknowns."""

    over: dict[int, float]
    law: Law


@dataclass(frozen=True)
class Shape:
    """Where everything is: lines of the unknowns (B, N, 3), motors of the bodies (B, n + 1, 8)."""

    points: Array
    ways: Array
    bodies: Array


@dataclass(frozen=True)
class Pull:
    """Dead load in base axes and where it acts in the frame behind everything: all (B, 3)."""

    force: Array
    moment: Array
    point: Array


class Machine:
    """An arm at B poses, as effects change it; joint i is unknown i and part i."""

    def __init__(self, arm: Arm, q: Array, springs: Array, path: str, balance: float, air: Air, bent: bool) -> None:
        """Angles (B, n) in deg, springs (B, n) in N m/rad; ``air``: how the hall warms up."""
        n = len(arm.joints)
        self.arm, self.q, self.turned, self.bent, self.balance, self.air = arm, q, arm.rad(q), bent, balance, air
        self.freedoms = [Freedom(i + 1, way=arm.about[i]) for i in range(n)]
        self.parts = [Part({i: 1.0}, Spring(springs[:, i].copy())) for i in range(n)]
        if path == "parallelogram":
            self.parts[2].over[1] = 1.0  # The third drive turns the forearm against the carousel.
        self.spring = springs

    def free(self, body: int, through: Array, way: Array, law: Law, slides: bool = False) -> int:
        """Something on a body gives way, in its frame."""
        return self._part(Freedom(body, through, way / np.linalg.norm(way), slides), law)

    def behind(self, part: int, law: Law) -> int:
        """Something gives way in a row with a part."""
        i = self._part(Freedom(-1), law)
        self.parts[part].over[i] = -1.0
        return i

    def _part(self, freedom: Freedom, law: Law) -> int:
        self.freedoms.append(freedom)
        self.beside({len(self.freedoms) - 1: 1.0}, law)
        return len(self.freedoms) - 1

    def along(self, part: int) -> dict[int, float]:
        """What a joint's drive turns, without what gives way behind it."""
        return {i: by for i, by in self.parts[part].over.items() if self.freedoms[i].body >= 0}

    def beside(self, over: dict[int, float], law: Law) -> None:
        """Something more holds."""
        self.parts.append(Part(dict(over), law))

    def divide(self, share: float) -> None:
        """The third drive holds the forearm by the crank with a share of its stiffness, by the elbow with the rest."""
        k = self.spring[:, 2]
        self.parts[2] = Part({2: 1.0}, Spring((1 - share) * k))
        self.beside({1: 1.0, 2: 1.0}, Spring(share * k))

    def close(self) -> None:
        """After all effects: lines, first shape, weights."""
        N = len(self.freedoms)
        self.sums = np.array([[part.over.get(i, 0.0) for i in range(N)] for part in self.parts])
        self.body = np.array([f.body for f in self.freedoms])
        self.turns = np.array([f.body >= 0 and not f.slides for f in self.freedoms])
        order = sorted(range(N), key=lambda i: (self.body[i], i))
        rank = np.empty(N, dtype=int)
        rank[order] = np.arange(N)
        self.upstream = rank[:, None] <= rank[None, :]
        self.middles = self.arm.ends / 2
        held_by = np.append(np.arange(len(self.middles)), len(self.middles) - 1)
        self.carried = (self.body >= 0) & (self.body <= held_by[:, None])  # (bodies and tip, N)
        full = np.outer(self.arm.masses * G, [0, 0, -1.0])
        # Balancers follow the arm and carry a share of it; what stands beneath the arm still bears all.
        self.weight = (1 - self.balance) * full
        self.first = self.shape(np.zeros((len(self.q), N)))
        lever = self._levers(self.first, np.zeros((len(self.q), 3)))[:, :-1]
        self.held = self.balance * np.einsum("pc,bpnc->bn", full, lever) * (np.arange(N) >= len(self.arm.joints))

    def shape(self, x: Array) -> Shape:
        """At unknowns (B, N)."""
        B, n = len(self.q), len(self.arm.joints)
        points, ways = np.zeros((B, len(self.freedoms), 3)), np.zeros((B, len(self.freedoms), 3))
        here, bodies = np.tile(ONE, (B, 1)), []

        def place(i: int, f: Freedom, by: Array) -> Array:
            points[:, i], ways[:, i] = at(here, f.through), direct(here, f.way)
            return then(here, shift(by[:, None] * f.way) if f.slides else turn(f.way, f.through, by))

        for body in range(n + 1):
            if body:
                here = then(here, self.arm.fixed[body - 1])
                here = place(body - 1, self.freedoms[body - 1], self.turned[:, body - 1] + x[:, body - 1])
            for i, f in enumerate(self.freedoms):
                if i >= n and f.body == body:
                    here = place(i, f, x[:, i])
            bodies.append(here)
        return Shape(points, ways, np.stack(bodies, axis=1))

    def tip(self, shape: Shape, point: Array) -> Array:
        """Where a point (B, 3) behind the flange is."""
        return origin(then(shape.bodies[:, -1], shift(self.arm.flange + point)))

    def _levers(self, s: Shape, point: Array) -> Array:
        """What bodies' middles and the point move by for each unknown, (B, n + 2, N, 3)."""
        places = np.concatenate([at(s.bodies, self.middles[None]), self.tip(s, point)[:, None]], axis=1)
        arms = places[:, :, None] - s.points[:, None]
        ways = np.broadcast_to(s.ways[:, None], arms.shape)
        moves = np.where(self.turns[:, None], cross(ways, arms), ways)
        return np.asarray(moves * self.carried[:, :, None])

    def lever(self, point: Array) -> Array:
        """What the point moves by for each unknown, undeformed, (B, N, 3)."""
        return self._levers(self.first, point)[:, -1]

    def work(self, x: Array, pull: Pull) -> tuple[Array, Array]:
        """Slope (B, N) of what dead forces do, and how it changes (B, N, N)."""
        s = self.shape(x) if self.bent else self.first
        J = self._levers(s, pull.point)
        F = np.concatenate([np.broadcast_to(self.weight, (len(x), *self.weight.shape)), pull.force[:, None]], axis=1)
        slope = np.einsum("bpc,bpnc->bn", F, J) + self.held
        slope = slope + np.einsum("bc,bnc->bn", pull.moment, s.ways * self.turns[:, None])
        if not self.bent:
            return slope, np.zeros((len(x), x.shape[1], x.shape[1]))
        # Along a chain the lever of a later unknown turns about the line of an earlier one.
        turned = cross(F[:, :, None], s.ways[:, None]) * (self.carried & self.turns)[..., None]
        bend = np.einsum("bpkc,bplc->bkl", turned, J)
        return slope, np.where(self.upstream, bend, np.swapaxes(bend, 1, 2))

    def parts_pull(self, x: Array, kept: list[Array], now: Now) -> tuple[Array, Array]:
        """Torque and stiffness of all parts (B, P)."""
        y = x @ self.sums.T
        found = [part.law.pull(y[:, p], kept[p], now) for p, part in enumerate(self.parts)]
        return np.stack([f[0] for f in found], axis=1), np.stack([f[1] for f in found], axis=1)

    def rest(self, x: Array, pull: Pull, kept: list[Array], now: Now) -> tuple[Array, list[Array]]:
        """Shape of least energy near ``x`` (B, N), and memories where something let go. RuntimeError: none found."""
        for _ in range(LET_GO):
            x = self._least(x, pull, kept, now)
            y = x @ self.sums.T
            after = [part.law.snap(y[:, p], kept[p]) for p, part in enumerate(self.parts)]
            if all(a is b or np.array_equal(a, b) for a, b in zip(after, kept, strict=True)):
                return x, kept
            kept = after
        return x, kept

    def _least(self, x: Array, pull: Pull, kept: list[Array], now: Now) -> Array:
        """Newton's way, halved wherever what is out of balance would grow."""
        P, scale = self.sums, None
        work = self.work(x, pull)
        for _ in range(ROUNDS):
            torque, stiff = self.parts_pull(x, kept, now)
            out = torque @ P - work[0]
            H = np.einsum("bp,pi,pj->bij", stiff, P, P) - work[1]
            scale = 1 / np.sqrt(np.abs(np.einsum("bii->bi", H))) if scale is None else scale
            step = -scale * np.linalg.solve(H * scale[:, :, None] * scale[:, None], (out * scale)[..., None])[..., 0]
            if np.all(np.abs(step) < 1e-13 + 1e-11 * np.abs(x).max()):
                return np.asarray(x + step)
            size, part = np.linalg.norm(out * scale, axis=1), np.ones(len(x))
            for _ in range(14):
                work = self.work(x + part[:, None] * step, pull) if self.bent else work
                after = self.parts_pull(x + part[:, None] * step, kept, now)[0] @ P - work[0]
                worse = np.linalg.norm(after * scale, axis=1) > size * (1 - 1e-4 * part) + 1e-9
                if not np.any(worse):
                    break
                part = np.where(worse, part / 2, part)
            x = x + part[:, None] * step
        raise RuntimeError("no equilibrium")


Rng = np.random.Generator
Numbers = dict[str, Any]


@dataclass(frozen=True)
class Spec(shared.Spec):
    """One set of this world. Lengths in m."""

    away: bool  # the arm goes away and comes back between two cycles
    air: Numbers  # how the hall warms up in a session
    point: tuple[float, ...]  # loaded and read in the flange frame; none: the model's tool point

    @property
    def of(self) -> Arm:
        """The arm as it is stated."""
        return load(self.arm)

    @property
    def loaded(self) -> Array:
        """The point (3,) in the flange frame."""
        return np.array(self.point) if self.point else self.of.tool


@dataclass
class Case:
    """Readings of V set-ups, K each: all that laws of loads and gauges go by. Laws may change what is pulled and read.

    Arrays are (V, K) or (V, K, 3); seconds since the first reading, the session's start, putting the load on.
    """

    time_s: Array
    since_s: Array
    hold_s: Array
    zero_s: Array
    cycle: NDArray[np.int_]
    up: NDArray[np.bool_]
    stated: Array  # size of the load
    force: Array
    moment: Array
    load_at: Array
    read_at: Array
    air: Numbers
    machine: Machine | None = None


def air(n: Numbers, since_s: Array) -> Array:
    """How warm the hall is at seconds since a session's start, about 1 in the end."""
    return np.asarray(1 + n["swing"] * np.sin(2 * np.pi * since_s / n["period_s"] + n["phase"]))


def follows(n: Numbers, since_s: Array, lag_s: float) -> Array:
    """How warm something is that was cold and follows the hall by a lag of first order."""
    w, t = 2 * np.pi / n["period_s"], np.maximum(since_s, 0)
    late, gone = np.arctan(w * lag_s), np.exp(-t / lag_s)
    wave = np.sin(w * t + n["phase"] - late) - np.sin(n["phase"] - late) * gone
    return np.asarray(1 - gone + n["swing"] * np.cos(late) * wave)


@dataclass(frozen=True)
class Scene:
    """What sizes are drawn by: a set without effects, and how long its longest session takes."""

    spec: Spec
    span_s: float

    @property
    def arm(self) -> Arm:
        """As stated."""
        return self.spec.of

    def unit(self, of: str, place: str) -> float:
        """One of what a number is a multiple of."""
        force = max(self.spec.loads)
        match of:
            case "":
                return 1.0
            case "force":
                return force
            case "span":
                return self.span_s
            case "arm":
                return self.arm.size
            case "payload":
                return self.arm.payload / 1300
            case "moment":
                return 0.5 * force * self.arm.reach
            case "weight":
                return 0.2 * float(self.arm.masses.sum()) * 9.81 * self.arm.reach + 0.5 * force * self.arm.reach
        i = self.arm.joints.index(place)
        torque = force * self.levers[i]
        return float({"torque": torque, "spring": self.spec.springs[i], "turn": torque / self.spec.springs[i]}[of])

    @cached_property
    def levers(self) -> Array:
        """Of each drive under a weight."""
        return levers(self.spec.arm, self.spec.path)

    def joint(self, rng: Rng, among: tuple[str, ...] = ()) -> str:
        """One that moves the point, mostly."""
        share = self.levers / np.sqrt(np.array(self.spec.springs))
        share = share * [not among or j in among for j in self.arm.joints]
        return str(rng.choice(self.arm.joints, p=share / share.sum()))


@dataclass(frozen=True)
class Range:
    """A number between two, times a unit of the scene."""

    low: float
    high: float
    of: str = ""
    log: bool = False
    signed: bool = False

    def draw(self, rng: Rng, scene: Scene, place: str) -> float:
        """One."""
        one = np.exp(rng.uniform(np.log(self.low), np.log(self.high))) if self.log else rng.uniform(self.low, self.high)
        return float(one * scene.unit(self.of, place) * (rng.choice([-1, 1]) if self.signed else 1))


@dataclass(frozen=True)
class Pick:
    """Anything that a function draws."""

    of: Callable[[Rng, Scene, str], Any]

    def draw(self, rng: Rng, scene: Scene, place: str) -> Any:
        """One."""
        return self.of(rng, scene, place)


ANYWHERE = Pick(lambda rng, scene, place: direction(rng))
LEVEL = Pick(lambda rng, scene, place: direction(rng, flat=True))
ANGLE = Range(-np.pi, np.pi)
Acts = Callable[[Machine, Numbers, str], None]


@dataclass(frozen=True)
class Row:
    """A family: where it acts, its sizes, and what it changes of angles, arm, loads or readings.

    ``where``: names of places to choose from, "joint" for some joint, or a function. ``needs``: of history, levels,
    clock, pins (the parallelogram's), both (load paths), poised (weights that are balanced).
    """

    family: str
    axis: str
    where: str | Callable[[Rng, Scene], str]
    sizes: dict[str, Range | Pick]
    build: Acts | None = None
    load: Callable[[Case, Numbers], None] | None = None
    read: Callable[[Case, Numbers, Array, str], Array] | None = None
    angles: Callable[[Array, Numbers, int], Array] | None = None
    bare: bool = False
    needs: frozenset[str] = field(default_factory=frozenset)
    rigid: bool = False  # the model holds the joint rigid

    @property
    def axes(self) -> list[str]:
        """What it varies with."""
        return self.axis.split(", ")

    @property
    def spot(self) -> str:
        """The one place where it acts, if there is but one."""
        one = self.where if isinstance(self.where, str) else ""
        return one if one not in ("", "joint") and " " not in one else ""

    def code(self, place: str) -> str:
        """As a key says it."""
        return self.family if self.bare else f"{self.family}:{place}"

    def effect(self, rng: Rng, scene: Scene) -> Effect:
        """One of the family."""
        if callable(self.where):
            place = self.where(rng, scene)
        elif self.where == "joint":
            place = scene.joint(rng)
        elif all(name in scene.arm.joints for name in self.where.split()):
            place = scene.joint(rng, tuple(self.where.split()))
        else:
            place = str(rng.choice(self.where.split()))
        numbers: Numbers = {name: size.draw(rng, scene, place) for name, size in self.sizes.items()}
        return Effect(self.family, place, numbers.pop("", {}) | numbers)


def usable(arm: Arm, q: Array) -> NDArray[np.bool_]:
    """Which angles (..., n) somebody would hang a weight at: allowed, above the floor, away from the column."""
    points, _, flange = arm.lines(q)
    tip = origin(flange)
    out = np.hypot(tip[..., 0], tip[..., 1])
    low = np.minimum(points[..., 2:, 2].min(axis=-1), tip[..., 2])
    return np.asarray(arm.allows(q) & (low > 0.12 * arm.reach) & (out > 0.28 * arm.reach))


def anywhere(rng: Rng, arm: Arm, count: int) -> Array:
    """Angles (count, n) in deg within the limits, but for the last turns of long ones."""
    middle, half = (arm.high + arm.low) / 2, (arm.high - arm.low) / 2
    return np.asarray(middle + np.minimum(0.95 * half, 160.0) * rng.uniform(-1, 1, (count, len(middle))))


@cache
def levers(name: str, path: str) -> Array:
    """Of each drive under a weight, root of the mean square over poses, and a little, m (n,)."""
    arm = load(name)
    q = anywhere(np.random.default_rng(17), arm, 4000)
    z = arm.levers(q[usable(arm, q)], arm.tool)[..., 2]
    if path == "parallelogram":
        z[:, 1] -= z[:, 2]
    return np.asarray(np.sqrt(np.mean(z**2, axis=0)) + 0.02)
