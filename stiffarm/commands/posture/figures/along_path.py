"""Figures along a path: joints and axes within their limits, the predicted surface error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from machining.cutting import Comparison, SurfaceError
from robots import Robot
from robots.arrays import Array
from robots.constants import NORMAL_95
from stiffarm.pages.figure_parts import LINES, SERIES, above, angle_label, drawing, note, panels
from stiffarm.pages.style import FAINT, INK

_BAND: Final = 0.16
# Points closer than this would make markers run into each other.
_MARKED: Final = 25


def joints_figure(arc: Array, courses: Mapping[str, Array], robot: Robot, *, narrow: bool = False) -> Figure:
    """Draw joint angles q (n, dof) rad of courses, the first boldly, over the path's length ``arc`` (n,) m."""
    degrees = {name: np.degrees(q) for name, q in courses.items()}
    labels = [angle_label(name) for name in robot.coordinates]
    heading = "Joint angles along the path"
    return motion_figure(arc * 1e3, degrees, labels, np.degrees(robot.limits), heading, narrow=narrow)


def motion_figure(
    arc_mm: Array,
    courses: Mapping[str, Array],
    labels: Sequence[str],
    limits: Array,
    heading: str,
    *,
    whole: bool = False,
    narrow: bool = False,
) -> Figure:
    """Draw what joints or axes do along the path, one panel each, with their limits.

    ``arc_mm`` (n,); ``courses`` by name (n, c), the first is drawn boldly; ``limits`` (c, 2), in the
    picture if near, with ``whole`` in any case. ``narrow``: for half of a page's width.
    """
    columns, width, height = (2, 5.2, 1.7) if narrow else (3, 10.0, 2.6)
    with panels(heading, len(labels), columns, width, height, 0.9, sharex=True) as (figure, axes):
        for j, ax in enumerate(axes):
            _panel(ax, arc_mm, {name: q[:, j] for name, q in courses.items()}, limits[j], whole)
            ax.set_title(labels[j], loc="left", pad=4)
        for ax in axes[-columns:]:
            ax.set_xlabel("path, mm")
            # Panels with none below them have no axis to share.
            ax.tick_params(labelbottom=True)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=4)
    return figure


def draw_line(ax: Axes, arc_mm: Array, values: Array, name: str, k: int) -> None:
    """Draw values (n,) along the path as line ``k`` of several, the first of which is bold."""
    marker, width = "o" if len(arc_mm) == 1 else "", 2.2 if k == 0 else 1.2
    ax.plot(
        arc_mm, values, color=SERIES[k], linestyle=LINES[k], linewidth=width, zorder=4 - k, label=name, marker=marker
    )


def _panel(ax: Axes, arc_mm: Array, angles: Mapping[str, Array], limits: Array, whole: bool) -> None:
    for k, (name, values) in enumerate(angles.items()):
        draw_line(ax, arc_mm, values, name, k)
    every = np.concatenate([*angles.values(), *([limits] if whole else [])])
    room = max(5.0, 0.12 * float(np.ptp(every)))
    low, high = float(every.min()) - room, float(every.max()) + room
    ax.set_ylim(low, high)
    for limit, outward in zip(limits, (-1.0, 1.0), strict=True):
        if low < limit < high:
            ax.axhline(limit, color=INK, linewidth=1.0, linestyle=":")
            ax.axhspan(limit, limit + outward * 2.0 * (high - low), color=FAINT, alpha=0.5, linewidth=0)


def milling_error_figure(
    errors: Mapping[str, SurfaceError],
    comparison: Comparison | None = None,
    heading: str = "Predicted surface error along the path",
) -> Figure:
    """Draw surface errors (um) over the arc length (mm) with 95 % bands; below them their difference.

    Parameters
    ----------
    errors : name of a set of postures -> its error, one to four, before the optimisation first
    comparison : of the first two; its difference gets a panel of its own, with the band of what is not common
    """
    s = next(iter(errors.values())).arc_length
    rows = 1 if comparison is None else 2
    look: dict[str, Any] = {} if rows == 1 else {"height_ratios": (1.6, 1.0), "sharex": True}
    with drawing(heading, (9.0, 4.4 if rows == 1 else 6.6), rows, 1, **look) as (figure, axes):
        keys: list[Any] = []
        for (name, error), colour, line in zip(errors.items(), SERIES, LINES, strict=False):
            _curve(axes[0], s, error.normal, error.band, colour, line)
            key: dict[str, Any] = {"color": colour, "linestyle": line, "linewidth": 2.2}
            keys.append(Line2D([], [], label=name, **key))
        keys.append(Patch(color="#8A8F96", alpha=0.35, label="95 % band"))
        axes[0].set_ylabel("surface error (µm)")
        above(axes[0], keys, 5)
        _sides(axes[0])
        if comparison is not None:
            half = NORMAL_95 * comparison.sd
            band = comparison.difference - half, comparison.difference + half
            _curve(axes[1], s, comparison.difference, band, SERIES[3], "-")
            before, after = list(errors)[:2]
            axes[1].set_ylabel("difference (µm)")
            said = f"{before} minus {after}, with what is uncertain about both in common"
            axes[1].set_title(said, loc="left", size=10)
        for ax in axes:
            _with_zero(ax)
        axes[-1].set_xlabel("arc length along the path (mm)")
    return figure


def _curve(ax: Axes, s: Array, value: Array, band: tuple[Array, Array], colour: str, line: Any) -> None:
    x = s * 1e3
    look: dict[str, Any] = {"marker": "o", "markersize": 3.5} if len(s) <= _MARKED else {}
    ax.fill_between(x, band[0] * 1e6, band[1] * 1e6, color=colour, alpha=_BAND, linewidth=0)
    for edge in band:
        ax.plot(x, edge * 1e6, color=colour, linewidth=0.7, alpha=0.7)
    ax.plot(x, value * 1e6, color=colour, linestyle=line, linewidth=2.2, **look)


def _with_zero(ax: Axes) -> None:
    """Zero belongs into the picture: an axis cut off makes a small change look large."""
    low, high = ax.get_ylim()
    low, high = min(low, 0.0), max(high, 0.0)
    room = 0.04 * (high - low) if high > low else 1.0
    ax.set_ylim(low - room * (low < 0.0), high + room * (high > 0.0))
    ax.axhline(0.0, color=INK, linewidth=1.0, zorder=1.5)
    ax.margins(x=0.02)


def _sides(ax: Axes) -> None:
    """What the signs mean, outside the axes at their right."""
    look: dict[str, Any] = {"xycoords": "axes fraction", "rotation": 90, "color": "#555555", "size": 9.0}
    note(ax, "above 0: material left\nbelow 0: cut too deep", (1.0, 0.5), (16, 0), **look)
