"""What can be free in a model of absolute readings, by name, and where it stands among the variables.

Names: ``JOINT.frame.x|y|z`` (mm) and ``JOINT.frame.rx|ry`` (deg), errors of a joint's frame in its own axes (z along
its axis), which are the errors of DH parameters without their singularity where axes are parallel; ``JOINT.zero``
(deg); ``JOINT.ratio``, by how much more the joint turns than it says; ``JOINT.per.OTHER``, how much it turns with
another joint; ``JOINT.reversal`` (mrad), its lost motion: by how much less it has turned than it says, half of it
either way, where the table says which way it came; ``JOINT.sinN|cosN`` (mrad), its periodic error of order N;
``JOINT.stiffness`` and ``PLACE.ROW`` as of :mod:`fem.free.parameters`, under the arm's own weight and payloads;
``JOINT.mass``, by what share more than the model says weighs what turns with a joint and not with the next one;
``payload.NAME.mass`` (kg) and ``payload.NAME.mx|my|mz`` (kg m); ``rail.x|y|z`` (the way for each metre),
``rail.bowN.x|y|z`` (mm) and ``rail.turnN.x|y|z`` (mrad), Legendre polynomials over the length that was used;
``target.NAME.x|y|z`` (mm); ``arm.growth`` (ppm/K), by how much all lengths of the arm grow; ``drift.x|y|z`` (mm) and
``drift.rx|ry|rz`` (mrad), how far the arm moves in its own axes from the first reading to the last, evenly;
``settling.x`` ... the same, most of it at first (as what warms up does); ``bumpN.x`` ... at once, after N of 32 equal
parts of the time.

Groups stand for their members: ``geometry``, ``zeros``, ``ratios``, ``coupling``, ``periodic`` (joint error curves up
to order 48, shrunk) or ``periodicN``, ``springs``, ``tilts``, ``base``, ``rail``, ``masses``, ``payload``, ``growth``,
``drift``, ``reversal``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from doe.absolute.readings import AbsoluteReadings
from fem.free.base import SHIFT, TURN
from fem.statics.ports import ROWS
from robots import InputError, Robot
from robots.arrays import Indices

Kind = Literal[
    "frame",
    "zero",
    "ratio",
    "coupling",
    "periodic",
    "spring",
    "payload",
    "rail",
    "target",
    "growth",
    "drift",
    "reversal",
    "mass",
]
Group = Callable[[Robot, AbsoluteReadings], "Iterator[Unknown]"]

AXES = ("x", "y", "z")
# What is known of an arm before it was measured (assumed): one standard deviation of its frames, zeros, gear ratios and
# couplings. Wide, so that the readings decide wherever they say anything.
FRAME_m, FRAME_rad, ZERO_rad, RATIO, COUPLING = 0.01, 0.02, 0.1, 0.01, 0.01
# Compliances are of the size of this share of the softest that is allowed, or far below.
SOFT = 0.3
RAIL_WAY, RAIL_BOW_m, RAIL_TURN_rad = 0.1, 1e-3, 1e-3
# A target is somewhere within arm's length of the flange; a payload's mass is given to a fifth.
TARGET_m, PAYLOAD_SHARE = 1.0, 0.2
# Highest order of a joint's error curve: features 7.5 deg wide. Orders up to this one are offered one by one.
CURVE_ORDER, HIGHEST_ORDER = 48, 400
RAIL_ORDER = 6
# How much an arm of steel or aluminium may grow for each degree; how far a tracker or base may move within a session.
GROWTH, DRIFT_m, DRIFT_rad = 2e-5, 1e-3, 1e-3
# Share to which masses of links are known.
MASS = 0.1
# How much a joint's lost motion may be.
REVERSAL = 1e-3
# Equal parts of a campaign's time between which something may have moved at once; what settles has done 63 % of it
# after a third.
BUMPS, SETTLING, THIRD = 32, -1, 1.0 / 3.0
DEGREE = math.pi / 180.0


@dataclass(frozen=True)
class Unknown:
    """A number that is free: ``value = factor * variable`` in ``unit``.

    ``index``: which one of its kind (joint, row, order, ...); ``sd``: what was known before, of the variable, about
    ``start``; inf for nothing. ``law``: a variance that the readings tell, common to all with the same word; "" for
    ``sd`` as it stands. ``low``, ``high``: range of the variable.
    """

    name: str
    kind: Kind
    index: tuple[int, ...]
    unit: str
    factor: float
    sd: float = math.inf
    law: str = ""
    low: float = -math.inf
    high: float = math.inf
    start: float = 0.0


def geometry(robot: Robot, _: AbsoluteReadings) -> Iterator[Unknown]:
    """Frames and zeros of all joints."""
    for j in range(robot.dof):
        yield from (frame_error(robot, j, c) for c in range(5))
        yield zero_error(robot, j)


def frame_error(robot: Robot, joint: int, component: int) -> Unknown:
    """An error of a joint's frame: positions 0 to 2 along its own axes, turns 3 and 4 about x and y."""
    name = robot.joint_names[joint]
    if component < 3:
        return Unknown(f"{name}.frame.{AXES[component]}", "frame", (joint, component), "mm", 1e3, FRAME_m)
    return Unknown(f"{name}.frame.r{AXES[component - 3]}", "frame", (joint, component), "deg", 1 / DEGREE, FRAME_rad)


def zero_error(robot: Robot, joint: int) -> Unknown:
    """What is added to a joint's angle."""
    return Unknown(f"{robot.joint_names[joint]}.zero", "zero", (joint,), "deg", 1.0 / DEGREE, ZERO_rad)


def zeros(robot: Robot, _: AbsoluteReadings) -> Iterator[Unknown]:
    """Zeros of all joints."""
    return (zero_error(robot, j) for j in range(robot.dof))


def ratios(robot: Robot, _: AbsoluteReadings) -> Iterator[Unknown]:
    """Gear ratios of all joints."""
    return (ratio_error(robot, j) for j in range(robot.dof))


def ratio_error(robot: Robot, joint: int) -> Unknown:
    """By how much more a joint turns than it says, as a share."""
    return Unknown(f"{robot.joint_names[joint]}.ratio", "ratio", (joint,), "1", 1.0, RATIO)


def coupling(robot: Robot, _: AbsoluteReadings) -> Iterator[Unknown]:
    """Each of the last three joints turning with those before it among them, as wrists are geared."""
    wrist = range(max(robot.dof - 3, 0), robot.dof)
    for j in wrist:
        for k in wrist:
            if k < j:
                yield coupling_error(robot, j, k)


def coupling_error(robot: Robot, joint: int, other: int) -> Unknown:
    """How much a joint turns with another one."""
    name = f"{robot.joint_names[joint]}.per.{robot.joint_names[other]}"
    return Unknown(name, "coupling", (joint, other), "1", 1.0, COUPLING)


def periodic(order: int) -> Group:
    """Periodic errors of all joints up to an order, with a law of their sizes that the readings tell."""

    def group(robot: Robot, _: AbsoluteReadings) -> Iterator[Unknown]:
        for j in range(robot.dof):
            for n in range(1, order + 1):
                yield from (periodic_error(robot, j, n, phase) for phase in (0, 1))

    return group


def periodic_error(robot: Robot, joint: int, order: int, phase: int) -> Unknown:
    """The sine (phase 0) or cosine (1) of an order of a joint's error."""
    name = f"{robot.joint_names[joint]}.{('sin', 'cos')[phase]}{order}"
    return Unknown(name, "periodic", (joint, order, phase), "mrad", 1e3, 1.0, "periodic")


def spring(place: str, where: int, row: int) -> Unknown:
    """A joint's (or, with ``where`` -1, the base's) compliance in a row of its axes; rigid to softer than any."""
    unit, softest = ("N/m", SHIFT[0]) if row < 3 else ("N m/rad", TURN[0])
    name = f"{place}.stiffness" if row == 5 and where >= 0 else f"{place}.{ROWS[row]}"
    return Unknown(name, "spring", (where, row), unit, 1.0, SOFT / softest, low=0.0, high=1.0 / softest)


def springs(robot: Robot, _: AbsoluteReadings) -> Iterator[Unknown]:
    """Springs about the axes of all joints."""
    return (spring(name, j, 5) for j, name in enumerate(robot.joint_names))


def tilts(robot: Robot, _: AbsoluteReadings) -> Iterator[Unknown]:
    """Springs across the axes of all joints, in their tilting directions."""
    return (spring(name, j, row) for j, name in enumerate(robot.joint_names) for row in (3, 4))


def base(_: Robot, __: AbsoluteReadings) -> Iterator[Unknown]:
    """Tilting springs of the base."""
    return (spring("base", -1, row) for row in (3, 4))


def masses(robot: Robot, _: AbsoluteReadings) -> Iterator[Unknown]:
    """Masses of what turns with each joint."""
    return (Unknown(f"{name}.mass", "mass", (j,), "1", 1.0, MASS) for j, name in enumerate(robot.joint_names))


def payload(_: Robot, data: AbsoluteReadings) -> Iterator[Unknown]:
    """Mass and centre of every payload that is not zero, about what the table says."""
    for k, one in enumerate(data.payloads):
        if one.kg > 0.0:
            same = [k for k, other in enumerate(data.payloads) if other.kg == one.kg]
            number = f"-{same.index(k) + 1}" if len(same) > 1 else ""
            share, name = PAYLOAD_SHARE * one.kg, f"payload.{one.kg:g}kg{number}"
            yield Unknown(f"{name}.mass", "payload", (k, 0), "kg", 1.0, share, start=one.kg)
            for a in range(3):
                moment = one.kg * float(one.centre[a])
                yield Unknown(f"{name}.m{AXES[a]}", "payload", (k, 1 + a), "kg m", 1.0, share * 0.5, start=moment)


def rail(_: Robot, data: AbsoluteReadings) -> Iterator[Unknown]:
    """The rail's direction and pitch, how it bows, and how the carriage turns along it."""
    if not data.has_rail:
        return
    for a in range(3):
        yield Unknown(f"rail.{AXES[a]}", "rail", (0, 1, a), "1", 1.0, 10.0)
    for n in range(1, RAIL_ORDER + 1):
        for a in range(3):
            if n > 1:
                yield Unknown(f"rail.bow{n}.{AXES[a]}", "rail", (0, n, a), "mm", 1e3, 1.0, "rail.bow")
            yield Unknown(f"rail.turn{n}.{AXES[a]}", "rail", (1, n, a), "mrad", 1e3, 1.0, "rail.turn")


def reversals(robot: Robot, data: AbsoluteReadings) -> Iterator[Unknown]:
    """Lost motion of the joints that came from either side."""
    for j in range(robot.dof if data.approach.size else 0):
        if np.ptp(data.approach[:, j]) > 0.0:
            yield Unknown(f"{robot.joint_names[j]}.reversal", "reversal", (j,), "mrad", 1e3, REVERSAL)


def growth(_: Robot, data: AbsoluteReadings) -> Iterator[Unknown]:
    """All lengths of the arm with the temperature, where the table has one."""
    if len(data.temperature) and np.ptp(data.temperature) > 0.0:
        yield Unknown("arm.growth", "growth", (), "ppm/K", 1e6, GROWTH)


def drift(_: Robot, data: AbsoluteReadings) -> Iterator[Unknown]:
    """An even move of the arm against the tracker over the time of the readings, where the table has one."""
    return moved(data, 0)


def moved(data: AbsoluteReadings, way: int) -> Iterator[Unknown]:
    """A move of the arm against the tracker: even over the time (0), settling, or at once after so many parts of it."""
    if len(data.time) and np.ptp(data.time) > 0.0:
        name = {0: "drift", SETTLING: "settling"}.get(way, f"bump{way}")
        for turns, unit, sd, letter in ((0, "mm", DRIFT_m, ""), (1, "mrad", DRIFT_rad, "r")):
            for a in range(3):
                yield Unknown(f"{name}.{letter}{AXES[a]}", "drift", (way, turns, a), unit, 1e3, sd)


GROUPS: dict[str, Group] = {
    "geometry": geometry,
    "zeros": zeros,
    "ratios": ratios,
    "coupling": coupling,
    "periodic": periodic(CURVE_ORDER),
    "springs": springs,
    "tilts": tilts,
    "base": base,
    "rail": rail,
    "masses": masses,
    "payload": payload,
    "growth": growth,
    "drift": drift,
    "reversal": reversals,
}
USUAL = ("geometry", "springs", "periodic", "rail")


def targets(data: AbsoluteReadings) -> Iterator[Unknown]:
    """Where each target sits in the flange frame; always free."""
    for t, name in enumerate(data.target.names):
        for a in range(3):
            yield Unknown(f"target.{name}.{AXES[a]}", "target", (t, a), "mm", 1e3, TARGET_m)


def unknowns(robot: Robot, data: AbsoluteReadings, free: Sequence[str]) -> tuple[Unknown, ...]:
    """What the names of groups and single numbers set free, each once, and the targets and the way of a rail.

    Raises
    ------
    InputError
        A name that is neither.
    """
    out: dict[str, Unknown] = {}
    for name in free:
        for one in _named(robot, data, name):
            out[one.name] = one
    way = (one for one in rail(robot, data) if one.index[:2] == (0, 1))
    for one in (*way, *targets(data)):
        out[one.name] = one
    return tuple(out.values())


def _named(robot: Robot, data: AbsoluteReadings, name: str) -> Sequence[Unknown]:
    if name in GROUPS:
        return tuple(GROUPS[name](robot, data))
    if found := re.fullmatch(r"periodic([1-9]\d{0,2})", name):
        order = int(found[1])
        if order <= HIGHEST_ORDER:
            return tuple(periodic(order)(robot, data))
    if name.endswith(".periodic") and name.removesuffix(".periodic") in robot.joint_names:
        joint = robot.joint_names.index(name.removesuffix(".periodic"))
        return tuple(one for one in periodic(CURVE_ORDER)(robot, data) if one.index[0] == joint)
    groups = (
        *(group(robot, data) for group in (payload, rail, growth, reversals)),
        *(moved(data, k) for k in range(SETTLING, BUMPS)),
    )
    members = (one for group in groups for one in group)
    if one := single(robot, name) or next((member for member in members if member.name == name), None):
        return (one,)
    raise InputError(
        "parameter of absolute readings",
        code="M001",
        value=name,
        allowed=f"{', '.join((*GROUPS, 'periodic4'))}, or one of a joint: {robot.joint_names[0]}.zero, .ratio, "
        ".periodic, .frame.x, .frame.rx, .per.OTHER, .sin1, .cos1, .stiffness, .rx",
    )


def single(robot: Robot, name: str) -> Unknown | None:
    """The unknown of a joint or the base with this name; None where there is none."""
    place, _, rest = name.partition(".")
    if place == "base" and rest in ROWS:
        return spring("base", -1, ROWS.index(rest))
    if place not in robot.joint_names:
        return None
    j = robot.joint_names.index(place)
    if rest == "zero":
        return zero_error(robot, j)
    if rest == "ratio":
        return ratio_error(robot, j)
    if rest == "stiffness" or rest in ROWS:
        return spring(place, j, 5 if rest == "stiffness" else ROWS.index(rest))
    if found := re.fullmatch(r"frame\.(r?)([xyz])", rest):
        component = AXES.index(found[2]) + 3 * bool(found[1])
        return zero_error(robot, j) if component == 5 else frame_error(robot, j, component)
    if found := re.fullmatch(r"(sin|cos)([1-9]\d{0,2})", rest):
        return periodic_error(robot, j, int(found[2]), int(found[1] == "cos"))
    if rest.startswith("per.") and rest[4:] in robot.joint_names and rest[4:] != place:
        return coupling_error(robot, j, robot.joint_names.index(rest[4:]))
    return None


@dataclass(frozen=True)
class Layout:
    """The unknowns in order, and the place of each kind's among them."""

    unknowns: tuple[Unknown, ...]

    def __len__(self) -> int:
        return len(self.unknowns)

    def of(self, kind: Kind) -> list[tuple[int, tuple[int, ...]]]:
        """Places and indices of one kind."""
        return [(k, one.index) for k, one in enumerate(self.unknowns) if one.kind == kind]

    def places(self, wanted: Callable[[Unknown], bool]) -> Indices:
        """Places of those that are wanted."""
        return np.array([k for k, one in enumerate(self.unknowns) if wanted(one)], dtype=np.intp)

    def without(self, names: Sequence[str]) -> Layout:
        """Others alone."""
        return Layout(tuple(one for one in self.unknowns if one.name not in names))

    def with_targets(self, data: AbsoluteReadings) -> Layout:
        """The same with the targets of other readings."""
        kept = tuple(one for one in self.unknowns if one.kind != "target")
        return replace(self, unknowns=(*kept, *targets(data)))
