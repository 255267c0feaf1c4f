"""What scatters: gauge, share of the deflection, and set-up; variances estimated by restricted likelihood.

A reading in pose g, component k, is ``y = f + e + a_gk + b_gk f``: noise ``e`` of its own, and two terms that all
readings of one component in one set-up have in common, with standard deviations ``pose`` (m or rad) and ``pose_share``.
Of its own a reading has white noise (or its own sigma), and beside that one of these, the noise's *structure*: a share
of the component read (``share``), a share of the length of the displacement vector (``vector``), noise in proportion
to the load (``load``), or white noise of another size for each axis (``axes``). Repeats tell which
(:mod:`doe.estimation.repeats`); a diagnosis asks the likelihood where there are none. Heavy tails: :meth:`Noise.weigh`.

Readings of one set-up are not independent, and intervals that ignore it are too narrow. The covariance is made of one
small block for each pose and component (:mod:`doe.estimation.blocks`). Variances:
:mod:`doe.estimation.restricted_likelihood`, which does not take the fitted parameters' share of the scatter for noise.

What scatters can be no larger than what was read (:func:`within_readings`), and only repeats tell it from what the
model misses (:func:`origin`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from doe.estimation.blocks import Covariance
from doe.estimation.least_squares import spanning
from doe.estimation.problem import Problem
from doe.estimation.restricted_likelihood import Known, Likelihood, Term, maximise
from robots.arrays import Array, Bools

Origin = Literal["given", "repeats", "residual"]
Structure = Literal["share", "vector", "load", "axes"]

# Fewer poses or readings than these say nothing about a variance beside the parameters.
FEWEST_POSES, FEWEST_READINGS = 6, 16
# Deflections must differ by this factor before a share can be told from a constant.
SHARE_SPAN = 1.8
WHITE = ("white0", "white1")
POSE = ("pose0", "pose1")
LOAD = ("load0", "load1")
AXES = ("axis0", "axis1", "axis2", "axis3", "axis4", "axis5")
NAMES = (*WHITE, "share", *POSE, "pose_share", "vector", *LOAD, *AXES)
SHARES = ("share", "pose_share", "vector")
# Scatter of more than this share of the deflection is no share of it: where hardly any deflection is predicted, any
# residual is a large multiple of it, and what is predicted elsewhere would be given that multiple as its noise.
MOST_SHARE = 1.0
# Repeats to spare from which they tell the noise: with fewer their scatter is not known to within a factor of two.
FEWEST_REPEATS = 3
# Standardised residual beyond which a reading loses weight; 0.3 % of good ones do.
OUTLIER = 3.0
# Outliers are expected to be this share of the readings, with standard deviations so many times as large.
OUTLIERS, WIDER = 0.02, 10.0


@dataclass(frozen=True)
class Noise:
    """Standard deviations: ``white`` and ``pose`` (2,) for translations (m) and rotations (rad); shares (-).

    ``load`` (2,): m and rad for each N of load; ``axes`` (6,): white noise (m, rad) of each component beyond ``white``;
    ``tail``: degrees of freedom of the Student's t distribution that readings' own scatter follows; 0 for a normal one
    with a few outliers in it. With a tail the standard deviations are those that go with :meth:`weigh`.
    """

    white: tuple[float, float]
    share: float = 0.0
    pose: tuple[float, float] = (0.0, 0.0)
    pose_share: float = 0.0
    vector: float = 0.0
    load: tuple[float, float] = (0.0, 0.0)
    axes: tuple[float, ...] = (0.0,) * 6
    tail: float = 0.0

    @staticmethod
    def of(numbers: Array) -> Noise:
        """The noise with standard deviations and shares in the order of :data:`NAMES`, then ``tail`` (16,)."""
        x = numbers.tolist()
        return Noise((x[0], x[1]), x[2], (x[3], x[4]), x[5], x[6], (x[7], x[8]), tuple(x[9:15]), x[15])

    @cached_property
    def numbers(self) -> Array:
        """Standard deviations and shares in the order of :data:`NAMES`, then ``tail`` (16,)."""
        out = np.array(
            [*self.white, self.share, *self.pose, self.pose_share, self.vector, *self.load, *self.axes, self.tail]
        )
        out.setflags(write=False)
        return out

    @property
    def structure(self) -> Structure:
        """What readings' own scatter depends on, beside white noise."""
        if self.vector:
            return "vector"
        return "load" if any(self.load) else "axes" if any(self.axes) else "share"

    def variance(self, p: Problem, f: Array) -> Array:
        """Variance (m,) of the readings' own part at predictions f (m,)."""
        kind = (p.component >= 3).astype(int)
        own = np.where(np.isnan(p.sigma), np.array(self.white)[kind], p.sigma)
        out = own**2 + (self.share * f) ** 2
        if self.structure != "share":
            out = out + (self.vector * p.lengths(f)) ** 2 + (np.array(self.load)[kind] * p.load) ** 2
            out = out + np.where(np.isnan(p.sigma), np.array(self.axes)[p.component], 0.0) ** 2
        return np.asarray(out)

    def common(self, p: Problem, f: Array) -> Array:
        """Columns (m, 2) of what a set-up's readings have in common, times its standard deviation."""
        kind = (p.component >= 3).astype(int)
        return np.stack([np.array(self.pose)[kind], self.pose_share * f], axis=1)

    def covariance(self, p: Problem, f: Array, weight: Array) -> Covariance:
        """Covariance of the readings at predictions f (m,); ``weight`` (m,) divides the own part of outliers."""
        return p.blocks.covariance(self.variance(p, f) / weight, self.common(p, f))

    def spread(self, p: Problem, f: Array) -> Array:
        """Standard deviation (m,) of each reading at predictions f (m,), its set-up's scatter and tails included."""
        own = self.whole**2 * self.variance(p, f)
        return np.asarray(np.sqrt(own + np.sum(self.common(p, f) ** 2, axis=1)))

    def weigh(self, own: Array) -> Array:
        """Weights (m,) of residuals over the readings' own standard deviations: 1, less for those far out."""
        # Student's t as normal distributions of many widths: with weights the sum of squares is as many as readings.
        return 1.0 / (1.0 + own**2 / (self.tail + 1.0)) if self.tail else outlier_weight(own)

    @property
    def whole(self) -> float:
        """Standard deviation of all readings over that of those in the middle of the distribution: 1 without tails."""
        return float(np.sqrt((self.tail + 1.0) / (self.tail - 2.0))) if self.tail > 2.0 else 1.0

    def times(self, factor: float, names: tuple[str, ...], floor: tuple[float, float]) -> Noise:
        """Copy with more or less of the readings' own scatter that is named; white noise never below ``floor``."""
        own = tuple(name for name in names if not name.startswith("pose"))
        if set(own) & set(AXES):
            own = (*dict.fromkeys((*own, *WHITE)),)
        scaled = self.with_variances(own, factor**2 * self.variances(own))
        return replace(scaled, white=at_least(scaled.white, floor))

    def as_share(self, p: Problem, f: Array) -> Noise:
        """About as much noise of other readings as white noise and a share, for those that know no more of them.

        f (m,): predictions of the readings ``p`` that it was found with.
        """
        if self.structure == "share" and not self.tail:
            return self
        size, length = (max(float(np.sqrt(np.mean(x**2))), 1e-300) for x in (f, p.lengths(f)))
        load = np.array(self.load) * float(np.sqrt(np.mean(p.load**2)))
        axes = np.sqrt(np.mean(np.array(self.axes).reshape(2, 3) ** 2, axis=1))
        white = self.whole * np.sqrt(np.array(self.white) ** 2 + load**2 + axes**2)
        share = self.whole * float(np.hypot(self.share, self.vector * length / size))
        return Noise((float(white[0]), float(white[1])), share, self.pose, self.pose_share)

    @property
    def has_common(self) -> bool:
        """Whether readings of one set-up are correlated."""
        return bool(any(self.pose) or self.pose_share)

    def variances(self, names: tuple[str, ...]) -> Array:
        """Squares (k,) of the standard deviations named (:data:`NAMES`)."""
        return np.asarray(self.numbers[[NAMES.index(name) for name in names]] ** 2)

    def with_variances(self, names: tuple[str, ...], values: Array) -> Noise:
        """Copy with other variances."""
        numbers = self.numbers.copy()
        numbers[[NAMES.index(name) for name in names]] = np.sqrt(values)
        return Noise.of(numbers)

    def split(self, read: Bools) -> Noise:
        """The same with all white noise in ``axes``, of components (6,) that are read."""
        white = np.repeat(self.white, 3)
        axes = np.where(read, np.sqrt(white**2 + np.array(self.axes) ** 2), 0.0)
        return replace(self, white=(0.0, 0.0), axes=tuple(axes.tolist()))

    def folded(self, read: Bools) -> Noise:
        """The same with as much as possible in ``white``: what the calmest component (6,) that is read has."""
        white, axes = np.array(self.white), np.array(self.axes)
        for kind in (0, 1):
            mine = read & (np.arange(6) // 3 == kind)
            if mine.any():
                least = axes[mine].min()
                white[kind] = np.hypot(white[kind], least)
                axes[mine] = np.sqrt(np.maximum(axes[mine] ** 2 - least**2, 0.0))
        return replace(self, white=(float(white[0]), float(white[1])), axes=tuple(axes.tolist()))


def outlier_weight(own: Array) -> Array:
    """Weights (m,) of standardised residuals x: 1 up to OUTLIER, about 1 / WIDER^2 for sure outliers, 1 / x^2 beyond.

    The weights of the likelihood of a contaminated normal distribution (Tukey 1960; Little 1988,
    doi:10.2307/2347491), maximised in turn with the variances: by its odds a reading belongs to the wider one. An
    outlier then adds to the sum of squares about what a good reading adds, so that the noise is not taken for larger
    than it is, and one that a slipped digit has put hundreds of standard deviations away adds no more. Divided by its
    value at OUTLIER, so that good readings count in full.
    """

    def weight(x: Array) -> Array:
        odds = OUTLIERS / (1.0 - OUTLIERS) / WIDER * np.exp(np.minimum(0.5 * x**2 * (1.0 - WIDER**-2), 500.0))
        return np.asarray(1.0 - odds / (1.0 + odds) * (1.0 - 1.0 / np.maximum(x**2, WIDER**2)))

    return np.minimum(1.0, weight(own) / weight(np.array(OUTLIER)))


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
    given, factor = np.nan_to_num(p.sigma) ** 2, np.ones(2)
    square = noise.variance(p, f) - given + np.sum(noise.common(p, f) ** 2, axis=1)
    for kind, mine in enumerate((p.component < 3, p.component >= 3)):
        held, found = float(np.sum(p.value[mine] ** 2)), float(np.sum(square[mine]))
        factor[kind] = np.sqrt(held / found) if found > held else 1.0
    if (factor == 1.0).all():
        return replace(noise, white=at_least(noise.white, floor))
    kinds = [kind_of(name) if name[-1].isdigit() else 2 for name in NAMES]
    scaled = Noise.of(noise.numbers * [*np.array([*factor, factor.min()])[kinds], 1.0])
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


def terms_of(p: Problem, f: Array, structure: Structure = "share") -> tuple[str, ...]:
    """Names of the variances that these readings can tell."""
    own = np.isnan(p.sigma)
    kinds = p.component < 3, p.component >= 3
    names = [name for name, kind in zip(WHITE, kinds, strict=True) if (own & kind).any()]
    shared, common = estimable(p, f)
    # Where every reading brings its sigma, that is the noise: a share beside it would make any sigma look right.
    if shared and own.any():
        if structure == "axes":
            names = [AXES[k] for k in np.unique(p.component[own])]
        elif structure == "load":
            names += [name for name, kind in zip(LOAD, kinds, strict=True) if (own & kind).any()]
        else:
            names.append(structure)
    names += ["pose_share"] * common
    return tuple(names + [name for name, kind in zip(POSE, kinds, strict=True) if common and kind.any()])


def own_terms(names: tuple[str, ...]) -> tuple[str, ...]:
    """Those of the variances named that are of single readings, not of set-ups."""
    return tuple(name for name in names if not name.startswith("pose"))


def pattern(name: str, p: Problem, f: Array, weight: Array) -> Array:
    """How a variance enters the readings' (m,): the diagonal of its own part, or the column that a set-up shares."""
    turn = p.component >= 3
    if name in POSE:
        return np.asarray(turn == (name == POSE[1]), dtype=np.float64)
    if name == "pose_share":
        return f
    own = np.isnan(p.sigma)
    if name in AXES:
        return np.asarray((own & (p.component == AXES.index(name))) / weight)
    if name in WHITE:
        return np.asarray((own & (turn == (name == WHITE[1]))) / weight)
    if name in LOAD:
        return np.asarray(np.where(turn == (name == LOAD[1]), p.load, 0.0) ** 2 / weight)
    return np.asarray((p.lengths(f) if name == "vector" else f) ** 2 / weight)


def likelihood(
    p: Problem, names: tuple[str, ...], rest: Noise, f: Array, J: Array, error: Array, weight: Array
) -> Likelihood:
    """The restricted likelihood of the variances named; ``rest``: noise that holds the others.

    ``error`` (m,) = read - f; J (m, p): derivatives; ``weight`` (m,) divides the own variance of outliers.
    """
    terms = [
        Term(n, pattern(n, p, f, weight), common=n.startswith("pose"), column=int(n == "pose_share")) for n in names
    ]
    fixed = rest.with_variances(names, np.zeros(len(names))).variance(p, f) / weight
    return Likelihood(p.blocks, tuple(terms), fixed, _independent(J), error)


def fit_noise(
    p: Problem,
    f: Array,
    J: Array,
    error: Array,
    start: Noise,
    floor: tuple[float, float],
    weight: Array,
    *,
    names: tuple[str, ...] | None = None,
    known: dict[tuple[str, ...], Known | None] | None = None,
) -> Noise:
    """Variances by restricted likelihood from residuals ``error`` (m,) = read - f, with derivatives J (m, k).

    All terms that the readings can tell are estimated together (``names``: only these); what the likelihood does not
    ask for ends at zero, and so does a share of more than all (:data:`MOST_SHARE`). ``weight`` (m,) divides the own
    variance of outliers. White noise never falls below ``floor``, and all of it stays within the readings.
    """
    names = terms_of(p, f, start.structure) if names is None else names
    known = {} if known is None else known
    read = np.isin(np.arange(6), p.component)
    by_axis = bool(set(names) & set(AXES))
    start = start.split(read) if by_axis else start
    while names:
        of = likelihood(p, names, start, f, J, error, weight)
        low = np.array([floor[kind_of(n)] ** 2 if n in WHITE or n in AXES else 0.0 for n in names])
        t, known[names] = maximise(of, start.variances(names), low, known.get(names))
        found = start.with_variances(names, t)
        absurd = tuple(n for n in names if n in SHARES and getattr(found, n) > MOST_SHARE)
        if not absurd:
            return within_readings(p, f, found.folded(read) if by_axis else found, floor)
        start = start.with_variances(absurd, np.zeros(len(absurd)))
        names = tuple(n for n in names if n not in absurd)
    return start


def kind_of(name: str) -> int:
    """0 of translations, 1 of rotations."""
    return int(name[-1]) // 3 if name in AXES else int(name[-1])


def _independent(J: Array) -> Array:
    """A basis of the columns' span: the likelihood must not hang on directions that no reading tells."""
    norm = np.sqrt(np.einsum("mp,mp->p", J, J))
    S = J[:, norm > 0.0] / norm[norm > 0.0]
    # Columns that are far from depending on one another are a basis as they are.
    if S.shape[0] > S.shape[1] > 0 and np.linalg.eigvalsh(S.T @ S)[0] > 1e-8:
        return np.asarray(S)
    return spanning(J, 1e-8)
