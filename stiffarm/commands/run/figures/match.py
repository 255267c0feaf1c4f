"""The figure of models against the measurement, pose by pose. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robots import InputError
from robots.arrays import Array
from stiffarm.pages.figure_parts import MARKERS, SERIES, above, axis_limit, drawing, named_columns, note, same_length
from stiffarm.pages.style import FAINT, INK


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
        top.set_ylabel("deflection |dz| (mm)")
        top.margins(y=0.1)
        low.set_ylim(-1.15 * limit, (1.6 if beyond else 1.15) * limit)
        low.set_ylabel("simulated − measured (mm)\n← too stiff    too soft →", size=9.5)
        named_columns(low, poses)
        top.grid(visible=False, axis="x")
        low.set_xlabel("pose number" + ("; arrows leave the axis and are not shown above" if beyond else ""))
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
