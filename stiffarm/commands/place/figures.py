"""Figures of a placement: the goal over base positions, stiffness and error along the path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from machining.placement import Along
from machining.placement.freedom import STOPPED_BY
from robots.arrays import Array
from stiffarm.commands.posture.figures.along_path import draw_line
from stiffarm.commands.posture.figures.axes_map import hatched, steps
from stiffarm.pages.figure_parts import LINES, MARKERS, SERIES, drawing, paler
from stiffarm.pages.style import FAINT, INK, OKABE_ITO, STIFFNESS_COLOURS

# How positions are drawn that cannot be taken, by why.
ZONES = {
    "reach": ("#9AA0A8", ""),
    "limit": ("#C9CED6", "//"),
    "collision": (OKABE_ITO["vermillion"], "xx"),
    "singularity": (OKABE_ITO["purple"], ".."),
    "between": (OKABE_ITO["blue"], "\\\\"),
}
# Pictures of positions stand beside the answer, in half of a page's width.
WIDTH_IN = 5.2


def curve_figure(
    x: Array, values: Mapping[str, Array], why: Sequence[str], axis: str, label: str, marks: Mapping[str, float]
) -> Figure:
    """Draw what positions over one coordinate are worth; where there is no value the zone of ``why`` is shaded.

    ``x`` (p,) ascending, ``values`` (p,) by name, ``why`` (p,) of :data:`ZONES` or empty; ``marks``: positions by name,
    the first is the recommended one.
    """
    with drawing("", (WIDTH_IN, 4.6)) as (figure, (ax,)):
        edge = np.concatenate([[x[0]], 0.5 * (x[1:] + x[:-1]), [x[-1]]])
        for i, reason in enumerate(why):
            if reason:
                colour, hatch = ZONES[reason]
                ax.axvspan(edge[i], edge[i + 1], facecolor=paler(colour), edgecolor=colour, hatch=hatch, linewidth=0.0)
        for k, (name, value) in enumerate(values.items()):
            ax.plot(
                x,
                value,
                color=SERIES[0] if k == 0 else INK,
                linestyle=LINES[k],
                linewidth=2.2 if k == 0 else 1.4,
                marker="o" if len(x) < 60 else "",
                markersize=3,
                label=name,
            )
        ax.set_xlim(x[0], x[-1])
        every = np.concatenate(list(values.values()))
        if np.isfinite(every).any():
            low, high = float(np.nanmin(every)), float(np.nanmax(every))
            room = 0.08 * (high - low) or 1.0
            ax.set_ylim((0.0 if 0.0 <= low < 0.5 * high else low - room), high + 2.0 * room)
        _marked_lines(ax, marks)
        ax.set(xlabel=axis, ylabel=label)
        _legend(figure, ax, why)
    return figure


def _marked_lines(ax: Axes, marks: Mapping[str, float]) -> None:
    """Positions as upright lines: black with a flag for the recommended one, in no colour that a zone has."""
    for k, (name, at) in enumerate(marks.items()):
        # A white edge, so that it shows on a hatched zone as well.
        ax.axvline(at, color="white", linewidth=5.0, zorder=4)
        ax.axvline(
            at,
            color=INK,
            linestyle="-" if k == 0 else LINES[k + 1],
            linewidth=2.4 if k == 0 else 1.4,
            zorder=5,
            label=name,
        )
        if k == 0:
            ax.plot(
                at,
                1.0,
                marker="v",
                markersize=11,
                color=INK,
                transform=ax.get_xaxis_transform(),
                clip_on=False,
                zorder=6,
            )


def map_figure(
    x: Array,
    y: Array,
    value: Array,
    why: Sequence[str],
    names: tuple[str, str],
    label: str,
    marks: Mapping[str, tuple[float, float]],
) -> Figure:
    """Draw what positions over two coordinates are worth.

    ``value`` and ``why`` (p, r) over x (p,) and y (r,); ``marks`` as in :func:`curve_figure`, as positions.
    """
    reason = np.array(why, dtype=object).reshape(value.shape)
    wide = float(np.ptp(x)) / max(float(np.ptp(y)), 1e-9)
    size = WIDTH_IN, float(np.clip(1.2 + 4.0 / max(wide, 0.5), 3.4, 6.0))
    with drawing("", size) as (figure, (ax,)):
        ax.grid(visible=False)
        for key, (colour, hatch) in ZONES.items():
            mask = reason == key
            if mask.any():
                hatched(ax, steps(x), steps(y), mask, paler(colour), hatch, colour)
        mesh = ax.pcolormesh(x, y, np.ma.masked_invalid(value.T), cmap=STIFFNESS_COLOURS, shading="nearest")
        for k, (name, spot) in enumerate(marks.items()):
            marker = "*" if k == 0 else MARKERS[k]
            ax.plot(
                *spot,
                linestyle="",
                marker=marker,
                markersize=17 if k == 0 else 9,
                label=name,
                markerfacecolor="white",
                markeredgecolor=INK,
                markeredgewidth=1.4,
                zorder=5,
            )
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
    for key, (colour, hatch) in ZONES.items():
        if key in why:
            handles.append(Patch(facecolor=paler(colour), edgecolor=colour, hatch=hatch, linewidth=0.0))
            labels.append(STOPPED_BY[key])
    if handles:
        figure.legend(handles, labels, loc="outside lower left", ncols=2)
