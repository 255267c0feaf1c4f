"""The paper's claims computed for each reading: on the path, around a point, over a plane, against displacement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from kr60_readings import FORCE_N, P1_M, P2_M, P_M, TABLE_4, UP, Reading, flange_frames, index, path
from scipy.stats import kendalltau, spearmanr

import fem
import machining
from machining.stiffness.distribution import Distribution, Over, distribution
from robots.arrays import Array, Bools
from surrogate.maps.data import Layout
from surrogate.maps.layouts import plane_or_box, points_of

GAMMA_DEG = np.arange(-180.0, 180.0, 1.0)
PLANE_GAMMA_DEG = np.arange(0.0, 181.0, 15.0)
PATH_GAMMA_DEG = (0.0, 10.0, 30.0, 59.0, 100.0)
COMPARED = ("k_fs", "nspi", "rayleigh", "directional", "weakest", "mean")


@dataclass(frozen=True)
class PointCurve:
    """k_fs (N/mm) at P over gamma: where it is largest, and the least value next below that gamma."""

    k: Array
    best_deg: float
    foot_deg: float

    @property
    def span(self) -> tuple[float, float]:
        """Smallest and largest k_fs over gamma, N/mm."""
        return float(np.nanmin(self.k)), float(np.nanmax(self.k))


def at_point(model: fem.ArmModel, reading: Reading) -> PointCurve:
    """Fig. 4."""
    k = index(model, reading, np.tile(P_M, (len(GAMMA_DEG), 1)), GAMMA_DEG)
    best = int(np.nanargmax(k))
    foot = best
    # Downhill from the maximum towards smaller gamma; the circle closes at -180.
    while k[foot - 1] < k[foot] and foot > best - len(k):
        foot -= 1
    return PointCurve(k, float(GAMMA_DEG[best]), float((GAMMA_DEG[foot] + 180.0) % 360.0 - 180.0))


@dataclass(frozen=True)
class PathResult:
    """k_fs (N/mm) on the path: at the table's points, on ``x_mm``, means by gamma, mean of the best gamma each."""

    table: Array
    x_mm: Array
    k: Array
    means: Array
    best_gamma: Array
    optimum: Array

    @property
    def error(self) -> float:
        """Largest relative difference to Table 4; NaN where a point cannot be reached."""
        return float(np.abs(self.table / TABLE_4[:, 1] - 1.0).max())

    @property
    def worst_x_mm(self) -> float:
        """Where on the path k_fs is smallest, mm; NaN where part of the path cannot be reached."""
        return float(self.x_mm[np.argmin(self.k)]) if np.isfinite(self.k).all() else float("nan")


def on_path(model: fem.ArmModel, reading: Reading) -> PathResult:
    """Table 4, Fig. 5 and Table 5: points 2 mm apart along the path, as in the paper's optimised path."""
    length = np.linalg.norm(P2_M - P1_M)
    x = np.linspace(P1_M[0], P2_M[0], int(length / 0.002) + 1) * 1e3
    points = path(x)
    means = np.array([index(model, reading, points, g).mean() for g in PATH_GAMMA_DEG])
    each = np.stack([index(model, reading, points, g) for g in GAMMA_DEG[::2]])
    each = np.where(np.isnan(each), -np.inf, each)
    return PathResult(
        index(model, reading, path(TABLE_4[:, 0]), 0.0),
        x,
        index(model, reading, points, 0.0),
        means,
        GAMMA_DEG[::2][each.argmax(axis=0)],
        each.max(axis=0),
    )


def tool_frame(reading: Reading) -> Array:
    """Tool frame (4, 4) on the flange of a reading: z leads down out of the holder, x is base X at gamma = 0."""
    T, tip = flange_frames(reading, np.zeros((1, 3)), np.zeros(1))
    frame = np.eye(4)
    frame[:3, :3] = T[0, :3, :3].T @ np.diag([1.0, -1.0, -1.0])
    frame[:3, 3] = tip
    return frame


@dataclass(frozen=True)
class PlaneResult:
    """k_fs over the plane z = 486 mm at each of ``PLANE_GAMMA_DEG``; the distribution's gamma is the reading's own."""

    grid: Layout
    found: Distribution

    @property
    def k(self) -> Array:
        """k_fs (gamma, y, x), N/mm, NaN where no posture."""
        return np.asarray(1e-3 * self.found.value.T.reshape(-1, *self.grid.shape))

    def statistics(self, over: Over = "reached") -> dict[str, Array]:
        """Mean, standard deviation and peak to valley (N/mm) by gamma, and the share of the plane reached."""
        s = self.found.statistics(over)
        return {
            "mean": 1e-3 * s.mean,
            "std": 1e-3 * s.standard_deviation,
            "pv": 1e-3 * s.peak_to_valley,
            "reached": s.share,
        }

    def near_the_base(self, gamma: int) -> float:
        """Rank correlation of k_fs with the distance from the base axis; -1: always stiffer when nearer."""
        distance, k = np.hypot(*points_of(self.grid)[:, :2].T), self.found.value[:, gamma]
        known = np.isfinite(k)
        return float(spearmanr(distance[known], k[known]).statistic)

    def stiff_region(self) -> Array:
        """Share (gamma,) of the plane that is stiffer than half of all points at all gamma: the paper's red region."""
        middle = np.nanmedian(self.found.value)
        return np.asarray((self.found.value > middle).mean(axis=0))

    def together(self) -> Bools:
        """Whether mean and peak to valley change the same way from one gamma to the next."""
        s = self.statistics()
        return np.asarray(np.diff(s["mean"]) * np.diff(s["pv"]) > 0.0)


def on_plane(model: fem.ArmModel, reading: Reading, step_mm: float = 25.0) -> PlaneResult:
    """Figs. 10 and 11. The paper does not say where its plane ends: here 1.2 m across and 0.6 to 1.4 m ahead."""
    x_mm, y_mm = np.arange(-600.0, 601.0, step_mm), np.arange(600.0, 1401.0, step_mm)
    grid, gamma = plane_or_box(x_mm, y_mm, 1e3 * P_M[2]), np.radians(PLANE_GAMMA_DEG)
    if reading.branch is None and reading.at == "tool":
        path = machining.tool_path(points_of(grid), UP)
        task = machining.Task(path, tool_frame(reading), np.eye(4), np.array([1.0, 0.0, 0.0]))
        value = distribution(model, task, None, reading.turn * gamma).value
    else:
        # No rule of `distribution`: limits broken, one branch, Jacobian elsewhere.
        value = 1e3 * np.stack([index(model, reading, points_of(grid), g) for g in PLANE_GAMMA_DEG], axis=1)
    return PlaneResult(grid, Distribution(machining.Objective(), gamma, value))


@dataclass(frozen=True)
class Correlation:
    """Rank correlation of an index with the displacement |d| and with its part along the normal |n . d|.

    ``wrong``: share of pairs of poses whose order by the index is not that of |d|.
    """

    length: float
    normal: float
    wrong: float


@dataclass(frozen=True)
class ForceStudy:
    """Fig. 3 over the workspace: displacement (mm) under 200 N along each axis, the indices (N/mm), correlations."""

    d_mm: Array
    values: dict[str, Array]
    correlations: dict[str, Correlation]
    other_forces: dict[str, tuple[float, float]]


def under_force(model: fem.ArmModel, q: Array, point: Array, rng: np.random.Generator) -> ForceStudy:
    """Fig. 3 at poses q (n, 6), the tool point (3,) m in the flange frame, normal along base Z.

    ``other_forces``: lowest and highest rank correlation with |d| over 50 random directions of the force.
    """
    C = machining.translational(model, q, point)
    values = {name: machining.evaluate(name, C, UP, FORCE_N) * 1e-3 for name in COMPARED}
    d = np.einsum("nij,j->ni", C, FORCE_N) * 1e3
    length, normal = np.linalg.norm(d, axis=1), np.abs(d[:, 2])
    few = rng.choice(len(q), min(len(q), 3000), replace=False)
    correlations = {
        name: Correlation(
            float(spearmanr(k, length).statistic),
            float(spearmanr(k, normal).statistic),
            float((1.0 + kendalltau(k[few], length[few]).statistic) / 2.0),
        )
        for name, k in values.items()
    }
    seen: dict[str, list[float]] = {name: [] for name in COMPARED}
    for u in rng.normal(size=(50, 3)):
        moved = np.linalg.norm(np.einsum("nij,j->ni", C[few], u), axis=1)
        for name in COMPARED:
            k = machining.evaluate(name, C[few], UP, u)
            seen[name].append(float(spearmanr(k, moved).statistic))
    return ForceStudy(length, values, correlations, {name: (min(v), max(v)) for name, v in seen.items()})


def implied_force(k_N_per_mm: Array, error_mm: Array) -> Array:
    """Force (N) along the normal that makes k_fs explain a milling error, if only that force acts."""
    return np.asarray(k_N_per_mm * error_mm)
