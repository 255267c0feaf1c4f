"""The arm at one pose as a frame, what a law may change of it, and what happens to it while it stands there."""

from __future__ import annotations

import atexit
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..shared import Effect
from .arm import GRAVITY, Arm, Deck, Material, Row, Section, Spec, Stand, load, turns

Array = NDArray[np.float64]
X, Y = np.array([1.0, 0, 0]), np.array([0.0, 1, 0])
DOWN = np.array([0.0, 0, -1])


@dataclass
class Joint:
    """What stands in a joint: a law about its axis, others across it, and more hinges in a row behind it."""

    stiffness: float
    law: Callable[[float], Material] | None = None
    bearing: dict[int, Material] = field(default_factory=dict)
    behind: list[dict[int, Material]] = field(default_factory=list)

    def materials(self) -> dict[int, Material]:
        """By direction; 4 is about the axis."""
        law = self.law(self.stiffness) if self.law else ("Elastic", self.stiffness)
        return {4: law, **self.bearing}


@dataclass
class Nodes:
    """Tags by place."""

    ground: int = 0
    base: int = 0
    before: list[int] = field(default_factory=list)
    after: list[int] = field(default_factory=list)
    flange: int = 0
    tip: int = 0


@dataclass
class Plan:
    """What is to be built; effects change it before ``build``."""

    arm: Arm
    stand: Stand
    joints: list[Joint]
    turn: Array  # (n,) rad, of each joint from its frame's zero
    point: Array  # loaded and read, flange frame
    path: str = "serial"
    bar: float = 1e14  # N/m, the parallelogram's
    share: float = 1.0  # of the third joint's stiffness that is in the parallelogram's crank, the rest in the elbow
    beams: dict[int, Section] = field(default_factory=dict)  # by body; 0 is the base
    base: list[dict[int, Material]] = field(default_factory=list)  # in a row, base axes
    tool: list[dict[int, Material]] = field(default_factory=list)  # in a row, flange axes
    mount: Callable[[Deck, int], int] | None = None  # from the ground to the base
    beside: list[Callable[[Deck, Nodes], None]] = field(default_factory=list)
    split: dict[int, dict[int, Material]] = field(default_factory=dict)  # a hinge half way along a body
    press: float = 0.0  # N, that bolts press the base down with
    balance: float = 0.0  # share of the weights' torques that is balanced
    came: dict[int, float] = field(default_factory=dict)  # torque about a joint with which the pose was come to


def body_masses(arm: Arm) -> list[float]:
    """Of the base and behind each joint, kg."""
    return [arm.masses.get(body, 0.0) for body in ("base", *arm.joints)]


def weight_torques(plan: Plan) -> Array:
    """About each joint (n,) by all that hangs behind it, N m."""
    s, n = plan.stand, len(plan.joints)
    ends = np.vstack([s.origins[1:], s.flange])
    masses = np.array(body_masses(plan.arm)[1:])
    out = np.zeros(n)
    for i in range(n):
        middle = (s.origins[i:] + ends[i:]) / 2 - s.origins[i]
        out[i] = s.axes[i] @ np.cross(middle, masses[i:, None] * GRAVITY * DOWN).sum(axis=0)
    return out


def _body(deck: Deck, plan: Plan, i: int, start: int, end: Array) -> int:
    """The beam of body ``i`` from a node to a place, in halves where a hinge is in it."""
    if i not in plan.split:
        return deck.reach(start, end, plan.beams.get(i))
    half = deck.reach(start, (deck.at(start) + end) / 2, plan.beams.get(i))
    way = end - deck.at(start)
    x = way / np.linalg.norm(way)
    y = plan.stand.axes[i - 1] if abs(plan.stand.axes[i - 1] @ x) < 0.9 else np.eye(3)[int(np.argmin(np.abs(x)))]
    return deck.reach(deck.hinge(half, plan.split[i], x, y), end, plan.beams.get(i))


def _crank(deck: Deck, plan: Plan, nodes: Nodes, about: Callable[[float], Material]) -> None:
    """The parallelogram: a crank about the second axis that the third drive turns, a bar to the forearm's pin."""
    s = plan.stand
    assert plan.arm.pin is not None
    pin = s.turned[2] @ plan.arm.pin
    drive = plan.joints[2].stiffness
    turn = deck.hinge(nodes.before[1], {4: about(plan.share * drive)}, s.axes[1], s.across[1])
    deck.bar(deck.reach(turn, deck.at(turn) + pin), deck.reach(nodes.after[2], s.origins[2] + pin), plan.bar)


def build(plan: Plan) -> tuple[Deck, Nodes]:
    """The frame, from the ground to the tool."""
    deck, nodes, s = Deck(), Nodes(), plan.stand
    here = nodes.ground = deck.node(np.zeros(3))
    deck.fix(here)
    if plan.mount:
        here = plan.mount(deck, here)
    for hinge in plan.base:
        here = deck.hinge(here, hinge, X, Y)
    nodes.base = here
    for i, joint in enumerate(plan.joints):
        here = _body(deck, plan, i, here, s.origins[i])
        nodes.before.append(here)
        materials = joint.materials()
        if i == 2 and plan.path == "parallelogram":
            materials[4] = ("Elastic", max((1 - plan.share) * joint.stiffness, 1e-3))
        here = deck.hinge(here, materials, s.axes[i], s.across[i])
        for more in joint.behind:
            here = deck.hinge(here, more, s.axes[i], s.across[i])
        nodes.after.append(here)
    if plan.path == "parallelogram":
        _crank(deck, plan, nodes, plan.joints[2].law or (lambda k: ("Elastic", k)))
    here = nodes.flange = _body(deck, plan, len(plan.joints), here, s.flange)
    for hinge in plan.tool:
        here = deck.hinge(here, hinge, s.turned[-1] @ X, s.turned[-1] @ Y)
    nodes.tip = deck.reach(here, s.flange + s.turned[-1] @ plan.point)
    for add in plan.beside:
        add(deck, nodes)
    return deck, nodes


def weights(plan: Plan, nodes: Nodes) -> list[list[float]]:
    """Loads of dead weight: half of each body at each of its ends, and what balances them about the joints."""
    masses = body_masses(plan.arm)
    starts, ends = [nodes.base, *nodes.after], [*nodes.before, nodes.flange]
    out = [
        [node, *(0.5 * mass * GRAVITY * DOWN), 0.0, 0.0, 0.0]
        for start, end, mass in zip(starts, ends, masses, strict=True)
        for node in (start, end)
    ]
    out.append([nodes.base, *(plan.press * DOWN), 0.0, 0.0, 0.0])
    for i, torque in enumerate(weight_torques(plan) * plan.balance):
        out += couple(plan, nodes, i, -float(torque))
    return [[int(node), *map(float, load)] for node, *load in out]


def couple(plan: Plan, nodes: Nodes, i: int, torque: float) -> list[list[float]]:
    """A torque about joint ``i``: on the body behind it, and back on the one before."""
    axis = plan.stand.axes[i]
    return [
        [node, 0.0, 0.0, 0.0, *map(float, sign * torque * axis)]
        for node, sign in ((nodes.after[i], 1), (nodes.before[i], -1))
    ]


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
    axes: tuple[str, ...] = ("pose",)
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


ON = 4.0  # s, weights and the way there, before the arm is left to settle
PUT = 8.0  # s, to put a load on or to take one off


@dataclass(frozen=True)
class Event:
    """A force and a moment (6,) at the point from a time on; ``read``: its end is read, when the next load comes."""

    at_s: float
    until_s: float
    wrench: Array
    read: bool


def _legs(deck: Deck, start: float, events: list[Event], came: bool) -> list[list[Any]]:
    """Ends of legs in s, steps, whether to read: weights, the way there and back, settling, then every event."""
    put = 1 if deck.linear else 2 if deck.forgets else 4 if deck.viscous else 10
    hold = 6 if deck.viscous else 1
    legs: list[list[Any]] = [[1.0, 2 * put, False], [2.5, put if came else 1, False], [ON, put if came else 1, False]]
    legs.append([start, 3 * hold, False])
    for event in events:
        legs.append([start + event.at_s + PUT, put, False])
        legs.append([start + event.until_s, hold, event.read])
    return legs


def _wrenches(nodes: Nodes, start: float, events: list[Event]) -> list[dict[str, Any]]:
    """A pattern for each of the six components that is there."""
    times, values = [0.0, start], [np.zeros(6), np.zeros(6)]
    for event in events:
        begin = start + event.at_s
        times += [max(begin, times[-1] + 1e-3), begin + PUT]
        values += [values[-1], event.wrench]
    table = np.array(values)
    return [
        {"times": times, "values": table[:, k].tolist(), "loads": [[nodes.tip, *np.eye(6)[k].tolist()]]}
        for k in range(6)
        if np.any(table[:, k])
    ]


def run(plan: Plan, deck: Deck, nodes: Nodes, events: list[Event], settle_s: float) -> Array:
    """Displacements (n, 6) of the point at the ends of the events that are read, since weights came on."""
    if not deck.forgets:
        return _run(plan, deck, nodes, events, settle_s)
    loads = [event.wrench for event in events if event.read]
    different, which = np.unique(loads, axis=0, return_inverse=True)
    once = [Event(20.0 * i, 20.0 * i + 15.0, wrench, True) for i, wrench in enumerate(different)]
    return _run(plan, deck, nodes, once, settle_s)[which.ravel()]


def _run(plan: Plan, deck: Deck, nodes: Nodes, events: list[Event], settle_s: float) -> Array:
    start = ON + settle_s
    patterns = [{"times": [0.0, 1.0], "values": [0.0, 1.0], "loads": weights(plan, nodes)}]
    patterns += [
        {"times": [0.0, 1.0, 2.5, ON], "values": [0.0, 0.0, 1.0, 0.0], "loads": couple(plan, nodes, i, torque)}
        for i, torque in plan.came.items()
    ]
    patterns += _wrenches(nodes, start, events)
    legs = _legs(deck, start, events, bool(plan.came))
    return solver().run({"deck": deck.commands, "patterns": patterns, "legs": legs, "node": nodes.tip})


class Solver:
    """One process of OpenSees; tasks go in one by one."""

    def __init__(self) -> None:
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and file
            [sys.executable, str(Path(__file__).with_name("worker.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            text=True,
            env={**os.environ, "OMP_NUM_THREADS": "1"},  # Frames are small: threads would only wait for one another.
        )

    def run(self, task: dict[str, Any]) -> Array:
        """Displacements (n, 6) in m and rad at the legs to be read. RuntimeError: no solution, or no OpenSees here."""
        assert self._process.stdin
        assert self._process.stdout
        try:
            self._process.stdin.write(json.dumps(task) + "\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            self._said.seek(0)
            raise RuntimeError(f"OpenSees does not run: {self._said.read().decode(errors='replace')[-800:]}")
        answer = json.loads(line)
        if "error" in answer:
            raise RuntimeError(answer["error"])
        return np.array(answer["found"], dtype=float).reshape(-1, 6)

    def close(self) -> None:
        """End the process."""
        if self._process.stdin:
            self._process.stdin.close()
        self._process.wait(timeout=20)
        if self._process.stdout:
            self._process.stdout.close()
        self._said.close()


@cache
def solver() -> Solver:
    """The one that is shared; it ends with our process."""
    one = Solver()
    atexit.register(one.close)
    return one
