"""Unit-load flexibility by numpy, batched over poses: the statics of any arm, and its parts one by one.

Statics gives the wrench each part carries, ``s_p = T_p(q) w`` (:mod:`fem.statics.transfers`); with part compliance
``C_p`` the tool point moves by ``d = sum_p T_p^T C_p T_p w`` (principle of virtual forces).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.model import ArmModel
from fem.statics.loads import as_points, as_wrenches
from fem.statics.transfers import axial_transfers, transfers
from fem.statics.vectors import poses_last
from robots.arrays import Array, in_blocks
from robots.kinematics import BodyFrames, as_poses, forward_kinematics, tool_position

# Poses worked on at once: few enough that the intermediate arrays stay in cache. Not a power of two:
# rows that far apart would compete for the same cache lines.
CHUNK = 2000


def deflection(model: ArmModel, q: Array, wrench: Array, point: Array | None = None) -> Array:
    """Displacement (n, 6) of the tool point; arguments and errors as of :func:`fem.deflection`."""
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
    """Cartesian compliance (n, 6, 6) at the tool point; arguments and errors as of :func:`fem.compliance`."""
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
    for rows in in_blocks(len(q), size):
        frames = forward_kinematics(model.robot, q[rows])
        yield rows, frames, tool_position(model.robot, frames, None if points is None else points[rows])
