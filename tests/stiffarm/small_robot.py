"""A made-up robot as a URDF, and readings of it: what a user brings who has written no Python."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from fem import build_model, deflection
from robots import load_description

_LINK = '<link name="{name}"><inertial><mass value="{mass}"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'  # noqa: E501
_JOINT = (
    '<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>'
    '<axis xyz="{axis}"/><limit effort="0" velocity="1" lower="{low}" upper="{high}"/></joint>'
)
# Name, place in the one before (m), axis, limits (rad): waist, shoulder, elbow, wrist.
AXES = (
    ("waist", "0 0 0.4", "0 0 1", -3.0, 3.0),
    ("shoulder", "0.1 0 0.2", "0 1 0", -1.5, 1.5),
    ("elbow", "0 0 0.7", "0 1 0", -2.0, 2.0),
    ("wrist", "0.6 0 0", "0 1 0", -2.0, 2.0),
)
STIFFNESS = {"waist": 6e5, "shoulder": 4e5, "elbow": 2.5e5, "wrist": 8e4}


def write_urdf(path: Path) -> Path:
    """Four axes and a tool 0.25 m behind the wrist."""
    links = ["base_link", *(f"link_{name}" for name, *_ in AXES)]
    parts = [_LINK.format(name=name, mass=20.0) for name in links]
    parts.append(_LINK.format(name="tool0", mass=1.0))
    for k, (name, xyz, axis, low, high) in enumerate(AXES):
        place = {"parent": links[k], "child": links[k + 1], "xyz": xyz, "axis": axis, "low": low, "high": high}
        parts.append(_JOINT.format(name=name, **place))
    parts.append(
        f'<joint name="tool" type="fixed"><parent link="{links[-1]}"/><child link="tool0"/>'
        '<origin xyz="0.25 0 0"/></joint>'
    )
    path.write_text(f'<?xml version="1.0"?>\n<robot name="small">\n{chr(10).join(parts)}\n</robot>\n', encoding="utf-8")
    return path


def write_readings(
    urdf: Path,
    path: Path,
    poses: int = 8,
    seed: int = 0,
    *,
    noise_mm: float = 0.002,
    sideways: bool = True,
    shoulder: Callable[[float], float] | None = None,
) -> Path:
    """Readings of dx, dy and dz under two loads, by the robot with springs of STIFFNESS and Gaussian noise.

    ``shoulder``: the shoulder's spring over its angle (rad), where it is no constant.
    """
    robot = build_model(load_description(urdf))
    names = robot.robot.joint_names
    model = robot.with_springs({name: STIFFNESS[label] for name, label in zip(names, STIFFNESS, strict=True)})
    rng = np.random.default_rng(seed)
    low, high = robot.robot.limits.T
    directions = ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)) if sideways else ((0.0, 0.0, -1.0),)
    rows: list[Sequence[object]] = []
    for k, q in enumerate(rng.uniform(0.6 * low, 0.6 * high, (poses, len(low)))):
        if shoulder is not None:
            model = model.with_springs({names[1]: shoulder(float(q[1]))})
        for direction in directions:
            for load in (100.0, 200.0):
                wrench = np.array([*(load * v for v in direction), 0.0, 0.0, 0.0])
                moved = deflection(model, q[None], wrench[None])[0, :3] * 1e3
                for repeat in (1, 2):
                    read = moved + noise_mm * rng.normal(size=3)
                    angles = [f"{math.degrees(v):.6f}" for v in q]
                    rows.append([f"S{seed}-{k}", *angles, *wrench[:3], *(f"{v:.5f}" for v in read), repeat])
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["pose", *robot.robot.coordinates, "fx_N", "fy_N", "fz_N", "dx_mm", "dy_mm", "dz_mm", "repeat"])
        writer.writerows(rows)
    return path
