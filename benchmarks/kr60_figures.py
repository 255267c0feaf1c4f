"""The pictures of docs/kr60_indices.md: path and point, displacement against index, plane."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from kr60_claims import GAMMA_DEG, PLANE_GAMMA_DEG, ForceStudy, PathResult, PlaneResult, PointCurve
from kr60_readings import TABLE_4
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, StrMethodFormatter

from stiffarm.picture_style import INK, OKABE_ITO, STIFFNESS_COLOURS, house_style, new_figure

# Small files: the page shows them at this size.
DOTS_PER_INCH = 80
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


def _map(figure: Figure, ax: Axes, plane: PlaneResult, gamma: int, name: str, top: float) -> None:
    image = ax.pcolormesh(
        plane.x_mm, plane.y_mm, plane.k[gamma], cmap=STIFFNESS_COLOURS, vmin=300.0, vmax=top, shading="nearest"
    )
    ax.set(xlabel="x, mm", ylabel="y, mm", title=f"{name}, gamma = {PLANE_GAMMA_DEG[gamma]:.0f} deg", aspect="equal")
    figure.colorbar(image, ax=ax, extend="both", orientation="horizontal").set_label("k_fs, N/mm")


def plane(planes: Mapping[str, PlaneResult]) -> Figure:
    """Figs. 10 and 11: maps of two readings at gamma = 60, and the mean over the plane against gamma."""
    gamma = int(np.flatnonzero(PLANE_GAMMA_DEG == 60.0)[0])
    with house_style():
        figure, axes = new_figure((12.0, 4.2), 1, 3)
        for ax, name in zip(axes, ("A0", "B"), strict=False):
            _map(figure, ax, planes[name], gamma, name, 1000.0)
        for name, result in planes.items():
            axes[2].plot(
                PLANE_GAMMA_DEG, result.statistics()["mean"], "o-", color=colour(name), label=name, markersize=3
            )
        axes[2].axvline(60.0, color=INK, linestyle=":", linewidth=1.0)
        axes[2].set(xlabel="gamma, deg", ylabel="mean k_fs where reached, N/mm", xticks=np.arange(0, 181, 30))
        axes[2].set_title("Mean over the plane; dotted: paper")
        axes[2].legend(frameon=False, ncols=2)
    return figure
