"""Figures of a verified program over its moves: clearance, axis speeds, distance from the straight line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from machining.verification import Kind, Verification
from robots.arrays import Array
from stiffarm.pages.figure_parts import LINES, MARKERS, above, drawing, joint_line, log_ticks
from stiffarm.pages.style import INK, OKABE_ITO, SIZES_IN

# More bins than this a page cannot show.
BINS: Final = 1200
BAD: Final = OKABE_ITO["vermillion"]
SEEN, PROVEN = OKABE_ITO["blue"], "#BBD3E4"
# Below this a distance from the line is rounding, m.
NOTHING: Final = 1e-9


def binned(values: Array, *, least: bool = False) -> tuple[Array, Array]:
    """Moves and values thinned out to ``BINS``: of each bin the largest value, or the least; NaN is left out."""
    n = len(values)
    edges = np.unique(np.linspace(0, n, min(n, BINS) + 1).astype(np.int64))[:-1]
    pick = np.fmin if least else np.fmax
    return edges.astype(np.float64), np.asarray(pick.reduceat(values, edges))


def clearance_figure(found: Verification, *, narrow: bool = False) -> Figure:
    """Least distance of any two checked bodies in each move, the distance proven, and the safety distance.

    ``narrow``: for half of a page's width.
    """
    swept, n = found.swept, found.program.n
    within = swept.within * 1e3
    with drawing("Clearance along the program", (5.2, 4.4) if narrow else SIZES_IN["wide"]) as (figure, (ax,)):
        x, seen = binned(np.minimum(swept.distance, swept.within) * 1e3, least=True)
        _, proven = binned(np.clip(swept.proven, 0.0, swept.within) * 1e3, least=True)
        ax.fill_between(x, proven, np.maximum(seen, 0.0), color=PROVEN, linewidth=0.0)
        ax.plot(x, np.maximum(seen, 0.0), color=SEEN, linewidth=1.4)
        handles: list[Line2D | Patch] = [
            Line2D([], [], color=SEEN, label="least distance seen"),
            Patch(color=PROVEN, label="down to the distance proven"),
        ]
        if found.safety > 0.0:
            ax.axhline(found.safety * 1e3, color=BAD, linestyle=":", linewidth=1.4)
            handles.append(
                Line2D([], [], color=BAD, linestyle=":", label=f"safety distance, {found.safety * 1e3:g} mm")
            )
        if _mark(ax, found, Kind.COLLISION, alpha=0.25):
            _mark(ax, found, Kind.COLLISION, ymax=0.03)
            handles.append(Patch(color=BAD, label="overlap"))
        ax.set(ylim=(0.0, within * 1.03), ylabel=f"distance (mm), up to {within:g}")
        _moves(ax, n)
        above(ax, handles, 2 if narrow else 4)
    return figure


def speeds_figure(found: Verification) -> Figure:
    """Speeds that the feed asks for over each axis' greatest, of the axes whose limit is known."""
    with np.errstate(invalid="ignore"):
        share = 100.0 * found.timing.speed / found.axes.speed
    share[:, np.isinf(found.axes.speed)] = np.nan
    shown = [j for j in range(found.axes.count) if np.isfinite(share[:, j]).any()]
    top = float(np.nanmax(share))
    heading = f"Axis speeds at the programmed feed: up to {top:.3g} % of the greatest"
    with drawing(heading, SIZES_IN["wide"]) as (figure, (ax,)):
        for j in shown:
            x, worst = binned(share[:, j])
            joint = j < found.axes.dof
            # Other axes are drawn thicker than any joint.
            look = joint_line(found.axes.names[j], j) if joint else {"color": INK, "linestyle": LINES[j % len(LINES)]}
            ax.plot(x, worst, linewidth=1.4 if joint else 2.4, label=found.axes.names[j], **look)
        ax.axhline(100.0, color=BAD, linestyle=":", linewidth=1.4)
        # Far below the limit the limit is left out, so that the curves can be told apart.
        high = 1.25 * top if top < 25.0 else max(110.0, 1.05 * min(top, 400.0))
        ax.set(ylim=(0.0, high if high > 0.0 else 1.0), ylabel="speed asked over the greatest (%)")
        _mark(ax, found, Kind.SPEED, alpha=0.18)
        _moves(ax, found.program.n)
        above(ax, ax.get_legend_handles_labels()[0], min(len(shown), 9))
    return figure


def straightness_figure(found: Verification) -> Figure:
    """How far the tip leaves the straight line between points in cutting moves if all axes move evenly."""
    line = found.path.line * 1e3
    with drawing("Linearisation error of cutting moves", SIZES_IN["wide"]) as (figure, (ax,)):
        x, worst = binned(np.maximum(line, NOTHING * 1e3))
        few = int(np.isfinite(worst).sum()) < 40
        ax.plot(x, worst, color=SEEN, linewidth=1.2, marker=MARKERS[0] if few else None, markersize=4)
        limit = found.demands.tolerance * 1e3
        ax.axhline(limit, color=BAD, linestyle=":", linewidth=1.4)
        ax.set_yscale("log")
        low = min(float(np.nanmin(worst)), limit)
        ax.set_ylim(0.5 * low, 3.0 * max(float(np.nanmax(worst)), limit))
        log_ticks(ax.yaxis)
        ax.set_ylabel("distance from the line (mm)")
        _mark(ax, found, Kind.DEVIATION, alpha=0.18)
        _moves(ax, found.program.n)
        handles: Sequence[Line2D] = [
            Line2D([], [], color=SEEN, label="axes moved evenly between points"),
            Line2D([], [], color=BAD, linestyle=":", label=f"tolerance, {limit:g} mm"),
        ]
        above(ax, handles, 2)
    return figure


def _mark(ax: Axes, found: Verification, kind: Kind, **look: Any) -> bool:
    """Shade the moves of a kind of offence; whether there are any."""
    marked = [o for o in found.errors if o.kind is kind]
    for offence in marked:
        ax.axvspan(offence.move - 0.5, offence.last + 0.5, color=BAD, linewidth=0.0, **look)
    return bool(marked)


def _moves(ax: Axes, n: int) -> None:
    ax.set(xlim=(-0.01 * n, max(n - 1, 1) * 1.01), xlabel="move")
