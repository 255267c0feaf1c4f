"""Arms read from description files, as chains in MuJoCo, and laws of torque and time."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..shared import description, si

Vector = NDArray[np.float64]

ARMS = ("kr60-3", "tx200", "heron7", "mantis5", "xr701")

# Springs as a data sheet would say, N m/rad: where nothing is published, of the size of such arms' gears (RV 110 to 320
# with their drives in series; 0.4 to 4e6 for main axes, 0.02 to 3e6 for wrists).
SPRINGS: dict[str, tuple[float, ...]] = {
    "kr60-3": (2.1977e6, 0.8994e6, 1.1118e6, 6.44e4, 2.54e4, 2.0e4),
    "tx200": (2.6e6, 2.1e6, 1.3e6, 2.4e5, 1.9e5, 9e4),
    "heron7": (1.9e6, 1.6e6, 1.1e6, 0.8e6, 2.6e5, 1.7e5, 8e4),
    "mantis5": (1.5e6, 1.3e6, 0.9e6, 2.4e5, 1.1e5),
    "xr701": (3.0e6, 1.4e6, 0.76e6, 1.4e6, 8e5, 4e5),
}
# Masses in kg of the moving parts where the description has none: by the joint that carries them.
MASSES: dict[str, dict[str, float]] = {"mantis5": {"pan": 150.0, "boom": 90.0, "stick": 75.0, "turn": 20.0}}


RAD = np.pi / 180


@dataclass(frozen=True)
class Joint:
    """A hinge: where it stands on the part before it, and how the table counts its angle (all in m and rad)."""

    name: str
    coordinate: str
    sign: float
    offset: float
    limits: tuple[float, float]
    position: Vector
    rotation: Vector
    axis: Vector


@dataclass(frozen=True)
class Link:
    """A casing from its joint to the next: mass, and the stiffness of its mean section (N m^2, N)."""

    name: str
    body: str
    mass: float
    bending: float
    twisting: float
    stretching: float


@dataclass(frozen=True)
class Arm:
    """One arm as the world knows it."""

    name: str
    joints: tuple[Joint, ...]
    flange: Vector
    links: tuple[Link, ...]
    payload: float
    parallelogram: bool
    pin: float
    coupled: tuple[tuple[Vector, float, float], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints, from the base on."""
        return tuple(joint.name for joint in self.joints)

    def index(self, joint: str) -> int:
        """Place of a joint in the chain."""
        return self.names.index(joint)

    def real(self, table: Vector) -> Vector:
        """Angles of the hinges from those of the table."""
        return np.array([j.sign * a + j.offset for j, a in zip(self.joints, table, strict=True)])

    def main(self) -> tuple[str, str]:
        """The two joints that lift: the second axis, and the elbow."""
        return self.names[1], ("elbow" if "elbow" in self.names else self.names[2])

    def wrist(self) -> tuple[str, str]:
        """The hand's roll and bend, which share a housing."""
        last = len(self.names) - 1
        return self.names[last - 2], self.names[last - 1]


def load(name: str) -> Arm:
    """Read an arm of this world's own or a bundled one."""
    data = tomllib.loads(description(name))
    joints = tuple(_joint(entry) for entry in data["joint"])
    bar = data.get("parallelogram")
    coordinates = [joint.coordinate for joint in joints]
    coupled = []
    for entry in data.get("coupling", []):
        row = np.zeros(len(joints))
        for term in entry["terms"]:
            row[coordinates.index(term["coordinate"])] = term["factor"]
        low, high = np.atleast_1d(si(entry["limits"], RAD))
        start = float(si(entry["offset"], RAD)) if "offset" in entry else 0.0
        coupled.append((row, float(low) - start, float(high) - start))
    return Arm(
        name,
        joints,
        np.asarray(si(data["flange"]["xyz"], RAD)),
        _links(name, data),
        float(si(data["payload"], RAD)),
        bar is not None,
        float(np.linalg.norm(si(bar["pin"], RAD))) if bar else 0.0,
        tuple(coupled),
    )


def _joint(entry: dict[str, Any]) -> Joint:
    if "dh" in entry:
        alpha, a, d = (float(si(entry["dh"][key], RAD)) for key in ("alpha", "a", "d"))
        cos, sin = np.cos(alpha), np.sin(alpha)
        rotation = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
        position, axis = np.array([a, -sin * d, cos * d]), np.array([0.0, 0.0, 1.0])
    else:
        rotation, position = np.eye(3), si(entry["frame"]["xyz"], RAD)
        axis = np.asarray(entry["frame"]["axis"], dtype=float)
    low, high = si(entry["limits"], RAD)
    offset = float(si(entry["offset"], RAD)) if "offset" in entry else 0.0
    sign = float(entry.get("sign", 1))
    return Joint(entry["name"], entry["coordinate"], sign, offset, (float(low), float(high)), position, rotation, axis)


def _links(name: str, data: dict[str, Any]) -> tuple[Link, ...]:
    bare = MASSES.get(name, {})
    links = [Link(body, body, mass, 0.0, 0.0, 0.0) for body, mass in bare.items()]
    for entry in data.get("link", []):
        material = data["materials"][entry["material"]]
        young = float(si(material["youngs_modulus"], RAD))
        shear = young / (2 + 2 * float(si(material["poissons_ratio"], RAD)))
        sections = [entry["section"], entry.get("section_end", entry["section"])]
        area, inertia, polar = np.mean([_section(section) for section in sections], axis=0)
        mass = float(si(entry["mass"], RAD))
        links.append(Link(entry["name"], entry["body"], mass, young * inertia, shear * polar, young * area))
    return tuple(links)


def _section(entry: dict[str, Any]) -> tuple[float, float, float]:
    """Area, second moment (the mean of both axes) and torsion constant of a thin-walled section."""
    wall = float(si(entry["wall"], RAD))
    if entry["kind"] == "tube":
        radius = (float(si(entry["diameter"], RAD)) - wall) / 2
        inertia = np.pi * radius**3 * wall
        return 2 * np.pi * radius * wall, inertia, 2 * inertia
    wide, high = float(si(entry["width"], RAD)) - wall, float(si(entry["height"], RAD)) - wall
    up = wall * (high**3 / 6 + wide * high**2 / 2)
    side = wall * (wide**3 / 6 + high * wide**2 / 2)
    return 2 * wall * (wide + high), (up + side) / 2, 2 * wall * wide**2 * high**2 / (wide + high)


GRAVITY = 9.80665
DIRECTIONS = ("tx", "ty", "tz", "rx", "ry", "rz")
_AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
# Change of any deflection, in rad or m, at which an equilibrium has been found.
SETTLED = 1e-12
MOST_STEPS = 80

Law = Callable[[Vector], Vector]


def _text(values: Sequence[float] | Vector) -> str:
    return " ".join(f"{float(v):.17g}" for v in values)


def _freedoms(place: str, wanted: Mapping[str, Sequence[str]]) -> str:
    """Slides first, then hinges, all at the body's origin."""
    lines = []
    for direction in DIRECTIONS:
        if direction in wanted.get(place, ()):
            kind = "slide" if direction[0] == "t" else "hinge"
            lines.append(f'<joint name="{place}.{direction}" type="{kind}" axis="{_AXES[direction[1]]}"/>')
    return "".join(lines)


def _quaternion(rotation: Vector) -> Vector:
    out = np.zeros(4)
    mujoco.mju_mat2Quat(out, np.ascontiguousarray(rotation, dtype=float).ravel())
    return out


def mjcf(arm: Arm, wanted: Mapping[str, Sequence[str]], shifts: Vector, weigh: float) -> str:
    """Write the arm as MJCF: a body for the base, for each joint and for the flange.

    Parameters
    ----------
    wanted : directions that give way beside the gears, by place (``base``, a joint's name, ``tool``)
    shifts : (joints + 1, 3) m, by how far each body sits from where its drawing has it
    weigh : factor on the masses
    """
    steps = [*(joint.position for joint in arm.joints[1:]), arm.flange]
    masses = {link.body: link.mass * weigh for link in arm.links}
    text = [
        '<mujoco><compiler angle="radian"/>',
        f'<option gravity="0 0 {-GRAVITY}"/><worldbody><body name="base">',
        _freedoms("base", wanted),
        '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>',
    ]
    for joint, shift, step in zip(arm.joints, shifts, steps, strict=False):
        mass = max(masses.get(joint.name, 0.0), 1e-3)
        # A body of its own for what gives way before the joint: MuJoCo allows six freedoms a body.
        text.append(f'<body pos="{_text(joint.position + shift)}" quat="{_text(_quaternion(joint.rotation))}">')
        text.append(_freedoms(joint.name, wanted))
        text.append('<inertial pos="0 0 0" mass="1e-3" diaginertia="1e-4 1e-4 1e-4"/><body>')
        text.append(f'<joint name="{joint.name}" type="hinge" axis="{_text(joint.axis)}"/>')
        text.append(f'<inertial pos="{_text(step / 2)}" mass="{mass}" diaginertia="{_text([mass * 0.05] * 3)}"/>')
    text.append(f'<body name="flange" pos="{_text(arm.flange + shifts[-1])}">{_freedoms("tool", wanted)}')
    text.append('<inertial pos="0 0 0" mass="1e-3" diaginertia="1e-4 1e-4 1e-4"/></body>')
    return "".join(text) + "</body>" * (2 * len(arm.joints) + 1) + "</worldbody></mujoco>"


class Chain:
    """An arm that gives way at its gears, and at whatever else is wanted.

    Deflections are ordered: gears of all joints first, then the other freedoms by place. ``share`` is the part of an
    ideal parallelogram in how the elbow follows the shoulder: 1 keeps the forearm's direction when the shoulder's gear
    gives way, 0 is the plain chain.
    """

    def __init__(
        self,
        arm: Arm,
        wanted: Mapping[str, Sequence[str]] | None = None,
        shifts: Vector | None = None,
        weigh: float = 1.0,
        share: float | None = None,
    ) -> None:
        wanted = wanted or {}
        count = len(arm.joints)
        shifts = np.zeros((count + 1, 3)) if shifts is None else shifts
        self.model = mujoco.MjModel.from_xml_string(mjcf(arm, wanted, shifts, weigh))
        self.data = mujoco.MjData(self.model)
        self.flange = int(self.model.body("flange").id)
        places = ("base", *arm.names, "tool")
        more = [f"{place}.{d}" for place in places for d in DIRECTIONS if d in wanted.get(place, ())]
        self.names = [*arm.names, *more]
        self.where = {name: i for i, name in enumerate(self.names)}
        self._slots = np.array([int(self.model.joint(name).qposadr[0]) for name in self.names])
        self.size, self._joints = len(self.names), count
        self.mix = np.eye(self.size)
        share = float(arm.parallelogram) if share is None else share
        if arm.parallelogram and share:
            self.mix[2, 1] = -share
        self._bias, self._jacobian = np.zeros(self.size), np.zeros((3, self.size))

    def pose(self, angles: Vector, deflection: Vector) -> None:
        """Bring all bodies to where these angles and deflections put them."""
        turned = self.mix @ deflection
        turned[: self._joints] += angles
        self.data.qpos[self._slots] = turned
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def point(self, lever: Vector) -> Vector:
        """Where a point of the flange's frame is."""
        return np.asarray(self.data.xpos[self.flange] + self.data.xmat[self.flange].reshape(3, 3) @ lever)

    def jacobian(self, lever: Vector) -> Vector:
        """Motion (3, freedoms) of a point of the flange's frame by deflections."""
        mujoco.mj_jac(self.model, self.data, self._jacobian, None, self.point(lever), self.flange)
        return np.asarray(self._jacobian[:, self._slots] @ self.mix)

    def torque(self, force: Vector, lever: Vector) -> Vector:
        """What the load and the arm's own weight do on each freedom, N m or N."""
        mujoco.mj_rne(self.model, self.data, 0, self._bias)
        return np.asarray(force @ self.jacobian(lever) - self._bias[self._slots] @ self.mix)

    def settle(self, angles: Vector, force: Vector, lever: Vector, law: Law, start: Vector) -> tuple[Vector, Vector]:
        """Find the equilibrium: each freedom deflected as its law says for the torque at the deflected pose.

        Newton's method on the complementary form ``deflection - law(torque(deflection)) = 0``. The residual is that
        of the deflected pose; in the tangent the change of torques with the pose is left out, which is some 0.3 % of it
        for arms, so that each step wins two to three digits.

        Returns
        -------
        deflection, torque : (freedoms,) each; the bodies stay where the equilibrium has them
        """
        deflection = start
        for _ in range(MOST_STEPS):
            self.pose(angles, deflection)
            torque = self.torque(force, lever)
            found = law(torque)
            change = float(np.max(np.abs(found - deflection)))
            deflection = found
            if change < SETTLED:
                self.pose(angles, deflection)
                return deflection, torque
        raise ArithmeticError(f"no equilibrium within {MOST_STEPS} steps: the last one still moved {change:g}")


def beam(length: Vector, bending: float, twisting: float, stretching: float) -> Vector:
    """Flexibility (6, 6) of a straight Euler-Bernoulli cantilever at its tip, about the axes of its root."""
    size = float(np.linalg.norm(length))
    along = length / size
    across = np.eye(3) - np.outer(along, along)
    cross = np.array([[0, -along[2], along[1]], [along[2], 0, -along[0]], [-along[1], along[0], 0]])
    out = np.zeros((6, 6))
    out[:3, :3] = size / stretching * np.outer(along, along) + size**3 / (3 * bending) * across
    out[3:, 3:] = size / twisting * np.outer(along, along) + size / bending * across
    out[3:, :3] = size**2 / (2 * bending) * cross
    out[:3, 3:] = out[3:, :3].T
    return out


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
