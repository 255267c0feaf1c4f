"""Figures of the readings: as they were measured, and pose by pose beside models. Pure: data in, Figure out."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from doe import Measurements
from doe.tables.notes import DoubtfulReadings
from robots import InputError, Robot
from robots.arrays import Array
from stiffarm.pages.figure_parts import (
    MARKERS,
    SERIES,
    above,
    axis_limit,
    drawing,
    named_columns,
    note,
    paler,
)
from stiffarm.pages.numbers import naturally
from stiffarm.pages.style import FAINT, INK

_HATCHES: Final = ("////", "xxxx", "....")
# From this many bars on, their numbers stand upright; from the second on they are left out.
_BARS_UPRIGHT, _BARS_BARE = 36, 90
# From this many characters on, the labels of the poses stand upright.
_LABELS_UPRIGHT = 100
# More loads than these are no levels: bars then stand pose by pose.
MOST_LEVELS: Final = 6


def wrist_families(data: Measurements, robot: Robot) -> dict[str, str]:
    """Name each pose by the coordinates from the fourth on that vary in the data: ``q4 = 0°, q5 = −100°``."""
    columns = [i for i in range(3, robot.dof) if np.ptp(data.q[:, i]) > 0.0]
    out = {}
    for pose, rows in data.pose_groups().items():
        angles = zip(columns, np.degrees(data.q[rows[0], columns]), strict=True)
        parts = [f"{robot.coordinates[i].removesuffix('_deg')} = {angle:.4g}°" for i, angle in angles]
        out[pose] = ", ".join(parts).replace("-", "−") or "all poses"
    return out


def axis_words(data: Measurements) -> str:
    """What is read: ``|dz|``, or the length of several components."""
    read = [name for k, name in enumerate(("dx", "dy", "dz")) if data.used[:, k].any()]
    return f"|{read[0]}|" if len(read) == 1 else f"|({', '.join(read)})|"


def data_figure(
    data: Measurements,
    *,
    excluded_loads_N: Sequence[float] = (),
    doubts: Sequence[DoubtfulReadings] = (),
    families: Mapping[str, str] | None = None,
) -> Figure:
    """Draw the deflection (mm) read in each pose, grouped by load; repeats as their mean with the range.

    More than :data:`MOST_LEVELS` loads have an axis: each reading is a dot over its load.

    Parameters
    ----------
    excluded_loads_N : loads shown pale, as not used to calibrate
    doubts : hatched bars with a note; where several apply to a bar, the first
    families : pose -> family, drawn in one colour each (see :func:`wrist_families`); ignored if there are
        more families than colours

    Raises
    ------
    InputError
        No translation was read.
    """
    size = data.deflection * 1e3
    if np.isnan(size).all():
        raise InputError(f"{data.source}: no translation was read", code="T006", remedy="give dx_mm, dy_mm or dz_mm")
    loads, poses = _load_groups(data.loads_N), naturally(data.pose)
    if len(loads) > MOST_LEVELS:
        return _over_load(data, size)
    names = list(dict.fromkeys(families.values())) if families else []
    names = names if len(names) <= len(SERIES) else []
    bars = len(loads) * len(poses)
    places = np.add.outer((len(poses) + 1.4) * np.arange(len(loads)), np.arange(len(poses)))
    used: set[int] = set()
    longest = max(map(len, poses))
    upright = bars * longest > _LABELS_UPRIGHT
    # What stands below the pose labels, in points: upright ones are as high as they are long.
    below_pt = 10.0 + 6.0 * max(longest, 2)
    heading = "Measured deflection of every pose and load"
    with drawing(heading, (10.0, 5.0 + 0.25 * len(doubts))) as (figure, (ax,)):
        for (load, rows), at in zip(loads, places, strict=True):
            pale = any(_same_load(load, other) for other in excluded_loads_N)
            for x, pose in zip(at, poses, strict=True):
                mine = size[[i for i in rows if data.pose[i] == pose]]
                colour = SERIES[names.index(families[pose])] if families and names else SERIES[0]
                hatches = [i for i, d in enumerate(doubts) if d.holds(pose, load)][:1]
                used.update(hatches)
                look: dict[str, Any] = {"facecolor": paler(colour) if pale else colour}
                look |= {"hatch": _HATCHES[hatches[0] % 3]} if hatches else {}
                _data_bar(ax, float(x), mine[~np.isnan(mine)], look, bars)
            text = f"{load:.4g} N" + (" (not used to calibrate)" if pale else "")
            below = {"xycoords": ("data", "axes fraction"), "weight": "bold", "size": 10}
            note(ax, text, (float(at.mean()), 0.0), (0, -(below_pt if upright else 22.0)), va="top", **below)
        ax.set_xticks(places.ravel(), poses * len(loads), size=8.5, rotation=90 if upright else 0)
        ax.tick_params(axis="x", length=0, pad=2)
        ax.grid(visible=False, axis="x")
        ax.set(
            xlim=(-1.2, places[-1, -1] + 1.2),
            ylim=(0.0, (1.08 if bars <= _BARS_UPRIGHT else 1.14) * float(np.nanmax(size))),
            ylabel=f"measured deflection {axis_words(data)} (mm)",
        )
        grouped = ", grouped by load (N)" if len(loads) > 1 else ""
        ax.set_xlabel(f"pose number{grouped}", labelpad=28.0 + (2.0 * longest if upright else 0.0))
        if len(names) > 1:
            above(ax, [Patch(facecolor=c, label=name) for c, name in zip(SERIES, names, strict=False)], 4)
        hatched = [(_HATCHES[i % 3], textwrap.fill(doubts[i].note, 130)) for i in sorted(used)]
        if hatched:
            keys = [Patch(facecolor="#777777", edgecolor="white", hatch=h, label=text) for h, text in hatched]
            figure.legend(handles=keys, loc="outside lower left", handlelength=2.6, handleheight=1.4)
    return figure


def _over_load(data: Measurements, size: Array) -> Figure:
    """Deflection (n,) mm over load: what is softer than the rest stands above it."""
    known = ~np.isnan(size)
    with drawing("Measured deflection of every pose over its load", (10.0, 4.6)) as (figure, (ax,)):
        ax.plot(data.loads_N[known], size[known], "o", color=SERIES[0], markersize=6, alpha=0.75)
        slope = float(data.loads_N[known] @ size[known] / (data.loads_N[known] @ data.loads_N[known]))
        ends = np.array([0.0, 1.05 * float(data.loads_N.max())])
        ax.plot(
            ends, slope * ends, color=INK, linewidth=1.2, linestyle="--", label=f"all alike: {slope * 1e3:.2g} um/N"
        )
        ax.set(xlim=ends, ylim=(0.0, 1.08 * float(np.nanmax(size))), xlabel="load (N)")
        ax.set_ylabel(f"measured deflection {axis_words(data)} (mm)")
        above(ax, ax.get_legend_handles_labels()[0], 2)
    return figure


def _data_bar(ax: Axes, x: float, values: Array, look: Mapping[str, Any], bars: int) -> None:
    if not values.size:
        note(ax, "–", (x, 0.0), va="bottom")
        return
    ax.bar(x, values.mean(), 0.86, edgecolor="white", linewidth=0.0, **look)
    if np.ptp(values) > 0.0:
        ax.vlines(x, values.min(), values.max(), color=INK, linewidth=1.2)
    if bars <= _BARS_BARE:
        upright = bars > _BARS_UPRIGHT
        text = f"{values.mean():.2f}"
        note(ax, text, (x, values.max()), (0, 2), va="bottom", size=8.5, rotation=90 if upright else 0)


def _same_load(a: float, b: float) -> bool:
    # A real weight is never its nominal one.
    return abs(a - b) <= 0.01 * abs(b)


def _load_groups(loads: Array) -> list[tuple[float, list[int]]]:
    """Rows of each load, smallest load first; loads that follow one another within 1 % are one."""
    order = np.argsort(loads, kind="stable")
    ascending = loads[order]
    jumps = np.flatnonzero(ascending[1:] > 1.01 * ascending[:-1]) + 1
    return [(float(loads[rows[0]]), rows.tolist()) for rows in np.split(order, jumps)]


def match_figure(
    poses: Sequence[str],
    measured_mm: Array,
    variants: Mapping[str, Array],
    gauge_mm: float = 0.01,
    heading: str = "Measured and simulated deflection by pose",
    what: str = "|dz|",
) -> Figure:
    """Draw measured and simulated deflection by pose, and the residuals with the gauge's band below.

    Parameters
    ----------
    poses, measured_mm : (n,) labels and readings
    variants : name -> (n,) the same simulated, in mm (NaN = not predicted)

    Raises
    ------
    InputError
        Arrays that are not as long as ``poses``, or readings that are not finite.
    """
    measured = np.asarray(measured_mm, dtype=np.float64)
    simulated = {name: np.asarray(v, dtype=np.float64) for name, v in variants.items()}
    for name, values in {"measured_mm": measured, **simulated}.items():
        if values.shape != (len(poses),) or not len(poses):
            allowed = f"({len(poses)},), one value a pose, n >= 1"
            raise InputError(f"match figure: {name}", code="B002", value=f"shape {values.shape}", allowed=allowed)
    if not np.isfinite(measured).all():
        raise InputError("match figure: measured_mm", code="B002", value="NaN or infinity", allowed="finite (mm)")
    rank = {label: k for k, label in enumerate(naturally(poses))}
    order = sorted(range(len(poses)), key=lambda k: rank[poses[k]])
    poses, measured = [poses[k] for k in order], measured[order]
    simulated = {name: values[order] for name, values in simulated.items()}
    # Along the reading's own sense, so that "too soft" is up whatever the sign of dz.
    error = {name: (v - measured) * np.where(measured < 0.0, -1.0, 1.0) for name, v in simulated.items()}
    size = np.abs(np.concatenate([*error.values(), measured[:0]]))
    limit = max(axis_limit(size[np.isfinite(size)]), 2.5 * gauge_mm)
    beyond = bool((size > limit).any())
    x, width = np.arange(len(poses)), 0.62 / max(len(variants), 1)
    with drawing(heading, (10.0, 6.8), 2, 1, sharex=True, height_ratios=[1.7, 1.3]) as (figure, (top, low)):
        top.hlines(np.abs(measured), x - 0.4, x + 0.4, color=INK, linewidth=2.6, label="measured")
        band: dict[str, Any] = {"color": FAINT, "alpha": 0.5, "linewidth": 0}
        gauge = low.axhspan(-gauge_mm, gauge_mm, label=f"gauge ±{gauge_mm:g} mm", **band)
        low.axhline(0.0, color=INK, linewidth=0.8)
        for i, (name, residual) in enumerate(error.items()):
            at = x + (i - (len(variants) - 1) / 2) * width
            good = np.isfinite(residual)
            look: dict[str, Any] = {"color": SERIES[i % 6], "marker": MARKERS[i % 6], "linestyle": "none"}
            look |= {"markersize": 6.5, "markeredgecolor": "white"}
            near = np.where(np.abs(residual) <= limit, np.abs(measured) + residual, np.nan)
            top.plot(at, near, label=f"{name}: {_rms_text(residual[good], len(poses))}", **look)
            _residuals(low, at[good].astype(np.float64), residual[good], limit, look)
        top.set_ylabel(f"deflection {what} (mm)")
        top.margins(y=0.1)
        low.set_ylim(-1.15 * limit, (1.6 if beyond else 1.15) * limit)
        low.set_ylabel("simulated − measured (mm)\n← too stiff    too soft →", size=9.5)
        named_columns(low, poses)
        top.grid(visible=False, axis="x")
        low.set_xlabel("pose number" + ("; arrows: beyond the axis, not shown above" if beyond else ""))
        above(top, [*top.get_legend_handles_labels()[0], gauge], 2)
    return figure


def _rms_text(residual: Array, count: int) -> str:
    if not residual.size:
        return "not predicted"
    some = "" if residual.size == count else f" of {residual.size} readings"
    return f"RMS {np.sqrt(np.mean(residual**2)):.3f} mm{some}"


def _residuals(ax: Axes, x: Array, residual: Array, limit: float, look: Mapping[str, Any]) -> None:
    """Stems from zero; values beyond the limit stand at it as an arrow with their number."""
    ax.vlines(x, 0.0, np.clip(residual, -limit, limit), color=look["color"], linewidth=1.4)
    inside = np.abs(residual) <= limit
    ax.plot(x[inside], residual[inside], **look)
    for at, value in zip(x[~inside], residual[~inside], strict=True):
        up = value > 0.0
        ax.plot(at, limit if up else -limit, marker="^" if up else "v", color=look["color"], markersize=7)
        end, text = (at, limit if up else -limit), f"{value:+.2f}".replace("-", "−")
        note(ax, text, end, (0, 6 if up else -6), va="bottom" if up else "top", size=8.5, rotation=90)
