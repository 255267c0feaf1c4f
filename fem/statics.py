"""The fast path: unit-load flexibility, batched over poses.

The arm is statically determinate, so statics alone gives the wrench each part carries,
``s_p = T_p(q) w``; with part compliance ``C_p`` the tool point moves by ``d = sum_p T_p^T C_p T_p w``
(principle of virtual forces). With a parallelogram the forearm's moment about the elbow goes down the
pinned bar to the third actuator, so joint 2 does not feel it. Small displacements; the unloaded arm is
the reference; gravity of the arm itself is in that reference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.model import ArmModel
from robots import InputError
from robots.kinematics import BodyFrames, as_poses, forward_kinematics, tool_position

Array = NDArray[np.float64]

# Poses worked on at once: few enough that the intermediate arrays stay in cache.
CHUNK = 2048

# Below this sine of the angle between bar and lever the parallelogram is flat and carries nothing.
FLAT_SINE = 1e-3


@dataclass(frozen=True)
class Transfer:
    """Wrench carried by a part for a unit wrench at the tool: T (n, s, 6), with its compliance.

    ``compliance``: (s, s), or (n,) for a single pose-dependent spring (then s = 1). ``joint``: index of
    the joint if the part is the spring about that joint's axis, else None.
    """

    name: str
    T: Array
    compliance: Array
    joint: int | None = None


@dataclass(frozen=True)
class _Loop:
    """The parallelogram at n poses: bar direction u, lever rho, elbow, shoulder, bar force row N = row . w."""

    u: Array
    rho: Array
    shoulder: Array
    row: Array


def transport(R: Array, r: Array) -> Array:
    """Wrench at a point in local axes per wrench at the tool in base axes, (n, 6, 6).

    ``R`` (n, 3, 3): local axes as columns; ``r`` (n, 3): from the point to the tool point.
    """
    T = np.zeros((len(r), 6, 6))
    local = np.swapaxes(R, 1, 2)
    T[:, :3, :3] = T[:, 3:, 3:] = local
    # Row i of R^T [r]x is a_i x r, with a_i the i-th local axis.
    T[:, 3, :3] = _cross(local[:, 0], r)
    T[:, 4, :3] = _cross(local[:, 1], r)
    T[:, 5, :3] = _cross(local[:, 2], r)
    return T


def _cross(a: Array, b: Array) -> Array:
    """Cross product of (n, 3) arrays; numpy's own costs three times as much."""
    out = np.empty_like(b)
    out[:, 0] = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    out[:, 1] = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    out[:, 2] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return out


def _loop(model: ArmModel, frames: BodyFrames, tool: Array) -> _Loop | None:
    p = model.robot.parallelogram
    if model.bar is None or p is None:
        return None
    elbow, shoulder = frames.p[:, p.driven + 1], frames.p[:, p.crank_about + 1]
    span = elbow - shoulder
    u = span / np.linalg.norm(span, axis=1)[:, None]
    rho = frames.R[:, p.driven + 1] @ p.pin
    e = frames.axis[:, p.driven]
    lever = np.einsum("ni,ni->n", e, _cross(rho, u))
    flat = np.abs(lever) < FLAT_SINE * np.linalg.norm(p.pin)
    if flat.any():
        raise InputError(
            f"pose {int(np.flatnonzero(flat)[0])}: the parallelogram of {model.robot.name} is flat "
            "(bar and lever in line), so the bar cannot carry the forearm's moment",
            allowed="poses away from that singularity", remedy="check the joint angles",
        )
    moment = np.concatenate([_cross(e, tool - elbow), e], axis=1)
    return _Loop(u, rho, shoulder, -moment / lever[:, None])


def _bar_wrench(loop: _Loop, R: Array, arm: Array | None, sign: float = 1.0) -> Array:
    """Wrench of the bar force at a point (n, 6, 6), local axes; ``arm``: from the point to the pin."""
    force = np.einsum("nji,nj->ni", R, loop.u)
    moment = np.zeros_like(force) if arm is None else np.einsum("nji,nj->ni", R, _cross(arm, loop.u))
    return np.asarray(sign * np.concatenate([force, moment], axis=1)[:, :, None] * loop.row[:, None, :])


def transfers(model: ArmModel, frames: BodyFrames, q: Array, tool: Array) -> Iterator[Transfer]:
    """Every compliant part with the wrench it carries; tool (n, 3) in the base frame."""
    loop = _loop(model, frames, tool)
    yield from _link_transfers(model, frames, tool, loop)
    yield from _joint_transfers(model, frames, q, tool, loop)
    if loop is not None and model.bar is not None:
        if model.bar.compliance > 0.0:
            yield Transfer("bar", loop.row[:, None, :], np.array([[model.bar.compliance]]))
        if model.bar.crank is not None:
            crank = model.bar.crank
            yield Transfer("crank", _bar_wrench(loop, frames.R[:, crank.body], None, -1.0), crank.element.flexibility)


def _link_transfers(
    model: ArmModel, frames: BodyFrames, tool: Array, loop: _Loop | None
) -> Iterator[Transfer]:
    p = model.robot.parallelogram
    for link in model.links:
        R, origin = frames.R[:, link.body], frames.p[:, link.body]
        tip = link.element.points[1]
        T = transport(R, tool - origin - R @ tip)
        if loop is not None and p is not None and link.body == p.driven:
            T = T + _bar_wrench(loop, R, loop.rho)
        if "pin" in link.element.interfaces:
            pin = np.zeros_like(T) if loop is None else _bar_wrench(loop, R, None)
            T = np.concatenate([T, pin], axis=1)
        yield Transfer(link.name, T, link.element.flexibility)


def _joint_transfers(
    model: ArmModel, frames: BodyFrames, q: Array, tool: Array, loop: _Loop | None
) -> Iterator[Transfer]:
    for joint in model.joints:
        compliance = joint.axial.compliance(q)
        if compliance.any():
            yield Transfer(joint.name, axial_row(model, frames, tool, loop, joint.joint), compliance, joint.joint)
        if joint.other.any():
            T = _joint_wrench(model, frames, tool, loop, joint.joint)[:, :5]
            yield Transfer(f"{joint.name} other directions", T, np.diag(joint.other))


def axial_row(model: ArmModel, frames: BodyFrames, tool: Array, loop: _Loop | None, joint: int) -> Array:
    """Torque about a joint's axis per unit wrench at the tool, (n, 1, 6)."""
    e = frames.axis[:, joint]
    origin = frames.p[:, joint + 1]
    row = np.concatenate([_cross(e, tool - origin), e], axis=1)
    p = model.robot.parallelogram
    if loop is not None and p is not None and joint == p.crank_about:
        to_pin = frames.p[:, p.driven + 1] + loop.rho - origin
        row = row + np.einsum("ni,ni->n", e, _cross(to_pin, loop.u))[:, None] * loop.row
    # The driven joint's own row needs no change: the crank's torque equals the forearm's moment.
    return row[:, None, :]


def _joint_wrench(
    model: ArmModel, frames: BodyFrames, tool: Array, loop: _Loop | None, joint: int
) -> Array:
    R = frames.R[:, joint + 1] @ model.robot.R_post[joint].T
    origin = frames.p[:, joint + 1]
    T = transport(R, tool - origin)
    p = model.robot.parallelogram
    if loop is not None and p is not None and joint in (p.crank_about, p.driven):
        to_pin = frames.p[:, p.driven + 1] + loop.rho - origin
        T = T + _bar_wrench(loop, R, to_pin)
    return T


def _prepare(model: ArmModel, q: Array, point: Array | None) -> tuple[BodyFrames, Array]:
    frames = forward_kinematics(model.robot, q)
    return frames, tool_position(model.robot, frames, point)


def _chunks(n: int) -> Iterator[slice]:
    for start in range(0, n, CHUNK):
        yield slice(start, min(start + CHUNK, n))


def _point_chunk(point: Array | None, part: slice) -> Array | None:
    return point if point is None or point.ndim == 1 else point[part]


def _as_wrenches(wrench: Array, n: int) -> Array:
    w = np.asarray(wrench, dtype=np.float64)
    if w.shape not in ((6,), (n, 6)) or not np.isfinite(w).all():
        raise InputError(
            "wrench array", value=f"shape {w.shape}", allowed=f"finite, (6,) or ({n}, 6): force N, moment N m"
        )
    return np.broadcast_to(w, (n, 6))


def _batched(
    model: ArmModel, q: Array, point: Array | None, shape: tuple[int, ...],
    kernel: Callable[[BodyFrames, Array, Array, slice], Array],
) -> Array:
    q = as_poses(model.robot, q)
    out = np.empty((len(q), *shape))
    for part in _chunks(len(q)):
        frames, tool = _prepare(model, q[part], _point_chunk(point, part))
        out[part] = kernel(frames, q[part], tool, part)
    return out


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
    w = _as_wrenches(wrench, len(np.asarray(q)))

    def kernel(frames: BodyFrames, q: Array, tool: Array, part: slice) -> Array:
        return sum(
            (part_deflection(t, w[part]) for t in transfers(model, frames, q, tool)),
            start=np.zeros((len(q), 6)),
        )

    return _batched(model, q, point, (6,), kernel)


def part_deflection(transfer: Transfer, w: Array) -> Array:
    """The share of one part in the tool's displacement, (n, 6)."""
    s = np.matmul(transfer.T, w[:, :, None])[:, :, 0]
    h = s * transfer.compliance[:, None] if transfer.compliance.ndim == 1 else s @ transfer.compliance
    return np.asarray(np.matmul(h[:, None, :], transfer.T)[:, 0])


def deflection_by_part(
    model: ArmModel, q: Array, wrench: Array, point: Array | None = None
) -> dict[str, Array]:
    """The tool's displacement (n, 6) split by part; the parts add up to :func:`deflection`."""
    q = as_poses(model.robot, q)
    w = _as_wrenches(wrench, len(q))
    frames, tool = _prepare(model, q, point)
    return {t.name: part_deflection(t, w) for t in transfers(model, frames, q, tool)}


def compliance(model: ArmModel, q: Array, point: Array | None = None) -> Array:
    """Cartesian compliance (n, 6, 6) at the tool point, base axes: m/N, rad/N, m/(N m), rad/(N m)."""

    def kernel(frames: BodyFrames, q: Array, tool: Array, part: slice) -> Array:
        C = np.zeros((len(q), 6, 6))
        for t in transfers(model, frames, q, tool):
            CT = t.T * t.compliance[:, None, None] if t.compliance.ndim == 1 else t.compliance @ t.T
            C += np.swapaxes(t.T, 1, 2) @ CT
        return C

    return _batched(model, q, point, (6, 6), kernel)


def directional_stiffness(
    model: ArmModel, q: Array, direction: Array | None = None, point: Array | None = None
) -> Array:
    """Stiffness |F| / |d . F/|F|| (n,) in N/m for a force along ``direction`` (base axes, default -Z).

    Raises
    ------
    InputError
        Direction of length zero, or a model with nothing that gives way.
    """
    axis = np.array([0.0, 0.0, -1.0]) if direction is None else np.asarray(direction, dtype=np.float64)
    norm = np.linalg.norm(axis)
    if axis.shape != (3,) or not norm > 0.0:
        raise InputError("load direction", value=axis.tolist(), allowed="three numbers, not all zero")
    unit = np.concatenate([axis / norm, np.zeros(3)])
    along = deflection(model, q, unit, point) @ unit
    if not (along > 0.0).all():
        raise InputError(
            "the model is rigid in this direction", remedy="give it flexible links or joint springs"
        )
    return np.asarray(1.0 / along)


def spring_influence(
    model: ArmModel, q: Array, wrench: Array, point: Array | None = None
) -> tuple[Array, Array]:
    """The linear structure of the deflection in the axial joint compliances.

    Returns
    -------
    influence (n, dof, 6) : displacement per unit compliance of each joint, m or rad per rad/(N m)
    rest (n, 6) : displacement of everything else (links, bar, other joint directions)
    """
    q = as_poses(model.robot, q)
    w = _as_wrenches(wrench, len(q))
    frames, tool = _prepare(model, q, point)
    loop = _loop(model, frames, tool)
    influence = np.zeros((len(q), model.robot.dof, 6))
    for joint in model.joints:
        row = axial_row(model, frames, tool, loop, joint.joint)
        influence[:, joint.joint] = part_deflection(Transfer(joint.name, row, np.ones(len(q))), w)
    rest = np.zeros((len(q), 6))
    for t in transfers(model, frames, q, tool):
        if t.joint is None:
            rest += part_deflection(t, w)
    return influence, rest
