"""Error bars of a surrogate: how wrong it may be at a pose, from runs it was not fitted to and from leverage.

A surrogate's error is no noise: it is the same each time, larger near the boundary and where few runs are. Its size
is therefore learned, ``s(q) = exp(a(q) + b ln h(q))``, with a quadratic in the angles and h the leverage of a small
part of the basis (large where the fitted runs say little), on one half of the runs kept out; the other half gives the
factor that makes 95 % of its errors fall inside (split conformal prediction: Lei et al. 2018,
doi:10.1080/01621459.2017.1307116). For poses drawn as those were, the share inside is 95 % whatever the errors'
distribution, up to the sampling of that half; for other poses (all on a limit, say) it is not promised.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.arrays import Array, Bools
from robots.errors import InputError, require_at_least
from surrogate.basis import Basis, polynomial_basis
from surrogate.expansion import Expansion
from surrogate.fast import evaluate, sum_of_squares
from surrogate.scope import Scope

LEVEL = 0.95
# A number that the readings left open matters where it may change the quantity by this share.
MATTERS = 0.01
# Errors below the rounding of a double are all alike.
_ROUND_OFF = 1e-16
# Terms that leverage is taken over: each query costs their square.
_LEVERAGE_TERMS = 60
FEWEST_RUNS = 200


@dataclass(frozen=True, eq=False)
class ErrorBars:
    """Size of the relative error over the inputs.

    ``leverage``: its outputs' squares add up to h; ``scale``: a (one output); ``exponent``: b; ``quantile``: factor
    from s to the half-width of the 95 % interval; ``n_runs``: runs behind it.
    """

    leverage: Expansion
    scale: Expansion
    exponent: float
    quantile: float
    n_runs: int

    def __post_init__(self) -> None:
        if not (np.isfinite([self.exponent, self.quantile]).all() and self.quantile >= 0.0):
            raise InputError(
                "surrogate: error bars", code="F007", value=[self.exponent, self.quantile], allowed="finite, 0 or more"
            )
        if self.scale.n_outputs != 1:
            raise InputError("surrogate: scale of the error bars", code="F007", allowed="one number at each pose")

    def half_width(self, Q: Array) -> Array:
        """Half-width (n,) of the 95 % interval of the quantity, relative to it; Q (n, k) rad."""
        return np.asarray(self.quantile * _size(self.leverage, self.scale, self.exponent, Q))


@dataclass(frozen=True, eq=False)
class ParameterBars:
    """What the calibration's uncertainty makes of the quantity.

    ``gradients``: its outputs g (p,) are the changes of the quantity y by independent unit changes of the parameters,
    so ``|g| / y`` is the relative standard deviation (linear propagation, for small uncertainties); ``names``: of the
    parameters; ``misfit``: largest error of it on runs kept out, over its largest value.
    ``undetermined``: what the readings left open, which is not in g, and ``open_share``: by which share each of these
    (m,) may change the quantity; where it matters (`MATTERS`), the standard deviation is a lower bound.
    """

    gradients: Expansion
    names: tuple[str, ...]
    misfit: float = 0.0
    undetermined: tuple[str, ...] = ()
    open_share: Expansion | None = None

    def __post_init__(self) -> None:
        count = 0 if self.open_share is None else self.open_share.n_outputs
        if count != len(self.undetermined) or not (np.isfinite(self.misfit) and self.misfit >= 0.0):
            raise InputError(
                "surrogate: uncertainty of parameters",
                code="F007",
                allowed="a share for each open one, a finite misfit",
            )

    def relative_sd(self, Q: Array, y: Array) -> Array:
        """Relative standard deviation (n,); Q (n, k) rad, the quantity y (n,)."""
        return np.asarray(np.sqrt(sum_of_squares(self.gradients, Q)) / np.abs(y))

    def matters(self, Q: Array) -> Bools:
        """Which of ``undetermined`` matter at which pose (n, m); Q (n, k) rad."""
        if self.open_share is None:
            return np.zeros((len(Q), 0), dtype=np.bool_)
        return np.asarray(evaluate(self.open_share, Q) > MATTERS)


def learn_bars(basis: Basis, scope: Scope, Q_fitted: Array, Q: Array, error: Array) -> ErrorBars:
    """Learn error bars from relative errors (n,) at poses Q (n, k) rad that were not fitted.

    Parameters
    ----------
    basis : what was fitted, to the runs at ``Q_fitted`` (m, k)

    Raises
    ------
    InputError
        Fewer than 200 runs: the 95 % factor would be chance.
    """
    require_at_least("error bars: runs kept out", len(Q), FEWEST_RUNS, code="S004")
    leverage = _leverage(basis, Q_fitted)
    quadratic = polynomial_basis(scope.lower, scope.upper, 2, scope.periodic)
    # Halves one after the other: every second point of a Sobol sequence fills only half of the box.
    first, second = slice(0, len(Q) // 2), slice(len(Q) // 2, None)
    size = np.log(np.maximum(np.abs(error), _ROUND_OFF))
    features = np.column_stack([quadratic.design(Q), _log_leverage(leverage, Q)])
    # Least norm: leverage may be a function of the quadratic's terms.
    found = np.asarray(np.linalg.lstsq(features[first], size[first], rcond=1e-10)[0], dtype=np.float64)
    scale, exponent = quadratic.expansion(found[:-1]), float(found[-1])
    score = np.abs(error[second]) / _size(leverage, scale, exponent, Q[second])
    rank = int(np.ceil((len(score) + 1) * LEVEL))
    return ErrorBars(leverage, scale, exponent, float(np.sort(score)[min(rank, len(score)) - 1]), len(Q))


def _size(leverage: Expansion, scale: Expansion, exponent: float, Q: Array) -> Array:
    # Capped: far outside of the domain the quadratic runs away, and nothing is known there anyway.
    log = evaluate(scale, Q)[:, 0] + exponent * _log_leverage(leverage, Q)
    return np.asarray(np.exp(np.minimum(log, 50.0)))


def _log_leverage(leverage: Expansion, Q: Array) -> Array:
    return np.asarray(np.log(sum_of_squares(leverage, Q) + 1e-30))


def _leverage(basis: Basis, Q: Array) -> Expansion:
    """The simplest terms of a basis, made orthonormal over the fitted poses."""
    order = np.lexsort([basis.terms.sum(axis=1), np.count_nonzero(basis.terms, axis=1)])
    small = basis.take(order[: min(_LEVERAGE_TERMS, basis.n_terms, len(Q) // 2)])
    # Terms that these poses cannot tell apart are left out, so that no leverage is infinite.
    A = small.design(Q) / np.sqrt(len(Q))
    import scipy.linalg  # which queries do not need

    _, R, pivots = scipy.linalg.qr(A, mode="economic", pivoting=True)
    rank = int(np.count_nonzero(np.abs(np.diag(R)) > 1e-8 * abs(R[0, 0])))
    kept = np.sort(pivots[:rank])
    R = np.asarray(np.linalg.qr(A[:, kept], mode="r"), dtype=np.float64)
    coefficients = np.asarray(np.linalg.solve(R, np.eye(rank)), dtype=np.float64)
    chosen = small.take(kept)
    return chosen.expansion(np.asarray(coefficients, dtype=np.float64))
