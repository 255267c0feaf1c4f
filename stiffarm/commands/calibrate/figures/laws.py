"""Figure of laws: springs over their angles with bands and points. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from doe.calibration.laws import READ, LawCurve
from doe.certainty.uncertainty import LawBand
from robots import InputError
from robots.arrays import Array
from stiffarm.pages.figure_parts import angle_label, log_ticks, panels
from stiffarm.pages.style import INK, OKABE_ITO

_LAW: Final = OKABE_ITO["blue"]
# Marker, face and edge of a point by its origin, and what the legend calls it.
_POINTS: Final = {
    READ: ("o", "white", _LAW, READ),
    "calibrated": ("o", OKABE_ITO["vermillion"], OKABE_ITO["vermillion"], "calibrated"),
    "mirrored": ("o", "white", OKABE_ITO["vermillion"], "mirrored by symmetry"),
    "held": ("s", "#8A8F96", "#5A5F66", "held at its starting value"),
}
# Points that readings stand behind.
_OWN: Final = (READ, "calibrated")
# Curves of a law of two angles, told apart by their strokes.
_MOST_SLICES: Final = 3
_STYLES: Final = ("-", "--", ":")
# The axis shows the angles read and this much beyond; bands where nothing was read may be wide.
_ROOM: Final = 1.6
# A spring that varies little must not look wild.
_LEAST_SPAN: Final = 3.0
# Ends of intervals farther away than this leave the axis.
_FARTHEST: Final = 10.0


def laws_figure(curves: Sequence[LawCurve]) -> Figure:
    """Draw each law's stiffness (N m/rad, log axis) over its angle, with 95 % band and points.

    Of a law of two angles there is a curve over the one for each value that was read of the other: between these
    nothing is known. Beyond the angles read a curve is dashed: extrapolation. A law of more angles has points only.

    Raises
    ------
    InputError
        No laws.
    """
    if not curves:
        raise InputError("laws figure: no laws to draw", code="B002")
    heading = "Joint stiffness against the joint angles"
    with panels(heading, len(curves), 2, 10.0 if len(curves) > 1 else 7.4, 3.3, 0.9) as (figure, axes):
        for ax, curve in zip(axes, curves, strict=True):
            if len(curve.inputs) == 2:
                _slices(ax, curve)
            else:
                _curve(ax, curve)
        keys: dict[str, Any] = {}
        for ax in figure.axes:
            keys |= dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
        figure.legend(handles=list(keys.values()), loc="outside lower center", ncols=4)
    return figure


def _curve(ax: Axes, curve: LawCurve) -> None:
    """A law of one angle, or the points of one of many."""
    ax.set_yscale("log")
    read, first = curve.read, curve.read_deg[:, 0]
    angle = curve.angle_deg[:, 0]
    inside = (angle >= first.min()) & (angle <= first.max())
    within = np.where(inside, curve.band.stiffness, np.nan)
    if len(angle):
        ax.fill_between(angle, curve.band.low, curve.band.high, color=_LAW, alpha=0.14, linewidth=0)
        ax.plot(angle, within, color=_LAW, linewidth=2.4, label="law")
        if np.isfinite(curve.band.stiffness[~inside]).any():
            ax.plot(angle, curve.band.stiffness, color=_LAW, linewidth=1.3, linestyle="--", label="extrapolated")
    else:
        ax.vlines(first, read.low, read.high, color=_LAW, linewidth=1.0)
    _points(ax, curve, curve.read_deg[:, :1], read.stiffness)
    unknown = first[np.isnan(read.stiffness)]
    if unknown.size:
        look: dict[str, Any] = {"color": INK, "label": "not determined", "transform": ax.get_xaxis_transform()}
        ax.plot(unknown, np.full(len(unknown), 0.03), "x", **look)
    _limits(ax, np.concatenate([within, read.stiffness]), np.concatenate([read.low, read.high]))
    ax.set(xlabel=angle_label(curve.inputs[0]), ylabel="stiffness (N m/rad)")
    also = "" if len(angle) else f", also over {', '.join(n.removesuffix('_deg') for n in curve.inputs[1:])}"
    ax.set_title(f"{curve.joint}: {curve.kind}{also}", loc="left", weight="bold")


def _limits(ax: Axes, values: Array, ends: Array) -> None:
    """What is known between the angles read decides the axis, three times from end to end at least.

    ``ends`` of intervals count as far as they are not decades away.
    """
    values = values[np.isfinite(values) & (values > 0.0)]
    if not values.size:
        return
    ends = np.clip(ends[np.isfinite(ends)], values.min() / _FARTHEST, values.max() * _FARTHEST)
    values = np.concatenate([values, ends])
    low, high = values.min() / _ROOM, values.max() * _ROOM
    middle, half = np.sqrt(low * high), max(np.sqrt(high / low), np.sqrt(_LEAST_SPAN))
    ax.set_ylim(middle / half, middle * half)
    log_ticks(ax.yaxis)


def _points(ax: Any, curve: LawCurve, angle_deg: Array, height: Array) -> None:
    for origin, (marker, face, edge, label) in _POINTS.items():
        mine = np.array(curve.origin) == origin
        if mine.any():
            look = {"markerfacecolor": face, "markeredgecolor": edge, "markeredgewidth": 1.5, "markersize": 7.0}
            ax.plot(*angle_deg[mine].T, height[mine], marker, zorder=4, label=label, **look)
            if origin != READ:
                low, high = curve.read.low[mine], curve.read.high[mine]
                ax.vlines(*angle_deg[mine].T, low, high, color=edge, linewidth=1.2, zorder=3)


def _slices(ax: Axes, curve: LawCurve) -> None:
    """A law of two angles: over the one that was read at more values, a curve for each value read of the other."""
    ax.set_yscale("log")
    own = np.array([origin in _OWN for origin in curve.origin])
    own = own if own.any() else np.ones(len(own), dtype=np.bool_)
    counts = [len(np.unique(curve.read_deg[own, k])) for k in range(2)]
    along = int(np.argmax(counts))
    beside = 1 - along
    values = np.unique(curve.read_deg[own, beside])[:_MOST_SLICES]
    grid = np.unique(curve.angle_deg[:, beside])
    every, ends = [curve.read.stiffness], [curve.read.low, curve.read.high]
    for value, style in zip(values, _STYLES, strict=False):
        mine = curve.angle_deg[:, beside] == grid[np.argmin(np.abs(grid - value))]
        angle, law = curve.angle_deg[mine, along], curve.band.stiffness[mine]
        other = f"{angle_label(curve.inputs[beside]).replace(' (deg)', '')} = {value:g} deg".replace("-", "−")
        name = f"law, {other}" if len(values) > 1 else "law"
        read = curve.read_deg[own & (curve.read_deg[:, beside] == value), along]
        inside = (angle >= read.min()) & (angle <= read.max())
        ax.plot(angle, np.where(inside, law, np.nan), color=_LAW, linewidth=2.2, linestyle=style, label=name)
        if np.isfinite(curve.band.low[mine]).any():
            ax.fill_between(angle, curve.band.low[mine], curve.band.high[mine], color=_LAW, alpha=0.12, linewidth=0)
        every.append(law[inside])
    shown = np.isin(curve.read_deg[:, beside], values) | ~own
    read_here = LawBand(*(v[shown] for v in (curve.read.stiffness, curve.read.low, curve.read.high)))
    origins = tuple(o for o, s in zip(curve.origin, shown, strict=True) if s)
    some = replace(curve, origin=origins, read=read_here)
    _points(ax, some, curve.read_deg[shown][:, [along]], curve.read.stiffness[shown])
    _limits(ax, np.concatenate(every), np.concatenate(ends))
    ax.set(xlabel=angle_label(curve.inputs[along]), ylabel="stiffness (N m/rad)")
    at = f", {other}" if len(values) == 1 else ""
    ax.set_title(f"{curve.joint}: {curve.kind}{at}", loc="left", weight="bold")
