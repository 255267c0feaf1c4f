"""Figures of the calibration: data, sensitivity, match, prediction, springs. Pure: data in, Figure out."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from doe import Measurements, PoseEffects, SpringEstimate
from robots import InputError, Robot
from stiffarm.picture_style import FAINT, INK, OKABE_ITO, house_style, new_figure

Array = NDArray[np.float64]

SERIES: Final = tuple(OKABE_ITO[c] for c in ("blue", "vermillion", "green", "purple", "orange", "sky"))
MARKERS: Final = "osD^vP"
_HATCHES: Final = ("////", "xxxx", "....")
# Values after a jump by more than this factor leave a linear axis; their number is written instead.
_JUMP = 3.0
# From this many bars on, their numbers stand upright; from the second on they are left out.
_BARS_UPRIGHT, _BARS_BARE = 36, 90


@dataclass(frozen=True)
class Doubt:
    """Readings that may be wrong: at these poses and loads (N), for the reason in ``note``."""

    poses: tuple[str, ...]
    loads_N: tuple[float, ...]  # noqa: N815 - the unit's letter
    note: str


@dataclass(frozen=True)
class VariantRow:
    """A calibrated variant: RMS errors in mm of the fit and of poses left out (NaN = not predicted)."""

    name: str
    parameters: int
    fit_rms_mm: float
    left_out_rms_mm: float


def joint_colour(name: str, position: int = 0) -> str:
    """Return one colour for a joint in every figure, by the number in its name, else by ``position``."""
    digits = re.findall(r"\d+", name)
    # Joint 2 gets the first colour: on most arms it is the one that matters.
    return SERIES[((int(digits[-1]) if digits else position) - 2) % len(SERIES)]


def wrist_families(data: Measurements, robot: Robot) -> dict[str, str]:
    """Name each pose by the coordinates from the fourth on that vary in the data: ``q4 = 0°, q5 = −100°``."""
    columns = [i for i in range(3, robot.dof) if np.ptp(data.q[:, i]) > 0.0]
    out = {}
    for pose, rows in data.pose_groups().items():
        angles = zip(columns, np.degrees(data.q[rows[0], columns]), strict=True)
        parts = [f"{robot.coordinates[i].removesuffix('_deg')} = {angle:.4g}°" for i, angle in angles]
        out[pose] = ", ".join(parts).replace("-", "−") or "all poses"
    return out


def data_figure(
    data: Measurements,
    *,
    excluded_loads_N: Sequence[float] = (),
    doubts: Sequence[Doubt] = (),
    families: Mapping[str, str] | None = None,
) -> Figure:
    """Draw the measured |dz| (mm) of each pose, grouped by load; repeats as their mean with the range.

    Parameters
    ----------
    excluded_loads_N : loads shown pale, as not used to calibrate
    doubts : hatched bars with a note; where several apply to a bar, the first
    families : pose -> family, drawn in one colour each (see :func:`wrist_families`); ignored if there are
        more families than colours

    Raises
    ------
    InputError
        No reading of dz.
    """
    dz = np.abs(data.displacement[:, 2]) * 1e3
    if np.isnan(dz).all():
        raise InputError(f"{data.source}: no dz_mm reading to draw", remedy="give dz_mm for at least one row")
    loads, poses = _load_groups(data.loads_N), list(data.pose_groups())
    names = list(dict.fromkeys(families.values())) if families else []
    names = names if len(names) <= len(SERIES) else []
    bars = len(loads) * len(poses)
    places = np.add.outer((len(poses) + 1.4) * np.arange(len(loads)), np.arange(len(poses)))
    used: set[int] = set()
    with house_style():
        figure, (ax,) = new_figure((10.0, 5.0 + 0.25 * len(doubts)))
        for (load, rows), at in zip(loads, places, strict=True):
            pale = any(_same_load(load, other) for other in excluded_loads_N)
            for x, pose in zip(at, poses, strict=True):
                mine = dz[[i for i in rows if data.pose[i] == pose]]
                colour = SERIES[names.index(families[pose])] if families and names else SERIES[0]
                hatches = [i for i, d in enumerate(doubts) if _applies(d, pose, load)][:1]
                used.update(hatches)
                look: dict[str, Any] = {"facecolor": paler(colour) if pale else colour}
                look |= {"hatch": _HATCHES[hatches[0] % 3]} if hatches else {}
                _data_bar(ax, float(x), mine[~np.isnan(mine)], look, bars)
            text = f"{load:.4g} N" + (" (not used to calibrate)" if pale else "")
            below = {"xycoords": ("data", "axes fraction"), "weight": "bold", "size": 10}
            note(ax, text, (float(at.mean()), 0.0), (0, -22), va="top", **below)
        ax.set_xticks(places.ravel(), poses * len(loads), size=8.5, rotation=0 if bars <= 40 else 90)
        ax.tick_params(axis="x", length=0, pad=2)
        ax.grid(visible=False, axis="x")
        ax.set_xlim(-1.2, places[-1, -1] + 1.2)
        ax.set_ylim(0.0, (1.08 if bars <= _BARS_UPRIGHT else 1.14) * float(np.nanmax(dz)))
        ax.set_ylabel("measured deflection |dz| (mm)")
        ax.set_xlabel("pose number, grouped by load (N)", labelpad=28)
        if len(names) > 1:
            above(ax, [Patch(facecolor=c, label=name) for c, name in zip(SERIES, names, strict=False)], 4)
        hatched = [(_HATCHES[i % 3], textwrap.fill(doubts[i].note, 130)) for i in sorted(used)]
        if hatched:
            keys = [Patch(facecolor="#777777", edgecolor="white", hatch=h, label=text) for h, text in hatched]
            figure.legend(handles=keys, loc="outside lower left", handlelength=2.6, handleheight=1.4)
        title(figure, "Measured vertical deflection of every pose and load")
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


def sensitivity_figure(
    effects: Mapping[str, Sequence[PoseEffects]],
    levels_Nm_per_rad: tuple[float, float] | None = None,
) -> Figure:
    """Draw the signed main effects of the joint springs (mm): a column a load path, a row a pose.

    ``levels_Nm_per_rad``: the low and high stiffness of the study, for the axis label.

    Raises
    ------
    InputError
        No effects.
    """
    poses = list(dict.fromkeys(e.pose for column in effects.values() for e in column))
    if not poses:
        raise InputError("sensitivity figure: no effects to draw")
    every = np.concatenate([e.effect_mm for column in effects.values() for e in column])
    low, high = levels_Nm_per_rad or (0.0, 0.0)
    step = f" from {low:,.0f} to {high:,.0f} N m/rad".replace(",", " ") if levels_Nm_per_rad else ""
    with house_style():
        figure, axes = new_figure((10.0, 1.6 + 1.25 * len(poses)), len(poses), len(effects), sharex=True)
        for c, (path, column) in enumerate(effects.items()):
            axes[c].set_title(f"Load path: {path}", loc="left")
            for r, pose in enumerate(poses):
                ax = axes[r * len(effects) + c]
                found = [e for e in column if e.pose == pose]
                if found:
                    _effect_bars(ax, found[0], float(np.abs(every).max()))
                else:
                    ax.text(0.5, 0.5, "not studied", transform=ax.transAxes, ha="center")
                if c == 0:
                    ax.set_ylabel(f"pose {pose}", weight="bold")
        low, high = min(0.0, every.min()), max(0.0, every.max(), 1e-9)
        room = 0.2 * (high - low)
        axes[0].set_xlim(low - room if low < 0.0 else 0.0, high + room)
        title(figure, "Which joint's stiffness moves the tool")
        figure.supxlabel(f"effect on dz of stiffening one joint{step} (mm); positive: sags less", size=10)
    return figure


def _effect_bars(ax: Axes, effects: PoseEffects, largest: float) -> None:
    rows = np.arange(len(effects.joints))
    colours = [joint_colour(joint, i + 2) for i, joint in enumerate(effects.joints)]
    ax.barh(rows, effects.effect_mm, 0.72, color=colours)
    ax.axvline(0.0, color=INK, linewidth=0.8)
    for row, value in zip(rows, effects.effect_mm, strict=True):
        text = "0" if abs(value) <= 1e-7 * largest else f"{value:+.3g}".replace("-", "−")
        side = 1 if value >= 0.0 else -1
        note(ax, text, (value, float(row)), (4 * side, 0), ha="left" if side > 0 else "right")
    ax.set_yticks(rows, list(effects.joints))
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.grid(visible=False, axis="y")


def match_figure(
    poses: Sequence[str], measured_mm: Array, variants: Mapping[str, Array], gauge_mm: float = 0.01
) -> Figure:
    """Draw measured and simulated deflection by pose, and the residuals with the gauge's band below.

    Parameters
    ----------
    poses, measured_mm : (n,) labels and dz readings
    variants : name -> (n,) simulated dz in mm (NaN = not predicted)

    Raises
    ------
    InputError
        Arrays that are not as long as ``poses``, or readings that are not finite.
    """
    measured = np.asarray(measured_mm, dtype=np.float64)
    simulated = {name: np.asarray(v, dtype=np.float64) for name, v in variants.items()}
    for name, values in {"measured_mm": measured, **simulated}.items():
        _same_length(f"match figure: {name}", values, poses)
    if not np.isfinite(measured).all():
        raise InputError("match figure: measured_mm", value="NaN or infinity", allowed="finite (mm)")
    # Along the reading's own sense, so that "too soft" is up whatever the sign of dz.
    error = {name: (v - measured) * np.where(measured < 0.0, -1.0, 1.0) for name, v in simulated.items()}
    size = np.abs(np.concatenate([*error.values(), measured[:0]]))
    limit = max(_axis_limit(size[np.isfinite(size)]), 2.5 * gauge_mm)
    beyond = bool((size > limit).any())
    x, width = np.arange(len(poses)), 0.62 / max(len(variants), 1)
    with house_style():
        figure, (top, low) = new_figure((10.0, 6.8), 2, 1, sharex=True, height_ratios=[1.7, 1.3])
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
        top.set_ylabel("deflection |dz| (mm)")
        top.margins(y=0.1)
        low.set_ylim(-1.15 * limit, (1.6 if beyond else 1.15) * limit)
        low.set_ylabel("simulated − measured (mm)\n← too stiff    too soft →", size=9.5)
        low.set_xticks(x, list(poses), rotation=0 if len(poses) <= 24 else 90)
        low.set_xlabel("pose number" + ("; arrows leave the axis and are not shown above" if beyond else ""))
        for ax in (top, low):
            ax.grid(visible=False, axis="x")
        above(top, [*top.get_legend_handles_labels()[0], gauge], 2)
        title(figure, "Measured and simulated deflection by pose")
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


def comparison_figure(rows: Sequence[VariantRow]) -> Figure:
    """Draw how well each variant fits, and how well it predicts poses left out (RMS, mm), as paired bars.

    The axis is linear. Values more than three times the next smaller one are drawn as broken bars with
    their number, and the axis label says so.

    Raises
    ------
    InputError
        No rows, or no finite value.
    """
    values = np.array([[row.fit_rms_mm, row.left_out_rms_mm] for row in rows])
    if not np.isfinite(values).any():
        raise InputError("comparison figure: no finite RMS error to draw")
    limit = _axis_limit(values[np.isfinite(values)])
    broken = bool((values > limit).any())
    y = np.arange(len(rows))
    with house_style():
        figure, (ax,) = new_figure((10.0, 1.7 + 0.78 * len(rows)))
        for k, label in enumerate(("fit to all poses", "prediction of poses left out")):
            at = y + (k - 0.5) * 0.36
            lengths = np.clip(np.nan_to_num(values[:, k]), 0.0, 1.12 * limit)
            ax.barh(at, lengths, 0.34, color=SERIES[k], label=label)
            for row, value in zip(at, values[:, k], strict=True):
                _bar_end(ax, row, value, limit)
        ax.set_yticks(y, [f"{r.name}\n{r.parameters} parameter{'s' * (r.parameters != 1)}" for r in rows])
        ax.set_ylim(len(rows) - 0.45, -0.55)
        ax.set_xlim(0.0, 1.25 * limit)
        ax.tick_params(axis="y", length=0)
        ax.grid(visible=False, axis="y")
        ax.set_xlabel("RMS error (mm)" + ("; broken bars leave the axis, their value is written" * broken))
        above(ax, ax.get_legend_handles_labels()[0], 2)
        title(figure, "Fit, and prediction of poses that were left out")
    return figure


def _bar_end(ax: Axes, row: float, value: float, limit: float) -> None:
    if not np.isfinite(value):
        note(ax, "not predicted", (0.0, row), (4, 0), ha="left")
        return
    broken = value > limit
    end = 1.12 * limit if broken else value
    note(ax, f"{value:.3f}", (end, row), (4, 0), ha="left", weight="bold" if broken else "normal")
    for cut in (0.985, 1.005) if broken else ():
        ends = [cut * limit, (cut + 0.02) * limit]
        ax.plot(ends, [row + 0.24, row - 0.24], color="white", linewidth=3.0)


def springs_figure(
    rows: Mapping[str, Sequence[SpringEstimate]],
    start_bounds_Nm_per_rad: tuple[float, float] | None = None,
) -> Figure:
    """Draw constant springs with their 95 % intervals (N m/rad, log axis), a colour for each load path.

    An arrow to the right: the data do not exclude a rigid joint. A spring at its bound has no marker, for
    its value means nothing; only its lower limit is drawn.

    Parameters
    ----------
    rows : load path -> springs from :mod:`doe.constant`
    start_bounds_Nm_per_rad : shaded, the range in which the fit started

    Raises
    ------
    InputError
        No springs.
    """
    joints = list(dict.fromkeys(s.joint for springs in rows.values() for s in springs))
    if not joints:
        raise InputError("springs figure: no springs to draw")
    known = [v for k in rows.values() for s in k for v in (*s.interval, _value(s)) if np.isfinite(v)]
    known += list(start_bounds_Nm_per_rad or ())
    low, high = (min(known) / 1.6, max(known) * 2.5) if known else (1e4, 1e7)
    step = 0.7 / len(rows)
    with house_style():
        figure, (ax,) = new_figure((10.0, 1.6 + 0.42 * len(joints) * max(len(rows), 2)))
        if start_bounds_Nm_per_rad is not None:
            band: dict[str, Any] = {"color": FAINT, "alpha": 0.3, "linewidth": 0}
            ax.axvspan(*start_bounds_Nm_per_rad, label="range the fit started in", **band)
        ax.set_xscale("log")
        ax.set_xlim(low, high)
        for i, (path, springs) in enumerate(rows.items()):
            look: dict[str, Any] = {"color": SERIES[i % 6], "marker": MARKERS[i % 6]}
            ax.plot([], [], linewidth=2.2, label=f"load path: {path}", **look)
            for s in springs:
                _interval(ax, joints.index(s.joint) + (i - (len(rows) - 1) / 2) * step, s, high, look)
        ax.set_yticks(range(len(joints)), joints, weight="bold")
        ax.set_ylim(len(joints) - 0.45, -0.55)
        ax.tick_params(axis="y", length=0)
        ax.grid(visible=False, axis="y")
        ax.set_xlabel("joint stiffness (N m/rad), 95 % interval; arrow: a rigid joint is not excluded")
        ax.text(1.01, 1.02, "10⁶ N m/rad (95 %)", transform=ax.transAxes, weight="bold", size=9)
        above(ax, ax.get_legend_handles_labels()[0], 3)
        title(figure, "Constant joint springs from all poses at once")
    return figure


def _value(s: SpringEstimate) -> float:
    return s.stiffness if s.status in ("determined", "one-sided") else float("nan")


def _interval(ax: Axes, y: float, s: SpringEstimate, edge: float, look: Mapping[str, Any]) -> None:
    (low, high), value, colour = s.interval, _value(s), look["color"]
    if np.isfinite(low) and np.isinf(high):
        arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 2.2, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", (edge, y), (low, y), annotation_clip=False, arrowprops=arrow)
    elif np.isfinite(low):
        ax.hlines(y, low, high, color=colour, linewidth=2.2)
    for end in (low, high):
        if np.isfinite(end):
            ax.plot(end, y, marker="|", color=colour, markersize=10, markeredgewidth=2.2)
    if np.isfinite(value):
        ax.plot(value, y, markersize=8, markeredgecolor="white", **look)
    where: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "ha": "left", "color": colour}
    note(ax, _interval_text(s), (1.01, y), **where)


def _interval_text(s: SpringEstimate) -> str:
    value, low, high = (f"{k / 1e6:#.3g}" for k in (s.stiffness, *s.interval))
    if s.status == "not identified":
        return "not identified"
    if not np.isfinite(s.interval[0]):
        return f"{value} (no spare reading)" if s.status == "determined" else "no limit known"
    if s.status == "at bound":
        return f"at least {low}; rigid fits best"
    return f"{value} (at least {low})" if s.status == "one-sided" else f"{value} ({low} to {high})"


def rigid_joint_figure(poses: Sequence[str], measured_mm: Array, simulated: Mapping[str, Array]) -> Figure:
    """Draw the first models, with rigid joints, against the measurement (mm, log axis), and the factor.

    Parameters
    ----------
    poses, measured_mm : (n,) labels and readings
    simulated : name of a model -> (n,) mm

    Raises
    ------
    InputError
        No model, arrays that are not as long as ``poses``, or a deflection of zero or not finite.
    """
    measured = np.abs(np.asarray(measured_mm, dtype=np.float64))
    models = {name: np.abs(np.asarray(v, dtype=np.float64)) for name, v in simulated.items()}
    if not models:
        raise InputError("rigid joint figure: no model to draw")
    for name, values in {"measured_mm": measured, **models}.items():
        _same_length(f"rigid joint figure: {name}", values, poses)
        if not (np.isfinite(values).all() and (values > 0.0).all()):
            raise InputError(f"rigid joint figure: {name}", value=values.tolist(), allowed="not 0, finite (mm)")
    spread = (np.arange(len(models)) - (len(models) - 1) / 2) * 0.7 / len(models)
    with house_style():
        figure, (ax,) = new_figure((10.0, 1.6 + 0.36 * len(poses) * max(len(models), 2)))
        ax.set_xscale("log")
        for i, (name, values) in enumerate(models.items()):
            y = np.arange(len(poses)) + spread[i]
            ax.hlines(y, values, measured, color=paler(SERIES[i % 6]), linewidth=1.6, zorder=2)
            look: dict[str, Any] = {"marker": MARKERS[(i + 1) % 6], "color": SERIES[i % 6], "markersize": 8}
            ax.plot(values, y, linestyle="none", label=name, **look)
            for at, simulation, reading in zip(y, values, measured, strict=True):
                factor = f"× {float(f'{reading / simulation:.2g}'):,g}".replace(",", " ")
                middle = (float(np.sqrt(simulation * reading)), at)
                note(ax, factor, middle, (0, 2), va="bottom", size=9.5, weight="bold")
                end = {"ha": "right" if simulation <= reading else "left", "color": SERIES[i % 6]}
                note(ax, f"{simulation:.3g}", (simulation, at), (-8 if simulation <= reading else 8, 0), **end)
        every = np.add.outer(np.arange(len(poses)), spread)
        again = np.repeat(measured, len(models))
        ax.plot(again, every.ravel(), "o", color=INK, markersize=8, label="measured", zorder=3)
        for p, reading in enumerate(measured):
            right = max([reading, *(values[p] for values in models.values())]) <= reading
            where: dict[str, Any] = {"ha": "left" if right else "right", "weight": "bold", "size": 9.5}
            note(ax, f"{reading:.2f}", (reading, p), (9 if right else -9, 0), **where)
        ax.set_yticks(range(len(poses)), [f"pose {p}" for p in poses])
        ax.set_ylim(len(poses) - 0.45, -0.55)
        ax.margins(x=0.12)
        ax.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        ax.grid(visible=False, axis="y")
        ax.set_xlabel("deflection |dz| (mm), log axis; × = measured over simulated")
        above(ax, ax.get_legend_handles_labels()[0], 4)
        title(figure, "Models with rigid joints against the measurement")
    return figure


def note(ax: Axes, text: str, xy: tuple[float, float], offset: tuple[float, float] = (0, 0), **look: Any) -> None:
    """Write beside a point, ``offset`` in points of type, centred unless ``look`` says otherwise."""
    ax.annotate(text, xy, offset, textcoords="offset points", **{"ha": "center", "va": "center", "size": 9.0, **look})


def above(ax: Axes, handles: Sequence[Any], columns: int) -> None:
    """Put the legend above the axes, where it hides no data."""
    look: dict[str, Any] = {"columnspacing": 1.4, "handlelength": 1.6, "borderaxespad": 0.3}
    ax.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, **look)


def title(figure: Figure, text: str) -> None:
    """Write the title of a figure at its top left."""
    figure.suptitle(text, x=0.01, ha="left", size=11.5, weight="bold")


def paler(colour: str) -> str:
    """Return a colour mixed with white; unlike a transparent one it hides the grid behind it."""
    red, green, blue = (0.42 * part + 0.58 for part in to_rgb(colour))
    return to_hex((red, green, blue))


def _axis_limit(values: Array) -> float:
    """End of a linear axis of magnitudes: the largest, or the last one before a jump to a few far larger."""
    ordered = np.sort(values)
    for i in range(int(0.6 * len(ordered)), len(ordered) - 1):
        if ordered[i] > 0.0 and ordered[i + 1] > _JUMP * ordered[i]:
            return float(ordered[i])
    return float(ordered[-1]) if ordered.size and ordered[-1] > 0.0 else 1.0


def _same_length(what: str, values: Array, poses: Sequence[str]) -> None:
    if values.shape != (len(poses),) or not len(poses):
        allowed = f"({len(poses)},), one value a pose, n >= 1"
        raise InputError(what, value=f"shape {values.shape}", allowed=allowed)


def _same_load(a: float, b: float) -> bool:
    # A real weight is never its nominal one.
    return abs(a - b) <= 0.01 * abs(b)


def _applies(doubt: Doubt, pose: str, load: float) -> bool:
    return pose in doubt.poses and any(_same_load(load, other) for other in doubt.loads_N)


def _load_groups(loads: Array) -> list[tuple[float, list[int]]]:
    """Rows of each load, smallest load first; loads within 1 % are one."""
    groups: list[tuple[float, list[int]]] = []
    for i in np.argsort(loads, kind="stable"):
        if groups and _same_load(float(loads[i]), groups[-1][0]):
            groups[-1][1].append(int(i))
        else:
            groups.append((float(loads[i]), [int(i)]))
    return groups
