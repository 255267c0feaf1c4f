"""What gauges and people add to a reading, and its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from .arm import Arm, Vector
from .chain import Chain
from .effect import Row

KINDS = ("share-of-component", "share-of-vector", "load", "white", "by-axis", "heavy-tailed", "session")
# Standard deviation of Student's t with three degrees of freedom.
HEAVY = np.sqrt(3.0)
# What a good gauge adds to any reading, m.
FLOOR = 5e-6


@dataclass(frozen=True)
class Noise:
    """Kind and sizes: a share of what is read, m by axis, m that a session has in common, N that count as full load."""

    kind: str
    share: float
    axes: tuple[float, float, float]
    session: float
    scatter: float
    outliers: bool
    resolution: float
    full: float


def draw_noise(rng: np.random.Generator, kind: str, scatter: float, outliers: bool, full: float) -> Noise:
    """Shares of 1 to 4 %, white noise of 5 to 30 um, 10 to 40 um in common within a session."""
    white = np.exp(rng.uniform(np.log(5e-6), np.log(30e-6), 3))
    x, y, z = (white if kind == "by-axis" else white[[0, 0, 0]]).tolist()
    session = float(rng.uniform(10e-6, 40e-6)) if kind == "session" else 0.0
    resolution = 1e-5 if rng.random() < 0.25 else 1e-6
    return Noise(kind, float(rng.uniform(0.01, 0.04)), (x, y, z), session, scatter, outliers, resolution, full)


def deviations(noise: Noise, rows: Sequence[Row], true: Vector) -> Vector:
    """Standard deviation (n, 3) of each component by itself, m."""
    out = np.tile(np.array(noise.axes), (len(rows), 1))
    if noise.kind == "share-of-component":
        out = np.hypot(noise.share * np.abs(true), FLOOR)
    elif noise.kind == "share-of-vector":
        out = np.repeat(np.hypot(noise.share * np.linalg.norm(true, axis=1), FLOOR)[:, None], 3, axis=1)
    elif noise.kind == "load":
        size = np.array([np.linalg.norm(row.force) for row in rows])
        out = np.hypot(out * (size / noise.full)[:, None], FLOOR)
    return out


def blur(noise: Noise, rows: Sequence[Row], true: Vector, rng: np.random.Generator) -> tuple[Vector, list[int]]:
    """Readings (n, 3) with noise, and which of them are outliers (row times three plus component)."""
    sigma = deviations(noise, rows, true)
    scatter = {pose: noise.scatter * rng.normal() for pose in dict.fromkeys(row.pose for row in rows)}
    common = {s: noise.session * rng.normal(size=3) for s in sorted({row.moment.session for row in rows})}
    draws = rng.standard_t(3, true.shape) / HEAVY if noise.kind == "heavy-tailed" else rng.normal(size=true.shape)
    out = true + sigma * draws
    for i, row in enumerate(rows):
        out[i] += scatter[row.pose] * true[i] + common[row.moment.session]
    out = np.round(out / noise.resolution) * noise.resolution
    wrong: list[int] = []
    if noise.outliers:
        for spoilt in np.flatnonzero(rng.random(len(rows)) < 1 / 50).tolist():
            for axis in range(3):
                wrong.append(3 * spoilt + axis)
                out[spoilt, axis] = _spoilt(out[spoilt, axis], sigma[spoilt, axis], rng)
    return out, wrong


def _spoilt(value: float, sigma: float, rng: np.random.Generator) -> float:
    """Return 5 to 15 standard deviations more or less, a slipped digit or a slipped sign."""
    kind = rng.random()
    if kind < 0.7:
        return float(value + rng.choice([-1, 1]) * rng.uniform(5, 15) * sigma)
    return float(-value if kind < 0.85 else value * rng.choice([0.1, 10.0]))


def excess(
    arm: Arm, rows: Sequence[Row], true: Vector, noise: Noise, axes: Sequence[int], free: Sequence[str], share: float
) -> float:
    """Chi-square of noise-free readings after refitting all springs of the model, which are never negative.

    What set-ups scatter and sessions have in common are unknowns with a prior of their own size, which is the same as
    their covariance. Least squares in compliances on rigid links, at the table's angles.
    """
    columns = _columns(arm, rows, free, share)[:, :, axes]
    sigma, y = deviations(noise, rows, true)[:, axes], true[:, axes]
    common = _common(noise, rows, y)
    flat = [(block / sigma).reshape(-1) for block in (*common, *columns, y)]
    prior = np.zeros((len(common), len(flat)))
    prior[:, : len(common)] = np.eye(len(common))
    small = np.asarray(np.linalg.qr(np.vstack([prior, np.array(flat).T]), mode="r"))
    left = small[len(common) :, len(common) :]
    scale = np.linalg.norm(left[:, :-1], axis=0)
    seen = scale > 1e-9 * max(float(scale.max()), 1e-300)
    return float(nnls(left[:, :-1][:, seen] / scale[seen], left[:, -1])[1] ** 2)


def _columns(arm: Arm, rows: Sequence[Row], free: Sequence[str], share: float) -> Vector:
    """Displacement (springs, n, 3) by each spring of 1 rad/(N m), as a model without effects has it."""
    chain = Chain(arm, share=share)
    slots = [chain.where[name] for name in free]
    out, known = np.zeros((len(free), len(rows), 3)), {}
    for i, row in enumerate(rows):
        key = np.concatenate([row.angles, row.force]).tobytes()
        if key not in known:
            chain.pose(arm.real(row.angles), np.zeros(chain.size))
            jacobian = chain.jacobian(row.point)[:, slots]
            known[key] = (jacobian * (row.force @ jacobian)).T
        out[:, i] = known[key]
    return out


def _common(noise: Noise, rows: Sequence[Row], y: Vector) -> list[Vector]:
    """What several readings have in common, each (n, axes) in m for one unit of it."""
    out = []
    if noise.scatter:
        poses = np.array([row.pose for row in rows])
        out += [noise.scatter * y * (poses == pose)[:, None] for pose in dict.fromkeys(poses.tolist())]
    if noise.session:
        days = np.array([row.moment.session for row in rows])
        for day in np.unique(days):
            out += [noise.session * np.outer(days == day, unit) for unit in np.eye(y.shape[1])]
    return out
