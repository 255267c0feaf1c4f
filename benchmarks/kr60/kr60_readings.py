"""What the KUKA KR60-3 paper may have computed: tools and rules, each stated in full, none of them the paper's own.

The paper (Gao 2024, doi:10.1109/ACCESS.2024.3435911) gives neither the tool's transform nor the joint limits nor the
point its Jacobian is taken at. A reading fixes all of these, so that k_fs (eq. 12) along base Z follows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

import fem
import machining
import robots
from robots.arrays import Array
from robots.inverse.solutions import inverse_kinematics

# Gao 2024, section III.B and Table 4. The table's columns: x (mm), k_fs (N/mm), milling error (mm).
P1_M, P2_M = np.array([-0.043, 0.834, 0.486]), np.array([0.057, 0.947, 0.486])
P_M = np.array([0.150, 1.200, 0.486])
TABLE_4 = np.array(
    [
        [-40.0, 530.5647, 0.038],
        [-20.0, 482.9829, 0.057],
        [0.0, 474.9636, 0.069],
        [10.0, 476.0073, 0.064],
        [30.0, 480.9952, 0.059],
    ]
)
FORCE_N = np.array([200.0, 200.0, 200.0])
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Reading:
    """One way to read the paper.

    ``z6`` (3,) and ``lever`` (3,) m: direction of the flange axis, and from flange centre to tool point, base axes at
    gamma = 0; gamma turns both about the vertical through the tool point, ``turn = -1`` clockwise seen from above.
    ``at``: where the Jacobian is taken. ``branch``: always that one, limits or not; None: the stiffest within limits.
    """

    name: str
    says: str
    z6: Array
    lever: Array
    turn: Literal[1, -1] = -1
    at: Literal["tool", "flange"] = "tool"
    branch: str | None = None

    @property
    def tilt_deg(self) -> float:
        """Angle between the flange axis and the downward vertical, which is the tool axis on a level surface."""
        return float(np.degrees(np.arccos(-self.z6[2] / np.linalg.norm(self.z6))))

    @property
    def ahead_mm(self) -> float:
        """Tool point along the flange axis, from the flange."""
        return float(self.lever @ self.z6 / np.linalg.norm(self.z6) * 1e3)

    @property
    def aside_mm(self) -> float:
        """Tool point's distance from the flange axis."""
        return float(np.sqrt(self.lever @ self.lever - (self.ahead_mm * 1e-3) ** 2) * 1e3)


def _beside(name: str, says: str, x: float, y: float, lever: list[float], turn: Literal[1, -1] = -1) -> Reading:
    return Reading(name, says, np.array([x, y, -np.sqrt(1.0 - x * x - y * y)]), np.array(lever), turn)


def spindle(ahead_m: float, down_m: float) -> Reading:
    """A spindle across the flange axis, which stands level at gamma = 0 along +y: the usual way to mount one."""
    lever = np.array([0.0, ahead_m, -down_m])
    says = f"spindle across the flange axis, {1e3 * ahead_m:.0f} mm ahead, {1e3 * down_m:.0f} mm down"
    return Reading("S", says, np.array([0.0, 1.0, 0.0]), lever)


A0 = Reading(
    "A0",
    "flange axis level, Jacobian at the flange, always one branch, limits broken; 2 fitted figures",
    np.array([0.0, 1.0, 0.0]),
    np.array([0.0, 0.1447, 0.002]),
    at="flange",
    branch="front, elbow down, no flip",
)
RULE = "the paper's rule (limits kept, stiffest branch, Jacobian at the tool point); 5 fitted figures"
B = _beside("B", RULE, -0.0796, -0.0991, [-0.1213, -0.1256, 0.0146])
B2 = _beside("B2", "as B, another tool that fits", 0.00788, -0.04848, [0.17189, -0.164, 0.02868], 1)
B3 = _beside("B3", "as B, another tool that fits less well", 0.02724, -0.07859, [0.07998, -0.17066, 0.04849], 1)
S = spindle(0.065, 0.200)
IN_LINE = Reading("L", "spindle in line with the flange axis, 250 mm long", -UP, np.array([0.0, 0.0, -0.25]))
READINGS = (A0, B, B2, B3, S)


def arm() -> fem.ArmModel:
    """The paper's model: rigid links, the joint stiffnesses of its Table 1."""
    return fem.build_model(robots.load_description("kr60-3"), links="rigid")


def path(x_mm: Array) -> Array:
    """Points (n, 3) m on the line from P1 to P2 at x (n,) mm."""
    share = (x_mm * 1e-3 - P1_M[0]) / (P2_M[0] - P1_M[0])
    return np.asarray(P1_M + share[:, None] * (P2_M - P1_M))


def flange_frames(reading: Reading, points: Array, gamma_deg: Array) -> tuple[Array, Array]:
    """Flange frames (n, 4, 4) with the tool at points (n, 3) m, and the tool point in the flange frame (3,) m."""
    z = reading.z6 / np.linalg.norm(reading.z6)
    x = np.array([1.0, 0.0, 0.0]) - z[0] * z
    x = x / np.linalg.norm(x)
    R0 = np.stack([x, np.cross(z, x), z], axis=1)
    angle = reading.turn * np.radians(gamma_deg)
    turn = np.zeros((len(points), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
    turn[:, 1, 0], turn[:, 0, 1], turn[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
    T = np.tile(np.eye(4), (len(points), 1, 1))
    T[:, :3, :3] = turn @ R0
    T[:, :3, 3] = points - turn @ reading.lever
    return T, R0.T @ reading.lever


def postures(model: fem.ArmModel, reading: Reading, points: Array, gamma_deg: Array) -> tuple[Array, Array]:
    """Chosen joint angles (n, 6) rad and k_fs (n,) N/mm along base Z; NaN where the rule finds no posture."""
    T, tool = flange_frames(reading, points, gamma_deg)
    found = inverse_kinematics(model.robot, T, T_flange_tool=np.eye(4))
    n, m, dof = found.q.shape
    usable = found.reached if reading.branch else found.valid
    q = np.where(usable[:, :, None], found.q, 0.0)
    at = tool if reading.at == "tool" else np.zeros(3)
    k = machining.stiffness_index(model, q.reshape(-1, dof), UP, at).reshape(n, m) * 1e-3
    k = np.where(usable, k, -np.inf)
    column = np.full(n, found.names.index(reading.branch)) if reading.branch else k.argmax(axis=1)
    rows = np.arange(n)
    none = ~usable[rows, column]
    return np.where(none[:, None], np.nan, q[rows, column]), np.where(none, np.nan, k[rows, column])


def index(model: fem.ArmModel, reading: Reading, points: Array, gamma_deg: Array | float) -> Array:
    """k_fs (n,) N/mm, see :func:`postures`."""
    return postures(model, reading, points, np.broadcast_to(np.asarray(gamma_deg, dtype=float), len(points)))[1]
