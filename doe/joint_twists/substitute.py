"""What the six stiffnesses of every joint make of the flange: stiffness, its uncertainty, usual models, a map.

Links are rigid, as in the paper: what they give way by between two reflectors is in the joints' stiffnesses. A force f
at the flange centre moves it along itself by ``sum_jr c_jr s_jr^2`` per newton, with s_jr what row r of joint j carries
per newton: linear in the compliances, so the uncertainty is exact to first order and no matrix is inverted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import nnls

from doe.joint_twists.cycles import carried, carried_rows
from doe.joint_twists.identify import Identified
from fem import ArmModel
from robots import InputError, forward_kinematics, inverse_kinematics, require_one_of, why_no_closed_form
from robots.arrays import Array
from robots.frames import framed

# Compliances (n, dof, 6) of the rows of every joint at poses (n, dof).
Compliances = Callable[[Array], Array]

AXIS = 5
# Of the six rows of a joint, the one about its gear axis.
ABOUT_GEAR = np.eye(6)[AXIS]
XYZ = np.eye(3)

# Axes of the flange on the map. The paper says that "the flange coordinate system was not rotated in any axis", not
# which orientation that is. forward: Z along the base's X; then the wrist centre of the origin is at 1344 - 194 =
# 1150 mm, a round figure, and the arm reaches the whole window. base: parallel to the base's, Z up, as with all joints
# at zero: the arm reaches half of it. down: Z down, as for milling on a table.
Orientation = Literal["base", "forward", "down"]

ORIENTATIONS: dict[str, Array] = {
    "base": np.eye(3),
    "forward": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
    "down": np.diag([1.0, -1.0, -1.0]),
}
# TX200 paper, section 2.1.
ORIGIN_M = (1.344, 0.550)
# Not stated in the paper: chosen so that the arm reaches all of it.
SIZE_M = (0.6, 0.6)


@dataclass(frozen=True, eq=False)
class Stiffness:
    """Directional stiffness (n, k) N/m in k directions, the ends of its 95 % interval, and ``open_share`` (n, k).

    ``open_share``: part of the squared forces and moments (at one metre) that falls on stiffnesses which are not
    identified: where it is not zero the value is too stiff by what nobody knows.
    """

    value: Array
    low: Array
    high: Array
    open_share: Array


def loads_in(model: ArmModel, q: Array, directions: Array) -> Array:
    """What every joint carries (n, k, dof, 6) per newton at the flange centre along directions (k, 3), flange axes."""
    k, n = len(directions), len(q)
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    wrench = np.hstack([np.tile(unit, (n, 1)), np.zeros((n * k, 3))])
    s = carried(model, np.repeat(q, k, axis=0), wrench, np.zeros((n * k, 3)))
    return s.reshape(n, k, -1, 6)


def stiffness_with(
    model: ArmModel, compliances: Array, q: Array, directions: Array = XYZ, *, or_rigid: bool = False
) -> Array:
    """Directional stiffness |F| / |d . F/|F|| (n, k) N/m at the flange centre along ``directions`` (k, 3), flange axes.

    ``compliances`` (n, dof, 6), or one row for all poses (dof, 6).

    Raises
    ------
    InputError
        A direction in which nothing deflects; with ``or_rigid`` the stiffness there is inf.
    """
    s2 = loads_in(model, q, directions) ** 2
    moved = np.einsum("nkjr,njr->nk", s2, np.broadcast_to(compliances, (len(q), *s2.shape[2:])))
    if not or_rigid and not (moved > 0.0).all():
        raise InputError(
            "directional stiffness: nothing deflects in a direction", code="M005", remedy="identify more stiffnesses"
        )
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / moved)


def predict(model: ArmModel, found: Identified, q: Array, directions: Array = XYZ) -> Stiffness:
    """Directional stiffness by identified stiffnesses, with 95 % intervals from their covariances."""
    s2 = loads_in(model, q, directions) ** 2
    c, sd = found.compliances(q)
    moved = np.einsum("nkjr,njr->nk", s2, c)
    spread = np.sqrt(np.einsum("nkjr,njr->nk", s2**2, sd**2))
    quantile = max(d.quantile for d in found.directions.values())
    missing = np.array([d.status == "not identified" for d in found.directions.values()]).reshape(-1, 6)
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = 1.0 / (moved + quantile * spread), 1.0 / (moved - quantile * spread)
        value = np.where(moved > 0.0, 1.0 / moved, np.nan)
    # Without an interval of the compliances (NaN) there is none of the stiffness either.
    high = np.where((high > 0.0) | np.isnan(high), high, np.inf)
    return Stiffness(value, low, high, np.asarray(s2[..., missing].sum(axis=-1) / s2.sum(axis=(2, 3))))


def compliances_of(found: Identified) -> Compliances:
    """The identified compliances as a function of the pose; zero where there is no number."""
    return lambda q: found.compliances(q)[0]


def gear_refitted(model: ArmModel, six: Array, q: Array) -> Array:
    """Compliances (dof,) rad/(N m) of the usual model as it is usually found: a constant a gear, fitted at the flange.

    Least squares over the displacements under unit forces in flange X, Y and Z at poses q, where all rows have the
    compliances ``six`` (n, dof, 6); none below zero, and zero for a gear that these forces never turn. The other
    directions of the joints end up in the gears' effective stiffnesses.
    """
    frames = forward_kinematics(model.robot, q)
    T, w = carried_rows(model, frames, frames.p_flange), np.zeros((len(q), 3, 6))
    w[:, :, :3] = np.swapaxes(frames.R_flange, 1, 2)
    s = np.einsum("njra,nka->nkjr", T, w)
    whole = np.einsum("njra,njr,nkjr->nka", T, six, s)[..., :3]
    of_gear = np.einsum("nja,nkj->nkaj", T[:, :, AXIS], s[..., AXIS])[..., :3, :]
    A = of_gear.reshape(-1, T.shape[1])
    size = np.linalg.norm(A, axis=0)
    # Forces at the flange centre never turn the last joint: what its column holds is rounding.
    moves = size > 1e-9 * size.max()
    effective = np.zeros(len(size))
    effective[moves] = nnls(A[:, moves] / size[moves], whole.ravel())[0] / size[moves]
    return effective


def reachable_poses(model: ArmModel, n: int, rng: np.random.Generator, *, lowest_m: float = 0.0) -> Array:
    """Poses (n, dof) drawn evenly within limits, the flange above ``lowest_m``, its axis no further down than that.

    Collisions of the arm with itself are not looked at.

    Raises
    ------
    InputError
        Next to no pose keeps the limits.
    """
    robot = model.robot
    kept: list[Array] = []
    for _ in range(200):
        q = rng.uniform(robot.limits[:, 0], robot.limits[:, 1], size=(4 * n, robot.dof))
        q = q[robot.reachable(q)]
        if len(q):
            kept += list(q[forward_kinematics(robot, q).p_flange[:, 2] > lowest_m])
        if len(kept) >= n:
            return np.array(kept[:n])
    raise InputError(f"random poses of {robot.name}: hardly any keeps the limits", code="J005", allowed="wider limits")


@dataclass(frozen=True)
class Errors:
    """Relative errors of directional stiffness, by flange axis (3,): mean, 95th percentile of the size, worst size.

    ``bias``: mean with its sign, positive where the model is too stiff.
    """

    bias: Array
    mean: Array
    p95: Array
    worst: Array


def errors_of(k: Array, reference: Array) -> Errors:
    """Errors of stiffnesses k (n, 3) against ``reference`` (n, 3)."""
    e = k / reference - 1.0
    size = np.abs(e)
    return Errors(e.mean(axis=0), size.mean(axis=0), np.percentile(size, 95.0, axis=0), size.max(axis=0))


def usual_models(
    model: ArmModel, six: Compliances, *, poses: int, rng: np.random.Generator
) -> tuple[Errors, Errors, Array]:
    """How wrong models of the gears alone are against six stiffnesses a joint, over random reachable poses.

    The usual model (eq. 3 of the paper) has stiffness about the gear axes only, all else is rigid.

    Returns
    -------
    errors with the same torsional stiffness; errors refitted to flange deflections at other random poses; the
    effective compliances (dof,) of that fit
    """
    seen, q = (reachable_poses(model, poses, rng) for _ in range(2))
    effective = gear_refitted(model, six(seen), seen)
    c = six(q)
    reference = stiffness_with(model, c, q)
    gears = c * ABOUT_GEAR, np.outer(effective, ABOUT_GEAR)
    same, fitted = (stiffness_with(model, gear, q, or_rigid=True) for gear in gears)
    return errors_of(same, reference), errors_of(fitted, reference), effective


@dataclass(frozen=True, eq=False)
class Window:
    """A map as in Fig. 3 of the TX200 paper, of a window of the X-Z plane, the flange never turned.

    ``x`` (nx,) and ``z`` (nz,) m, ``q`` (nz, nx, dof) rad, ``stiffness`` (nz, nx, 3) N/m in flange X, Y, Z.

    NaN where the flange cannot be brought there. ``mean``: of the three directions. ``elbow``: up or down, in all of
    the map.
    """

    orientation: Orientation
    elbow: str
    x: Array
    z: Array
    q: Array
    stiffness: Array

    @property
    def mean(self) -> Array:
        """Mean of the directional stiffnesses (nz, nx) N/m."""
        return np.asarray(self.stiffness.mean(axis=2))


def stiffness_window(
    model: ArmModel,
    six: Compliances,
    *,
    orientation: Orientation = "forward",
    origin_m: tuple[float, float] = ORIGIN_M,
    size_m: tuple[float, float] = SIZE_M,
    points: tuple[int, int] = (31, 31),
) -> Window:
    """Directional stiffnesses over a window of the plane Y = 0, each under a unit force of its own.

    The paper gives the window's origin (X 1344 mm, Z 550 mm from the base), not its size.

    The arm stands in front of axis 1, its elbow in all of the map on the side that reaches more of it (up if both do),
    its wrist the way that keeps joint 4 nearest to zero.

    Raises
    ------
    InputError
        Unknown orientation; a robot without inverse kinematics in closed form; nothing in the window is reached.
    """
    require_one_of("orientation of the flange", orientation, ORIENTATIONS, code="J005")
    robot = model.robot
    if (reason := why_no_closed_form(robot)) is not None:
        raise InputError(
            f"stiffness window of {robot.name}: {reason}", code="R004", allowed="a robot with a spherical wrist"
        )
    x = origin_m[0] + np.linspace(0.0, size_m[0], points[0])
    z = origin_m[1] + np.linspace(0.0, size_m[1], points[1])
    points_m = np.column_stack([np.tile(x, z.size), np.zeros(x.size * z.size), np.repeat(z, x.size)])
    T = framed(ORIENTATIONS[orientation], points_m)
    found = inverse_kinematics(robot, T, T_flange_tool=np.eye(4), near=np.zeros(robot.dof))
    usable, elbow = np.zeros_like(found.valid), "up"
    for side in ("up", "down"):
        wanted = [f"elbow {side}" in name and "back" not in name for name in found.names]
        these = np.asarray(found.valid & np.array(wanted))
        if these.any(axis=1).sum() > usable.any(axis=1).sum():
            usable, elbow = these, side
    turned = np.where(usable, np.abs(found.q[:, :, 3]), np.inf)
    best = turned.argmin(axis=1)
    reached = np.asarray(usable.any(axis=1), dtype=np.bool_)
    q = np.where(reached[:, None], found.q[np.arange(len(T)), best], np.nan)
    if not reached.any():
        raise InputError(
            f"stiffness window of {robot.name}: nothing in it is reached with the flange {orientation}",
            code="J005",
            value=f"X {1e3 * x[0]:.0f} to {1e3 * x[-1]:.0f}, Z {1e3 * z[0]:.0f} to {1e3 * z[-1]:.0f} mm",
            allowed="a window within reach",
            remedy="move it with --window, or choose another --flange",
        )
    k = np.full((len(T), 3), np.nan)
    k[reached] = stiffness_with(model, six(q[reached]), q[reached])
    return Window(orientation, elbow, x, z, q.reshape(z.size, x.size, -1), k.reshape(z.size, x.size, 3))
