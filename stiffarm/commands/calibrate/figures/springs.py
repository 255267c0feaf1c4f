"""Figures of the calibrated springs: constants with intervals, and laws against angles. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from doe import SpringPoints
from fem.springs import spring_from
from robots import InputError, Robot
from robots.arrays import Array
from robots.schema.description import LogPolynomialLaw
from stiffarm.pages.figure_parts import MARKERS, SERIES, above, angle_label, log_ticks, note, power_of_ten, title
from stiffarm.pages.style import FAINT, OKABE_ITO, house_style, new_figure
from stiffarm.session.spring_words import UNIT, SpringEstimate, spring_text

_SURFACE: Final = OKABE_ITO["green"]
# Marker, face and edge of a point by its origin, and what the legend calls it.
_POINTS: Final = {
    "calibrated": ("o", OKABE_ITO["vermillion"], OKABE_ITO["vermillion"], "calibrated"),
    "mirrored": ("o", "white", OKABE_ITO["vermillion"], "mirrored by symmetry"),
    "held": ("s", "#8A8F96", "#5A5F66", "held at its starting value"),
}


def springs_figure(
    rows: Mapping[str, Sequence[SpringEstimate]],
    start_bounds_Nm_per_rad: tuple[float, float] | None = None,
    heading: str = "Constant joint springs from all poses at once",
) -> Figure:
    """Draw constant springs with their 95 % intervals (N m/rad, log axis), a colour for each calibration.

    An arrow: there is no limit on that side (to the right a rigid joint is not excluded). A spring at its bound
    has no marker, for its value means nothing; only its limit is drawn.

    Parameters
    ----------
    rows : name of a calibration -> its constant springs
    start_bounds_Nm_per_rad : shaded, the range in which the fit started

    Raises
    ------
    InputError
        No springs.
    """
    joints = list(dict.fromkeys(s.joint for springs in rows.values() for s in springs))
    if not joints:
        raise InputError("springs figure: no springs to draw")
    known = [v for k in rows.values() for s in k for v in (*s.interval, _value(s)) if 0.0 < v < np.inf]
    known += list(start_bounds_Nm_per_rad or ())
    ends = (min(known) / 2.5, max(known) * 2.5) if known else (1e4, 1e7)
    step = 0.7 / len(rows)
    with house_style():
        figure, (ax,) = new_figure((10.0, 1.6 + len(joints) * max(0.32 * len(rows), 0.84)))
        if start_bounds_Nm_per_rad is not None:
            band: dict[str, Any] = {"color": FAINT, "alpha": 0.3, "linewidth": 0}
            ax.axvspan(*start_bounds_Nm_per_rad, label="range the fit started in", **band)
        ax.set_xscale("log")
        ax.set_xlim(*ends)
        log_ticks(ax.xaxis)
        for i, (name, springs) in enumerate(rows.items()):
            look: dict[str, Any] = {"color": SERIES[i % 6], "marker": MARKERS[i % 6]}
            ax.plot([], [], linewidth=2.2, label=name, **look)
            for s in springs:
                _interval(ax, joints.index(s.joint) + (i - (len(rows) - 1) / 2) * step, s, ends, look)
        ax.set_yticks(range(len(joints)), joints, weight="bold")
        ax.set_ylim(len(joints) - 0.45, -0.55)
        ax.tick_params(axis="y", length=0)
        ax.grid(visible=False, axis="y")
        ax.set_xlabel("joint stiffness (N m/rad), 95 % interval; arrow to the right: a rigid joint is not excluded")
        ax.text(1.01, 1.02, f"{UNIT} (95 %)", transform=ax.transAxes, weight="bold", size=9)
        above(ax, ax.get_legend_handles_labels()[0], 3)
        title(figure, heading)
    return figure


def _value(s: SpringEstimate) -> float:
    return s.stiffness if s.status in ("determined", "one-sided") else float("nan")


def _interval(ax: Axes, y: float, s: SpringEstimate, ends: tuple[float, float], look: Mapping[str, Any]) -> None:
    low, high = s.interval
    value, colour = _value(s), look["color"]
    known = [end for end in (low, high) if 0.0 < end < np.inf]
    # Without spare readings there is a bound but no limit: nothing to draw.
    if len(known) == 1 and not np.isnan([low, high]).any():
        arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 2.2, "shrinkA": 0, "shrinkB": 0}
        tip = ends[1] if np.isinf(high) else ends[0]
        ax.annotate("", (tip, y), (known[0], y), annotation_clip=False, arrowprops=arrow)
    elif len(known) == 2:
        ax.hlines(y, low, high, color=colour, linewidth=2.2)
    for end in known:
        ax.plot(end, y, marker="|", color=colour, markersize=10, markeredgewidth=2.2)
    if np.isfinite(value):
        ax.plot(value, y, markersize=8, markeredgecolor="white", **look)
    where: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "ha": "left", "color": colour}
    note(ax, spring_text(s), (1.01, y), **where)


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


def _curve(ax: Axes, robot: Robot, law: LogPolynomialLaw, points: SpringPoints) -> None:
    (angle,) = _range(law, 201)
    ax.semilogy(np.degrees(angle), _stiffness(robot, law, angle[:, None]), color=_SURFACE, linewidth=2.4)
    _markers(ax, points, points.stiffness)
    low, high = ax.get_ylim()
    # A curve that varies little must not look wild: half a decade is shown at least.
    middle, half = np.sqrt(low * high), max(np.sqrt(high / low), 10**0.25)
    ax.set_ylim(middle / half, middle * half)
    ax.yaxis.set_major_locator(LogLocator(subs=(1, 1.5, 2, 3, 4, 5, 6, 8) if half < 10**0.4 else (1, 2, 5)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda k, _: power_of_ten(float(k))))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.set_xlabel(angle_label(law.inputs[0]))
    ax.set_ylabel("stiffness (N m/rad)")


def _markers(ax: Any, points: SpringPoints, height: Array) -> None:
    for origin, (marker, face, edge, _) in _POINTS.items():
        mine = np.array(points.origin) == origin
        look = {"markerfacecolor": face, "markeredgecolor": edge, "markeredgewidth": 1.5, "markersize": 7.5}
        ax.plot(*np.degrees(points.angles[mine]).T, height[mine], marker, zorder=4, **look)


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
    ax.zaxis.set_major_formatter(FuncFormatter(lambda v, _: power_of_ten(10.0**v)))
    ax.set_xlabel(angle_label(law.inputs[0]), labelpad=6)
    ax.set_ylabel(angle_label(law.inputs[1]), labelpad=6)
    ax.set_zlabel("stiffness (N m/rad)", labelpad=1)
    ax.locator_params(axis="x", nbins=5)
    ax.locator_params(axis="y", nbins=5)
    ax.view_init(elev=24, azim=-58)
    ax.set_box_aspect((1.2, 1.0, 0.88), zoom=0.95)
