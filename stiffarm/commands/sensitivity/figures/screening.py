"""Figures of Sobol, Morris and derivative studies. Pure: data in, Figure out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from doe.planning.screening import Screening, variance_shares
from robots import InputError
from stiffarm.pages.figure_parts import MARKERS, SERIES, paler, title
from stiffarm.pages.style import INK, OKABE_ITO, house_style, new_figure

_TOTAL: Final = OKABE_ITO["blue"]
_EXACT: Final = OKABE_ITO["vermillion"]
_COLUMNS: Final = 3
_LINE: Final = {"color": INK, "linewidth": 1.2, "capsize": 3}


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
    with house_style():
        figure, panels = _panels(len(poses), 1.0 + 0.34 * k)
        rows = np.arange(k)
        for o, (ax, pose) in enumerate(zip(panels, poses, strict=False)):
            if indices:
                ax.barh(rows, found.total[o], 0.72, xerr=found.total_conf[o], color=paler(_TOTAL), error_kw=_LINE)
                ax.barh(rows, np.maximum(found.first[o], 0.0), 0.36, color=_TOTAL)
                ax.plot(variance_shares(found.derivative[o]), rows, "D", color=_EXACT, markersize=5, linestyle="none")
            else:
                ax.barh(rows, found.derivative[o], 0.72, color=_EXACT)
            ax.set_title(f"pose {pose}", loc="left")
            ax.set_yticks(rows, list(found.parameters) if o % _COLUMNS == 0 else [""] * k)
            ax.set_ylim(k - 0.4, -0.6)
            ax.set_xlim(0.0, 1.25 if indices else None)
            ax.grid(visible=False, axis="y")
        handles: list[Patch | Line2D] = []
        if indices:
            handles = [Patch(color=paler(_TOTAL), label="total index"), Patch(color=_TOTAL, label="first order")]
            handles.append(
                Line2D(
                    [],
                    [],
                    label="expected from exact derivatives, mid-range",
                    marker="D",
                    color=_EXACT,
                    linestyle="none",
                )
            )
            figure.legend(handles=handles, loc="outside lower center", ncols=3)
        title(figure, f"Which number moves {what}" + ("" if indices else ": shares of exact derivatives, mid-range"))
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
    with house_style():
        figure, panels = _panels(len(poses), 3.6)
        for ax, pose, mean, spread in zip(
            panels, poses, found.mean_effect * factor, found.spread * factor, strict=False
        ):
            for i, name in enumerate(found.parameters):
                look = {"color": SERIES[i % 6], "marker": MARKERS[(i // 6 + i) % 6], "linestyle": "none"}
                ax.plot(mean[i], spread[i], markersize=8, markeredgecolor="white", label=name, **look)
            reach = 1.08 * max(float(mean.max()), float(spread.max()), 1e-12)
            ax.plot([0.0, reach], [0.0, reach], color="#BBBBBB", linewidth=0.9, linestyle="--", zorder=0.5)
            ax.set(xlim=(-0.02 * reach, reach), ylim=(-0.04 * reach, reach), xlabel=f"mean effect ({unit})")
            ax.set_title(f"pose {pose}", loc="left")
        for ax in panels[::_COLUMNS]:
            ax.set_ylabel(f"spread ({unit})")
        handles, names = panels[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=min(len(names), 6))
        title(figure, f"Morris: elementary effects on {what}")
    return figure


def _panels(count: int, height: float) -> tuple[Figure, list]:  # type: ignore[type-arg]
    columns = min(count, _COLUMNS)
    rows = -(-count // columns)
    figure, axes = new_figure((10.5 if columns > 1 else 7.0, 1.2 + height * rows), rows, columns)
    for ax in axes[count:]:
        ax.set_visible(False)
    return figure, axes[:count]


def _check(found: Screening, poses: Sequence[str]) -> None:
    if not poses or found.derivative.shape != (len(poses), len(found.parameters)):
        raise InputError("screening figure: poses", value=len(poses), allowed="one label for each output, at least 1")
