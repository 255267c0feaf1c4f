"""A stiffness map as in Fig. 3 of the TX200 paper: a window of the X-Z plane, the flange never turned.

The paper gives the window's origin (X 1344 mm, Z 550 mm from the base), not its size, and says that "the flange
coordinate system was not rotated in any axis". Which orientation that is, it does not say. Taken here: ``forward``, the
flange's Z axis along the base's X: then the wrist centre of the origin is at 1344 - 194 = 1150 mm, a round figure, and
the arm reaches the whole window. ``base``: flange axes parallel to the base's, Z up, as with all joints at zero: the
arm reaches half of it. ``down``: Z down, as for milling on a table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from doe.joint_twists.substitute import Compliances, stiffness_with
from fem import ArmModel
from robots import InputError, inverse_kinematics, why_no_closed_form
from robots.arrays import Array
from robots.frames import framed

Orientation = Literal["base", "forward", "down"]

ORIENTATIONS: dict[str, Array] = {
    "base": np.eye(3),
    "forward": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
    "down": np.diag([1.0, -1.0, -1.0]),
}
# TX200 paper, section 2.1.
ORIGIN_M = (1.344, 0.550)
# Not stated in the paper: chosen so that the arm reaches all of it.
SIZE_M = (0.6, 0.6)


@dataclass(frozen=True, eq=False)
class Window:
    """A map: ``x`` (nx,) and ``z`` (nz,) m, ``q`` (nz, nx, dof) rad, ``stiffness`` (nz, nx, 3) N/m in flange X, Y, Z.

    NaN where the flange cannot be brought there. ``mean``: of the three directions. ``elbow``: up or down, in all of
    the map.
    """

    orientation: Orientation
    elbow: str
    x: Array
    z: Array
    q: Array
    stiffness: Array

    @property
    def mean(self) -> Array:
        """Mean of the directional stiffnesses (nz, nx) N/m."""
        return np.asarray(self.stiffness.mean(axis=2))


def stiffness_window(
    model: ArmModel, six: Compliances, *, orientation: Orientation = "forward",
    origin_m: tuple[float, float] = ORIGIN_M, size_m: tuple[float, float] = SIZE_M, points: tuple[int, int] = (31, 31),
) -> Window:  # fmt: skip
    """Directional stiffnesses over a window of the plane Y = 0, each under a unit force of its own.

    The arm stands in front of axis 1, its elbow in all of the map on the side that reaches more of it (up if both do),
    its wrist the way that keeps joint 4 nearest to zero.

    Raises
    ------
    InputError
        Unknown orientation; a robot without inverse kinematics in closed form; nothing in the window is reached.
    """
    if orientation not in ORIENTATIONS:
        raise InputError("orientation of the flange", value=orientation, allowed=", ".join(ORIENTATIONS))
    robot = model.robot
    if (reason := why_no_closed_form(robot)) is not None:
        raise InputError(f"stiffness window of {robot.name}: {reason}", allowed="a robot with a spherical wrist")
    x = origin_m[0] + np.linspace(0.0, size_m[0], points[0])
    z = origin_m[1] + np.linspace(0.0, size_m[1], points[1])
    points_m = np.column_stack([np.tile(x, z.size), np.zeros(x.size * z.size), np.repeat(z, x.size)])
    T = framed(ORIENTATIONS[orientation], points_m)
    found = inverse_kinematics(robot, T, T_flange_tool=np.eye(4), near=np.zeros(robot.dof))
    usable, elbow = np.zeros_like(found.valid), "up"
    for side in ("up", "down"):
        wanted = [f"elbow {side}" in name and "back" not in name for name in found.names]
        these = np.asarray(found.valid & np.array(wanted))
        if these.any(axis=1).sum() > usable.any(axis=1).sum():
            usable, elbow = these, side
    turned = np.where(usable, np.abs(found.q[:, :, 3]), np.inf)
    best = turned.argmin(axis=1)
    q = np.where(np.asarray(usable.any(axis=1))[:, None], found.q[np.arange(len(T)), best], np.nan)
    reached = np.asarray(usable.any(axis=1), dtype=np.bool_)
    if not reached.any():
        raise InputError(
            f"stiffness window of {robot.name}: nothing in it is reached with the flange {orientation}",
            value=f"X {1e3 * x[0]:.0f} to {1e3 * x[-1]:.0f}, Z {1e3 * z[0]:.0f} to {1e3 * z[-1]:.0f} mm",
            allowed="a window within reach",
            remedy="move it with --window, or choose another --flange",
        )
    k = np.full((len(T), 3), np.nan)
    k[reached] = stiffness_with(model, six, q[reached])
    return Window(orientation, elbow, x, z, q.reshape(z.size, x.size, -1), k.reshape(z.size, x.size, 3))
