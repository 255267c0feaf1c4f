"""Five arms with seven axes as tables of numbers, from their makers' public descriptions; nothing else is taken."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robots import ModelDescription
from robots.urdf.reading import read_urdf

# A quarter of a turn in rad, and a turn each way, which stands for a joint without limits.
Q, WHOLE = 0.5 * np.pi, 2.0 * np.pi
Z, Y, MINUS_Y = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
# Of each joint: origin xyz (m) and rpy (rad) in the body before, axis, limits (rad).
Row = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float], tuple[float, float]]
NONE = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SevenAxisArm:
    """An arm: its joints, its flange (xyz, rpy), where the numbers are from, and where a part is put before it (m)."""

    name: str
    source: str
    licence: str
    joints: tuple[Row, ...]
    flange: tuple[tuple[float, float, float], tuple[float, float, float]]
    part: tuple[float, float, float]

    def urdf(self) -> str:
        """The arm as URDF, for this program and for others."""
        links = "".join(f'<link name="b{i}"/>' for i in range(len(self.joints) + 1)) + '<link name="flange"/>'
        rows = [
            f'<joint name="joint_{i + 1}" type="revolute"><parent link="b{i}"/><child link="b{i + 1}"/>'
            f"{_origin(xyz, rpy)}<axis xyz={_text(axis)}/>"
            f'<limit lower="{low!r}" upper="{high!r}" effort="100" velocity="2"/></joint>'
            for i, (xyz, rpy, axis, (low, high)) in enumerate(self.joints)
        ]
        plate = f'<joint name="plate" type="fixed"><parent link="b{len(rows)}"/><child link="flange"/>'
        return f'<robot name="{self.name}">{links}{"".join(rows)}{plate}{_origin(*self.flange)}</joint></robot>\n'

    def description(self, folder: Path) -> ModelDescription:
        """The arm as this program reads it."""
        path = folder / f"{self.name}.urdf"
        path.write_text(self.urdf(), encoding="utf-8")
        return read_urdf(path).description


def _text(values: tuple[float, float, float]) -> str:
    return '"' + " ".join(repr(float(v)) for v in values) + '"'


def _origin(xyz: tuple[float, float, float], rpy: tuple[float, float, float]) -> str:
    return f"<origin xyz={_text(xyz)} rpy={_text(rpy)}/>"


def _degrees(*limits: float) -> list[tuple[float, float]]:
    return [(-float(np.radians(limit)), float(np.radians(limit))) for limit in limits]


_IIWA = _degrees(170, 120, 170, 120, 170, 120, 175)

ARMS = (
    SevenAxisArm(
        "fr3",
        "frankaemika/franka_description, robots/fr3/kinematics.yaml and joint_limits.yaml, 2024",
        "Apache-2.0",
        (
            ((0, 0, 0.333), NONE, Z, (-2.7437, 2.7437)),
            (NONE, (-Q, 0, 0), Z, (-1.7837, 1.7837)),
            ((0, -0.316, 0), (Q, 0, 0), Z, (-2.9007, 2.9007)),
            ((0.0825, 0, 0), (Q, 0, 0), Z, (-3.0421, -0.1518)),
            ((-0.0825, 0.384, 0), (-Q, 0, 0), Z, (-2.8065, 2.8065)),
            (NONE, (Q, 0, 0), Z, (0.5445, 4.5169)),
            ((0.088, 0, 0), (Q, 0, 0), Z, (-3.0159, 3.0159)),
        ),
        ((0, 0, 0.107), NONE),
        (0.45, 0.0, 0.15),
    ),
    SevenAxisArm(
        "iiwa14",
        "lbr-stack/lbr_fri_ros2_stack, lbr_description/urdf/iiwa14/iiwa14_description.xacro and joint_limits.yaml",
        "Apache-2.0",
        (
            ((0, 0, 0.1475), NONE, Z, _IIWA[0]),
            ((0, -0.01, 0.2125), NONE, Y, _IIWA[1]),
            ((0, 0.01, 0.228), NONE, Z, _IIWA[2]),
            ((0, 0.0105, 0.192), NONE, MINUS_Y, _IIWA[3]),
            ((0, -0.0105, 0.2075), NONE, Z, _IIWA[4]),
            ((0, -0.0707, 0.1925), NONE, Y, _IIWA[5]),
            ((0, 0.0707, 0.091), NONE, Z, _IIWA[6]),
        ),
        ((0, 0, 0.035), NONE),
        (0.56, 0.0, 0.2),
    ),
    SevenAxisArm(
        "gen3",
        "Kinovarobotics/ros2_kortex, kortex_description/arms/gen3/7dof/urdf/gen3_macro.xacro",
        "BSD-3-Clause",
        (
            ((0, 0, 0.15643), (2 * Q, 0, 0), Z, (-WHOLE, WHOLE)),
            ((0, 0.005375, -0.12838), (Q, 0, 0), Z, (-2.24, 2.24)),
            ((0, -0.21038, -0.006375), (-Q, 0, 0), Z, (-WHOLE, WHOLE)),
            ((0, 0.006375, -0.21038), (Q, 0, 0), Z, (-2.57, 2.57)),
            ((0, -0.20843, -0.006375), (-Q, 0, 0), Z, (-WHOLE, WHOLE)),
            ((0, 0.00017505, -0.10593), (Q, 0, 0), Z, (-2.09, 2.09)),
            ((0, -0.10593, -0.00017505), (-Q, 0, 0), Z, (-WHOLE, WHOLE)),
        ),
        ((0, 0, -0.061525), (2 * Q, 0, 0)),
        (0.4, 0.0, 0.15),
    ),
    SevenAxisArm(
        "xarm7",
        "xArm-Developer/xarm_ros2, xarm_description/urdf/xarm7/xarm7.urdf.xacro",
        "BSD-3-Clause",
        (
            ((0, 0, 0.267), NONE, Z, (-WHOLE, WHOLE)),
            (NONE, (-Q, 0, 0), Z, (-2.059, 2.0944)),
            ((0, -0.293, 0), (Q, 0, 0), Z, (-WHOLE, WHOLE)),
            ((0.0525, 0, 0), (Q, 0, 0), Z, (-0.19198, 3.927)),
            ((0.0775, -0.3425, 0), (Q, 0, 0), Z, (-WHOLE, WHOLE)),
            (NONE, (Q, 0, 0), Z, (-1.69297, 2 * Q)),
            ((0.076, 0.097, 0), (-Q, 0, 0), Z, (-WHOLE, WHOLE)),
        ),
        (NONE, NONE),
        (0.4, 0.0, 0.15),
    ),
    SevenAxisArm(
        "sawyer",
        "RethinkRobotics/sawyer_robot, sawyer_description/urdf/sawyer_base.urdf.xacro",
        "Apache-2.0",
        (
            ((0, 0, 0.08), NONE, Z, (-3.0503, 3.0503)),
            ((0.081, 0.05, 0.237), (-Q, Q, 0), Z, (-3.8095, 2.2736)),
            ((0, -0.14, 0.1425), (Q, 0, 0), Z, (-3.0426, 3.0426)),
            ((0, -0.042, 0.26), (-Q, 0, 0), Z, (-3.0439, 3.0439)),
            ((0, -0.125, -0.1265), (Q, 0, 0), Z, (-2.9761, 2.9761)),
            ((0, 0.031, 0.275), (-Q, 0, 0), Z, (-2.9761, 2.9761)),
            ((0, -0.11, 0.1053), (-Q, -0.17453, 3.1416), Z, (-4.7124, 4.7124)),
        ),
        ((0, 0, 0.0245), (0, 0, 1.570796)),
        (0.6, 0.0, 0.1),
    ),
)
