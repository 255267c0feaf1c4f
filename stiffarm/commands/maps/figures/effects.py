"""Main effects in a joint sweep: a quantity against each swept coordinate, median and band. Data in, Figure out."""

from __future__ import annotations

import textwrap
from typing import Final, NamedTuple

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from robots import InputError
from robots.arrays import Array, Integers
from stiffarm.commands.maps.figures.slices import headings
from stiffarm.commands.maps.looks import Look
from stiffarm.pages.figure_parts import angle_label, drawing, log_ticks
from stiffarm.pages.style import OKABE_ITO
from surrogate.maps.data import MapData

# Ends of the band in %.
BAND: Final = (5.0, 95.0)


class SweptEffect(NamedTuple):
    """A quantity at each value of one coordinate, over all reached poses with it: (k,) each, NaN if none."""

    levels: Array
    low: Array
    median: Array
    high: Array
    poses: Integers


def swept_effects(data: MapData, name: str) -> dict[str, SweptEffect]:
    """Percentiles of a field at each value of each swept coordinate, by the coordinate's name.

    Raises
    ------
    InputError
        The map is no joint sweep.
    """
    if data.layout.kind != "joints":
        raise InputError("main effects of a map", code="B002", value=data.layout.kind, allowed="joints")
    values = np.where(np.asarray(data.reached), np.asarray(data.fields[name].values), np.nan).reshape(data.layout.shape)
    out = {}
    for i, axis in enumerate(data.layout.axes):
        by_level = np.moveaxis(values, i, 0).reshape(len(axis.values), -1)
        kept = [row[np.isfinite(row)] for row in by_level]
        figures = np.array(
            [np.percentile(row, [BAND[0], 50.0, BAND[1]]) if row.size else np.full(3, np.nan) for row in kept]
        )
        low, median, high = figures.T
        out[axis.name] = SweptEffect(axis.values, low, median, high, np.array([row.size for row in kept]))
    return out


def swept_effects_figure(data: MapData, look: Look, heading: str, facts: str = "") -> Figure:
    """Draw the median and the 5-95 % band of a quantity against each swept coordinate, on one scale.

    Raises
    ------
    InputError
        The map is no joint sweep.
    """
    effects = swept_effects(data, look.name)
    # One value is no sweep.
    shown = {name: effect for name, effect in effects.items() if len(effect.levels) > 1} or effects
    blue = OKABE_ITO["blue"]
    with drawing("", (max(2.6 * len(shown) + 0.8, 6.4), 4.0), 1, len(shown), sharey=True) as (figure, axes):
        for ax, (name, effect) in zip(axes, shown.items(), strict=True):
            band = ax.fill_between(effect.levels, effect.low, effect.high, color=blue, alpha=0.18, linewidth=0)
            marker = "o" if len(effect.levels) <= 40 else None
            (line,) = ax.plot(effect.levels, effect.median, color=blue, marker=marker, markersize=4)
            ax.set_xlabel(angle_label(name))
            ax.xaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 1.5, 2, 3, 4.5, 5, 6, 9, 10]))
        low = np.nanmin([np.nanmin(e.low) for e in shown.values()])
        high = np.nanmax([np.nanmax(e.high) for e in shown.values()])
        if isinstance(look.norm, LogNorm) and low > 0.0:
            axes[0].set(yscale="log", ylim=(0.9 * low, 1.1 * high))
            log_ticks(axes[0].yaxis, lambda v: f"{v:g}")
        elif low >= 0.0:
            axes[0].set_ylim(0.0, 1.05 * high)
        # A long label in one line would run into the title.
        axes[0].set_ylabel(textwrap.fill(look.axis_label, 32))
        figure.legend([line, band], ["median", "5 to 95 % of the poses"], loc="outside lower left", ncols=2)
        headings(figure, heading, facts)
    return figure
