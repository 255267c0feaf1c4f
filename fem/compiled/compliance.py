"""Compliance, deflection and directional stiffness: what callers of the mechanics ask for.

Large batches of poses go by compiled loops where there are some (numba is installed, and the arm has nothing that they
do not know), all else by numpy (:mod:`fem.statics.flexibility`); the results are the same to rounding. Shares of the
poses go to threads; their number changes no digit. Laws of springs that vary with the pose are evaluated by numpy, all
poses of a share at once. Small displacements; the unloaded arm is the reference, and its own gravity is in it.
"""

from __future__ import annotations

import weakref
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from fem.compiled import kernel_arrays
from fem.compiled.flat_arm import FlatArm, flat_arm, why_not_flat
from fem.model import ArmModel
from fem.statics import flexibility
from fem.statics.inputs import as_points, as_wrenches
from fem.statics.transfers import flat_parallelogram
from robots import InputError
from robots.arrays import Array
from robots.kinematics import as_poses
from robots.threads import compiled_loops, in_shares

if TYPE_CHECKING:
    from fem.compiled.kernel_arrays import Figures, Work

# None where numba is not there.
kernels = partial(compiled_loops, "fem.compiled.kernels")
# Fewer poses than this numpy has done in some 10 ms; loading numba takes 0.3 s, once. Where thousands of calls follow
# one another, loading counts for nothing.
FEWEST, FEWEST_OFTEN = 2_000, 64
# Angles (rad) whose sines the compiled code knows to the last digit; theirs may be larger by an offset or two.
LARGEST = 1e5
# Blocks of poses for which a thread takes sines, cosines and laws at once.
SHARE = 16


def why_not_compiled(model: ArmModel) -> str | None:
    """Why no batch of this arm's poses goes by compiled loops, however large; None if large ones do."""
    reason = why_not_flat(model)
    if reason is None and kernels() is None:
        reason = "numba is not installed, or cannot start; pip install 'stiffarm[fast]'"
    return reason


def compliance(
    model: ArmModel,
    q: Array,
    point: Array | None = None,
    *,
    threads: int | None = None,
    out: Array | None = None,
    often: bool = False,
) -> Array:
    """Cartesian compliance (n, 6, 6) at the tool point, base axes: m/N, rad/N, m/(N m), rad/(N m).

    Column j is the deflection under the j-th unit wrench.

    Parameters
    ----------
    q : (n, dof) rad; limits are not checked here
    point : (3,) or (n, 3) m in the flange frame instead of the model's tool point
    threads : of compiled loops; None for as many as there are processors
    out : contiguous float (n, 6, 6), to be filled instead of a new array: of 288 bytes a pose the writing takes as
        long as the computing, unless they stay in the cache
    often : whether many more such calls follow, so that small batches too are worth compiled loops

    Raises
    ------
    InputError
        Shapes, values that are not finite, a flat parallelogram; ``out`` of another shape or type, ``threads`` below 1.
    """
    q = as_poses(model.robot, q)
    _check_out(out, len(q))
    if not _is_compiled(model, q, threads, often=often):
        plain = flexibility.compliance(model, q, point)
        if out is None:
            return plain
        out[:] = plain
        return out
    if out is None:
        out = np.empty((len(q), 6, 6))
    _solve(model, q, np.empty((0, 6)), point, threads, out.reshape(len(q), 36))
    return out


def deflection(
    model: ArmModel,
    q: Array,
    wrench: Array,
    point: Array | None = None,
    *,
    threads: int | None = None,
    often: bool = False,
) -> Array:
    """Displacement (n, 6) of the tool point under a wrench, from the unloaded arm: m and rad, base axes.

    The other arguments and the errors are those of :func:`compliance`.

    Parameters
    ----------
    wrench : (6,) or (n, 6), force N and moment N m in base axes at the tool point
    """
    q = as_poses(model.robot, q)
    if not _is_compiled(model, q, threads, often=often):
        return flexibility.deflection(model, q, wrench, point)
    loads = as_wrenches(wrench, len(q))
    out = np.empty((len(q), 6))
    _solve(model, q, loads[:1] if np.ndim(wrench) == 1 else loads, point, threads, out)
    return out


def directional_stiffness(
    model: ArmModel, q: Array, direction: Array | None = None, point: Array | None = None
) -> Array:
    """Stiffness |F| / |d . F/|F|| (n,) in N/m for a force along ``direction`` (base axes, default -Z).

    Raises
    ------
    InputError
        As of :func:`compliance`; a direction of length zero, or a model with nothing that gives way along it.
    """
    unit = unit_force(direction)
    displacement = deflection(model, q, unit, point) @ unit
    if not (displacement > 0.0).all():
        raise InputError(
            f"pose {int(np.argmin(displacement > 0.0))}: the model is rigid in this direction",
            remedy="give it flexible links or joint springs",
        )
    return np.asarray(1.0 / displacement)


def unit_force(direction: Array | None) -> Array:
    """Wrench (6,) of 1 N along a direction (3,), default -Z; InputError for one that is none."""
    axis = np.array([0.0, 0.0, -1.0]) if direction is None else np.asarray(direction, dtype=np.float64)
    norm = np.linalg.norm(axis)
    if axis.shape != (3,) or not 0.0 < norm < np.inf:
        raise InputError("load direction", value=axis.tolist(), allowed="three finite numbers, not all zero")
    return np.concatenate([axis / norm, np.zeros(3)])


def _is_compiled(model: ArmModel, q: Array, threads: int | None, *, often: bool) -> bool:
    if threads is not None and threads < 1:
        raise InputError("threads", value=threads, allowed="1 or more, None for as many as there are processors")
    if len(q) < max(FEWEST_OFTEN if often else FEWEST, 1) or why_not_flat(model) is not None or kernels() is None:
        return False
    return bool(max(q.max(), -q.min()) <= LARGEST)


def _solve(model: ArmModel, q: Array, wrench: Array, point: Array | None, threads: int | None, out: Array) -> None:
    """Fill ``out`` (n, 36) with compliances, or (n, 6) with deflections under wrenches (1 or n, 6)."""
    compiled = kernels()
    assert compiled is not None  # noqa: S101 - the caller has looked
    points = _points(model, point, len(q))
    arm, figures = _plan(model, compiled)

    def share(rows: slice) -> int:
        buffer: Work = kernel_arrays.work_of(len(arm.sign), len(arm.laws))
        some = _plain(q[rows])
        at, loads = (_plain(a[rows] if len(a) > 1 else a) for a in (points, wrench))
        axial, laws = arm.axial_compliance(some), arm.law_compliance(some)
        flat = int(compiled.deflections(figures, some, axial, laws, at, loads, buffer, out[rows]))
        return rows.start + flat if flat >= 0 else len(q)

    first = min(in_shares(len(q), SHARE * kernel_arrays.BLOCK, threads, share))
    if first < len(q):
        raise flat_parallelogram(model.robot, first)


def _points(model: ArmModel, point: Array | None, n: int) -> Array:
    """Tool points (1 or n, 3)."""
    points = as_points(point, n)
    if point is None or points is None:
        return np.asarray(model.robot.T_flange_tool[None, :3, 3])
    return points[:1] if np.ndim(point) == 1 else points


def _plain(a: Array) -> Array:
    """Contiguous and writable: numba compiles anew for arrays that are not."""
    return np.require(a, np.float64, ["C", "W"])


# The last model and its arrays: maps ask for one block after the other of the same model.
_kept: tuple[weakref.ref[ArmModel], FlatArm, Figures] | None = None


def _plan(model: ArmModel, compiled: ModuleType) -> tuple[FlatArm, Figures]:
    """Arrays of a model; models are immutable, so those of the last one are kept."""
    global _kept
    kept = _kept
    if kept is None or kept[0]() is not model:
        arm = flat_arm(model)
        kept = _kept = weakref.ref(model), arm, _figures(compiled, arm)
    return kept[1], kept[2]


def _check_out(out: Array | None, n: int) -> None:
    shape = (n, 6, 6)
    if out is not None and (out.shape != shape or out.dtype != np.float64 or not out.flags.c_contiguous):
        raise InputError("out", value=f"{out.dtype} {out.shape}", allowed=f"contiguous float64 of shape {shape}")


def _figures(compiled: ModuleType, arm: FlatArm) -> Figures:
    dof = len(arm.sign)
    joint, base = np.zeros((dof, kernel_arrays.CONSTANTS)), np.zeros(kernel_arrays.CONSTANTS)
    joint[:, kernel_arrays.TURN : kernel_arrays.TURN + 2] = arm.turn
    joint[:, kernel_arrays.SHIFT : kernel_arrays.SHIFT + 3] = arm.shift
    K = np.zeros((dof + 1, 6, 6))
    for part in arm.parts:
        K[part.frame] += part.K  # the base's is the last
    packed = _packed(K)
    joint[:, compiled.K :], base[compiled.K :] = packed[:dof], packed[dof]
    kind = np.full(dof, compiled.ANY)
    kind[arm.turn[:, 0] == 0.0] = compiled.QUARTER
    kind[arm.turn[:, 0] == 1.0] = compiled.STRAIGHT
    loop, at_pin, pin, upper, housing = np.zeros(8), np.zeros((6, 6)), np.zeros((6, 6)), np.zeros(36), np.zeros(36)
    if arm.loop is not None:
        d = arm.loop.driven
        c, s = arm.turn[d]
        loop[:3] = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]]) @ arm.loop.u
        loop[3:6], loop[6], loop[7] = arm.loop.pin, arm.loop.least, arm.loop.bar
        for part in arm.parts:
            if part.at_pin is not None and part.pin is not None:
                at_pin[:, :3] += part.at_pin
                pin[:3, :3] += part.pin
        upper, housing = K[d - 1].ravel().copy(), arm.loop.housing.ravel()
    figures: Figures = kernel_arrays.Figures(
        joint=joint,
        kind=kind.astype(np.int64),
        soft=np.asarray(packed[:dof].any(axis=1), dtype=np.int64),
        base=base,
        base_soft=bool(base.any()),
        turn_base=arm.turn_base,
        sign=arm.sign,
        offset=arm.offset,
        R_tool=np.ascontiguousarray(arm.R_tool),
        t_tool=arm.t_tool,
        law_frame=np.array([law.frame for law in arm.laws], dtype=np.int64),
        law_axis=np.array([law.axis for law in arm.laws]).reshape(-1, 3),
        law_turns=np.array([law.turns for law in arm.laws], dtype=np.int64),
        driven=-1 if arm.loop is None else arm.loop.driven,
        loop=loop,
        at_pin=at_pin.ravel(),
        pin=pin.ravel(),
        upper=np.ascontiguousarray(upper),
        housing=np.ascontiguousarray(housing),
        housed=bool(housing.any()),
        shift_crank=np.zeros(3) if arm.loop is None else arm.shift[arm.loop.driven - 1],
    )
    return figures


def _packed(K: Array) -> Array:
    """Symmetric matrices (k, 6, 6) as 21 numbers each, in the order of the kernels' rows."""
    i, j = np.triu_indices(3)
    return np.concatenate([K[:, i, j], K[:, :3, 3:].reshape(-1, 9), K[:, 3 + i, 3 + j]], axis=1)
