"""What joints and their frames are off by, as arrays: what a calibrated arm has beyond the geometry as described.

Kinematics, statics and programs compute with the geometry as described, as the arm's controller does: errors of a
millimetre or a milliradian change a stiffness by a thousandth. Where the tool really is needs them: the URDF of the
calibrated arm, and programs that are corrected for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from robots.arrays import Array, Bools
from robots.schema.description import Joint, ModelDescription
from robots.schema.joint_errors import ErrorCurve
from robots.schema.units import factor

COMPONENTS = ("x", "y", "z", "rx", "ry")
MRAD = 1e-3


@dataclass(frozen=True, eq=False)
class JointErrors:
    """Errors of an arm's joints, SI.

    ``frames`` (dof, 5): each joint's frame is moved (m) in its own axes and turned (rad) by a rotation vector about x
    and y; ``zero`` (dof,) rad: the part of the robot's offsets that is no design but an error; ``turn`` (dof, dof): by
    how much more joints turn, ratios on the diagonal and couplings beside it; ``sin``, ``cos`` (dof, orders) rad: error
    curves over the coordinates; ``read``: by joint, ranges (rad) of its coordinate where its curve is identified, None
    without a curve; ``parameters`` (p,) and ``covariance`` (p, p) SI: how sure they are.
    """

    frames: Array
    zero: Array
    turn: Array
    sin: Array
    cos: Array
    read: tuple[tuple[tuple[float, float], ...] | None, ...]
    parameters: tuple[str, ...] = ()
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def turned(self, q: Array) -> Array:
        """What joints turn (n, dof) rad where their coordinates read q (n, dof) rad; zeros are the robot's own."""
        q = np.asarray(q, dtype=np.float64)
        out = q + q @ self.turn.T
        for j in np.flatnonzero(self.sin.any(axis=1) | self.cos.any(axis=1)):
            angle = q[:, j, None] * np.arange(1, self.sin.shape[1] + 1)
            out[:, j] += np.sin(angle) @ self.sin[j] + np.cos(angle) @ self.cos[j]
        return np.asarray(out)

    def unread(self, q: Array) -> Bools:
        """Which joints (n, dof) stand, at coordinates q (n, dof) rad, where their curves are not identified."""
        out = np.zeros(q.shape, dtype=np.bool_)
        for j, ranges in enumerate(self.read):
            if ranges is not None:
                # Curves repeat every turn.
                known = [((q[:, j] - low) % (2.0 * np.pi)) <= high - low + 1e-9 for low, high in ranges]
                out[:, j] = ~np.any(known, axis=0) if known else True
        return out


def joint_errors(description: ModelDescription) -> JointErrors | None:
    """The errors of a described arm; None where positions have told none."""
    joints = description.joint
    if description.positions is None and all(joint.error is None for joint in joints):
        return None
    names, dof = [joint.name for joint in joints], len(joints)
    frames, turn = np.zeros((dof, len(COMPONENTS))), np.zeros((dof, dof))
    order = max((len(c.sin_mrad) for c in map(_curve, joints) if c is not None), default=0)
    waves = np.zeros((2, dof, order))
    for j, joint in enumerate(joints):
        if joint.error is None:
            continue
        for k, name in enumerate(COMPONENTS):
            figure = getattr(joint.error, name)
            frames[j, k] = 0.0 if figure is None else figure.si
        turn[j, j] = 0.0 if joint.error.ratio is None else joint.error.ratio.si
        for other in joint.error.turns_with:
            turn[j, names.index(other.joint)] += other.factor.si
        if (curve := joint.error.curve) is not None:
            own = np.array([curve.sin_mrad, curve.cos_mrad]) * MRAD
            waves[:, j, : own.shape[1]] = own
    zero = np.array([0.0 if joint.zero_error is None else joint.zero_error.si for joint in joints])
    of = description.positions
    known = () if of is None else of.parameters
    V = np.array(of.covariance).reshape(len(known), len(known)) if of is not None else np.zeros((0, 0))
    read = tuple(_read(_curve(joint)) for joint in joints)
    return JointErrors(frames, zero, turn, waves[0], waves[1], read, known, V)


def designed(description: ModelDescription) -> ModelDescription:
    """The description without errors of zeros and geometry that positions told: what the arm's controller has."""
    if description.positions is None:
        return description
    plain = {"zero_error": None, "error": None}
    joints = tuple(joint.model_copy(update=plain) for joint in description.joint)
    return description.model_copy(update={"joint": joints, "positions": None})


def _curve(joint: Joint) -> ErrorCurve | None:
    return None if joint.error is None else joint.error.curve


def _read(curve: ErrorCurve | None) -> tuple[tuple[float, float], ...] | None:
    deg = factor("angle", "deg")
    return None if curve is None else tuple((low * deg, high * deg) for low, high in curve.identified_deg)


def where_unread(errors: JointErrors, names: Sequence[str], q: Array) -> dict[str, int]:
    """By joint: at how many of the coordinates q (n, dof) rad its curve is not identified; those with none left out."""
    count = errors.unread(q).sum(axis=0)
    return {name: int(n) for name, n in zip(names, count, strict=True) if n}
