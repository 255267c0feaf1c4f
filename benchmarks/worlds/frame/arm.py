"""Arms as their description files state them, what a set is made from, and a frame as OpenSees takes it."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import shared
from ..shared import description, si

Array = NDArray[np.float64]
GRAVITY = 9.81
# N m/rad. xr701, kr60-3 and fanuc near published values, the others of their class.
SPRINGS: dict[str, tuple[float, ...]] = {
    "xr701": (1.8e6, 1.4e6, 0.76e6, 6e5, 3.5e5, 2.2e5),
    "kr60-3": (2.1977e6, 0.8994e6, 1.1118e6, 6.44e4, 2.54e4, 2.0e4),
    "tx200": (1.7e6, 1.2e6, 8.5e5, 1.9e5, 1.2e5, 8e4),
    "fanuc-r2000ic": (9.34e5, 4.13e6, 1.91e6, 2.33e5, 4.04e5, 7.96e4),
    "crane6": (9e5, 7e5, 4.2e5, 7e4, 4.5e4, 2.8e4),
    "reed7": (4e5, 3.4e5, 2.2e5, 1.5e5, 5.5e4, 4e4, 2.2e4),
}
# No file states the masses of its parts; the whole arm's, split as in others of its class.
FANUC_PARTS = {"base": 330.0, "j1": 290.0, "j2": 190.0, "j3": 230.0, "j6": 50.0}


@dataclass(frozen=True)
class Section:
    """A hollow section: what a beam of OpenSees asks for."""

    area: float
    inertia: float
    torsion: float
    modulus: float
    shear: float


@dataclass(frozen=True)
class Link:
    """A casing between two joints."""

    name: str
    body: str
    section: Section


@dataclass(frozen=True)
class Stand:
    """Where everything is at one pose, in base axes."""

    origins: Array  # (n, 3) of the joints
    axes: Array  # (n, 3)
    across: Array  # (n, 3) a direction across each axis, fixed to the body before it
    turned: Array  # (n, 3, 3) of the bodies behind the joints
    flange: Array  # (3,)


@dataclass(frozen=True)
class Arm:
    """A serial arm of n joints. Lengths in m, angles of joints in deg as tables state them, masses in kg."""

    name: str
    joints: tuple[str, ...]
    columns: tuple[str, ...]
    frames: Array  # (n, 4, 4) of each joint in the frame behind the one before
    about: Array  # (n, 3) its axis there
    signs: Array
    offsets: Array
    low: Array
    high: Array
    flange: Array
    tool: Array
    couplings: tuple[tuple[Array, float, float, float], ...]  # factors, offset, lowest, highest
    masses: dict[str, float]
    links: tuple[Link, ...]
    payload: float  # N
    springs: Array
    pin: Array | None = None

    @property
    def reach(self) -> float:
        """Of all frames in a row, m."""
        return float(np.linalg.norm(self.frames[1:, :3, 3], axis=1).sum() + np.linalg.norm(self.flange))

    @property
    def size(self) -> float:
        """Torques of this arm over those of a 130 kg arm."""
        return self.payload * self.reach / (1300 * 3.0)

    @property
    def torque(self) -> float:
        """What the payload brings at half the reach, N m."""
        return 0.5 * self.payload * self.reach

    def index(self, joint: str) -> int:
        """Number of a joint by its name."""
        return self.joints.index(joint)

    def shifted(self, lengths: Array, zeros: Array) -> Arm:
        """Frames off by lengths (n + 1, 3) in m, joint zeros by (n,) in deg."""
        frames = self.frames.copy()
        frames[:, :3, 3] += lengths[:-1]
        return replace(self, frames=frames, offsets=self.offsets + zeros, flange=self.flange + lengths[-1])

    def allows(self, q: Array) -> bool:
        """Whether angles (n,) in deg are within the limits, coupled ones too."""
        coupled = all(low <= offset + factors @ q <= high for factors, offset, low, high in self.couplings)
        return bool(np.all(q >= self.low - 1e-9) and np.all(q <= self.high + 1e-9) and coupled)

    def stand(self, q: Array) -> Stand:
        """The arm at angles (n,) in deg."""
        here = np.eye(4)
        origins, axes, across, turned = [], [], [], []
        for frame, about, angle in zip(self.frames, self.about, self.signs * q + self.offsets, strict=True):
            here = here @ frame
            u = about / np.linalg.norm(about)
            other = np.eye(3)[int(np.argmin(np.abs(u)))]
            v = np.cross(u, other)
            origins.append(here[:3, 3])
            axes.append(here[:3, :3] @ u)
            across.append(here[:3, :3] @ v / np.linalg.norm(v))
            here = here.copy()
            here[:3, :3] = here[:3, :3] @ rotation(u, np.radians(angle))
            turned.append(here[:3, :3])
        end = here[:3, :3] @ self.flange + here[:3, 3]
        return Stand(np.array(origins), np.array(axes), np.array(across), np.array(turned), end)


def rotation(axis: Array, angle: float) -> Array:
    """About a unit axis by an angle in rad, (3, 3) (Rodrigues)."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def turns(arm: Arm, stand: Stand, point: Array) -> tuple[Array, Array]:
    """What a point (3,) in the flange frame moves by for a turn of 1 rad about each axis (n, 3); where it is (3,)."""
    tip = stand.flange + stand.turned[-1] @ point
    return np.cross(stand.axes, tip - stand.origins), tip


def _fixed(joint: dict[str, Any]) -> tuple[Array, Array]:
    """Frame (4, 4) of a joint at zero, and its axis there."""
    frame = np.eye(4)
    if "frame" in joint:
        frame[:3, 3] = si(joint["frame"]["xyz"])
        return frame, np.array(joint["frame"]["axis"], dtype=float)
    dh = {key: si(joint["dh"][key]) for key in ("alpha", "a", "d")}
    frame[:3, :3] = rotation(np.array([1.0, 0, 0]), np.radians(dh["alpha"]))
    frame[:3, 3] = np.array([dh["a"], 0, 0]) + frame[:3, :3] @ np.array([0, 0, dh["d"]])
    return frame, np.array([0.0, 0, 1])


def _section(link: dict[str, Any], materials: dict[str, Any]) -> Section:
    """At the link's root: thin walls, torsion after Bredt."""
    of, material = link["section"], materials[link["material"]]
    modulus, nu = si(material["youngs_modulus"]), si(material["poissons_ratio"])
    wall = si(of["wall"])
    if of["kind"] == "tube":
        radius = (si(of["diameter"]) - wall) / 2
        area, inertia = 2 * np.pi * radius * wall, np.pi * radius**3 * wall
        torsion = 2 * inertia
    else:
        b, h = si(of["width"]) - wall, si(of["height"]) - wall
        area, torsion = 2 * (b + h) * wall, 2 * wall * (b * h) ** 2 / (b + h)
        inertia = (wall * h**2 * (h + 3 * b) + wall * b**2 * (b + 3 * h)) / 12
    return Section(area, inertia, torsion, modulus, modulus / (2 + 2 * nu))


@cache
def load(name: str) -> Arm:
    """One of ``SPRINGS`` by its name."""
    raw = tomllib.loads(description(name))
    joints = raw["joint"]
    fixed = [_fixed(joint) for joint in joints]
    columns = tuple(joint["coordinate"] for joint in joints)
    limits = np.array([si(joint["limits"]) for joint in joints], dtype=float)
    links = raw.get("link", [])
    couplings = [
        (
            np.array([sum(t["factor"] for t in one["terms"] if t["coordinate"] == c) for c in columns], dtype=float),
            float(si(one["offset"])),
            *map(float, si(one["limits"])),
        )
        for one in raw.get("coupling", [])
    ]
    return Arm(
        name=name,
        joints=tuple(joint["name"] for joint in joints),
        columns=columns,
        frames=np.array([frame for frame, _ in fixed]),
        about=np.array([axis for _, axis in fixed]),
        signs=np.array([joint.get("sign", 1) for joint in joints], dtype=float),
        offsets=np.array([si(joint["offset"]) if "offset" in joint else 0 for joint in joints], dtype=float),
        low=limits[:, 0],
        high=limits[:, 1],
        flange=np.array(si(raw["flange"]["xyz"])),
        tool=np.array(si(raw["tool"]["xyz"])) if "tool" in raw else np.zeros(3),
        couplings=tuple(couplings),
        masses={link["body"]: float(si(link["mass"])) for link in links} or FANUC_PARTS,
        links=tuple(Link(link["name"], link["body"], _section(link, raw["materials"])) for link in links),
        payload=GRAVITY * float(si(raw["payload"])),
        springs=np.array(SPRINGS[name]),
        pin=np.array(si(raw["parallelogram"]["pin"])) if "parallelogram" in raw else None,
    )


ANGLE_DIGITS = 4


@dataclass(frozen=True)
class Spec(shared.Spec):
    """One set of this world. Lengths in m."""

    settle_s: float
    moves: bool  # the arm goes away and comes back between two cycles
    soft_links: float  # share of the deflection that links give
    point: tuple[float, ...]  # loaded and read in the flange frame; none: the model's tool point

    @property
    def of(self) -> Arm:
        """The arm as it is stated."""
        return load(self.arm)


@dataclass(frozen=True)
class Row:
    """A reading to be taken, as the table states it."""

    visit: int
    cycle: int
    session: int
    since_s: float  # the session's start
    time_s: float
    zero_s: float  # when the gauge was zeroed, at no load
    phase: str
    pose: str
    angles: Array  # (n,) deg
    force: Array  # (3,) N, base axes
    point: Array  # (3,) m, flange frame
    moment: Array  # (3,) N m

    @property
    def load(self) -> float:
        """N."""
        return float(np.linalg.norm(self.force))


# ("Elastic", k), ("ElasticPP", ...), with the arguments of OpenSees behind the tag; ("Parallel", material, ...).
Material = tuple[Any, ...]

STIFF = 1e14  # N/m, N m/rad: gives 1e-8 of what a joint does
RIGID = Section(1e14, 1e14, 1e14, 1.0, 1.0)
# Below this a stiff beam would be a million times stiffer than its neighbours: a constraint does it.
SHORT = 0.1  # m
SAME = 1e-9  # m


def elastic(material: Material) -> bool:
    """Whether force is in proportion to motion, whatever came before."""
    return material[0] == "Elastic" and len(material) == 2


FORGETS = {"Elastic", "ElasticMultiLinear", "ElasticPPGap", "ENT"}


def forgets(material: Material) -> bool:
    """Whether it does not matter what came before. Gaps slide at forces that no arm brings."""
    return all(forgets(m) for m in material[1:]) if material[0] == "Parallel" else material[0] in FORGETS


def viscous(material: Material) -> bool:
    """Whether time matters."""
    return material[0] in {"Maxwell", "Viscous"} or any(viscous(m) for m in material[1:] if isinstance(m, tuple))


class Deck:
    """Commands in order; what they make bears rising tags."""

    def __init__(self) -> None:
        self.commands: list[list[Any]] = []
        self.places: list[Array] = []
        self.materials: dict[Material, int] = {}
        self._elements = 0

    @property
    def linear(self) -> bool:
        """Whether one step is as good as many."""
        return all(elastic(m) for m in self.materials)

    @property
    def forgets(self) -> bool:
        """Whether the order of loads does not matter."""
        return all(forgets(m) for m in self.materials)

    @property
    def viscous(self) -> bool:
        """Whether holding a load matters."""
        return any(viscous(m) for m in self.materials)

    def node(self, place: Array) -> int:
        """A new node at a place (3,) in m."""
        self.places.append(np.asarray(place, dtype=float))
        self.commands.append(["node", len(self.places), *map(float, place)])
        return len(self.places)

    def fix(self, node: int) -> None:
        """Hold a node in all six freedoms."""
        self.commands.append(["fix", node, 1, 1, 1, 1, 1, 1])

    def at(self, node: int) -> Array:
        """Where a node is."""
        return self.places[node - 1]

    def material(self, material: Material) -> int:
        """Its tag; the same material is made once, as elements take copies."""
        if material not in self.materials:
            parts = [self.material(m) if isinstance(m, tuple) else m for m in material[1:]]
            self.materials[material] = len(self.materials) + 1
            self.commands.append(["uniaxialMaterial", material[0], self.materials[material], *parts])
        return self.materials[material]

    def spring(self, i: int, j: int, materials: dict[int, Material], x: Array, y: Array) -> None:
        """Between two nodes at one place: directions 1 to 3 along x, y, z and 4 to 6 about them."""
        self._elements += 1
        tags = [self.material(m) for m in materials.values()]
        along = [*map(float, x), *map(float, y)]
        self.commands.append(
            ["element", "zeroLength", self._elements, i, j, "-mat", *tags, "-dir", *materials, "-orient", *along]
        )

    def hinge(self, i: int, materials: dict[int, Material], x: Array, y: Array) -> int:
        """A node behind node ``i``, stiff in all directions that no material is given for."""
        j = self.node(self.at(i))
        self.spring(i, j, {d: materials.get(d, ("Elastic", STIFF)) for d in range(1, 7)}, x, y)
        return j

    def reach(self, i: int, place: Array, section: Section | None = None) -> int:
        """A node at a place, held by node ``i`` through a beam, which is stiff without a section."""
        length = float(np.linalg.norm(place - self.at(i)))
        if length < SAME:
            return i
        j = self.node(place)
        if section is None and length < SHORT:
            self.commands.append(["rigidLink", "beam", i, j])
            return j
        s = section or RIGID
        self._elements += 1
        way = (place - self.at(i)) / length
        beside = np.cross(way, np.eye(3)[int(np.argmin(np.abs(way)))])
        self.commands.append(["geomTransf", "Linear", self._elements, *map(float, beside)])
        values = [s.area, s.modulus, s.shear, s.torsion, s.inertia, s.inertia]
        self.commands.append(["element", "elasticBeamColumn", self._elements, i, j, *values, self._elements])
        return j

    def bar(self, i: int, j: int, stiffness: float) -> None:
        """Pinned at both ends, stiffness in N/m along it."""
        self._elements += 1
        length = float(np.linalg.norm(self.at(j) - self.at(i)))
        tag = self.material(("Elastic", stiffness * length))
        self.commands.append(["element", "Truss", self._elements, i, j, 1.0, tag])
