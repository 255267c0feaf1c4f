"""Images of a scene in parallel projection: the robot, painted surfaces and coloured points, with or without OpenGL.

pyvista draws them, or a z-buffer in numpy (mplot3d cannot sort points among triangles); same camera, same lights.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from robots.arrays import Array, Integers
from stiffarm.pages import style
from stiffarm.pages.robot_drawing import ROBOT_COLOURS, DrawnBody

Image = NDArray[np.uint8]

# Direction to each light (right, up, towards the eye) and its strength.
_LIGHTS: Final = (((0.0, 0.0, 1.0), 0.5), ((-0.45, 0.67, 0.59), 0.55))
_AMBIENT_BODY, _AMBIENT_BALL, _DIFFUSE = 0.36, 0.5, 0.75
# Faces that meet at a sharper angle keep their edge; pyvista's own default.
_SHARP_DEG: Final = 30.0


class Surface(NamedTuple):
    """A painted surface, seen from both sides: vertices (k, 3) mm, triangles (m, 3), RGB of each (m, 3), 0 to 1."""

    vertices: Array
    triangles: Integers
    colours: Array


@dataclass(frozen=True)
class Scene:
    """What stands in the frame, in mm: points (n, 3) with colours (n, 3), the robot, painted surfaces."""

    camera: style.Camera
    points: Array
    colours: Array
    bodies: tuple[DrawnBody, ...]
    surfaces: tuple[Surface, ...] = ()

    @property
    def radius_mm(self) -> float:
        """Radius of a drawn point: the cloud looks dense, single points stay visible."""
        extent = np.ptp(self.camera(self.points)[:, :2], axis=0)
        return float(np.clip(0.8 * np.sqrt(extent.prod() / len(self.points)), 14.0, 28.0))


class Window(NamedTuple):
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


def gl_image(scene: Scene, window: Window) -> Image:
    """Points as shaded balls, surfaces and the robot on a transparent ground, RGBA, by pyvista."""
    import pyvista as pv

    u0, u1, v0, v1 = window.extent
    plotter = pv.Plotter(off_screen=True, window_size=[window.width, window.height], lighting="none")
    for where, strength in _LIGHTS:
        plotter.add_light(pv.Light(position=where, light_type="camera light", intensity=strength))
    look: dict[str, Any] = {"smooth_shading": True, "split_sharp_edges": True, "diffuse": _DIFFUSE}
    for body in scene.bodies:
        plotter.add_mesh(pv.wrap(body.mesh), color=ROBOT_COLOURS[body.role], ambient=_AMBIENT_BODY, **look)
    for surface in scene.surfaces:
        faces: Any = surface.triangles
        mesh = pv.PolyData.from_regular_faces(surface.vertices, faces)
        mesh.cell_data["colour"] = _bytes(surface.colours)
        look |= {"feature_angle": _SHARP_DEG, "ambient": _AMBIENT_BALL}
        plotter.add_mesh(mesh, scalars="colour", rgb=True, **look)
    if len(scene.points):
        balls = pv.PolyData(scene.points)
        balls["colour"] = _bytes(scene.colours)
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


def _bytes(colours: Array) -> Image:
    return np.round(255.0 * colours).astype(np.uint8)


def z_buffer_image(scene: Scene, window: Window) -> Image:
    """Do the same without OpenGL: every pixel keeps the nearest of what is drawn over it."""
    depth = np.full((window.height, window.width), -np.inf)
    image = np.zeros((window.height, window.width, 4), dtype=np.uint8)
    for body in scene.bodies:
        mesh = body.mesh.smooth_shaded
        corners = window.pixels(scene.camera(np.asarray(mesh.vertices)))[mesh.faces]
        normals = scene.camera(np.asarray(mesh.vertex_normals))[mesh.faces]
        colour = np.array(to_rgb(ROBOT_COLOURS[body.role]))
        for triangle, normal in zip(corners, normals, strict=True):
            _fill(image, depth, triangle, normal, colour, _AMBIENT_BODY)
    for surface in scene.surfaces:
        _surface(image, depth, surface, scene, window)
    if len(scene.points):
        _balls(image, depth, scene, window)
    return image


def _surface(image: Image, depth: Array, surface: Surface, scene: Scene, window: Window) -> None:
    """Fill a surface's triangles, each turned to the eye."""
    corners = window.pixels(scene.camera(surface.vertices))[surface.triangles]
    normals = scene.camera(corner_normals(surface.vertices, surface.triangles))
    ahead, back = corners[:, 1, :2] - corners[:, 0, :2], corners[:, 2, :2] - corners[:, 0, :2]
    # Rows count downward.
    away = ahead[:, 0] * back[:, 1] - back[:, 0] * ahead[:, 1] > 0.0
    corners[away], normals[away] = corners[away, ::-1], -normals[away, ::-1]
    for triangle, normal, colour in zip(corners, normals, surface.colours, strict=True):
        _fill(image, depth, triangle, normal, colour, _AMBIENT_BALL)


def corner_normals(vertices: Array, triangles: Integers) -> Array:
    """Unit normals (m, 3, 3) at the triangles' corners: the mean over neighbours that are not across a sharp edge.

    All triangles must be wound the same way round, as those of a swept or closed surface are.
    """
    corners = vertices[triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = area / np.linalg.norm(area, axis=1, keepdims=True)
    # Every corner with every triangle at its vertex: triangles sorted by vertex, then counted off.
    order = np.argsort(triangles, axis=None, kind="stable")
    count = np.bincount(triangles.ravel(), minlength=len(vertices))
    first = np.concatenate([[0], np.cumsum(count)])[triangles.ravel()]
    pairs = count[triangles.ravel()]
    corner = np.repeat(np.arange(triangles.size), pairs)
    step = np.arange(len(corner)) - np.repeat(np.cumsum(pairs) - pairs, pairs)
    other = order[np.repeat(first, pairs) + step] // 3
    smooth = np.einsum("pi,pi->p", unit[corner // 3], unit[other]) > np.cos(np.radians(_SHARP_DEG))
    total = np.zeros((triangles.size, 3))
    np.add.at(total, corner[smooth], area[other[smooth]])
    return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True)).reshape(-1, 3, 3)


def _fill(image: Image, depth: Array, corners: Array, normals: Array, colour: Array, ambient: float) -> None:
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
    image[box][seen] = _shaded(colour, normal, ambient)


def _balls(image: Image, depth: Array, scene: Scene, window: Window) -> None:
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
