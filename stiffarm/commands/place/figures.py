"""Figures of a placement: the goal over base positions, stiffness and error along the path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from machining.placement import Along
from robots import InputError
from robots.arrays import Array
from stiffarm.commands.posture.figures.along_path import draw_line
from stiffarm.commands.posture.figures.axes_map import hatched, steps
from stiffarm.pages.figure_parts import SERIES, drawing, paler
from stiffarm.pages.style import FAINT, INK, OKABE_ITO, STIFFNESS_COLOURS

# Why a position cannot be taken, and how it is drawn.
ZONES = {
    "reach": ("out of reach", "#9AA0A8", ""),
    "limit": ("beyond a joint limit", "#C9CED6", "//"),
    "collision": ("collision", OKABE_ITO["vermillion"], "xx"),
    "singularity": ("too near a singularity", OKABE_ITO["purple"], ".."),
}


def curve_figure(
    x: Array, value: Array, why: Sequence[str], axis: str, label: str, marks: Mapping[str, float]
) -> Figure:
    """Draw the goal over one coordinate; where it is NaN the zone of ``why`` is shaded.

    ``x`` (p,) ascending, ``value`` (p,), ``why`` (p,) of :data:`ZONES` or empty; ``marks``: positions by name.

    Raises
    ------
    InputError
        Shapes that do not fit.
    """
    if x.shape != value.shape or len(why) != len(x) or not len(x):
        raise InputError("curve of positions", value=f"shape {value.shape}", allowed=f"({len(x)},), one of each")
    with drawing(f"{label.split(',')[0]} over the base's position", "wide") as (figure, (ax,)):
        edge = np.concatenate([[x[0]], 0.5 * (x[1:] + x[:-1]), [x[-1]]])
        for i, reason in enumerate(why):
            if reason:
                _, colour, hatch = ZONES[reason]
                ax.axvspan(edge[i], edge[i + 1], facecolor=paler(colour), edgecolor=colour, hatch=hatch, linewidth=0.0)
        ax.plot(x, value, color=SERIES[0], marker="o" if len(x) < 60 else "", markersize=3)
        ax.set_xlim(x[0], x[-1])
        if np.isfinite(value).any():
            low, high = float(np.nanmin(value)), float(np.nanmax(value))
            room = 0.08 * (high - low) or 1.0
            ax.set_ylim((0.0 if 0.0 <= low < 0.5 * high else low - room), high + room)
        for k, (name, at) in enumerate(marks.items()):
            # A white edge, so that it shows on a hatched zone as well.
            ax.axvline(at, color="white", linewidth=5.0, zorder=4)
            colour, style = (SERIES[1], "-") if k == 0 else (INK, ":")
            ax.axvline(at, color=colour, linestyle=style, linewidth=2.0, zorder=5, label=name)
        ax.set(xlabel=axis, ylabel=label)
        _legend(figure, ax, why)
    return figure


def map_figure(
    x: Array,
    y: Array,
    value: Array,
    why: Sequence[str],
    names: tuple[str, str],
    label: str,
    marks: Mapping[str, tuple[float, float]],
) -> Figure:
    """Draw the goal over two coordinates; ``value`` and ``why`` (p, r) over x (p,) and y (r,), marks as positions.

    Raises
    ------
    InputError
        Shapes that do not fit.
    """
    if value.shape != (len(x), len(y)) or len(why) != value.size:
        raise InputError("map of positions", value=f"shape {value.shape}", allowed=f"({len(x)}, {len(y)})")
    reason = np.array(why, dtype=object).reshape(value.shape)
    wide = float(np.ptp(x)) / max(float(np.ptp(y)), 1e-9)
    size = 9.0, float(np.clip(7.0 / max(wide, 0.5), 3.6, 7.5))
    with drawing(f"{label.split(',')[0]} over the base's position", size) as (figure, (ax,)):
        ax.grid(visible=False)
        for key, (_, colour, hatch) in ZONES.items():
            mask = reason == key
            if mask.any():
                hatched(ax, steps(x), steps(y), mask, paler(colour), hatch, colour)
        mesh = ax.pcolormesh(x, y, np.ma.masked_invalid(value.T), cmap=STIFFNESS_COLOURS, shading="nearest")
        for k, (name, spot) in enumerate(marks.items()):
            ax.plot(*spot, linestyle="", marker="*" if k == 0 else "o", markersize=15 if k == 0 else 8, label=name,
                    markerfacecolor="white", markeredgecolor=INK, zorder=5)  # fmt: skip
        ax.set(xlabel=names[0], ylabel=names[1])
        bar = figure.colorbar(mesh, ax=ax, label=label)
        bar.outline.set_visible(False)
        _legend(figure, ax, why)
    return figure


def along_figure(placements: Mapping[str, Along]) -> Figure:
    """Draw stiffness (N/mm) and surface error (um) of placements by name along their path, the first boldly."""
    heading = "Stiffness and predicted surface error along the path"
    with drawing(heading, (10.0, 6.4), 2, 1, sharex=True) as (figure, axes):
        for k, (name, one) in enumerate(placements.items()):
            draw_line(axes[0], one.error.arc_length * 1e3, one.stiffness * 1e-3, name, k)
            draw_line(axes[1], one.error.arc_length * 1e3, one.error.normal * 1e6, name, k)
        axes[0].set_ylabel("stiffness along the force, N/mm")
        axes[1].set_ylabel("surface error, um")
        axes[0].set_ylim(bottom=0.0)
        axes[1].axhline(0.0, color=FAINT, linewidth=1.0, zorder=0)
        axes[1].set_xlabel("path, mm")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    return figure


def _legend(figure: Figure, ax: Axes, why: Sequence[str]) -> None:
    handles, labels = ax.get_legend_handles_labels()
    for key, (name, colour, hatch) in ZONES.items():
        if key in why:
            handles.append(Patch(facecolor=paler(colour), edgecolor=colour, hatch=hatch, linewidth=0.0))
            labels.append(name)
    if handles:
        figure.legend(handles, labels, loc="outside lower left", ncols=5)
