"""Figures of the calibration: data, sensitivity, match, prediction, springs. Pure: data in, Figure out."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
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
    """Name each pose by the coordinates from the fourth on that vary in the data: ``q4 = 0, q5 = -100 deg``."""
    columns = [i for i in range(3, robot.dof) if np.ptp(data.q[:, i]) > 0.0]
    out = {}
    for pose, rows in data.pose_groups().items():
        angles = np.degrees(data.q[rows[0], columns])
        parts = [
            f"{robot.coordinates[i].removesuffix('_deg')} = {a:.4g}°"
            for i, a in zip(columns, angles, strict=True)
        ]
        out[pose] = ", ".join(parts) or "all poses"
    return out


def data_figure(
    data: Measurements,
    *,
    excluded_loads_N: Sequence[float] = (),  # noqa: N803 - the unit's letter
    doubts: Sequence[Doubt] = (),
    families: Mapping[str, str] | None = None,
) -> Figure:
    """Draw the measured |dz| (mm) of each pose, grouped by load; repeats as their mean with the range.

    Parameters
    ----------
    excluded_loads_N : loads shown pale, as not used to calibrate
    doubts : hatched bars with a note; where several apply to a bar, the first
    families : pose -> family, drawn in one colour each (see :func:`wrist_families`)

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
    bars = len(loads) * len(poses)
    with house_style():
        figure, (ax,) = new_figure((10.0, 4.8))
        places, labels, used = [], [], set()
        for g, (load, rows) in enumerate(loads):
            pale = any(_same_load(load, other) for other in excluded_loads_N)
            for p, pose in enumerate(poses):
                mine = dz[[i for i in rows if data.pose[i] == pose]]
                mine = mine[~np.isnan(mine)]
                x = g * (len(poses) + 1.4) + p
                places.append(x)
                labels.append(pose)
                if not mine.size:
                    ax.text(x, 0.0, "–", ha="center", va="bottom")
                    continue
                doubt = next((i for i, d in enumerate(doubts) if _applies(d, pose, load)), None)
                used |= {doubt}
                colour = SERIES[names.index(families[pose]) % len(SERIES)] if families else SERIES[0]
                ax.bar(
                    x,
                    mine.mean(),
                    0.86,
                    facecolor=_paler(colour) if pale else colour,
                    edgecolor="white",
                    linewidth=0.0,
                    hatch=None if doubt is None else _HATCHES[doubt % 3],
                )
                if np.ptp(mine) > 0.0:
                    ax.vlines(x, mine.min(), mine.max(), color=INK, linewidth=1.2)
                if bars <= 90:
                    ax.annotate(
                        f"{mine.mean():.2f}",
                        (x, mine.max()),
                        (0, 2),
                        textcoords="offset points",
                        ha="center",
                        va="bottom",
                        size=8.5 if bars <= 36 else 7.5,
                        rotation=0 if bars <= 36 else 90,
                    )
            suffix = " (not used to calibrate)" if pale else ""
            centre = g * (len(poses) + 1.4) + (len(poses) - 1) / 2
            ax.annotate(
                f"{load:.4g} N{suffix}",
                (centre, 0),
                (0, -22),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                ha="center",
                va="top",
                weight="bold",
            )
        ax.set_xticks(places, labels, size=8.5, rotation=0 if bars <= 40 else 90)
        ax.tick_params(axis="x", length=0, pad=2)
        ax.grid(visible=False, axis="x")
        ax.set_xlim(-1.2, places[-1] + 1.2)
        ax.set_ylim(0.0, 1.08 * float(np.nanmax(dz)))
        ax.set_ylabel("measured deflection |dz| (mm)")
        ax.set_xlabel("pose number, grouped by load (N)", labelpad=28)
        handles = [Patch(facecolor=SERIES[i % len(SERIES)], label=name) for i, name in enumerate(names)]
        handles += [
            Patch(facecolor="#888888", edgecolor="white", hatch=_HATCHES[i % 3], label=d.note)
            for i, d in enumerate(doubts)
            if i in used
        ]
        if handles:
            ax.legend(handles=handles, loc="upper left", handlelength=2.2, handleheight=1.2)
        ax.set_title("Measured vertical deflection of every pose and load", loc="left", weight="bold")
    return figure


def sensitivity_figure(
    effects: Mapping[str, Sequence[PoseEffects]],
    levels_Nm_per_rad: tuple[float, float] | None = None,  # noqa: N803
) -> Figure:
    """Draw the signed main effects of the joint springs (mm): a column for each load path, a row for each pose.

    ``levels_Nm_per_rad``: the low and high stiffness of the study, for the axis label.

    Raises
    ------
    InputError
        No effects.
    """
    poses = list(dict.fromkeys(e.pose for column in effects.values() for e in column))
    if not poses:
        raise InputError("sensitivity figure: no effects to draw")
    largest = max(float(np.abs(e.effect_mm).max()) for column in effects.values() for e in column)
    low, high = levels_Nm_per_rad or (0.0, 0.0)
    step = f" from {low:,.0f} to {high:,.0f} N m/rad".replace(",", " ") if levels_Nm_per_rad else ""
    with house_style():
        size = (10.0, 1.5 + 1.25 * len(poses))
        figure, axes = new_figure(size, len(poses), len(effects), sharex=True)
        for c, (path, column) in enumerate(effects.items()):
            axes[c].set_title(f"Load path: {path}", loc="left")
            for r, pose in enumerate(poses):
                ax = axes[r * len(effects) + c]
                found = [e for e in column if e.pose == pose]
                if found:
                    _effect_bars(ax, found[0], largest)
                else:
                    ax.text(0.5, 0.5, "not studied", transform=ax.transAxes, ha="center")
                if c == 0:
                    ax.set_ylabel(f"pose {pose}", weight="bold")
        every = np.concatenate([e.effect_mm for column in effects.values() for e in column])
        axes[0].set_xlim(*(1.22 * np.array([min(0.0, every.min()), max(0.0, every.max(), 1e-9)])))
        figure.suptitle("Which joint's stiffness moves the tool", x=0.01, ha="left", size=11, weight="bold")
        figure.supxlabel(f"effect on dz of stiffening one joint{step} (mm); positive: sags less", size=10)
    return figure


def _effect_bars(ax: Axes, effects: PoseEffects, largest: float) -> None:
    rows = np.arange(len(effects.joints))
    ax.barh(
        rows, effects.effect_mm, 0.72, color=[joint_colour(j, i + 2) for i, j in enumerate(effects.joints)]
    )
    ax.axvline(0.0, color=INK, linewidth=0.8)
    for row, value in zip(rows, effects.effect_mm, strict=True):
        text = "0" if abs(value) < 1e-7 * max(largest, 1e-300) else f"{value:+.3g}"
        ax.annotate(
            text,
            (value, row),
            (4 if value >= 0.0 else -4, 0),
            textcoords="offset points",
            ha="left" if value >= 0.0 else "right",
            va="center",
            size=9,
        )
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
    limit = _axis_limit(np.concatenate([np.abs(e[np.isfinite(e)]) for e in [*error.values(), measured[:0]]]))
    limit = max(limit, 2.5 * gauge_mm)
    x, width = np.arange(len(poses)), 0.62 / max(len(variants), 1)
    with house_style():
        figure, (top, low) = new_figure((10.0, 6.6), 2, 1, sharex=True, height_ratios=[1.7, 1.3])
        top.hlines(np.abs(measured), x - 0.4, x + 0.4, color=INK, linewidth=2.6, label="measured")
        band = low.axhspan(
            -gauge_mm, gauge_mm, color=FAINT, alpha=0.5, linewidth=0, label=f"gauge ±{gauge_mm:g} mm"
        )
        low.axhline(0.0, color=INK, linewidth=0.8)
        for i, (name, residual) in enumerate(error.items()):
            at = x + (i - (len(variants) - 1) / 2) * width
            good = np.isfinite(residual)
            rms = float(np.sqrt(np.mean(residual[good] ** 2))) if good.any() else float("nan")
            count = "" if good.all() else f" of {int(good.sum())} poses"
            look = {"color": SERIES[i % 6], "marker": MARKERS[i % 6], "linestyle": "none", "markersize": 6.5}
            near = np.where(np.abs(residual) <= limit, np.abs(measured) + residual, np.nan)
            top.plot(at, near, markeredgecolor="white", label=f"{name}: RMS {rms:.3f} mm{count}", **look)
            _residuals(low, at[good], residual[good], limit, look)
        top.set_ylabel("deflection |dz| (mm)")
        top.set_ylim(bottom=0.0 if np.abs(measured).min() < 0.3 * np.abs(measured).max() else None)
        top.margins(y=0.12)
        beyond = any((np.abs(e[np.isfinite(e)]) > limit).any() for e in error.values())
        low.set_ylim(-1.15 * limit, (1.6 if beyond else 1.15) * limit)
        low.set_ylabel("simulated − measured (mm)\n← too stiff    too soft →", size=9.5)
        low.set_xticks(x, list(poses))
        low.set_xlabel("pose number" + ("; arrows leave the axis and are not shown above" if beyond else ""))
        for ax in (top, low):
            ax.grid(visible=False, axis="x")
        handles = [*top.get_legend_handles_labels()[0], band]
        top.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.04), ncols=2, borderaxespad=0.0)
        figure.suptitle(
            "Measured and simulated deflection by pose", x=0.01, ha="left", size=11, weight="bold"
        )
    return figure


def _residuals(ax: Axes, x: Array, residual: Array, limit: float, look: Mapping[str, object]) -> None:
    """Stems from zero; values beyond the limit stand at it as an arrow with their number."""
    shown = np.clip(residual, -limit, limit)
    ax.vlines(x, 0.0, shown, color=str(look["color"]), linewidth=1.4)
    inside = np.abs(residual) <= limit
    ax.plot(x[inside], residual[inside], markeredgecolor="white", **look)  # type: ignore[arg-type]
    for at, value in zip(x[~inside], residual[~inside], strict=True):
        end = np.copysign(limit, value)
        ax.plot(at, end, marker="^" if value > 0.0 else "v", color=str(look["color"]), markersize=7)
        ax.annotate(
            f"{value:+.2f}",
            (at, end),
            (0, 6 if value > 0.0 else -6),
            textcoords="offset points",
            ha="center",
            va="bottom" if value > 0.0 else "top",
            size=8.5,
            rotation=90,
        )


def comparison_figure(rows: Sequence[VariantRow]) -> Figure:
    """Draw how well each variant fits, and how well it predicts poses left out (RMS, mm), as paired bars.

    The axis is linear. A value that is three times the next one or more is drawn as a broken bar with its number.

    Raises
    ------
    InputError
        No rows, or no finite value.
    """
    values = np.array([[row.fit_rms_mm, row.left_out_rms_mm] for row in rows])
    if not np.isfinite(values).any():
        raise InputError("comparison figure: no finite RMS error to draw")
    limit = _axis_limit(values[np.isfinite(values)])
    y = np.arange(len(rows))
    with house_style():
        figure, (ax,) = new_figure((10.0, 1.7 + 0.78 * len(rows)))
        for k, (label, colour) in enumerate(
            (("fit to all poses", SERIES[0]), ("prediction of poses left out", SERIES[1]))
        ):
            at = y + (k - 0.5) * 0.36
            ax.barh(
                at, np.clip(np.nan_to_num(values[:, k]), 0.0, 1.12 * limit), 0.34, color=colour, label=label
            )
            for row, value in zip(at, values[:, k], strict=True):
                _bar_end(ax, row, value, limit)
        plural = [f"{r.name}\n{r.parameters} parameter{'' if r.parameters == 1 else 's'}" for r in rows]
        ax.set_yticks(y, plural)
        ax.set_ylim(len(rows) - 0.45, -0.55)
        ax.set_xlim(0.0, 1.25 * limit)
        ax.tick_params(axis="y", length=0)
        ax.grid(visible=False, axis="y")
        broken = bool((values[np.isfinite(values)] > limit).any())
        ax.set_xlabel(
            "RMS error (mm)" + ("; broken bars leave the axis, their value is written" if broken else "")
        )
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.1)
        figure.suptitle(
            "Fit, and prediction of poses that were left out", x=0.01, ha="left", size=11, weight="bold"
        )
    return figure


def _bar_end(ax: Axes, row: float, value: float, limit: float) -> None:
    end = min(value, 1.12 * limit) if np.isfinite(value) else 0.0
    text = f"{value:.3f}" if np.isfinite(value) else "not predicted"
    ax.annotate(
        text,
        (end, row),
        (4, 0),
        textcoords="offset points",
        va="center",
        size=9,
        weight="bold" if end < value else "normal",
    )
    if end < value:
        for cut in (0.985, 1.005):
            ax.plot(
                [cut * limit, (cut + 0.02) * limit], [row + 0.24, row - 0.24], color="white", linewidth=3.0
            )


def springs_figure(
    rows: Mapping[str, Sequence[SpringEstimate]],
    start_bounds_Nm_per_rad: tuple[float, float] | None = None,  # noqa: N803
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
            ax.axvspan(
                *start_bounds_Nm_per_rad,
                color=FAINT,
                alpha=0.3,
                linewidth=0,
                label="range the fit started in",
            )
        ax.set_xscale("log")
        ax.set_xlim(low, high)
        for i, (path, springs) in enumerate(rows.items()):
            look = {"color": SERIES[i % 6], "marker": MARKERS[i % 6]}
            ax.plot([], [], linewidth=2.2, label=f"load path: {path}", **look)
            for s in springs:
                _interval(ax, joints.index(s.joint) + (i - (len(rows) - 1) / 2) * step, s, high, look)
        ax.set_yticks(range(len(joints)), joints, weight="bold")
        ax.set_ylim(len(joints) - 0.45, -0.55)
        ax.tick_params(axis="y", length=0)
        ax.grid(visible=False, axis="y")
        ax.set_xlabel("joint stiffness (N m/rad), 95 % interval; arrow: a rigid joint is not excluded")
        ax.text(1.01, 1.02, "10⁶ N m/rad (95 %)", transform=ax.transAxes, weight="bold", size=9)
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.1)
        figure.suptitle(
            "Constant joint springs from all poses at once", x=0.01, ha="left", size=11, weight="bold"
        )
    return figure


def _value(s: SpringEstimate) -> float:
    return s.stiffness if s.status in ("determined", "one-sided") else float("nan")


def _interval(ax: Axes, y: float, s: SpringEstimate, edge: float, look: Mapping[str, str]) -> None:
    (low, high), value = s.interval, _value(s)
    if np.isfinite(low) and np.isinf(high):
        ax.annotate(
            "",
            (edge, y),
            (low, y),
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-|>",
                "color": look["color"],
                "linewidth": 2.2,
                "shrinkA": 0,
                "shrinkB": 0,
            },
        )
    elif np.isfinite(low):
        ax.hlines(y, low, high, color=look["color"], linewidth=2.2)
    for end in (low, high):
        if np.isfinite(end):
            ax.plot(end, y, marker="|", color=look["color"], markersize=10, markeredgewidth=2.2)
    if np.isfinite(value):
        ax.plot(value, y, color=look["color"], marker=look["marker"], markersize=8, markeredgecolor="white")
    number = {
        "determined": f"{value / 1e6:#.3g} ({low / 1e6:#.3g} to {high / 1e6:#.3g})",
        "one-sided": f"{value / 1e6:#.3g} (at least {low / 1e6:#.3g})",
        "at bound": f"at least {low / 1e6:#.3g}; rigid fits best",
        "not identified": "not identified",
    }[s.status]
    ax.annotate(
        number.replace("(nan to nan)", "(no spare reading)").replace("at least nan", "no limit"),
        (1.01, y),
        xycoords=("axes fraction", "data"),
        va="center",
        size=9,
        color=look["color"],
    )


def rigid_joint_figure(poses: Sequence[str], measured_mm: Array, simulated: Mapping[str, Array]) -> Figure:
    """Draw the first models, with rigid joints, against the measured deflection (mm, log axis) and the factor.

    Parameters
    ----------
    poses, measured_mm : (n,) labels and readings
    simulated : name of a model -> (n,) mm

    Raises
    ------
    InputError
        Arrays that are not as long as ``poses``, or a deflection of zero or not finite (no logarithm).
    """
    measured = np.abs(np.asarray(measured_mm, dtype=np.float64))
    models = {name: np.abs(np.asarray(v, dtype=np.float64)) for name, v in simulated.items()}
    for name, values in {"measured_mm": measured, **models}.items():
        _same_length(f"rigid joint figure: {name}", values, poses)
        if not (np.isfinite(values).all() and (values > 0.0).all()):
            raise InputError(
                f"rigid joint figure: {name}", value=values.tolist(), allowed="finite, not 0 (mm)"
            )
    step = 0.7 / max(len(models), 1)
    with house_style():
        figure, (ax,) = new_figure((10.0, 1.6 + 0.36 * len(poses) * max(len(models), 2)))
        ax.set_xscale("log")
        for i, (name, values) in enumerate(models.items()):
            colour = SERIES[i % 6]
            for p in range(len(poses)):
                y = p + (i - (len(models) - 1) / 2) * step
                ax.plot([values[p], measured[p]], [y, y], color=colour, linewidth=1.4, alpha=0.55, zorder=2)
                factor = float(f"{measured[p] / values[p]:.2g}")
                ax.annotate(
                    f"× {factor:,g}".replace(",", " "),
                    (np.sqrt(values[p] * measured[p]), y),
                    (0, 1.5),
                    textcoords="offset points",
                    ha="center",
                    va="bottom",
                    size=9.5,
                    weight="bold",
                )
                ax.annotate(
                    f"{values[p]:.3g}",
                    (values[p], y),
                    (-7, 0),
                    textcoords="offset points",
                    ha="right",
                    va="center",
                    size=9,
                    color=colour,
                )
            ax.plot(
                values,
                np.arange(len(poses)) + (i - (len(models) - 1) / 2) * step,
                linestyle="none",
                label=name,
                marker=MARKERS[(i + 1) % 6],
                color=colour,
                markersize=8,
            )
        spread = [(i - (len(models) - 1) / 2) * step for i in range(len(models))] or [0.0]
        every = np.add.outer(np.arange(len(poses)), spread)
        ax.plot(
            np.repeat(measured, len(spread)),
            every.ravel(),
            "o",
            color=INK,
            markersize=8,
            label="measured",
            zorder=3,
        )
        for p, value in enumerate(measured):
            ax.annotate(
                f"{value:.2f}",
                (value, p),
                (9, 0),
                textcoords="offset points",
                va="center",
                size=9.5,
                weight="bold",
            )
        ax.set_yticks(range(len(poses)), [f"pose {p}" for p in poses])
        ax.set_ylim(len(poses) - 0.45, -0.55)
        ax.margins(x=0.12)
        ax.grid(visible=False, axis="y")
        ax.set_xlabel("deflection |dz| (mm), log axis; × = measured over simulated")
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, borderaxespad=0.1)
        figure.suptitle(
            "Models with rigid joints against the measurement", x=0.01, ha="left", size=11, weight="bold"
        )
    return figure


def _axis_limit(values: Array) -> float:
    """End of a linear axis of magnitudes: the largest, or the last one before a jump to a few far larger."""
    ordered = np.sort(values)
    for i in range(int(0.6 * len(ordered)), len(ordered) - 1):
        if ordered[i] > 0.0 and ordered[i + 1] > _JUMP * ordered[i]:
            return float(ordered[i])
    return float(ordered[-1]) if ordered.size and ordered[-1] > 0.0 else 1.0


def _paler(colour: str) -> Array:
    # Not transparency: the grid would show through the bars.
    return np.asarray(0.42 * np.array(to_rgb(colour)) + 0.58)


def _same_length(what: str, values: Array, poses: Sequence[str]) -> None:
    if values.shape != (len(poses),) or not len(poses):
        raise InputError(
            what, value=f"shape {values.shape}", allowed=f"({len(poses)},), one value a pose, n >= 1"
        )


def _same_load(a: float, b: float) -> bool:
    return abs(a - b) <= 0.01 * abs(b)


def _applies(doubt: Doubt, pose: str, load: float) -> bool:
    return pose in doubt.poses and any(_same_load(load, other) for other in doubt.loads_N)


def _load_groups(loads: Array) -> list[tuple[float, list[int]]]:
    """Readings by load; loads within 1 % are one, for a real weight is never its nominal one."""
    groups: list[tuple[float, list[int]]] = []
    for i in np.argsort(loads, kind="stable"):
        if groups and _same_load(float(loads[i]), groups[-1][0]):
            groups[-1][1].append(int(i))
        else:
            groups.append((float(loads[i]), [int(i)]))
    return groups
