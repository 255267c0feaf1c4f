"""Which noise to reckon with: a set of plausible variances, with what is known of gauges and set-ups beforehand."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from doe.diagnosis.setting import FLOOR, Setting
from doe.estimation.blocks import Covariance
from doe.estimation.least_squares import spanning
from doe.estimation.noise import (
    NAMES,
    Noise,
    at_least,
    fit_noise,
    likelihood,
    own_terms,
    rms_by_kind,
    terms_of,
)
from doe.estimation.repeats import costs, repeated, structures
from robots.arrays import Array

# Readings scatter by some 3 % of their size, within a factor of two or so; set-ups by 1 %, seldom by 2.
READING, READING_FACTOR = 0.03, math.log(2.5)
SETUP = 0.008
OWN = own_terms(NAMES)
# Scatter between set-ups, as a share of the deflection, beyond which it is none.
MOST = 0.3
# Directions of columns (of norm one) weaker than this are others over again.
SAME = 1e-5


# Length of a displacement vector over its components' RMS: between one component read and three.
VECTOR = 1.4
# What another structure of the noise must add to the log likelihood of what a model leaves: that has a structure too.
ANOTHER = 3.0

# Typical deflection (m), rotation (rad) and load (N).
Size = tuple[float, float, float]


@dataclass(frozen=True)
class NoisePrior:
    """What is known beforehand: typical scatter between set-ups as a share of the deflection."""

    setup: float = SETUP

    def log_density(self, noise: Noise, size: Size) -> float:
        """Log density, up to a constant, of all that readings of typical ``size`` scatter by, whatever it hangs on."""
        kind = 0 if size[0] > 0.0 else 1
        typical = max(size[kind], 1e-12)
        axes = noise.axes[3 * kind : 3 * kind + 3]
        fixed = math.hypot(noise.white[kind], noise.load[kind] * size[2], math.hypot(*axes) / math.sqrt(3.0))
        own = math.hypot(noise.share, VECTOR * noise.vector, fixed / typical) * noise.whole
        common = math.hypot(noise.pose_share, noise.pose[kind] / typical)
        return -0.5 * (math.log(max(own, 1e-9) / READING) / READING_FACTOR) ** 2 - 0.5 * (common / self.setup) ** 2


def typical_size(s: Setting) -> Size:
    """RMS of the translations and rotations read, zero where none was, and of the loads."""
    return (*rms_by_kind(s.data, s.data.value), float(np.sqrt(np.mean(s.data.load**2))))


def fitted_noise(s: Setting, columns: Array, weight: Array, start: Noise | None = None) -> Noise:
    """Variances by restricted likelihood where the readings may follow ``columns`` (m, k).

    Where repeats tell what readings scatter by of their own, that is taken, and what is left of the readings says only
    how set-ups scatter. Elsewhere all comes from what is left; its structure is that of ``start``, or the likeliest.
    """
    p, f = s.data, s.prediction
    told = repeated(p)
    begin = start or first_noise(s)
    # Directions that only rounding tells apart would make the restricted likelihood hang on rounding.
    basis = spanning(columns, SAME)
    if basis.shape[1] >= len(f) - 1:
        return begin
    every = (begin.structure,) if start is not None or told is not None else structures(p, f)
    worth, found = -math.inf, begin
    for structure in every:
        names = terms_of(p, f, structure)
        names = names if told is None else tuple(n for n in names if n not in own_terms(names))
        try:
            one = fit_noise(p, f, basis, s.residual, begin, FLOOR, weight, names=names)
            gain = 0.0
            if len(every) > 1:
                of = likelihood(p, names, one, f, basis, s.residual, weight)
                gain = (
                    -of.at(one.variances(names)).loss - costs(structure, p, len(p)) - ANOTHER * (structure != "share")
                )
        except np.linalg.LinAlgError:
            # Columns that follow all set-ups but one leave nothing to tell their scatter by.
            continue
        if gain > worth:
            worth, found = gain, one
    return _believed(found, typical_size(s))


def first_noise(s: Setting) -> Noise:
    """The noise before any model has been held against the readings: their repeats', or a usual one."""
    told = repeated(s.data)
    if told is not None:
        return replace(told.noise, white=at_least(told.noise.white, FLOOR))
    size = typical_size(s)
    return Noise(white=(max(1e-5, 0.01 * size[0]), max(1e-5, 0.01 * size[1])))


def _believed(noise: Noise, size: Size) -> Noise:
    """The noise with no more scatter between set-ups than can be believed: few set-ups may ask for any amount."""
    pose = (min(noise.pose[0], MOST * size[0]), min(noise.pose[1], MOST * size[1]))
    return replace(noise, pose=pose, pose_share=min(noise.pose_share, MOST))


def around(noise: Noise, by: float = 1.25) -> list[Noise]:
    """A noise with more and less scatter (``by`` a factor), and with less between set-ups."""
    out = []
    for common in (1.0, 0.5, 0.2, 0.0) if noise.has_common else (1.0,):
        calmer = replace(
            noise, pose=(common * noise.pose[0], common * noise.pose[1]), pose_share=common * noise.pose_share
        )
        out += [calmer.times(scale, OWN, FLOOR) for scale in (1.0 / by, 1.0, by)]
    return out


def own_doubt(s: Setting) -> float:
    """Factor by which readings' own scatter may be more or less: what :func:`around` asks for."""
    told = repeated(s.data)
    return 1.25 if told is None else min(1.25, math.exp(1.5 / math.sqrt(2.0 * told.count)))


def plain_noises(s: Setting) -> list[Noise]:
    """White noise of usual sizes, as shares of what was read, with little or usual scatter between set-ups.

    What repeats tell is not asked again.
    """
    size = typical_size(s)
    usual = [Noise((max(x * size[0], FLOOR[0]), max(x * size[1], FLOOR[1]))) for x in (0.01, 0.02, 0.03, 0.045, 0.07)]
    own = usual if repeated(s.data) is None else [first_noise(s)]
    return [replace(noise, pose_share=common) for noise in own for common in (0.0, 0.01)]


def with_setup(noise: Noise, share: float) -> Noise:
    """The noise with a given scatter between set-ups, all of it a share of the deflection."""
    return replace(noise, pose=(0.0, 0.0), pose_share=share)


def covariance(s: Setting, noise: Noise, weight: Array) -> Covariance:
    """Covariance of the readings."""
    return noise.covariance(s.data, s.prediction, weight)
