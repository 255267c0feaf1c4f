"""The arm at one pose as a frame: springs in its joints, beams between them, what effects put in or beside them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .arms import GRAVITY, Arm, Section, Stand
from .deck import Deck, Material

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
