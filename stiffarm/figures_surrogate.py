"""Figures of springs against angles, main effects, surrogate quality and what bends. Data in, Figure out."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap, LogNorm, to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from doe import SpringPoints
from fem.springs import spring_from
from robots import InputError, Robot
from robots.schema import LogPolynomialLaw
from stiffarm.figures_calibration import SERIES, above, joint_colour, note, paler, title
from stiffarm.picture_style import FAINT, INK, OKABE_ITO, house_style, new_figure
from surrogate.main_effects import MainEffect

Array = NDArray[np.float64]

_SURFACE: Final = OKABE_ITO["green"]
# Marker, face and edge of a point by its origin, and what the legend calls it.
_POINTS: Final = {
    "calibrated": ("o", OKABE_ITO["vermillion"], OKABE_ITO["vermillion"], "calibrated"),
    "mirrored": ("o", "white", OKABE_ITO["vermillion"], "mirrored by symmetry"),
    "held": ("s", "#8A8F96", "#5A5F66", "held at its starting value"),
}
_GREYS: Final = ("#6B7178", "#9AA0A7", "#C4C8CD")
_JOINT: Final = re.compile(r"(?:j|a|joint)[ _-]?\d+", re.IGNORECASE)
# A surrogate whose largest error is below this part of the others' is not drawn beside them.
_FAR_BELOW: Final = 1e-5


@dataclass(frozen=True, eq=False)
class HeldOut:
    """A surrogate on runs kept out of its fit: true and predicted stiffness, (n,) N/mm."""

    name: str
    true_N_per_mm: Array  # noqa: N815 - units are written as the shop writes them
    predicted_N_per_mm: Array  # noqa: N815

    @property
    def relative_error(self) -> Array:
        """``|predicted / true - 1|`` of the compliance (n,), 1 and not %, as in ``ErrorFigures``."""
        return np.asarray(np.abs(self.true_N_per_mm / self.predicted_N_per_mm - 1.0))


def response_surface_figure(
    laws: Mapping[str, LogPolynomialLaw], points: Mapping[str, SpringPoints], robot: Robot
) -> Figure:
    """Draw each joint's stiffness (N m/rad, log axis) against its one or two angles, with its points.

    Parameters
    ----------
    laws, points : joint -> law and the points it was fitted to, with the same inputs
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
        figure, _ = new_figure((10.0, 0.9 + (3.7 if cols == 2 else 4.2) * rows), rows=0)
        figure.set_layout_engine("constrained", w_pad=0.12, h_pad=0.06)
        for i, joint in enumerate(j for j in robot.joint_names if j in laws):
            flat = len(laws[joint].inputs) == 1
            ax: Any = figure.add_subplot(rows, cols, i + 1, projection=None if flat else "3d")
            (_curve if flat else _surface)(ax, robot, laws[joint], points[joint])
            ax.set_title(f"Joint {joint}", loc="left", weight="bold")
        keys: list[Any] = []
        for origin, (marker, face, edge, label) in _POINTS.items():
            if any(origin in p.origin for p in points.values()):
                look: dict[str, Any] = {"markerfacecolor": face, "markeredgecolor": edge, "markersize": 7.5}
                keys += figure.axes[0].plot([], [], linestyle="none", marker=marker, label=label, **look)
        keys += figure.axes[0].plot([], [], color=_SURFACE, linewidth=3.0, label="fitted law")
        figure.legend(handles=keys, loc="outside lower center", ncols=4)
        title(figure, "Calibrated joint stiffness against the joint angles")
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
    _markers(ax, points, points.stiffness)
    low, high = ax.get_ylim()
    # A curve that varies little must not look wild: half a decade is shown at least.
    middle, half = np.sqrt(low * high), max(np.sqrt(high / low), 10**0.25)
    ax.set_ylim(middle / half, middle * half)
    ax.yaxis.set_major_locator(LogLocator(subs=(1, 1.5, 2, 3, 4, 5, 6, 8) if half < 10**0.4 else (1, 2, 5)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda k, _: _power(float(k))))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.set_xlabel(_angle_label(law.inputs[0]))
    ax.set_ylabel("stiffness (N m/rad)")


def _markers(ax: Any, points: SpringPoints, height: Array) -> None:
    for origin, (marker, face, edge, _) in _POINTS.items():
        mine = np.array(points.origin) == origin
        look = {"markerfacecolor": face, "markeredgecolor": edge, "markeredgewidth": 1.5, "markersize": 7.5}
        ax.plot(*np.degrees(points.angles[mine]).T, height[mine], marker, zorder=4, **look)


def _power(k: float) -> str:
    exponent = int(np.floor(np.log10(k) + 1e-9))
    lead = f"{k / 10.0**exponent:.3g}"
    return rf"$10^{{{exponent}}}$" if lead == "1" else rf"${lead}\cdot10^{{{exponent}}}$"


def _surface(ax: Any, robot: Robot, law: LogPolynomialLaw, points: SpringPoints) -> None:
    """3-D axes know no log axis, so log10 k is drawn and the ticks are powers of ten."""
    x, y = np.meshgrid(*_range(law, 61), indexing="ij")
    log_k = np.log10(_stiffness(robot, law, np.stack([x.ravel(), y.ravel()], axis=1))).reshape(x.shape)
    ax.computed_zorder = False
    look = {"alpha": 0.55, "rcount": 20, "ccount": 20, "linewidth": 0.35, "edgecolor": "#007A59"}
    ax.plot_surface(np.degrees(x), np.degrees(y), log_k, color=_SURFACE, zorder=1, **look)
    _markers(ax, points, np.log10(points.stiffness))
    every = np.concatenate([log_k.ravel(), np.log10(points.stiffness)])
    low, high = np.floor(2.0 * every.min()) / 2.0, np.ceil(2.0 * every.max() + 1e-9) / 2.0
    ax.set_zlim(low, high)
    ax.set_zticks(np.arange(np.ceil(low), high + 0.01))
    ax.zaxis.set_major_formatter(FuncFormatter(lambda v, _: rf"$10^{{{v:.0f}}}$"))
    ax.set_xlabel(_angle_label(law.inputs[0]), labelpad=6)
    ax.set_ylabel(_angle_label(law.inputs[1]), labelpad=6)
    ax.set_zlabel("stiffness (N m/rad)", labelpad=1)
    ax.locator_params(axis="x", nbins=5)
    ax.locator_params(axis="y", nbins=5)
    ax.view_init(elev=24, azim=-58)
    ax.set_box_aspect((1.2, 1.0, 0.88), zoom=0.95)


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
            heights = _spread([float(effect[column][-1]) for _, column, _, _ in looks])
            for (label, column, colour, marker), height in zip(looks, heights, strict=True):
                look: dict[str, Any] = {"color": OKABE_ITO[colour]}
                ax.plot(levels, effect[column], marker=marker, markersize=7, **look)
                note(ax, label, (float(levels[-1]), height), (7, 0), ha="left", weight="bold", size=9.5, **look)
            ax.set_xticks(levels, [f"{v:g}".replace("-", "−") for v in levels])
            ax.set_xlabel(_angle_label(name))
            span = max(float(np.ptp(levels)), 1.0)
            ax.set_xlim(levels[0] - 0.1 * span, levels[-1] + 0.36 * span)
        axes[0].set_ylabel("structural stiffness / its maximum (–)")
        axes[0].set_ylim(0.0, 1.06)
        title(figure, "Main effects of the joint angles on the stiffness")
    return figure


def _spread(values: Sequence[float]) -> list[float]:
    """Heights for labels at ascending values, pushed up so that none overlaps the axis or another."""
    out = [max(values[0], 0.02)]
    for value in values[1:]:
        out.append(max(value, out[-1] + 0.055))
    return out


def surrogate_quality_figure(rows: Sequence[HeldOut]) -> Figure:
    """Draw predicted against true stiffness (N/mm) on held-out runs, and how large the errors are.

    The panel of errors tells which share of the runs has a larger relative error than x (both axes log),
    with marks at the RMS, at 95 % of the runs, and at the largest error.

    Raises
    ------
    InputError
        No rows, arrays that do not fit, or a stiffness that is not positive and finite.
    """
    if not rows:
        raise InputError("surrogate figure: no surrogates to draw")
    for row in rows:
        if np.shape(row.true_N_per_mm) != np.shape(row.predicted_N_per_mm) or np.ndim(row.true_N_per_mm) != 1:
            raise InputError(f"surrogate figure: {row.name}", allowed="two arrays (n,) of one length")
        both = np.concatenate([row.true_N_per_mm, row.predicted_N_per_mm])
        if not both.size or not (np.isfinite(both).all() and (both > 0.0).all()):
            raise InputError(f"surrogate figure: {row.name}: stiffness", allowed="finite, above 0 N/mm")
    every = np.concatenate([np.concatenate([r.true_N_per_mm, r.predicted_N_per_mm]) for r in rows])
    ends = (0.93 * float(every.min()), 1.07 * float(every.max()))
    cols = 2 if len(rows) in (2, 4) else min(3, len(rows))
    lines, height = -(-len(rows) // cols), 7.6 / cols + 0.7
    with house_style():
        # Panels about as high as wide; a single one stands beside the errors.
        figure, _ = new_figure((10.0, lines * height + 4.0 if len(rows) > 1 else 4.6), rows=0)
        figure.set_layout_engine("constrained")
        if len(rows) > 1:
            grid = figure.add_gridspec(lines + 1, cols, height_ratios=[*[height] * lines, 3.6])
        else:
            grid = figure.add_gridspec(1, 2, width_ratios=[1.0, 1.3])
        panels = [figure.add_subplot(grid[i // cols, i % cols]) for i in range(len(rows))]
        cells = [_parity(ax, row, ends) for ax, row in zip(panels, rows, strict=True)]
        most = max(10.0, *(float(np.max(np.asarray(cell.get_array()))) for cell in cells))
        for i, (ax, row, cell) in enumerate(zip(panels, rows, cells, strict=True)):
            cell.set_norm(LogNorm(1.0, most))
            ax.set_title(row.name, loc="left", color=SERIES[i % 6], weight="bold", size=10)
            if i % cols == 0:
                ax.set_ylabel("predicted stiffness (N/mm)")
        bar = figure.colorbar(cells[0], ax=panels, aspect=30, pad=0.015, format="%g")
        bar.set_label("runs in a cell (–)")
        _tails(figure.add_subplot(grid[lines, :] if len(rows) > 1 else grid[0, 1]), rows)
        title(figure, "Surrogates on runs that were kept out of the fit")
    return figure


def _parity(ax: Axes, row: HeldOut, ends: tuple[float, float]) -> PolyCollection:
    low, high = (float(v) for v in np.log10(ends))
    # The palest blues are left out: a cell with a single run must be seen on white.
    look: dict[str, Any] = {"cmap": ListedColormap(colormaps["Blues"](np.linspace(0.3, 1.0, 256)))}
    look |= {"gridsize": 42, "mincnt": 1, "linewidths": 0.1, "extent": (low, high, low, high)}
    cells = ax.hexbin(row.true_N_per_mm, row.predicted_N_per_mm, xscale="log", yscale="log", **look)
    ax.plot(ends, ends, color=OKABE_ITO["vermillion"], linewidth=0.9)
    ax.set_xlim(*ends)
    ax.set_ylim(*ends)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        axis.set_minor_formatter(NullFormatter())
    ax.set_xlabel("true stiffness (N/mm)")
    return cells


def _tails(ax: Axes, rows: Sequence[HeldOut]) -> None:
    """Share of the runs with a larger error. A surrogate that is exact by comparison is only named."""
    largest = max(float(row.relative_error.max()) for row in rows)
    ax.set_xscale("log")
    ax.set_yscale("log")
    shown = [row for row in rows if row.relative_error.max() > _FAR_BELOW * largest] or list(rows)
    lines: list[Any] = []
    for i, row in enumerate(rows):
        error = np.sort(row.relative_error)
        rms = float(np.sqrt(np.mean(error**2)))
        marks = {"RMS": rms, "95 %": float(np.quantile(error, 0.95)), "max": float(error[-1])}
        text = f"{row.name}: " + ", ".join(f"{key} {_percent(value)}" for key, value in marks.items())
        text += "" if row in shown else " (left of the axis)"
        share = 1.0 - np.arange(len(error)) / len(error)
        kept = slice(None) if row in shown else slice(0)
        lines += ax.plot(error[kept], share[kept], color=SERIES[i % 6], label=text)
        for marker, value in zip("osD", marks.values() if row in shown else (), strict=False):
            # The largest stands at the end of the curve, also where several runs share it.
            at = 1.0 / len(error) if marker == "D" else float(np.mean(error >= value))
            look: dict[str, Any] = {"markersize": 8, "markeredgecolor": "white", "zorder": 4}
            ax.plot(value, at, marker, color=SERIES[i % 6], **look)
    names = ("RMS", "95 % of the runs are below", "largest")
    keys = [ax.plot([], [], m, color="#777777", label=n)[0] for m, n in zip("osD", names, strict=True)]
    middle = min(float(np.median(row.relative_error)) for row in shown)
    ax.set_xlim(max(0.02 * middle, 1e-17), 2.0 * max(largest, 1e-16))
    ax.set_ylim(0.5 / max(len(row.true_N_per_mm) for row in rows), 1.4)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda v, _: _percent(float(v))))
        axis.set_minor_formatter(NullFormatter())
    ax.set_xlabel("relative error of the compliance (%)")
    ax.set_ylabel("runs with a larger error (%)")
    # The layout leaves room for the last legend only, so the one inside comes first.
    ax.add_artist(ax.legend(handles=keys, loc="lower left", borderaxespad=0.6))
    above(ax, lines, 1)


def _percent(value: float) -> str:
    return f"{float(f'{100.0 * value:.2g}'):g} %"


def budget_figure(
    parts: Mapping[str, Array],
    poses: Sequence[str],
    measured_mm: Array | None = None,
    least_share: float = 0.02,
) -> Figure:
    """Draw what bends: each part's share of the vertical deflection (mm) by pose, in stacked bars.

    Parts that work against the sum (possible under a load that is not vertical) stand left of zero.

    Parameters
    ----------
    parts : name -> (n,) mm, from :func:`fem.deflection_by_part`
    poses : (n,) labels
    measured_mm : (n,) readings, drawn as a black line across each bar
    least_share : parts below this share at every pose are drawn together

    Raises
    ------
    InputError
        No parts, arrays not as long as ``poses``, values not finite, or a pose that does not deflect.
    """
    table = np.array([np.asarray(v, dtype=np.float64) for v in parts.values()])
    if table.shape != (len(parts), len(poses)) or not table.size or not np.isfinite(table).all():
        allowed = f"finite, ({len(poses)},) each"
        raise InputError("budget figure: parts", value=f"shape {table.shape}", allowed=allowed)
    total = table.sum(axis=0)
    if not total.all():
        raise InputError(f"budget figure: pose {poses[int(np.argmin(np.abs(total)))]} does not deflect")
    stack = _stacked(list(parts), table * np.sign(total), np.abs(total), least_share)
    with house_style():
        figure, (ax,) = new_figure((10.0, 1.8 + 0.4 * len(poses)))
        for name, values, left in stack:
            _segment(ax, name, values, left, _part_colour(name, [n for n, _, _ in stack]), np.abs(total))
        end = sum(np.maximum(values, 0.0) for _, values, _ in stack)
        for row, value in enumerate(np.abs(total)):
            behind = (float(np.asarray(end)[row]), row)
            note(ax, f"{value:.2f} mm", behind, (7, 0), ha="left", weight="bold")
        y, keys = np.arange(len(poses)), ax.get_legend_handles_labels()[0]
        if measured_mm is not None:
            ax.vlines(np.abs(measured_mm), y - 0.46, y + 0.46, color="black", linewidth=2.2)
            look: dict[str, Any] = {"color": "black", "markersize": 11, "markeredgewidth": 2.2}
            keys += ax.plot([], [], linestyle="none", marker="|", label="measured", **look)
        ax.axvline(0.0, color=INK, linewidth=0.8)
        ax.set_yticks(y, [f"pose {p}" for p in poses])
        ax.set_ylim(len(poses) - 0.4, -0.6)
        ax.set_xlim(min(0.0, 1.05 * ax.dataLim.x0), 1.12 * ax.dataLim.x1)
        ax.tick_params(axis="y", length=0)
        ax.grid(visible=False, axis="y")
        ax.set_xlabel("vertical deflection |dz| (mm); bold: simulated sum, in the bars: share of it (%)")
        above(ax, keys, 7)
        title(figure, "Where the deflection comes from")
    return figure


def _stacked(names: list[str], size: Array, total: Array, least_share: float) -> list[tuple[str, Array, Array]]:
    """Name, length and left end (n,) of each segment: largest part first, the small ones together last."""
    share = np.abs(size) / total
    kept = sorted(np.flatnonzero(share.max(axis=1) >= least_share), key=lambda i: -float(share[i].mean()))
    segments = [(names[i], size[i]) for i in kept]
    small = [i for i in range(len(names)) if i not in kept and share[i].max() > 0.0]
    if small:
        count = "other part," if len(small) == 1 else f"{len(small)} other parts, each"
        segments.append((f"{count} below {100 * least_share:g} %", size[small].sum(axis=0)))
    out: list[tuple[str, Array, Array]] = []
    for name, values in segments:
        same = [np.where(values * v > 0.0, v, 0.0) for _, v, _ in out]
        out.append((name, values, np.sum([np.zeros(len(values)), *same], axis=0)))
    return out


def _segment(ax: Axes, name: str, values: Array, left: Array, colour: str, total: Array) -> None:
    y = np.arange(len(values))
    ax.barh(y, values, 0.74, left=left, color=colour, edgecolor="white", linewidth=0.8, label=name)
    dark = np.dot(to_rgb(colour), (0.3, 0.59, 0.11)) < 0.5
    for row in np.flatnonzero(np.abs(values) > 0.045 * total.max()):
        middle = (float(left[row] + values[row] / 2), float(row))
        text = f"{100 * values[row] / total[row]:.0f} %".replace("-", "−")
        note(ax, text, middle, color="white" if dark else INK)


def _part_colour(name: str, names: Sequence[str]) -> str:
    """Joints in their colours of the other figures, structure in greys, so that the two are told apart."""
    found = _JOINT.match(name)
    if found:
        colour = joint_colour(found.group())
        return colour if found.group() == name else paler(colour)
    return _GREYS[[n for n in names if not _JOINT.match(n)].index(name) % 3]
