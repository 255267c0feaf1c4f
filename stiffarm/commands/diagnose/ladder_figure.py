"""The ladder of a diagnosis as a picture: the error falling look by look, and how probable each name was and is."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from robots.quantities import percent
from stiffarm.commands.diagnose.ladder import Ladder
from stiffarm.pages.dumbbells import AFTER, BEFORE, draw_dumbbells
from stiffarm.pages.figure_parts import drawing, named_rows, note
from stiffarm.pages.style import INK

# Probabilities nearer than this have their numbers at one end; left of an end a number needs so much of the axis.
_NEAR, _ROOM, _HALF = 0.2, 0.15, 0.5

HEADING = "Look by look: the error at poses left out, and how probable each name was and is"


def ladder_figure(of: Ladder, noise: tuple[str, float]) -> Figure:
    """Draw a row for each step, the last of them for what may still be missing.

    ``noise``: what the error cannot fall below, in words, and how much it is (mm).
    """
    names = ["springs alone", *(f"+ {r.code}" for r in of.rungs)]
    error = np.array([(of.start_mm, math.nan), *(r.error_mm for r in of.rungs)])
    open_ = math.isfinite(of.more)
    names += ["something more?"] if open_ else []
    size = (10.0, 1.75 + 0.4 * len(names))
    with drawing(HEADING, size, 1, 2, sharey=True, width_ratios=[1.25, 1.0]) as (figure, (left, right)):
        named_rows(left, names)
        draw_dumbbells(left, error)
        top = float(np.nanmax([*error.ravel(), noise[1]])) or 1.0
        line = left.axvline(noise[1], color=INK, linewidth=1.1, linestyle="--", zorder=1, label=noise[0])
        left.set(xlim=(0.0, 1.2 * top), xlabel="RMS error at poses left out (mm)")
        for k, r in enumerate(of.rungs, start=1):
            _probability(right, k, r.then, r.now)
        if open_:
            look: dict[str, Any] = {"marker": "X", "markersize": 9.0, "color": INK}
            right.plot(100.0 * of.more, len(names) - 1, linestyle="none", **look)
            _write(right, percent(of.more), of.more, len(names) - 1, right=True)
        right.set(xlim=(0.0, 118.0), xticks=range(0, 101, 20), xlabel="probability (%)")
        right.tick_params(axis="y", length=0)
        right.grid(visible=False, axis="y")
        handles = [
            Line2D([], [], linestyle="none", label="before; probability when accepted", **BEFORE),
            Line2D([], [], linestyle="none", label="after; probable now, checks heeded", **AFTER),
            line,
        ]
        figure.legend(handles=handles, loc="outside lower left", ncols=3)
    return figure


def _probability(ax: Axes, row: int, then: float, now: float) -> None:
    ax.hlines(row, 100.0 * now, 100.0 * then, color="#C9CDD2", linewidth=4.0, zorder=1.5)
    for value, look in ((then, BEFORE), (now, AFTER)):
        ax.plot(100.0 * value, row, linestyle="none", zorder=3, clip_on=False, **look)
    low, high = min(then, now), max(then, now)
    if high - low < _NEAR:
        # No room for a number at each end: both at the end that has some.
        _write(ax, f"{percent(then)} → {percent(now)}", low if low > _HALF else high, row, right=low <= _HALF)
        return
    _write(ax, percent(low), low, row, right=low < _ROOM)
    _write(ax, percent(high), high, row, right=True)


def _write(ax: Axes, text: str, value: float, row: int, *, right: bool) -> None:
    side = {"ha": "left", "size": 9.5} if right else {"ha": "right", "size": 9.5}
    note(ax, text, (100.0 * value, row), (9, 0) if right else (-9, 0), **side)
