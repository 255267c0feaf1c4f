"""What a surrogate answers: values with error bars, and flags for poses at which they do not hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fem.statics.small_displacements import beyond_small, refuse_beyond
from robots import Robot
from robots.arm_class import usual_load
from robots.arrays import Array, Bools, in_blocks
from robots.constants import NORMAL_95
from robots.errors import InputError
from robots.frames import unit_vector
from robots.inverse.singularities import BLOCK, NEAR_SINGULAR, singularity_distance
from surrogate.model import COMPLIANCE, Surrogate, predict, raw, refuse
from surrogate.scope import Scope, count_rows, every

# Half-width of a 95 % interval by parameters beyond which first-order propagation is off by 7 %
# (doe.certainty.propagation).
ROUGH_95 = 0.6
# Of more poses than this, nearness to singularities is told only when asked for: it takes many times as long.
SINGULARITY_ROWS = 1_000
# No structure is as stiff as this, m/N; beyond, 1/c overflows.
_STIFFEST = 1e-300


@dataclass(frozen=True, eq=False)
class QueryResult:
    """A quantity at n poses.

    Parameters
    ----------
    value : (n,) the quantity in SI; of a compliance its reciprocal, the stiffness in N/m. NaN where not answered
    relative_error : (n,) half-width of the 95 % interval over the value, of model and parameters together. Infinite
        where the pose is outside of the domain or cannot be reached: nothing is known there. NaN where no error bar
        was learned (another load direction)
    model_error, parameter_error : (n,) its two parts; the second is NaN where nothing is known of the parameters
    inside_domain : (n,) each input within the domain
    reachable : (n,) the couplings hold
    beyond_small : (n,) poses where the load that arms of this reach bear takes it beyond small displacements
        (:mod:`fem.statics.small_displacements`): the value does not hold. False for other quantities than stiffnesses,
        and where the robot is not known
    singularity : (n,) smallest singular value of the Jacobian at the tool point, lengths over the arm's
        (:func:`robots.singularity_distance`); NaN if the robot is not known or it was not asked for
    open : row -> what the calibration left open and what matters there: its error bar is a lower bound
    faults : row -> what is wrong with it, in words, for all rows outside
    """

    value: Array
    relative_error: Array
    model_error: Array
    parameter_error: Array
    inside_domain: Bools
    reachable: Bools
    beyond_small: Bools
    singularity: Array
    open: dict[int, tuple[str, ...]]
    faults: dict[int, str]

    @property
    def stiffness_N_per_mm(self) -> Array:  # noqa: N802 - units are written as the shop writes them
        """Directional stiffness (n,), for a surrogate of the compliance."""
        return 1e-3 * self.value

    @cached_property
    def near_singular(self) -> Bools:
        """Poses near a singularity (`NEAR_SINGULAR`)."""
        return np.asarray(self.singularity < NEAR_SINGULAR)

    @cached_property
    def rough(self) -> Bools:
        """Poses where the calibration's part is so large that its linear propagation is rough (`ROUGH_95`)."""
        return np.asarray(np.nan_to_num(self.parameter_error) > ROUGH_95)

    @cached_property
    def answered(self) -> Bools:
        """Rows with a value."""
        return np.isfinite(self.value)


def query(
    surrogate: Surrogate,
    Q: Array,
    extrapolate: bool = False,
    *,
    direction: Array | None = None,
    singularity: bool | None = None,
) -> QueryResult:
    """Value with error bars and flags; Q (n, k) rad in the order of ``surrogate.inputs``.

    Rows outside of the domain or of a coupling are flagged and get no value.

    Parameters
    ----------
    extrapolate : give values there too, flagged and without error bar
    direction : (3,) another force direction, for a factored surrogate: values without error bars, which were learned
        for its own direction
    singularity : tell how near each pose is to a singularity; None: for up to `SINGULARITY_ROWS` poses

    Raises
    ------
    InputError
        No row at all can be answered, an angle that is not finite, a pose where the fit gives no valid value, or
        nothing but values beyond small displacements.
    """
    poses = surrogate.poses(Q, f"query of {surrogate.robot}")
    inside, reachable = every(surrogate.inside(poses)), every(surrogate.couplings.kept(poses))
    good = inside & reachable
    if not extrapolate and len(poses) and not good.any():
        raise InputError(
            f"query of {surrogate.robot}: {count_rows(~good)} outside the fitted range: "
            + "; ".join(surrogate.faults(poses)),
            code="S001",
            remedy="ask inside these ranges, fit a surrogate on a larger domain, or pass `--extrapolate` "
            "(extrapolate=True) to get flagged values without an error bar",
        )
    asked = np.ones(len(poses), dtype=np.bool_) if extrapolate else good
    value = np.full(len(poses), np.nan)
    # Without a mask where all are: masks of many rows take as long as some of the work.
    rows: Bools | slice = slice(None) if good.all() else good
    value[rows] = _values(surrogate, poses[rows], direction)
    value[asked & ~good] = _extrapolated(surrogate, poses[asked & ~good], direction)
    if extrapolate and len(poses) and not np.isfinite(value).any():
        refuse(surrogate, value, ~good)
    known = direction is None or same_direction(direction, surrogate.load_direction)
    judged = good & known
    model, parameters = _bars(surrogate, poses, value, rows if known else judged)
    model[good & ~judged] = np.nan
    total = np.hypot(model, np.where(np.isnan(parameters), 0.0, parameters))
    beyond = _beyond_small(surrogate, value)
    near, robot = np.full(len(poses), np.nan), surrogate.kinematics
    if robot is not None and (len(poses) <= SINGULARITY_ROWS if singularity is None else singularity):
        for rows in in_blocks(len(poses), BLOCK):
            near[rows] = singularity_distance(robot, full_poses(robot, surrogate, poses[rows])).sigma_min
    bad = np.flatnonzero(~good)
    faults = dict(zip(bad.tolist(), surrogate.words_of_faults(poses[bad]), strict=True))
    return QueryResult(
        value, total, model, parameters, inside, reachable, beyond, near, _left_open(surrogate, poses, judged), faults
    )


def _beyond_small(surrogate: Surrogate, value: Array) -> Bools:
    """Which stiffnesses (n,) N/m are beyond small displacements; InputError where all that are known are."""
    robot = surrogate.kinematics
    if robot is None or not (surrogate.quantity.name == COMPLIANCE or surrogate.quantity.unit == "N/m"):
        return np.zeros(len(value), dtype=np.bool_)
    load = usual_load(robot)
    moved = np.nan_to_num(load / np.maximum(np.abs(value), _STIFFEST))[:, None]
    beyond = beyond_small(robot, moved)
    known = np.isfinite(value)
    if known.any() and beyond[known].all():
        refuse_beyond(robot, moved[known], f"query of {surrogate.robot} under {load:.3g} N, as arms of its reach bear")
    return beyond


def _values(surrogate: Surrogate, poses: Array, direction: Array | None) -> Array:
    y = predict(surrogate, poses, direction)
    if surrogate.quantity.name != COMPLIANCE:
        return y
    refuse(surrogate, y, ~(y > _STIFFEST))
    return 1.0 / y


def _extrapolated(surrogate: Surrogate, poses: Array, direction: Array | None) -> Array:
    """Values far outside: NaN where the fit gives none."""
    y = raw(surrogate, poses, direction)
    if surrogate.quantity.name != COMPLIANCE:
        return np.where(np.isfinite(y), y, np.nan)
    fine = np.isfinite(y) & (y > _STIFFEST)
    return np.where(fine, 1.0 / np.where(fine, y, 1.0), np.nan)


def same_direction(a: Array, b: Sequence[float]) -> bool:
    """Whether two directions (3,) are one but for length and sign, which leave a compliance unchanged."""
    one, other = (unit_vector(each, "direction") for each in (a, b))
    return bool(np.linalg.norm(np.cross(one, other)) < 1e-12)


def _bars(surrogate: Surrogate, poses: Array, value: Array, good: Bools | slice) -> tuple[Array, Array]:
    """95 % half-widths by the surrogate's own error and by the parameters; infinite where nothing is known."""
    model = np.full(len(poses), np.inf)
    parameters = np.full(len(poses), np.nan)
    if surrogate.bars is None:
        model[good] = np.nan
    else:
        model[good] = surrogate.bars.half_width(poses[good])
    if surrogate.parameters is not None:
        own = 1.0 / value[good] if surrogate.quantity.name == COMPLIANCE else value[good]
        parameters[good] = NORMAL_95 * surrogate.parameters.relative_sd(poses[good], own)
    return model, parameters


def _left_open(surrogate: Surrogate, poses: Array, good: Bools) -> dict[int, tuple[str, ...]]:
    p = surrogate.parameters
    if p is None:
        return {}
    there = p.matters(poses) & good[:, None]
    rows = np.flatnonzero(there.any(axis=1))
    kinds, kind = np.unique(there[rows], axis=0, return_inverse=True)
    names = [tuple(n for n, yes in zip(p.undetermined, one, strict=True) if yes) for one in kinds]
    return dict(zip(rows.tolist(), (names[j] for j in kind.reshape(-1)), strict=True))


def full_poses(robot: Robot, scope: Scope, Q: Array) -> Array:
    """Poses of all joints (n, dof) rad from the inputs (n, k), the others at their fixed values."""
    q = np.zeros((len(Q), robot.dof))
    for name, value in scope.fixed_deg.items():
        q[:, robot.coordinate_index(name)] = np.radians(value)
    q[:, [robot.coordinate_index(name) for name in scope.inputs]] = Q
    return q
