"""Figures of a study: scores with their intervals beside the aims, and stated probabilities beside shares right."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from benchmarks.diagnosis.study.scores import Reliability, Score
from benchmarks.diagnosis.study.words import TELLING
from stiffarm.pages.figure_parts import above, drawing, named_rows, note
from stiffarm.pages.style import FAINT, INK, OKABE_ITO

# Looks by whether an aim is met: told apart by their markers, not by colour alone.
_LOOKS: Final[dict[bool | None, dict[str, Any]]] = {
    True: {"color": OKABE_ITO["blue"], "marker": "o"},
    False: {"color": OKABE_ITO["vermillion"], "marker": "X"},
    None: {"color": FAINT, "marker": "D"},
}
_MARK: Final[dict[str, Any]] = {"linestyle": "none", "markersize": 8.0}
_SAID: Final = {True: "aim met", False: "aim missed", None: "no aim"}


def scores_figure(found: Sequence[Score]) -> Figure:
    """Draw each share with its exact 95 % interval and its aim."""
    shown = [s for s in found if s.share.of]
    with drawing("Scores with 95 % intervals", (10.0, 1.6 + 0.34 * len(shown))) as (figure, (ax,)):
        for row, s in enumerate(shown):
            low, high = (100.0 * v for v in s.share.interval95)
            look = _LOOKS[s.is_met]
            ax.hlines(row, low, high, color=look["color"], linewidth=2.5)
            ax.plot(100.0 * s.share.count / s.share.of, row, **look, **_MARK)
            if s.aim is not None:
                ax.plot(100.0 * s.aim, row, "|", color=INK, markersize=16, markeredgewidth=2.0)
        named_rows(ax, [f"{s.name} ({s.share.of})" for s in shown])
        ax.set_xlim(-1.0, 101.0)
        ax.set_xlabel("share of sets (%)")
        keys = [Line2D([], [], label=text, **_LOOKS[met], **_MARK) for met, text in _SAID.items()]
        keys.append(
            Line2D([], [], color=INK, linestyle="none", marker="|", markersize=14, markeredgewidth=2.0, label="aim")
        )
        figure.legend(handles=keys, loc="outside lower left", ncols=4)
    return figure


def reliability_figure(bins: Sequence[Reliability]) -> Figure:
    """Draw the share right over the probability stated: on the line, what was stated is what holds."""
    with drawing("Stated probability and share right", (7.0, 5.6)) as (figure, (ax,)):
        ax.plot([0, 100], [0, 100], color=INK, linewidth=1.0, label="stated = right")
        for many, label in ((True, f"{TELLING} sets and more"), (False, f"fewer than {TELLING} sets")):
            mine = [b for b in bins if (b.right.of >= TELLING) == many]
            if not mine:
                continue
            x = 100.0 * np.array([b.stated for b in mine])
            y = 100.0 * np.array([b.right.count / b.right.of for b in mine])
            ends = 100.0 * np.array([b.right.interval95 for b in mine]).T
            look: dict[str, Any] = {"color": OKABE_ITO["blue"]} if many else {"color": INK, "markerfacecolor": "white"}
            ax.errorbar(x, y, yerr=[y - ends[0], ends[1] - y], fmt="o" if many else "s", label=label, capsize=3, **look)
            for at, b in zip(zip(x, y, strict=True), mine, strict=True):
                note(ax, str(b.right.of), at, (8, -8), ha="left", size=8.5)
        ax.set(xlim=(0, 101), ylim=(0, 103), xlabel="probability stated for what leads (%)", ylabel="right family (%)")
        above(ax, ax.get_legend_handles_labels()[0], 3)
    return figure
