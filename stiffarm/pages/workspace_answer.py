"""How stiff an arm is at its tool: key figures, sentences and one picture, for the first screen of pages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import MappingProxyType
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from robots.quantities import known_to, ranged, significant
from stiffarm.pages.figure_parts import drawing, log_ticks, named_rows, note
from stiffarm.pages.numbers import grouped
from stiffarm.pages.report import KeyFigure
from stiffarm.pages.style import FAINT, INK, OKABE_ITO
from stiffarm.session.workspace import Spot, WorkspaceStiffness

UNIT: Final = "N/mm"
NAMES: Final = MappingProxyType(
    {"softest": "softest pose", "median": "median pose", "stiffest": "stiff pose, 19 of 20 are softer"}
)
# An interval with its ends more than this factor apart says that the stiffness is not known.
_NOT_KNOWN: Final = 10.0


def value_words(spot: Spot) -> str:
    """``290 N/mm``, with the digits that its interval leaves; of one that says nothing only the lower limit."""
    if not spot.has_interval:
        return f"{significant(spot.stiffness, 2)} {UNIT}"
    if math.isinf(spot.high) or spot.high > _NOT_KNOWN * spot.low:
        return f"at least {significant(spot.low, 2)} {UNIT}"
    return f"{known_to(spot.stiffness, spot.low, spot.high)} {UNIT}"


def interval_words(spot: Spot) -> str:
    """``95 %: 260 to 330 N/mm``."""
    if not spot.has_interval:
        return "no interval known"
    more = f"; open: {open_words(spot.open_names, 1)}" if spot.open_names else ""
    return f"95\u00a0%: {ranged(spot.low, spot.high, UNIT)}{more}"


def open_words(names: Sequence[str], most: int) -> str:
    """What the readings left open: so many by name, of the rest the number."""
    single = [name for name in names if " " not in name]
    shown = single[:most]
    rest = len(single) - len(shown)
    words = ", ".join(shown) + (f"{' and ' if shown else ''}{rest} more" if rest else "")
    return words or "only some sums of parameters are known"


def key_figures(found: WorkspaceStiffness) -> list[KeyFigure]:
    """The three poses with what gives way there."""
    return [
        KeyFigure(
            value_words(spot),
            f"{NAMES[spot.name]}; {spot.part}: {100.0 * spot.share:.0f}\u00a0% of the deflection",
            interval_words(spot),
        )
        for spot in found.spots
    ]


def lede(found: WorkspaceStiffness) -> str:
    """The answer in one or two sentences."""
    soft, middle, stiff = (value_words(spot).removesuffix(f" {UNIT}") for spot in found.spots)
    parts = list(dict.fromkeys(spot.part for spot in found.spots[:2]))
    most = parts[0] if len(parts) == 1 else f"{parts[0]} at the softest and {parts[1]} at the median pose"
    return (
        f"Under a vertical load the stiffness at the tool is {soft} {UNIT} in the softest pose of the workspace, "
        f"{middle} in the median one and {stiff} in a stiff one (19 of 20 are softer). The largest share of the "
        f"deflection is in {most}."
    )


def interval_remark(found: WorkspaceStiffness) -> str:
    """What the intervals hold, and what they do not."""
    if not found.has_intervals:
        return (
            "There is no interval: no calibration left the covariance of its parameters. One that matches each pose by "
            "itself has none, nor have springs at their bounds."
        )
    text = "Intervals (95\u00a0%) include the uncertainty of the calibrated parameters"
    if found.open_names:
        return f"{text}, but not what the readings left open: {open_words(found.open_names, 4)}."
    return f"{text}."


def answer_figure(found: WorkspaceStiffness) -> Figure:
    """The three poses with their intervals, and how the stiffness is spread over the workspace."""
    values = found.values[found.values > 0.0]
    ends = [v for s in found.spots for v in (s.low, s.stiffness, s.high) if math.isfinite(v)]
    # The few stiffest poses of all say nothing about the arm: they leave the axis.
    low, high = min([*ends, float(values[0])]) / 1.25, 1.25 * max([*ends, float(np.quantile(values, 0.99))])
    heading = f"Stiffness at the tool, {grouped(str(len(found.values)))} poses"
    with drawing(heading, (5.2, 3.7), 2, 1, sharex=True, height_ratios=[1.0, 1.6]) as (figure, (above, below)):
        edges = np.geomspace(low, high, 41)
        above.stairs(np.histogram(values, edges)[0], edges, color=FAINT, fill=True)
        above.set(ylabel="poses", yticks=[])
        above.grid(visible=False, axis="y")
        for row, (spot, colour) in enumerate(zip(found.spots, ("vermillion", "black", "blue"), strict=True)):
            top = min(spot.high, high) if spot.has_interval else spot.stiffness
            if spot.has_interval:
                below.hlines(row, max(spot.low, low), top, color=OKABE_ITO[colour], linewidth=4.0, alpha=0.55)
                if spot.high > high:
                    below.plot(top, row, ">", color=OKABE_ITO[colour], markersize=8, clip_on=False)
            below.plot(spot.stiffness, row, "os^"[row], color=OKABE_ITO[colour], markersize=8, zorder=3)
            above.axvline(spot.stiffness, color=OKABE_ITO[colour], linewidth=1.2)
            left = math.log(spot.stiffness / low) > 0.62 * math.log(high / low)
            text = value_words(spot).removesuffix(f" {UNIT}")
            side = "right" if left else "left"
            at = min(spot.low if spot.has_interval else spot.stiffness, spot.stiffness) if left else top
            note(below, text, (at, row), (-9 if left else 9, 0), ha=side, size=10, color=INK)
        below.set(xscale="log", xlim=(low, high), xlabel=f"stiffness under a vertical load ({UNIT})")
        named_rows(
            below,
            [f"{s.name.replace('stiffest', 'stiff')}\n{s.part} {100.0 * s.share:.0f} %" for s in found.spots],
            size=10,
        )
        log_ticks(below.xaxis, lambda v: significant(v, 1 if v < 1 else 2) if v >= 1000 else f"{v:g}")
        above.tick_params(axis="x", length=0)
    return figure
