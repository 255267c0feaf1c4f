"""Small pictures of the arm in a pose, with the load as an arrow, for sheets."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence

import numpy as np

from robots import ModelDescription, Robot, forward_kinematics, tool_position
from robots.arrays import Array
from robots.constants import M_TO_MM
from robots.progress import Progress, report_progress
from stiffarm.pages import style
from stiffarm.pages.robot_drawing import draw_robot
from stiffarm.pages.scenes import Scene, Window, z_buffer_image

# Width and height in pixels: some 300 dpi at the size on the page.
WIDTH, HEIGHT = 640, 520
_SIZE_IN = (3.2, 2.6)
# Pixels drawn for two of the picture: reducing them smooths the edges.
FINENESS = 3
# Share of the frame that stays free around arm and arrow.
_MARGIN = 0.04
_ARROW = style.OKABE_ITO["vermillion"]
_CAMERA = style.Camera(np.array([0.55, -1.0, 0.42]))


def pose_pictures(
    description: ModelDescription,
    robot: Robot,
    q: Array,
    direction: Array | None,
    progress: Progress | None = None,
) -> list[str]:
    """A base64 PNG for each pose q (n, dof) rad under a load along direction (n, 3) or none; all at the same scale."""
    tool = tool_position(robot, forward_kinematics(robot, q)) * M_TO_MM
    nothing = np.zeros((0, 3))
    scenes = [Scene(_CAMERA, nothing, nothing, tuple(draw_robot(description, robot, one))) for one in q]
    reach = max(float(np.linalg.norm(body.mesh.bounds, axis=1).max()) for scene in scenes for body in scene.bodies)
    along = np.zeros((len(q), 3)) if direction is None else direction
    arrows = [np.stack([end, end + 0.22 * reach * d]) for end, d in zip(tool, along, strict=True)]
    extent = _extent(scenes, arrows)
    out = []
    for scene, arrow in zip(scenes, arrows, strict=True):
        out.append(_drawn(scene, arrow, extent))
        report_progress(progress, len(out), len(scenes))
    return out


def _extent(scenes: Sequence[Scene], arrows: Sequence[Array]) -> tuple[float, float, float, float]:
    """The piece of the picture plane (u0, u1, v0, v1 in mm) that holds every arm and arrow."""
    corners = np.vstack([*arrows, *[np.asarray(body.mesh.vertices) for scene in scenes for body in scene.bodies]])
    flat = _CAMERA(corners)[:, :2]
    low, high = flat.min(axis=0), flat.max(axis=0)
    return style.window(0.5 * (low + high), (0.5 + _MARGIN) * (high - low), np.array([WIDTH, HEIGHT]))


def _drawn(scene: Scene, arrow: Array, extent: tuple[float, float, float, float]) -> str:
    image = z_buffer_image(scene, Window(extent, FINENESS * WIDTH // 2, FINENESS * HEIGHT // 2))
    figure, _ = style.new_figure(_SIZE_IN, rows=0)
    with style.house_style():
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.imshow(image, extent=extent, aspect="auto", interpolation="antialiased")
        start, end = _CAMERA(arrow)[:, :2]
        look = {"arrowstyle": "-|>,head_width=0.35,head_length=0.7", "color": _ARROW, "lw": 2.6}
        if (arrow[0] != arrow[1]).any():
            axes.annotate("", end, start, arrowprops={**look, "shrinkA": 0.0, "shrinkB": 0.0})
        axes.set(xlim=extent[:2], ylim=extent[2:])
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=WIDTH / _SIZE_IN[0])
    return base64.b64encode(buffer.getvalue()).decode("ascii")
