"""Charts of bars that several reports draw: side by side in groups, and stacked to shares of a whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure

from robots import InputError
from robots.arrays import Array
from robots.quantities import significant
from stiffarm.pages.figure_parts import (
    SERIES,
    above,
    axis_limit,
    drawing,
    joint_colour,
    log_ticks,
    named_columns,
    named_rows,
    note,
    paler,
)
from stiffarm.pages.style import INK

if TYPE_CHECKING:
    from fem import PartKind

# From this many bars on, their numbers stand upright; from the second on they are left out.
_BARS_UPRIGHT, _BARS_BARE = 20, 48
# As many as colours: no two series of bars differ by hue alone.
HATCHES: Final = ("", "////", "....", "xxxx", "\\\\\\\\", "++++")
# Bands below this mean share everywhere are drawn together.
_LEAST_BAND: Final = 0.03
_GREYS: Final = ("#4E545B", "#DADDE1")


def bars_figure(
    heading: str,
    series: Mapping[str, Mapping[str, float]],
    what: str,
    below: str = "",
    lines: Mapping[str, float] | None = None,
    *,
    log: bool = False,
    colours: Sequence[str] = SERIES,
) -> Figure:
    """Draw bars side by side, a group for each label and a colour for each series, with their values where few.

    Bars more than three times as long as the next smaller one end at the top of a linear axis with an arrow.

    Parameters
    ----------
    series : name -> label -> value (NaN or missing: no bar)
    what, below : labels of the two axes, with the unit
    lines : name and value of up to two lines across
    log : a logarithmic axis of values
    colours : of the series, in turn

    Raises
    ------
    InputError
        No value at all, or on a logarithmic axis one that is not above 0.
    """
    labels = list(dict.fromkeys(label for one in series.values() for label in one))
    values = np.array([[one.get(label, np.nan) for label in labels] for one in series.values()])
    known = values[np.isfinite(values)]
    if not known.size or (log and (known <= 0.0).any()):
        raise InputError(
            f"bars of {what}", code="B002", value=known.tolist(), allowed="a finite value" + ", all above 0" * log
        )
    limit = np.inf if log else axis_limit(known)
    top = min(1.12 * limit, float(known.max())) or limit
    # Numbers side by side: three digits of the longest bar, on a logarithmic axis of each.
    digits = ".3g" if log else f".{int(np.clip(2 - np.floor(np.log10(top)), 0, 4))}f"
    step = 0.8 / len(series)
    with drawing(heading, (10.0, 4.0)) as (figure, (ax,)):
        for i, (name, heights) in enumerate(zip(series, values, strict=True)):
            at = np.arange(len(labels)) + (i - (len(series) - 1) / 2) * step
            look: dict[str, Any] = {
                "color": colours[i % len(colours)],
                "hatch": HATCHES[i % len(HATCHES)],
                "edgecolor": "white",
            }
            ax.bar(at, np.minimum(heights, top), 0.92 * step, label=name, **look)
            for x, height in zip(at, heights, strict=True):
                _value(ax, x, height, top, values.size, digits)
        for (name, value), style in zip((lines or {}).items(), ("--", ":"), strict=False):
            ax.axhline(value, color=INK, linewidth=1.2, linestyle=style, label=name)
        named_columns(ax, labels)
        if log:
            ax.set(yscale="log", ylim=(0.5 * known.min(), 2.0 * known.max()))
            log_ticks(ax.yaxis, lambda v: f"{v:g}")
        else:
            ax.set_ylim(0.0, 1.14 * max([top, *(lines or {}).values()]))
        ax.set(xlabel=below, ylabel=what + "\n↑ leaves the axis" * bool((known > top).any()))
        above(ax, ax.get_legend_handles_labels()[0], 4)
    return figure


def ranked_figure(heading: str, values: Mapping[str, float], what: str, most: int = 8) -> Figure:
    """Draw lying bars, the largest first, for half a page's width; what is beyond ``most`` has one bar together.

    ``what``: label of the axis, with the unit.
    """
    order = sorted(values, key=lambda name: -values[name])
    shown = {name: values[name] for name in order[:most]}
    if order[most:]:
        shown[f"{len(order) - most} others"] = sum(values[name] for name in order[most:])
    with drawing(heading, (5.2, 1.3 + 0.3 * len(shown))) as (figure, (ax,)):
        for row, (name, value) in enumerate(shown.items()):
            ax.barh(row, value, 0.72, color=SERIES[0] if name in values else _GREYS[0])
            note(ax, significant(value, 2), (value, row), (5, 0), ha="left", size=10)
        named_rows(ax, list(shown), size=10)
        ax.set_xlim(0.0, 1.25 * max(shown.values(), default=0.0) or 1.0)
        ax.set_xlabel(what)
    return figure


def _value(ax: Axes, x: float, height: float, top: float, bars: int, digits: str) -> None:
    """Write the height of a bar above it, a dash where there is none."""
    if bars > _BARS_BARE:
        return
    text = "–" if not np.isfinite(height) else f"{height:{digits}}" + " ↑" * bool(height > top)
    end = min(height, top) if np.isfinite(height) else ax.get_ylim()[0]
    note(ax, text, (x, end), (0, 2), va="bottom", rotation=90 if bars > _BARS_UPRIGHT else 0)


def part_colours(parts: Sequence[str], kinds: Sequence[PartKind], apart: Sequence[str] = ()) -> dict[str, str]:
    """Joints in their colours of the other figures, a joint's bearing paler; structure in colours of its own.

    These are ``apart``, in turn; without any, greys that get lighter along the chain.
    """
    structure = [name for name, kind in zip(parts, kinds, strict=True) if kind != "joint"]
    dark, light = (np.array(to_rgb(grey)) for grey in _GREYS)
    steps = np.linspace(0.0, 1.0, max(len(structure), 2))
    own = apart or [to_hex(tuple(dark + t * (light - dark))) for t in steps]
    out = {name: own[i % len(own)] for i, name in enumerate(structure)}
    joints = [name for name, kind in zip(parts, kinds, strict=True) if kind == "joint"]
    for position, name in enumerate(joints):
        colour = joint_colour(name.split(" ")[0], position)
        out[name] = paler(colour) if " " in name else colour
    return out


def share_bands(ax: Axes, edges: Array, share: Array, parts: Sequence[str], kinds: Sequence[PartKind]) -> None:
    """Stack the parts' shares (n, p), 0 to 1, to columns between ``edges`` (n + 1,), named at the right.

    NaN: no column. Parts that are small everywhere are drawn together.
    """
    colours, height = part_colours(parts, kinds), 100.0 * share
    most = np.nanmax(share, axis=0)
    shown = [i for i in np.argsort(-np.nanmean(share, axis=0), kind="stable") if most[i] >= _LEAST_BAND]
    bands = [(parts[i], height[:, i], colours[parts[i]], kinds[i]) for i in shown]
    small = [i for i in range(len(parts)) if i not in shown and most[i] > 0.0]
    if small:
        name = parts[small[0]] if len(small) == 1 else f"{len(small)} others"
        bands.append((name, height[:, small].sum(axis=1), "white", "other"))
    wide, bottom = np.diff(edges), np.zeros(len(share))
    right: list[tuple[float, str]] = []
    for name, high, colour, kind in bands:
        look: dict[str, Any] = {"color": colour, "edgecolor": "white", "linewidth": 1.0}
        look |= {"hatch": "////"} if kind == "parallelogram" else {}
        look |= {"edgecolor": "#B8BCC2", "linewidth": 0.6} if colour == "white" else {}
        ax.bar(edges[:-1], np.nan_to_num(high), wide, bottom=bottom, align="edge", **look)
        _inside(ax, edges, bottom, high, colour)
        last = int(np.flatnonzero(~np.isnan(high))[-1])
        right.append((float(bottom[last] + 0.5 * high[last]), name))
        bottom = bottom + np.nan_to_num(high)
    end, span = float(edges[-1]), float(np.ptp(edges))
    for at, (middle, name) in zip(_apart([m for m, _ in right], 4.6), right, strict=True):
        ax.plot([end, end + 0.035 * span], [middle, at], color="#777777", linewidth=0.7, clip_on=False)
        ax.annotate(name, (end + 0.045 * span, at), va="center", size=9.5, annotation_clip=False)
    ax.set(xlim=(edges[0], end), ylim=(0.0, 100.0))
    ax.grid(visible=False)


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
