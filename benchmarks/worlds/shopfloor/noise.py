"""Noise of the gauge, set-up scatter, outliers; and the covariance that the drawn noise truly has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.worlds.shopfloor.arms import Floats, Ints
from benchmarks.worlds.shopfloor.law import log_uniform

KINDS = ("share-of-component", "share-of-vector", "load", "white", "by-axis", "heavy-tailed", "session")
UM = 1e-6


@dataclass(frozen=True)
class Noise:
    """One structure of noise, SI.

    share is of the component or the vector, per_newton of the load (m/N), axes are standard deviations (3,) m;
    days is the standard deviation of a session's own offset (m), floor that of the gauge's last digits.
    """

    kind: str
    share: float
    per_newton: float
    axes: tuple[float, float, float]
    days: float
    scatter: float
    resolution: float
    outliers: bool

    def sigma(self, d: Floats, force: Floats) -> Floats:
        """Standard deviation of each component (n, 3), resolution apart."""
        floor = 2.0 * UM
        if self.kind == "share-of-component":
            return self.share * np.abs(d) + floor
        if self.kind == "share-of-vector":
            return np.tile(self.share * np.linalg.norm(d, axis=1)[:, None] + floor, (1, 3))
        if self.kind == "load":
            return np.tile(self.per_newton * np.linalg.norm(force, axis=1)[:, None] + floor, (1, 3))
        return np.tile(np.array(self.axes), (len(d), 1))

    def variance(self, d: Floats, force: Floats) -> Floats:
        """Of each component (n, 3), m^2, the rounding with it."""
        return np.asarray(self.sigma(d, force) ** 2 + self.resolution**2 / 12.0)

    def jitter(self, shape: tuple[int, ...], rng: np.random.Generator) -> Floats:
        """Unit variance; heavy tails as a scale mixture: a Student t with three degrees of freedom over its sqrt(3)."""
        normal = rng.normal(size=shape)
        if self.kind != "heavy-tailed":
            return normal
        return np.asarray(normal / np.sqrt(rng.chisquare(3, shape) / 3.0) / np.sqrt(3.0))

    def rounded(self, d: Floats) -> Floats:
        """To the gauge's steps."""
        return np.asarray(np.rint(d / self.resolution) * self.resolution)


def draw(rng: np.random.Generator, kind: str, scatter: float, outliers: bool) -> Noise:
    white = log_uniform(rng, 5 * UM, 30 * UM)
    axes = (white, white, white)
    if kind == "by-axis":
        x, y, z = (log_uniform(rng, 5 * UM, 30 * UM) for _ in range(3))
        axes = (x, y, z)
    days = log_uniform(rng, 8 * UM, 30 * UM) if kind == "session" else 0.0
    return Noise(
        kind,
        log_uniform(rng, 0.005, 0.03),
        log_uniform(rng, 0.02 * UM, 0.08 * UM),
        axes,
        days,
        scatter,
        float(rng.choice([1.0, 1.0, 1.0, 10.0])) * UM,
        outliers,
    )


def measured(
    noise: Noise,
    clean: Floats,
    force: Floats,
    pose: Ints,
    session: Ints,
    rng: np.random.Generator,
    axes: slice,
) -> tuple[Floats, list[int]]:
    """Readings (n, 3) m with all noise, and the rows that were spoilt in one of the read ``axes``."""
    read = np.arange(3)[axes]
    d = clean * (1.0 + noise.scatter * rng.normal(size=int(pose.max()) + 1)[pose][:, None])
    sigma = noise.sigma(clean, force)
    d = d + sigma * noise.jitter(clean.shape, rng)
    d = d + noise.days * rng.normal(size=(int(session.max()) + 1, 3))[session]
    spoilt = np.flatnonzero(rng.random(len(d)) < 0.02).tolist() if noise.outliers else []
    for row in spoilt:
        axis = int(rng.choice(read))
        way = rng.random()
        if way < 0.7:
            d[row, axis] += rng.choice([-1.0, 1.0]) * rng.uniform(5.0, 15.0) * sigma[row, axis]
        else:
            d[row, axis] *= -1.0 if way < 0.85 else float(rng.choice([10.0, 0.1]))
    return noise.rounded(d), spoilt


def common(noise: Noise, d: Floats, pose: Ints, session: Ints) -> Floats:
    """What readings have in common, as columns of a root of the covariance, (n, 3, m) m."""
    columns = []
    if noise.scatter:
        columns += [noise.scatter * d * (pose == p)[:, None] for p in np.unique(pose)]
    if noise.days:
        for day in np.unique(session):
            columns += [noise.days * np.outer(session == day, axis) for axis in np.eye(3)]
    return np.stack(columns, axis=-1) if columns else np.zeros((*d.shape, 0))


def tags(noise: Noise, spoilt: int) -> Mapping[str, object]:
    return {"noise": noise.kind, "scatter": noise.scatter, "outliers": spoilt, "resolution_um": noise.resolution / UM}
