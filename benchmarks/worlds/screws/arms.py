"""The arms of this world: read from description files as data, with screws at home; bundled ones and two of its own."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from .beams import Link, Section
from .screws import Array, screw_through

BUNDLED = Path(__file__).resolve().parents[3] / "robots" / "data"
OWN = Path(__file__).resolve().parent / "data"
UNITS = {"mm": 1e-3, "m": 1.0, "deg": np.pi / 180.0, "GPa": 1e9, "kg": 1.0, "1": 1.0, "N mm/rad": 1e-3, "N m/rad": 1.0}
# Nominal springs in N m/rad of arms whose file has none: within the fact sheet's 4e5 to 4e6 and 2e4 to 3e6.
NOMINAL = {
    "tx200": (2.4e6, 1.7e6, 1.2e6, 3.0e5, 2.2e5, 1.1e5),
    "xr701": (2.2e6, 1.4e6, 7.6e5, 1.1e6, 6.0e5, 2.5e5),
}
# Angles that somebody would measure at, in deg: clear of the floor and of the arm's own trunk.
BOXES = {
    "kr60-3": ((-80, 80), (-115, -20), (-55, 45), (-150, 150), (-100, 100), (-120, 120)),
    "tx200": ((-80, 80), (-15, 65), (25, 125), (-150, 150), (-100, 100), (-120, 120)),
    "xr701": ((-80, 80), (-35, 45), (42, 113), (-180, 180), (-95, 95), (-120, 120)),
    "mast7": ((-80, 80), (5, 75), (-40, 40), (30, 110), (-120, 120), (-90, 90), (-120, 120)),
    "picker5": ((-80, 80), (-20, 60), (30, 120), (-70, 80), (-150, 150)),
}


@dataclass(frozen=True)
class Arm:
    """An arm: names; screws (6, n), joint centres (n, 3) and flange (4, 4) at home; springs; box of angles."""

    name: str
    text: str
    joints: tuple[str, ...]
    coordinates: tuple[str, ...]
    screws: Array
    centres: Array
    flange: Array
    sign: Array
    offset: Array
    limits_deg: Array
    box_deg: Array
    springs: Array
    payload_newton: float
    links: tuple[Link, ...]
    pin: float | None = None
    folded_deg: tuple[float, float] | None = None

    @property
    def size(self) -> int:
        """Number of joints."""
        return len(self.joints)

    def joint_angles(self, q: Array) -> Array:
        """Angles from home in rad of coordinates in rad."""
        return self.sign * q + self.offset

    def displaced(self, shifts: Array, last: Array) -> Arm:
        """The arm as it was built: joint centres (n, 3) and flange (3,) shifted by so many m."""
        centres = self.centres + np.cumsum(shifts, axis=0)
        screws = np.stack([screw_through(s[:3], c) for s, c in zip(self.screws.T, centres, strict=True)], -1)
        flange = self.flange.copy()
        flange[:3, 3] += shifts.sum(axis=0) + last
        return replace(self, centres=centres, screws=screws, flange=flange)


def figure(entry: Any) -> Any:
    """A figure of a description file in SI units; lists as arrays."""
    value = entry["value"]
    scale = UNITS[entry["unit"]]
    return np.asarray(value, float) * scale if isinstance(value, list) else float(value) * scale


def turn(axis: str, angle: float) -> Array:
    """Rotation (4, 4) about x or z."""
    c, s = np.cos(angle), np.sin(angle)
    motion = np.eye(4)
    a, b = {"x": (1, 2), "z": (0, 1)}[axis]
    motion[a, a], motion[a, b], motion[b, a], motion[b, b] = c, -s, s, c
    return motion


def step(*xyz: float) -> Array:
    """Translation (4, 4)."""
    motion = np.eye(4)
    motion[:3, 3] = xyz
    return motion


def _home(data: dict[str, Any]) -> tuple[list[Array], list[Array]]:
    """Joint frames at home (4, 4) and axes in base axes (3,) of a description's joints, then the flange's frame."""
    here, frames, axes = np.eye(4), [], []
    for joint in data["joint"]:
        axis = np.array([0.0, 0.0, 1.0])
        if "dh" in joint:
            alpha, a, d = (figure(joint["dh"][k]) for k in ("alpha", "a", "d"))
            here = here @ turn("x", alpha) @ step(a, 0, 0) @ step(0, 0, d)
        else:
            here = here @ step(*figure(joint["frame"]["xyz"]))
            axis = np.asarray(joint["frame"]["axis"], float)
        frames.append(here)
        axes.append(here[:3, :3] @ axis)
    frames.append(here @ step(*figure(data["flange"]["xyz"])))
    return frames, axes


def _section(entry: dict[str, Any]) -> Section:
    wall = figure(entry["wall"])
    if entry["kind"] == "tube":
        return Section(False, figure(entry["diameter"]), figure(entry["diameter"]), wall)
    return Section(True, figure(entry["width"]), figure(entry["height"]), wall)


def _link(entry: dict[str, Any], data: dict[str, Any], frames: list[Array], joints: tuple[str, ...]) -> Link:
    body = 0 if entry["body"] == "base" else joints.index(entry["body"]) + 1
    frame = np.eye(4) if body == 0 else frames[body - 1]
    via = [frame[:3, :3] @ figure(v) + frame[:3, 3] for v in entry.get("via", [])]
    path = np.stack([frame[:3, 3], *via, frames[body][:3, 3]])
    material = data["materials"][entry["material"]]
    start = _section(entry["section"])
    end = _section(entry["section_end"]) if "section_end" in entry else start
    up = frame[:3, :3] @ np.asarray(entry.get("beam_up", [1, 0, 0]), float)
    stiff = figure(material["youngs_modulus"]), figure(material["poissons_ratio"])
    return Link(entry["name"], body, path, up, start, end, *stiff)


@cache
def arm(name: str) -> Arm:
    """The arm of that name, as its description says."""
    own = OWN / f"{name}.toml"
    text = (own if own.is_file() else BUNDLED / f"{name}.toml").read_text(encoding="utf-8")
    data = tomllib.loads(text)
    joints = tuple(j["name"] for j in data["joint"])
    frames, axes = _home(data)
    centres = np.stack([f[:3, 3] for f in frames[:-1]])
    given = [figure(j["stiffness"]) if "stiffness" in j else 0.0 for j in data["joint"]]
    plate = data.get("parallelogram")
    fold = data["coupling"][0]["limits"]["value"] if plate else None
    return Arm(
        name=name,
        text=text,
        joints=joints,
        coordinates=tuple(j["coordinate"] for j in data["joint"]),
        screws=np.stack([screw_through(a, c) for a, c in zip(axes, centres, strict=True)], -1),
        centres=centres,
        flange=frames[-1],
        sign=np.array([float(j.get("sign", 1)) for j in data["joint"]]),
        offset=np.array([figure(j["offset"]) if "offset" in j else 0.0 for j in data["joint"]]),
        limits_deg=np.array([j["limits"]["value"] for j in data["joint"]], float),
        box_deg=np.array(BOXES[name], float),
        springs=np.array(NOMINAL.get(name, given), float),
        payload_newton=9.81 * figure(data["payload"]),
        links=tuple(_link(entry, data, frames, joints) for entry in data.get("link", [])),
        pin=float(np.linalg.norm(figure(plate["pin"]))) if plate else None,
        folded_deg=(float(fold[0]), float(fold[1])) if fold else None,
    )
