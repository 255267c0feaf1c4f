"""Where compliance can sit in an arm, and how a tool reading depends on it: exact and linear.

A *port* is a place that carries a wrench ``s = T(q) w`` for the wrench w at the loaded point: the base, each joint
(its frame, z along the axis), each link, the bar, the tool (the model's tool point, flange axes). A symmetric
compliance C (s, s) there adds ``T^T C T w`` to the displacement, whatever the rest of the arm does, because the arm
is statically determinate.
So the displacement is linear in every entry of every compliance, and its derivative is known exactly:
``d/dC_ab = T^T (e_a e_b^T + e_b e_a^T) T w`` (half of it on the diagonal).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fem.model import ArmModel
from fem.statics.loads import as_points, as_wrenches
from fem.statics.transfers import Moved, joint_rows, transfers
from fem.statics.vectors import poses_last
from robots import require_one_of
from robots.arrays import Array, Indices
from robots.kinematics import as_poses, forward_kinematics, tool_position

ROWS = ("tx", "ty", "tz", "rx", "ry", "rz")
BASE, TOOL = "base", "tool"


@dataclass(frozen=True)
class Port:
    """A place of an arm at n loaded poses.

    ``distinct`` (s, 6, u): wrench carried there per wrench at the loaded point (base axes), for u poses; ``where``
    (n,): which of them each loaded pose is; ``wrench`` (6, n). ``flexibility`` (s, s): what the model has there
    already (a link's, the bar's), or None. The six rows of base, joints and tool are those of ``ROWS``: forces then
    moments in the place's own axes. Rows are worked out when they are asked for.
    """

    name: str
    distinct: Array
    where: Indices
    wrench: Array
    flexibility: Array | None = None

    @cached_property
    def T(self) -> Array:  # noqa: N802 - the letter of the equation
        """Wrench carried per wrench at the loaded point (s, 6, n)."""
        return self.distinct[:, :, self.where]

    @cached_property
    def carried(self) -> Array:
        """Wrench carried (s, n) under the load itself."""
        return np.asarray(np.einsum("skn,kn->sn", self.T, self.wrench))

    def take(self, rows: Indices) -> Port:
        """The port at some of the loaded poses (r,), also again and again."""
        return Port(self.name, self.distinct, self.where[rows], self.wrench[:, rows], self.flexibility)

    def influence(self, a: int, b: int) -> Array:
        """Displacement (n, 6) per unit of the compliance's entries (a, b) and (b, a); m or rad per unit."""
        T_a = self.distinct[a][:, self.where]
        T_b = T_a if a == b else self.distinct[b][:, self.where]
        d = T_a * np.sum(T_b * self.wrench, axis=0)
        if a != b:
            d = d + T_b * np.sum(T_a * self.wrench, axis=0)
        return np.asarray(d.T)

    def share(self, C: Array) -> Array:
        """Displacement (n, 6) by a compliance C (s, s)."""
        return np.asarray(np.einsum("skn,sn->nk", self.T, C @ self.carried))


def ports(
    model: ArmModel, q: Array, wrench: Array, point: Array | None = None, only: Collection[str] | None = None
) -> dict[str, Port]:
    """Every port of an arm at the loaded poses, by name: base, joints, links, bar and crank, tool.

    Arguments as in :func:`fem.deflection`; ``only``: names of the ports that are wanted, None for
    all. 300 bytes a port and pose: batch beyond some 1e5 poses.

    Raises
    ------
    InputError
        Shapes, values that are not finite, or a flat parallelogram.
    """
    q = as_poses(model.robot, q)
    w, points = poses_last(as_wrenches(wrench, len(q))), as_points(point, len(q))
    if only is not None and not only:
        return {}
    first, where = _in_a_row(q, points)
    places = _places(model, q[first], None if points is None else points[first], only)
    return {name: Port(name, T, where, w, flexibility) for name, (T, flexibility) in places.items()}


def _in_a_row(q: Array, points: Array | None) -> tuple[Indices, Indices]:
    """First of every run of equal poses (u,), and the run of every pose (n,): loads and repeats come in a row."""
    new = np.ones(len(q), dtype=bool)
    new[1:] = (q[1:] != q[:-1]).any(axis=1)
    if points is not None:
        new[1:] |= (points[1:] != points[:-1]).any(axis=1)
    return np.flatnonzero(new), np.cumsum(new) - 1


def _places(
    model: ArmModel, q: Array, points: Array | None, only: Collection[str] | None
) -> dict[str, tuple[Array, Array | None]]:
    """T (s, 6, n) and flexibility of the ports wanted."""
    frames = forward_kinematics(model.robot, q)
    tool = tool_position(model.robot, frames, points)
    places: dict[str, tuple[Array, Array | None]] = {BASE: (_at(frames.R[:, 0], tool), None)}
    for joint, T in joint_rows(model, frames, tool, only=only):
        places[model.robot.joint_names[joint]] = (T, None)
    known = {link.name for link in model.links} | {"bar", "crank"}
    wanted = known if only is None else known & set(only)
    for part in transfers(model, frames, q, tool) if wanted else ():
        if part.name in wanted and part.joint is None:
            places[part.name] = (np.broadcast_to(part.matrix(), (len(part.compliance), 6, len(q))), part.compliance)
    places[TOOL] = (_at(frames.R_flange, tool - tool_position(model.robot, frames)), None)
    return places if only is None else {name: place for name, place in places.items() if name in only}


def port_of(places: dict[str, Port], name: str) -> Port:
    """One port by name; raises InputError if the arm has none of that name."""
    require_one_of("place of a compliance", name, places, code="B003")
    return places[name]


def _at(R: Array, r: Array) -> Array:
    """T (6, 6, n) to axes R (n, 3, 3), columns, at a point from which the tool is r (n, 3) away."""
    return Moved(poses_last(R), poses_last(r)).matrix()
