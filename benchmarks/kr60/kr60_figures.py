"""The pictures of docs/validation/kr60_indices.md: path and point, displacement against index, plane by gamma."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter, StrMethodFormatter
from scipy.stats import kendalltau, spearmanr

import fem
import machining
import robots
from machining.stiffness.distribution import Distribution, Over, distribution
from robots.arrays import Array, Bools
from robots.inverse.solutions import inverse_kinematics
from stiffarm.commands.maps.index.figures import HATCH, HATCH_INK, NOTHING
from stiffarm.commands.maps.looks import look_bar, look_of
from stiffarm.pages.figure_parts import log_ticks
from stiffarm.pages.style import INK, OKABE_ITO, STIFFNESS_COLOURS, house_style, new_figure
from surrogate.maps.data import Field, Layout
from surrogate.maps.layouts import plane_or_box, points_of

# Gao 2024, section III.B and Table 4. The table's columns: x (mm), k_fs (N/mm), milling error (mm).
P1_M, P2_M = np.array([-0.043, 0.834, 0.486]), np.array([0.057, 0.947, 0.486])
P_M = np.array([0.150, 1.200, 0.486])
TABLE_4 = np.array(
    [
        [-40.0, 530.5647, 0.038],
        [-20.0, 482.9829, 0.057],
        [0.0, 474.9636, 0.069],
        [10.0, 476.0073, 0.064],
        [30.0, 480.9952, 0.059],
    ]
)
FORCE_N = np.array([200.0, 200.0, 200.0])
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Reading:
    """One way to read the paper.

    ``z6`` (3,) and ``lever`` (3,) m: direction of the flange axis, and from flange centre to tool point, base axes at
    gamma = 0; gamma turns both about the vertical through the tool point, ``turn = -1`` clockwise seen from above.
    ``at``: where the Jacobian is taken. ``branch``: always that one, limits or not; None: the stiffest within limits.
    """

    name: str
    says: str
    z6: Array
    lever: Array
    turn: Literal[1, -1] = -1
    at: Literal["tool", "flange"] = "tool"
    branch: str | None = None

    @property
    def tilt_deg(self) -> float:
        """Angle between the flange axis and the downward vertical, which is the tool axis on a level surface."""
        return float(np.degrees(np.arccos(-self.z6[2] / np.linalg.norm(self.z6))))

    @property
    def ahead_mm(self) -> float:
        """Tool point along the flange axis, from the flange."""
        return float(self.lever @ self.z6 / np.linalg.norm(self.z6) * 1e3)

    @property
    def aside_mm(self) -> float:
        """Tool point's distance from the flange axis."""
        return float(np.sqrt(self.lever @ self.lever - (self.ahead_mm * 1e-3) ** 2) * 1e3)


def _beside(name: str, says: str, x: float, y: float, lever: list[float], turn: Literal[1, -1] = -1) -> Reading:
    return Reading(name, says, np.array([x, y, -np.sqrt(1.0 - x * x - y * y)]), np.array(lever), turn)


def spindle(ahead_m: float, down_m: float) -> Reading:
    """A spindle across the flange axis, which stands level at gamma = 0 along +y: the usual way to mount one."""
    lever = np.array([0.0, ahead_m, -down_m])
    says = f"spindle across the flange axis, {1e3 * ahead_m:.0f} mm ahead, {1e3 * down_m:.0f} mm down"
    return Reading("S", says, np.array([0.0, 1.0, 0.0]), lever)


A0 = Reading(
    "A0",
    "flange axis level, Jacobian at the flange, always one branch, limits broken; 2 fitted figures",
    np.array([0.0, 1.0, 0.0]),
    np.array([0.0, 0.1447, 0.002]),
    at="flange",
    branch="front, elbow down, no flip",
)
RULE = "the paper's rule (limits kept, stiffest branch, Jacobian at the tool point); 5 fitted figures"
B = _beside("B", RULE, -0.0796, -0.0991, [-0.1213, -0.1256, 0.0146])
B2 = _beside("B2", "as B, another tool that fits", 0.00788, -0.04848, [0.17189, -0.164, 0.02868], 1)
B3 = _beside("B3", "as B, another tool that fits less well", 0.02724, -0.07859, [0.07998, -0.17066, 0.04849], 1)
S = spindle(0.065, 0.200)
IN_LINE = Reading("L", "spindle in line with the flange axis, 250 mm long", -UP, np.array([0.0, 0.0, -0.25]))
READINGS = (A0, B, B2, B3, S)


def arm() -> fem.ArmModel:
    """The paper's model: rigid links, the joint stiffnesses of its Table 1."""
    return fem.build_model(robots.load_description("kr60-3"), links="rigid")


def path(x_mm: Array) -> Array:
    """Points (n, 3) m on the line from P1 to P2 at x (n,) mm."""
    share = (x_mm * 1e-3 - P1_M[0]) / (P2_M[0] - P1_M[0])
    return np.asarray(P1_M + share[:, None] * (P2_M - P1_M))


def flange_frames(reading: Reading, points: Array, gamma_deg: Array) -> tuple[Array, Array]:
    """Flange frames (n, 4, 4) with the tool at points (n, 3) m, and the tool point in the flange frame (3,) m."""
    z = reading.z6 / np.linalg.norm(reading.z6)
    x = np.array([1.0, 0.0, 0.0]) - z[0] * z
    x = x / np.linalg.norm(x)
    R0 = np.stack([x, np.cross(z, x), z], axis=1)
    angle = reading.turn * np.radians(gamma_deg)
    turn = np.zeros((len(points), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
    turn[:, 1, 0], turn[:, 0, 1], turn[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
    T = np.tile(np.eye(4), (len(points), 1, 1))
    T[:, :3, :3] = turn @ R0
    T[:, :3, 3] = points - turn @ reading.lever
    return T, R0.T @ reading.lever


def postures(model: fem.ArmModel, reading: Reading, points: Array, gamma_deg: Array) -> tuple[Array, Array]:
    """Chosen joint angles (n, 6) rad and k_fs (n,) N/mm along base Z; NaN where the rule finds no posture."""
    T, tool = flange_frames(reading, points, gamma_deg)
    found = inverse_kinematics(model.robot, T, T_flange_tool=np.eye(4))
    n, m, dof = found.q.shape
    usable = found.reached if reading.branch else found.valid
    q = np.where(usable[:, :, None], found.q, 0.0)
    at = tool if reading.at == "tool" else np.zeros(3)
    k = machining.stiffness_index(model, q.reshape(-1, dof), UP, at).reshape(n, m) * 1e-3
    k = np.where(usable, k, -np.inf)
    column = np.full(n, found.names.index(reading.branch)) if reading.branch else k.argmax(axis=1)
    rows = np.arange(n)
    none = ~usable[rows, column]
    return np.where(none[:, None], np.nan, q[rows, column]), np.where(none, np.nan, k[rows, column])


def index(model: fem.ArmModel, reading: Reading, points: Array, gamma_deg: Array | float) -> Array:
    """k_fs (n,) N/mm, see :func:`postures`."""
    return postures(model, reading, points, np.broadcast_to(np.asarray(gamma_deg, dtype=float), len(points)))[1]


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


# Small files: the page shows them at this size.
DOTS_PER_INCH = 80
MAP_GAMMA_DEG = (0.0, 30.0, 60.0, 90.0)
COLOURS = dict(zip(("A0", "B", "B2", "B3", "S"), ("blue", "vermillion", "green", "purple", "orange"), strict=True))


def colour(name: str) -> str:
    return OKABE_ITO[COLOURS[name]]


def save(figure: Figure, file: Path) -> None:
    with house_style():
        figure.savefig(file, format="png", dpi=DOTS_PER_INCH)


def curves(paths: Mapping[str, PathResult], points: Mapping[str, PointCurve]) -> Figure:
    """Figs. 5 and 4: k_fs along the path at gamma = 0, and at P over gamma."""
    with house_style():
        figure, (left, right) = new_figure((10.0, 4.2), 1, 2)
        for name, result in paths.items():
            if np.isfinite(result.error):
                left.plot(result.x_mm, result.k, color=colour(name), label=name, linewidth=1.6)
        left.plot(TABLE_4[:, 0], TABLE_4[:, 1], "o", color=INK, label="Table 4", markersize=6)
        left.set(xlabel="x on the path, mm", ylabel="k_fs, N/mm", title="Path P1 to P2, gamma = 0")
        left.legend(frameon=False)
        for name, curve in points.items():
            right.plot(GAMMA_DEG, curve.k, color=colour(name), label=name, linewidth=1.6)
        for gamma, word in ((8.0, "8"), (59.0, "59")):
            right.axvline(gamma, color=INK, linestyle=":", linewidth=1.0)
            right.annotate(word, (gamma, 1.0), xycoords=("data", "axes fraction"), ha="center", va="bottom", fontsize=8)
        right.set(xlabel="gamma, deg", ylabel="k_fs, N/mm", xticks=np.arange(-180, 181, 60))
        right.set_title("Point P; dotted: the paper's range of rise", pad=16)
        right.legend(frameon=False, ncols=2)
    return figure


def scatter(study: ForceStudy, rng: np.random.Generator) -> Figure:
    """Fig. 3: displacement under (200, 200, 200) N against three indices."""
    few = rng.choice(len(study.d_mm), 1200, replace=False)
    with house_style():
        figure, axes = new_figure((10.0, 3.7), 1, 3, sharey=True)
        for ax, name in zip(axes, ("k_fs", "nspi", "rayleigh"), strict=True):
            ax.loglog(study.values[name][few], study.d_mm[few], ".", color=colour("A0"), markersize=3, alpha=0.5)
            rank = study.correlations[name].length
            ax.set(xlabel=f"{name}, N/mm", title=f"rank correlation {rank:.2f}")
            for axis in (ax.xaxis, ax.yaxis):
                # The style draws no formulas, so no powers of ten.
                axis.set_major_formatter(StrMethodFormatter("{x:g}"))
                axis.set_minor_formatter(NullFormatter())
        axes[0].set_ylabel("displacement, mm")
    return figure


def _map(ax: Axes, plane: PlaneResult, values: Array, norm: Normalize) -> None:
    y_mm, x_mm = (axis.values for axis in plane.grid.axes)
    ax.set_facecolor(NOTHING)
    ax.patch.set(hatch=HATCH, edgecolor=HATCH_INK)
    ax.grid(visible=False)
    ax.pcolormesh(x_mm, y_mm, values, cmap=STIFFNESS_COLOURS, norm=norm, shading="nearest", rasterized=True)
    ax.set(aspect="equal", xticks=(-500, 0, 500), yticks=(600, 1000, 1400))


def maps(planes: Mapping[str, PlaneResult]) -> Figure:
    """Fig. 10: the plane at some gamma, a row a reading with a scale of its own, and the best gamma at each point."""
    columns = [int(np.flatnonzero(g == PLANE_GAMMA_DEG)[0]) for g in MAP_GAMMA_DEG]
    with house_style():
        figure, axes = new_figure((12.0, 9.6), len(planes), len(columns) + 1, sharex=True, sharey=True)
        rows = np.array(axes).reshape(len(planes), -1)
        for row, (name, plane) in zip(rows, planes.items(), strict=True):
            best = 1e-3 * plane.found.best_at_points().value.reshape(plane.grid.shape)
            shown = [*(plane.k[c] for c in columns), best]
            known = np.concatenate([values[np.isfinite(values)] for values in shown])
            look = look_of("k_fs", Field(known, "N/mm", "k_fs"))
            for ax, values in zip(row, shown, strict=True):
                _map(ax, plane, values, look.norm)
            look_bar(figure, look, axes=list(row))
            row[0].set_ylabel(f"{name}\ny (mm)")
        for ax, gamma in zip(rows[0], MAP_GAMMA_DEG, strict=False):
            ax.set_title(f"gamma = {gamma:.0f} deg")
        rows[0, -1].set_title("best of each point")
        for ax in rows[-1]:
            ax.set_xlabel("x (mm)")
        nothing = Patch(facecolor=NOTHING, edgecolor=HATCH_INK, hatch=HATCH, label="no posture within reach and limits")
        figure.legend(handles=[nothing], loc="outside lower left")
    return figure


def statistics(planes: Mapping[str, PlaneResult]) -> Figure:
    """Fig. 11: mean, standard deviation, peak to valley against gamma, over both sets of points."""
    names = {"mean": "mean", "std": "standard deviation", "pv": "peak to valley"}
    said = {
        "mean": "paper: largest at the dotted line",
        "std": "paper: varies little",
        "pv": "paper: like the mean; grey: against it",
    }
    with house_style():
        figure, axes = new_figure((12.0, 6.6), 2, 3, sharex=True)
        for row, over in enumerate(("reached", "common")):
            for ax, key in zip(axes[3 * row : 3 * row + 3], names, strict=True):
                drawn = [plane.statistics(over)[key] for plane in planes.values()]  # type: ignore[arg-type]
                for name, values in zip(planes, drawn, strict=True):
                    ax.plot(PLANE_GAMMA_DEG, values, "o-", color=colour(name), label=name, markersize=3)
                known = np.concatenate(drawn)
                ax.set_xticks(np.arange(0, 181, 30))
                ax.set_title(f"{names[key]}\n({said[key]})" if row == 0 else names[key])
                if key != "mean":
                    ax.set_yscale("log")
                    ax.set_ylim(0.85 * known.min(), 1.18 * known.max())
                    log_ticks(ax.yaxis, lambda v: f"{v:g}")
                if key == "mean":
                    ax.axvline(60.0, color=INK, linestyle=":", linewidth=1.0)
                if key == "pv":
                    ax.axvspan(15.0, 45.0, color="#ECECEC", zorder=0)
            words = "each gamma over\nthe points it reaches" if row == 0 else "points that\nevery gamma reaches"
            axes[3 * row].set_ylabel(f"{words}\nk_fs (N/mm)")
        for ax in axes[3:]:
            ax.set_xlabel("gamma (deg)")
        figure.legend(handles=axes[0].get_legend_handles_labels()[0], loc="outside lower left", ncols=len(planes))
    return figure
