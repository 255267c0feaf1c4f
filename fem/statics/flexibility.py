"""The fast path: unit-load flexibility, batched over poses.

Statics gives the wrench each part carries, ``s_p = T_p(q) w`` (:mod:`fem.statics.transfers`); with part
compliance ``C_p`` the tool point moves by ``d = sum_p T_p^T C_p T_p w`` (principle of virtual forces).
Small displacements; the unloaded arm is the reference; gravity of the arm itself is in that reference.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.model import ArmModel
from fem.statics.inputs import as_points, as_wrenches
from fem.statics.transfers import axial_transfers, transfers
from fem.statics.vectors import poses_last
from robots import InputError
from robots.arrays import Array
from robots.kinematics import BodyFrames, as_poses, forward_kinematics, tool_position

# Poses worked on at once: few enough that the intermediate arrays stay in cache. Not a power of two:
# rows that far apart would compete for the same cache lines.
CHUNK = 2000


def deflection(model: ArmModel, q: Array, wrench: Array, point: Array | None = None) -> Array:
    """Displacement of the tool point under a wrench, relative to the unloaded arm.

    Parameters
    ----------
    q : (n, dof) rad; limits are not checked here
    wrench : (6,) or (n, 6), force N and moment N m in base axes at the tool point
    point : (3,) or (n, 3) m in the flange frame instead of the model's tool point

    Returns
    -------
    (n, 6): translation m, rotation rad, base axes

    Raises
    ------
    InputError
        Shapes, values that are not finite, or a flat parallelogram.
    """
    q = as_poses(model.robot, q)
    loads = as_wrenches(wrench, len(q))
    out = np.empty((len(q), 6))
    for rows, frames, tool in batches(model, q, point):
        w = poses_last(loads[rows])
        total = np.zeros_like(w)
        for part in transfers(model, frames, q[rows], tool, rows.start):
            total += part.share(w)
        out[rows] = total.T
    return out


def deflection_by_part(model: ArmModel, q: Array, wrench: Array, point: Array | None = None) -> dict[str, Array]:
    """Split the tool's displacement by part, (n, 6) each; the parts add up to :func:`deflection`."""
    q = as_poses(model.robot, q)
    loads = as_wrenches(wrench, len(q))
    shares: dict[str, Array] = {}
    for rows, frames, tool in batches(model, q, point):
        w = poses_last(loads[rows])
        for part in transfers(model, frames, q[rows], tool, rows.start):
            shares.setdefault(part.name, np.zeros((len(q), 6)))[rows] = part.share(w).T
    return shares


def compliance(model: ArmModel, q: Array, point: Array | None = None) -> Array:
    """Cartesian compliance (n, 6, 6) at the tool point, base axes: m/N, rad/N, m/(N m), rad/(N m).

    Arguments and errors as in :func:`deflection`: column j is the deflection under the j-th unit wrench.
    """
    q = as_poses(model.robot, q)
    out = np.zeros((len(q), 6, 6))
    for rows, frames, tool in batches(model, q, point, CHUNK // 4):
        parts = list(transfers(model, frames, q[rows], tool, rows.start))
        T = [part.matrix() for part in parts]
        CT = [part.deformation(t) for part, t in zip(parts, T, strict=True)]
        if parts:
            out[rows] = _poses_first(T).swapaxes(1, 2) @ _poses_first(CT)
    return out


def _poses_first(blocks: list[Array]) -> Array:
    return np.ascontiguousarray(np.moveaxis(np.concatenate(blocks), -1, 0))


def directional_stiffness(
    model: ArmModel, q: Array, direction: Array | None = None, point: Array | None = None
) -> Array:
    """Stiffness |F| / |d . F/|F|| (n,) in N/m for a force along ``direction`` (base axes, default -Z).

    Raises
    ------
    InputError
        Direction of length zero, or a model with nothing that gives way.
    """
    unit = unit_force(direction)
    return stiffness_along(deflection(model, q, unit, point) @ unit)


def unit_force(direction: Array | None) -> Array:
    """Wrench (6,) of 1 N along a direction (3,), default -Z; InputError for one that is none."""
    axis = np.array([0.0, 0.0, -1.0]) if direction is None else np.asarray(direction, dtype=np.float64)
    norm = np.linalg.norm(axis)
    if axis.shape != (3,) or not 0.0 < norm < np.inf:
        raise InputError("load direction", value=axis.tolist(), allowed="three finite numbers, not all zero")
    return np.concatenate([axis / norm, np.zeros(3)])


def stiffness_along(displacement: Array) -> Array:
    """Stiffness (n,) N/m from displacements (n,) along a unit force, m; InputError where there is none."""
    if not (displacement > 0.0).all():
        raise InputError(
            f"pose {int(np.argmin(displacement > 0.0))}: the model is rigid in this direction",
            remedy="give it flexible links or joint springs",
        )
    return np.asarray(1.0 / displacement)


def spring_influence(model: ArmModel, q: Array, wrench: Array, point: Array | None = None) -> tuple[Array, Array]:
    """Split the deflection into its linear dependence on the axial joint compliances and the rest.

    Arguments and errors as in :func:`deflection`; ``deflection = rest + sum_j c_j influence_j``.

    Returns
    -------
    influence (n, dof, 6) : displacement per unit compliance of each joint, m or rad per rad/(N m)
    rest (n, 6) : displacement of everything else (links, bar, other joint directions)
    """
    q = as_poses(model.robot, q)
    loads = as_wrenches(wrench, len(q))
    influence = np.zeros((len(q), model.robot.dof, 6))
    rest = np.zeros((len(q), 6))
    for rows, frames, tool in batches(model, q, point):
        w = poses_last(loads[rows])
        for joint, torque in axial_transfers(model, frames, tool, rows.start):
            influence[rows, joint] = torque.displacement(torque.carried(w)).T
        for part in transfers(model, frames, q[rows], tool, rows.start):
            if part.joint is None:
                rest[rows] += part.share(w).T
    return influence, rest


def batches(
    model: ArmModel, q: Array, point: Array | None, size: int = CHUNK
) -> Iterator[tuple[slice, BodyFrames, Array]]:
    """Batches of poses: their rows, frames, and tool points (base frame)."""
    points = as_points(point, len(q))
    for start in range(0, len(q), size):
        rows = slice(start, min(start + size, len(q)))
        frames = forward_kinematics(model.robot, q[rows])
        yield rows, frames, tool_position(model.robot, frames, None if points is None else points[rows])
