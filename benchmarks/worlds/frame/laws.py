"""What a law is: where it can act, how large it is drawn, and what it changes on the way to a reading."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arms import Arm, load, turns
from .plan import Plan
from .spec import Effect, Row, Spec

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """What sizes are drawn by: the arm, its largest load, when readings are taken and how long a session takes."""

    spec: Spec
    duration_s: float
    times_s: tuple[float, ...]

    @property
    def arm(self) -> Arm:
        """As stated."""
        return self.spec.of

    @property
    def force(self) -> float:
        """Largest load, N."""
        return max(self.spec.loads)

    def torque(self, joint: str) -> float:
        """What the largest load brings about a joint, typically, N m."""
        return self.force * lever_arms(self.spec.arm)[self.arm.index(joint)]

    def spring(self, joint: str) -> float:
        """Its true stiffness."""
        return self.spec.springs[self.arm.index(joint)]

    def some_joint(self, rng: np.random.Generator, among: tuple[str, ...] = ()) -> str:
        """One of those that move the point most, mostly: there an arm is looked at first."""
        arm = self.arm
        share = lever_arms(self.spec.arm) ** 2 / np.array(self.spec.springs)
        weights = np.array(
            [np.sqrt(s) if not among or name in among else 0 for name, s in zip(arm.joints, share, strict=True)]
        )
        return str(rng.choice(arm.joints, p=weights / weights.sum()))


@dataclass(frozen=True)
class Moment:
    """When the arm stands at a pose: seconds since the first reading and since the session began."""

    visit: int
    time_s: float
    session: int
    since_s: float
    came: float  # -1 or 1: from which side


class Law:
    """Defaults change nothing. Subclasses say what a family does in their own words."""

    family = ""
    axis: tuple[str, ...] = ("pose",)
    bare = False  # the code has no place
    spot = ""  # the one place where it acts, if there is but one
    by_clock = False
    by_session = False
    arms: tuple[str, ...] = ()
    path = "serial"
    angles = False  # another convention of angles: poses must be allowed either way

    def code(self, place: str) -> str:
        """As a key says it."""
        return self.family if self.bare else f"{self.family}:{place}"

    def place(self, rng: np.random.Generator, scene: Scene) -> str:
        """Where it acts: some joint by default."""
        return self.spot or scene.some_joint(rng)

    def draw(self, rng: np.random.Generator, scene: Scene, place: str) -> dict[str, Any]:
        """Its numbers."""
        raise NotImplementedError

    def rigid(self, place: str) -> tuple[str, ...]:
        """Joints that the model holds rigid."""
        return ()

    def true_angles(self, e: Effect, arm: Arm, q: Array) -> Array:
        """Angles (n,) in deg that a table's stand for."""
        return q

    def pull(self, e: Effect, row: Row, force: Array, load_at: Array, read_at: Array) -> tuple[Array, Array, Array]:
        """The force in base axes, and where it acts and what is read, in the flange frame."""
        return force, load_at, read_at

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        """The frame before it is built."""

    def read(self, e: Effect, rows: list[Row], moved: Array) -> Array:
        """What the gauge says (n, 3) of a cycle's rows, of how the point moved, m."""
        return moved


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Between two positive numbers."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def sign(rng: np.random.Generator) -> float:
    """-1 or 1."""
    return float(rng.choice([-1.0, 1.0]))


def unit(rng: np.random.Generator, flat: bool = False) -> list[float]:
    """A direction; flat: a horizontal one."""
    v = rng.normal(size=3) * ([1, 1, 0] if flat else [1, 1, 1])
    return [float(x) for x in v / np.linalg.norm(v)]


def usable(arm: Arm, q: Array) -> bool:
    """Whether a pose is allowed, and one that somebody would hang a weight on."""
    if not arm.allows(q):
        return False
    s = arm.stand(q)
    heights = np.append(s.origins[2:, 2], s.flange[2])
    out = float(np.hypot(*s.flange[:2]))
    return bool(heights.min() > 0.1 * arm.reach and out > 0.25 * arm.reach)


def some_pose(rng: np.random.Generator, arm: Arm) -> Array:
    """Anywhere in the limits, but for the last turns of long ones, (n,) deg."""
    middle, half = (arm.high + arm.low) / 2, (arm.high - arm.low) / 2
    return middle + np.minimum(0.94 * half, 150.0) * rng.uniform(-1, 1, len(middle))


@cache
def lever_arms(name: str) -> Array:
    """Of each joint under a weight, root of the mean square over poses, m (n,)."""
    arm, rng, levers = load(name), np.random.default_rng(11), []
    while len(levers) < 60:
        q = some_pose(rng, arm)
        if usable(arm, q):
            levers.append(turns(arm, arm.stand(q), arm.tool)[0][:, 2])
    return np.sqrt(np.mean(np.square(levers), axis=0)) + 0.02
