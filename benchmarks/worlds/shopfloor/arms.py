"""Robots of this world as joint origins, axes, limits and masses; three bundled geometries and two arms of our own."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

DATA = Path(__file__).resolve().parents[3] / "robots" / "data"
HERE = Path(__file__).resolve().parent
TO_SI = {"mm": 1e-3, "m": 1.0, "N mm/rad": 1e-3, "N m/rad": 1.0, "deg": 1.0, "kg": 1.0}
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


def _si(figure: Mapping[str, Any] | None, default: float = 0.0) -> Any:
    if figure is None:
        return default
    value = figure["value"]
    factor = TO_SI[figure["unit"]]
    return [factor * v for v in value] if isinstance(value, list) else factor * value


def dh_origin(alpha: float, a: float, d: float, offset: float) -> tuple[Floats, Floats]:
    """Position and rotation of a modified Denavit-Hartenberg joint frame (Craig): Rx(alpha) Tx(a) Tz(d) Rz(offset)."""
    ca, sa = np.cos(np.radians(alpha)), np.sin(np.radians(alpha))
    turn = (Rotation.from_euler("x", alpha, degrees=True) * Rotation.from_euler("z", offset, degrees=True)).as_matrix()
    return np.array([a, -sa * d, ca * d]), np.round(turn, 15)


def _axis(joint: Mapping[str, Any], spring: float | None) -> Axis:
    offset, sign = _si(joint.get("offset")), joint.get("sign", 1)
    if "dh" in joint:
        dh = {key: _si(joint["dh"][key]) for key in ("alpha", "a", "d")}
        xyz, turn = dh_origin(dh["alpha"], dh["a"], dh["d"], offset)
        about = np.array([0.0, 0.0, 1.0])
    else:
        about = np.array(joint["frame"]["axis"], dtype=float)
        xyz = np.array(_si(joint["frame"]["xyz"]), dtype=float)
        turn = np.round(Rotation.from_rotvec(np.radians(offset) * about).as_matrix(), 15)
    low, high = _si(joint["limits"])
    k = _si(joint.get("stiffness"), spring or 0.0)
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


def source_of(name: str) -> Path:
    return (DATA if name in BUNDLED else HERE / "data") / f"{name}.toml"


@cache
def robot(name: str) -> Robot:
    """The arm of this name; only geometry, limits, masses and springs of its file are looked at."""
    table = tomllib.loads(source_of(name).read_text(encoding="utf-8"))
    springs = SPRINGS.get(name, (None,) * len(table["joint"]))
    axes = tuple(_axis(joint, k) for joint, k in zip(table["joint"], springs, strict=True))
    weight = {link["body"]: _si(link["mass"]) for link in table["link"]}
    loop = table.get("parallelogram")
    return Robot(
        name,
        axes,
        tuple(_si(table["flange"]["xyz"])),
        tuple(weight.get(a.name, 0.0) for a in axes),
        float(table["payload"]["value"]),
        abs(_si(loop["pin"])[2]) if loop else 0.0,
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
