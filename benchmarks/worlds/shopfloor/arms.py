"""Robots of this world, their links as beams, and how they yield."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..shared import description, si

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Springs that stand in the model where the bundled file has none, N m/rad: same-class values (FACTS, table 4).
SPRINGS = {
    "tx200": (2.4e6, 1.9e6, 1.2e6, 2.2e5, 1.6e5, 9e4),
    "xr701": (2.0e6, 1.4e6, 0.8e6, 6e5, 3e5, 1.5e5),
}
BUNDLED = ("kr60-3", "tx200", "xr701")
OWN = ("werft-7", "krume-5")


@dataclass(frozen=True)
class Axis:
    """One joint: origin in the frame before it (m, rotation matrix), unit axis, limits (deg), nominal spring."""

    name: str
    coordinate: str
    xyz: tuple[float, float, float]
    turn: tuple[tuple[float, ...], ...]
    axis: tuple[float, float, float]
    limits: tuple[float, float]
    spring: float


@dataclass(frozen=True)
class Robot:
    """An arm: axes from base to flange, the flange in the last frame (m), masses of the bodies and the payload (kg)."""

    name: str
    axes: tuple[Axis, ...]
    flange: tuple[float, float, float]
    masses: tuple[float, ...]
    payload: float
    pin_behind: float = 0.0

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.axes)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(axis.name for axis in self.axes)

    @property
    def parallelogram(self) -> bool:
        """Whether a bar drives the forearm."""
        return self.pin_behind > 0.0

    def nominal(self) -> Floats:
        """Springs of the maker's sheet, N m/rad."""
        return np.array([axis.spring for axis in self.axes])

    def limits(self) -> Floats:
        """Degrees, (dof, 2)."""
        return np.array([axis.limits for axis in self.axes])

    def off_drawing(self, rng: np.random.Generator, sigma: float = 1e-3) -> Robot:
        """The arm as built: each length that is not zero is off by about ``sigma`` m."""

        def off(xyz: tuple[float, ...]) -> tuple[float, float, float]:
            x, y, z = (v + (rng.normal(0.0, sigma) if v else 0.0) for v in xyz)
            return (x, y, z)

        return replace(self, axes=tuple(replace(a, xyz=off(a.xyz)) for a in self.axes), flange=off(self.flange))


def dh_origin(alpha: float, a: float, d: float, offset: float) -> tuple[Floats, Floats]:
    """Position and rotation of a modified Denavit-Hartenberg joint frame (Craig): Rx(alpha) Tx(a) Tz(d) Rz(offset)."""
    ca, sa = np.cos(np.radians(alpha)), np.sin(np.radians(alpha))
    turn = (Rotation.from_euler("x", alpha, degrees=True) * Rotation.from_euler("z", offset, degrees=True)).as_matrix()
    return np.array([a, -sa * d, ca * d]), np.round(turn, 15)


def _axis(joint: Mapping[str, Any], spring: float | None) -> Axis:
    offset, sign = si(joint["offset"]) if "offset" in joint else 0.0, joint.get("sign", 1)
    if "dh" in joint:
        dh = {key: si(joint["dh"][key]) for key in ("alpha", "a", "d")}
        xyz, turn = dh_origin(dh["alpha"], dh["a"], dh["d"], offset)
        about = np.array([0.0, 0.0, 1.0])
    else:
        about = np.array(joint["frame"]["axis"], dtype=float)
        xyz = np.array(si(joint["frame"]["xyz"]), dtype=float)
        turn = np.round(Rotation.from_rotvec(np.radians(offset) * about).as_matrix(), 15)
    low, high = si(joint["limits"])
    k = si(joint["stiffness"]) if "stiffness" in joint else spring or 0.0
    way = about * sign
    return Axis(
        joint["name"],
        joint["coordinate"],
        (float(xyz[0]), float(xyz[1]), float(xyz[2])),
        tuple(tuple(map(float, row)) for row in turn),
        (float(way[0]), float(way[1]), float(way[2])),
        (float(low), float(high)),
        float(k),
    )


@cache
def robot(name: str) -> Robot:
    """The arm of this name; only geometry, limits, masses and springs of its file are looked at."""
    table = tomllib.loads(description(name))
    springs = SPRINGS.get(name, (None,) * len(table["joint"]))
    axes = tuple(_axis(joint, k) for joint, k in zip(table["joint"], springs, strict=True))
    weight = {link["body"]: si(link["mass"]) for link in table["link"]}
    loop = table.get("parallelogram")
    return Robot(
        name,
        axes,
        tuple(si(table["flange"]["xyz"])),
        tuple(weight.get(a.name, 0.0) for a in axes),
        float(table["payload"]["value"]),
        abs(si(loop["pin"])[2]) if loop else 0.0,
    )


def _rpy(turn: Floats) -> tuple[float, float, float]:
    """Roll, pitch and yaw (rad); where pitch is a right angle, the yaw is zero."""
    pitch = float(np.arcsin(np.clip(-turn[2, 0], -1.0, 1.0)))
    if abs(turn[2, 0]) > 1.0 - 1e-12:
        return float(np.arctan2(-turn[2, 0] * turn[0, 1], turn[1, 1])), pitch, 0.0
    return float(np.arctan2(turn[2, 1], turn[2, 2])), pitch, float(np.arctan2(turn[1, 0], turn[0, 0]))


def urdf(arm: Robot) -> str:
    """The arm as URDF text; a body's mass sits halfway to the next joint, as a slender rod's."""
    ends = [*(a.xyz for a in arm.axes[1:]), arm.flange]
    parts = [f'<?xml version="1.0"?>\n<robot name="{arm.name}">\n  <link name="base"/>']
    for axis, end, mass in zip(arm.axes, ends, arm.masses, strict=True):
        parts.append(f'  <link name="{axis.name}_body">')
        if mass:
            x, y, z = (v / 2 for v in end)
            inertia = max(mass * sum(v * v for v in end) / 12, 1e-2)
            parts.append(
                f'    <inertial><origin xyz="{x:.9g} {y:.9g} {z:.9g}"/><mass value="{mass:.9g}"/>'
                f'<inertia ixx="{inertia:.6g}" iyy="{inertia:.6g}" izz="{inertia:.6g}" ixy="0" ixz="0" iyz="0"/>'
                "</inertial>"
            )
        parts.append("  </link>")
    parts.append('  <link name="flange"/>')
    parent = "base"
    for axis in arm.axes:
        child = f"{axis.name}_body"
        roll, pitch, yaw = _rpy(np.array(axis.turn))
        low, high = np.radians(axis.limits)
        parts.append(
            f'  <joint name="{axis.name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{" ".join(f"{v:.12g}" for v in axis.xyz)}" rpy="{roll:.15g} {pitch:.15g} {yaw:.15g}"/>'
            f'<axis xyz="{" ".join(f"{v:.12g}" for v in axis.axis)}"/>'
            f'<limit lower="{low:.12g}" upper="{high:.12g}" effort="10000" velocity="2"/></joint>'
        )
        parent = child
    seat = " ".join(f"{v:.12g}" for v in arm.flange)
    parts.append(
        f'  <joint name="flange_seat" type="fixed"><parent link="{parent}"/><child link="flange"/>'
        f'<origin xyz="{seat}"/></joint>\n</robot>\n'
    )
    return "\n".join(parts)


# Gauss-Legendre points on each straight piece; the integrands are smooth.
NODES, SHARES = np.polynomial.legendre.leggauss(12)


def _outline(section: Mapping[str, Any], wall: float) -> Floats:
    """Width, height and wall of a box; diameter twice and wall of a tube, m; the wall times a factor."""
    names = ("diameter", "diameter", "wall") if section["kind"] == "tube" else ("width", "height", "wall")
    return np.array([float(si(section[name])) for name in names]) * (1.0, 1.0, wall)


def yields(kind: str, outline: Floats, modulus: float, nu: float) -> Floats:
    """Flexibility per length (6,) of a section: along x; shear y, z; torsion; bending about y, z. y is the width."""
    width, height, wall = outline
    shear = modulus / (2.0 * (1.0 + nu))
    if kind == "tube":
        outer, inner = width / 2, width / 2 - wall
        area, bend = np.pi * (outer**2 - inner**2), np.pi / 4 * (outer**4 - inner**4)
        m = inner / outer
        kappa = 6 * (1 + nu) * (1 + m**2) ** 2 / ((7 + 6 * nu) * (1 + m**2) ** 2 + (20 + 12 * nu) * m**2)
        sheared, bent = kappa * shear * area, modulus * bend
        return 1.0 / np.array([modulus * area, sheared, sheared, 2 * shear * bend, bent, bent])
    b, h = width - wall, height - wall
    area = width * height - (width - 2 * wall) * (height - 2 * wall)
    about_y = (width * height**3 - (width - 2 * wall) * (height - 2 * wall) ** 3) / 12
    about_z = (height * width**3 - (height - 2 * wall) * (width - 2 * wall) ** 3) / 12
    torsion = 4 * (b * h) ** 2 * wall / (2 * (b + h))
    across = [2 * b * wall * 5 / 6, 2 * h * wall * 5 / 6]
    return 1.0 / np.array(
        [
            modulus * area,
            shear * across[0],
            shear * across[1],
            shear * torsion,
            modulus * about_y,
            modulus * about_z,
        ]
    )


def _action(point: Floats, axes: Floats) -> Floats:
    """Motion action (linear before angular) from a section's axes at a point to the body's frame."""
    x, y, z = point
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    action = np.zeros((6, 6))
    action[:3, :3] = action[3:, 3:] = axes
    action[:3, 3:] = cross @ axes
    return action


def _axes(x: Floats, up: Floats) -> Floats:
    """Axes of a section as columns: along, across, and towards ``up``."""
    up = up - (up @ x) * x
    if np.linalg.norm(up) < 1e-6:
        up = np.cross(x, [0.0, 1.0, 0.0] if abs(x[1]) < 0.9 else [0.0, 0.0, 1.0])
    z = up / np.linalg.norm(up)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _along(points: Sequence[Floats], link: Mapping[str, Any], wall: float, modulus: float, nu: float) -> Floats:
    kind, first = link["section"]["kind"], _outline(link["section"], wall)
    last = _outline(link.get("section_end", link["section"]), wall)
    pieces = [b - a for a, b in pairwise(points)]
    total = sum(float(np.linalg.norm(p)) for p in pieces)
    flexibility, gone = np.zeros((6, 6)), 0.0
    for start, piece in zip(points, pieces, strict=False):
        length = float(np.linalg.norm(piece))
        axes = _axes(piece / length, np.array(link.get("beam_up", (1, 0, 0)), dtype=float))
        for node, share in zip((NODES + 1) / 2, SHARES / 2, strict=True):
            at = (gone + node * length) / total
            c = yields(kind, first + at * (last - first), modulus, nu)
            ad = _action(start + node * piece, axes)
            flexibility += share * length * (ad * c) @ ad.T
        gone += length
    return flexibility


def _ends(arm: Robot, body: int, link: Mapping[str, Any]) -> list[Floats]:
    """Corners of a link in its body's frame: from its origin over ``via`` to where the next body begins."""
    last = arm.flange if body == arm.dof - 1 else arm.axes[body + 1].xyz
    return [np.zeros(3), *(np.asarray(si(v), dtype=float) for v in link.get("via", ())), np.array(last)]


@dataclass(frozen=True)
class Beam:
    """A link: its name, its body (a joint's number, -2 for the base) and 6x6 flexibility in that body's frame."""

    name: str
    body: int
    flexibility: Floats


@cache
def beams(name: str, wall: float = 1.0, modulus: float = 1.0) -> tuple[Beam, ...]:
    """The links of an arm, walls and moduli times these factors."""
    arm, table = robot(name), tomllib.loads(description(name))
    found = []
    for link in table["link"]:
        body = -1 if link["body"] == "base" else arm.names.index(link["body"])
        stuff = table["materials"][link["material"]]
        e, nu = modulus * float(si(stuff["youngs_modulus"])), float(si(stuff["poissons_ratio"]))
        flexibility = _along(_ends(arm, body, link), link, wall, e, nu)
        found.append(Beam(str(link["name"]), -2 if body < 0 else body, flexibility))
    return tuple(found)


@dataclass(frozen=True)
class Postures:
    """What a number of poses have in common.

    parts : (n, dof + 2, 6, 6) actions of joints, base and tool; linear before angular
    turns : (n, dof, 6) motion of the tool by a turn of a spring by 1 rad
    weight : (n, dof) torque of the links' weight in the springs, N m
    centres : (n, dof, 3) joint origins in base axes, m
    tool, flange_axes : (n, 3) m and (n, 3, 3)
    """

    parts: Floats
    turns: Floats
    weight: Floats
    centres: Floats
    tool: Floats
    flange_axes: Floats


def _springs(arm: Robot, turns: Floats, weight: Floats, loop: bool) -> tuple[Floats, Floats]:
    """With a parallelogram the third drive holds the forearm's direction, so the second moves the elbow alone."""
    if not loop:
        return turns, weight
    way = float(np.dot(arm.axes[1].axis, arm.axes[2].axis))
    turns, weight = turns.copy(), weight.copy()
    turns[:, 1] -= way * turns[:, 2]
    weight[:, 1] -= way * weight[:, 2]
    return turns, weight


def postures(arm: Robot, q: Floats, shift: Floats | None = None, loop: bool | None = None) -> Postures:
    """The arm at joint angles ``q`` (rad, (n, dof)); ``shift`` moves the tool point, in flange axes (m)."""
    model = pin.buildModelFromXML(urdf(arm))
    data = model.createData()
    seat = pin.SE3(np.eye(3), np.array(arm.flange) + (0.0 if shift is None else shift))
    n, dof = q.shape
    parts, centres = np.zeros((n, dof + 2, 6, 6)), np.zeros((n, dof, 3))
    weight, tool, axes = np.zeros((n, dof)), np.zeros((n, 3)), np.zeros((n, 3, 3))
    for i, angles in enumerate(q):
        pin.forwardKinematics(model, data, angles)
        weight[i] = -pin.computeGeneralizedGravity(model, data, angles)
        pin.forwardKinematics(model, data, angles)
        end = data.oMi[dof] * seat
        seen = pin.SE3(np.eye(3), end.translation).inverse()
        frames = [*(data.oMi[k + 1] for k in range(dof)), pin.SE3.Identity(), end]
        for k, frame in enumerate(frames):
            parts[i, k] = (seen * frame).toActionMatrix()
        centres[i] = [frame.translation for frame in frames[:dof]]
        tool[i], axes[i] = end.translation, end.rotation
    about = np.array([a.axis for a in arm.axes])
    turns = np.einsum("nkij,kj->nki", parts[:, :dof, :, 3:], about)
    turns, weight = _springs(arm, turns, weight, arm.parallelogram if loop is None else loop)
    return Postures(parts, turns, weight, centres, tool, axes)


def lateral(arm: Robot, joint: int) -> Floats:
    """Two unit axes across a joint's own, in its frame, (2, 3)."""
    axis = np.array(arm.axes[joint].axis)
    first = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first)])


def springs_only(at: Postures, pose: np.ndarray, wrench: Floats, compliance: Floats) -> Floats:
    """Displacement of the tool, (n, 6) m and rad, of readings at ``pose`` under ``wrench``, by linear springs alone."""
    turns = at.turns[pose]
    torque = np.einsum("nki,ni->nk", turns, wrench)
    return np.asarray(np.einsum("nki,nk,k->ni", turns, torque, compliance))
