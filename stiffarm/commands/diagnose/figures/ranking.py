"""Figures of what explains a disagreement: where it lies, how probable each candidate is, which are twins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from robots import InputError
from stiffarm.pages.figure_parts import drawing, named_columns, named_rows, note
from stiffarm.pages.style import FAINT, INK, OKABE_ITO

EFFECT: Final = OKABE_ITO["blue"]
CHOSEN: Final = OKABE_ITO["green"]
UNKNOWN: Final = OKABE_ITO["orange"]
NOTHING: Final = "#8A9097"
_MOST_TWINS: Final = 18


@dataclass(frozen=True)
class Bar:
    """A candidate: ``kind`` is ``effect``, ``chosen`` (taken into the model), ``none`` or ``unknown``."""

    name: str
    probability: float
    left_out_rms_mm: float
    kind: str


def where_figure(groups: Mapping[str, Sequence[tuple[str, float, float]]]) -> Figure:
    """Draw where the disagreement lies: for each kind of group (label, share, mean square of standardised residuals).

    Poses have a row of their own; a kind of which all readings are of one group is left out. Shares are NaN where
    nothing is beyond the noise; then mean squares are drawn.

    Raises
    ------
    InputError
        No groups.
    """
    if not groups or not all(groups.values()):
        raise InputError("where figure: no groups to draw")
    small = [kind for kind, some in groups.items() if kind != "pose" and len(some) > 1]
    rows = [["pose"], small] if small else [["pose"]]
    known = bool(np.isfinite([g[1] for g in groups["pose"]]).all())
    shares = "Where simulation and measurement disagree: shares of what is beyond the noise"
    heading = shares if known else "Mean squares of the residuals over the noise; 1 is noise alone"
    with drawing(heading, (10.0, 6.2 if small else 3.6), 0) as (figure, _):
        figure.set_layout_engine("constrained")
        for number, (part, kinds) in enumerate(
            zip(figure.subfigures(len(rows), 1, squeeze=False)[:, 0], rows, strict=True)
        ):
            axes = part.subplots(1, len(kinds), squeeze=False)[0]
            for ax, kind in zip(axes, kinds, strict=True):
                _share_bars(ax, kind, groups[kind], values=number > 0)
    return figure


def _share_bars(ax: Axes, kind: str, groups: Sequence[tuple[str, float, float]], *, values: bool) -> None:
    labels = [g[0] for g in groups]
    share = 100.0 * np.array([g[1] for g in groups])
    known = bool(np.isfinite(share).all())
    heights = share if known else np.array([g[2] for g in groups])
    x = np.arange(len(groups))
    ax.bar(x, heights, 0.7, color=OKABE_ITO["vermillion"] if known else FAINT)
    ax.axhline(100.0 / len(groups) if known else 1.0, color=INK, linewidth=0.9, linestyle="--")
    if values:
        for k, v in enumerate(heights):
            note(ax, f"{v:.0f} %" if known else f"{v:.2f}", (k, v), (0, 2), va="bottom")
        ax.margins(y=0.16)
    named_columns(ax, labels)
    ax.set(
        ylabel="share (%)" if known else "mean square",
        xlabel=f"by {kind}" + (" (dashed: all alike)" if known and not values else ""),
    )


def ranking_figure(bars: Sequence[Bar], heading: str) -> Figure:
    """Draw the candidates: probability, and the error at poses left out.

    Raises
    ------
    InputError
        No candidates.
    """
    if not bars:
        raise InputError("ranking figure: no candidates to draw")
    colours = {"effect": EFFECT, "chosen": CHOSEN, "none": NOTHING, "unknown": UNKNOWN}
    words = {"chosen": "taken into the model", "effect": "other effects", "none": "nothing missing",
             "unknown": "something unknown"}  # fmt: skip
    y = np.arange(len(bars))
    size = (10.0, 1.7 + 0.34 * len(bars))
    with drawing(heading, size, 1, 2, sharey=True, width_ratios=[1.7, 1.0]) as (figure, (left, right)):
        left.barh(y, [100.0 * b.probability for b in bars], 0.68, color=[colours[b.kind] for b in bars])
        for k, b in enumerate(bars):
            note(left, _percent(b.probability), (100.0 * b.probability, k), (4, 0), ha="left")
        named_rows(left, [words[b.kind] if b.kind in ("none", "unknown") else b.name for b in bars])
        left.set(xlim=(0.0, 112.0), xticks=range(0, 101, 20), xlabel="probability (%)")
        rms = [b.left_out_rms_mm for b in bars]
        right.hlines(y, 0.0, rms, color="#D5D8DC", linewidth=1.4)
        right.scatter(rms, y, s=34, color=[colours[b.kind] for b in bars], zorder=3, linewidths=0)
        right.set(xlim=(0.0, 1.12 * max(rms)), xlabel="error at poses left out, RMS (mm)")
        right.grid(visible=False, axis="y")
        right.tick_params(axis="y", length=0)
        kinds = [kind for kind in words if any(b.kind == kind for b in bars)]
        handles = [Patch(color=colours[kind], label=words[kind]) for kind in kinds]
        figure.legend(handles=handles, loc="outside lower left", ncols=4)
    return figure


def _percent(p: float) -> str:
    if p > 0.9995:
        return "> 99.9 %"
    return f"{100.0 * p:.1f} %" if p >= 0.0005 else "< 0.1 %"


def twins_figure(twins: Mapping[str, Sequence[str]]) -> Figure:
    """Draw which candidates (rows) these readings could not tell from which others (columns).

    Raises
    ------
    InputError
        No candidate has a twin.
    """
    count: dict[str, int] = {}
    for others in twins.values():
        for code in others:
            count[code] = count.get(code, 0) + 1
    if not count:
        raise InputError("twins figure: no twins to draw")
    rows = list(twins)
    columns = [code for code in rows if code in count]
    columns += sorted((c for c in count if c not in columns), key=lambda c: -count[c])
    columns, more = columns[:_MOST_TWINS], len(columns) - _MOST_TWINS
    heading = "Dots: these readings could not tell the two apart"
    with drawing(heading, (10.0, 2.6 + 0.32 * len(rows))) as (figure, (ax,)):
        for i, row in enumerate(rows):
            for k, column in enumerate(columns):
                if row == column:
                    ax.scatter(k, i, s=60, marker="s", color=FAINT, linewidths=0)
                elif column in twins[row]:
                    ax.scatter(k, i, s=90, marker="o", color=UNKNOWN, linewidths=0)
        ax.set_xticks(range(len(columns)), columns, rotation=55, ha="right", rotation_mode="anchor")
        ax.set_yticks(range(len(rows)), rows)
        ax.set(xlim=(-0.6, max(len(columns), 12) - 0.4), ylim=(len(rows) - 0.4, -0.6))
        if more > 0:
            ax.set_xlabel(f"and {more} more")
    return figure
