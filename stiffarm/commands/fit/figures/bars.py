"""Figures of how honest a surrogate's error bars are, and of where its errors are large. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from scipy.stats import binned_statistic

from robots.arrays import Array
from robots.constants import NORMAL_95
from stiffarm.commands.fit.figures.effects import exceedance, percent_label, series_look
from stiffarm.pages.figure_parts import MARKERS, SERIES, above, angle_label, drawing, log_ticks, panels
from stiffarm.pages.style import FAINT, INK

LEVEL: Final = 0.95
PARTS: Final = 10
# Errors over half-widths beyond this are not drawn.
MOST_SHOWN: Final = 6.0
# Widths of an input's range that errors are gathered in, and the fewest runs that a 95th percentile is taken of.
_BINS = 18
_FEWEST = 20
_SMALLEST = 1e-17


@dataclass(frozen=True, eq=False)
class JudgedBars:
    """A surrogate on uniform runs kept out: size of its relative error and half-width of its 95 % bar, both (n,).

    ``colour``: number of its colour in ``SERIES``, the same in every figure.
    """

    name: str
    error: Array
    half_width: Array
    colour: int = 0

    @property
    def inside(self) -> float:
        """Share of the runs inside the bars."""
        return float(np.mean(self.error <= self.half_width))


@dataclass(frozen=True)
class Part:
    """Runs of like half-width: how many, their median half-width and error, and the share inside the bars."""

    runs: int
    half_width: float
    error: float
    inside: float


def parts(row: JudgedBars, count: int = PARTS) -> list[Part]:
    """The runs in equal parts, from the narrowest bars to the widest; fewer parts than ``count`` if runs are few."""
    order = np.argsort(row.half_width, kind="stable")
    out = []
    for i in np.array_split(order, min(count, len(order))):
        within = float(np.mean(row.error[i] <= row.half_width[i]))
        out.append(Part(len(i), float(np.median(row.half_width[i])), float(np.median(row.error[i])), within))
    return out


def chance(runs: int) -> float:
    """What chance makes of a true share of 95 % among so many runs: half-width of its own 95 % interval."""
    return float(NORMAL_95 * np.sqrt(LEVEL * (1.0 - LEVEL) / max(runs, 1)))


def error_bars_figure(rows: Sequence[JudgedBars]) -> Figure:
    """Draw the error over its bar as a distribution, and the share inside from narrow bars to wide ones."""
    heading = "Do the error bars hold? Runs that neither the fit nor the bars have seen"
    with drawing(heading, (10.0, 4.6), 1, 2) as (figure, (left, right)):
        _ratios(left, rows)
        _shares(right, rows)
    return figure


def _ratios(ax: Axes, rows: Sequence[JudgedBars]) -> None:
    ratios = [row.error / np.maximum(row.half_width, 1e-300) for row in rows]
    lines = [
        exceedance(ax, ratio, row.colour, f"{row.name}: {100.0 * row.inside:.1f} % inside")
        for row, ratio in zip(rows, ratios, strict=True)
    ]
    most = max(float(ratio.max()) for ratio in ratios)
    ax.set(xlim=(0.0, min(max(1.6, 1.05 * most), MOST_SHOWN)), ylim=(0.5 / max(len(row.error) for row in rows), 1.3))
    ax.axvline(1.0, color=INK, linewidth=0.9, linestyle=(0, (4, 3)))
    ax.axhline(1.0 - LEVEL, color=INK, linewidth=0.9, linestyle=(0, (4, 3)))
    ax.plot(1.0, 1.0 - LEVEL, "o", color=INK, markersize=5, zorder=4)
    ax.annotate("honest bars\npass here", (1.0, 1.0 - LEVEL), (10, 16), textcoords="offset points", size=9.0, ha="left")
    ax.set(xlabel="error / half-width of its 95 % bar (–)", ylabel="runs with a larger ratio (%)")
    above(ax, lines, 1)


def _shares(ax: Axes, rows: Sequence[JudgedBars]) -> None:
    count = min(PARTS, *(len(row.error) for row in rows))
    least = 1.0
    handles = []
    for i, row in enumerate(rows):
        found = [part.inside for part in parts(row, count)]
        least = min(least, *found)
        # Side by side: the points of several surrogates often lie on one another.
        x = np.arange(1, count + 1) + 0.12 * (i - 0.5 * (len(rows) - 1))
        look: dict[str, Any] = {"color": SERIES[row.colour % len(SERIES)], "marker": MARKERS[row.colour % len(MARKERS)]}
        handles += ax.plot(x, found, markersize=6, linewidth=1.2, label=row.name, **look)
    spread = chance(min(len(row.error) for row in rows) // count)
    band = ax.axhspan(LEVEL - spread, min(LEVEL + spread, 1.0), color=FAINT, alpha=0.35, linewidth=0)
    band.set_label("95 %, and what chance makes of it")
    ax.axhline(LEVEL, color=INK, linewidth=0.9)
    ax.set(ylim=(min(0.895, least - 0.015), 1.003), xlim=(0.5, count + 0.5))
    ticks = np.arange(1, count + 1)
    ax.set_xticks(ticks, [f"{t}" for t in ticks])
    ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{100.0 * v:g} %"))
    ax.set(xlabel="tenth of the runs, from the narrowest bars to the widest (–)", ylabel="inside the bars (%)")
    above(ax, [*handles, band], 2)


def error_over_inputs_figure(rows: Sequence[JudgedBars], inputs: Sequence[str], Q_deg: Array) -> Figure:
    """Draw median and 95th percentile of the relative error against each input; Q_deg (n, k)."""
    columns = 3 if len(inputs) in (3, 5, 6) else 2
    with panels("Where the error is large", len(inputs), columns, 10.0, 2.7, 1.0, sharey=True) as (figure, axes):
        for j, (ax, name) in enumerate(zip(axes, inputs, strict=True)):
            for row in rows:
                middle, median, high = gathered(Q_deg[:, j], row.error)
                look = series_look(row.colour)
                ax.fill_between(middle, median, high, color=look["color"], alpha=0.12, linewidth=0)
                ax.plot(middle, high, linewidth=2.4, label=f"{row.name}: 95 % of the runs are below", **look)
                ax.plot(middle, median, linewidth=1.1, label="its median", **look)
            ax.set(yscale="log", xlabel=angle_label(name))
            ax.locator_params(axis="x", nbins=7)
            if j % columns == 0:
                ax.set_ylabel("relative error (%)")
        # Shared by all panels.
        log_ticks(axes[0].yaxis, percent_label)
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2, handlelength=2.4)
    return figure


def gathered(x: Array, error: Array) -> tuple[Array, Array, Array]:
    """Middle, median error and 95th percentile in equal widths of an input's range; widths with few runs are left out.

    ``x``, ``error``: (n,).
    """
    edges = np.linspace(float(x.min()), float(x.max()), _BINS + 1)
    high = partial(np.quantile, q=0.95)
    count, median, most = (binned_statistic(x, error, of, edges)[0] for of in ("count", "median", high))
    kept = count >= _FEWEST
    middle = 0.5 * (edges[:-1] + edges[1:])[kept]
    return middle, np.maximum(median[kept], _SMALLEST), np.maximum(most[kept], _SMALLEST)
