"""Figures of the surrogate: main effects of the angles, and errors on held-out runs. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullLocator

from robots.arrays import Array
from stiffarm.pages.figure_parts import LINES, SERIES, above, angle_label, drawing, log_ticks, note
from stiffarm.pages.style import FAINT, OKABE_ITO
from surrogate.main_effects import MainEffect

# A surrogate whose largest error is below this part of the others' is not drawn beside them.
_FAR_BELOW: Final = 1e-5


@dataclass(frozen=True, eq=False)
class HeldOut:
    """A surrogate on runs kept out of its fit: true and predicted stiffness, (n,) N/mm.

    ``of_compliance``: errors are those of the reciprocal, as a surrogate of the compliance is judged. False: the two
    arrays hold the quantity itself, in a unit that the figure is told.
    """

    name: str
    true_N_per_mm: Array  # noqa: N815 - units are written as the shop writes them
    predicted_N_per_mm: Array  # noqa: N815
    of_compliance: bool = True

    @property
    def relative_error(self) -> Array:
        """``|predicted / true - 1|`` of the quantity fitted (n,), 1 and not %, as in ``ErrorFigures``."""
        true, found = self.true_N_per_mm, self.predicted_N_per_mm
        return np.asarray(np.abs(true / found - 1.0 if self.of_compliance else found / true - 1.0))


def main_effects_figure(effects: Mapping[str, MainEffect | tuple[Array, Array, Array, Array]]) -> Figure:
    """Draw smallest, mean and largest normalised stiffness against the levels of each angle (deg).

    ``effects``: from :func:`surrogate.main_effects.main_effects`.
    """
    looks = (("min", 1, "blue", "v"), ("mean", 2, "green", "o"), ("max", 3, "vermillion", "^"))
    heading = "Main effects of the joint angles on the stiffness"
    with drawing(heading, (10.0, 4.2), 1, len(effects), sharey=True) as (figure, axes):
        for ax, (name, effect) in zip(axes, effects.items(), strict=True):
            levels = effect[0]
            ax.fill_between(levels, effect[1], effect[3], color=FAINT, alpha=0.25, linewidth=0)
            heights = _spread([float(effect[column][-1]) for _, column, _, _ in looks])
            for (label, column, colour, marker), height in zip(looks, heights, strict=True):
                look: dict[str, Any] = {"color": OKABE_ITO[colour]}
                ax.plot(levels, effect[column], marker=marker, markersize=7, **look)
                note(ax, label, (float(levels[-1]), height), (7, 0), ha="left", weight="bold", size=9.5, **look)
            ax.set_xticks(levels, [f"{v:g}".replace("-", "−") for v in levels])
            ax.set_xlabel(angle_label(name))
            span = max(float(np.ptp(levels)), 1.0)
            ax.set_xlim(levels[0] - 0.1 * span, levels[-1] + 0.36 * span)
        axes[0].set(ylabel="structural stiffness / its maximum (–)", ylim=(0.0, 1.06))
    return figure


def _spread(values: Sequence[float]) -> list[float]:
    """Heights for labels at ascending values, pushed up so that none overlaps the axis or another."""
    out = [max(values[0], 0.02)]
    for value in values[1:]:
        out.append(max(value, out[-1] + 0.055))
    return out


def surrogate_quality_figure(
    rows: Sequence[HeldOut], what: str = "stiffness (N/mm)", error_of: str = "compliance"
) -> Figure:
    """Draw predicted against true stiffness (N/mm) on held-out runs, and how large the errors are.

    ``what``, ``error_of``: another quantity with its unit, and what the errors are of. The panel of errors tells
    which share of the runs has a larger relative error than x (both axes log), with marks at the RMS, at 95 % of the
    runs, and at the largest error.
    """
    every = np.concatenate([np.concatenate([r.true_N_per_mm, r.predicted_N_per_mm]) for r in rows])
    ends = (0.93 * float(every.min()), 1.07 * float(every.max()))
    cols = 2 if len(rows) in (2, 4) else min(3, len(rows))
    lines, height = -(-len(rows) // cols), 7.6 / cols + 0.7
    # Panels about as high as wide; a single one stands beside the errors.
    size = (10.0, lines * height + 4.0 if len(rows) > 1 else 4.6)
    with drawing("Surrogates on runs that were kept out of the fit", size, rows=0) as (figure, _):
        figure.set_layout_engine("constrained")
        if len(rows) > 1:
            grid = figure.add_gridspec(lines + 1, cols, height_ratios=[*[height] * lines, 3.6])
        else:
            grid = figure.add_gridspec(1, 2, width_ratios=[1.0, 1.3])
        panels = [figure.add_subplot(grid[i // cols, i % cols]) for i in range(len(rows))]
        cells = [_parity(ax, row, ends, what) for ax, row in zip(panels, rows, strict=True)]
        most = max(10.0, *(float(np.max(np.asarray(cell.get_array()))) for cell in cells))
        for i, (ax, row, cell) in enumerate(zip(panels, rows, cells, strict=True)):
            cell.set_norm(LogNorm(1.0, most))
            ax.set_title(row.name, loc="left", color=SERIES[i % 6], weight="bold", size=10)
            if i % cols == 0:
                ax.set_ylabel(f"predicted {what}")
        bar = figure.colorbar(cells[0], ax=panels, aspect=30, pad=0.015, format="%g")
        bar.set_label("runs in a cell (–)")
        _tails(figure.add_subplot(grid[lines, :] if len(rows) > 1 else grid[0, 1]), rows, error_of)
    return figure


def _parity(ax: Axes, row: HeldOut, ends: tuple[float, float], what: str) -> PolyCollection:
    low, high = (float(v) for v in np.log10(ends))
    # The palest blues are left out: a cell with a single run must be seen on white.
    look: dict[str, Any] = {"cmap": ListedColormap(colormaps["Blues"](np.linspace(0.3, 1.0, 256)))}
    look |= {"gridsize": 42, "mincnt": 1, "linewidths": 0.1, "extent": (low, high, low, high)}
    cells = ax.hexbin(row.true_N_per_mm, row.predicted_N_per_mm, xscale="log", yscale="log", **look)
    ax.plot(ends, ends, color=OKABE_ITO["vermillion"], linewidth=0.9)
    ax.set(xlim=ends, ylim=ends)
    for axis in (ax.xaxis, ax.yaxis):
        log_ticks(axis, lambda v: f"{v:g}")
    ax.set_xlabel(f"true {what}")
    return cells


def series_look(number: int) -> dict[str, Any]:
    """Colour and dash of a surrogate by its number, the same in every figure."""
    return {"color": SERIES[number % len(SERIES)], "linestyle": LINES[number % len(LINES)]}


def exceedance(ax: Axes, values: Array, number: int, label: str) -> Line2D:
    """Draw which share of the values (n,) is at least x, on a logarithmic axis of shares in percent.

    ``number``: of the series, by which it has its colour and dash.
    """
    shares = 1.0 - np.arange(len(values)) / len(values)
    (line,) = ax.plot(np.sort(values), shares, label=label, **series_look(number))
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: percent_label(float(v))))
    ax.yaxis.set_minor_locator(NullLocator())
    return line


def _tails(ax: Axes, rows: Sequence[HeldOut], error_of: str) -> None:
    """Share of the runs with a larger error. A surrogate that is exact by comparison is only named."""
    largest = max(float(row.relative_error.max()) for row in rows)
    ax.set_xscale("log")
    shown = [row for row in rows if row.relative_error.max() > _FAR_BELOW * largest] or list(rows)
    lines: list[Any] = []
    for i, row in enumerate(rows):
        error = row.relative_error
        marks = {"RMS": np.sqrt(np.mean(error**2)), "95 %": np.quantile(error, 0.95), "max": error.max()}
        text = f"{row.name}: " + ", ".join(f"{key} {percent_label(float(value))}" for key, value in marks.items())
        if row not in shown:
            lines += ax.plot([], [], label=f"{text} (left of the axis)", **series_look(i))
            continue
        lines.append(exceedance(ax, error, i, text))
        # The largest stands at the end of the curve, also where several runs share it.
        heights = [np.mean(error >= marks["RMS"]), np.mean(error >= marks["95 %"]), 1.0 / len(error)]
        for marker, value, at in zip("osD", marks.values(), heights, strict=True):
            look: dict[str, Any] = {"markersize": 8, "markeredgecolor": "white", "zorder": 4}
            ax.plot(value, at, marker, color=SERIES[i % 6], **look)
    names = ("RMS", "95 % of the runs are below", "largest")
    keys = [ax.plot([], [], m, color="#777777", label=n)[0] for m, n in zip("osD", names, strict=True)]
    middle = min(float(np.median(row.relative_error)) for row in shown)
    ax.set(
        xlim=(max(0.02 * middle, 1e-17), 2.0 * max(largest, 1e-16)),
        ylim=(0.5 / max(len(row.true_N_per_mm) for row in rows), 1.4),
    )
    ax.xaxis.set_major_formatter(FuncFormatter(lambda v, _: percent_label(float(v))))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set(xlabel=f"relative error of the {error_of} (%)", ylabel="runs with a larger error (%)")
    # The layout leaves room for the last legend only, so the one inside comes first.
    ax.add_artist(ax.legend(handles=keys, loc="lower left", borderaxespad=0.6))
    above(ax, lines, 1)


def percent_label(value: float) -> str:
    """A relative error as a label of an axis, in percent."""
    return f"{100.0 * value:.0f} %" if value >= 0.1 else f"{float(f'{100.0 * value:.2g}'):g} %"
