"""Before and after as dumbbells: an open circle, a filled diamond, and the way between them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from robots import InputError
from robots.arrays import Array
from robots.quantities import significant
from stiffarm.pages.figure_parts import above, drawing, named_columns, named_rows, note
from stiffarm.pages.style import INK, OKABE_ITO

# Looks of the two ends: by shape and filling, not by colour alone.
BEFORE: Final[dict[str, Any]] = {
    "marker": "o",
    "markersize": 8.0,
    "markerfacecolor": "white",
    "markeredgecolor": OKABE_ITO["vermillion"],
    "markeredgewidth": 2.0,
}
AFTER: Final[dict[str, Any]] = {
    "marker": "D",
    "markersize": 7.0,
    "markerfacecolor": OKABE_ITO["blue"],
    "markeredgecolor": OKABE_ITO["blue"],
}
_BAR: Final = "#C9CDD2"
# More rows than this stand side by side, without their numbers.
_MOST_ROWS: Final = 12
# Nearer to zero than this share of the largest there is no room at the left.
_LOW: Final = 0.12


def dumbbells_figure(
    heading: str,
    rows: Mapping[str, tuple[float, float]],
    what: str,
    *,
    lines: Mapping[str, float] | None = None,
    below: str = "",
    ends: tuple[str, str] = ("before", "after"),
) -> Figure:
    """Draw how something fell or rose from the first to the second of each pair (name -> before, after).

    A few lie one above another with their numbers written; many stand side by side, ``below`` them what they are.

    Parameters
    ----------
    rows : not negative; the second is NaN where there is none
    what : label of the axis of values, with the unit
    lines : name and value of up to two lines across
    ends : what the two ends are called

    Raises
    ------
    InputError
        No finite value.
    """
    values = np.array(list(rows.values()), dtype=np.float64).reshape(-1, 2)
    if not np.isfinite(values).any():
        raise InputError(f"dumbbells of {what}", code="B002", value=values.tolist(), allowed="a finite value")
    lying = len(rows) <= _MOST_ROWS
    size = (10.0, 1.35 + 0.36 * len(rows)) if lying else (10.0, 3.8)
    with drawing(heading, size) as (figure, (ax,)):
        draw_dumbbells(ax, values, lying=lying)
        handles = [Line2D([], [], linestyle="none", label=ends[0], **BEFORE)]
        if np.isfinite(values[:, 1]).any():
            handles.append(Line2D([], [], linestyle="none", label=ends[1], **AFTER))
        for (name, value), dash in zip((lines or {}).items(), ("--", ":"), strict=False):
            across = ax.axvline if lying else ax.axhline
            handles.append(across(value, color=INK, linewidth=1.2, linestyle=dash, label=name, zorder=1))
        top = float(np.nanmax([*values.ravel(), *(lines or {}).values()])) or 1.0
        if lying:
            named_rows(ax, list(rows))
            ax.set(xlim=(0.0, 1.12 * top), xlabel=what)
        else:
            named_columns(ax, list(rows))
            ax.set(ylim=(0.0, 1.08 * top), ylabel=what, xlabel=below)
        above(ax, handles, 4)
    return figure


def draw_dumbbells(ax: Axes, values: Array, *, lying: bool = True, digits: int = 3) -> None:
    """Draw pairs (n, 2) at the rows, or else the columns, 0, 1, ... of axes; numbers beside those that lie."""
    for k, (a, b) in enumerate(values.tolist()):
        both = np.isfinite([a, b]).all()
        if both:
            (ax.hlines if lying else ax.vlines)(k, a, b, color=_BAR, linewidth=4.0 if lying else 2.5, zorder=1.5)
        for value, look in ((a, BEFORE), (b, AFTER)):
            if not np.isfinite(value):
                continue
            small = {} if lying else {"markersize": 0.75 * look["markersize"]}
            x, y = (value, k) if lying else (k, value)
            ax.plot(x, y, linestyle="none", zorder=3 if look is AFTER else 2.5, **{**look, **small})
            if lying:
                # Away from the other end.
                if a == b and look is AFTER:
                    continue
                text, left = significant(value, digits), both and value == min(a, b) and a != b
                if left and value < _LOW * np.nanmax(values):
                    # Left of it stand the names of the rows.
                    note(ax, text, (value, k), (-3, 5), ha="left", va="bottom", size=9.5)
                else:
                    note(ax, text, (value, k), (-9, 0) if left else (9, 0), ha="right" if left else "left", size=9.5)
