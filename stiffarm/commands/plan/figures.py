"""Figure of a plan: what each parameter's interval will be, and what chance would have given."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from doe.certainty.uncertainty import ParameterEstimate
from doe.planning.plan import Foresight, MeasurementPlan
from robots.constants import NORMAL_95
from robots.quantities import significant
from stiffarm.commands.plan.words import factor95, is_open, quantity
from stiffarm.pages.figure_parts import above, drawing, log_ticks, named_rows, note
from stiffarm.pages.style import FAINT, INK, OKABE_ITO

Row = tuple[Foresight, ParameterEstimate | None]

_BEFORE, _AFTER, _RANDOM = FAINT, OKABE_ITO["blue"], OKABE_ITO["orange"]
# Intervals wider than this factor to either side are cut off, with an arrow.
_WIDEST = 30.0
_BAR_IN, _FRAME_IN = 0.62, 1.75
# From so many parameters on bars get thin and names one line; more than the second are left to plan.json.
_MANY, _MOST = 9, 24


def plan_figure(made: MeasurementPlan, found: Sequence[ParameterEstimate | None], robot: str) -> Figure:
    """Predicted 95 % intervals before and after (left), and the choice against random ones (right).

    The right half is left out for a plain design, which nobody chose.
    """
    rows: list[Row] = list(zip(made.foresight, found, strict=True))
    rows.sort(key=lambda row: not row[0].seen)
    left_out = max(0, len(rows) - _MOST)
    rows = rows[:_MOST]
    chosen = len(made.random) > 0
    height = max(3.8, _FRAME_IN + (_BAR_IN if len(rows) < _MANY else 0.55 * _BAR_IN) * len(rows))
    count = f"{len(made.q)} set-ups for {robot}"
    rest = f" ({left_out} more parameters in plan.json)" if left_out else ""
    heading = f"{count}: what they will tell" + (", and what chance would" if chosen else "") + rest
    widths = [1.5, 1.0] if chosen else [1.0]
    with drawing(heading, (11.0 if chosen else 7.0, height), 1, len(widths), width_ratios=widths) as (figure, axes):
        _intervals(axes[0], rows)
        if chosen:
            _against_chance(axes[1], made)
    return figure


def _intervals(ax: Axes, rows: Sequence[Row]) -> None:
    """Intervals as factors of the value planned for; of linear parameters as multiples of the interval before."""
    for y, (f, found) in enumerate(rows):
        before, after = _before(f, found), _ends(f, f.promised)
        _bar(ax, y - 0.17, *before, _BEFORE)
        _bar(ax, y + 0.17, *after, _AFTER if f.seen else _BEFORE)
        text = f"÷ {significant(f.promised_shrink, 2)}" if f.promised_shrink >= 1.05 else "perhaps no narrower"
        right, gap = (after[1], 5) if after[1] < _WIDEST else (_WIDEST, 11)
        note(
            ax,
            text if f.seen else "not seen",
            (right, y + 0.17),
            (gap, 0),
            ha="left",
            color=_AFTER if f.seen else INK,
        )
    ax.axvline(1.0, color="#888888", linewidth=0.9, zorder=1.5)
    ax.set(xscale="log", xlim=(1.0 / _WIDEST, _WIDEST))
    log_ticks(ax.xaxis, lambda v: f"{v:g}")
    ax.xaxis.set_minor_locator(NullLocator())
    named_rows(ax, [_name(f, len(rows) >= _MANY) for f, _ in rows])
    linear = any(f.parameter.scale == "linear" for f, _ in rows)
    ax.set_xlabel("95 % interval over the value planned for" + (" (offsets: over that before)" if linear else ""))
    handles = [
        Patch(facecolor=_BEFORE, label="before"),
        Patch(facecolor=_AFTER, label="after, predicted with lack of fit; ÷: times narrower"),
    ]
    above(ax, handles, 2)


def _before(f: Foresight, found: ParameterEstimate | None) -> tuple[float, float]:
    """Interval before, as a factor; one that the readings leave open ends nowhere on that side."""
    if found is None or not is_open(found) or f.parameter.scale == "linear" or math.isnan(found.interval[0]):
        return _ends(f, f.before)
    return found.interval[0] / f.planned_for, found.interval[1] / f.planned_for


def _ends(f: Foresight, sd: float) -> tuple[float, float]:
    if f.parameter.scale == "linear":
        # A shift has no ratio; its share of the interval before is drawn in the same way.
        factor = factor95(sd / f.before)
        return 1.0 / factor, factor
    factor = factor95(sd)
    return 1.0 / factor, factor


def _bar(ax: Axes, y: float, low: float, high: float, colour: str) -> None:
    left, right = max(low, 1.0 / _WIDEST), min(high, _WIDEST)
    # The edge keeps an interval in sight that is narrower than a pixel.
    ax.barh(y, right - left, 0.3, left, color=colour, edgecolor=colour, linewidth=1.2, zorder=2)
    # Arrow heads where the interval goes on.
    for end, cut, marker in ((left, low < left, "<"), (right, high > right, ">")):
        if cut:
            ax.plot(end, y, marker=marker, markersize=8, color=colour, clip_on=False, zorder=3)


def _name(f: Foresight, in_one_line: bool) -> str:
    p = f.parameter
    end = f"± {quantity(NORMAL_95 * f.promised, p.unit, 2)} after" if p.scale == "linear" else ""
    return f"{p.name}{' ' if in_one_line else chr(10)}{end or 'at ' + quantity(f.planned_for, p.unit, 2)}"


def _against_chance(ax: Axes, made: MeasurementPlan) -> None:
    """Typical standard deviation of random choices of 1, 2 ... set-ups, and of the one chosen."""
    n, m = len(made.q), np.arange(1, len(made.random) + 1)
    value = float(made.per_parameter(made.value))
    mixed = any(f.parameter.scale == "linear" for f in made.foresight)
    # Standard deviations in different units have no common one: they are shown over this plan's.
    scale = 1.0 if made.criterion == "I" else 1.0 / value if mixed and made.criterion == "D" else 100.0
    low, middle, high = (scale * made.per_parameter(column) for column in made.random.T)
    value *= scale
    ax.fill_between(m, low, high, color=_RANDOM, alpha=0.25, linewidth=0.0)
    ax.plot(m, middle, color=_RANDOM)
    ax.plot(n, value, "o", color=_AFTER, markersize=9, zorder=4)
    if made.random_needed is not None:
        ax.plot([n, made.random_needed], [value, value], color=_AFTER, linewidth=1.0, linestyle=(0, (4, 3)))
        ax.plot(made.random_needed, value, "o", markerfacecolor="white", markeredgecolor=_AFTER, markersize=7, zorder=4)
    ax.set_yscale("log")
    shown = slice(max(0, min(n, 3) - 1), None)
    ax.set_ylim(0.8 * min(value, float(low.min())), 1.15 * float(high[shown].max()))
    log_ticks(ax.yaxis, lambda v: f"{v:g}")
    if ax.get_ylim()[1] < 12.0 * ax.get_ylim()[0]:
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0)))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.set_xlim(0.0, len(m) + 1.0)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=8))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    ax.set_xlabel("set-ups")
    unit = "over this plan's" if mixed else "% of its value"
    ax.set_ylabel(
        {
            "D": f"standard deviation of a parameter\n(geometric mean, {unit})",
            "A": "standard deviation of a parameter\n(root mean square, % of the vague prior's)",
            "I": "standard deviation of a predicted deflection (mm)",
        }[made.criterion]
    )
    if len(made.foresight) >= _MANY:
        ax.set(box_aspect=1.0, anchor="N")
    handles = [
        Line2D([], [], color=_AFTER, marker="o", linestyle="", markersize=8, label="this plan"),
        Line2D([], [], color=_RANDOM, label="random, median and 80 %"),
    ]
    above(ax, handles, 2)
