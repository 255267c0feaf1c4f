"""What a user would take instead of our surrogate: ready-made regressors, set up as their manuals advise.

Each learns compliance from joint angles. All get angles scaled to -1..1 over the fitted runs (or their cosines and
sines) and a target of mean 0 and standard deviation 1. How they compare: :mod:`peer_comparison`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import product
from math import comb
from types import MappingProxyType
from typing import Any, Literal, Protocol

import numpy as np

from robots.arrays import Array
from robots.constants import NORMAL_95
from robots.errors import InputError

Features = Literal["angles", "cos-sin"]
Target = Literal["compliance", "log-compliance"]
KernelName = Literal["rbf", "matern-5/2"]

# Bytes of a number, of an index, and of an exponent or column, packed: what an export would have to hold.
REAL, INDEX, SMALL = 8, 4, 1
# Rows predicted at once: distances to all fitted runs must fit in the cache or at least in memory.
_ROWS = 1000


@dataclass(frozen=True)
class Variant:
    """What may be chosen for a regressor: the target, what it sees of the angles, its kernel (if it has one)."""

    target: Target
    features: Features
    kernel: KernelName | None = None

    def __str__(self) -> str:
        return ", ".join(part for part in (self.target, self.features, self.kernel) if part)


@dataclass(frozen=True)
class Size:
    """Bytes of the numbers needed for values, and of those needed on top for error bars (None: it has none)."""

    values: int
    bars: int | None = None


class Regressor(Protocol):
    """A library's regressor behind one interface; X (n, f) features, z (n,) scaled target."""

    def fit(self, X: Array, z: Array) -> None:
        """Learn."""
        ...

    def predict(self, X: Array) -> Array:
        """Values (n,)."""
        ...

    def deviation(self, X: Array) -> Array | None:
        """One standard deviation of each value (n,), or None where the method has no such thing."""
        ...

    def size(self) -> Size:
        """What a portable file would have to hold."""
        ...


@dataclass(frozen=True)
class Peer:
    """A regressor to compare with.

    Parameters
    ----------
    title : what it is, with its settings
    build : (variant, number of inputs, number of runs to fit) -> an unfitted regressor
    variants : what its target and inputs may be; the best is chosen on runs set aside
    most_runs : it is fitted on no more than these; None: no limit
    runs_to_choose : variants are tried on no more than these; None: no limit
    """

    title: str
    build: Callable[[Variant, int, int], Regressor]
    variants: tuple[Variant, ...]
    most_runs: int | None = None
    runs_to_choose: int | None = None


class Polynomial:
    """PolynomialFeatures with ordinary least squares, or with ridge and its weight by leave-one-out.

    ``ridge``: weights to choose from; None is LinearRegression with its default ``tol``.
    """

    def __init__(self, degree: int, ridge: Array | None = None) -> None:
        from sklearn.linear_model import LinearRegression, RidgeCV
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import PolynomialFeatures

        solver = LinearRegression() if ridge is None else RidgeCV(alphas=ridge)
        self.degree = degree
        self.model: Any = make_pipeline(PolynomialFeatures(degree), solver)

    def fit(self, X: Array, z: Array) -> None:
        """See :class:`Regressor`; terms that outnumber the runs are refused (InputError)."""
        terms = comb(X.shape[1] + self.degree, self.degree)
        if terms > len(X):
            raise InputError(
                f"polynomial of degree {self.degree}: {terms} terms, but {len(X)} runs",
                code="S004",
                allowed="at least as many runs as terms",
                remedy="add runs",
            )
        self.model.fit(X, z)

    def predict(self, X: Array) -> Array:
        """See :class:`Regressor`."""
        return np.asarray(self.model.predict(X), dtype=np.float64)

    def deviation(self, X: Array) -> None:
        """Scikit-learn gives none."""

    def size(self) -> Size:
        """Coefficients and exponents."""
        powers = self.model[0].powers_
        return Size(REAL * (len(powers) + 1) + SMALL * powers.size)


class GaussianProcess:
    """GaussianProcessRegressor: a kernel with a length for each input, white noise, marginal likelihood."""

    def __init__(self, kernel: KernelName) -> None:
        self.kernel = kernel
        self.model: Any = None

    def fit(self, X: Array, z: Array) -> None:
        """See :class:`Regressor`."""
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern, WhiteKernel

        lengths, bounds = np.ones(X.shape[1]), (1e-2, 1e3)
        shape = RBF(lengths, bounds) if self.kernel == "rbf" else Matern(lengths, bounds, nu=2.5)
        kernel = ConstantKernel(1.0, (1e-3, 1e6)) * shape + WhiteKernel(1e-6, (1e-12, 1e-1))
        self.model = GaussianProcessRegressor(kernel, random_state=0).fit(X, z)

    def predict(self, X: Array) -> Array:
        """See :class:`Regressor`."""
        return _by_blocks(self.model.predict, X)

    def deviation(self, X: Array) -> Array:
        """Standard deviation, the noise found included."""
        return _by_blocks(lambda rows: self.model.predict(rows, return_std=True)[1], X)

    def size(self) -> Size:
        """Values need all fitted runs and one weight for each; bars need the factor of their covariance."""
        n, k = self.model.X_train_.shape
        return Size(REAL * (n * k + n + len(self.model.kernel_.theta)), REAL * n * (n + 1) // 2)


class Kriging:
    """SMT's KRG: constant trend, squared exponential correlation, lengths by likelihood (TNC).

    One start of the search, not ten: ten took eight times as long for the same errors. It starts at theta = 0.1: from
    SMT's default of 0.01 one start ended in errors ten times larger (400 runs of a 6R arm with a parallelogram).
    """

    def __init__(self) -> None:
        self.model: Any = None

    def fit(self, X: Array, z: Array) -> None:
        """See :class:`Regressor`."""
        model = _smt_kriging()(print_global=False, n_start=1, theta0=[0.1], seed=0)
        model.set_training_values(X, z)
        model.train()
        self.model = model

    def predict(self, X: Array) -> Array:
        """See :class:`Regressor`."""
        return _by_blocks(lambda rows: self.model.predict_values(rows)[:, 0], X)

    def deviation(self, X: Array) -> Array:
        """Square root of the kriging variance."""
        variance = _by_blocks(lambda rows: self.model.predict_variances(rows)[:, 0], X)
        return np.sqrt(np.maximum(variance, 0.0))

    def size(self) -> Size:
        """As for the Gaussian process, and how inputs and values were scaled."""
        n, k = self.model.X_norma.shape
        found = self.model.optimal_par
        scaling = 2 * k + 2 + self.model.optimal_theta.size
        trend = found["beta"].size
        more = n * (n + 1) // 2 + found["Ft"].size + found["G"].size + 1
        return Size(REAL * (n * k + n + trend + scaling), REAL * more)


class Boosting:
    """HistGradientBoostingRegressor, up to 2000 trees, stopped when a tenth of the runs gets no better."""

    def __init__(self) -> None:
        from sklearn.ensemble import HistGradientBoostingRegressor

        self.model: Any = HistGradientBoostingRegressor(
            max_iter=2000, early_stopping=True, n_iter_no_change=50, random_state=0
        )

    def fit(self, X: Array, z: Array) -> None:
        """See :class:`Regressor`."""
        self.model.fit(X, z)

    def predict(self, X: Array) -> Array:
        """See :class:`Regressor`."""
        return np.asarray(self.model.predict(X), dtype=np.float64)

    def deviation(self, X: Array) -> None:
        """It gives none."""

    def size(self) -> Size:
        """Threshold or value, column and two children of each node."""
        # The trees have no public name; those of another version may be elsewhere, and AttributeError says so.
        trees = [tree for stage in self.model._predictors for tree in stage]
        return Size(REAL + (REAL + SMALL + 2 * INDEX) * sum(len(tree.nodes) for tree in trees))


class Network:
    """MLPRegressor: two layers of 64 tanh units, L-BFGS."""

    def __init__(self) -> None:
        from sklearn.neural_network import MLPRegressor

        self.model: Any = MLPRegressor(
            hidden_layer_sizes=(64, 64),
            activation="tanh",
            solver="lbfgs",
            alpha=1e-6,
            max_iter=1500,
            max_fun=100_000,
            random_state=0,
        )

    def fit(self, X: Array, z: Array) -> None:
        """See :class:`Regressor`."""
        self.model.fit(X, z)

    def predict(self, X: Array) -> Array:
        """See :class:`Regressor`."""
        return np.asarray(self.model.predict(X), dtype=np.float64)

    def deviation(self, X: Array) -> None:
        """It gives none."""

    def size(self) -> Size:
        """Weights and offsets."""
        return Size(REAL * sum(a.size for a in (*self.model.coefs_, *self.model.intercepts_)))


def _by_blocks(function: Callable[[Array], Array], X: Array) -> Array:
    return np.concatenate([np.asarray(function(X[i : i + _ROWS])) for i in range(0, len(X), _ROWS)])


def _smt_kriging() -> Any:
    try:
        from smt.surrogate_models import KRG
    except ImportError as error:
        raise InputError(
            "kriging: the package smt is not installed",
            code="F013",
            remedy='install it (`pip install "stiffarm[smt]"`), or compare without kriging',
        ) from error
    return KRG


def _build_kriging(variant: Variant, n_inputs: int, n_runs: int) -> Kriging:
    _smt_kriging()
    return Kriging()


RIDGE_WEIGHTS = np.logspace(-10, 2, 13)


def _build_ridge(variant: Variant, n_inputs: int, n_runs: int) -> Polynomial:
    """Sixth degree in angles; in cosines and sines the highest up to 6 with two runs for each term."""
    f = n_inputs if variant.features == "angles" else 2 * n_inputs
    degree = 6
    while variant.features == "cos-sin" and degree > 1 and 2 * comb(f + degree, degree) > n_runs:
        degree -= 1
    return Polynomial(degree, RIDGE_WEIGHTS)


_TARGETS: tuple[Target, ...] = ("compliance", "log-compliance")
_FEATURES: tuple[Features, ...] = ("angles", "cos-sin")
_KERNELS: tuple[KernelName, ...] = ("rbf", "matern-5/2")
_ALL = tuple(Variant(t, f) for t, f in product(_TARGETS, _FEATURES))

PEERS: Mapping[str, Peer] = MappingProxyType(
    {
        "polynomial": Peer(
            "scikit-learn: MinMaxScaler, PolynomialFeatures(6), LinearRegression",
            lambda variant, k, n: Polynomial(6),
            tuple(Variant(t, "angles") for t in _TARGETS),
        ),
        "ridge": Peer("scikit-learn: MinMaxScaler, PolynomialFeatures, RidgeCV", _build_ridge, _ALL),
        "gaussian-process": Peer(
            "scikit-learn: GaussianProcessRegressor, a length for each input, white noise",
            lambda variant, k, n: GaussianProcess(variant.kernel or "rbf"),
            tuple(Variant(t, f, kernel) for t, f, kernel in product(_TARGETS, _FEATURES, _KERNELS)),
            most_runs=1024,
            runs_to_choose=300,
        ),
        "kriging": Peer(
            "SMT: KRG, squared exponential, constant trend", _build_kriging, _ALL, most_runs=512, runs_to_choose=200
        ),
        "boosting": Peer(
            "scikit-learn: HistGradientBoostingRegressor, early stopping", lambda variant, k, n: Boosting(), _ALL
        ),
        "network": Peer(
            "scikit-learn: MLPRegressor, 64 x 64 tanh, L-BFGS",
            lambda variant, k, n: Network(),
            _ALL,
            runs_to_choose=1000,
        ),
    }
)


class Estimator(Protocol):
    """Anything that can be compared. Q (n, k) rad, compliance in m/N."""

    def fit(self, Q: Array, y: Array) -> None:
        """Learn from runs."""
        ...

    def predict(self, Q: Array) -> Array:
        """Compliance (n,)."""
        ...

    def interval(self, Q: Array) -> tuple[Array, Array] | None:
        """Lower and upper end (n,) of the 95 % error bar of compliance; None where there is none."""
        ...

    def size(self) -> Size:
        """Bytes of the numbers a portable file must hold."""
        ...


@dataclass(frozen=True)
class OwnCandidate:
    """A surrogate of ours as callables, so that this module depends on none of them.

    ``fit(Q, y)`` gives whatever the others take as their first argument; ``interval`` is the 95 % error bar.
    One that was fitted before gives it back from ``fit`` and says in ``fit_s`` how many seconds that took; one that
    runs the model at poses of its own says in ``n_train`` at how many.
    """

    title: str
    fit: Callable[[Array, Array], Any]
    predict: Callable[[Any, Array], Array]
    size_bytes: Callable[[Any], int]
    interval: Callable[[Any, Array], tuple[Array, Array]] | None = None
    bars_bytes: Callable[[Any], int] | None = None
    fit_s: float | None = None
    n_train: Callable[[Any], int] | None = None


@dataclass
class PeerEstimator:
    """A regressor with the scaling of its inputs and of its target."""

    peer: Peer
    variant: Variant
    _regressor: Any = field(init=False, default=None)
    _inputs: Any = field(init=False, default=None)
    _mean: float = field(init=False, default=0.0)
    _deviation: float = field(init=False, default=1.0)

    def fit(self, Q: Array, y: Array) -> None:
        """See :class:`Estimator`."""
        from sklearn.preprocessing import MinMaxScaler

        self._inputs = MinMaxScaler((-1.0, 1.0)).fit(_features(Q, self.variant.features))
        t = np.log(y) if self.variant.target == "log-compliance" else y
        self._mean, self._deviation = float(t.mean()), float(t.std()) or 1.0
        self._regressor = self.peer.build(self.variant, Q.shape[1], len(Q))
        self._regressor.fit(self._scaled(Q), (t - self._mean) / self._deviation)

    def predict(self, Q: Array) -> Array:
        """See :class:`Estimator`."""
        return self._compliance(self._regressor.predict(self._scaled(Q)))

    def interval(self, Q: Array) -> tuple[Array, Array] | None:
        """See :class:`Estimator`; normal in the target, so never below zero where that is a logarithm."""
        X = self._scaled(Q)
        deviation = self._regressor.deviation(X)
        if deviation is None:
            return None
        z = self._regressor.predict(X)
        return self._compliance(z - NORMAL_95 * deviation), self._compliance(z + NORMAL_95 * deviation)

    def size(self) -> Size:
        """The regressor's numbers, and those of the scaling."""
        own = self._regressor.size()
        return Size(own.values + REAL * (2 * self._inputs.n_features_in_ + 2), own.bars)

    def _scaled(self, Q: Array) -> Array:
        return np.asarray(self._inputs.transform(_features(Q, self.variant.features)), dtype=np.float64)

    def _compliance(self, z: Array) -> Array:
        t = self._mean + self._deviation * np.asarray(z, dtype=np.float64)
        return np.asarray(np.exp(t) if self.variant.target == "log-compliance" else t)


@dataclass
class OwnEstimator:
    """A candidate of ours, fitted."""

    candidate: OwnCandidate
    fitted: Any = None

    def fit(self, Q: Array, y: Array) -> None:
        """See :class:`Estimator`."""
        self.fitted = self.candidate.fit(Q, y)

    def predict(self, Q: Array) -> Array:
        """See :class:`Estimator`."""
        return np.asarray(self.candidate.predict(self.fitted, Q), dtype=np.float64)

    def interval(self, Q: Array) -> tuple[Array, Array] | None:
        """See :class:`Estimator`."""
        return None if self.candidate.interval is None else self.candidate.interval(self.fitted, Q)

    def size(self) -> Size:
        """See :class:`Estimator`."""
        bars = self.candidate.bars_bytes
        return Size(self.candidate.size_bytes(self.fitted), None if bars is None else bars(self.fitted))


def _features(Q: Array, features: Features) -> Array:
    return Q if features == "angles" else np.hstack([np.cos(Q), np.sin(Q)])
