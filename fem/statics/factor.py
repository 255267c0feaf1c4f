"""The compliance as a sum of squares: ``C(q) = sum_r c_g(r)(q) l_r(q)^T l_r(q)``, never indefinite.

Every compliant part adds ``T^T C_p T`` (:mod:`fem.statics.flexibility`). With ``C_p = F^T F`` its rows are those of ``F
T``: for a chain of revolute joints they are sums of products of one sine or cosine of each angle, as smooth as
functions get, while a spring that depends on the pose stays outside as a factor of its own. A surrogate that learns the
rows is positive semidefinite whatever its error (:mod:`surrogate.factored`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fem.model import ArmModel, JointPart
from fem.springs import SumSpring
from fem.statics.flexibility import batches
from fem.statics.transfers import Transfer, transfers
from robots import InputError
from robots.arrays import Array, Integers
from robots.kinematics import as_poses

# Directions of a part's compliance matrix that carry less than this share of its largest entry are round-off.
_NO_COMPLIANCE = 1e-14


@dataclass(frozen=True)
class ComplianceFactor:
    """Rows of the compliance at n poses.

    Parameters
    ----------
    rows : (n, r, 6), unit sqrt(m/N) in front of forces; for a spring in ``weights`` without its stiffness
    part : (r,) name of the part of each row
    weights : (n, g) compliances of springs that are single numbers at each pose, rad/(N m) or m/N
    group : (r,) which weight belongs to a row, -1: none, its compliance is in the row
    """

    rows: Array
    part: tuple[str, ...]
    weights: Array
    group: Integers

    def compliance(self) -> Array:
        """The compliance matrices (n, 6, 6)."""
        weight = np.hstack([self.weights, np.ones((len(self.rows), 1))])[:, self.group]
        return np.asarray(np.swapaxes(self.rows, 1, 2) @ (weight[:, :, None] * self.rows))


def compliance_factor(model: ArmModel, q: Array, point: Array | None = None) -> ComplianceFactor:
    """Split the compliance (n, 6, 6) of :func:`fem.compliance` into rows; arguments and errors as there.

    Raises
    ------
    InputError
        Also a model in which nothing deflects, or a joint whose coupled compliance is no positive one.
    """
    q = as_poses(model.robot, q)
    model = replace(model, joints=tuple(_apart(joint) if joint.is_coupled else joint for joint in model.joints))
    rows: list[Array] = []
    weights: list[Array] = []
    for where, frames, tool in batches(model, q, point):
        parts = list(transfers(model, frames, q[where], tool, where.start))
        _check(model, parts)
        # Of springs that are single numbers at each pose, the compliance stays outside.
        single = [part.compliance for part in parts if part.compliance.ndim == 1]
        roots = [_root(model, part) for part in parts]
        rows.append(
            np.concatenate([F @ np.moveaxis(p.matrix(), 2, 0) for F, p in zip(roots, parts, strict=True)], axis=1)
        )
        weights.append(np.stack(single, axis=1) if single else np.empty((len(tool), 0)))
    count = [root.shape[-2] for root in roots]
    springs = np.array([part.compliance.ndim == 1 for part in parts])
    group = np.where(springs, np.cumsum(springs) - 1, -1)
    names = np.repeat([part.name for part in parts], count).tolist()
    return ComplianceFactor(np.concatenate(rows), tuple(names), np.concatenate(weights), np.repeat(group, count))


def _check(model: ArmModel, parts: list[Transfer]) -> None:
    if not parts:
        raise InputError(
            f"model of {model.robot.name}: nothing in it deflects",
            code="M005",
            remedy="give it flexible links or joint springs",
        )
    for part in parts:
        if (part.compliance < 0.0).any() and part.compliance.ndim == 1:
            raise InputError(
                f"model of {model.robot.name}: compliance of {part.name} with what couples it to other directions",
                code="M004",
                allowed="positive semidefinite",
                remedy="a softer spring about the axis, or a weaker coupling",
            )


def _apart(joint: JointPart) -> JointPart:
    """The same joint with a bearing that is positive semidefinite by itself, and the rest of the axial compliance.

    What couples them, b, takes ``b^T B^-1 b`` (Schur's complement) of the axial compliance to be a sum of squares.
    """
    bearing = joint.bearing.copy()
    size = np.sqrt(np.maximum(np.diag(bearing)[:5], 1e-300))
    coupling = bearing[5, :5] / size
    inverse = np.linalg.pinv(bearing[:5, :5] / np.outer(size, size), rcond=_NO_COMPLIANCE, hermitian=True)
    bearing[5, 5] = coupling @ inverse @ coupling
    return replace(joint, bearing=bearing, axial=SumSpring(joint.axial, -bearing[5, 5]))


def _root(model: ArmModel, part: Transfer) -> Array:
    """F (r, s), or (n, r, s) of a part that depends on the pose, with F^T F its compliance; 1 of a single spring."""
    if part.compliance.ndim < 3:
        return np.eye(1) if part.compliance.ndim == 1 else _square_root(part.compliance)
    values, vectors = np.linalg.eigh(np.moveaxis(part.compliance, 2, 0))
    if (values[:, 0] < -_NO_COMPLIANCE * np.abs(values).max()).any():
        raise InputError(
            f"model of {model.robot.name}: compliance of {part.name} at the stated load",
            code="M004",
            allowed="positive semidefinite",
            remedy="learn the stiffness along one load (--basis polynomial or trigonometric)",
        )
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, :, None] * vectors.swapaxes(1, 2))


def _square_root(C: Array) -> Array:
    """F (r, s) with F^T F = C (s, s), r its rank; forces and moments are scaled alike first."""
    size = np.sqrt(np.maximum(np.diag(C), 1e-300))
    values, vectors = np.linalg.eigh(C / np.outer(size, size))
    kept = values > _NO_COMPLIANCE * values[-1]
    return np.asarray((np.sqrt(values[kept]) * vectors[:, kept] * size[:, None]).T)
