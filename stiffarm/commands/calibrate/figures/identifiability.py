"""Figure of what readings determine: intervals of the parameters."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from doe.certainty.uncertainty import ParameterEstimate
from robots import InputError
from stiffarm.commands.calibrate.words import estimate_text, known, shown_unit
from stiffarm.pages.figure_parts import MARKERS, SERIES, above, drawing, log_ticks, named_rows, note
from stiffarm.pages.style import FAINT, INK, OKABE_ITO

_COLOURS: Final = {
    "determined": OKABE_ITO["blue"],
    "one-sided": OKABE_ITO["orange"],
    "at bound": OKABE_ITO["vermillion"],
    "not identified": "#8A8F96",
}


def intervals_figure(
    rows: Mapping[str, Sequence[ParameterEstimate]],
    heading: str = "95 % intervals; an arrow: the readings set no limit on that side",
    expected: tuple[float, float] | None = None,
) -> Figure:
    """Draw 95 % intervals, a panel for each unit: logarithmic for positive numbers, open ends as arrows.

    A parameter at its bound has no marker, for its value means nothing; those without an interval share one line.

    Parameters
    ----------
    rows : name of a calibration -> its estimates; each of several has its colour, of a single one the status decides
    expected : shaded, the range in which joint springs were expected (N m/rad)

    Raises
    ------
    InputError
        No estimates.
    """
    groups: dict[tuple[str, bool], list[tuple[str, ParameterEstimate]]] = {}
    # Drawn is what any calibration says something of; the rest has nothing to be drawn.
    drawn = {e.parameter.name for some in rows.values() for e in some if _has_interval(e)}
    open_names = list(dict.fromkeys(e.parameter.name for some in rows.values() for e in some))
    open_names = [name for name in open_names if name not in drawn]
    for name, estimates in rows.items():
        for e in estimates:
            if e.parameter.name in drawn or not drawn:
                key = shown_unit(e.parameter)[1], e.parameter.scale != "linear"
                groups.setdefault(key, []).append((name, e))
    if not groups:
        raise InputError("intervals figure: no estimates to draw", code="B002")
    heights = [
        max(0.36, 0.24 * len(rows)) * len({e.parameter.name for _, e in group}) + 0.4 for group in groups.values()
    ]
    below = f"Not identified, so without an interval: {', '.join(open_names)}" if open_names and drawn else ""
    below = textwrap.fill(below, 115)
    size = (10.0, 0.8 + 0.25 * (len(rows) > 1) + 0.35 * len(groups) + sum(heights) + 0.2 * len(below.splitlines()))
    with drawing(heading, size, len(groups), 1, gridspec_kw={"height_ratios": heights}) as (figure, axes):
        if below:
            figure.supxlabel(below, x=0.01, ha="left", size=9.5)
        for ax, ((unit, log), group) in zip(axes, groups.items(), strict=True):
            _panel(ax, group, list(rows), expected, log=log)
            ax.set_xlabel(f"value ({unit})", labelpad=1)
        if len(rows) > 1:
            above(axes[0], axes[0].get_legend_handles_labels()[0], 3)
    return figure


def _has_interval(e: ParameterEstimate) -> bool:
    return known(e) or any(map(math.isfinite, e.interval))


def _panel(
    ax: Axes,
    group: Sequence[tuple[str, ParameterEstimate]],
    series: Sequence[str],
    expected: tuple[float, float] | None,
    *,
    log: bool,
) -> None:
    factor = shown_unit(group[0][1].parameter)[0]
    names = list(dict.fromkeys(e.parameter.name for _, e in group))
    springs = expected is not None and any(e.parameter.spring_of is not None for _, e in group)
    shaded = [end * factor for end in expected] if expected is not None and springs else []
    ends = _ends([e for _, e in group], factor, shaded, log=log)
    if shaded:
        ax.axvspan(*shaded, color=FAINT, alpha=0.3, linewidth=0, label="range expected")
    if log:
        ax.set_xscale("log")
    ax.set_xlim(*ends)
    if log:
        log_ticks(ax.xaxis, lambda v: f"{v:g}")
    for i, one in enumerate(series if len(series) > 1 else ()):
        ax.plot([], [], linewidth=2.2, label=one, color=SERIES[i % 6], marker=MARKERS[i % 6])
    for one, e in group:
        i = series.index(one)
        row = names.index(e.parameter.name) + (i - (len(series) - 1) / 2) * 0.76 / len(series)
        colour = SERIES[i % 6] if len(series) > 1 else _COLOURS[e.status]
        low, high = (v * factor for v in e.interval)
        if not math.isnan(low):
            _bar(ax, row, (low, high), ends, colour, log=log)
        if known(e):
            ax.plot(e.value * factor, row, MARKERS[i % 6], color=colour, markersize=7, markeredgecolor="white")
        note(ax, estimate_text(e), (1.01, row), xycoords=("axes fraction", "data"), ha="left", color=INK)
    named_rows(ax, names)


def _bar(
    ax: Axes, row: float, interval: tuple[float, float], ends: tuple[float, float], colour: str, *, log: bool
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


def _ends(
    group: Sequence[ParameterEstimate], factor: float, shaded: Sequence[float], *, log: bool
) -> tuple[float, float]:
    """Ends of the axis: what is known or ``shaded``, and some room."""
    values = [v * factor for e in group for v in (*e.interval, e.value if known(e) else math.nan) if math.isfinite(v)]
    values += shaded
    if log:
        values = [v for v in values if v > 0.0]
        return (min(values) / 1.8, max(values) * 1.8) if values else (0.1, 10.0)
    if not values:
        return -1.0, 1.0
    room = 0.12 * max(max(values) - min(values), 1e-12)
    return min(values) - room, max(values) + room
