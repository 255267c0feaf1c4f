"""Figures of springs against angles, main effects, surrogate quality and what bends. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, PercentFormatter
from numpy.typing import NDArray

from doe import SpringPoints
from fem.springs import spring_from
from robots import InputError, Robot
from robots.schema import LogPolynomialLaw
from stiffarm.figures_calibration import MARKERS, SERIES, joint_colour
from stiffarm.picture_style import FAINT, INK, OKABE_ITO, house_style, new_figure
from surrogate.main_effects import MainEffect

Array = NDArray[np.float64]

_SURFACE: Final = OKABE_ITO["green"]
# Filled: calibrated; hollow: mirrored by symmetry; grey: held at an assumed value.
_POINTS: Final = {
    "calibrated": ("o", OKABE_ITO["vermillion"], OKABE_ITO["vermillion"]),
    "mirrored": ("o", "white", OKABE_ITO["vermillion"]),
    "held": ("s", "#8A8F96", "#5A5F66"),
}
_GREYS: Final = ("#6B7178", "#9AA0A7", "#C4C8CD")


@dataclass(frozen=True)
class HeldOut:
    """A surrogate on runs kept out of its fit: true and predicted stiffness, (n,) N/mm."""

    name: str
    true_N_per_mm: Array  # noqa: N815 - units are written as the shop writes them
    predicted_N_per_mm: Array  # noqa: N815

    @property
    def relative_error(self) -> Array:
        """``|predicted / true - 1|`` (n,), 1 and not %."""
        return np.asarray(np.abs(self.predicted_N_per_mm / self.true_N_per_mm - 1.0))


def response_surface_figure(
    laws: Mapping[str, LogPolynomialLaw], points: Mapping[str, SpringPoints], robot: Robot
) -> Figure:
    """Draw each joint's stiffness (N m/rad, log axis) against its one or two angles, with its points.

    Parameters
    ----------
    laws, points : joint -> law and the calibrated points it goes through, with the same inputs
    robot : whose coordinates the laws name

    Raises
    ------
    InputError
        No laws, a law of more than two angles, or a law without its points.
    """
    if not laws:
        raise InputError("response surfaces: no laws to draw")
    for joint, law in laws.items():
        if joint not in points or points[joint].inputs != law.inputs:
            raise InputError(f"response surface of {joint}: no points in the inputs of its law")
        if len(law.inputs) > 2:
            raise InputError(f"response surface of {joint}: angles", value=len(law.inputs), allowed="1 or 2")
    cols = min(2, len(laws))
    rows = -(-len(laws) // cols)
    with house_style():
        figure, _ = new_figure((5.0 * cols, 0.6 + 3.9 * rows), rows=0)
        figure.set_layout_engine("constrained", w_pad=0.12, h_pad=0.08)
        for i, (joint, law) in enumerate(laws.items()):
            flat = len(law.inputs) == 1
            ax: Any = figure.add_subplot(rows, cols, i + 1, projection=None if flat else "3d")
            (_curve if flat else _surface)(ax, robot, law, points[joint])
            ax.set_title(f"Joint {joint}", loc="left", weight="bold")
        used = [o for o in _POINTS if any(o in p.origin for p in points.values())]
        handles = [
            figure.axes[0].plot([], [], m, markerfacecolor=face, markeredgecolor=edge, markersize=7.5)[0]
            for m, face, edge in (_POINTS[o] for o in used)
        ]
        notes = {
            "calibrated": "calibrated",
            "mirrored": "mirrored by symmetry",
            "held": "held at its starting value",
        }
        handles += figure.axes[0].plot([], [], color=_SURFACE, linewidth=3.0)
        figure.legend(handles, [*(notes[o] for o in used), "fitted law"], loc="outside upper right", ncols=4)
    return figure


def _stiffness(robot: Robot, law: LogPolynomialLaw, angles: Array) -> Array:
    """Stiffness (n,) N m/rad of a law at angles (n, inputs) rad."""
    q = np.zeros((len(angles), robot.dof))
    q[:, [robot.coordinate_index(name) for name in law.inputs]] = angles
    return np.asarray(1.0 / spring_from(robot, law).compliance(q))


def _range(law: LogPolynomialLaw, count: int) -> list[Array]:
    """Angles (count,) rad over each input's range of validity."""
    ends = zip(law.centre_deg, law.half_range_deg, strict=True)
    return [np.radians(np.linspace(c - h, c + h, count)) for c, h in ends]


def _angle_label(name: str) -> str:
    return f"{name.removesuffix('_deg')} (deg)"


def _curve(ax: Axes, robot: Robot, law: LogPolynomialLaw, points: SpringPoints) -> None:
    (angle,) = _range(law, 201)
    ax.semilogy(np.degrees(angle), _stiffness(robot, law, angle[:, None]), color=_SURFACE, linewidth=2.4)
    for origin, (marker, face, edge) in _POINTS.items():
        mine = np.array(points.origin) == origin
        ax.plot(
            np.degrees(points.angles[mine, 0]),
            points.stiffness[mine],
            marker,
            markersize=8,
            markerfacecolor=face,
            markeredgecolor=edge,
            markeredgewidth=1.5,
            zorder=4,
        )
    low, high = ax.get_ylim()
    # A curve that varies little must not look wild: half a decade is shown at least.
    middle, half = np.sqrt(low * high), max(np.sqrt(high / low), 10**0.25)
    ax.set_ylim(middle / half, middle * half)
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda k, _: _power(float(k))))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.set_xlabel(_angle_label(law.inputs[0]))
    ax.set_ylabel("stiffness (N m/rad)")


def _power(k: float) -> str:
    exponent = int(np.floor(np.log10(k) + 1e-9))
    lead = round(k / 10.0**exponent)
    return rf"$10^{{{exponent}}}$" if lead == 1 else rf"${lead}\cdot10^{{{exponent}}}$"


def _surface(ax: Any, robot: Robot, law: LogPolynomialLaw, points: SpringPoints) -> None:
    """3-D axes know no log axis, so log10 k is drawn and the ticks are powers of ten."""
    x, y = np.meshgrid(*_range(law, 61), indexing="ij")
    log_k = np.log10(_stiffness(robot, law, np.stack([x.ravel(), y.ravel()], axis=1))).reshape(x.shape)
    ax.computed_zorder = False
    ax.plot_surface(
        np.degrees(x),
        np.degrees(y),
        log_k,
        color=_SURFACE,
        alpha=0.55,
        rcount=31,
        ccount=31,
        linewidth=0.3,
        edgecolor="#00684C",
        zorder=1,
    )
    for origin, (marker, face, edge) in _POINTS.items():
        mine = np.array(points.origin) == origin
        ax.plot(
            *np.degrees(points.angles[mine]).T,
            np.log10(points.stiffness[mine]),
            marker,
            markersize=7.5,
            markerfacecolor=face,
            markeredgecolor=edge,
            markeredgewidth=1.5,
            zorder=4,
        )
    every = np.concatenate([log_k.ravel(), np.log10(points.stiffness)])
    low, high = np.floor(2.0 * every.min()) / 2.0, np.ceil(2.0 * every.max()) / 2.0
    ax.set_zlim(low, high)
    ax.set_zticks(np.arange(np.ceil(low), high + 0.01))
    ax.zaxis.set_major_formatter(FuncFormatter(lambda v, _: rf"$10^{{{v:.0f}}}$"))
    ax.set_xlabel(_angle_label(law.inputs[0]))
    ax.set_ylabel(_angle_label(law.inputs[1]))
    ax.set_zlabel("stiffness (N m/rad)")
    ax.locator_params(axis="x", nbins=5)
    ax.locator_params(axis="y", nbins=5)
    ax.view_init(elev=24, azim=-58)
    ax.set_box_aspect((1.15, 1.0, 0.8), zoom=0.86)


def main_effects_figure(effects: Mapping[str, MainEffect | tuple[Array, Array, Array, Array]]) -> Figure:
    """Draw smallest, mean and largest normalised stiffness against the levels of each angle (deg).

    ``effects``: from :func:`surrogate.main_effects.main_effects`.

    Raises
    ------
    InputError
        No effects.
    """
    if not effects:
        raise InputError("main effects figure: no effects to draw")
    looks = (("min", 1, "blue", "v"), ("mean", 2, "green", "o"), ("max", 3, "vermillion", "^"))
    with house_style():
        figure, axes = new_figure((10.0, 4.2), 1, len(effects), sharey=True)
        for ax, (name, effect) in zip(axes, effects.items(), strict=True):
            levels = effect[0]
            ax.fill_between(levels, effect[1], effect[3], color=FAINT, alpha=0.25, linewidth=0)
            for label, column, colour, marker in looks:
                ax.plot(
                    levels, effect[column], color=OKABE_ITO[colour], marker=marker, markersize=7, label=label
                )
                ax.annotate(
                    label,
                    (levels[-1], effect[column][-1]),
                    (7, 0),
                    textcoords="offset points",
                    va="center",
                    color=OKABE_ITO[colour],
                    weight="bold",
                    size=9.5,
                )
            ax.set_xticks(levels, [f"{v:g}" for v in levels])
            ax.set_xlabel(_angle_label(name))
            span = max(float(np.ptp(levels)), 1.0)
            ax.set_xlim(levels[0] - 0.1 * span, levels[-1] + 0.34 * span)
        axes[0].set_ylabel("structural stiffness / its maximum (–)")
        axes[0].set_ylim(0.0, 1.06)
        figure.suptitle(
            "Main effects of the joint angles on the stiffness", x=0.01, ha="left", size=11, weight="bold"
        )
    return figure


def surrogate_quality_figure(rows: Sequence[HeldOut]) -> Figure:
    """Draw predicted against true stiffness (N/mm) on held-out runs, and how large the errors are.

    The lower panel tells which share of the runs has a larger relative error than x (both axes log), with
    marks at the RMS, at 95 % of the runs, and at the largest error.

    Raises
    ------
    InputError
        No rows, arrays that do not fit, or a stiffness that is not positive and finite.
    """
    if not rows:
        raise InputError("surrogate figure: no surrogates to draw")
    for row in rows:
        both = np.concatenate([np.ravel(row.true_N_per_mm), np.ravel(row.predicted_N_per_mm)])
        if np.shape(row.true_N_per_mm) != np.shape(row.predicted_N_per_mm) or np.ndim(row.true_N_per_mm) != 1:
            raise InputError(f"surrogate figure: {row.name}", allowed="two arrays (n,) of one length")
        if not both.size or not (np.isfinite(both).all() and (both > 0.0).all()):
            raise InputError(
                f"surrogate figure: {row.name}: stiffness", allowed="finite, greater than 0 N/mm"
            )
    every = np.concatenate([np.concatenate([r.true_N_per_mm, r.predicted_N_per_mm]) for r in rows])
    ends = (0.93 * float(every.min()), 1.07 * float(every.max()))
    cols = min(3, len(rows))
    lines = -(-len(rows) // cols)
    with house_style():
        figure, _ = new_figure((10.0, 3.6 * lines + 3.9), rows=0)
        figure.set_layout_engine("constrained")
        grid = figure.add_gridspec(lines + 1, cols, height_ratios=[*[1.0] * lines, 1.05])
        for i, row in enumerate(rows):
            ax = figure.add_subplot(grid[i // cols, i % cols])
            _parity(ax, row, ends)
            ax.set_title(row.name, loc="left", color=SERIES[i % 6], weight="bold")
            if i % cols == 0:
                ax.set_ylabel("predicted stiffness (N/mm)")
        colours = figure.axes[0].collections[0]
        bar = figure.colorbar(colours, ax=figure.axes[: len(rows)], aspect=30, pad=0.015)
        bar.set_label("runs in a cell (–)")
        _tails(figure.add_subplot(grid[lines, :]), rows)
    return figure


def _parity(ax: Axes, row: HeldOut, ends: tuple[float, float]) -> None:
    scale = tuple(np.log10(ends))
    ax.hexbin(
        row.true_N_per_mm,
        row.predicted_N_per_mm,
        gridsize=42,
        xscale="log",
        yscale="log",
        cmap="cividis_r",
        norm=LogNorm(1.0, max(10.0, len(row.true_N_per_mm) / 40)),
        mincnt=1,
        extent=(*scale, *scale),
        linewidths=0.1,
    )
    ax.plot(ends, ends, color=INK, linewidth=0.9)
    ax.set_xlim(*ends)
    ax.set_ylim(*ends)
    ax.set_aspect("equal")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        axis.set_minor_formatter(NullFormatter())
    ax.set_xlabel("true stiffness (N/mm)")


def _tails(ax: Axes, rows: Sequence[HeldOut]) -> None:
    """Share of the runs with a larger error; below a billionth of the largest error nothing is shown."""
    largest = max(float(row.relative_error.max()) for row in rows)
    ax.set_xscale("log")
    ax.set_yscale("log")
    for i, row in enumerate(rows):
        error = np.sort(row.relative_error)
        n, rms = len(error), float(np.sqrt(np.mean(error**2)))
        marks = {"RMS": rms, "95 %": float(np.quantile(error, 0.95)), "max": float(error[-1])}
        text = ", ".join(f"{key} {_percent(value)}" for key, value in marks.items())
        share = 1.0 - np.arange(n) / n
        ax.plot(error, share, color=SERIES[i % 6], label=f"{row.name}: {text}")
        for marker, value in zip("osD", marks.values(), strict=True):
            at = max(float(np.mean(error >= value)), 1.0 / n)
            ax.plot(value, at, marker, color=SERIES[i % 6], markersize=8, markeredgecolor="white", zorder=4)
    for marker, name in zip("osD", ("RMS", "95 % of the runs", "largest"), strict=True):
        ax.plot([], [], marker, color="#777777", markersize=8, label=name)
    low = max(1e-3 * min(float(np.quantile(r.relative_error, 0.5)) for r in rows), 1e-17)
    ax.set_xlim(max(low, 1e-16), 3.0 * max(largest, 1e-15))
    ax.set_ylim(0.5 / max(len(r.true_N_per_mm) for r in rows), 1.3)
    ax.xaxis.set_major_formatter(FuncFormatter(lambda v, _: _percent(float(v))))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=None))
    ax.set_xlabel("relative error of the stiffness (%), held-out runs")
    ax.set_ylabel("runs with a larger error (%)")
    ax.legend(loc="lower left", ncols=1)


def _percent(value: float) -> str:
    return f"{100.0 * value:.2g} %"


def budget_figure(
    parts: Mapping[str, Array],
    poses: Sequence[str],
    measured_mm: Array | None = None,
    least_share: float = 0.02,
) -> Figure:
    """Draw what bends: each part's share of the vertical deflection (mm) by pose, in stacked bars.

    Parameters
    ----------
    parts : name -> (n,) mm, from :func:`fem.deflection_by_part`
    poses : (n,) labels
    measured_mm : (n,) readings, drawn as a black line across each bar
    least_share : parts below this share at every pose are drawn together

    Raises
    ------
    InputError
        No parts, arrays not as long as ``poses``, values not finite, or parts that work against each other
        (as under a load that is not vertical): then shares mean nothing.
    """
    table = np.array([np.asarray(v, dtype=np.float64) for v in parts.values()])
    if table.shape != (len(parts), len(poses)) or not table.size or not np.isfinite(table).all():
        raise InputError(
            "budget figure: parts", value=f"shape {table.shape}", allowed=f"finite, ({len(poses)},) each"
        )
    total = table.sum(axis=0)
    if (table * np.sign(total) < -1e-9 * np.abs(total)).any() or not total.all():
        raise InputError("budget figure: parts that bend against the sum", remedy="load along Z only")
    size = np.abs(table)
    joints = [name for name in parts if size[list(parts).index(name)].max() > 0.0]
    share = size / np.abs(total)
    kept = [i for i, name in enumerate(parts) if share[i].max() >= least_share and name in joints]
    kept.sort(key=lambda i: -float(share[i].mean()))
    stack = [(list(parts)[i], size[i]) for i in kept]
    others = [i for i in range(len(parts)) if i not in kept and size[i].max() > 0.0]
    if others:
        stack.append((f"{len(others)} others, each below {least_share:.0%}", size[others].sum(axis=0)))
    with house_style():
        figure, (ax,) = new_figure((10.0, 1.8 + 0.4 * len(poses)))
        left, y = np.zeros(len(poses)), np.arange(len(poses))
        for i, (name, values) in enumerate(stack):
            colour = _part_colour(name, i, [n for n, _ in stack])
            ax.barh(y, values, 0.74, left=left, color=colour, edgecolor="white", linewidth=0.8, label=name)
            ink = "white" if np.dot(to_rgb(colour), (0.3, 0.59, 0.11)) < 0.5 else INK
            for row, value in enumerate(values):
                if value / np.abs(total).max() > 0.042:
                    ax.text(
                        left[row] + value / 2,
                        row,
                        f"{value / abs(total[row]):.0%}",
                        ha="center",
                        va="center",
                        size=9,
                        color=ink,
                    )
            left = left + values
        for row in range(len(poses)):
            ax.annotate(
                f"{abs(total[row]):.2f} mm",
                (left[row], row),
                (6, 0),
                textcoords="offset points",
                va="center",
                size=9,
                weight="bold",
            )
        if measured_mm is not None:
            ax.vlines(np.abs(measured_mm), y - 0.46, y + 0.46, color="black", linewidth=2.2, label="measured")
        ax.set_yticks(y, [f"pose {p}" for p in poses])
        ax.set_ylim(len(poses) - 0.4, -0.6)
        ax.set_xlim(0.0, 1.12 * float(np.abs(total).max()))
        ax.tick_params(axis="y", length=0)
        ax.grid(visible=False, axis="y")
        ax.set_xlabel("vertical deflection |dz| (mm) and each part's share of it (%)")
        ax.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=6,
            borderaxespad=0.1,
            columnspacing=1.2,
            handlelength=1.2,
        )
        figure.suptitle("Where the deflection comes from", x=0.01, ha="left", size=11, weight="bold")
    return figure


def _part_colour(name: str, position: int, names: Sequence[str]) -> str:
    """Joints in their colours of the other figures, structure in greys, so that the two are told apart."""
    if name.split()[0].lstrip("jJaA").isdigit() and not name[0].isdigit():
        return joint_colour(name.split()[0])
    rigid = [n for n in names if n[0].isdigit() or not n.split()[0].lstrip("jJaA").isdigit()]
    return _GREYS[rigid.index(name) % 3] if position >= 0 else FAINT
