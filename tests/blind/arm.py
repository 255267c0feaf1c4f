"""The robot as plain numbers, read from the bundled TOML files as data (SI units, radians)."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DATA = Path(__file__).resolve().parents[2] / "robots" / "data"
FACTORS = {"m": 1.0, "mm": 1e-3, "deg": np.pi / 180, "rad": 1.0, "GPa": 1e9, "N mm/rad": 1e-3, "N m/rad": 1.0, "1": 1.0}
# The XR701's springs were never published; these are the figures a rigid-link fit of its readings gives.
NOMINAL_SPRINGS = {
    "xr701": {"j2": 1.4e6, "j3": 0.76e6, "j4": 1.4e6, "j5": 0.6e6},
}
# Newtons, up to half of what the arm carries (xr701) and three quarters (kr60-3).
LOADS = {"xr701": (150.0, 375.0, 650.0), "kr60-3": (150.0, 300.0, 450.0)}


def si(quantity: dict[str, Any]) -> Any:
    """A ``{value, unit}`` entry in SI units."""
    return np.asarray(quantity["value"], dtype=float) * FACTORS[quantity["unit"]]


@dataclass(frozen=True)
class Section:
    """Outer dimensions in m; a tube has width = height = diameter."""

    kind: str
    width: float
    height: float
    wall: float


@dataclass(frozen=True)
class Link:
    """A straight or bent beam on body ``body`` (0 is the base, i the body behind joint i), tapering linearly."""

    name: str
    body: int
    points: Array  # (m, 3) in the body's frame
    up: Array  # the direction of the section's height, body frame
    start: Section
    end: Section
    youngs: float
    poisson: float


@dataclass(frozen=True)
class Bar:
    """The parallelogram: pin in the forearm's frame, bar and crank as sections."""

    pin: Array
    bar: Section
    crank: Section
    youngs: float
    poisson: float


@dataclass(frozen=True)
class Arm:
    """A six-joint arm: fixed transforms (R, t) before each joint, rotation about ``axes`` by sign * q + offset."""

    name: str
    coordinates: tuple[str, ...]
    rotations: Array  # (6, 3, 3)
    translations: Array  # (6, 3)
    axes: Array  # (6, 3)
    shifts: Array  # (6,) along the axis after the rotation (DH's d)
    signs: Array
    offsets: Array
    limits: Array  # (6, 2) rad, of the coordinates as named
    couplings: tuple[tuple[Array, float, float, float], ...]  # factors (6,), offset, low, high
    flange: Array
    links: tuple[Link, ...]
    bar: Bar | None
    parallelogram: bool
    stiffness: tuple[float | None, ...]  # N m/rad of the model's springs, None where the joint is held rigid


def section(entry: dict[str, Any]) -> Section:
    if entry["kind"] == "tube":
        d = float(si(entry["diameter"]))
        return Section("tube", d, d, float(si(entry["wall"])))
    return Section("box", float(si(entry["width"])), float(si(entry["height"])), float(si(entry["wall"])))


def _joint(entry: dict[str, Any]) -> tuple[Array, Array, Array, float]:
    """Fixed rotation, fixed translation, axis and shift along it."""
    if "dh" in entry:
        alpha, a, d = (float(si(entry["dh"][name])) for name in ("alpha", "a", "d"))
        c, s = np.cos(alpha), np.sin(alpha)
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), np.array([a, 0.0, 0.0]), np.array([0, 0, 1.0]), d
    return np.eye(3), si(entry["frame"]["xyz"]), np.asarray(entry["frame"]["axis"], dtype=float), 0.0


def _links(data: dict[str, Any], joints: list[tuple[Array, Array, Array, float]], flange: Array) -> list[Link]:
    # Where the next joint's frame starts, seen from the body before it: it does not depend on the angles.
    ends = [t + R @ (axis * d) for R, t, axis, d in joints] + [flange]
    numbers = {"base": 0} | {j["name"]: i + 1 for i, j in enumerate(data["joint"])}
    links = []
    for entry in data["link"]:
        material = data["materials"][entry["material"]]
        body = numbers[entry["body"]]
        points = [np.zeros(3), *(si(v) for v in entry.get("via", [])), ends[body]]
        start = section(entry["section"])
        end = section(entry["section_end"]) if "section_end" in entry else start
        up = np.asarray(entry.get("beam_up", [1, 0, 0]), dtype=float)
        youngs, poisson = float(si(material["youngs_modulus"])), float(material["poissons_ratio"]["value"])
        links.append(Link(entry["name"], body, np.array(points), up, start, end, youngs, poisson))
    return links


@cache
def arm(name: str) -> Arm:
    """One of the bundled robots, by its name."""
    data = tomllib.loads((DATA / f"{name}.toml").read_text(encoding="utf-8"))
    joints = [_joint(entry) for entry in data["joint"]]
    flange = si(data["flange"]["xyz"])
    names = [entry["coordinate"] for entry in data["joint"]]
    couplings = []
    for entry in data.get("coupling", []):
        factors = np.zeros(6)
        for term in entry["terms"]:
            factors[names.index(term["coordinate"])] = term["factor"]
        low, high = si(entry["limits"])
        couplings.append((factors, float(si(entry["offset"])), float(low), float(high)))
    bar = None
    if "parallelogram" in data:
        entry = data["parallelogram"]
        material = data["materials"][entry["bar_material"]]
        youngs, poisson = float(si(material["youngs_modulus"])), float(material["poissons_ratio"]["value"])
        bar = Bar(si(entry["pin"]), section(entry["bar"]), section(entry["crank"]), youngs, poisson)
    own = NOMINAL_SPRINGS.get(name)
    springs = [
        (own.get(e["name"]) if own else float(si(e["stiffness"])) if "stiffness" in e else None) for e in data["joint"]
    ]
    return Arm(
        name=name,
        coordinates=tuple(names),
        rotations=np.array([j[0] for j in joints]),
        translations=np.array([j[1] for j in joints]),
        axes=np.array([j[2] for j in joints]),
        shifts=np.array([j[3] for j in joints]),
        signs=np.array([float(e.get("sign", 1)) for e in data["joint"]]),
        offsets=np.array([float(si(e["offset"])) if "offset" in e else 0.0 for e in data["joint"]]),
        limits=np.array([si(e["limits"]) for e in data["joint"]]),
        couplings=tuple(couplings),
        flange=flange,
        links=tuple(_links(data, joints, flange)),
        bar=bar,
        parallelogram=data["load_path"] == "parallelogram",
        stiffness=tuple(springs),
    )
