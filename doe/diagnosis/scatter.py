"""Which noise to reckon with: a set of plausible variances, with what is known of gauges and set-ups beforehand."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from doe.diagnosis.setting import FLOOR, Setting
from doe.estimation.blocks import Covariance
from doe.estimation.least_squares import spanning
from doe.estimation.noise import Noise, fit_noise, rms_by_kind
from robots.arrays import Array

# Readings scatter by some 3 % of their size, within a factor of two or so; set-ups by 1 %, seldom by 2.
READING, READING_FACTOR = 0.03, math.log(2.5)
SETUP = 0.008
# Scatter between set-ups, as a share of the deflection, beyond which it is none.
MOST = 0.3
# Directions of columns (of norm one) weaker than this are others over again.
SAME = 1e-5


@dataclass(frozen=True)
class NoisePrior:
    """What is known beforehand: typical scatter between set-ups as a share of the deflection."""

    setup: float = SETUP

    def log_density(self, noise: Noise, size: tuple[float, float]) -> float:
        """Log density, up to a constant; ``size``: typical deflection (m) and rotation (rad)."""
        kind = 0 if size[0] > 0.0 else 1
        typical = max(size[kind], 1e-12)
        own = math.hypot(noise.share, noise.white[kind] / typical)
        common = math.hypot(noise.pose_share, noise.pose[kind] / typical)
        return -0.5 * (math.log(max(own, 1e-9) / READING) / READING_FACTOR) ** 2 - 0.5 * (common / self.setup) ** 2


def typical_size(s: Setting) -> tuple[float, float]:
    """RMS of the translations and rotations read; zero where none was."""
    return rms_by_kind(s.data, s.data.value)


def fitted_noise(s: Setting, columns: Array, weight: Array, start: Noise | None = None) -> Noise:
    """Variances by restricted likelihood where the readings may follow ``columns`` (m, k)."""
    f = s.prediction
    begin = start or Noise(white=(max(1e-5, 0.01 * typical_size(s)[0]), max(1e-5, 0.01 * typical_size(s)[1])))
    # Directions that only rounding tells apart would make the restricted likelihood hang on rounding.
    basis = spanning(columns, SAME)
    if basis.shape[1] >= len(f) - 1:
        return begin
    try:
        found = fit_noise(s.data, f, basis, s.residual, begin, FLOOR, weight)
    except np.linalg.LinAlgError:
        # Columns that follow all set-ups but one leave nothing to tell their scatter by.
        return begin
    return _believed(found, typical_size(s))


def _believed(noise: Noise, size: tuple[float, float]) -> Noise:
    """The noise with no more scatter between set-ups than can be believed: few set-ups may ask for any amount."""
    pose = (min(noise.pose[0], MOST * size[0]), min(noise.pose[1], MOST * size[1]))
    return replace(noise, pose=pose, pose_share=min(noise.pose_share, MOST))


def around(noise: Noise) -> list[Noise]:
    """A noise with more and less scatter, and with less between set-ups."""
    out = []
    for common in (1.0, 0.5, 0.2, 0.0) if noise.has_common else (1.0,):
        calmer = replace(noise, pose=(common * noise.pose[0], common * noise.pose[1]),
                         pose_share=common * noise.pose_share)  # fmt: skip
        for scale in (0.8, 1.0, 1.25):
            white = (max(scale * noise.white[0], FLOOR[0]), max(scale * noise.white[1], FLOOR[1]))
            out.append(replace(calmer, white=white, share=scale * noise.share))
    return out


def plain_noises(s: Setting) -> list[Noise]:
    """White noise of usual sizes, as shares of what was read, with little or usual scatter between set-ups."""
    size = typical_size(s)
    return [
        Noise((max(share * size[0], FLOOR[0]), max(share * size[1], FLOOR[1])), pose_share=common)
        for share in (0.01, 0.02, 0.03, 0.045, 0.07)
        for common in (0.0, 0.01)
    ]


def with_setup(noise: Noise, share: float) -> Noise:
    """The noise with a given scatter between set-ups, all of it a share of the deflection."""
    return replace(noise, pose=(0.0, 0.0), pose_share=share)


def covariance(s: Setting, noise: Noise, weight: Array) -> Covariance:
    """Covariance of the readings."""
    return noise.covariance(s.data, s.prediction, weight)
