"""Sweeps over path points and gamma by compiled loops, for arms with an exact spherical wrist; needs numba.

The same results as :func:`robots.inverse_kinematics` with :meth:`machining.stiffness.objective.Objective.values`, to
rounding. The stiffness itself is compiled for rigid links with constant springs about the joint axes; for other arms
only the joint angles are. Blocks of targets go to as many threads as numba is set to use; their number changes no
digit. Without numba, or with one that does not load, everything goes the other way.

Where two branches meet, or at the edge of reach, an angle is known to the square root of rounding (1e-8) only, and the
two ways may differ by as much.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import fem
from fem.springs import ConstantSpring
from machining.inputs import as_units
from machining.task import Task
from robots import InputError, Robot
from robots.arrays import Array, in_blocks
from robots.frames import by_frame
from robots.inverse.solutions import as_frames
from robots.inverse.spherical_wrist import SphericalWristArm, spherical_wrist_arm
from robots.inverse.wrist import BOUNDARY
from robots.robot import LIMIT_TOLERANCE_RAD
from robots.threads import compiled_loops, in_shares
from robots.threads import default_threads as threads

if TYPE_CHECKING:
    from machining.stiffness.kernels import Figures

# None where numba is not there.
kernels = partial(compiled_loops, "machining.stiffness.kernels")
# Fewer targets than this numpy has done in some 30 ms; loading numba takes 0.3 s, once.
FEWEST = 5_000
# Points whose tool frames are made at once: with more of them memory would grow with the path.
POINTS = 8_192
# Blocks that a thread takes at once.
SHARE = 8
# Tool axes farther from orthonormal than this are rounded figures; the inverse kinematics makes them orthonormal.
ROUNDED = 1e-12

# Of each quantity: its load, whether it looks along the normal, whether it is a stiffness.
_QUANTITIES = {
    "k_fs": ("normal", False, True),
    "directional": ("normal", True, True),
    "rayleigh": ("direction of force", False, True),
    "nspi": ("direction of force", True, True),
    "displacement": ("force", False, False),
    "normal displacement": ("force", True, False),
}


def fast_sweep(
    model: fem.ArmModel, task: Task, quantity: str, force: Array | None, gamma: Array
) -> tuple[Array, NDArray[np.int8], Array | None] | None:
    """Sweep path points and gamma (n, m) rad; k targets in the order of ``gamma.ravel()``. None: take the other way.

    Returns q (k, 8, 6) rad, reason (k, 8), and value (k, 8), NaN where not valid; None instead of the value where the
    model or the quantity is none of those compiled.

    ``force`` (n, 3) N at the points where the quantity needs one.
    """
    compiled = kernels() if gamma.size >= FEWEST and not model.robot.couplings else None
    if compiled is None:
        return None
    if task.T_flange_tool.ndim == 3:
        return _tool_by_tool(compiled, model, task, quantity, force, gamma)
    return _one_tool(compiled, model, task, quantity, force, gamma)


def _one_tool(
    compiled: ModuleType, model: fem.ArmModel, task: Task, quantity: str, force: Array | None, gamma: Array
) -> tuple[Array, NDArray[np.int8], Array | None] | None:
    try:
        arm = spherical_wrist_arm(model.robot)
    except InputError:  # another kind of arm
        return None
    if not arm.exact:
        return None
    compliance = axial_compliance(model) if quantity in _QUANTITIES else None
    what, along, stiffness = _QUANTITIES["k_fs" if compliance is None else quantity]
    figures = _figures(compiled, arm, model.robot, task, np.zeros(6) if compliance is None else compliance)
    points = _points(arm, task, _load(what, task, force))
    if points is None:
        return None
    q, reason, value = _run(compiled, figures, points, along, gamma)
    if compliance is None:
        return q, reason, None
    if stiffness:
        with np.errstate(divide="ignore"):
            np.divide(1.0, value, out=value)
    return q, reason, value


def _tool_by_tool(
    compiled: ModuleType, model: fem.ArmModel, task: Task, quantity: str, force: Array | None, gamma: Array
) -> tuple[Array, NDArray[np.int8], Array | None] | None:
    """:func:`fast_sweep` of a path along which tools are changed; None where one of them takes the other way."""
    n, m = gamma.shape
    found = None
    for rows, T in by_frame(task.T_flange_tool, n):
        one = replace(task.at(rows), T_flange_tool=T)
        part = _one_tool(compiled, model, one, quantity, None if force is None else force[rows], gamma[rows])
        if part is None:
            return None
        if found is None:
            found = [None if p is None else np.empty((n, m, *p.shape[1:]), dtype=p.dtype) for p in part]
        for whole, p in zip(found, part, strict=True):
            if whole is not None and p is not None:
                whole[rows] = p.reshape(len(rows), m, *p.shape[1:])
    assert found is not None  # noqa: S101 - a path has points
    q, reason, value = (None if p is None else p.reshape(n * m, *p.shape[2:]) for p in found)
    # Only the value may be left out.
    assert q is not None  # noqa: S101
    assert reason is not None  # noqa: S101
    return q, reason, value


def axial_compliance(model: fem.ArmModel) -> Array | None:
    """Compliances (dof,) rad/(N m) about the joint axes, if nothing else gives way and all are constant; else None."""
    if model.links or model.load_path != "serial" or model.base.any() or model.tool.any():
        return None
    out = np.zeros(model.robot.dof)
    for joint in model.joints:
        if not isinstance(joint.axial, ConstantSpring) or joint.bearing.any() or joint.housing.any() or joint.laws:
            return None
        out[joint.joint] = 1.0 / joint.axial.stiffness
    return out


def _run(
    compiled: ModuleType, figures: Figures, points: Array, along: bool, gamma: Array
) -> tuple[Array, NDArray[np.int8], Array]:
    block, rows, pairs = compiled.BLOCK, compiled.ROWS, compiled.COSINE
    k, m = gamma.size, gamma.shape[1]
    angle = gamma.ravel()
    q, reason, value = np.empty((k, 8, 6)), np.empty((k, 8), dtype=np.int8), np.empty((k, 8))

    def share(targets: slice) -> None:
        work, found = np.zeros((rows, block)), np.empty((pairs, block))
        for start in range(targets.start, targets.stop, block):
            part = slice(start, min(start + block, k))
            # A block that is not full is filled up with the last target.
            target = np.minimum(np.arange(start, start + block), k - 1)
            np.cos(angle[target], out=work[compiled.GAMMA])
            np.sin(angle[target], out=work[compiled.GAMMA + 1])
            compiled.solve(figures, points, target // m, along, work.ravel())
            np.arctan2(work[:pairs], work[pairs : 2 * pairs], out=found)
            compiled.finish(figures, found, work.ravel(), q[part], reason[part], value[part])

    in_shares(k, SHARE * block, threads(), share)
    return q, reason, value


def _figures(compiled: ModuleType, arm: SphericalWristArm, robot: Robot, task: Task, compliance: Array) -> Figures:
    wrist = arm.wrist
    tool = as_frames(task.T_flange_tool[None], "tool frame")[0]
    lever, z6, x6 = _tuple(
        np.stack([tool[:3, 3] - wrist.centre_flange, wrist.z6_flange, wrist.x6_flange]) @ tool[:3, :3]
    )
    near = robot.limits.mean(axis=1)
    alpha, beta = wrist.alpha, wrist.beta
    figures: Figures = compiled.Figures(
        R_21=_tuple(arm.R_21),
        t_21=_tuple(arm.t_21),
        R_42=_tuple(arm.R_42),
        sin12=arm.sin12,
        cos12=arm.cos12,
        along_2=arm.along_2,
        upper=arm.upper,
        fore=arm.fore,
        elbow_zero=arm.elbow_zero,
        elbow_zero_cs=(float(np.cos(arm.elbow_zero)), float(np.sin(arm.elbow_zero))),
        sign3=arm.sign3,
        front=arm.front,
        elbow_up=arm.elbow_up,
        margin_m=arm.margin_m,
        free_m=BOUNDARY * arm.length,
        free_rad=BOUNDARY,
        margin_rad=arm.margin_rad,
        nearest=abs(alpha - beta),
        farthest=min(alpha + beta, 2.0 * np.pi - alpha - beta),
        ca=float(np.cos(alpha)),
        sa=float(np.sin(alpha)),
        cb=float(np.cos(beta)),
        sb=float(np.sin(beta)),
        sin2_least=float(np.sin(0.5 * (alpha - beta)) ** 2),
        cos2_most=float(np.cos(0.5 * (alpha + beta)) ** 2),
        wrist_zero=wrist.zero,
        outward=wrist.outward,
        lever=lever,
        z6=z6,
        x6=x6,
        cos_near=_tuple(np.cos(near)),
        sin_near=_tuple(np.sin(near)),
        near=near,
        lower=robot.limits[:, 0] - LIMIT_TOLERANCE_RAD,
        upper_limit=robot.limits[:, 1] + LIMIT_TOLERANCE_RAD,
        compliance=_tuple(compliance),
    )
    return figures


def _tuple(a: Array) -> Any:
    """Nested tuples of an array's numbers."""
    return tuple(map(_tuple, a)) if a.ndim > 1 else tuple(a.tolist())


def _load(what: str, task: Task, force: Array | None) -> Array:
    if what == "normal":
        return task.normals
    assert force is not None  # noqa: S101 - the objective has seen to it
    return force if what == "force" else as_units("force", force, len(force))


def _points(arm: SphericalWristArm, task: Task, load: Array) -> Array | None:
    """(n, 18) as the compiled code wants them; None where tool axes are rounded figures."""
    out = np.empty((task.path.n, 18))
    for rows in in_blocks(task.path.n, POINTS):
        some = task.at(rows)
        frames = some.tool_frames([0.0, 0.5 * np.pi])
        R = frames[..., :3, :3]
        if np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max() > ROUNDED:
            return None
        out[rows] = _points_at(arm, some, frames, load[rows])
    return out


def _points_at(arm: SphericalWristArm, task: Task, frames: Array, load: Array) -> Array:
    """(n, 18) of some points; frames (n, 2, 4, 4) at gamma 0 and 90 deg."""
    tip, axis, x, y = frames[:, 0, :3, 3] - arm.p1, -frames[:, 0, :3, 2], frames[:, 0, :3, 0], frames[:, 1, :3, 0]
    return np.asarray(np.hstack([v @ arm.B1 for v in (tip, axis, x, y, load, task.normals)]))
