"""Figures of a diagnosis: residuals and the gap, before and after; candidates, laws, and traces in the readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from doe.diagnosis.findings.laws import LawCurve
from doe.diagnosis.findings.traces import Row, Trace, Traces
from robots import InputError
from robots.arrays import Array
from robots.quantities import percent, significant
from stiffarm.pages.dumbbells import dumbbells_figure
from stiffarm.pages.figure_parts import above, drawing, named_columns, named_rows, note
from stiffarm.pages.style import FAINT, INK, OKABE_ITO

BEFORE: Final = OKABE_ITO["vermillion"]
AFTER: Final = OKABE_ITO["blue"]
_MANY_POINTS: Final = 250
UNKNOWN: Final = OKABE_ITO["orange"]
# Looks of candidates by kind: they differ by lightness or hatching, not by hue alone.
_KINDS: Final[dict[str, dict[str, Any]]] = {
    "effect": {"facecolor": OKABE_ITO["sky"], "edgecolor": "white"},
    "chosen": {"facecolor": OKABE_ITO["blue"], "edgecolor": "white"},
    "none": {"facecolor": "#D5D8DC", "edgecolor": "#6F757D", "linewidth": 0.8},
    "unknown": {"facecolor": UNKNOWN, "edgecolor": "white", "hatch": "////"},
}
_UP: Final = OKABE_ITO["blue"]
_DOWN: Final = OKABE_ITO["vermillion"]
_MANY: Final = 200
# Single readings at small torques may imply wild turns; the axis keeps to these quantiles of them.
_KEPT: Final = (1.0, 99.0)
_LEFT: Final[dict[str, Any]] = {"color": INK, "linestyle": "none", "marker": "o", "markersize": 2.4, "alpha": 0.55}
_OWN: Final[dict[str, Any]] = {"color": OKABE_ITO["vermillion"], "linewidth": 1.7}
_TWIN: Final[dict[str, Any]] = {"color": OKABE_ITO["blue"], "linewidth": 1.4, "linestyle": (0, (4, 1.2))}
_MOST_NAMES: Final = 12
# From this many readings on lines are thin.
_MANY_READINGS: Final = 120


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
        for k, (f, colour) in enumerate(zip(fits, (BEFORE, AFTER), strict=False)):
            left, right = axes[2 * k], axes[2 * k + 1]
            _strip(left, f, f.pose, colour)
            _strip(right, f, f.load, colour)
            left.set_title(f"{f.name}: RMS {significant(f.rms)} {f.unit}", loc="left")
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


def law_figure(curve: LawCurve, heading: str) -> Figure:
    """Draw a joint's law with its 95 % band, the spring without it, and what single readings imply.

    Over the torque: the turn; for friction the loop of loading and unloading. Over the angle: the compliance.
    """
    with drawing(heading, (8.4, 5.0)) as (figure, (ax,)):
        names = ("loading", "unloading") if len(curve.branches) > 1 else ("law found",)
        for (x, y, low, high), colour, name in zip(curve.branches, (_UP, _DOWN), names, strict=False):
            ax.fill_between(x, low, high, color=colour, alpha=0.18, linewidth=0)
            ax.plot(x, y, color=colour, linewidth=2.4, label=name)
        ax.plot(curve.branches[0][0], curve.plain, color=INK, linestyle="--", linewidth=1.2, label="its spring alone")
        size = 8 if len(curve.read_x) > _MANY else 20
        look: dict[str, Any] = {"s": size, "alpha": 0.45, "linewidths": 0, "zorder": 1.5}
        for side, colour, name in (
            (~curve.unloading, _UP, "readings"),
            (curve.unloading, _DOWN, "readings, unloading"),
        ):
            if side.any():
                ax.scatter(curve.read_x[side], curve.read_y[side], color=colour, label=name, **look)
        _limits(ax, curve)
        if curve.axis == "torque":
            ax.set(xlabel=f"torque about {curve.joint} under the load (N m)", ylabel=f"turn of {curve.joint} (mrad)")
        else:
            ax.set(xlabel=f"angle of {curve.joint} (deg)", ylabel=f"compliance of {curve.joint} (µrad/(N m))")
        above(ax, ax.get_legend_handles_labels()[0], 5)
    return figure


def _limits(ax: Axes, curve: LawCurve) -> None:
    values = [np.concatenate([low, high]) for _, _, low, high in curve.branches]
    ends = [curve.plain, *values]
    if curve.read_y.size:
        ends.append(np.percentile(curve.read_y, _KEPT))
    flat = np.concatenate(ends)
    low, high = float(np.nanmin(flat)), float(np.nanmax(flat))
    if curve.axis == "angle":
        low = min(low, 0.0) if low < 0.3 * high else low
    room = 0.06 * max(high - low, 1e-9)
    ax.set_ylim(low - room, high + room)


def traces_figure(of: Traces) -> Figure:
    """Draw a row for each effect: what springs leave of the readings, its trace, and those of its twins beside it."""
    columns = 1 + max(len(row.twins) for row in of.rows)
    heading = "The trace of each credible effect over the readings" + ", its twins beside it" * (columns > 1)
    size = (10.0, 1.1 + 2.2 * len(of.rows))
    with drawing(heading, size, len(of.rows), columns, sharex=True, sharey="row") as (figure, axes):
        for k, row in enumerate(of.rows):
            mine = axes[columns * k : columns * (k + 1)]
            for ax in mine[1 + len(row.twins) :]:
                ax.set_axis_off()
            _panel(mine[0], of, row, row.own, f"{row.own.code}\n{percent(row.probability)} before its checks")
            for ax, twin in zip(mine[1:], row.twins, strict=False):
                _panel(ax, of, row, twin, f"twin {twin.code}\noff by {significant(twin.off, 2)} {of.unit}")
            mine[0].set_ylabel(f"change ({of.unit})")
            _trace_limits(mine[0], row)
        handles = [
            Line2D(
                [],
                [],
                label="left over by springs" + " and what was found before" * any(r.given for r in of.rows),
                **{**_LEFT, "markersize": 5.0},
            ),
            Line2D([], [], label="trace of the effect", **_OWN),
        ]
        if columns > 1:
            handles.append(Line2D([], [], label="trace of a twin, as like as it can be made", **_TWIN))
        figure.legend(handles=handles, loc="outside lower left", ncols=3)
    return figure


def _panel(ax: Axes, of: Traces, row: Row, drawn: Trace, name: str) -> None:
    x = np.arange(len(of.pose))
    for k in _breaks(of.read):
        ax.axvline(k - 0.5, color=INK, linewidth=0.8)
    for k in _breaks(of.pose):
        ax.axvline(k - 0.5, color=FAINT, linewidth=0.4)
    ax.plot(x, row.left, zorder=1.5, **_LEFT)
    look = _OWN if drawn is row.own else _TWIN
    thin = {"linewidth": 1.0} if len(x) > _MANY_READINGS else {}
    ax.step(x, drawn.values, where="mid", zorder=2, **{**look, **thin})
    ax.axhline(0.0, color=FAINT, linewidth=0.8, zorder=0.8)
    ax.set_title(name, loc="left", size=9.5)
    ax.grid(visible=False, axis="x")
    ax.set_xlim(-0.6, len(x) - 0.4)
    starts = [0, *_breaks(of.pose)]
    several = len(set(of.read)) > 1
    if several or len(starts) > _MOST_NAMES:
        # Which component each block is says more than the names of very many poses.
        blocks = [0, *_breaks(of.read)]
        ends = [*blocks[1:], len(x)]
        ax.set_xticks(
            [0.5 * (a + b - 1) for a, b in zip(blocks, ends, strict=True)], [f"{of.read[a]}, by pose" for a in blocks]
        )
    else:
        ends = [*starts[1:], len(x)]
        ax.set_xticks([0.5 * (a + b - 1) for a, b in zip(starts, ends, strict=True)], [of.pose[a] for a in starts])
        ax.set_xlabel("pose" if ax.get_subplotspec() is not None and _last(ax) else "")
    ax.tick_params(axis="x", length=0)


def _last(ax: Axes) -> bool:
    spec = ax.get_subplotspec()
    return spec is not None and spec.is_last_row()


def _breaks(labels: tuple[str, ...]) -> list[int]:
    """Where a label differs from the one before."""
    return [k for k in range(1, len(labels)) if labels[k] != labels[k - 1]]


def _trace_limits(ax: Axes, row: Row) -> None:
    """Limits that hold the traces and all but the farthest readings."""
    values: list[Array] = [row.own.values, *(t.values for t in row.twins), np.percentile(row.left, [1.0, 99.0])]
    flat = np.concatenate(values)
    low, high = float(flat.min()), float(flat.max())
    room = 0.08 * max(high - low, 1e-12)
    ax.set_ylim(low - room, high + room)
