"""What each part of the arm carries: the wrench ``s = T(q) w`` for a wrench w at the tool.

The arm is statically determinate, so statics alone gives T. With a parallelogram the forearm's moment
about the elbow goes down the pinned bar to the third actuator, so joint 2 does not feel it; the bar's
force is a single number N = row . w, and every part between the bar's ends carries it on top.
Arrays follow :mod:`fem.vectors`: poses along the last axis.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.model import ArmModel
from fem.vectors import cross, dot, poses_last, rigid_rotation, to_base, to_local
from robots import InputError
from robots.kinematics import BodyFrames

Array = NDArray[np.float64]

# Below this sine of the angle between bar and lever the parallelogram is flat and carries nothing.
FLAT_SINE = 1e-3


@dataclass(frozen=True)
class Transfer:
    """A compliant part: it carries ``s = T w`` and, deformed by h, moves the tool by ``d = T^T h``.

    T (s, 6) is never formed. Its first six rows move the tool's wrench to the part's point, in local axes
    (``frame``: R (3, 3, n) and the lever r (3, n) from the point to the tool point); on top comes
    ``column`` (s, n) times the force ``row`` . w, with ``row`` (6, n). A part without a frame carries that
    force (or torque) alone: s = 1 and no column.
    ``compliance``: (s, s), or (n,) for a single spring that depends on the pose.
    ``joint``: index of the joint if the part is the spring about that joint's axis, else None.
    """

    name: str
    compliance: Array
    frame: tuple[Array, Array] | None = None
    row: Array | None = None
    column: Array | None = None
    joint: int | None = None

    def carried(self, w: Array) -> Array:
        """Wrench, force or torque (s, n) in the part for a wrench ``w``, (6, n) or (6, 1), at the tool."""
        s = None
        if self.frame is not None:
            R, r = self.frame
            s = np.concatenate([to_local(R, w[:3]), to_local(R, w[3:] + cross(r, w[:3]))])
        if self.row is None:
            return np.zeros((0, 1)) if s is None else s
        force = dot(self.row, w)[None]
        if s is None or self.column is None:
            return force
        total = self.column * force
        total[:6] += s
        return np.asarray(total)

    def deformation(self, s: Array) -> Array:
        """Deformation (s, n) of the linear part under what it carries."""
        return s * self.compliance if self.compliance.ndim == 1 else self.compliance @ s

    def displacement(self, h: Array) -> Array:
        """Displacement (6, n) of the tool point by the part's deformation ``h`` (s, n)."""
        d = None
        if self.frame is not None:
            R, r = self.frame
            turn = to_base(R, h[3:6])
            d = np.concatenate([to_base(R, h[:3]) + cross(turn, r), turn])
        if self.row is None:
            return np.zeros((6, 1)) if d is None else d
        along = self.row * (h if self.column is None else dot(self.column, h))
        return np.asarray(along if d is None else d + along)

    def share(self, w: Array) -> Array:
        """Displacement (6, n) of the tool point that the part contributes under the wrench ``w``."""
        return self.displacement(self.deformation(self.carried(w)))
