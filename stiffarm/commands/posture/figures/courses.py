"""Figures of motion along a path: joints and axes within their limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robots import InputError, Robot
from robots.arrays import Array
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.figure_parts import SERIES, angle_label, title
from stiffarm.pages.report import Picture
from stiffarm.pages.style import FAINT, INK, house_style, new_figure


def joints_picture(pictures: Pictures, arc: Array, courses: Mapping[str, Array], robot: Robot) -> Picture:
    """Draw joint angles q (n, dof) rad of courses, the first boldly, over the path's length ``arc`` (n,) m."""
    figure = motion_figure(
        arc * 1e3,
        {name: np.degrees(q) for name, q in courses.items()},
        [angle_label(name) for name in robot.coordinates],
        np.degrees(robot.limits),
        "Joint angles along the path",
    )
    return pictures.add(figure, "joints", "Joint angles along the path; beyond the dotted lines are the limits.")


def motion_figure(
    arc_mm: Array, courses: Mapping[str, Array], labels: Sequence[str], limits: Array, heading: str
) -> Figure:
    """Draw what joints or axes do along the path, one panel each, with their limits.

    ``arc_mm`` (n,); ``courses`` by name (n, c), the first is drawn boldly; ``limits`` (c, 2).

    Raises
    ------
    InputError
        No courses, or shapes that do not fit.
    """
    n, many = len(arc_mm), len(labels)
    if not courses or any(q.shape != (n, many) for q in courses.values()) or limits.shape != (many, 2):
        raise InputError("motion figure", value="shapes that do not fit", allowed=f"courses ({n}, {many})")
    columns = min(3, many)
    lines = -(-many // columns)
    with house_style():
        figure, axes = new_figure((10.0, 0.9 + 2.6 * lines), lines, columns, sharex=True)
        for j, ax in enumerate(axes[:many]):
            _panel(ax, arc_mm, {name: q[:, j] for name, q in courses.items()}, limits[j])
            ax.set_title(labels[j], loc="left", pad=4)
        for ax in axes[many:]:
            ax.set_visible(False)
        for ax in axes[max(0, many - columns) : many]:
            ax.set_xlabel("path, mm")
        title(figure, heading)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=4)
    return figure


def draw_lines(ax: Axes, arc_mm: Array, series: Mapping[str, Array]) -> None:
    """Draw values (n,) by name along the path, the first boldly."""
    marker = "o" if len(arc_mm) == 1 else ""
    for k, (name, values) in enumerate(series.items()):
        width = 2.2 if k == 0 else 1.2
        ax.plot(arc_mm, values, color=SERIES[k], linewidth=width, zorder=4 - k, label=name, marker=marker)


def _panel(ax: Axes, arc_mm: Array, angles: Mapping[str, Array], limits: Array) -> None:
    draw_lines(ax, arc_mm, angles)
    every = np.concatenate(list(angles.values()))
    room = max(5.0, 0.12 * float(np.ptp(every)))
    low, high = float(every.min()) - room, float(every.max()) + room
    ax.set_ylim(low, high)
    for limit, outward in zip(limits, (-1.0, 1.0), strict=True):
        if low < limit < high:
            ax.axhline(limit, color=INK, linewidth=1.0, linestyle=":")
            ax.axhspan(limit, limit + outward * 2.0 * (high - low), color=FAINT, alpha=0.5, linewidth=0)
