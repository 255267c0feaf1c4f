"""Where compliance can sit in an arm, and how a tool reading depends on it: exact and linear.

A *port* is a place that carries a wrench ``s = T(q) w`` for the wrench w at the loaded point: the base, each joint
(its frame, z along the axis), each link, the bar, the tool (the model's tool point, flange axes). A symmetric
compliance C (s, s) there adds ``T^T C T w`` to the displacement, whatever the rest of the arm does, because the arm
is statically determinate.
So the displacement is linear in every entry of every compliance, and its derivative is known exactly:
``d/dC_ab = T^T (e_a e_b^T + e_b e_a^T) T w`` (half of it on the diagonal).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.inputs import as_points, as_wrenches
from fem.model import ArmModel
from fem.transfers import joint_rows, transfers
from fem.vectors import cross, poses_last
from robots import InputError
from robots.kinematics import as_poses, forward_kinematics, tool_position

Array = NDArray[np.float64]

ROWS = ("tx", "ty", "tz", "rx", "ry", "rz")
BASE, TOOL = "base", "tool"


@dataclass(frozen=True)
class Port:
    """A place of an arm at n loaded poses.

    ``T`` (s, 6, n): wrench carried there per wrench at the loaded point (base axes). ``carried`` (s, n): under
    the load itself. ``flexibility`` (s, s): what the model has there already (a link's, the bar's), or None.
    The six rows of base, joints and tool are those of ``ROWS``: forces then moments in the place's own axes.
    """

    name: str
    T: Array
    carried: Array
    flexibility: Array | None = None

    def influence(self, a: int, b: int) -> Array:
        """Displacement (n, 6) per unit of the compliance's entries (a, b) and (b, a); m or rad per unit."""
        d = self.T[a] * self.carried[b]
        if a != b:
            d = d + self.T[b] * self.carried[a]
        return np.asarray(d.T)

    def share(self, C: Array) -> Array:
        """Displacement (n, 6) by a compliance C (s, s)."""
        return np.asarray(np.einsum("skn,sn->nk", self.T, C @ self.carried))


def ports(model: ArmModel, q: Array, wrench: Array, point: Array | None = None) -> dict[str, Port]:
    """Every port of an arm at the loaded poses, by name: base, joints, links, bar and crank, tool.

    Arguments as in :func:`fem.statics.deflection`. 300 bytes a port and pose: batch beyond some 1e5 poses.

    Raises
    ------
    InputError
        Shapes, values that are not finite, or a flat parallelogram.
    """
    q = as_poses(model.robot, q)
    w = poses_last(as_wrenches(wrench, len(q)))
    frames = forward_kinematics(model.robot, q)
    tool = tool_position(model.robot, frames, as_points(point, len(q)))
    places: dict[str, tuple[Array, Array | None]] = {BASE: (_moved(np.eye(3), poses_last(tool)), None)}
    for joint, T in joint_rows(model, frames, tool):
        places[model.robot.joint_names[joint]] = (T, None)
    known = {link.name for link in model.links} | {"bar", "crank"}
    for part in transfers(model, frames, q, tool):
        if part.name in known and part.joint is None:
            places[part.name] = (np.broadcast_to(part.matrix(), (len(part.compliance), 6, len(q))), part.compliance)
    lever = poses_last(tool - tool_position(model.robot, frames))
    places[TOOL] = (_moved(np.moveaxis(frames.R_flange, 0, -1), lever), None)
    return {
        name: Port(name, T, np.asarray(np.einsum("skn,kn->sn", T, w)), flexibility)
        for name, (T, flexibility) in places.items()
    }


def port_of(places: dict[str, Port], name: str) -> Port:
    """One port by name; raises InputError if the arm has none of that name."""
    if name not in places:
        raise InputError("place of a compliance", value=name, allowed=", ".join(places))
    return places[name]


def _moved(R: Array, r: Array) -> Array:
    """T (6, 6, n) to axes R (3, 3) or (3, 3, n), columns, at a point from which the tool is r (3, n) away."""
    n = max(r.shape[1], R.shape[2] if R.ndim == 3 else 1)
    T = np.zeros((6, 6, n))
    for k in range(3):
        axis = np.broadcast_to(R[:, k].reshape(3, -1), (3, n))
        T[k, :3] = T[3 + k, 3:] = axis
        T[3 + k, :3] = cross(axis, np.broadcast_to(r, (3, n)))
    return T
