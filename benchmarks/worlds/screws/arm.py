"""Screws, links as beams of screws, and the arms of this world."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ..shared import description, si

Array = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


def hat(vector: Array) -> Array:
    """Matrix (..., 3, 3) of the cross product with ``vector`` (..., 3)."""
    x, y, z = np.moveaxis(vector, -1, 0)
    o = np.zeros_like(x)
    return np.stack([np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], -2)


def screw_through(axis: Array, point: Array) -> Array:
    """Unit screw (6,) of a rotation about ``axis`` through ``point``."""
    unit = np.asarray(axis, float) / np.linalg.norm(axis)
    return np.concatenate([unit, np.cross(point, unit)])


def exponential(screw: Array, angle: Array) -> Array:
    """Motion (n, 4, 4) by ``angle`` (n,) in rad about a unit screw (6,) of a rotation."""
    K, v, a = hat(screw[:3]), screw[3:], np.asarray(angle, float)[:, None, None]
    sin, cos = np.sin(a), np.cos(a)
    motion = np.zeros((len(a), 4, 4))
    motion[:, :3, :3] = np.eye(3) + sin * K + (1.0 - cos) * (K @ K)
    slide = a * np.eye(3) + (1.0 - cos) * K + (a - sin) * (K @ K)
    motion[:, :3, 3] = slide @ v
    motion[:, 3, 3] = 1.0
    return motion


def adjoint(motion: Array) -> Array:
    """Map (n, 6, 6) of twists by ``motion`` (n, 4, 4)."""
    R, p = motion[:, :3, :3], motion[:, :3, 3]
    big = np.zeros((len(motion), 6, 6))
    big[:, :3, :3] = R
    big[:, 3:, 3:] = R
    big[:, 3:, :3] = hat(p) @ R
    return big


def body_motions(screws: Array, angles: Array) -> Array:
    """Motions (n, joints + 1, 4, 4) of base and bodies from home, of screws (6, joints) and angles (n, joints)."""
    count, joints = angles.shape
    motions = np.tile(np.eye(4), (count, joints + 1, 1, 1))
    for i in range(joints):
        motions[:, i + 1] = motions[:, i] @ exponential(screws[:, i], angles[:, i])
    return motions


def axes_at(screws: Array, motions: Array) -> Array:
    """Screw axes (n, 6, joints) at the poses of ``body_motions``: the space Jacobian."""
    columns = [adjoint(motions[:, i]) @ screws[:, i] for i in range(screws.shape[1])]
    return np.stack(columns, -1)


def wrench_at(force: Array, point: Array) -> Array:
    """Wrench (n, 6) of a force (n, 3) at a point (n, 3)."""
    return np.concatenate([np.cross(point, force), force], axis=1)


def displacement(twist: Array, point: Array) -> Array:
    """Displacement (n, 3) of a point (n, 3) by a small twist (n, 6)."""
    return twist[:, 3:] + np.cross(twist[:, :3], point)


def carried(compliance: Array, motion: Array, wrench: Array) -> Array:
    """Twist (n, 6) by a spatial compliance (6, 6) at home of a body that ``motion`` moved, under wrenches (n, 6)."""
    ad = adjoint(motion)
    felt = np.einsum("nji,nj->ni", ad, wrench)
    return np.asarray(np.einsum("nij,nj->ni", ad, felt @ compliance.T))


@dataclass(frozen=True)
class Section:
    """A thin box (width, height) or tube (width = height = diameter) with its wall, in m."""

    box: bool
    width: float
    height: float
    wall: float

    def stiffness(self, youngs: float, poisson: float) -> Array:
        """Stiffness (6,) per length: torsion, bending about y, about z, stretching, shear along y, along z."""
        w, h, t = self.width, self.height, self.wall
        shear = youngs / (2.0 * (1.0 + poisson))
        if not self.box:
            inner = w - 2.0 * t
            area, second = np.pi / 4.0 * (w**2 - inner**2), np.pi / 64.0 * (w**4 - inner**4)
            return np.array(
                [2 * shear * second, youngs * second, youngs * second, youngs * area, *[shear * area / 2] * 2]
            )
        wi, hi, wm, hm = w - 2 * t, h - 2 * t, w - t, h - t
        area = w * h - wi * hi
        about_y, about_z = (w * h**3 - wi * hi**3) / 12.0, (h * w**3 - hi * wi**3) / 12.0
        torsion = 2.0 * t * (wm * hm) ** 2 / (wm + hm)
        webs = [shear * 2 * t * w * 5 / 6, shear * 2 * t * h * 5 / 6]
        return np.array([shear * torsion, youngs * about_y, youngs * about_z, youngs * area, *webs])


@dataclass(frozen=True)
class Link:
    """A casing: path of points (k, 3) at home in base axes, its body (0 the base), sections at its ends."""

    name: str
    body: int
    path: Array
    up: Array
    start: Section
    end: Section
    youngs: float
    poisson: float

    def compliance(self) -> Array:
        """Spatial compliance (6, 6) at home of the whole link, by three Gauss points a piece of its path."""
        lengths = np.linalg.norm(np.diff(self.path, axis=0), axis=1)
        whole, total, done = float(lengths.sum()), np.zeros((6, 6)), 0.0
        nodes, weights = np.polynomial.legendre.leggauss(8)
        for a, b, length in zip(self.path[:-1], self.path[1:], lengths, strict=True):
            if length < 1e-9:
                continue
            along = (b - a) / length
            frame = _frame(along, self.up)
            for node, weight in zip(nodes, weights, strict=True):
                s = 0.5 * (1.0 + node)
                soft = 1.0 / self._section((done + s * length) / whole).stiffness(self.youngs, self.poisson)
                total += 0.5 * weight * length * _element(frame, a + s * (b - a), soft)
            done += length
        return total

    def _section(self, share: float) -> Section:
        a, b = self.start, self.end
        mixed = [(1 - share) * x + share * y for x, y in ((a.width, b.width), (a.height, b.height), (a.wall, b.wall))]
        return Section(a.box, *mixed)


def _frame(along: Array, up: Array) -> Array:
    """Axes (3, 3) of a section as rows: along the link, its width, its height."""
    height = up - (up @ along) * along
    if np.linalg.norm(height) < 1e-6:
        height = np.array([along[1], along[2], along[0]]) - (along[1] * along[0]) * along
        height -= (height @ along) * along
    height = height / np.linalg.norm(height)
    return np.stack([along, np.cross(height, along), height])


def _element(frame: Array, point: Array, soft: Array) -> Array:
    """Spatial compliance (6, 6) per length of a section at ``point``: six screws with their softness."""
    turns = [screw_through(axis, point) for axis in frame]
    slides = [np.concatenate([np.zeros(3), axis]) for axis in frame]
    screws = np.stack([*turns, *slides])
    return np.asarray(screws.T * soft @ screws)


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
    """A figure of a description file, angles in rad."""
    return si(entry, np.pi / 180.0)


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
    data = tomllib.loads(description(name))
    joints = tuple(j["name"] for j in data["joint"])
    frames, axes = _home(data)
    centres = np.stack([f[:3, 3] for f in frames[:-1]])
    given = [figure(j["stiffness"]) if "stiffness" in j else 0.0 for j in data["joint"]]
    plate = data.get("parallelogram")
    fold = data["coupling"][0]["limits"]["value"] if plate else None
    return Arm(
        name=name,
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
