"""Compliance, deflection and directional stiffness: what callers of the mechanics ask for.

Large batches of poses go by compiled loops where there are some (numba is installed, and the arm has nothing that they
do not know), all else by numpy (:mod:`fem.statics.flexibility`); the results are the same to rounding. Shares of the
poses go to threads; their number changes no digit. Laws of springs that vary with the pose are evaluated by numpy, all
poses of a share at once. Small displacements; the unloaded arm is the reference, and its own gravity is in it.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from fem.compiled.flat_arm import BLOCK, flat_arm, why_not_flat
from fem.model import ArmModel
from fem.statics import flexibility
from fem.statics.loads import as_points, as_wrenches
from fem.statics.transfers import flat_parallelogram
from robots import InputError, require_at_least
from robots.arrays import Array
from robots.frames import unit_vector
from robots.kept import once_for_each
from robots.kinematics import as_poses
from robots.threads import compiled_loops, in_shares, plain

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
            code="M005",
            remedy="give it flexible links or joint springs",
        )
    return np.asarray(1.0 / displacement)


def unit_force(direction: Array | None) -> Array:
    """Wrench (6,) of 1 N along a direction (3,), default -Z; InputError for one that is none."""
    axis = unit_vector((0.0, 0.0, -1.0) if direction is None else direction, "load direction")
    return np.concatenate([axis, np.zeros(3)])


def _is_compiled(model: ArmModel, q: Array, threads: int | None, *, often: bool) -> bool:
    require_at_least("threads (None: as many as there are processors)", threads, 1, code="B003")
    if len(q) < max(FEWEST_OFTEN if often else FEWEST, 1) or why_not_flat(model) is not None or kernels() is None:
        return False
    return bool(max(q.max(), -q.min()) <= LARGEST)


def _solve(model: ArmModel, q: Array, wrench: Array, point: Array | None, threads: int | None, out: Array) -> None:
    """Fill ``out`` (n, 36) with compliances, or (n, 6) with deflections under wrenches (1 or n, 6)."""
    compiled = kernels()
    assert compiled is not None  # noqa: S101 - the caller has looked
    points = _points(model, point, len(q))
    arm = _plan(model)

    def share(rows: slice) -> int:
        some = plain(q[rows])
        at, loads = (plain(a[rows] if len(a) > 1 else a) for a in (points, wrench))
        axial, laws = arm.axial_compliance(some), arm.law_compliance(some)
        flat = int(compiled.deflections(arm.figures, some, axial, laws, at, loads, arm.work(), out[rows]))
        return rows.start + flat if flat >= 0 else len(q)

    first = min(in_shares(len(q), SHARE * BLOCK, threads, share))
    if first < len(q):
        raise flat_parallelogram(model.robot, first)


def _points(model: ArmModel, point: Array | None, n: int) -> Array:
    """Tool points (1 or n, 3)."""
    points = as_points(point, n)
    if point is None or points is None:
        return np.asarray(model.robot.T_flange_tool[None, :3, 3])
    return points[:1] if np.ndim(point) == 1 else points


# Maps ask for one block after the other of the same model, and models are immutable.
_plan = once_for_each(flat_arm)


def _check_out(out: Array | None, n: int) -> None:
    shape = (n, 6, 6)
    if out is not None and (out.shape != shape or out.dtype != np.float64 or not out.flags.c_contiguous):
        raise InputError(
            "out", code="B001", value=f"{out.dtype} {out.shape}", allowed=f"contiguous float64 of shape {shape}"
        )
