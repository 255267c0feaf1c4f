"""Figures of the strain energy's shares: of one pose, of several, over the whole workspace. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from fem import Budget, PartKind
from robots import InputError
from robots.arrays import Array
from stiffarm.commands.simulate.budgets import PoseBudget, WorkspaceBudget
from stiffarm.pages.bars import part_colours, share_bands
from stiffarm.pages.figure_parts import above, drawing, named_columns, named_rows, note, title
from stiffarm.pages.style import INK, OKABE_ITO

# Structure is grey in these figures, so that joints and links are told apart; the hatch is for those who cannot.
_KIND_LOOKS: Final[dict[PartKind, tuple[str, str, str]]] = {
    "joint": (OKABE_ITO["blue"], "", "joints"),
    "link": ("#8A9097", "", "links"),
    "parallelogram": ("#C4C8CD", "////", "bar and crank"),
    "other": ("#C4C8CD", "....", "base and tool"),
}
# Per cent below which a share is round-off of a torque that is zero.
_NOTHING = 1e-9
# mm or mrad: no gauge sees less.
_LEAST_MOTION = 0.001


def energy_share_figure(budget: PoseBudget, heading: str, subtitle: str = "") -> Figure:
    """Draw each part's share in the strain energy of one pose (%), largest first, with its tool motion.

    Parameters
    ----------
    heading : what the budget is of; the largest part is named behind it
    subtitle : pose and load

    Raises
    ------
    InputError
        No parts.
    """
    if not budget.parts:
        raise InputError("energy share figure: no parts to draw", code="B002")
    order = budget.order
    share = 100.0 * budget.share[order]
    with drawing("", (10.0, 1.75 + 0.3 * len(order))) as (figure, (ax,)):
        for row, i in enumerate(order):
            colour, hatch, _ = _KIND_LOOKS[budget.kinds[i]]
            ax.barh(row, share[row], 0.72, color=colour, hatch=hatch, edgecolor="white", linewidth=0.0)
            note(ax, _share_text(budget, i), (share[row], row), (6, 0), ha="left", size=9.5)
        named_rows(ax, [budget.parts[i] for i in order], size=10)
        ax.set_xlim(0.0, 1.24 * share[0])
        motion = "" if budget.along is None else f"; beside the bars: tool motion along the load ({budget.along_unit})"
        ax.set_xlabel(f"share in the strain energy (%){motion}")
        kinds = [k for k in _KIND_LOOKS if k in budget.kinds]
        keys = [Patch(facecolor=_KIND_LOOKS[k][0], hatch=_KIND_LOOKS[k][1], edgecolor="white") for k in kinds]
        for key, kind in zip(keys, kinds, strict=True):
            together = 100.0 * budget.share[[k == kind for k in budget.kinds]].sum()
            key.set_label(f"{_KIND_LOOKS[kind][2]} {together:.1f} %")
        above(ax, keys, 4)
        _headed(figure, f"{heading}: {budget.leader}", subtitle)
    return figure


def _share_text(budget: PoseBudget, part: int) -> str:
    value = 100.0 * float(budget.share[part])
    if value < _NOTHING:
        return "carries nothing"
    text = f"{value:.1f} %" if value >= 0.05 else "below 0.1 %"
    if budget.along is None:
        return text
    return f"{text}   {_motion(float(budget.along[part]))} {budget.along_unit}"


def _motion(value: float) -> str:
    if value < _LEAST_MOTION:
        return f"below {_LEAST_MOTION:g}"
    return f"{value:{'.3g' if value >= 0.1 else '.2g'}}"


def workspace_budget_figure(found: WorkspaceBudget, heading: str, subtitle: str = "") -> Figure:
    """Draw the spread of each part's share over the workspace, and the mean shares against the tool's reach.

    Left: median (dot), half of the poses (thick) and nine poses in ten (thin). Right: mean shares of the poses in
    each bin of horizontal reach, stacked; parts that are small everywhere are drawn together.
    """
    budget, edges = found.budget, found.edges_mm()
    mean = found.mean_share(edges)
    colours = part_colours(budget.parts, budget.kinds)
    levels = 100.0 * found.quantiles((0.05, 0.25, 0.5, 0.75, 0.95))
    order = [int(i) for i in np.argsort(-levels[2], kind="stable")]
    size = (10.0, max(4.4, 1.6 + 0.3 * len(order)))
    with drawing("", size, 1, 2, width_ratios=[1.0, 1.25]) as (figure, (left, right)):
        _spreads(left, levels[:, order], [budget.parts[i] for i in order], [colours[budget.parts[i]] for i in order])
        share_bands(right, edges, mean, budget.parts, budget.kinds)
        right.set(xlabel="horizontal reach of the tool (mm)", ylabel="mean share in the strain energy (%)")
        _headed(figure, heading, subtitle)
    return figure


def pose_shares_figure(budget: Budget, names: Sequence[str], motion_mm: Array | None = None) -> Figure:
    """Draw each part's share in the strain energy of n poses (%), a column for each.

    ``names`` (n,) stand below, and where it is known the motion of the tool along the load (n,).

    Raises
    ------
    InputError
        No poses, or names of another number.
    """
    if not names or len(names) != len(budget.share):
        raise InputError(
            "shares by pose: names", code="B002", value=len(names), allowed=f"{len(budget.share)}, one a pose, n >= 1"
        )
    with drawing("Where the deflection comes from, pose by pose", (10.0, 4.6)) as (figure, (ax,)):
        share_bands(ax, np.linspace(-0.5, len(names) - 0.5, len(names) + 1), budget.share, budget.parts, budget.kinds)
        ax.set_xlabel("pose")
        if motion_mm is not None:
            names = [f"{name}\n{motion:.2f}" for name, motion in zip(names, motion_mm, strict=True)]
            ax.set_xlabel("pose, and below it the tool's motion along the load (mm)")
        named_columns(ax, names)
        ax.set_ylabel("share in the strain energy (%)")
    return figure


def readings_figure(measured: Array, simulated: Array, unit: str) -> Figure:
    """Draw simulated over measured readings (n,); on the line they are the same."""
    with drawing("Simulated and measured", (5.2, 4.2)) as (figure, (ax,)):
        top = 1.08 * float(max(np.nanmax(measured), np.nanmax(simulated)))
        ax.plot([0.0, top], [0.0, top], color=INK, linewidth=1.0)
        ax.plot(measured, simulated, "o", color=OKABE_ITO["blue"], markersize=6, alpha=0.75)
        note(ax, "too soft", (0.04 * top, 0.94 * top), ha="left", size=10, color="#555555")
        note(ax, "too stiff", (0.97 * top, 0.3 * top), ha="right", size=10, color="#555555")
        ax.set(xlim=(0.0, top), ylim=(0.0, top), xlabel=f"measured ({unit})", ylabel=f"simulated ({unit})")
    return figure


def _headed(figure: Figure, heading: str, subtitle: str) -> None:
    """Title with a line of facts below it, for which the layout keeps room."""
    title(figure, f"{heading}\n " if subtitle else heading)
    line = 1.4 * 11.5 / 72.0 / figure.get_figheight()
    figure.text(0.01, 0.98 - line, subtitle, size=9.5, va="top", color="#555555")


def _spreads(ax: Axes, levels: Array, names: Sequence[str], colours: Sequence[str]) -> None:
    # Dots at zero are drawn over the axis, not cut in half.
    on_top: dict[str, Any] = {"zorder": 4, "clip_on": False}
    for row, colour in enumerate(colours):
        low, lower, middle, upper, high = levels[:, row]
        ax.hlines(row, low, high, color=colour, linewidth=2.0)
        ax.hlines(row, lower, upper, color=colour, linewidth=7.0)
        ax.plot(middle, row, "o", color="white", markeredgecolor=INK, markersize=6.5, markeredgewidth=1.4, **on_top)
    named_rows(ax, names)
    ax.set_xlim(left=0.0)
    ax.set_xlabel("share in the strain energy (%): dot median,\nthick half of the poses, thin nine in ten")
