"""Figures of the laws that a diagnosis found, with their uncertainty. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robots import InputError
from stiffarm.commands.diagnose.effect_numbers import Number
from stiffarm.commands.diagnose.laws import LawCurve
from stiffarm.pages.figure_parts import above, log_ticks, note, title
from stiffarm.pages.style import FAINT, INK, OKABE_ITO, house_style, new_figure

_UP: Final = OKABE_ITO["blue"]
_DOWN: Final = OKABE_ITO["vermillion"]
_MANY: Final = 200
# Single readings at small torques may imply wild turns; the axis keeps to these quantiles of them.
_KEPT: Final = (1.0, 99.0)


def law_figure(curve: LawCurve, heading: str) -> Figure:
    """Draw a joint's law with its 95 % band, the spring without it, and what single readings imply.

    Over the torque: the turn; for friction the loop of loading and unloading. Over the angle: the compliance.
    """
    with house_style():
        figure, (ax,) = new_figure((8.4, 5.0))
        names = ("loading", "unloading") if len(curve.branches) > 1 else ("law found",)
        for (x, y, low, high), colour, name in zip(curve.branches, (_UP, _DOWN), names, strict=False):
            ax.fill_between(x, low, high, color=colour, alpha=0.18, linewidth=0)
            ax.plot(x, y, color=colour, linewidth=2.4, label=name)
        ax.plot(curve.branches[0][0], curve.plain, color=INK, linestyle="--", linewidth=1.2, label="its spring alone")
        size = 8 if len(curve.read_x) > _MANY else 20
        look: dict[str, Any] = {"s": size, "alpha": 0.45, "linewidths": 0, "zorder": 1.5}
        for side, colour, name in (
            (~curve.unloading, _UP, "readings"),
            (curve.unloading, _DOWN, "readings, unloading"),
        ):
            if side.any():
                ax.scatter(curve.read_x[side], curve.read_y[side], color=colour, label=name, **look)
        _limits(ax, curve)
        if curve.axis == "torque":
            ax.set_xlabel(f"torque about {curve.joint} under the load (N m)")
            ax.set_ylabel(f"turn of {curve.joint} (mrad)")
        else:
            ax.set_xlabel(f"angle of {curve.joint} (deg)")
            ax.set_ylabel(f"compliance of {curve.joint} (µrad/(N m))")
        above(ax, ax.get_legend_handles_labels()[0], 5)
        title(figure, heading)
    return figure


def _limits(ax: Axes, curve: LawCurve) -> None:
    values = [np.concatenate([low, high]) for _, _, low, high in curve.branches]
    ends = [curve.plain, *values]
    if curve.read_y.size:
        ends.append(np.percentile(curve.read_y, _KEPT))
    flat = np.concatenate(ends)
    low, high = float(np.nanmin(flat)), float(np.nanmax(flat))
    if curve.axis == "angle":
        low = min(low, 0.0) if low < 0.3 * high else low
    room = 0.06 * max(high - low, 1e-9)
    ax.set_ylim(low - room, high + room)


def numbers_figure(numbers: Sequence[Number]) -> Figure:
    """Draw each number with its 95 % interval over the range that was thought plausible, a panel each.

    Raises
    ------
    InputError
        No number that can be drawn.
    """
    shown = [n for n in numbers if np.isfinite(n.value)]
    if not shown:
        raise InputError("numbers figure: no number to draw")
    with house_style():
        figure, axes = new_figure((9.0, 0.9 + 1.15 * len(shown)), len(shown), 1)
        for ax, n in zip(axes, shown, strict=True):
            _number(ax, n)
        title(figure, "Numbers found, with 95 % intervals; grey: what was thought plausible")
    return figure


def _number(ax: Axes, n: Number) -> None:
    low, high = n.plausible
    ranges = [(-high, -low), (low, high)] if n.signed else [(low, high)]
    points = [n.value, *(v for one in ranges for v in one), *(v for v in (n.low, n.high) if v is not None)]
    finite = np.array([v for v in points if np.isfinite(v)])
    for a, b in ranges:
        ax.axvspan(a, b, color=FAINT, alpha=0.45, linewidth=0)
    left, right = float(finite.min()), float(finite.max())
    log = not n.signed and left > 0.0 and right > 8.0 * left
    if log:
        ax.set_xscale("log")
        edges = left / 1.3, right * 1.3
    else:
        edges = left - 0.08 * (right - left), right + 0.08 * (right - left)
    ax.set_xlim(*edges)
    if n.low is not None and n.high is not None:
        ends = [max(n.low, edges[0]), min(n.high, edges[1])]
        ax.plot(ends, [0.0, 0.0], color=_UP, linewidth=2.6, solid_capstyle="butt")
        if n.high > edges[1]:
            ax.plot(edges[1], 0.0, ">", color=_UP, markersize=8, clip_on=False)
    ax.plot(n.value, 0.0, "o", color=_UP, markersize=9, markeredgecolor="white", zorder=3)
    note(ax, _text(n.value), (n.value, 0.0), (0, 9), va="bottom", weight="bold")
    if log:
        log_ticks(ax.xaxis)
    ax.set_ylim(-0.6, 1.1)
    ax.set_yticks([])
    ax.grid(visible=False, axis="y")
    ax.spines["left"].set_visible(False)
    unit = "" if n.unit == "1" else f" ({n.unit})"
    ax.set_xlabel(f"{n.code}: {n.name}{unit}")


def _text(value: float) -> str:
    return f"{value:.3g}".replace("e+0", "e").replace("e-0", "e-").replace("-", "−")
