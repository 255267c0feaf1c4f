"""The gap in space: arrows of measured minus simulated at each pose's tool point, before and after."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from doe.diagnosis.space import Gaps
from doe.tables.measurements import largest_rows
from fem.arm import Arm
from robots.arrays import Array
from robots.constants import M_TO_MM
from stiffarm.commands.diagnose.arms import skeleton, tool_points
from stiffarm.pages import style
from stiffarm.pages.rendering import VIEWS, chosen, show
from stiffarm.pages.robot_drawing import draw_robot
from stiffarm.pages.scenes import Scene

# Looks by the model: of the two arrows at a pose the wide one is the model's before.
_LOOKS: Final[dict[str, dict[str, Any]]] = {
    "before": {"color": style.OKABE_ITO["vermillion"], "linewidth": 4.0},
    "after": {"color": style.OKABE_ITO["blue"], "linewidth": 1.8},
}
# The poses of longer campaigns are points alone.
_MOST_LINES: Final = 27
# Length of the longest arrow as a share of the box that holds arm and poses.
_LONGEST: Final = 0.2


def space_figure(found: Gaps, arm: Arm, planned: Array | None = None, *, changed: bool) -> Figure:
    """Draw the arm in the pose with the largest gap, and at each pose the gap under its largest load.

    The arm's other poses are thin lines. ``planned`` (n, dof) rad: poses to measure next; ``changed``: whether the
    model after differs from the one before.
    """
    rows = largest_rows(found.pose, np.linalg.norm(found.force, axis=1))
    points = found.point[rows] * M_TO_MM
    arrows = {"before": np.nan_to_num(found.before[rows])}
    if changed:
        arrows["after"] = np.nan_to_num(found.after[rows])
    worst = int(np.linalg.norm(arrows["before"], axis=1).argmax())
    bodies = tuple(draw_robot(arm.description, arm.robot, found.q[rows[worst]]))
    measured = [M_TO_MM * skeleton(arm.robot, found.q[r], found.point[r])[0] for r in rows]
    ahead = [] if planned is None else [(q, tool_points(arm.robot, q[None])[0]) for q in planned]
    to_come = [M_TO_MM * skeleton(arm.robot, q, at)[0] for q, at in ahead]
    every = np.vstack([points, *measured, *to_come, *[body.mesh.bounds for body in bodies]])
    largest = max(float(np.linalg.norm(gap, axis=1).max()) for gap in arrows.values())
    scale = _LONGEST * float(np.ptp(every, axis=0).max()) / max(largest, 1e-12)
    tips = np.vstack([points + scale * gap for gap in arrows.values()])
    camera, nothing = VIEWS["oblique"], np.zeros((0, 3))
    works, _ = chosen(None)
    figure, _ = style.new_figure("picture", rows=0)
    with style.house_style():
        axes = style.frame_axes(figure, camera, style.box_ticks(np.vstack([every, tips])), flat=False)
        show(figure, axes, Scene(camera, nothing, nothing, bodies), works)
        for line in measured if len(measured) <= _MOST_LINES else []:
            axes.plot(*camera(line)[:, :2].T, color=style.FAINT, linewidth=0.9, zorder=1.5)
        for line in to_come:
            axes.plot(*camera(line)[:, :2].T, color=style.INK, linewidth=1.1, linestyle=(0, (4, 2)), zorder=3)
            axes.plot(*camera(line[-1])[:2], "D", color="white", markeredgecolor=style.INK, markersize=7.0, zorder=4.5)
        for name, gap in arrows.items():
            _arrows(axes, camera(points)[:, :2], camera(points + scale * gap)[:, :2], **_LOOKS[name])
        title = arm.description.title.split(" (")[0]
        style.headings(
            figure,
            f"{title}: where measurement and simulation disagree",
            f"measured minus simulated displacement at {len(rows)} poses, each under its largest load; "
            f"the arm in pose {found.pose[rows[worst]]}, where the gap is largest",
        )
        _legend(figure, axes, list(arrows), scale, largest, planned=bool(to_come))
    return figure


def _arrows(axes: Axes, tail: Array, head: Array, color: str, linewidth: float) -> None:
    way = head - tail
    look: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.0013 * linewidth, "zorder": 4}
    axes.quiver(tail[:, 0], tail[:, 1], way[:, 0], way[:, 1], color=color, **look)
    axes.plot(tail[:, 0], tail[:, 1], "o", color="white", markeredgecolor=color, markersize=4.5, zorder=3.5)


def _legend(figure: Figure, axes: Axes, names: list[str], scale: float, largest_m: float, *, planned: bool) -> None:
    """Colours, and a bar whose length is a round number of millimetres."""
    words = {"before": "before", "after": "with what was missing"}
    handles = [Line2D([], [], label=words[name], **_LOOKS[name]) for name in names]
    if planned:
        look: dict[str, Any] = {"color": style.INK, "linewidth": 1.1, "linestyle": (0, (4, 2)), "marker": "D"}
        handles.append(Line2D([], [], label="to measure next", markerfacecolor="white", markersize=7.0, **look))
    figure.legend(handles=handles, loc="upper right", bbox_to_anchor=(0.985, 0.88), fontsize=10)
    size_mm = float(MaxNLocator(nbins=3, steps=[1, 2, 5, 10]).tick_values(0.0, M_TO_MM * largest_m)[1])
    length = scale * size_mm / M_TO_MM
    (u0, u1), (v0, v1) = axes.get_xlim(), axes.get_ylim()
    u, v = u0 + 0.03 * (u1 - u0), v0 + 0.955 * (v1 - v0)
    axes.plot([u, u + length], [v, v], color="#222222", linewidth=2.6, solid_capstyle="butt", zorder=5, clip_on=False)
    axes.text(u, v + 0.012 * (v1 - v0), f"{size_mm:g} mm, of arrows", ha="left", va="bottom", size=10)
