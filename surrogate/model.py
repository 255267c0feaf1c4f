"""What a surrogate is, and what it predicts."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from fem.statics.stated import StatedAt
from robots import Robot
from robots.arrays import Array, Bools, Integers, in_blocks
from robots.errors import InputError, require_one_of
from robots.frames import unit_vector
from surrogate.error_bars import ErrorBars, ParameterBars
from surrogate.expansion import Expansion
from surrogate.fast import evaluate, sum_of_squares
from surrogate.scope import ROWS_SHOWN, Scope, count_rows

Target = Literal["direct", "logarithm", "factored"]

TARGETS: tuple[Target, ...] = get_args(Target)
SCHEMA = "stiffarm-surrogate/2"
COMPLIANCE = "compliance"
# Numbers that rows of a factored surrogate take while evaluating: some 16 MB.
_BLOCK = 2_000_000


@dataclass(frozen=True)
class Quantity:
    """What a surrogate answers: ``name`` ('compliance' or another scalar), ``unit`` of its SI value, words for it.

    'compliance' is m/N along the load direction; the stiffness shown is its reciprocal.
    """

    name: str = COMPLIANCE
    unit: str = "m/N"
    label: str = "compliance along the load"


@dataclass(frozen=True)
class ErrorFigures:
    """How far a surrogate is off on runs that were kept out of its fit and of its error bars.

    Relative errors are ``|predicted / true - 1|`` (1, not %): over uniform and boundary poses together, and
    (``interior``) over the uniform ones. ``coverage95``: share of the uniform ones inside the 95 % error bars.
    ``condition_number`` is that of the least squares matrix; ``degree`` is the total degree or the trigonometric
    order. ``matrix_rms``, ``matrix_max``: of the 6 x 6 compliance, Frobenius norm of the error over that of the
    matrix; None for a scalar.
    """

    basis: str
    degree: int
    target: str
    n_terms: int
    n_train: int
    n_test: int
    rms_relative: float
    p95_relative: float
    max_relative: float
    rms_interior: float
    max_interior: float
    coverage95: float
    condition_number: float
    matrix_rms: float | None = None
    matrix_max: float | None = None


@dataclass(frozen=True, eq=False)
class Factor:
    """How the numbers of an expansion make a compliance matrix: ``C = sum_r w_g(r)(q) l_r(q)^T l_r(q)``.

    The expansion gives the rows l (r, 6). ``weights``: expansions (one output each) of the logarithms of w (g,);
    ``group`` (r,): which weight belongs to a row, -1 is 1.
    """

    group: Integers
    weights: tuple[Expansion, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.weights)
        if self.group.ndim != 1 or not len(self.group) or (self.group < -1).any() or (self.group >= count).any():
            raise InputError(
                "surrogate: groups of the factor's rows", code="F007", allowed=f"-1 to {count - 1} for each row"
            )
        if any(law.n_outputs != 1 for law in self.weights):
            raise InputError("surrogate: weights of the factor's rows", code="F007", allowed="one number at each pose")

    def weight(self, Q: Array) -> Array:
        """Weights (n, r) of the rows."""
        columns = [np.exp(evaluate(law, Q)) for law in self.weights]
        return np.asarray(np.hstack([*columns, np.ones((len(Q), 1))])[:, self.group])


@dataclass(frozen=True, eq=False, kw_only=True)
class Surrogate(Scope):
    """A quantity over the inputs as a sum of basis functions, with its held-out errors.

    ``y(q) = expansion(q)`` for the target 'direct', ``exp(expansion(q))`` for 'logarithm'; for 'factored' the
    expansion holds the rows of the 6 x 6 compliance (`Factor`), which is positive semidefinite by construction, and
    y is the compliance along the load direction. Valid inside the domain and the couplings only.

    Parameters
    ----------
    basis, degree : name of the basis, and its total degree or trigonometric order
    bars : error bars of y; None where the surrogate was never judged
    parameters : uncertainty of y by the calibrated parameters of the model; None where the model says nothing of it
    kinematics : the robot, by which near-singular poses are told; None where it is not known
    fixed_influence : fixed coordinate -> largest relative change of y that turning it makes (sampled)
    at_load : of an arm with effects, the load that it was learned at; None: it has none

    Raises
    ------
    InputError
        As for `Scope`; also numbers that do not fit together or are not finite.
    """

    quantity: Quantity = field(default_factory=Quantity)
    basis: str
    degree: int
    target: Target
    expansion: Expansion
    factor: Factor | None = None
    errors: ErrorFigures
    bars: ErrorBars | None = None
    parameters: ParameterBars | None = None
    kinematics: Robot | None = None
    fixed_influence: dict[str, float] = field(default_factory=dict)
    at_load: StatedAt | None = None
    notes: tuple[str, ...] = ()
    schema_version: str = SCHEMA

    def __post_init__(self) -> None:
        super().__post_init__()
        require_one_of("surrogate: target", self.target, TARGETS, code="F007")
        if any(part.n_inputs != len(self.inputs) for part in self._parts()):
            raise InputError("surrogate: basis", code="F007", allowed=f"one of {len(self.inputs)} inputs")
        if (self.target == "factored") != (self.factor is not None):
            raise InputError("surrogate: factor", code="F007", allowed="for the target 'factored', and only there")
        wanted = 1 if self.factor is None else 6 * len(self.factor.group)
        if self.expansion.n_outputs != wanted:
            raise InputError(f"surrogate: {self.expansion.n_outputs} numbers a pose", code="F007", allowed=str(wanted))
        figures = [value for value in vars(self.errors).values() if isinstance(value, float)]
        if not all(np.isfinite(f) and f >= 0.0 for f in figures):
            raise InputError("surrogate: error figures", code="F007", value=figures, allowed="finite and 0 or more")

    def _parts(self) -> list[Expansion]:
        """All expansions over the inputs."""
        return [
            self.expansion,
            *(() if self.factor is None else self.factor.weights),
            *(() if self.bars is None else (self.bars.leverage, self.bars.scale)),
            *(() if self.parameters is None else (self.parameters.gradients,)),
            *(() if self.parameters is None or self.parameters.open_share is None else (self.parameters.open_share,)),
        ]

    @property
    def has_matrix(self) -> bool:
        """Whether it knows the 6 x 6 compliance."""
        return self.factor is not None

    @cached_property
    def _along_load(self) -> list[tuple[Expansion | None, Expansion]]:
        return self._weighted(np.array(self.load_direction))

    def _weighted(self, direction: Array) -> list[tuple[Expansion | None, Expansion]]:
        """Rows along a direction (3,) by their weight, None for 1."""
        assert self.factor is not None  # noqa: S101 - asked only of factored ones
        rows, weights = self.along(direction), (*self.factor.weights, None)
        return [
            (weights[g], Expansion(rows.families, rows.terms, rows.coefficients[:, self.factor.group == g]))
            for g in np.unique(self.factor.group)
        ]

    def along(self, direction: Array) -> Expansion:
        """Rows of a factored surrogate times a force direction (3,): (n, r) numbers, whose weighted squares add up."""
        d = np.concatenate([np.asarray(direction, dtype=np.float64), np.zeros(3)])
        rows = self.expansion.coefficients.reshape(self.expansion.n_terms, -1, 6)
        return Expansion(self.expansion.families, self.expansion.terms, rows @ d)


def predict(surrogate: Surrogate, Q: Array, direction: Array | None = None) -> Array:
    """The quantity as the fit gives it; Q (n, k) rad -> (n,), SI.

    Domain and couplings are not checked, and with the target 'direct' a poor fit can give a compliance of zero or
    less; `query` refuses both. ``direction`` (3,): another force direction, for a factored surrogate.

    Raises
    ------
    InputError
        Wrong shape, an angle that is not finite, so far outside of the domain that the fit overflows, or another
        direction of a surrogate that knows only one.
    """
    y = raw(surrogate, surrogate.poses(Q, f"query of {surrogate.robot}"), direction)
    refuse(surrogate, y, ~np.isfinite(y))
    return y


def raw(surrogate: Surrogate, poses: Array, direction: Array | None = None) -> Array:
    """As `predict` at finite poses (n, k) rad, whatever the fit gives there, NaN and infinity too."""
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        if surrogate.factor is not None:
            along = None if direction is None else unit_vector(direction, "direction")
            y = np.zeros(len(poses))
            for law, part in surrogate._along_load if along is None else surrogate._weighted(along):
                square = sum_of_squares(part, poses)
                y += square if law is None else np.exp(evaluate(law, poses)[:, 0]) * square
        elif direction is not None:
            raise InputError(
                "direction of a query",
                code="S002",
                value=np.asarray(direction).tolist(),
                allowed=f"none: this surrogate knows only the load along {surrogate.load_direction}",
                remedy="fit one with --basis factored, which knows all directions",
            )
        else:
            y = evaluate(surrogate.expansion, poses)[:, 0]
            if surrogate.target == "logarithm":
                y = np.exp(y)
    return np.asarray(y)


def predict_compliance(surrogate: Surrogate, Q: Array, direction: Array | None = None) -> Array:
    """Compliance along the load direction; Q (n, k) rad -> (n,) m/N. As `predict`.

    Raises
    ------
    InputError
        As `predict`; also a surrogate of another quantity.
    """
    if surrogate.quantity.name != COMPLIANCE:
        raise InputError(
            "compliance from a surrogate of",
            code="S002",
            value=surrogate.quantity.name,
            allowed=COMPLIANCE,
            remedy="fit one of the stiffness (`stiffarm fit`)",
        )
    return predict(surrogate, Q, direction)


def compliance_matrix(surrogate: Surrogate, Q: Array) -> Array:
    """The 6 x 6 compliance at the tool point, base axes; Q (n, k) rad -> (n, 6, 6), positive semidefinite.

    Raises
    ------
    InputError
        As `predict`; also a surrogate that knows one direction only.
    """
    if surrogate.factor is None:
        raise InputError(
            f"compliance matrix from a surrogate with the {surrogate.basis} basis",
            code="S002",
            allowed="the basis factored",
            remedy="fit one with --basis factored",
        )
    poses = surrogate.poses(Q, f"query of {surrogate.robot}")
    out = np.empty((len(poses), 6, 6))
    # As in `predict`: what overflows far outside of the domain is refused below.
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        for part in in_blocks(len(poses), max(1, _BLOCK // surrogate.expansion.n_outputs)):
            rows = evaluate(surrogate.expansion, poses[part]).reshape(-1, len(surrogate.factor.group), 6)
            out[part] = rows.swapaxes(1, 2) @ (surrogate.factor.weight(poses[part])[:, :, None] * rows)
        size = np.trace(out, axis1=1, axis2=2)
    refuse(surrogate, size, ~np.isfinite(size))
    return 0.5 * (out + out.swapaxes(1, 2))


def refuse(surrogate: Surrogate, y: Array, bad: Bools) -> None:
    """InputError if the fit gives no valid value at some rows."""
    if bad.any():
        rows = "; ".join(f"row {i + 1}: {y[i]:.3g} {surrogate.quantity.unit}" for i in np.flatnonzero(bad)[:ROWS_SHOWN])
        raise InputError(
            f"query of {surrogate.robot}: the fit is not valid at {count_rows(bad)}: {rows}",
            code="S001",
            allowed=f"a positive, finite {surrogate.quantity.name}",
            remedy="fit with --basis factored, with more --runs, or over a smaller domain",
        )
