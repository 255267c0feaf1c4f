"""Arms read from description files as plain data, and such files edited as text for the program that diagnoses."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

OWN = Path(__file__).parent / "arms"
BUNDLED = Path(__file__).parents[3] / "robots" / "data"
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
UNITS = {"mm": 1e-3, "m": 1.0, "deg": np.pi / 180, "rad": 1.0, "kg": 1.0, "1": 1.0, "GPa": 1e9, "kg/m^3": 1.0}


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
    text: str
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
    own = OWN / f"{name}.toml"
    text = (own if own.exists() else BUNDLED / f"{name}.toml").read_text(encoding="utf-8")
    data = tomllib.loads(text)
    joints = tuple(_joint(entry) for entry in data["joint"])
    bar = data.get("parallelogram")
    coordinates = [joint.coordinate for joint in joints]
    coupled = []
    for entry in data.get("coupling", []):
        row = np.zeros(len(joints))
        for term in entry["terms"]:
            row[coordinates.index(term["coordinate"])] = term["factor"]
        low, high = np.atleast_1d(_value(entry["limits"]))
        start = float(_value(entry["offset"])) if "offset" in entry else 0.0
        coupled.append((row, float(low) - start, float(high) - start))
    return Arm(
        name,
        text,
        joints,
        np.asarray(_value(data["flange"]["xyz"])),
        _links(name, data),
        float(_value(data["payload"])),
        bar is not None,
        float(np.linalg.norm(_value(bar["pin"]))) if bar else 0.0,
        tuple(coupled),
    )


def model_text(arm: Arm, springs: dict[str, float], load_path: str | None = None) -> str:
    """The description with these springs and no others; joints that are not named are held rigid."""
    text = re.sub(r"^stiffness = .*\n", "", arm.text, flags=re.MULTILINE)
    for name, value in springs.items():
        entry = f'stiffness = {{ value = {value:.6g}, unit = "N m/rad", source = "assumed" }}\n'
        head = rf'(\[\[joint\]\]\nname = "{re.escape(name)}"\ncoordinate = .*\n(?:(?:sign|offset|limits) = .*\n)+)'
        text, count = re.subn(head, rf"\g<1>{entry}", text)
        if count != 1:
            raise ValueError(f"{arm.name}: joint {name} stands {count} times in the description; once is right")
    if load_path:
        text = re.sub(r'^load_path = ".*"', f'load_path = "{load_path}"', text, flags=re.MULTILINE)
    return text


def _value(entry: dict[str, Any]) -> Vector:
    return np.asarray(entry["value"], dtype=float) * UNITS[entry["unit"]]


def _joint(entry: dict[str, Any]) -> Joint:
    if "dh" in entry:
        alpha, a, d = (float(_value(entry["dh"][key])) for key in ("alpha", "a", "d"))
        cos, sin = np.cos(alpha), np.sin(alpha)
        rotation = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
        position, axis = np.array([a, -sin * d, cos * d]), np.array([0.0, 0.0, 1.0])
    else:
        rotation, position = np.eye(3), _value(entry["frame"]["xyz"])
        axis = np.asarray(entry["frame"]["axis"], dtype=float)
    low, high = _value(entry["limits"])
    offset = float(_value(entry["offset"])) if "offset" in entry else 0.0
    sign = float(entry.get("sign", 1))
    return Joint(entry["name"], entry["coordinate"], sign, offset, (float(low), float(high)), position, rotation, axis)


def _links(name: str, data: dict[str, Any]) -> tuple[Link, ...]:
    bare = MASSES.get(name, {})
    links = [Link(body, body, mass, 0.0, 0.0, 0.0) for body, mass in bare.items()]
    for entry in data.get("link", []):
        material = data["materials"][entry["material"]]
        young = float(_value(material["youngs_modulus"]))
        shear = young / (2 + 2 * float(_value(material["poissons_ratio"])))
        sections = [entry["section"], entry.get("section_end", entry["section"])]
        area, inertia, polar = np.mean([_section(section) for section in sections], axis=0)
        mass = float(_value(entry["mass"]))
        links.append(Link(entry["name"], entry["body"], mass, young * inertia, shear * polar, young * area))
    return tuple(links)


def _section(entry: dict[str, Any]) -> tuple[float, float, float]:
    """Area, second moment (the mean of both axes) and torsion constant of a thin-walled section."""
    wall = float(_value(entry["wall"]))
    if entry["kind"] == "tube":
        radius = (float(_value(entry["diameter"])) - wall) / 2
        inertia = np.pi * radius**3 * wall
        return 2 * np.pi * radius * wall, inertia, 2 * inertia
    wide, high = float(_value(entry["width"])) - wall, float(_value(entry["height"])) - wall
    up = wall * (high**3 / 6 + wide * high**2 / 2)
    side = wall * (wide**3 / 6 + high * wide**2 / 2)
    return 2 * wall * (wide + high), (up + side) / 2, 2 * wall * wide**2 * high**2 / (wide + high)
