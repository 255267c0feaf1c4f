"""Figures of what a calibration leaves: by pose, load, direction, phase; against the prediction; its distribution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import norm

from robots import InputError
from robots.arrays import Array, Bools
from stiffarm.pages.figure_parts import drawing, named_columns
from stiffarm.pages.numbers import naturally
from stiffarm.pages.style import FAINT, INK, OKABE_ITO

_GOOD: Final = OKABE_ITO["blue"]
_FLAGGED: Final = OKABE_ITO["vermillion"]
# Outliers beyond this many times the largest good residual stand at the edge, or nothing else could be seen.
_ROOM: Final = 1.6


def residuals_figure(
    residual: Array,
    unit: str,
    groups: Mapping[str, Sequence[str]],
    flagged: Bools,
    sd: Array | None = None,
    loads_N: Array | None = None,
) -> Figure:
    """Draw residuals (m,) by each grouping (its name -> a label for each residual), a panel each.

    Labels stand in their natural order. The black bar is the mean of a group. ``flagged`` (m,): outliers.
    ``sd`` (m,): standard deviation by the noise found, of which the band shows twice the median. ``loads_N`` (m,): of
    many different loads, which have an axis of their own.

    Raises
    ------
    InputError
        No groups, or labels of another number than residuals.
    """
    if not groups or any(len(labels) != len(residual) for labels in groups.values()):
        raise InputError("residuals figure: groups", code="B002", allowed="at least one, a label for each residual")
    count = len(groups) + (loads_N is not None)
    heading, size = "What the calibrated model leaves: read minus predicted", (10.0, 0.7 + 2.5 * count)
    with drawing(heading, size, count, 1) as (figure, axes):
        if loads_N is not None:
            _dots(axes[-1], loads_N, residual, flagged)
            axes[-1].axhline(0.0, color=INK, linewidth=0.8, zorder=1)
        for ax, (name, labels) in zip(axes, groups.items(), strict=False):
            _strip(ax, residual, list(labels), flagged)
            ax.set_xlabel(f"by {name}")
        for ax in axes:
            if sd is not None:
                reach = 2.0 * float(np.median(sd))
                ax.axhspan(-reach, reach, color=FAINT, alpha=0.25, linewidth=0, zorder=0.2)
            ax.set_ylabel(f"residual ({unit})")
        if loads_N is not None:
            axes[-1].set_xlabel("load (N)")
    return figure


def _strip(ax: Axes, residual: Array, labels: list[str], flagged: Bools) -> None:
    names = naturally(labels)
    place = np.array([names.index(label) for label in labels], dtype=np.float64)
    spread = np.zeros(len(place))
    for k in range(len(names)):
        mine = np.flatnonzero(place == k)
        spread[mine] = np.linspace(-0.22, 0.22, len(mine)) if len(mine) > 1 else 0.0
    _dots(ax, place + spread, residual, flagged)
    good = np.where(flagged, np.nan, residual)
    means = np.array([_mean(good[place == k]) for k in range(len(names))])
    if len(labels) > len(names):
        ax.hlines(means, np.arange(len(names)) - 0.3, np.arange(len(names)) + 0.3, color=INK, linewidth=1.6, zorder=3)
    ax.axhline(0.0, color=INK, linewidth=0.8, zorder=1)
    named_columns(ax, names)


def checks_figure(predicted: Array, measured: Array, own: Array, unit: str, flagged: Bools) -> Figure:
    """Draw measured against predicted, residuals against predicted, and standardised residuals against a normal law.

    ``own`` (m,): residuals without what set-ups have in common, over their standard deviations.

    Raises
    ------
    InputError
        Arrays of different lengths, or empty.
    """
    if not len(predicted) or {len(measured), len(own), len(flagged)} != {len(predicted)}:
        raise InputError("checks figure", code="B002", allowed="as many measured as predicted, at least one")
    with drawing("", (11.0, 4.2), 1, 3) as (figure, (match, left, normal)):
        ends = np.array([min(predicted.min(), measured.min()), max(predicted.max(), measured.max())])
        ends = ends + np.array([-1.0, 1.0]) * 0.04 * max(float(np.ptp(ends)), 1e-12)
        match.plot(ends, ends, color=INK, linewidth=0.9)
        match.set(xlim=ends, ylim=ends, xlabel=f"predicted ({unit})", ylabel=f"read ({unit})", aspect="equal")
        left.axhline(0.0, color=INK, linewidth=0.8)
        left.set(xlabel=f"predicted ({unit})", ylabel=f"read minus predicted ({unit})")
        order = np.argsort(own)
        quantile = norm.ppf((np.arange(len(own)) + 0.5) / len(own))
        reach = max(float(np.abs(quantile).max()), 1.0) * 1.1
        normal.plot([-reach, reach], [-reach, reach], color=INK, linewidth=0.9)
        normal.set(xlabel="normal law", ylabel="residual / its standard deviation", xlim=(-reach, reach))
        match.scatter(predicted[~flagged], measured[~flagged], s=14, color=_GOOD, alpha=0.75, linewidths=0, zorder=2)
        match.scatter(predicted[flagged], measured[flagged], s=28, color=_FLAGGED, marker="D", linewidths=0, zorder=2)
        for ax, x, y, mask in (
            (left, predicted, measured - predicted, flagged),
            (normal, quantile, own[order], flagged[order]),
        ):
            _dots(ax, x, y, mask)
        match.set_title("measured and predicted", loc="left")
        left.set_title("residuals", loc="left")
        normal.set_title("distribution", loc="left")
    return figure


def _mean(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if known.size else float("nan")


def _dots(ax: Axes, x: Array, y: Array, flagged: Bools) -> None:
    """Points; outliers as diamonds, as triangles at the edge if they are too far off for the axis."""
    look: dict[str, Any] = {"s": 24 if len(x) < 200 else 11, "linewidths": 0, "zorder": 2}
    ax.scatter(x[~flagged], y[~flagged], color=_GOOD, alpha=0.75, **look)
    look["color"], look["s"] = _FLAGGED, 34
    reach = _ROOM * float(np.abs(y[~flagged]).max(initial=0.0))
    if not flagged.any() or reach == 0.0 or np.abs(y[flagged]).max() <= reach:
        ax.scatter(x[flagged], y[flagged], marker="D", **look)
        return
    ax.set_ylim(-reach, reach)
    near = flagged & (np.abs(y) <= reach)
    ax.scatter(x[near], y[near], marker="D", **look)
    for side, marker in ((1.0, "^"), (-1.0, "v")):
        far = flagged & (side * y > reach)
        ax.scatter(x[far], np.full(int(far.sum()), 0.97 * side * reach), marker=marker, **look)
