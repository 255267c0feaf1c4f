"""Figures of the strain energy's shares: of one pose, and over the whole workspace. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from fem import PartKind
from robots import InputError
from robots.arrays import Array
from stiffarm.commands.simulate.budgets import PoseBudget, WorkspaceBudget
from stiffarm.pages.figure_parts import above, joint_colour, note, paler, title
from stiffarm.pages.style import INK, OKABE_ITO, house_style, new_figure

# Structure is grey in these figures, so that joints and links are told apart; the hatch is for those who cannot.
_KIND_LOOKS: Final[dict[PartKind, tuple[str, str, str]]] = {
    "joint": (OKABE_ITO["blue"], "", "joints"),
    "link": ("#8A9097", "", "links"),
    "parallelogram": ("#C4C8CD", "////", "bar and crank"),
    "other": ("#C4C8CD", "....", "base and tool"),
}
_GREYS: Final = ("#4E545B", "#DADDE1")
# Bands of the workspace figure below this mean share everywhere are drawn together.
_LEAST_BAND = 0.03
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
        raise InputError("energy share figure: no parts to draw")
    order = budget.order
    share = 100.0 * budget.share[order]
    with house_style():
        figure, (ax,) = new_figure((10.0, 1.75 + 0.3 * len(order)))
        for row, i in enumerate(order):
            colour, hatch, _ = _KIND_LOOKS[budget.kinds[i]]
            ax.barh(row, share[row], 0.72, color=colour, hatch=hatch, edgecolor="white", linewidth=0.0)
            note(ax, _share_text(budget, i), (share[row], row), (6, 0), ha="left", size=9.5)
        ax.set_yticks(range(len(order)), [budget.parts[i] for i in order], size=10)
        ax.set_ylim(len(order) - 0.4, -0.6)
        ax.set_xlim(0.0, 1.24 * share[0])
        ax.tick_params(axis="y", length=0)
        ax.grid(visible=False, axis="y")
        motion = "" if budget.along is None else f"; beside the bars: tool motion along the load ({budget.along_unit})"
        ax.set_xlabel(f"share in the strain energy (%){motion}")
        kinds = [k for k in _KIND_LOOKS if k in budget.kinds]
        keys = [Patch(facecolor=_KIND_LOOKS[k][0], hatch=_KIND_LOOKS[k][1], edgecolor="white") for k in kinds]
        for key, kind in zip(keys, kinds, strict=True):
            together = 100.0 * budget.share[[k == kind for k in budget.kinds]].sum()
            key.set_label(f"{_KIND_LOOKS[kind][2]} {together:.1f} %")
        above(ax, keys, 4)
        _headed(figure, f"{heading}: {budget.largest} gives most, {share[0]:.0f} %", subtitle)
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
    with house_style():
        figure, axes = new_figure((10.0, max(4.4, 1.6 + 0.3 * len(order))), 1, 2, width_ratios=[1.0, 1.25])
        _spreads(axes[0], levels[:, order], [budget.parts[i] for i in order], [colours[budget.parts[i]] for i in order])
        _bands(axes[1], found, edges, 100.0 * mean, colours)
        _headed(figure, heading, subtitle)
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
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.set_xlim(left=0.0)
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False, axis="y")
    ax.set_xlabel("share in the strain energy (%): dot median,\nthick half of the poses, thin nine in ten")


def _bands(ax: Axes, found: WorkspaceBudget, edges: Array, mean: Array, colours: dict[str, str]) -> None:
    budget = found.budget
    most = np.nanmax(mean, axis=0)
    shown = [i for i in np.argsort(-np.nanmean(mean, axis=0), kind="stable") if most[i] >= 100.0 * _LEAST_BAND]
    bands = [(budget.parts[i], mean[:, i], colours[budget.parts[i]], budget.kinds[i]) for i in shown]
    small = [i for i in range(len(most)) if i not in shown and most[i] > 0.0]
    if small:
        name = budget.parts[small[0]] if len(small) == 1 else f"{len(small)} others"
        bands.append((name, mean[:, small].sum(axis=1), "white", "other"))
    wide, bottom = np.diff(edges), np.zeros(len(mean))
    right: list[tuple[float, str]] = []
    for name, height, colour, kind in bands:
        look: dict[str, Any] = {"color": colour, "edgecolor": "white", "linewidth": 1.0}
        look |= {"hatch": "////"} if kind == "parallelogram" else {}
        look |= {"edgecolor": "#B8BCC2", "linewidth": 0.6} if colour == "white" else {}
        ax.bar(edges[:-1], np.nan_to_num(height), wide, bottom=bottom, align="edge", **look)
        _inside(ax, edges, bottom, height, colour)
        last = int(np.flatnonzero(~np.isnan(height))[-1])
        right.append((float(bottom[last] + 0.5 * height[last]), name))
        bottom = bottom + np.nan_to_num(height)
    end, span = float(edges[-1]), float(np.ptp(edges))
    for at, (middle, name) in zip(_apart([m for m, _ in right], 4.6), right, strict=True):
        ax.plot([end, end + 0.035 * span], [middle, at], color="#777777", linewidth=0.7, clip_on=False)
        ax.annotate(name, (end + 0.045 * span, at), va="center", size=9.5, annotation_clip=False)
    ax.set_xlim(edges[0], end)
    ax.set_ylim(0.0, 100.0)
    ax.grid(visible=False)
    ax.set_xlabel("horizontal reach of the tool (mm)")
    ax.set_ylabel("mean share in the strain energy (%)")


def _inside(ax: Axes, edges: Array, bottom: Array, height: Array, colour: str) -> None:
    """Write the percentage into the segments that are high enough."""
    dark = np.dot(to_rgb(colour), (0.3, 0.59, 0.11)) < 0.5
    for i in np.flatnonzero(np.nan_to_num(height) >= 7.0):
        middle = (float(0.5 * (edges[i] + edges[i + 1])), float(bottom[i] + 0.5 * height[i]))
        note(ax, f"{height[i]:.0f}", middle, color="white" if dark else INK, size=8.5)


def _apart(values: Sequence[float], gap: float) -> list[float]:
    """Heights for labels at ascending values, at least ``gap`` apart, within 0 to 100 where they fit."""
    out: list[float] = []
    for value in values:
        out.append(max(value, out[-1] + gap) if out else max(value, 0.5 * gap))
    top = 100.0 - 0.4 * gap
    for i in range(len(out) - 1, -1, -1):
        out[i] = min(out[i], top)
        top = out[i] - gap
    return out


def part_colours(parts: Sequence[str], kinds: Sequence[PartKind]) -> dict[str, str]:
    """Joints in their colours of the other figures; structure in greys that get lighter along the chain."""
    structure = [name for name, kind in zip(parts, kinds, strict=True) if kind != "joint"]
    dark, light = (np.array(to_rgb(grey)) for grey in _GREYS)
    steps = np.linspace(0.0, 1.0, max(len(structure), 2))
    out = {name: to_hex(tuple(dark + t * (light - dark))) for name, t in zip(structure, steps, strict=False)}
    joints = [name for name, kind in zip(parts, kinds, strict=True) if kind == "joint"]
    for position, name in enumerate(joints):
        colour = joint_colour(name.split(" ")[0], position)
        out[name] = paler(colour) if " " in name else colour
    return out
