"""Figures of a study: scores with their intervals beside the aims, and stated probabilities beside shares right."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from stiffarm.commands.study.scores import Reliability, Score
from stiffarm.pages.figure_parts import above, drawing, named_rows, note
from stiffarm.pages.style import FAINT, INK, OKABE_ITO

# From so many sets on a bin says something.
TELLING = 50


def scores_figure(found: Sequence[Score]) -> Figure:
    """Draw each share with its exact 95 % interval and its aim."""
    shown = [s for s in found if s.share.of]
    with drawing("Scores with 95 % intervals", (10.0, 1.6 + 0.34 * len(shown))) as (figure, (ax,)):
        for row, s in enumerate(shown):
            low, high = (100.0 * v for v in s.share.interval95)
            colour = {None: FAINT, True: OKABE_ITO["green"], False: OKABE_ITO["vermillion"]}[s.is_met]
            ax.hlines(row, low, high, color=colour, linewidth=2.5)
            ax.plot(100.0 * s.share.count / s.share.of, row, "o", color=colour)
            if s.aim is not None:
                ax.plot(100.0 * s.aim, row, "|", color=INK, markersize=16, markeredgewidth=2.0)
        named_rows(ax, [f"{s.name} ({s.share.of})" for s in shown])
        ax.set_xlim(-1.0, 101.0)
        ax.set_xlabel("share of sets (%); stroke: aim; green: met, red: missed")
    return figure


def reliability_figure(bins: Sequence[Reliability]) -> Figure:
    """Draw the share right over the probability stated: on the line, what was stated is what holds."""
    with drawing("Stated probability and share right", (7.0, 5.6)) as (figure, (ax,)):
        ax.plot([0, 100], [0, 100], color=INK, linewidth=1.0, label="stated = right")
        for many, label in ((True, f"{TELLING} sets and more"), (False, "fewer sets")):
            mine = [b for b in bins if (b.right.of >= TELLING) == many]
            if not mine:
                continue
            x = 100.0 * np.array([b.stated for b in mine])
            y = 100.0 * np.array([b.right.count / b.right.of for b in mine])
            ends = 100.0 * np.array([b.right.interval95 for b in mine]).T
            colour = OKABE_ITO["blue"] if many else OKABE_ITO["sky"]
            ax.errorbar(x, y, yerr=[y - ends[0], ends[1] - y], fmt="o", color=colour, label=label, capsize=3)
            for at, b in zip(zip(x, y, strict=True), mine, strict=True):
                note(ax, str(b.right.of), at, (8, -8), ha="left", size=8.5)
        ax.set(xlim=(0, 101), ylim=(0, 103), xlabel="probability stated for what leads (%)", ylabel="right family (%)")
        above(ax, ax.get_legend_handles_labels()[0], 3)
    return figure
