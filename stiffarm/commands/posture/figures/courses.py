"""Figures of a course of postures: joint angles within their limits, along the path. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robots import InputError
from robots.arrays import Array
from stiffarm.pages.figure_parts import SERIES, angle_label, title
from stiffarm.pages.style import FAINT, INK, house_style, new_figure


def joints_figure(arc_mm: Array, courses: Mapping[str, Array], names: Sequence[str], limits_deg: Array) -> Figure:
    """Draw each joint's angle (deg) along the path, one panel a joint, with its limits.

    ``arc_mm`` (n,); ``courses`` by name (n, dof) deg, the first is drawn boldly; ``limits_deg`` (dof, 2).

    Raises
    ------
    InputError
        No courses, or shapes that do not fit.
    """
    n, dof = len(arc_mm), len(names)
    if not courses or any(q.shape != (n, dof) for q in courses.values()) or limits_deg.shape != (dof, 2):
        raise InputError("joints figure", value="shapes that do not fit", allowed=f"courses ({n}, {dof}) deg")
    columns = min(3, dof)
    lines = -(-dof // columns)
    with house_style():
        figure, axes = new_figure((10.0, 0.9 + 2.6 * lines), lines, columns, sharex=True)
        for j, ax in enumerate(axes[:dof]):
            _panel(ax, arc_mm, {name: q[:, j] for name, q in courses.items()}, limits_deg[j])
            ax.set_title(angle_label(names[j]), loc="left", pad=4)
        for ax in axes[dof:]:
            ax.set_visible(False)
        for ax in axes[max(0, dof - columns) : dof]:
            ax.set_xlabel("path, mm")
        title(figure, "Joint angles along the path")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=4)
    return figure


def _panel(ax: Axes, arc_mm: Array, angles: Mapping[str, Array], limits: Array) -> None:
    marker = "o" if len(arc_mm) == 1 else ""
    for k, (name, angle) in enumerate(angles.items()):
        ax.plot(
            arc_mm, angle, color=SERIES[k], linewidth=2.2 if k == 0 else 1.2, zorder=3 - k, label=name, marker=marker
        )
    every = np.concatenate(list(angles.values()))
    room = max(5.0, 0.12 * float(np.ptp(every)))
    low, high = float(every.min()) - room, float(every.max()) + room
    ax.set_ylim(low, high)
    for limit, outward in zip(limits, (-1.0, 1.0), strict=True):
        if low < limit < high:
            ax.axhline(limit, color=INK, linewidth=1.0, linestyle=":")
            ax.axhspan(limit, limit + outward * 2.0 * (high - low), color=FAINT, alpha=0.5, linewidth=0)
