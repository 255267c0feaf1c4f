"""The pictures of docs/validation/kr60_indices.md: path and point, displacement against index, plane by gamma."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from kr60_claims import GAMMA_DEG, PLANE_GAMMA_DEG, ForceStudy, PathResult, PlaneResult, PointCurve
from kr60_readings import TABLE_4
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter, StrMethodFormatter

from robots.arrays import Array
from stiffarm.commands.maps.index.figures import HATCH, HATCH_INK, NOTHING
from stiffarm.commands.maps.looks import look_bar, look_of
from stiffarm.pages.figure_parts import log_ticks
from stiffarm.pages.style import INK, OKABE_ITO, STIFFNESS_COLOURS, house_style, new_figure
from surrogate.maps.data import Field

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
