"""Figures of what readings determine: intervals of the numbers, their correlations, and singular directions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from doe.certainty.uncertainty import ParameterEstimate
from robots import InputError
from robots.arrays import Array
from stiffarm.commands.calibrate.words import interval_text, known, shown_unit, value_text
from stiffarm.pages.figure_parts import log_ticks, note, title
from stiffarm.pages.style import INK, OKABE_ITO, house_style, new_figure

_COLOURS: Final = {
    "determined": OKABE_ITO["blue"],
    "one-sided": OKABE_ITO["orange"],
    "at bound": OKABE_ITO["vermillion"],
    "not identified": "#8A8F96",
}
# With more numbers than this, cells are too small to write in.
_WRITE_UP_TO: Final = 12


def intervals_figure(estimates: Sequence[ParameterEstimate]) -> Figure:
    """Draw 95 % intervals, a panel for each unit: logarithmic for positive numbers, open ends as arrows.

    A number at its bound or not identified has no marker, for its value means nothing.

    Raises
    ------
    InputError
        No estimates.
    """
    if not estimates:
        raise InputError("intervals figure: no estimates to draw")
    groups: dict[tuple[str, bool], list[ParameterEstimate]] = {}
    for e in estimates:
        groups.setdefault((shown_unit(e.parameter)[1], e.parameter.scale != "linear"), []).append(e)
    rows = [len(g) for g in groups.values()]
    ratios: dict[str, Any] = {"gridspec_kw": {"height_ratios": [n + 1.2 for n in rows]}}
    with house_style():
        height = 0.8 + 0.36 * sum(rows) + 0.75 * len(rows)
        figure, axes = new_figure((10.0, height), len(groups), 1, **ratios)
        for ax, ((unit, log), group) in zip(axes, groups.items(), strict=True):
            _panel(ax, group, unit, log=log)
        title(figure, "95 % intervals; an arrow: the readings set no limit on that side")
    return figure


def _panel(ax: Axes, group: list[ParameterEstimate], unit: str, *, log: bool) -> None:
    factor = shown_unit(group[0].parameter)[0]
    ends = _ends(group, factor, log=log)
    if log:
        ax.set_xscale("log")
    ax.set_xlim(*ends)
    if log:
        log_ticks(ax.xaxis, lambda v: f"{v:g}")
    for row, e in enumerate(group):
        colour = _COLOURS[e.status]
        low, high = (v * factor for v in e.interval)
        if not math.isnan(low):
            _bar(ax, row, (low, high), ends, colour, log=log)
        if known(e):
            ax.plot(e.value * factor, row, "o", color=colour, markersize=7, markeredgecolor="white")
        text = value_text(e) if e.status == "not identified" else f"{value_text(e)}  ({interval_text(e)})"
        note(ax, text, (1.01, row), xycoords=("axes fraction", "data"), ha="left", color=colour)
    ax.set_yticks(range(len(group)), [e.parameter.name for e in group])
    ax.set_ylim(len(group) - 0.4, -0.6)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel(unit, labelpad=1)


def _bar(
    ax: Axes, row: int, interval: tuple[float, float], ends: tuple[float, float], colour: str, *, log: bool
) -> None:
    low, high = interval
    below, beyond = low <= (0.0 if log else -math.inf), math.isinf(high)
    inner = (ends[0] if below else low, ends[1] if beyond else high)
    ax.hlines(row, *inner, color=colour, linewidth=2.2)
    for is_open, tip, other, end in ((below, ends[0], inner[1], low), (beyond, ends[1], inner[0], high)):
        if is_open:
            look = {"arrowstyle": "-|>", "color": colour, "linewidth": 2.2, "shrinkA": 0, "shrinkB": 0}
            ax.annotate("", (tip, row), (other, row), annotation_clip=False, arrowprops=look)
        else:
            ax.plot(end, row, marker="|", color=colour, markersize=9, markeredgewidth=2.0)


def _ends(group: list[ParameterEstimate], factor: float, *, log: bool) -> tuple[float, float]:
    """Ends of the axis: what is known, and some room."""
    values = [v * factor for e in group for v in (*e.interval, e.value if known(e) else math.nan) if math.isfinite(v)]
    if log:
        values = [v for v in values if v > 0.0]
        return (min(values) / 1.8, max(values) * 1.8) if values else (0.1, 10.0)
    if not values:
        return -1.0, 1.0
    room = 0.12 * max(max(values) - min(values), 1e-12)
    return min(values) - room, max(values) + room


def determination_figure(names: Sequence[str], correlation: Array, singular: Array, directions: Array) -> Figure:
    """Draw the correlations (k, k) of k numbers and the singular directions (k, k; rows) with their values (k,).

    Raises
    ------
    InputError
        No names, or arrays of other sizes.
    """
    k = len(names)
    if k == 0 or correlation.shape != (k, k) or directions.shape[1:] != (k,) or len(singular) != len(directions):
        raise InputError("determination figure", value=f"{k} names", allowed="arrays of their number")
    with house_style():
        figure, (left, right) = new_figure((11.0, min(2.2 + 0.42 * k, 11.0)), 1, 2)
        _cells(left, correlation, list(names), list(names))
        left.set_title("correlation of the estimates (bounds ignored)", loc="left")
        strength = singular / max(float(singular.max(initial=0.0)), 1e-300)
        _cells(right, directions, [f"{s:.2g}" for s in strength], list(names))
        right.set_title("combinations told, best first", loc="left")
        right.set_ylabel("singular value, relative")
    return figure


def _cells(ax: Axes, values: Array, rows: list[str], columns: list[str]) -> None:
    image = ax.imshow(values, cmap=mpl.colormaps["RdBu_r"], norm=Normalize(-1.0, 1.0), aspect="auto")
    ax.figure.colorbar(image, ax=ax, shrink=0.85, pad=0.02)
    ax.set_xticks(range(len(columns)), columns, rotation=60, ha="right", rotation_mode="anchor")
    ax.set_yticks(range(len(rows)), rows)
    ax.grid(visible=False)
    ax.tick_params(length=0)
    if len(columns) <= _WRITE_UP_TO:
        for (i, j), v in np.ndenumerate(values):
            if abs(v) >= 0.05:
                text = f"{v:.2f}".replace("-", "−")
                ax.text(j, i, text, ha="center", va="center", size=8, color="white" if abs(v) > 0.6 else INK)
