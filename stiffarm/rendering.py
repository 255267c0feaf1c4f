"""Pictures of a stiffness map with the robot in it, from two viewpoints, with or without OpenGL.

Matplotlib draws frame, labels and colour bar around a parallel projection; points and robot come from
pyvista or, without OpenGL or with ``STIFFARM_NO_GL=1``, from a z-buffer in numpy (mplot3d cannot sort
points among triangles).
"""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from robots import InputError
from stiffarm import picture_style as style
from stiffarm.robot_drawing import ROBOT_COLOURS, DrawnBody
from surrogate.vtk_files import M_TO_MM, N_PER_M_TO_N_PER_MM, StiffnessMap

Array = NDArray[np.float64]
Image = NDArray[np.uint8]
Renderer = Literal["pyvista", "matplotlib"]

NO_GL_VARIABLE: Final = "STIFFARM_NO_GL"
# Direction to each light (right, up, towards the eye) and its strength.
_LIGHTS: Final = (((0.0, 0.0, 1.0), 0.5), ((-0.45, 0.67, 0.59), 0.55))
_AMBIENT_BODY, _AMBIENT_BALL, _DIFFUSE = 0.36, 0.5, 0.75
_WINDOW_VARIABLE: Final = "VTK_DEFAULT_OPENGL_WINDOW"
_PROBE: Final = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(32, 32))
plotter.add_mesh(pyvista.Sphere())
image = plotter.screenshot(None, return_img=True)
print("drawn" if image.std() > 1 else "blank", type(plotter.render_window).__name__)
"""


@dataclass(frozen=True)
class Picture:
    """A picture that was written: where, by which renderer, and why not by pyvista if so."""

    path: Path
    renderer: Renderer
    message: str


VIEWS: Final = MappingProxyType(
    {"oblique": style.Camera(np.array([0.55, -1.0, 0.42])), "side": style.Camera(np.array([0.0, -1.0, 0.0]))}
)
"""``oblique``: from the front side; ``side``: along Y onto the XZ cross-section, X to the right."""


def gl_available() -> tuple[bool, str]:
    """Find out whether pyvista can draw without a screen here.

    Without an OpenGL library VTK dies with a segmentation fault, so a subprocess tries it, once in the
    life of this process. ``STIFFARM_NO_GL=1`` answers no without trying.

    Returns (yes, the render window's class) or (no, what is missing and how to get it).
    """
    if os.environ.get(NO_GL_VARIABLE, "") not in ("", "0"):
        return False, f"off-screen OpenGL is switched off by {NO_GL_VARIABLE}; pictures come from matplotlib"
    return _probe_gl()


@functools.cache
def _probe_gl() -> tuple[bool, str]:
    try:
        # The command is this interpreter and a constant text.
        run = subprocess.run(  # noqa: S603
            [sys.executable, "-c", _PROBE], capture_output=True, text=True, timeout=120, check=False
        )
        words = run.stdout.split()[-2:]
        if run.returncode == 0 and words[:1] == ["drawn"]:
            return True, words[1]
        reason = f"the trial ended with code {run.returncode}"
    except (OSError, subprocess.TimeoutExpired) as error:
        reason = str(error)
    return False, (
        f"no off-screen OpenGL ({reason}): install the package libosmesa6 (apt-get install libosmesa6) "
        "for pyvista pictures; until then they come from matplotlib"
    )


def render_map(
    stiffness_map: StiffnessMap,
    bodies: Sequence[DrawnBody],
    path: Path,
    *,
    view: str = "oblique",
    title: str | None = None,
    subtitle: str = "",
    colour_range: tuple[float, float] | None = None,
    cut: bool = True,
    renderer: Renderer | None = None,
) -> Picture:
    """Draw a map as a cloud of coloured points around the robot; PNG of 1600 x 1200 pixels.

    Parameters
    ----------
    stiffness_map, bodies : the map, and the robot from :func:`stiffarm.robot_drawing.draw_robot`
    view : ``oblique`` or ``side`` (see ``VIEWS``)
    subtitle : what else the reader needs: load, pose of the drawn robot
    colour_range : stiffness in N/mm at the ends of the colour bar; without it the 2nd and 98th
        percentile, rounded outward. Ends that cut values off say so ("≥ 700")
    cut : leave out the points on the viewer's side of the plane Y = 0, which would hide the robot
    renderer : None takes pyvista where OpenGL works and matplotlib elsewhere

    Raises
    ------
    InputError
        Unknown view, a colour range that is not ascending, or a folder that does not exist.
    """
    if view not in VIEWS:
        raise InputError("view of the map", value=view, allowed=", ".join(VIEWS))
    works, message = (False, "matplotlib was asked for") if renderer == "matplotlib" else gl_available()
    if renderer == "pyvista" and not works:
        raise InputError("renderer", value=renderer, allowed="matplotlib", remedy=message)
    style.require_folder(path)
    points = stiffness_map.positions * M_TO_MM
    values = stiffness_map.stiffness * N_PER_M_TO_N_PER_MM
    # Half a micrometre: rounding must not decide whether the section itself is shown.
    far = points[:, 1] >= -5e-4
    shown = far if cut and far.any() else np.ones(len(points), dtype=bool)
    norm, ticks = style.colour_scale(values, colour_range)
    colours = style.STIFFNESS_COLOURS(norm(values[shown]))[:, :3]
    scene = _Scene(VIEWS[view], points[shown], colours, tuple(bodies))
    count = f"{len(points):,} poses" + ("" if shown.all() else ", those at Y < 0 left out")
    figure, _ = style.new_figure("picture", rows=0)
    with style.house_style():
        corners = np.vstack([scene.points, *[body.mesh.bounds for body in bodies]])
        axes = style.frame_axes(figure, scene.camera, style.box_ticks(corners), flat=view == "side")
        heading = title or f"Stiffness map of {stiffness_map.metadata.get('robot', 'the robot')}"
        style.headings(figure, heading, f"{subtitle}; {count}" if subtitle else count)
        style.colour_bar(figure, norm, ticks, values)
        # Twice the pixels of the page: reducing them smooths the edges.
        size = 2 * style.DPI * figure.get_size_inches() * axes.get_position().size
        window = _Window((*axes.get_xlim(), *axes.get_ylim()), round(size[0]), round(size[1]))
        image = (_gl_image if works else _z_buffer_image)(scene, window)
        axes.imshow(image, extent=window.extent, aspect="auto", zorder=2, interpolation="antialiased")
    style.save_png(figure, path)
    return Picture(path, "pyvista" if works else "matplotlib", "" if works else message)


@dataclass(frozen=True)
class _Scene:
    """What stands in the frame, in mm: points (n, 3) with colours (n, 3), and the robot."""

    camera: style.Camera
    points: Array
    colours: Array
    bodies: tuple[DrawnBody, ...]

    @property
    def radius_mm(self) -> float:
        """Radius of a drawn point: the cloud looks dense, single points stay visible."""
        extent = np.ptp(self.camera(self.points)[:, :2], axis=0)
        return float(np.clip(0.8 * np.sqrt(extent.prod() / len(self.points)), 14.0, 28.0))


class _Window(NamedTuple):
    """The piece of the picture plane that is seen (u0, u1, v0, v1 in mm) and its size in pixels."""

    extent: tuple[float, float, float, float]
    width: int
    height: int

    @property
    def pixels_per_mm(self) -> float:
        """Scale, the same along both sides."""
        return self.height / (self.extent[3] - self.extent[2])

    def pixels(self, flat: Array) -> Array:
        """Picture plane (n, 3) in mm to column, row, nearness."""
        u0, _, _, v1 = self.extent
        across, down = flat[:, 0] - u0, v1 - flat[:, 1]
        return np.stack([across * self.pixels_per_mm - 0.5, down * self.pixels_per_mm - 0.5, flat[:, 2]], 1)


def _gl_image(scene: _Scene, window: _Window) -> Image:
    """Points as shaded balls and the robot on a transparent ground, RGBA, by pyvista."""
    u0, u1, v0, v1 = window.extent
    with _known_window():
        import pyvista as pv

        plotter = pv.Plotter(off_screen=True, window_size=[window.width, window.height], lighting="none")
        for where, strength in _LIGHTS:
            plotter.add_light(pv.Light(position=where, light_type="camera light", intensity=strength))
        for body in scene.bodies:
            look: dict[str, Any] = {"smooth_shading": True, "split_sharp_edges": True, "diffuse": _DIFFUSE}
            colour = ROBOT_COLOURS[body.role]
            plotter.add_mesh(pv.wrap(body.mesh), color=colour, ambient=_AMBIENT_BODY, **look)
        balls = pv.PolyData(scene.points)
        balls["colour"] = np.round(255.0 * scene.colours).astype(np.uint8)
        look = {"style": "points", "render_points_as_spheres": True, "ambient": _AMBIENT_BALL}
        size = 2.0 * scene.radius_mm * window.pixels_per_mm
        plotter.add_mesh(balls, scalars="colour", rgb=True, point_size=size, diffuse=_DIFFUSE, **look)
        right, up, towards = scene.camera.axes
        focus = 0.5 * (u0 + u1) * right + 0.5 * (v0 + v1) * up
        camera = plotter.camera
        camera.parallel_projection, camera.parallel_scale = True, 0.5 * (v1 - v0)
        camera.focal_point, camera.up = tuple(focus), tuple(up)
        camera.position = tuple(focus + 10.0 * (v1 - v0) * towards)
        plotter.reset_camera_clipping_range()
        image = plotter.screenshot(None, return_img=True, transparent_background=True)
        plotter.close()
    return np.asarray(image, dtype=np.uint8)


@contextmanager
def _known_window() -> Iterator[None]:
    """Ask VTK for the kind of window that the trial found, so that it does not complain about others."""
    before = os.environ.get(_WINDOW_VARIABLE)
    os.environ[_WINDOW_VARIABLE] = before or _probe_gl()[1]
    try:
        yield
    finally:
        del os.environ[_WINDOW_VARIABLE]
        if before is not None:
            os.environ[_WINDOW_VARIABLE] = before


def _z_buffer_image(scene: _Scene, window: _Window) -> Image:
    """Do the same without OpenGL: every pixel keeps the nearest of what is drawn over it."""
    depth = np.full((window.height, window.width), -np.inf)
    image = np.zeros((window.height, window.width, 4), dtype=np.uint8)
    for body in scene.bodies:
        mesh = body.mesh.smooth_shaded
        corners = window.pixels(scene.camera(np.asarray(mesh.vertices)))[mesh.faces]
        normals = scene.camera(np.asarray(mesh.vertex_normals))[mesh.faces]
        colour = np.array(to_rgb(ROBOT_COLOURS[body.role]))
        for triangle, normal in zip(corners, normals, strict=True):
            _fill(image, depth, triangle, normal, colour)
    _balls(image, depth, scene, window)
    return image


def _fill(image: Image, depth: Array, corners: Array, normals: Array, colour: Array) -> None:
    """Fill one triangle (3 corners, in pixels and nearness), shading between its corners' normals."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    low = np.maximum(np.floor(corners[:, :2].min(axis=0)).astype(int), 0)
    high = np.minimum(np.ceil(corners[:, :2].max(axis=0)).astype(int) + 1, depth.shape[::-1])
    # Rows count downward, so a face turned to the eye has a negative area.
    if area >= 0.0 or (low >= high).any():
        return
    x, y = np.arange(low[0], high[0]), np.arange(low[1], high[1])[:, None]
    b = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area
    c = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area
    z = az + b * (bz - az) + c * (cz - az)
    box = slice(low[1], high[1]), slice(low[0], high[0])
    seen = (b >= -1e-9) & (c >= -1e-9) & (b + c <= 1.0 + 1e-9) & (z > depth[box])
    depth[box][seen] = z[seen]
    edge_b, edge_c = normals[1] - normals[0], normals[2] - normals[0]
    normal = normals[0] + b[seen, None] * edge_b + c[seen, None] * edge_c
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    image[box][seen] = _shaded(colour, normal, _AMBIENT_BODY)


def _balls(image: Image, depth: Array, scene: _Scene, window: _Window) -> None:
    """Draw points as balls; of those on one spot only the nearest, which hides the others."""
    flat = window.pixels(scene.camera(scene.points))
    radius = scene.radius_mm * window.pixels_per_mm
    nearest = np.argsort(-flat[:, 2], kind="stable")
    _, first = np.unique(np.round(2.0 * flat[nearest, :2] / radius), axis=0, return_index=True)
    drawn = nearest[first]
    reach = np.arange(-np.ceil(radius), np.ceil(radius) + 1) / radius
    dx, dy = (g[np.hypot(reach, reach[:, None]) < 1.0] for g in np.meshgrid(reach, reach))
    normal = np.stack([dx, -dy, np.sqrt(1.0 - dx**2 - dy**2)], axis=1)
    column = np.round(flat[drawn, 0, None] + radius * dx).astype(int)
    row = np.round(flat[drawn, 1, None] + radius * dy).astype(int)
    z = flat[drawn, 2, None] + scene.radius_mm * normal[:, 2]
    inside = (column >= 0) & (column < window.width) & (row >= 0) & (row < window.height)
    point, pixel = np.nonzero(inside)
    row, column, z = row[inside], column[inside], z[inside]
    order = np.flatnonzero(z > depth[row, column])
    # Of repeated indices the last assignment stays, so the nearest comes last.
    order = order[np.argsort(z[order], kind="stable")]
    base = scene.colours[drawn[point[order]]]
    image[row[order], column[order]] = _shaded(base, normal[pixel[order]], _AMBIENT_BALL)


def _shaded(colour: Array, normal: Array, ambient: float) -> Image:
    """RGBA of surfaces with unit normals (n, 3) in the camera's axes."""
    light = sum(strength * np.clip(normal @ np.array(where), 0.0, 1.0) for where, strength in _LIGHTS)
    rgb = np.clip(colour * (ambient + _DIFFUSE * np.asarray(light))[:, None], 0.0, 1.0)
    return np.concatenate([255.0 * rgb + 0.5, np.full((len(rgb), 1), 255.0)], axis=1).astype(np.uint8)
