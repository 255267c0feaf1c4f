"""Mean, covariance and samples of a form that is linear in two sets of independent uncertain numbers.

A surface error is ``e_i = o_i + sum_jk s_j p_k B_ijk``, with compliances s (s_0 = 1 stands for what is held exact)
and force parameters p. For independent s and p the covariance is exact, whatever their distributions::

    cov(e_i, e_l) = L_s,i S L_s,l^T + L_p,i P L_p,l^T + sum B_ijk B_lmn S_jm P_kn

with ``L_s = sum_k p_k B_k``, ``L_p = sum_j s_j B_j``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.arrays import Array


@dataclass(frozen=True)
class Estimated:
    """A number with its 95 % interval ``low`` to ``high``."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Uncertain:
    """The uncertain numbers that all errors of one study share.

    ``compliance`` (j,) and ``force`` (k,) with covariances; their names, and notes what these rest on.
    """

    compliance: Array
    compliance_covariance: Array
    force: Array
    force_covariance: Array
    names: tuple[str, ...]
    notes: tuple[str, ...]

    def same_as(self, other: Uncertain) -> bool:
        """Whether both are about the same numbers."""
        pairs = (
            (self.compliance, other.compliance),
            (self.compliance_covariance, other.compliance_covariance),
            (self.force, other.force),
            (self.force_covariance, other.force_covariance),
        )
        # Round-off of two evaluations; another model or force differs by more.
        same = all(a.shape == b.shape and np.allclose(a, b, rtol=1e-9, atol=0.0) for a, b in pairs)
        return same and self.names == other.names

    def draws(self, count: int, generator: np.random.Generator) -> tuple[Array, Array]:
        """Normal samples of compliances (count, j) and forces (count, k)."""
        return (
            self.compliance
            + generator.standard_normal((count, len(self.compliance))) @ _root(self.compliance_covariance),
            self.force + generator.standard_normal((count, len(self.force))) @ _root(self.force_covariance),
        )


def deviations(u: Uncertain, form: Array) -> tuple[Array, Array, Array]:
    """Standard deviations (n,) of a form (n, j, k): in all, as :func:`covariance`; by compliances and by force alone.

    The latter two are to first order.
    """
    S, P = u.compliance_covariance, u.force_covariance
    by_s, by_p = np.einsum("njk,k->nj", form, u.force), np.einsum("njk,j->nk", form, u.compliance)
    product = np.einsum("njk,njk->n", S @ form @ P, form)
    s, p = np.sum((by_s @ S) * by_s, axis=1), np.sum((by_p @ P) * by_p, axis=1)
    whole, compliance, force = (np.sqrt(np.maximum(v, 0.0)) for v in (s + p + product, s, p))
    return whole, compliance, force


def covariance(u: Uncertain, first: Array, second: Array) -> Array:
    """Covariance (n, m) of two forms (n, j, k) and (m, j, k): exact."""
    S, P = u.compliance_covariance, u.force_covariance
    by_s = [np.einsum("njk,k->nj", B, u.force) for B in (first, second)]
    by_p = [np.einsum("njk,j->nk", B, u.compliance) for B in (first, second)]
    both = np.einsum("njk,ja,kb->nab", first, S, P, optimize=True)
    product = both.reshape(len(first), -1) @ second.reshape(len(second), -1).T
    return np.asarray(by_s[0] @ S @ by_s[1].T + by_p[0] @ P @ by_p[1].T + product)


def samples(form: Array, draws: tuple[Array, Array]) -> Array:
    """Values (count, n) of a form for given draws."""
    return np.asarray(np.einsum("cj,ck,njk->cn", *draws, form, optimize=True))


def interval(values: Array) -> tuple[float, float]:
    """95 % interval of samples (count,), by quantiles; infinite ends stay."""
    # "nearest" does not mix an infinite value with a finite one.
    low, high = np.quantile(values, [0.025, 0.975], method="nearest")
    return float(low), float(high)


def _root(C: Array) -> Array:
    """R with R^T R = C; correlations are factored, because units differ by orders of magnitude."""
    scale = np.sqrt(np.maximum(np.diag(C), 0.0))
    safe = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(C / np.outer(safe, safe))
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * scale)
