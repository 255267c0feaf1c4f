"""Figure of how the answers of a surrogate are spread over the poses. Pure: data in, Figure out."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from robots.arrays import Array
from robots.quantities import significant
from stiffarm.pages.figure_parts import drawing, log_ticks
from stiffarm.pages.style import FAINT, INK


def spread_figure(values: Array, what: str) -> Figure:
    """Draw how many of n values, all above 0, lie where, with their median and quartiles; ``what``: axis label."""
    low, lower, middle, upper, high = np.quantile(values, (0.01, 0.25, 0.5, 0.75, 0.99))
    low, high = low / 1.2, 1.2 * high
    with drawing("What it answers over the poses", (5.2, 3.4)) as (figure, (ax,)):
        edges = np.geomspace(low, high, 41)
        ax.stairs(np.histogram(values, edges)[0], edges, color=FAINT, fill=True)
        ax.axvline(middle, color=INK, linewidth=1.6)
        for quarter in (lower, upper):
            ax.axvline(quarter, color=INK, linewidth=1.2, linestyle=":")
        ax.set_title(f"median {significant(middle)}", loc="left", size=10)
        ax.set(xscale="log", xlim=(low, high), xlabel=what, ylabel="poses", yticks=[])
        log_ticks(ax.xaxis, lambda v: significant(v, 2) if v >= 1000.0 else f"{v:g}")
    return figure
