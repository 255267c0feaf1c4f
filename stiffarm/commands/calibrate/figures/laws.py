"""Figure of estimated laws: springs over their angles with their bands. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robots import InputError
from stiffarm.commands.calibrate.laws import LawCurve
from stiffarm.pages.figure_parts import above, angle_label, log_ticks, title
from stiffarm.pages.style import INK, OKABE_ITO, house_style, new_figure

_BLUE: Final = OKABE_ITO["blue"]
# The axis shows the angles read and this much beyond; bands where nothing was read may be wide.
_ROOM: Final = 1.6
_LEAST_SPAN: Final = 3.0


def laws_figure(curves: Sequence[LawCurve]) -> Figure:
    """Draw each law's stiffness (N m/rad, log axis) over its first angle, with 95 % band and the angles read.

    Beyond the angles read the curve is dashed: extrapolation. A law of several angles has points only, one for each
    pose read.

    Raises
    ------
    InputError
        No laws.
    """
    if not curves:
        raise InputError("laws figure: no laws to draw")
    columns = min(2, len(curves))
    rows = -(-len(curves) // columns)
    with house_style():
        figure, axes = new_figure((10.0 if columns == 2 else 7.4, 0.8 + 3.7 * rows), rows, columns)
        for ax, curve in zip(axes, curves, strict=False):
            _panel(ax, curve)
        for ax in axes[len(curves) :]:
            ax.set_visible(False)
        title(figure, "Springs over their angles, with 95 % bands")
    return figure


def _panel(ax: Axes, curve: LawCurve) -> None:
    ax.set_yscale("log")
    read = curve.read
    many = len(curve.inputs) > 1
    if not many:
        inside = (curve.angle_deg >= curve.read_deg.min()) & (curve.angle_deg <= curve.read_deg.max())
        ax.fill_between(curve.angle_deg, curve.band.low, curve.band.high, color=_BLUE, alpha=0.14, linewidth=0)
        where = np.where(inside, curve.band.stiffness, np.nan)
        ax.plot(curve.angle_deg, where, color=_BLUE, linewidth=2.4, label="law")
        ax.plot(curve.angle_deg, curve.band.stiffness, color=_BLUE, linewidth=1.3, linestyle="--", label="extrapolated")
    known = np.isfinite(read.stiffness)
    spread = [(read.stiffness - read.low)[known], (read.high - read.stiffness)[known]]
    ax.errorbar(
        curve.read_deg[known], read.stiffness[known], spread if many else None, fmt="o", markersize=5.0, color=_BLUE,
        markerfacecolor=_BLUE if many else "white", linewidth=1.0, label="angles read",
    )  # fmt: skip
    if (~known).any():
        ax.plot(
            curve.read_deg[~known], np.full(int((~known).sum()), 0.03), "x", color=INK, label="not determined",
            transform=ax.get_xaxis_transform(),
        )  # fmt: skip
    _limits(ax, curve)
    ax.set_xlabel(angle_label(curve.inputs[0]))
    ax.set_ylabel("stiffness (N m/rad)")
    above(ax, ax.get_legend_handles_labels()[0], 4)
    also = f", also over {', '.join(n.removesuffix('_deg') for n in curve.inputs[1:])}" if many else ""
    ax.set_title(f"{curve.joint}: {curve.kind}{also}", loc="left", weight="bold", pad=24)


def _limits(ax: Axes, curve: LawCurve) -> None:
    """What is known at the angles read decides the axis, three times from end to end at least."""
    values = np.concatenate([curve.read.low, curve.read.high])
    values = values[np.isfinite(values) & (values > 0.0)]
    if not values.size:
        return
    low, high = values.min() / _ROOM, values.max() * _ROOM
    middle, half = np.sqrt(low * high), max(np.sqrt(high / low), np.sqrt(_LEAST_SPAN))
    ax.set_ylim(middle / half, middle * half)
    log_ticks(ax.yaxis)
