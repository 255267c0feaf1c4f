"""Every measured pose as a skeleton with arrows for the deflection read, simulated and left over: small multiples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from doe.diagnosis.space import Stand
from robots import InputError, Robot, forward_kinematics
from robots.arrays import Array
from robots.constants import M_TO_MM
from robots.quantities import significant
from stiffarm.pages.style import FAINT, INK, OKABE_ITO, house_style, new_figure

READ, SIMULATED, LEFT = INK, OKABE_ITO["sky"], OKABE_ITO["vermillion"]
_ARM: Final = "#9AA1A8"
# Length of the longest arrow of each kind as a share of the arms' extent at most, and how far what is left over stands
# aside.
_LONGEST: Final = 0.45
_ASIDE: Final = 0.1
# Arms beside one another by the number of views; widths of figures, and heights of an arm's title and of what stands
# above and below all of them.
_COLUMNS: Final = {1: 5, 2: 3}
_WIDTH_IN, _NARROWEST_IN, _TITLE_IN, _TOP_IN, _BOTTOM_IN = 10.0, 7.4, 0.5, 0.4, 0.35
# Height of an arm at most, and what stays free beside it as a share of the arms' extent.
_HIGHEST_IN, _GAP = 2.6, 0.05


@dataclass(frozen=True, eq=False)
class _Looks:
    """What all panels share: ``times`` deflections, and what is left over, are larger than the arm.

    ``middle``, ``half`` (2,) m of what is shown, by view.
    """

    times: tuple[float, float]
    extent: float
    middle: dict[str, Array]
    half: dict[str, Array]


def arms_figure(some: Sequence[Stand], robot: Robot, heading: str, scale_by: Sequence[Stand] = ()) -> Figure:
    """Draw stands from the side, in the upright plane through the tool; where more than Z was read, from above too.

    Parameters
    ----------
    some : the stands to draw, in their order
    scale_by : all stands, where several figures are to have one scale

    Raises
    ------
    InputError
        No stands.
    """
    if not some:
        raise InputError("arms figure", code="B002", allowed="at least one pose")
    every = list(scale_by) or list(some)
    views = ("side", "above") if any(np.isfinite(s.read[:2]).any() for s in every) else ("side",)
    looks = _looks_of(every, robot, views)
    columns = min(_COLUMNS[len(views)], len(some))
    rows = -(-len(some) // columns)
    # All in one pair of axes, in metres: hundreds of them would take their time to lay out.
    wide = sum(2.0 * looks.half[view][0] for view in views) + _GAP * looks.extent
    high = max(2.0 * looks.half[view][1] for view in views)
    inch = min(_WIDTH_IN / (_COLUMNS[len(views)] * wide), _HIGHEST_IN / high)
    size = (max(columns * wide * inch, _NARROWEST_IN), _TOP_IN + _BOTTOM_IN + rows * (_TITLE_IN + high * inch))
    figure, _ = new_figure(size, rows=0)
    with house_style():
        # As far from the edge in inches, however high the figure is.
        figure.suptitle(heading, x=0.01, y=1.0 - 0.08 / size[1], ha="left", va="top", size=11.5, weight="bold")
        ax = figure.add_axes((0.0, _BOTTOM_IN / size[1], 1.0, 1.0 - (_TOP_IN + _BOTTOM_IN) / size[1]))
        ax.set_axis_off()
        ax.set(xlim=(0.0, size[0] / inch), ylim=(-rows * (high + _TITLE_IN / inch), 0.0), autoscale_on=False)
        for k, one in enumerate(some):
            corner = np.array([k % columns * wide, -(k // columns) * (high + _TITLE_IN / inch)])
            left = significant(M_TO_MM * one.left_over_m, 2)
            words = f"pose {one.pose}, {significant(one.load_N)} N\n{left} mm left over"
            for view, text in zip(views, (words, "\nfrom above"), strict=False):
                place = corner - np.array([0.0, 0.75 * _TITLE_IN / inch])
                ax.text(corner[0] + 0.02 * wide, corner[1], text, va="top", size=9.0, linespacing=1.25)
                _draw(ax, one, robot, view, looks, place)
                corner[0] += 2.0 * looks.half[view][0]
        _legend(figure, looks)
    return figure


def _skeleton(robot: Robot, q: Array, point: Array) -> list[Array]:
    """Lines (k, 3) m through the joints of an arm in poses q (dof,) to the point that was read.

    First the chain itself, from the base; then the crank and bar of a parallelogram.
    """
    frames = forward_kinematics(robot, q[None])
    chain = np.vstack([np.zeros(3), frames.p[0], frames.p_flange, point[None]])
    lines = [chain]
    if (pg := robot.parallelogram) is not None:
        lever = frames.R[0, pg.driven + 1] @ pg.pin
        crank, driven = frames.p[0, pg.crank_about + 1], frames.p[0, pg.driven + 1]
        lines.append(np.stack([crank, crank + lever, driven + lever, driven]))
    return lines


def _plane(s: Stand, view: str) -> Array:
    """Right and up (2, 3) of a view: in the upright plane through the tool, or from above."""
    if view == "above":
        return np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    out = s.point * [1.0, 1.0, 0.0]
    size = float(np.linalg.norm(out))
    right = out / size if size > 1e-6 else np.array([1.0, 0.0, 0.0])
    return np.stack([right, [0.0, 0.0, 1.0]])


def _looks_of(every: Sequence[Stand], robot: Robot, views: Sequence[str]) -> _Looks:
    lines = {v: [[x @ _plane(s, v).T for x in _skeleton(robot, s.q, s.point)] for s in every] for v in views}
    corners = {v: np.vstack([x for of_one in some for x in of_one]) for v, some in lines.items()}
    extent = max(float(np.ptp(flat, axis=0).max()) for flat in corners.values())
    deflection = max(float(np.linalg.norm(np.nan_to_num(v))) for s in every for v in (s.read, s.read - s.before))
    left = max(float(np.linalg.norm(np.nan_to_num(s.before))) for s in every)
    times = _round_down(_LONGEST * extent / max(deflection, 1e-12)), _round_down(_LONGEST * extent / max(left, 1e-12))
    middle, half = {}, {}
    for v in views:
        ends = [end for s in every for _, tail, way in _arrows(s, v, times, extent) for end in (tail, tail + way)]
        flat = np.vstack([corners[v], *ends])
        low, high = flat.min(axis=0), flat.max(axis=0)
        middle[v], half[v] = 0.5 * (low + high), 0.5 * (high - low) + 0.03 * extent
    return _Looks(times, extent, middle, half)


def _round_down(value: float) -> float:
    """The next of 1, 2, 5, 10, ... that is not larger."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(k for k in (1.0, 2.0, 5.0) if k * power <= value * (1.0 + 1e-9)) * power)


def _arrows(s: Stand, view: str, times: tuple[float, float], extent: float) -> list[tuple[str, Array, Array]]:
    """Each arrow of a stand: what it is, where it begins and its way (2,) in a view."""
    plane = _plane(s, view)
    at = s.point @ plane.T
    read, before = (plane @ np.nan_to_num(v) for v in (s.read, s.before))
    aside = at + _ASIDE * extent * _across(read, at)
    return [
        ("read", at, times[0] * read),
        ("simulated", at, times[0] * (read - before)),
        ("left over", aside, times[1] * before),
    ]


def _draw(ax: Axes, s: Stand, robot: Robot, view: str, looks: _Looks, corner: Array) -> None:
    """Draw a stand with the upper left corner of what is shown at ``corner`` (2,)."""
    middle, half = looks.middle[view], looks.half[view]
    move = corner - middle + half * [1.0, -1.0]
    chain, *others = (line @ _plane(s, view).T + move for line in _skeleton(robot, s.q, s.point))
    for line in others:
        ax.plot(*line.T, color=FAINT, linewidth=1.4, zorder=1)
    ax.plot(*chain.T, color=_ARM, linewidth=2.6, solid_capstyle="round", solid_joinstyle="round", zorder=1.2)
    ax.plot(*chain[1:-2].T, "o", color="white", markeredgecolor="#6F757D", markersize=3.6, zorder=1.4)
    for what, tail, way in _arrows(s, view, looks.times, looks.extent):
        _arrow(ax, tail + move, way, _ARROWS[what], float(np.linalg.norm(way)) / looks.extent)
    if view == "side":
        floor = np.array([[middle[0] - half[0], 0.0], [middle[0] + half[0], 0.0]]) + move
        ax.plot(*floor.T, color=FAINT, linewidth=0.8, zorder=0.5)


def _across(read: Array, at: Array) -> Array:
    """Unit vector (2,) across a deflection, away from the arm."""
    size = float(np.linalg.norm(read))
    way = np.array([-read[1], read[0]]) / size if size > 1e-12 else np.array([1.0, 0.0])
    return way if way @ at >= 0.0 else -way


# Looks by what an arrow is: they differ by width and by how they begin, not by colour alone.
_ARROWS: Final[dict[str, dict[str, Any]]] = {
    "read": {"color": READ, "linewidth": 4.2, "zorder": 2.0},
    "simulated": {"color": SIMULATED, "linewidth": 1.7, "zorder": 2.2},
    "left over": {"color": LEFT, "linewidth": 2.2, "zorder": 2.4, "marker": "o", "markerfacecolor": "white"},
}


def _arrow(ax: Axes, tail: Array, way: Array, look: dict[str, Any], share: float) -> None:
    """An arrow whose length is a ``share`` of the arms' extent; short ones have small heads."""
    small = min(1.0, share / 0.12)
    ax.annotate(
        "",
        tuple((tail + way).tolist()),
        tuple(tail.tolist()),
        zorder=look["zorder"],
        annotation_clip=False,
        arrowprops={
            "arrowstyle": "-|>,head_width=0.22,head_length=0.42",
            "color": look["color"],
            "lw": max(look["linewidth"] * small, 0.8),
            "shrinkA": 0.0,
            "shrinkB": 0.0,
            "mutation_scale": max(10.0 * small, 2.0),
        },
    )
    if "marker" in look:
        ax.plot(
            *tail,
            look["marker"],
            color="white",
            markeredgecolor=look["color"],
            markersize=4.0,
            zorder=look["zorder"] + 0.1,
        )


def _legend(figure: Figure, looks: _Looks) -> None:
    """What the arrows are, and how many times they are larger than the arm."""
    deflection, left = (f"× {significant(times, 1)}" for times in looks.times)
    said = {
        "read": f"read ({deflection})",
        "simulated": f"simulated, springs alone ({deflection})",
        "left over": f"left over: read minus simulated ({left})",
    }
    handles = [Line2D([], [], label=text, **_ARROWS[what]) for what, text in said.items()]
    figure.legend(handles=handles, loc="lower left", ncols=3)
