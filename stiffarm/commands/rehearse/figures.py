"""Figures of a rehearsal: the numbers hidden beside those found, and the tally of many draws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from stiffarm.commands.rehearse.step import Number
from stiffarm.pages.bars import bars_figure
from stiffarm.pages.figure_parts import drawing, named_rows
from stiffarm.pages.style import INK, OKABE_ITO


def numbers_figure(numbers: Sequence[Number]) -> Figure | None:
    """Draw each number found over its true value, with its 95 % interval; None where none was found."""
    drawn = [n for n in numbers if n.found is not None and n.true != 0.0]
    if not drawn:
        return None
    with drawing("What was found over what was hidden, with 95 % intervals", (10.0, 1.6 + 0.5 * len(drawn))) as (
        figure, (ax,),
    ):  # fmt: skip
        ax.axvline(1.0, color=INK, linewidth=1.2)
        furthest = 1.0
        for row, n in enumerate(drawn):
            value = (n.found or 0.0) / n.true
            ends = (value, value) if n.interval95 is None else tuple(sorted(e / n.true for e in n.interval95))
            shown = [e for e in (value, *ends) if np.isfinite(e)]
            furthest = max(furthest, *(abs(e - 1.0) for e in shown))
            ax.plot(np.nan_to_num(ends, posinf=1e9, neginf=-1e9), [row, row], color=OKABE_ITO["blue"], linewidth=2.5)
            ax.plot([value], [row], "o", color=OKABE_ITO["blue"])
        named_rows(ax, [f"{n.name} ({n.true:.3g} {n.unit})" for n in drawn])
        room = min(1.1 * furthest, 3.0)
        ax.set_xlim(1.0 - room, 1.0 + room)
        ax.set_ylim(len(drawn) - 0.5, -0.5)
        ax.set_xlabel("found / hidden")
    return figure


def tally_figure(every: dict[str, int], seen: dict[str, int]) -> Figure:
    """Draw how many draws came out how: of all, and of those that the readings could show."""
    series = {
        "all draws": {k: float(v) for k, v in every.items()},
        "visible in these readings": {k: float(seen.get(k, 0)) for k in every},
    }
    return bars_figure("What came of the draws", series, "draws")
