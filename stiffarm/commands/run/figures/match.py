"""Figures of models against the measurement: by pose, as RMS errors, with rigid joints. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robots import InputError
from robots.arrays import Array
from stiffarm.pages.figure_parts import MARKERS, SERIES, above, axis_limit, log_ticks, note, paler, same_length, title
from stiffarm.pages.style import FAINT, INK, house_style, new_figure


@dataclass(frozen=True)
class VariantRow:
    """A calibrated variant: RMS errors in mm of the fit and of poses left out (NaN = not predicted)."""

    name: str
    parameters: int
    fit_rms_mm: float
    left_out_rms_mm: float


def match_figure(
    poses: Sequence[str],
    measured_mm: Array,
    variants: Mapping[str, Array],
    gauge_mm: float = 0.01,
    heading: str = "Measured and simulated deflection by pose",
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
        same_length(f"match figure: {name}", values, poses)
    if not np.isfinite(measured).all():
        raise InputError("match figure: measured_mm", value="NaN or infinity", allowed="finite (mm)")
    # Along the reading's own sense, so that "too soft" is up whatever the sign of dz.
    error = {name: (v - measured) * np.where(measured < 0.0, -1.0, 1.0) for name, v in simulated.items()}
    size = np.abs(np.concatenate([*error.values(), measured[:0]]))
    limit = max(axis_limit(size[np.isfinite(size)]), 2.5 * gauge_mm)
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
        low.set_xticks(x, list(poses), rotation=0 if sum(map(len, poses)) <= 100 else 90)
        low.set_xlabel("pose number" + ("; arrows leave the axis and are not shown above" if beyond else ""))
        for ax in (top, low):
            ax.grid(visible=False, axis="x")
        above(top, [*top.get_legend_handles_labels()[0], gauge], 2)
        title(figure, heading)
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
    limit = axis_limit(values[np.isfinite(values)])
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
        same_length(f"rigid joint figure: {name}", values, poses)
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
        log_ticks(ax.xaxis, lambda v: f"{v:g}")
        ax.grid(visible=False, axis="y")
        ax.set_xlabel("deflection |dz| (mm), log axis; × = measured over simulated")
        above(ax, ax.get_legend_handles_labels()[0], 4)
        title(figure, "Models with rigid joints against the measurement")
    return figure
