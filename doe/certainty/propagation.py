"""What the uncertainty of calibrated numbers makes of the arm's compliance, pose by pose.

To first order, with variables u of covariance S and the compliance C along a unit wrench w,
``var C = (dC/du) S (dC/du)^T`` (the law of propagation, JCGM 100:2008, section 5.2). Derivatives are exact
(:mod:`fem.free.model`).

Limits of validity. C is linear in compliances, couplings and moduli: for these the standard deviation is exact
whatever its size, and only normality is lost where springs may be rigid. For laws (ln k) and walls a standard
deviation of ln k of 0.3 makes that of C 7 % larger than stated here (log-normal; 31 % at 0.6); beyond it ``is_rough``
says so, and :func:`sampled` serves. What the calibration held fixed counts as exact, so that the whole is a lower
bound of what is unknown about the arm; numbers that the readings left open are flagged where they matter
(``is_lower_bound``).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from doe.certainty.parameter_uncertainty import Bound, ParameterUncertainty, bind, parameter_uncertainty
from fem import ArmModel
from fem.free.model import LoadedPoses
from fem.statics.loads import as_points
from robots import InputError
from robots.arrays import Array, Bools
from robots.kinematics import as_poses

__all__ = [
    "ComplianceGradients",
    "ParameterUncertainty",
    "Propagated",
    "compliance_gradients",
    "drawn_variables",
    "parameter_uncertainty",
    "propagate",
    "sampled",
]


# Poses worked on at once: the derivatives of ten numbers are 4 MB.
BATCH = 8192
# A number left open matters where it may change the compliance by this share.
SHARE = 0.01
# Standard deviation of C, or of ln k of a law that carries a share, up to which the first order holds to 7 %.
ROUGH = 0.3
# The largest exponent of a wall in a link's compliance (bending of a solid section).
WALL_POWER = 3.0
# Draws with a negative compliance are drawn again so many times.
REDRAWN = 100


@dataclass(frozen=True, eq=False)
class Propagated:
    """The compliance along a unit wrench at n poses and its uncertainty.

    ``compliance`` (n,): m/N for a force. ``gradient`` (n, p): of ln(compliance) by the variables.
    ``relative_sd`` (n,): standard deviation over compliance, the same for the stiffness to first order, times Student's
    t over the normal quantile: 1.96 of it are 95 % (:attr:`ParameterUncertainty.widened`), wherever it is shown.
    ``open_share`` (n, m): by which share each of the m numbers and combinations ``open_names`` that the readings left
    open may change the compliance; it is not in ``relative_sd``. ``is_rough`` (n,): the first order does not hold.
    """

    compliance: Array
    gradient: Array
    relative_sd: Array
    open_names: tuple[str, ...]
    open_share: Array
    is_rough: Bools

    @property
    def is_lower_bound(self) -> Bools:
        """Where (n,) a number that the readings left open matters, so that ``relative_sd`` says too little."""
        return np.asarray((self.open_share > SHARE).any(axis=1))

    @property
    def matters(self) -> tuple[str, ...]:
        """Names of what the readings left open and what matters at any of the poses."""
        there: Bools = np.asarray((self.open_share > SHARE).any(axis=0))
        return tuple(name for name, yes in zip(self.open_names, there, strict=True) if yes)


def propagate(
    model: ArmModel,
    uncertainty: ParameterUncertainty,
    q: Array,
    direction: Array | None = None,
    point: Array | None = None,
) -> Propagated:
    """Propagate the covariance of the calibrated numbers to the compliance along a direction.

    Parameters
    ----------
    model : built from the description that the uncertainty comes from (with its effects of stage "model")
    q : (n, dof) rad
    direction : force (3,) or (n, 3), or force and moment (6,) or (n, 6), base axes, its length does not matter (of
        six: of all six); default -Z
    point : (3,) or (n, 3) m, flange frame, instead of the model's tool point

    Raises
    ------
    InputError
        Another model than the calibrated one, or one that is rigid in this direction.
    """
    q = as_poses(model.robot, q)
    bound = bind(uncertainty, model, q)
    load = _unit_wrench(direction, len(q))
    C, G = np.empty(len(q)), np.empty((len(q), len(bound.names)))
    for rows, at in _batches(model, q, load, point):
        value, J = _derivatives(bound, at)
        C[rows] = np.einsum("ni,ni->n", value, load[rows])
        G[rows] = np.einsum("nip,ni->np", J, load[rows])
    if not (C > 0.0).all():
        raise InputError(
            f"pose {int(np.argmin(C > 0.0))}: the model is rigid in this direction",
            code="M005",
            remedy="give it flexible links or joint springs",
        )
    G /= C[:, None]
    p = len(uncertainty.names)
    V = uncertainty.widened
    sd = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", G[:, :p], V, G[:, :p]), 0.0))
    rough = (sd > ROUGH) | _bent(bound, uncertainty, q, G)
    return Propagated(C, G[:, :p], sd, bound.open_names, np.abs(_open_change(bound, uncertainty, G)), rough)


@dataclass(frozen=True, eq=False)
class ComplianceGradients:
    """How the compliance (n, k, k) itself depends on the variables, at n poses.

    ``known`` (n, p, k, k): derivatives by the variables that have a variance: ``d . G d`` is that along any unit wrench
    d. ``open_change`` (n, m, k, k): by how much each of the m parameters and combinations ``open_names`` that the
    readings left open may change it. ``is_rough`` (n,): the first order does not hold for its trace.
    """

    known: Array
    open_names: tuple[str, ...]
    open_change: Array
    is_rough: Bools


def compliance_gradients(
    model: ArmModel, uncertainty: ParameterUncertainty, q: Array, point: Array | None = None, *, size: int = 6
) -> ComplianceGradients:
    """Derivatives of the compliance by the variables; ``size`` 6: the whole of it, 3: its translational block.

    Where all variables are compliances, couplings and moduli, the compliance is linear in them and the derivatives are
    all there is. Errors as in :func:`propagate`.
    """
    q = as_poses(model.robot, q)
    bound, p = bind(uncertainty, model, q), len(uncertainty.names)
    C, G = np.empty((len(q), size, size)), np.empty((len(q), len(bound.names), size, size))
    for column, load in enumerate(np.eye(6)[:size]):
        for rows, at in _batches(model, q, np.tile(load, (len(q), 1)), point):
            value, J = _derivatives(bound, at)
            C[rows, :, column] = value[:, :size]
            G[rows, :, :, column] = J[:, :size].transpose(0, 2, 1)
    G = 0.5 * (G + G.swapaxes(2, 3))
    trace = np.trace(C, axis1=1, axis2=2)
    share = np.trace(G, axis1=2, axis2=3) / np.where(trace > 0.0, trace, np.inf)[:, None]
    opened = _open_change(bound, uncertainty, G)
    return ComplianceGradients(G[:, :p], bound.open_names, opened, _bent(bound, uncertainty, q, share))


def sampled(
    model: ArmModel,
    uncertainty: ParameterUncertainty,
    q: Array,
    rng: np.random.Generator,
    draws: int = 1000,
    direction: Array | None = None,
    point: Array | None = None,
) -> Array:
    """Compliances (draws, n) of models whose numbers are drawn from the normal distribution of their variables.

    The alternative where the first order does not hold (JCGM 101:2008). Draws with a negative compliance of a part
    are drawn again, after 100 times set to rigid: a normal distribution of a compliance that is cut off there.
    Arguments and errors as in :func:`propagate`.
    """
    q = as_poses(model.robot, q)
    bound = bind(uncertainty, model, q)
    load = _unit_wrench(direction, len(q))
    u = _draws(bound, uncertainty, rng, draws)
    out = np.empty((draws, len(q)))
    for rows, at in _batches(model, q, load, point):
        d = bound.free(at).displacements(u)
        out[:, rows] = np.einsum("rni,ni->rn", d, load[rows])
    return out


def drawn_variables(
    uncertainty: ParameterUncertainty, model: ArmModel, q: Array, rng: np.random.Generator, draws: int
) -> Array:
    """Variables (draws, p) of models whose numbers are drawn as in :func:`sampled`.

    Numbers that do not act on the compliance keep their value. ``q`` (n, dof) rad: some poses, to know the model by.
    """
    bound = bind(uncertainty, model, q)
    columns = bound.columns[: len(uncertainty.names)]
    u = _draws(bound, uncertainty, rng, draws)
    return np.where(columns >= 0, u[:, np.maximum(columns, 0)], uncertainty.estimate)


def _draws(bound: Bound, uncertainty: ParameterUncertainty, rng: np.random.Generator, draws: int) -> Array:
    """Variables (draws, P) of the whole free model."""
    V = uncertainty.widened
    acts = np.flatnonzero(bound.columns[: len(uncertainty.names)] >= 0)
    columns = bound.columns[acts]
    positive = np.array([bound.numbers.parameters[c].scale == "compliance" for c in columns], dtype=np.bool_)
    root = _root(V[np.ix_(acts, acts)])
    u = np.tile(bound.numbers.u, (draws, 1))
    wrong = np.arange(draws)
    for _ in range(REDRAWN):
        u[np.ix_(wrong, columns)] = bound.numbers.u[columns] + rng.standard_normal((len(wrong), len(columns))) @ root.T
        wrong = np.flatnonzero((u[:, columns] < 0.0)[:, positive].any(axis=1))
        if not wrong.size:
            break
    cut = u[:, columns]
    u[:, columns] = np.where(positive, np.maximum(cut, 0.0), cut)
    return u


def _root(V: Array) -> Array:
    """R with R R^T = V, also where V is singular; scaled first, for variances span many decades."""
    sd = np.sqrt(np.diag(V))
    scale = np.where(sd > 0.0, sd, 1.0)
    values, vectors = np.linalg.eigh(V / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _unit_wrench(direction: Array | None, n: int) -> Array:
    """Loads (n, 6) of length one."""
    d = np.array([0.0, 0.0, -1.0]) if direction is None else np.asarray(direction, dtype=np.float64)
    if d.ndim not in (1, 2) or d.shape[-1] not in (3, 6) or (d.ndim == 2 and len(d) != n):
        raise InputError(
            "load direction: shape", code="B001", value=d.shape, allowed=f"(3,), (6,), ({n}, 3) or ({n}, 6)"
        )
    length = np.linalg.norm(d, axis=-1, keepdims=True)
    if not ((length > 0.0) & np.isfinite(length)).all():
        raise InputError(
            "load direction", code="B001", value=d.tolist() if d.ndim == 1 else "some", allowed="finite, not all zero"
        )
    out = np.zeros((n, 6))
    out[:, : d.shape[-1]] = d / length
    return out


def _batches(model: ArmModel, q: Array, load: Array, point: Array | None) -> Iterator[tuple[slice, LoadedPoses]]:
    given = as_points(point, len(q))
    tips = np.broadcast_to(model.robot.T_flange_tool[:3, 3] if given is None else given, (len(q), 3))
    for first in range(0, len(q), BATCH):
        rows = slice(first, min(first + BATCH, len(q)))
        yield rows, LoadedPoses(q[rows], load[rows], tips[rows])


def _derivatives(bound: Bound, at: LoadedPoses) -> tuple[Array, Array]:
    """Displacements (n, 6) and derivatives (n, 6, p + m) by the named variables; zero by those that do not act."""
    value, J = bound.free(at).evaluate(bound.numbers.u)
    acts = bound.columns >= 0
    out = np.zeros((*value.shape, len(acts)))
    out[:, :, acts] = J[:, :, bound.columns[acts]]
    return value, out


def _open_change(bound: Bound, uncertainty: ParameterUncertainty, G: Array) -> Array:
    """By how much (n, m + d, ...) open numbers and combinations may change what has derivatives G (n, p + m, ...).

    Along a direction that no reading determines the variables may go as far as the number that is the first to have
    changed by its own size.
    """
    p, D = len(uncertainty.names), uncertainty.directions
    way = np.divide(bound.sizes[:p], np.abs(D), out=np.full_like(D, np.inf), where=D != 0.0).min(axis=1, initial=np.inf)
    alone = np.einsum("m,nm...->nm...", bound.sizes[p:], G[:, p:])
    together = np.einsum("dp,np...->nd...", D * way[:, None], G[:, :p])
    return np.concatenate([alone, together], axis=1)


def _bent(bound: Bound, uncertainty: ParameterUncertainty, q: Array, G: Array) -> Bools:
    """Where (n,) a law's or a wall's own spread is beyond what the first order carries."""
    out = np.zeros(len(q), dtype=np.bool_)
    p = len(uncertainty.names)
    columns, parameters = bound.columns[:p], bound.numbers.parameters
    for law in bound.numbers.laws:
        mine = np.flatnonzero((columns >= law.first) & (columns < law.first + law.basis.size))
        if mine.size:
            B = law.basis(q)[:, columns[mine] - law.first]
            sd = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", B, uncertainty.covariance[np.ix_(mine, mine)], B), 0.0))
            share = np.abs(np.sum(G[:, mine] * B, axis=1)) / np.maximum(np.sum(B**2, axis=1), 1e-300)
            out |= (sd > ROUGH) & (share > SHARE)
    for k in np.flatnonzero(columns >= 0):
        if parameters[columns[k]].kind.has_sections:
            out |= (WALL_POWER * np.sqrt(uncertainty.covariance[k, k]) > ROUGH) & (np.abs(G[:, k]) > SHARE)
    return out
