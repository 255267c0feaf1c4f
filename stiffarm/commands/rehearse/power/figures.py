"""The picture of a power analysis: each effect's chances to be found and to be named, with their intervals."""

from __future__ import annotations

from matplotlib.figure import Figure

from doe.power.chances import POWER
from stiffarm.commands.rehearse.power.step import Addition, Power
from stiffarm.pages.bars import bars_figure
from stiffarm.pages.figure_parts import above, drawing, named_rows
from stiffarm.pages.style import FAINT, INK, OKABE_ITO

# Effects in one picture: more cannot be read.
DRAWN = 30


def chances_figure(r: Power) -> Figure:
    """Draw the chances of every effect, most surely named first; of many the first :data:`DRAWN`."""
    shown = r.judged[:DRAWN]
    heading = "Would it be found, would it be named? Usual sizes, 95 % intervals"
    with drawing(heading, (10.0, 1.6 + 0.27 * len(shown))) as (
        figure,
        (ax,),
    ):
        ax.axvline(100 * POWER, color=INK, linewidth=1.0, linestyle=(0, (4, 2)))
        looks = (("found", -0.17, "o", "white", OKABE_ITO["blue"]), ("named", 0.17, "D", None, OKABE_ITO["vermillion"]))
        for name, off, marker, face, colour in looks:
            for row, p in enumerate(shown):
                c = getattr(p, name)
                ax.plot([100 * c.low, 100 * c.high], [row + off] * 2, color=colour, linewidth=1.6, alpha=0.55)
                ax.plot(
                    [100 * c.value],
                    [row + off],
                    marker,
                    color=colour,
                    markerfacecolor=face or colour,
                    markersize=5.5,
                    label=name if row == 0 else None,
                )
        for row in range(0, len(shown), 2):
            ax.axhspan(row - 0.5, row + 0.5, color=FAINT, alpha=0.18, linewidth=0)
        named_rows(ax, [p.code for p in shown])
        ax.set_xlim(-2.0, 102.0)
        ax.set_xlabel("chance (%); dashed: 80 %")
        above(ax, ax.get_legend_handles_labels()[0], 2)
    return figure


def additions_figure(some: tuple[Addition, ...]) -> Figure:
    """Draw what one more set-up, load or repeat adds."""
    series = {name: {a.what: 100.0 * getattr(a, name) for a in some} for name in ("found", "named")}
    return bars_figure("What one more adds, in the mean over all effects", series, "gain (points of 100)")
