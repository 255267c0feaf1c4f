"""Figures of sensitivity studies: the factorial, Sobol, Morris and derivatives. Pure: data in, Figure out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from doe import PoseEffects
from doe.planning.screening import Screening, variance_shares
from robots import InputError
from stiffarm.pages.figure_parts import MARKERS, SERIES, drawing, joint_colour, named_rows, note, paler, panels
from stiffarm.pages.style import INK, OKABE_ITO

_TOTAL: Final = OKABE_ITO["blue"]
_EXACT: Final = OKABE_ITO["vermillion"]
_COLUMNS: Final = 3
_LINE: Final = {"color": INK, "linewidth": 1.2, "capsize": 3}


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
        raise InputError("sensitivity figure: no effects to draw", code="B002")
    every = np.concatenate([e.effect_mm for column in effects.values() for e in column])
    low, high = levels_Nm_per_rad or (0.0, 0.0)
    step = f" from {low:,.0f} to {high:,.0f} N m/rad" if levels_Nm_per_rad else ""
    heading, size = "Which joint's stiffness moves the tool", (10.0, 1.6 + 1.25 * len(poses))
    with drawing(heading, size, len(poses), len(effects), sharex=True) as (figure, axes):
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
        figure.supxlabel(f"effect on {read_words(effects)} of stiffening one joint{step} (mm); positive: less", size=10)
    return figure


def read_words(effects: Mapping[str, Sequence[PoseEffects]]) -> str:
    """What the effects of a study are on: ``dz``, or the largest reading where poses differ in that."""
    found = {e.component for column in effects.values() for e in column}
    return f"d{'xyz'[found.pop()]}" if len(found) == 1 else "the largest of dx, dy, dz"


def _effect_bars(ax: Axes, effects: PoseEffects, largest: float) -> None:
    colours = [joint_colour(joint, i + 2) for i, joint in enumerate(effects.joints)]
    ax.barh(range(len(colours)), effects.effect_mm, 0.72, color=colours)
    ax.axvline(0.0, color=INK, linewidth=0.8)
    for row, value in enumerate(effects.effect_mm):
        text = "0" if abs(value) <= 1e-7 * largest else f"{value:+.3g}".replace("-", "−")
        side = 1 if value >= 0.0 else -1
        note(ax, text, (value, float(row)), (4 * side, 0), ha="left" if side > 0 else "right")
    named_rows(ax, effects.joints)


def shares_figure(found: Screening, poses: Sequence[str], what: str) -> Figure:
    """Draw a panel for each pose: total and first-order indices with 95 % intervals, and diamonds.

    Diamonds: what the exact derivatives at mid-range would make of the variance, were they the same everywhere.

    Without Sobol indices (NaN) the derivative shares are the bars.

    Raises
    ------
    InputError
        No poses, or labels of another number than the study's outputs.
    """
    _check(found, poses)
    k = len(found.parameters)
    indices = bool(np.isfinite(found.total).any())
    heading = f"Which number moves {what}" + ("" if indices else ": shares of exact derivatives, mid-range")
    rows = np.arange(k)
    with panels(heading, len(poses), _COLUMNS, _width(poses), 1.0 + 0.34 * k, 1.2) as (figure, axes):
        for o, (ax, pose) in enumerate(zip(axes, poses, strict=True)):
            if indices:
                bars: dict[str, Any] = {"xerr": found.total_conf[o], "error_kw": _LINE, "label": "total index"}
                ax.barh(rows, found.total[o], 0.72, color=paler(_TOTAL), **bars)
                ax.barh(rows, np.maximum(found.first[o], 0.0), 0.36, color=_TOTAL, label="first order")
                diamonds: dict[str, Any] = {"markersize": 5, "label": "expected from exact derivatives, mid-range"}
                ax.plot(variance_shares(found.derivative[o]), rows, "D", color=_EXACT, **diamonds)
            else:
                ax.barh(rows, found.derivative[o], 0.72, color=_EXACT)
            ax.set_title(f"pose {pose}", loc="left")
            named_rows(ax, found.parameters if o % _COLUMNS == 0 else [""] * k)
            ax.set_xlim(0.0, 1.25 if indices else None)
        if indices:
            figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def morris_figure(found: Screening, poses: Sequence[str], what: str, factor: float, unit: str) -> Figure:
    """Draw a panel for each pose: spread against mean of the elementary effects, a marker for each number.

    Far right: it matters. High up: its effect depends on where the others (or itself) stand. ``factor``: from m
    or rad to ``unit``.

    Raises
    ------
    InputError
        No poses, or labels of another number than the study's outputs.
    """
    _check(found, poses)
    heading = f"Morris: elementary effects on {what}"
    with panels(heading, len(poses), _COLUMNS, _width(poses), 3.6, 1.2) as (figure, axes):
        for ax, pose, mean, spread in zip(axes, poses, found.mean_effect * factor, found.spread * factor, strict=True):
            for i, name in enumerate(found.parameters):
                look: dict[str, Any] = {
                    "color": SERIES[i % 6],
                    "marker": MARKERS[(i // 6 + i) % 6],
                    "linestyle": "none",
                }
                ax.plot(mean[i], spread[i], markersize=8, markeredgecolor="white", label=name, **look)
            reach = 1.08 * max(float(mean.max()), float(spread.max()), 1e-12)
            ax.plot([0.0, reach], [0.0, reach], color="#BBBBBB", linewidth=0.9, linestyle="--", zorder=0.5)
            ax.set(xlim=(-0.02 * reach, reach), ylim=(-0.04 * reach, reach), xlabel=f"mean effect ({unit})")
            ax.set_title(f"pose {pose}", loc="left")
        for ax in axes[::_COLUMNS]:
            ax.set_ylabel(f"spread ({unit})")
        handles, names = axes[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=min(len(names), 6))
    return figure


def _width(poses: Sequence[str]) -> float:
    return 10.5 if len(poses) > 1 else 7.0


def _check(found: Screening, poses: Sequence[str]) -> None:
    if not poses or found.derivative.shape != (len(poses), len(found.parameters)):
        raise InputError(
            "screening figure: poses", code="B002", value=len(poses), allowed="one label for each output, at least 1"
        )
