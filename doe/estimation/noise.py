"""What scatters: gauge, share of the deflection, and set-up; variances estimated by restricted likelihood.

A reading in pose g, component k, is ``y = f + e + a_gk + b_gk f``: white noise ``e`` with variance
``white^2 + (share f)^2`` (or the reading's own sigma), and two terms that all readings of one component in one
set-up have in common, with standard deviations ``pose`` (m or rad) and ``pose_share``. Readings of one set-up are
therefore not independent, and intervals that ignore it are too narrow. The covariance is made of one small block
for each pose and component (:mod:`doe.estimation.blocks`). Variances: :mod:`doe.estimation.restricted_likelihood`,
which does not take the fitted parameters' share of the scatter for noise.

What scatters can be no larger than what was read (:func:`within_readings`), and only repeats tell it from what the
model misses (:func:`origin`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from doe.estimation.blocks import Covariance
from doe.estimation.least_squares import spanning
from doe.estimation.problem import Problem
from doe.estimation.restricted_likelihood import Known, Likelihood, Term, maximise
from robots.arrays import Array

Origin = Literal["given", "repeats", "residual"]

# Fewer poses or readings than these say nothing about a variance beside the parameters.
FEWEST_POSES, FEWEST_READINGS = 6, 16
# Deflections must differ by this factor before a share can be told from a constant.
SHARE_SPAN = 1.8
WHITE = ("white0", "white1")
NAMES = (*WHITE, "share", "pose0", "pose1", "pose_share")
SHARES = ("share", "pose_share")
# Scatter of more than this share of the deflection is no share of it: where hardly any deflection is predicted, any
# residual is a large multiple of it, and what is predicted elsewhere would be given that multiple as its noise.
MOST_SHARE = 1.0
# Repeats to spare from which they tell the noise: with fewer their scatter is not known to within a factor of two.
FEWEST_REPEATS = 3


@dataclass(frozen=True)
class Noise:
    """Standard deviations: ``white`` and ``pose`` (2,) for translations (m) and rotations (rad); shares (-)."""

    white: tuple[float, float]
    share: float = 0.0
    pose: tuple[float, float] = (0.0, 0.0)
    pose_share: float = 0.0

    @staticmethod
    def of(numbers: Array) -> Noise:
        """The noise with standard deviations and shares (6,) in the order of :data:`NAMES`."""
        white0, white1, share, pose0, pose1, pose_share = numbers.tolist()
        return Noise((white0, white1), share, (pose0, pose1), pose_share)

    @property
    def numbers(self) -> Array:
        """Standard deviations and shares (6,) in the order of :data:`NAMES`."""
        return np.array([*self.white, self.share, *self.pose, self.pose_share])

    def variance(self, p: Problem, f: Array) -> Array:
        """Variance (m,) of the white part at predictions f (m,)."""
        kind = (p.component >= 3).astype(int)
        own = np.where(np.isnan(p.sigma), np.array(self.white)[kind], p.sigma)
        return np.asarray(own**2 + (self.share * f) ** 2)

    def common(self, p: Problem, f: Array) -> Array:
        """Columns (m, 2) of what a set-up's readings have in common, times its standard deviation."""
        kind = (p.component >= 3).astype(int)
        return np.stack([np.array(self.pose)[kind], self.pose_share * f], axis=1)

    def covariance(self, p: Problem, f: Array, weight: Array) -> Covariance:
        """Covariance of the readings at predictions f (m,); ``weight`` (m,) divides the white part of outliers."""
        return p.blocks.covariance(self.variance(p, f) / weight, self.common(p, f))

    def spread(self, p: Problem, f: Array) -> Array:
        """Standard deviation (m,) of each reading at predictions f (m,), its set-up's scatter included."""
        return np.asarray(np.sqrt(self.variance(p, f) + np.sum(self.common(p, f) ** 2, axis=1)))

    def times(self, factor: float, names: tuple[str, ...], floor: tuple[float, float]) -> Noise:
        """Copy with more or less of the readings' own scatter that is named; white noise never below ``floor``."""
        own = tuple(name for name in names if not name.startswith("pose"))
        scaled = self.with_variances(own, factor**2 * self.variances(own))
        return replace(scaled, white=at_least(scaled.white, floor))

    @property
    def has_common(self) -> bool:
        """Whether readings of one set-up are correlated."""
        return bool(any(self.pose) or self.pose_share)

    def variances(self, names: tuple[str, ...]) -> Array:
        """Squares (k,) of the standard deviations named (:data:`NAMES`)."""
        return self.numbers[[NAMES.index(name) for name in names]] ** 2

    def with_variances(self, names: tuple[str, ...], values: Array) -> Noise:
        """Copy with other variances."""
        numbers = self.numbers
        numbers[[NAMES.index(name) for name in names]] = np.sqrt(values)
        return Noise.of(numbers)


def at_least(sd: tuple[float, float], floor: tuple[float, float]) -> tuple[float, float]:
    """Standard deviations of translations and rotations, none below ``floor``."""
    return max(sd[0], floor[0]), max(sd[1], floor[1])


def rms_by_kind(p: Problem, x: Array) -> tuple[float, float]:
    """RMS of the translations (m) and of the rotations (rad) among x (m,); zero where none was read."""
    turn = p.component >= 3
    first, second = (float(np.sqrt(np.mean(x[k] ** 2))) if k.any() else 0.0 for k in (~turn, turn))
    return first, second


def origin(p: Problem, *, given: bool = False) -> Origin:
    """Where a noise is from: ``given`` with the readings, told by their repeats, or else the residual of the model.

    Without repeats what is estimated is what the model leaves of the readings, be it noise or what the model misses.
    """
    if given or not np.isnan(p.sigma).any():
        return "given"
    return "repeats" if len(p) - len(np.unique(p.replicate)) >= FEWEST_REPEATS else "residual"


def within_readings(p: Problem, f: Array, noise: Noise, floor: tuple[float, float] = (0.0, 0.0)) -> Noise:
    """The noise, with no more of it than the readings can hold: over all of them its RMS is at most theirs.

    A reading is a deflection and its noise, so on average its square holds that of the noise. An estimate passes this
    where the parameters explain less of the readings than as many numbers drawn at random would. Sigmas that readings
    bring with them are left alone, and white noise never falls below ``floor``. ``f`` (m,): predictions.
    """
    own, factor = np.isnan(p.sigma), np.ones(2)
    square = (
        np.where(own, np.array(noise.white)[(p.component >= 3).astype(int)], 0.0) ** 2
        + (noise.share * f) ** 2
        + np.sum(noise.common(p, f) ** 2, axis=1)
    )
    for kind, mine in enumerate((p.component < 3, p.component >= 3)):
        held, found = float(np.sum(p.value[mine] ** 2)), float(np.sum(square[mine]))
        factor[kind] = np.sqrt(held / found) if found > held else 1.0
    least = factor.min()
    scaled = Noise.of(noise.numbers * [*factor, least, *factor, least])
    return replace(scaled, white=at_least(scaled.white, floor))


def own_residual(p: Problem, noise: Noise, f: Array, weight: Array, error: Array) -> Array:
    """Errors (m,) without what their set-up has in common, over the readings' own standard deviations.

    What set-ups have in common is taken at its best prediction ``C C^T V^-1 e``.
    """
    V = noise.covariance(p, f, weight)
    return np.asarray(V.variance * V.solve(error[:, None])[:, 0] / np.sqrt(V.variance * weight))


def estimable(p: Problem, f: Array) -> tuple[bool, bool]:
    """Whether the data can tell a share of the deflection from a constant, and a set-up's scatter from white."""
    size = np.abs(f[p.component < 3]) if (p.component < 3).any() else np.abs(f)
    size = np.sort(size[size > 0.0])
    n = len(size) - 1
    spread = n > 0 and size[round(0.9 * n)] > SHARE_SPAN * size[round(0.1 * n)]
    return len(p) >= FEWEST_READINGS and bool(spread), p.blocks.most > 1 and len(p.poses) >= FEWEST_POSES


def terms_of(p: Problem, f: Array) -> tuple[str, ...]:
    """Names of the variances that these readings can tell."""
    own = np.isnan(p.sigma)
    kinds = p.component < 3, p.component >= 3
    names = [name for name, kind in zip(WHITE, kinds, strict=True) if (own & kind).any()]
    shared, common = estimable(p, f)
    # Where every reading brings its sigma, that is the noise: a share beside it would make any sigma look right.
    names += ["share"] * (shared and bool(own.any())) + ["pose_share"] * common
    return tuple(names + [name for name, kind in zip(("pose0", "pose1"), kinds, strict=True) if common and kind.any()])


def likelihood(
    p: Problem, names: tuple[str, ...], rest: Noise, f: Array, J: Array, error: Array, weight: Array
) -> Likelihood:
    """The restricted likelihood of the variances named; ``rest``: noise that holds the others.

    ``error`` (m,) = read - f; J (m, p): derivatives; ``weight`` (m,) divides the white variance of outliers.
    """
    own, turn = np.isnan(p.sigma), p.component >= 3
    patterns = {
        "white0": (own & ~turn) / weight, "white1": (own & turn) / weight, "share": f**2 / weight,
        "pose0": (~turn).astype(float), "pose1": turn.astype(float), "pose_share": f,
    }  # fmt: skip
    terms = [Term(n, patterns[n], common=n.startswith("pose"), column=int(n == "pose_share")) for n in names]
    fixed = rest.with_variances(names, np.zeros(len(names))).variance(p, f) / weight
    return Likelihood(p.blocks, tuple(terms), fixed, _independent(J), error)


def fit_noise(
    p: Problem, f: Array, J: Array, error: Array, start: Noise, floor: tuple[float, float], weight: Array,
    *, names: tuple[str, ...] | None = None, known: dict[tuple[str, ...], Known | None] | None = None,
) -> Noise:  # fmt: skip
    """Variances by restricted likelihood from residuals ``error`` (m,) = read - f, with derivatives J (m, k).

    All terms that the readings can tell are estimated together (``names``: only these); what the likelihood does not
    ask for ends at zero, and so does a share of more than all (:data:`MOST_SHARE`). ``weight`` (m,) divides the white
    variance of outliers. White noise never falls below ``floor``, and all of it stays within the readings.
    """
    names = terms_of(p, f) if names is None else names
    known = {} if known is None else known
    while names:
        of = likelihood(p, names, start, f, J, error, weight)
        low = np.array([floor[int(n[-1])] ** 2 if n in WHITE else 0.0 for n in names])
        t, known[names] = maximise(of, start.variances(names), low, known.get(names))
        found = start.with_variances(names, t)
        absurd = tuple(n for n in names if n in SHARES and getattr(found, n) > MOST_SHARE)
        if not absurd:
            return within_readings(p, f, found, floor)
        start = start.with_variances(absurd, np.zeros(len(absurd)))
        names = tuple(n for n in names if n not in absurd)
    return start


def _independent(J: Array) -> Array:
    """A basis of the columns' span: the likelihood must not hang on directions that no reading tells."""
    norm = np.sqrt(np.einsum("mp,mp->p", J, J))
    S = J[:, norm > 0.0] / norm[norm > 0.0]
    # Columns that are far from depending on one another are a basis as they are.
    if S.shape[0] > S.shape[1] > 0 and np.linalg.eigvalsh(S.T @ S)[0] > 1e-8:
        return np.asarray(S)
    return spanning(J, 1e-8)
