"""Figures of a rehearsal: the numbers hidden beside those found, and the tally of many draws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from stiffarm.commands.rehearse.step import Number
from stiffarm.pages.figure_parts import above, drawing, named_rows, note
from stiffarm.pages.style import FAINT, INK, OKABE_ITO


def numbers_figure(numbers: Sequence[Number]) -> Figure:
    """Draw each number found over its true value, with its 95 % interval."""
    drawn = [n for n in numbers if n.found is not None and n.true != 0.0]
    with drawing("What was found over what was hidden, with 95 % intervals", (10.0, 1.6 + 0.5 * len(drawn))) as (
        figure,
        (ax,),
    ):
        ax.axvline(1.0, color=INK, linewidth=1.2)
        furthest = 1.0
        for row, n in enumerate(drawn):
            value = (n.found or 0.0) / n.true
            ends = (value, value) if n.interval95 is None else tuple(sorted(e / n.true for e in n.interval95))
            shown = [e for e in (value, *ends) if np.isfinite(e)]
            furthest = max(furthest, *(abs(e - 1.0) for e in shown))
            ax.plot(np.nan_to_num(ends, posinf=1e9, neginf=-1e9), [row, row], color=OKABE_ITO["blue"], linewidth=2.5)
            ax.plot([value], [row], "o", color=OKABE_ITO["blue"])
        named_rows(ax, [f"{n.name} ({n.true:.3g}{'' if n.unit == '1' else ' ' + n.unit})" for n in drawn])
        room = min(1.1 * furthest, 3.0)
        ax.set_xlim(1.0 - room, 1.0 + room)
        ax.set_ylim(len(drawn) - 0.5, -0.5)
        ax.set_xlabel("found / hidden")
    return figure


def tally_figure(every: Mapping[str, int], seen: Mapping[str, int]) -> Figure:
    """Draw how many draws came out how: those that the readings could show, and the others."""
    with drawing("What came of the draws", (10.0, 1.9 + 0.45 * len(every))) as (figure, (ax,)):
        rows = np.arange(len(every))
        visible = np.array([seen.get(name, 0) for name in every])
        hidden = np.array(list(every.values())) - visible
        looks = (
            (visible, 0 * visible, OKABE_ITO["blue"], "visible in these readings"),
            (hidden, visible, FAINT, "hardly visible"),
        )
        for count, left, colour, label in looks:
            ax.barh(rows, count, 0.7, left=left, color=colour, label=label)
        for row, count in enumerate(every.values()):
            note(ax, str(count), (count, row), (6, 0), va="center", ha="left")
        named_rows(ax, list(every))
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.set_xlim(0.0, 1.08 * max(every.values()))
        ax.set_xlabel("draws")
        above(ax, ax.get_legend_handles_labels()[0], 2)
    return figure
