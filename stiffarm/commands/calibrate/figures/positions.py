"""Figures of a calibration from positions: how accurate before and after, by region, and the joints' error curves."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from doe.absolute.calibrate import Positions
from doe.absolute.identified import Curve
from doe.absolute.regions import Regions
from robots.arrays import Array
from stiffarm.pages.figure_parts import drawing
from stiffarm.pages.style import OKABE_ITO

_COLOURS: Final = ("vermillion", "blue", "green", "purple")
# Room beyond the largest of most readings; those beyond stand in the table.
_SHARE, _ROOM = 0.995, 1.3
# Squares in which the number of readings is written.
MOST_NUMBERS: Final = 60
_VIEWS: Final = ((0, 1, "from above"), (0, 2, "from the side"))


def accuracy_figure(c: Positions) -> Figure:
    """Share of readings that are nearer than a distance."""
    names = ("as described", "calibrated", "calibrated, left out")
    curves = dict(zip(names, c.distances().values(), strict=True))
    if c.holdout is not None:
        curves["held out"] = c.holdout[1].distance
    with drawing("How many readings are nearer than a distance", (10.0, 4.2), 1, 1) as (figure, axes):
        ax = axes[0]
        for (name, d), colour in zip(curves.items(), _COLOURS, strict=False):
            style = "--" if name != "as described" and "left out" in name else "-"
            ax.plot(
                1e3 * np.sort(d), 100.0 * np.arange(1, len(d) + 1) / len(d), style, color=OKABE_ITO[colour], label=name
            )
        ax.set_xlim(0.0, _ROOM * 1e3 * max(float(np.quantile(d, _SHARE)) for d in curves.values()))
        ax.set_ylim(0.0, 101.0)
        ax.set_xlabel("distance between read and predicted position (mm)")
        ax.set_ylabel("readings (%)")
        ax.legend(loc="lower right")
    return figure


def curves_figure(curves: tuple[Curve, ...]) -> Figure:
    """Each joint's error over its angle with its 95 % band, where it is identified."""
    size = (10.0, 0.8 + 1.9 * len(curves))
    with drawing("Error of each joint over its angle", size, len(curves), 1) as (figure, axes):
        for ax, one in zip(axes, curves, strict=True):
            angle = np.degrees(one.angle)
            error, half = (np.where(one.known, 1e3 * x, np.nan) for x in (one.error, one.half95))
            ax.fill_between(angle, error - half, error + half, color=OKABE_ITO["blue"], alpha=0.25, linewidth=0)
            ax.plot(angle, error, color=OKABE_ITO["blue"], linewidth=1.4)
            ax.axhline(0.0, color="0.5", linewidth=0.8)
            ax.set_ylabel(f"{one.joint} (mrad)")
            if one.is_known:
                ax.set_xlim(angle[one.known][0] - 2.0, angle[one.known][-1] + 2.0)
        axes[-1].set_xlabel("joint angle (deg)")
    return figure


def regions_figure(r: Regions) -> Figure:
    """RMS by column of regions, from above and from the side, before and for readings left out."""
    title = "How far off the arm is, by region of its workspace"
    with drawing(title, (10.0, 8.4), 2, 2) as (figure, axes):
        for k, (name, d) in enumerate((("as described", r.before), ("calibrated, poses left out", r.left_out))):
            views = [(a, b, view, _columns(r, d, a, b)) for a, b, view in _VIEWS]
            # One scale for both views of the same errors.
            most = 1e3 * max(float(np.nanmax(rms)) for *_, (_, _, rms, _) in views)
            for ax, (a, b, view, (x, y, rms, count)) in zip(axes[2 * k : 2 * k + 2], views, strict=True):
                shown = ax.pcolormesh(1e3 * x, 1e3 * y, 1e3 * rms.T, cmap="cividis", vmin=0.0, vmax=most)
                ax.set_aspect("equal")
                ax.set(xlabel=f"{'xyz'[a]} (mm)", ylabel=f"{'xyz'[b]} (mm)", title=f"{name}, {view}")
                figure.colorbar(shown, ax=ax, label="RMS (mm)", shrink=0.8)
                _write_counts(ax, x, y, 1e3 * rms / most, count)
    return figure


def _write_counts(ax: Axes, x: Array, y: Array, share: Array, count: Array) -> None:
    """Write how many readings a square has, where there is room for it."""
    if count.size > MOST_NUMBERS:
        return
    for i, j in np.argwhere(count > 0):
        middle = 500.0 * (x[i] + x[i + 1]), 500.0 * (y[j] + y[j + 1])
        ax.text(*middle, f"{count[i, j]:.0f}", ha="center", va="center", color="0.1" if share[i, j] > 0.6 else "1.0")


def _columns(r: Regions, d: Array, a: int, b: int) -> tuple[Array, Array, Array, Array]:
    """Edges (m), RMS (m) of readings over two axes, NaN where nothing was read, and how many they are."""
    place = np.floor(r.place[:, [a, b]] / r.edge).astype(np.int64)
    low, high = place.min(axis=0), place.max(axis=0) + 1
    edges = [r.edge * np.arange(low[i], high[i] + 1) for i in range(2)]
    row = (place[:, 0] - low[0]) * (high[1] - low[1]) + place[:, 1] - low[1]
    size = int(np.prod(high - low))
    count = np.bincount(row, minlength=size)
    square = np.bincount(row, d**2, minlength=size)
    rms = np.sqrt(np.where(count > 0, square / np.maximum(count, 1), np.nan))
    return edges[0], edges[1], rms.reshape(high - low), count.reshape(high - low)
