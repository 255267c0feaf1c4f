"""What a set is made from, all of it in its key, and what a row of the tables of laws says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arms import Arm, load
from .motors import origin
from .statics import Machine

Array = NDArray[np.float64]
Rng = np.random.Generator
Numbers = dict[str, Any]


@dataclass(frozen=True)
class Effect:
    """A law by its family, where it acts, and its numbers; with ``size`` 0 it is not there."""

    family: str
    place: str
    numbers: Numbers


@dataclass(frozen=True)
class Spec:
    """One set. Lengths in m, loads in N, springs in N m/rad; a stated spring of 0 is a rigid joint."""

    seed: int
    kind: str
    arm: str
    path: str
    springs: tuple[float, ...]
    stated: tuple[float, ...]
    reads: str
    poses: int
    grid: bool
    loads: tuple[float, ...]
    down: bool
    repeats: int
    second: tuple[float, ...]  # direction of every other set-up's load; none: all go down
    sessions: int
    columns: tuple[str, ...]
    scatter: float  # of each spring from set-up to set-up
    outliers: bool
    noise: Numbers
    balance: float  # share of the weights' torques that is balanced
    away: bool  # the arm goes away and comes back between two cycles
    air: Numbers  # how the hall warms up in a session
    point: tuple[float, ...]  # loaded and read in the flange frame; none: the model's tool point
    effects: tuple[Effect, ...] = ()

    @property
    def of(self) -> Arm:
        """The arm as it is stated."""
        return load(self.arm)

    @property
    def loaded(self) -> Array:
        """The point (3,) in the flange frame."""
        return np.array(self.point) if self.point else self.of.tool

    @property
    def axes(self) -> list[int]:
        """Components that are read."""
        return [2] if self.reads == "z" else [0, 1, 2]

    def rng(self, *what: int) -> Rng:
        """Chance that goes by the set and by what it is asked for."""
        return np.random.default_rng([self.seed, *what])

    def text(self) -> Numbers:
        """As JSON takes it."""
        return asdict(self)


def from_text(raw: Numbers) -> Spec:
    """A set as ``Spec.text`` gave it, through JSON or not."""
    given = {key: tuple(value) if isinstance(value, list) else value for key, value in raw.items()}
    return Spec(**given | {"effects": tuple(Effect(**one) for one in raw["effects"])})


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
class Way:
    """A direction; level: a horizontal one."""

    level: bool = False

    def draw(self, rng: Rng, scene: Scene, place: str) -> list[float]:
        """One."""
        v = rng.normal(size=3) * ([1, 1, 0] if self.level else [1, 1, 1])
        return [float(x) for x in v / np.linalg.norm(v)]


@dataclass(frozen=True)
class Pick:
    """Anything that a function draws."""

    of: Callable[[Rng, Scene, str], Any]

    def draw(self, rng: Rng, scene: Scene, place: str) -> Any:
        """One."""
        return self.of(rng, scene, place)


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
    sizes: dict[str, Range | Way | Pick]
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
