"""Arms as their description files state them, read as text: lines, limits, masses and sections."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .motors import ONE, cross, direct, origin, shift, then, turn

Array = NDArray[np.float64]
FILES = Path(__file__).resolve().parents[3] / "robots" / "data"
UNITS = {"m": 1.0, "mm": 1e-3, "deg": 1.0, "kg": 1.0, "GPa": 1e9, "1": 1.0}
G = 9.81
# N m/rad: near published values or of the class.
SPRINGS: dict[str, tuple[float, ...]] = {
    "xr701": (1.7e6, 1.4e6, 0.76e6, 1.1e6, 4e5, 2.5e5),
    "kr60-3": (2.1977e6, 0.8994e6, 1.1118e6, 6.44e4, 2.54e4, 2.0e4),
    "tx200": (1.5e6, 1.3e6, 9e5, 2.2e5, 1.4e5, 7e4),
}


def si(entry: Any) -> Array:
    """A quantity of the file."""
    return np.asarray(entry["value"], dtype=float) * UNITS[entry["unit"]]


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
    raw = tomllib.loads((FILES / f"{name}.toml").read_text(encoding="utf-8"))
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


def model_text(arm: Arm, springs: dict[str, float]) -> str:
    """The description with these springs in N m/rad; a joint without one is rigid."""
    lines = (FILES / f"{arm.name}.toml").read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line.startswith("stiffness ")]
    out = []
    for before, line in pairwise(["", *kept]):
        out.append(line)
        name = line.split('"')[1] if before == "[[joint]]" else ""
        if name in springs:
            out.append(f'stiffness = {{ value = {springs[name]:.6g}, unit = "N m/rad", source = "assumed" }}')
    return "\n".join(out) + "\n"
