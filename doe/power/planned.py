"""Planned readings as a diagnosis would see them: the arm fitted, springs and small errors free, candidates beside it.

Linear theory throughout: readings move with every candidate along its signature (:mod:`doe.diagnosis.signatures`), and
what springs and the errors of every arm can follow is projected out. What is left of a change, over the noise, is its
chi-square. A candidate explains a share of it and is charged for its numbers and shapes as the diagnosis charges it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.special import log_ndtr, logsumexp

from doe.diagnosis.candidates import candidates_of, impossible
from doe.diagnosis.evidence import Whitened
from doe.diagnosis.fits import Stack, against
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Options, is_learned, log_priors
from doe.diagnosis.known import base_of
from doe.diagnosis.scatter import covariance
from doe.diagnosis.setting import Setting, setting_of
from doe.diagnosis.signatures import Signature, shape_count
from doe.diagnosis.weighing import as_if
from doe.estimation.noise import Noise
from doe.estimation.repeats import repeated
from doe.tables.measurements import Measurements
from fem.effects.base import Effect
from fem.effects.catalogue import Maker
from fem.model import ArmModel
from robots import ModelDescription
from robots.arrays import Array

# Changes of the readings that are weighed at once.
AT_ONCE: Final = 256
NORMAL95: Final = 1.959964


@dataclass(frozen=True, eq=False)
class Explained:
    """What candidates explain of d changes of the readings.

    ``total`` (d,): chi-square of each change, beside springs and small errors; ``evidence`` by code (d,): log evidence
    gained over nothing missing, were the noise known; ``left`` by code (d,): chi-square that the best shape leaves;
    ``size`` by code (d,): the best shape's largest amplitude over the largest usual one, 0 without amplitudes;
    ``charge`` by code (d,): what the evidence is below half of what is explained, twice.
    """

    total: Array
    evidence: Mapping[str, Array]
    left: Mapping[str, Array]
    size: Mapping[str, Array]

    def charge(self, code: str) -> Array:
        """What a code's evidence pays for its numbers and shapes (d,), as chi-square."""
        return np.asarray(np.maximum(self.total - self.left[code] - 2.0 * self.evidence[code], 0.0))


@dataclass(frozen=True, eq=False)
class Planned:
    """Planned readings at the noise that they will have, with everything that could be missing.

    ``s``: the arm fitted to what it would read without noise and with nothing missing; ``freedom``: readings that tell
    the noise beside the springs: set-ups and axes where repeats tell what readings scatter by themselves.
    """

    s: Setting
    noise: Noise
    w: Whitened
    candidates: Mapping[str, Sequence[Signature]]

    @classmethod
    def of(
        cls,
        description: ModelDescription,
        model: ArmModel,
        table: Measurements,
        noise: Noise,
        own: Sequence[Maker] = (),
    ) -> Planned:
        """Readings of a table without noise, as planned.

        Raises
        ------
        InputError
            No reading sees a joint's spring, or fewer readings than springs.
        """
        s = setting_of(description, model, table, own=own)
        w = Whitened(base_of(s), covariance(s, noise, np.ones(len(s.data))))
        return cls(s, noise, w, candidates_of(s))

    @cached_property
    def freedom(self) -> float:
        """Degrees of freedom by which the noise will be told."""
        p = self.s.data
        count = len(np.unique(6 * p.pose + p.component)) if repeated(p) is not None else len(p)
        return float(max(count - len(self.s.free), 1))

    @cached_property
    def log_prior(self) -> dict[str, float]:
        """Log prior probabilities of nothing, of the unknown and of all candidates, as the diagnosis has them."""
        return log_priors(self.s, [NONE, UNKNOWN, *self.candidates], Options())

    @cached_property
    def stack(self) -> Stack:
        """All candidates that have amplitudes."""
        return Stack({code: some for code, some in self.candidates.items() if some[0].shift is None})

    @cached_property
    def effects(self) -> dict[str, Effect]:
        """The effects of the catalogue that the arm can have, by code."""
        return {code: effect for code, effect in self.s.known.items() if not is_learned(code)}

    def why_not(self, code: str) -> str | None:
        """Why these readings can say nothing of an effect; None if they might."""
        effect = self.s.known.get(code)
        return "this arm cannot have it" if effect is None else impossible(self.s, effect)

    def of_readings(self, displacement: Array) -> Array:
        """Components read (m, ...) of displacements (n, 6, ...) of the table's rows."""
        return np.asarray(displacement[self.s.data.row, self.s.data.component])

    def explained(self, changes: Array) -> Explained:
        """What every candidate explains of changes (m, d) of the readings."""
        parts = [self._explained(changes[:, k : k + AT_ONCE]) for k in range(0, changes.shape[1], AT_ONCE)]
        codes = list(self.candidates)
        return Explained(
            np.concatenate([p.total for p in parts]),
            {code: np.concatenate([p.evidence[code] for p in parts]) for code in codes},
            {code: np.concatenate([p.left[code] for p in parts]) for code in codes},
            {code: np.concatenate([p.size[code] for p in parts]) for code in codes},
        )

    def _explained(self, changes: Array) -> Explained:
        w = self.w
        W = w.V.whiten(changes)
        total = np.sum(W**2, axis=0) - np.sum((w.root @ (w.W.T @ W)) ** 2, axis=0)
        gain, told, size = (np.empty((len(self.stack.flat), len(total))) for _ in range(3))
        for mine, G, g in against(w, self.stack, changes):
            some = [self.stack.flat[i] for i in mine]
            gain[mine], told[mine] = _fitted(some, G, g)
            size[mine] = _sizes(some, G, g)
        evidence, left, sizes = {}, {}, {}
        for code, own in self.candidates.items():
            z, q = (
                (gain[self.stack.place[code]], told[self.stack.place[code]])
                if own[0].shift is None
                else (self._of_shifts(own, W))
            )
            evidence[code] = logsumexp(z, axis=0) - np.log(max(shape_count(own[0].effect), 1))
            left[code] = np.maximum(total - q.max(axis=0), 0.0)
            best = size[self.stack.place[code]] if own[0].shift is None else np.zeros_like(q)
            sizes[code] = np.take_along_axis(best, q.argmax(axis=0)[None], axis=0)[0]
        return Explained(total, evidence, left, sizes)

    def _of_shifts(self, some: Sequence[Signature], W: Array) -> tuple[Array, Array]:
        """Gain and chi-square explained (n, d) by effects that have no amplitudes: they are there or not."""
        w = self.w
        C = w.V.whiten(np.stack([as_if(self.s, w.base, c, w.V) for c in some], axis=1))
        half = w.root @ (w.W.T @ C)
        both = C.T @ W - half.T @ (w.root @ (w.W.T @ W))
        own = np.sum(C**2, axis=0) - np.sum(half**2, axis=0)
        q = 2.0 * both - own[:, None]
        return 0.5 * q, q

    def springs(self) -> list[tuple[str, float, float]]:
        """Each free spring with its stiffness, N m/rad, and the relative standard deviation of its compliance.

        By these readings alone, beside the errors of every arm, with nothing missing.
        """
        n, w = len(self.s.free), self.w
        precision = w.base.precision.copy()
        precision[:n] = 1e-9 * precision[:n]
        variance = np.diag(np.linalg.inv(w.W.T @ w.W + np.diag(precision)))[:n]
        sd = np.sqrt(np.maximum(variance, 0.0)) / np.maximum(self.s.springs, 1e-300)
        return [
            (name, float(1.0 / c) if c > 0.0 else np.inf, float(r))
            for name, c, r in zip(self.s.free, self.s.springs, sd, strict=True)
        ]


def _fitted(some: Sequence[Signature], G: Array, g: Array) -> tuple[Array, Array]:
    """Log evidence gained, and chi-square explained (n, d), as :mod:`doe.diagnosis.fits` has them."""
    mean, sd, positive = (np.stack([getattr(c, name) for c in some]) for name in ("mean", "sd", "positive"))
    precision = sd**-2.0
    S = G + precision[:, :, None] * np.eye(G.shape[1])
    covariance = np.linalg.inv(S)
    h = g + (precision * mean)[:, :, None]
    v = covariance @ h
    gain = 0.5 * np.sum(h * v, axis=1) - 0.5 * np.sum(precision * mean**2, axis=1)[:, None]
    gain += 0.5 * (np.log(precision).sum(axis=1) - np.linalg.slogdet(S)[1])[:, None]
    spread = np.sqrt(np.einsum("nkk->nk", covariance))
    above = log_ndtr(v / spread[:, :, None]) - log_ndtr(mean * np.sqrt(precision))[:, :, None]
    gain += np.sum(np.where(positive[:, :, None], above, 0.0), axis=1)
    # A compliance below nothing explains nothing.
    v = np.where(positive[:, :, None], np.maximum(v, 0.0), v)
    return gain, np.asarray(2.0 * np.sum(v * g, axis=1) - np.einsum("nkd,nkl,nld->nd", v, G, v))


def _sizes(some: Sequence[Signature], G: Array, g: Array) -> Array:
    """Largest amplitudes (n, d) over the largest usual ones, by least squares: priors would draw small ones in."""
    own = np.einsum("nkk->nk", G)
    # A thousandth keeps amplitudes apart that these readings see as one.
    ridge = 1e-3 * own + 1e-12 * np.maximum(own.max(axis=1, keepdims=True), 1e-300)
    v = np.linalg.solve(G + ridge[:, :, None] * np.eye(G.shape[1]), g)
    v = np.where(np.stack([c.positive for c in some])[:, :, None], np.maximum(v, 0.0), v)
    usual = np.array([[c.effect.parameters[k].size[1] for k in c.effect.amplitudes] for c in some])
    return np.asarray((np.abs(v) / usual[:, :, None]).max(axis=1))
