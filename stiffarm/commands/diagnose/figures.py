"""Figures of a diagnosis: read against simulated, residuals and the gap, before and after; what explains it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from robots import InputError
from robots.arrays import Array
from robots.quantities import percent, significant
from stiffarm.pages.dumbbells import dumbbells_figure
from stiffarm.pages.figure_parts import drawing, named_columns, named_rows, note
from stiffarm.pages.style import FAINT, INK, OKABE_ITO

BEFORE: Final = OKABE_ITO["vermillion"]
AFTER: Final = OKABE_ITO["blue"]
_MANY_BARS, _NUMBERED = 12, 3
_MANY_POINTS: Final = 250
UNKNOWN: Final = OKABE_ITO["orange"]
# Looks of candidates by kind: they differ by lightness or hatching, not by hue alone.
_KINDS: Final[dict[str, dict[str, Any]]] = {
    "effect": {"facecolor": OKABE_ITO["sky"], "edgecolor": "white"},
    "chosen": {"facecolor": OKABE_ITO["blue"], "edgecolor": "white"},
    "none": {"facecolor": "#D5D8DC", "edgecolor": "#6F757D", "linewidth": 0.8},
    "unknown": {"facecolor": UNKNOWN, "edgecolor": "white", "hatch": "////"},
}
_MOST_TWINS: Final = 18


@dataclass(frozen=True)
class Fit:
    """Readings of one kind of unit and what a model says of them.

    ``name``: of the model; ``read``, ``simulated`` (m,) in ``unit``; ``noise``: standard deviation of a reading;
    ``pose``, ``load``, ``phase``: labels (m,).
    """

    name: str
    read: Array
    simulated: Array
    noise: float
    pose: Sequence[str]
    load: Sequence[str]
    phase: Sequence[str]
    unit: str = "mm"

    @property
    def residual(self) -> Array:
        """Read minus simulated (m,)."""
        return self.read - self.simulated

    @property
    def rms(self) -> float:
        """RMS of the residuals."""
        return float(np.sqrt(np.mean(self.residual**2)))


def match_figure(fits: Sequence[Fit]) -> Figure:
    """Draw what was read against what each model says, with the gap to the line where both are equal.

    Raises
    ------
    InputError
        No model, or no readings.
    """
    if not fits or not len(fits[0].read):
        raise InputError("match figure", code="B002", allowed="at least one model and one reading")
    values = np.concatenate([v for f in fits for v in (f.read, f.simulated)])
    low, high = float(values.min()), float(values.max())
    room = 0.05 * max(high - low, 1e-9)
    ends = np.array([low - room, high + room])
    heading = "Read against simulated; vertical strokes are the gap, the band is two standard deviations"
    with drawing(heading, (10.0, 5.9), 1, len(fits), sharey=True) as (figure, axes):
        for ax, f, colour in zip(axes, fits, _colours(len(fits)), strict=True):
            ax.fill_between(ends, ends - 2.0 * f.noise, ends + 2.0 * f.noise, color=FAINT, alpha=0.35, linewidth=0)
            ax.plot(ends, ends, color=INK, linewidth=0.9)
            ax.vlines(f.simulated, f.simulated, f.read, color=colour, alpha=0.45, linewidth=0.9)
            _points(ax, f.simulated, f.read, f.phase, colour)
            ax.set(xlim=ends, ylim=ends, xlabel=f"simulated ({f.unit})")
            ax.set_box_aspect(1.0)
            ax.set_title(f"{f.name}: RMS {f.rms:.3f} {f.unit}", loc="left")
        axes[0].set_ylabel(f"read ({fits[0].unit})")
    return figure


def _colours(count: int) -> tuple[str, ...]:
    return (BEFORE, AFTER)[:count]


def _points(ax: Axes, x: Array, y: Array, phase: Sequence[str], colour: str) -> None:
    look: dict[str, Any] = {"color": colour, "linewidths": 0, "alpha": 0.75, "zorder": 2}
    size = 10 if len(x) > _MANY_POINTS else 22
    down = np.array([p == "unloading" for p in phase])
    ax.scatter(x[~down], y[~down], s=size, marker="o", label="loading", **look)
    if down.any():
        ax.scatter(x[down], y[down], s=1.3 * size, marker="v", label="unloading", **look)
        handles, labels = ax.get_legend_handles_labels()
        ax.legend(handles, labels, loc="upper left")


def residuals_figure(fits: Sequence[Fit]) -> Figure:
    """Draw residuals over poses and over loads, a row for each model, all on one scale.

    Raises
    ------
    InputError
        No model, or no readings.
    """
    if not fits or not len(fits[0].read):
        raise InputError("residuals figure", code="B002", allowed="at least one model and one reading")
    heading = "Residuals over poses and loads; black: mean of a group, band: two standard deviations"
    size = (10.0, 1.0 + 2.9 * len(fits))
    with drawing(heading, size, len(fits), 2, sharey=True, width_ratios=[2.3, 1.0]) as (figure, axes):
        for k, (f, colour) in enumerate(zip(fits, _colours(len(fits)), strict=True)):
            left, right = axes[2 * k], axes[2 * k + 1]
            _strip(left, f, f.pose, colour)
            _strip(right, f, f.load, colour)
            left.set_title(f"{f.name}: RMS {f.rms:.3f} {f.unit}", loc="left")
            left.set_ylabel(f"read − simulated ({f.unit})")
            if k == len(fits) - 1:
                left.set_xlabel("pose")
                right.set_xlabel("load; left loading, right unloading" if "unloading" in f.phase else "load")
    return figure


def _strip(ax: Axes, f: Fit, labels: Sequence[str], colour: str) -> None:
    names = list(dict.fromkeys(labels))
    place = np.array([names.index(label) for label in labels], dtype=np.float64)
    down = np.array([p == "unloading" for p in f.phase])
    shift = np.where(down, 0.2, -0.2) if down.any() and not down.all() else np.zeros(len(place))
    jitter = np.zeros(len(place))
    for k in range(len(names)):
        for side in (down, ~down):
            mine = np.flatnonzero((place == k) & side)
            jitter[mine] = np.linspace(-0.13, 0.13, len(mine)) if len(mine) > 1 else 0.0
    ax.axhspan(-2.0 * f.noise, 2.0 * f.noise, color=FAINT, alpha=0.35, linewidth=0, zorder=0.2)
    ax.axhline(0.0, color=INK, linewidth=0.8, zorder=1)
    size = 7 if len(place) > _MANY_POINTS else 18
    for side, marker in ((~down, "o"), (down, "v")):
        x = (place + shift + jitter)[side]
        ax.scatter(x, f.residual[side], s=size, marker=marker, color=colour, alpha=0.6, linewidths=0, zorder=2)
        groups = [
            np.mean(f.residual[side & (place == k)]) if (side & (place == k)).sum() > 1 else np.nan
            for k in range(len(names))
        ]
        middle = np.arange(len(names)) + (np.unique(shift[side])[0] if side.any() else 0.0)
        half = 0.17 if np.any(shift) else 0.3
        ax.hlines(groups, middle - half, middle + half, color=INK, linewidth=1.5, zorder=3)
    named_columns(ax, names)


def gap_figure(
    rows: Mapping[str, tuple[float, float]], noise: float, least: float, name: str = "noise alone"
) -> Figure:
    """Draw the RMS error (mm) before and after, a dumbbell for each way to judge it (name -> before, after).

    ``noise``: what noise alone would give, called ``name``; ``least``: the least that springs alone could reach in
    the fit. After is NaN where the model did not change.

    Raises
    ------
    InputError
        No rows.
    """
    if not rows:
        raise InputError("gap figure: no errors to draw", code="B002")
    lines = {f"{name}: {significant(noise)}": noise}
    if np.isfinite(least):
        lines[f"springs alone, at best: {significant(least)}"] = least
    return dumbbells_figure("The gap between simulation and measurement", rows, "RMS error (mm)", lines=lines)


@dataclass(frozen=True)
class Bar:
    """A candidate: ``kind`` is ``effect``, ``chosen`` (taken into the model), ``none`` or ``unknown``."""

    name: str
    probability: float
    kind: str


def where_figure(groups: Mapping[str, Sequence[tuple[str, float, float, float]]]) -> Figure:
    """Draw where the disagreement lies: for each kind of group (label, share, mean square of standardised residuals).

    The fourth is the share's standard deviation, NaN where it is not known. Poses have a row of their own; a
    kind of which all readings are of one group is left out. Shares are NaN where nothing is beyond the noise; then mean
    squares are drawn.

    Raises
    ------
    InputError
        No groups.
    """
    if not groups or not all(groups.values()):
        raise InputError("where figure: no groups to draw", code="B002")
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
                _share_bars(ax, kind, groups[kind], values=number > 0, part=len(kinds))
    return figure


def _share_bars(
    ax: Axes, kind: str, groups: Sequence[tuple[str, float, float, float]], *, values: bool, part: int
) -> None:
    labels = [g[0] for g in groups]
    share = 100.0 * np.array([g[1] for g in groups])
    known = bool(np.isfinite(share).all())
    heights = share if known else np.array([g[2] for g in groups])
    x = np.arange(len(groups))
    ax.bar(x, heights, 0.7, color=OKABE_ITO["vermillion"] if known else FAINT)
    sd = 100.0 * np.nan_to_num([g[3] if known else 0.0 for g in groups])
    if sd.any():
        ax.errorbar(x, heights, [np.minimum(sd, heights), sd], fmt="none", ecolor=INK, elinewidth=0.9, capsize=2.0)
    ax.axhline(100.0 / len(groups) if known else 1.0, color=INK, linewidth=0.9, linestyle="--")
    if values:
        # Many bars leave no room for all their numbers.
        named = np.argsort(-heights)[:_NUMBERED] if len(groups) > _MANY_BARS else range(len(groups))
        for k in named:
            v = heights[k]
            note(ax, _with_sd(v, sd[k]) if known else f"{v:.2f}", (k, v + sd[k]), (0, 2), va="bottom")
        ax.margins(y=0.16)
    named_columns(ax, labels, part)
    ax.set(
        ylabel="share (%)" if known else "mean square",
        xlabel=f"by {kind}" + (" (dashed: all alike)" if known and not values else ""),
    )


def _with_sd(value: float, sd: float) -> str:
    return f"{value:.0f} ± {sd:.0f} %" if sd >= 0.5 else f"{value:.0f} %"


def ranking_figure(bars: Sequence[Bar], heading: str) -> Figure:
    """Draw how probable the candidates are.

    Raises
    ------
    InputError
        No candidates.
    """
    if not bars:
        raise InputError("ranking figure: no candidates to draw", code="B002")
    words = {
        "chosen": "taken into the model",
        "effect": "other effects",
        "none": "nothing missing",
        "unknown": "something unknown",
    }
    y = np.arange(len(bars))
    with drawing(heading, (10.0, 1.4 + 0.3 * len(bars))) as (figure, (ax,)):
        drawn = ax.barh(y, [100.0 * b.probability for b in bars], 0.68)
        for patch, b in zip(drawn, bars, strict=True):
            patch.set(**_KINDS[b.kind])
        for k, b in enumerate(bars):
            note(ax, percent(b.probability), (100.0 * b.probability, k), (4, 0), ha="left")
        named_rows(ax, [words[b.kind] if b.kind in ("none", "unknown") else b.name for b in bars])
        ax.set(xlim=(0.0, 112.0), xticks=range(0, 101, 20), xlabel="probability (%)")
        kinds = [kind for kind in words if any(b.kind == kind for b in bars)]
        handles = [Patch(label=words[kind], **_KINDS[kind]) for kind in kinds]
        figure.legend(handles=handles, loc="outside lower left", ncols=4)
    return figure


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
        raise InputError("twins figure: no twins to draw", code="B002")
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
