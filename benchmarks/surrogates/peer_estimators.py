"""Regressors and surrogates of ours behind one interface: angles in, compliance and its error bar out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from peers import REAL, Features, Peer, Size, Variant

from robots.arrays import Array
from robots.constants import NORMAL_95


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
