"""Pictures of a stiffness map with the robot in it, from two viewpoints, with or without OpenGL.

Frame, labels and colour bar are drawn by matplotlib in the plane of a parallel projection; only what
stands between them (points and robot) comes from pyvista or, without OpenGL, from a painter that sorts
all triangles and points by depth (mplot3d cannot sort points among triangles). Set
``STIFFARM_NO_GL=1`` to force the painter.
"""

from __future__ import annotations

import functools
import os
import subprocess
import sys
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from robots import InputError
from stiffarm.picture_style import DPI, FAINT, INK, STIFFNESS_COLOURS, house_style, new_figure, save_png
from stiffarm.robot_drawing import DrawnBody
from surrogate.vtk_files import M_TO_MM, N_PER_M_TO_N_PER_MM, StiffnessMap

Array = NDArray[np.float64]
Renderer = Literal["pyvista", "matplotlib"]

NO_GL_VARIABLE: Final = "STIFFARM_NO_GL"
# All near grey: colour in the picture means stiffness and nothing else.
ROBOT_COLOURS: Final = MappingProxyType(
    {
        "base": "#A3A9B0", "link": "#D3D6DA", "joint": "#6F757D", "parallelogram": "#93A5A8",
        "flange": "#3C4147", "tool": "#3C4147",
    }
)
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


@dataclass(frozen=True)
class _Camera:
    """Parallel projection; ``towards`` points from the scene to the eye, z stays upright."""

    towards: Array

    @property
    def axes(self) -> Array:
        """Rows: right, up, towards the eye."""
        towards = self.towards / np.linalg.norm(self.towards)
        right = np.cross([0.0, 0.0, 1.0], towards)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(towards, right), towards])

    def __call__(self, points: Array) -> Array:
        """Project (..., 3) to right, up and nearness."""
        return np.asarray(points @ self.axes.T)


VIEWS: Final = MappingProxyType(
    {"oblique": _Camera(np.array([0.55, -1.0, 0.42])), "side": _Camera(np.array([0.0, -1.0, 0.0]))}
)
"""``oblique``: from the front side; ``side``: along Y onto the XZ cross-section, X to the right."""


def gl_available() -> tuple[bool, str]:
    """Can pyvista draw without a screen here?

    Without an OpenGL library VTK dies with a segmentation fault, so a subprocess tries it, once in the
    life of this process. ``STIFFARM_NO_GL=1`` answers no without trying.

    Returns
    -------
    (yes, the render window's class) or (no, what is missing and how to get it)
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
        words = run.stdout.split()
        if run.returncode == 0 and len(words) == 2 and words[0] == "drawn":
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
        raise InputError("renderer", value=renderer, remedy=message)
    points = stiffness_map.positions * M_TO_MM
    values = stiffness_map.stiffness * N_PER_M_TO_N_PER_MM
    # Half a micrometre: rounding must not decide whether the section itself is shown.
    far = points[:, 1] >= -5e-4
    shown = far if cut and far.any() else np.ones(len(points), dtype=bool)
    ticks = _colour_ticks(values, colour_range)
    norm = Normalize(ticks[0], ticks[-1])
    scene = _Scene(VIEWS[view], points[shown], STIFFNESS_COLOURS(norm(values[shown]))[:, :3], tuple(bodies))
    count = f"{len(points):,} poses" + ("" if shown.all() else ", the half nearer the viewer (Y < 0) cut away")
    figure, _ = new_figure("picture", rows=0)
    with house_style():
        axes = _frame(figure, scene, view)
        _headings(figure, title or f"Stiffness map of {stiffness_map.metadata.get('robot', 'the robot')}",
                  "; ".join(part for part in (subtitle, count) if part))
        _colour_bar(figure, norm, ticks, values)
        (_draw_gl if works else _draw_painted)(axes, scene)
    save_png(figure, path)
    return Picture(path, "pyvista" if works else "matplotlib", "" if works else message)


@dataclass(frozen=True)
class _Scene:
    """What stands in the frame, in mm: points (n, 3) with colours (n, 3), and the robot."""

    camera: _Camera
    points: Array
    colours: Array
    bodies: tuple[DrawnBody, ...]

    @property
    def ticks(self) -> list[Array]:
        """Ticks along x, y, z with one step for all; the outer ones bound the scene."""
        everything = np.vstack([self.points, *[b.mesh.bounds for b in self.bodies]])
        low, high = everything.min(axis=0), everything.max(axis=0)
        nice = MaxNLocator(nbins=7, steps=[1, 2, 5, 10]).tick_values(0.0, float((high - low).max()))
        step = nice[1] - nice[0]
        first, last = np.floor(low / step), np.maximum(np.ceil(high / step), np.floor(low / step) + 1.0)
        return [np.arange(a, b + 0.5) * step for a, b in zip(first, last, strict=True)]

    @property
    def radius_mm(self) -> float:
        """Radius of a drawn point: the cloud looks dense, single points stay visible."""
        extent = np.ptp(self.camera(self.points)[:, :2], axis=0)
        return float(np.clip(0.55 * np.sqrt(extent.prod() / len(self.points)), 11.0, 26.0))


def _colour_ticks(values: Array, colour_range: tuple[float, float] | None) -> Array:
    if colour_range is not None:
        low, high = colour_range
        if not (np.isfinite([low, high]).all() and low < high):
            raise InputError("colour range (N/mm)", value=str(colour_range), allowed="two ascending numbers")
        inner = MaxNLocator(nbins=7, steps=[1, 2, 5, 10]).tick_values(low, high)
        gap = 0.6 * (inner[1] - inner[0])
        inner = inner[(inner > low + gap) & (inner < high - gap)]
        return np.array([low, *inner, high])
    low, high = np.percentile(values, [2.0, 98.0])
    if high - low < 1e-6 * high:
        low, high = 0.95 * low, 1.05 * high
    ticks = np.asarray(MaxNLocator(nbins=7, steps=[1, 2, 5, 10]).tick_values(low, high))
    return ticks[(ticks > low - np.diff(ticks)[0]) & (ticks < high + np.diff(ticks)[0])]


def _colour_bar(figure: Figure, norm: Normalize, ticks: Array, values: Array) -> None:
    below, above = bool((values < ticks[0]).any()), bool((values > ticks[-1]).any())
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max"}.get((below, above), "both")
    axes = figure.add_axes((0.872, 0.20, 0.022, 0.56))
    bar = figure.colorbar(ScalarMappable(norm, STIFFNESS_COLOURS), cax=axes, extend=extend, ticks=ticks)
    labels = [f"{t:.6g}" for t in ticks]
    labels[0] = f"≤ {labels[0]}" if below else labels[0]
    labels[-1] = f"≥ {labels[-1]}" if above else labels[-1]
    bar.ax.set_yticklabels(labels)
    bar.outline.set_linewidth(0.6)
    bar.set_label("structural stiffness (N/mm)", size=11, labelpad=10)
    for y, text, side in ((1.065, "stiff", "bottom"), (-0.065, "soft", "top")):
        axes.text(0.5, y, text, transform=axes.transAxes, ha="center", va=side, size=10, color="#555555")


def _headings(figure: Figure, title: str, subtitle: str) -> None:
    heading, lines = textwrap.fill(title, 85), textwrap.fill(subtitle, 125)
    figure.text(0.03, 0.975, heading, size=15, weight="bold", va="top")
    figure.text(0.03, 0.975 - 0.032 * (1 + heading.count("\n")), lines, size=10, color="#555555", va="top")


def _frame(figure: Figure, scene: _Scene, view: str) -> Axes:
    """Axes of the picture plane in mm, with ticks and names, wide enough for the whole scene."""
    ticks = scene.ticks
    flat = view == "side"
    axes = figure.add_axes((0.075, 0.075, 0.755, 0.80) if flat else (0.01, 0.015, 0.83, 0.87))
    corners = np.stack(np.meshgrid(*[t[[0, -1]] for t in ticks], indexing="ij"), axis=-1).reshape(-1, 3)
    outer = scene.camera(corners)[:, :2]
    low, high = outer.min(axis=0), outer.max(axis=0)
    pad = (high - low) * (np.array([0.02, 0.02]) if flat else np.array([0.055, 0.05]))
    size = figure.get_size_inches() * [axes.get_position().width, axes.get_position().height]
    half = 0.5 * (high - low) + pad
    half = np.maximum(half, half[::-1] * size / size[::-1])
    centre = 0.5 * (low + high)
    axes.set(xlim=(centre[0] - half[0], centre[0] + half[0]), ylim=(centre[1] - half[1], centre[1] + half[1]))
    if flat:
        axes.set(xlabel="X (mm)", ylabel="Z (mm)", autoscale_on=False)
        axes.locator_params(nbins=9, steps=[1, 2, 5, 10])
        axes.axhline(0.0, color=FAINT, linewidth=1.2, zorder=0.9)
    else:
        axes.set_axis_off()
        axes.set_autoscale_on(False)
        _draw_box(axes, scene.camera, ticks)
    return axes


def _draw_box(axes: Axes, camera: _Camera, ticks: list[Array]) -> None:
    """Floor and the two far walls as grids, ticks at the near edges, for an eye at +x, -y, +z."""
    (x0, x1), (y0, y1), (z0, z1) = (t[[0, -1]] for t in ticks)
    lines = [[(x, y0, z0), (x, y1, z0), (x, y1, z1)] for x in ticks[0]]
    lines += [[(x1, y, z0), (x0, y, z0), (x0, y, z1)] for y in ticks[1]]
    lines += [[(x0, y0, z), (x0, y1, z), (x1, y1, z)] for z in ticks[2]]
    flat = [camera(np.array(line))[:, :2] for line in lines]
    axes.add_collection(LineCollection(flat, colors="#DDE0E4", linewidths=0.7, zorder=0.5), autolim=False)
    edges = [[(x0, y0, z1), (x0, y0, z0), (x1, y0, z0), (x1, y1, z0)]]
    flat = [camera(np.array(edge))[:, :2] for edge in edges]
    axes.add_collection(LineCollection(flat, colors="#8A9097", linewidths=0.9, zorder=0.6), autolim=False)
    d = 0.022 * max(x1 - x0, z1 - z0)
    rows = (
        ("X (mm)", ticks[0], np.array([[x, y0, z0] for x in ticks[0]]), np.array([0.0, -1.0, 0.0]), "x"),
        ("Y (mm)", ticks[1], np.array([[x1, y, z0] for y in ticks[1]]), np.array([1.0, 0.0, 0.0]), "y"),
        ("Z (mm)", ticks[2], np.array([[x0, y0, z] for z in ticks[2]]), np.array([0.0, -1.0, 0.0]), "z"),
    )
    for name, numbers, places, out, _ in rows:
        flat_out = camera(out)[:2] / np.linalg.norm(camera(out)[:2])
        spots = camera(places)[:, :2]
        for number, spot in zip(numbers, spots + 1.6 * d * flat_out, strict=True):
            axes.text(*spot, f"{number:g}", ha="center", va="center", size=9, color="#444444")
        along = spots[-1] - spots[0]
        turn = (np.degrees(np.arctan2(along[1], along[0])) + 90.0) % 180.0 - 90.0
        spot = spots[[0, -1]].mean(axis=0) + 4.4 * d * flat_out
        axes.text(*spot, name, ha="center", va="center", size=10, color=INK, rotation=abs(turn) if name[0] == "Z" else turn)


def _draw_gl(axes: Axes, scene: _Scene) -> None:
    """Points as shaded balls and the robot, by pyvista on a transparent ground."""
    (u0, u1), (v0, v1) = axes.get_xlim(), axes.get_ylim()
    height = int(2 * axes.get_position().height * axes.figure.get_size_inches()[1] * DPI)
    width = round(height * (u1 - u0) / (v1 - v0))
    with _known_window():
        import pyvista as pv

        plotter = pv.Plotter(off_screen=True, window_size=(width, height), lighting="none")
        plotter.add_light(pv.Light(light_type="headlight", intensity=0.45))
        plotter.add_light(pv.Light(position=(-0.6, 0.9, 0.8), light_type="camera light", intensity=0.6))
        for body in scene.bodies:
            mesh = pv.wrap(body.mesh)
            plotter.add_mesh(
                mesh, color=ROBOT_COLOURS[body.role], smooth_shading=True, split_sharp_edges=True,
                ambient=0.25, diffuse=0.8, specular=0.1,
            )
            edges = mesh.extract_feature_edges(40.0)
            if edges.n_cells:
                plotter.add_mesh(edges, color="#50555B", line_width=2.0, lighting=False)
        balls = pv.PolyData(scene.points)
        balls["colour"] = np.round(255.0 * scene.colours).astype(np.uint8)
        plotter.add_mesh(
            balls, scalars="colour", rgb=True, style="points", render_points_as_spheres=True,
            point_size=2.0 * scene.radius_mm * height / (v1 - v0), ambient=0.5, diffuse=0.6,
        )
        right, up, towards = scene.camera.axes
        focus = 0.5 * (u0 + u1) * right + 0.5 * (v0 + v1) * up
        plotter.camera.parallel_projection = True
        plotter.camera.focal_point, plotter.camera.up = tuple(focus), tuple(up)
        plotter.camera.position = tuple(focus + 10.0 * (v1 - v0) * towards)
        plotter.camera.parallel_scale = 0.5 * (v1 - v0)
        plotter.reset_camera_clipping_range()
        image = plotter.screenshot(None, return_img=True, transparent_background=True)
        plotter.close()
    axes.imshow(image, extent=(u0, u1, v0, v1), aspect="auto", zorder=2, interpolation="antialiased")
    axes.set(xlim=(u0, u1), ylim=(v0, v1))


@contextmanager
def _known_window() -> Iterator[None]:
    """Ask VTK for the kind of window that the trial found, so that it does not complain about the others."""
    if _WINDOW_VARIABLE in os.environ:
        yield
        return
    os.environ[_WINDOW_VARIABLE] = _probe_gl()[1]
    try:
        yield
    finally:
        del os.environ[_WINDOW_VARIABLE]


def _draw_painted(axes: Axes, scene: _Scene) -> None:
    """Everything as flat polygons, the farthest first."""
    parts = [_painted_points(scene), *[_painted_body(scene.camera, body, scene) for body in scene.bodies]]
    depth = np.concatenate([part[0] for part in parts])
    order = np.argsort(depth, kind="stable")
    polygons = [polygon for part in parts for polygon in part[1]]
    faces = np.concatenate([part[2] for part in parts])[order]
    edges = np.concatenate([part[3] for part in parts])[order]
    widths = np.concatenate([part[4] for part in parts])[order]
    axes.add_collection(
        PolyCollection([polygons[i] for i in order], facecolors=faces, edgecolors=edges, linewidths=widths, zorder=2),
        autolim=False,
    )
