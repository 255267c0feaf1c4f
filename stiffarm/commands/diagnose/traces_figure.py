"""Traces of the credible effects over the readings, their twins side by side."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from robots.arrays import Array
from robots.quantities import percent, significant
from stiffarm.commands.diagnose.traces import Row, Trace, Traces, widest
from stiffarm.pages.figure_parts import drawing
from stiffarm.pages.style import FAINT, INK, OKABE_ITO

_LEFT: Final[dict[str, Any]] = {"color": INK, "linestyle": "none", "marker": "o", "markersize": 2.4, "alpha": 0.55}
_OWN: Final[dict[str, Any]] = {"color": OKABE_ITO["vermillion"], "linewidth": 1.7}
_TWIN: Final[dict[str, Any]] = {"color": OKABE_ITO["blue"], "linewidth": 1.4, "linestyle": (0, (4, 1.2))}
_MOST_NAMES: Final = 12
# From this many readings on lines are thin.
_MANY: Final = 120


def traces_figure(of: Traces) -> Figure:
    """Draw a row for each effect: what springs leave of the readings, its trace, and those of its twins beside it."""
    columns = widest(of.rows)
    heading = "The trace of each credible effect over the readings" + ", its twins beside it" * (columns > 1)
    size = (10.0, 1.1 + 2.2 * len(of.rows))
    with drawing(heading, size, len(of.rows), columns, sharex=True, sharey="row") as (figure, axes):
        for k, row in enumerate(of.rows):
            mine = axes[columns * k : columns * (k + 1)]
            for ax in mine[1 + len(row.twins) :]:
                ax.set_axis_off()
            _panel(mine[0], of, row, row.own, f"{row.own.code}\n{percent(row.probability)} before its checks")
            for ax, twin in zip(mine[1:], row.twins, strict=False):
                _panel(ax, of, row, twin, f"twin {twin.code}\noff by {significant(twin.off, 2)} {of.unit}")
            mine[0].set_ylabel(f"change ({of.unit})")
            _limits(mine[0], row)
        handles = [
            Line2D(
                [],
                [],
                label="left over by springs" + " and what was found before" * any(r.given for r in of.rows),
                **{**_LEFT, "markersize": 5.0},
            ),
            Line2D([], [], label="trace of the effect", **_OWN),
        ]
        if columns > 1:
            handles.append(Line2D([], [], label="trace of a twin, as like as it can be made", **_TWIN))
        figure.legend(handles=handles, loc="outside lower left", ncols=3)
    return figure


def _panel(ax: Axes, of: Traces, row: Row, drawn: Trace, name: str) -> None:
    x = np.arange(len(of.pose))
    for k in _breaks(of.read):
        ax.axvline(k - 0.5, color=INK, linewidth=0.8)
    for k in _breaks(of.pose):
        ax.axvline(k - 0.5, color=FAINT, linewidth=0.4)
    ax.plot(x, row.left, zorder=1.5, **_LEFT)
    look = _OWN if drawn is row.own else _TWIN
    thin = {"linewidth": 1.0} if len(x) > _MANY else {}
    ax.step(x, drawn.values, where="mid", zorder=2, **{**look, **thin})
    ax.axhline(0.0, color=FAINT, linewidth=0.8, zorder=0.8)
    ax.set_title(name, loc="left", size=9.5)
    ax.grid(visible=False, axis="x")
    ax.set_xlim(-0.6, len(x) - 0.4)
    starts = [0, *_breaks(of.pose)]
    several = len(set(of.read)) > 1
    if several or len(starts) > _MOST_NAMES:
        # Which component each block is says more than the names of very many poses.
        blocks = [0, *_breaks(of.read)]
        ends = [*blocks[1:], len(x)]
        ax.set_xticks(
            [0.5 * (a + b - 1) for a, b in zip(blocks, ends, strict=True)], [f"{of.read[a]}, by pose" for a in blocks]
        )
    else:
        ends = [*starts[1:], len(x)]
        ax.set_xticks([0.5 * (a + b - 1) for a, b in zip(starts, ends, strict=True)], [of.pose[a] for a in starts])
        ax.set_xlabel("pose" if ax.get_subplotspec() is not None and _last(ax) else "")
    ax.tick_params(axis="x", length=0)


def _last(ax: Axes) -> bool:
    spec = ax.get_subplotspec()
    return spec is not None and spec.is_last_row()


def _breaks(labels: tuple[str, ...]) -> list[int]:
    """Where a label differs from the one before."""
    return [k for k in range(1, len(labels)) if labels[k] != labels[k - 1]]


def _limits(ax: Axes, row: Row) -> None:
    """Limits that hold the traces and all but the farthest readings."""
    values: list[Array] = [row.own.values, *(t.values for t in row.twins), np.percentile(row.left, [1.0, 99.0])]
    flat = np.concatenate(values)
    low, high = float(flat.min()), float(flat.max())
    room = 0.08 * max(high - low, 1e-12)
    ax.set_ylim(low - room, high + room)
