"""Figure of laws: springs over their angles with bands and points. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from robots import InputError
from robots.arrays import Array
from stiffarm.commands.calibrate.laws import READ, LawCurve
from stiffarm.pages.figure_parts import angle_label, log_ticks, panels, power_of_ten
from stiffarm.pages.style import INK, OKABE_ITO

_LAW: Final = OKABE_ITO["blue"]
# Marker, face and edge of a point by its origin, and what the legend calls it.
_POINTS: Final = {
    READ: ("o", "white", _LAW, READ),
    "calibrated": ("o", OKABE_ITO["vermillion"], OKABE_ITO["vermillion"], "calibrated"),
    "mirrored": ("o", "white", OKABE_ITO["vermillion"], "mirrored by symmetry"),
    "held": ("s", "#8A8F96", "#5A5F66", "held at its starting value"),
}
# The axis shows the angles read and this much beyond; bands where nothing was read may be wide.
_ROOM: Final = 1.6
# A spring that varies little must not look wild.
_LEAST_SPAN: Final = 3.0


def laws_figure(curves: Sequence[LawCurve]) -> Figure:
    """Draw each law's stiffness (N m/rad, log axis) over its one or two angles, with 95 % band and points.

    Beyond the angles read a curve is dashed: extrapolation. A law of more angles has points only, over the first.

    Raises
    ------
    InputError
        No laws.
    """
    if not curves:
        raise InputError("laws figure: no laws to draw")
    heading = "Joint stiffness against the joint angles"
    with panels(heading, len(curves), 2, 10.0 if len(curves) > 1 else 7.4, 3.9, 0.9) as (figure, axes):
        # Labels of axes in space hang over at the side.
        figure.set_layout_engine("constrained", w_pad=0.12, h_pad=0.06)
        for ax, curve in zip(axes, curves, strict=True):
            if len(curve.inputs) == 2:
                place = ax.get_subplotspec()
                ax.remove()
                _surface(figure.add_subplot(place, projection="3d"), curve)
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
    _limits(ax, np.concatenate([within, read.low, read.stiffness, read.high]))
    ax.set(xlabel=angle_label(curve.inputs[0]), ylabel="stiffness (N m/rad)")
    also = "" if len(angle) else f", also over {', '.join(n.removesuffix('_deg') for n in curve.inputs[1:])}"
    ax.set_title(f"{curve.joint}: {curve.kind}{also}", loc="left", weight="bold")


def _limits(ax: Axes, values: Array) -> None:
    """What is known between the angles read decides the axis, three times from end to end at least."""
    values = values[np.isfinite(values) & (values > 0.0)]
    if not values.size:
        return
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


def _surface(ax: Any, curve: LawCurve) -> None:
    """A law of two angles. 3-D axes know no log axis, so log10 k is drawn and the ticks are powers of ten."""
    side = round(np.sqrt(len(curve.angle_deg)))
    x, y = (column.reshape(side, side) for column in curve.angle_deg.T)
    log_k, points = np.log10(curve.band.stiffness).reshape(side, side), np.log10(curve.read.stiffness)
    ax.computed_zorder = False
    look = {"alpha": 0.55, "rcount": 20, "ccount": 20, "linewidth": 0.35, "edgecolor": "#00507D"}
    ax.plot_surface(x, y, log_k, color=_LAW, zorder=1, **look)
    ax.plot([], [], [], color=_LAW, linewidth=2.4, label="law")
    _points(ax, curve, curve.read_deg, points)
    every = np.concatenate([log_k.ravel(), points])
    low, high = np.floor(2.0 * np.nanmin(every)) / 2.0, np.ceil(2.0 * np.nanmax(every) + 1e-9) / 2.0
    ax.set_zlim(low, high)
    ax.set_zticks(np.arange(np.ceil(low), high + 0.01))
    ax.zaxis.set_major_formatter(FuncFormatter(lambda v, _: power_of_ten(10.0**v)))
    ax.set_xlabel(angle_label(curve.inputs[0]), labelpad=6)
    ax.set_ylabel(angle_label(curve.inputs[1]), labelpad=6)
    ax.set_zlabel("stiffness (N m/rad)", labelpad=1)
    ax.locator_params(axis="x", nbins=5)
    ax.locator_params(axis="y", nbins=5)
    ax.view_init(elev=24, azim=-58)
    ax.set_box_aspect((1.2, 1.0, 0.88), zoom=0.95)
    ax.set_title(f"{curve.joint}: {curve.kind}", loc="left", weight="bold")
