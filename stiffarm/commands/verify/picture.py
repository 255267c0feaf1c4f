"""The picture of an offence: robot and cell in that pose, the bodies it is about in colour, whole and from near."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from machining.verification import Offence, Verification
from robots.arrays import Array, Bools, Integers
from robots.constants import M_TO_MM
from stiffarm.commands.verify.bodies import BodySurface, body_surfaces, placed_in_world
from stiffarm.pages import style
from stiffarm.pages.rendering import Picture, Renderer, chosen, show
from stiffarm.pages.scenes import Scene, Surface

# Near grey, so that colour means offence; cutter and part are what a reader looks for.
COLOURS = {
    "arm": "#D3D6DA",
    "holder": "#7C858E",
    "cutter": "#3C4147",
    "carriage": "#A3A9B0",
    "fixture": "#B9B2A6",
    "part": "#A9C3D6",
}
FIRST, SECOND = style.OKABE_ITO["vermillion"], style.OKABE_ITO["purple"]
# Half the width of the near view, m; what is smaller than this around the touch is seen.
NEAR = 0.22
# Lines of sight that a view is judged by, a body.
RAYS = 24
FLOOR_COLOUR = "#E8EAED"


def offence_picture(found: Verification, offence: Offence, path: Path, *, renderer: Renderer | None = None) -> Picture:
    """Draw an offence; PNG, the whole cell on the left, the place of the offence on the right.

    Raises
    ------
    InputError
        pyvista was asked for and cannot draw here, or the folder does not exist.
    """
    works, message = chosen(renderer)
    style.require_folder(path)
    surfaces = body_surfaces(found.scene)
    q, travel, table = found.axes.parts(offence.values[None])
    placed = placed_in_world(found.scene, surfaces, q[0], travel[0], float(table[0]))
    touching = [
        _dense(x, b.triangles) for b, x in zip(surfaces, placed, strict=True) if b.name in (offence.bodies or ())
    ]
    place = place_of(found, offence, touching)
    base = found.program.cell.T_world_base(travel)[0, :3, 3]
    everything = np.concatenate([x[b.triangles] for b, x in zip(surfaces, placed, strict=True)])
    camera = style.Camera(_towards(base, place, [_near_points(place, x) for x in touching], everything))
    painted = tuple(
        Surface(M_TO_MM * x, body.triangles, np.tile(to_rgb(_colour(offence, body)), (len(body.triangles), 1)))
        for body, x in zip(surfaces, placed, strict=True)
    )
    floor = _floor(found, placed)
    nothing = np.zeros((0, 3))
    whole = Scene(camera, nothing, nothing, (), (*painted, *floor))
    figure, _ = style.new_figure("wide", rows=0)
    with style.house_style():
        left = figure.add_axes((0.01, 0.02, 0.48, 0.90))
        right = figure.add_axes((0.51, 0.02, 0.48, 0.90))
        corners = np.vstack([M_TO_MM * np.vstack(placed), *(surface.vertices for surface in floor)])
        _frame(figure, right, camera(M_TO_MM * place)[:2] + M_TO_MM * NEAR * np.array([[-1.0, -1.0], [1.0, 1.0]]))
        near = np.stack([right.get_xlim(), right.get_ylim()], axis=1)
        _frame(figure, left, np.vstack([camera(corners)[:, :2], near]))
        for axes in (left, right):
            show(figure, axes, whole, works)
        _box_of_near(left, right)
        _names(figure, offence)
    style.save_png(figure, path)
    return Picture(path, "pyvista" if works else "matplotlib", "" if works else message)


def place_of(found: Verification, offence: Offence, pair: list[Array]) -> Array:
    """The place (3,) m of an offence: between its bodies (points of each) where they are nearest, else the tip."""
    if len(pair) == 1:
        # The other is the floor: the lowest point.
        return np.asarray(pair[0][np.argmin(pair[0][:, 2])])
    if len(pair) == 2:
        distance, other = cKDTree(pair[1]).query(pair[0])
        nearest = int(np.argmin(distance))
        return np.asarray(0.5 * (pair[0][nearest] + pair[1][np.asarray(other)[nearest]]))
    cell = found.program.cell
    tip, (_, _, table) = found.courses.frames(offence.values[None]), found.axes.parts(offence.values[None])
    return np.asarray((cell.T_world_part(table)[0] @ tip[0])[:3, 3])


def _dense(vertices: Array, triangles: Integers) -> Array:
    """Points (k, 3) all over triangles: corners, and a grid within each."""
    share = np.array([[i, j, 8 - i - j] for i in range(9) for j in range(9 - i)]) / 8.0
    return np.asarray((share @ vertices[triangles]).reshape(-1, 3))


def _towards(base: Array, place: Array, bodies: list[Array], everything: Array) -> Array:
    """From a place to the eye, from above: aside of the arm unless the bodies hide each other there.

    Parameters
    ----------
    bodies : points (k, 3) m of the bodies near the place, one array each
    everything : (t, 3, 3) m, corners of all triangles in the scene
    """
    ahead = place[:2] - base[:2]
    length = float(np.linalg.norm(ahead))
    along = float(np.arctan2(ahead[1], ahead[0])) if length > 1e-6 else 0.0
    best, chosen_way = -1.0, np.array([0.0, -1.0, 0.5])
    # Aside first: of views that show as much the first is taken.
    for turn in np.radians([-57.0, 57.0, -90.0, 90.0, -25.0, 25.0, -120.0, 120.0]):
        way = np.array([np.cos(along + turn), np.sin(along + turn), 0.5])
        seen = min((float(_seen(points, way, everything).mean()) for points in bodies), default=1.0)
        if seen > best + 0.1:
            best, chosen_way = seen, way
    return chosen_way


def _near_points(place: Array, points: Array) -> Array:
    """At most ``RAYS`` points of a body near the place, evenly chosen."""
    near = points[np.linalg.norm(points - place, axis=1) < 0.3 * NEAR]
    near = near if len(near) else points
    return np.asarray(near[np.linspace(0, len(near) - 1, min(len(near), RAYS)).astype(int)])


def _seen(points: Array, way: Array, triangles: Array) -> Bools:
    """Whether nothing stands between points (k, 3) and an eye far off along ``way`` (T. Moeller, B. Trumbore 1997)."""
    way = way / np.linalg.norm(way)
    # A step off the surface that a point is on.
    start = points + 1e-3 * way
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(way, v)
    volume = np.einsum("ti,ti->t", u, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        r = start[:, None] - a
        first = np.einsum("kti,ti->kt", r, p) / volume
        q = np.cross(r, u)
        second = q @ way / volume
        distance = np.einsum("kti,ti->kt", q, v) / volume
    hit = (first >= 0.0) & (second >= 0.0) & (first + second <= 1.0) & (distance > 0.0)
    return np.asarray(~hit.any(axis=1))


def _colour(offence: Offence, body: BodySurface) -> str:
    if offence.bodies and body.name in offence.bodies:
        return FIRST if body.name == offence.bodies[0] else SECOND
    return COLOURS[body.kind]


def _floor(found: Verification, placed: list[Array]) -> list[Surface]:
    """The floor as two triangles below everything, if there is one."""
    z = found.program.cell.floor
    if z is None:
        return []
    every = np.vstack(placed)[:, :2]
    (x0, y0), (x1, y1) = every.min(axis=0) - 0.2, every.max(axis=0) + 0.2
    corners = M_TO_MM * np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]])
    return [Surface(corners, np.array([[0, 1, 2], [0, 2, 3]]), np.tile(to_rgb(FLOOR_COLOUR), (2, 1)))]


def _frame(figure: Figure, axes: Axes, flat: Array) -> None:
    """Let axes show at least the points (k, 2) of the picture plane, without distortion."""
    low, high = flat.min(axis=0), flat.max(axis=0)
    size = figure.get_size_inches() * axes.get_position().size
    half = 0.53 * (high - low)
    half = np.maximum(half, half[::-1] * size / size[::-1])
    (u0, v0), (u1, v1) = 0.5 * (low + high) - half, 0.5 * (low + high) + half
    axes.set(xlim=(u0, u1), ylim=(v0, v1), autoscale_on=False, xticks=[], yticks=[])
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.grid(visible=False)


def _box_of_near(left: Axes, right: Axes) -> None:
    """Mark in the whole picture what the near one shows."""
    (u0, u1), (v0, v1) = right.get_xlim(), right.get_ylim()
    left.plot([u0, u1, u1, u0, u0], [v0, v0, v1, v1, v0], color=style.INK, linewidth=0.9, zorder=5)
    for spine in right.spines.values():
        spine.set(visible=True, color=style.INK, linewidth=0.9)


def _names(figure: Figure, offence: Offence) -> None:
    """Say which colour is which body."""
    x = 0.015
    named = zip(offence.bodies or (), (FIRST, SECOND), strict=False)
    for name, colour in named:
        figure.text(x, 0.95, "■", color=colour, size=13, va="center")
        label = figure.text(x + 0.018, 0.95, name, size=10.5, va="center")
        extent = label.get_window_extent(figure.canvas.get_renderer())  # type: ignore[attr-defined]
        x += 0.018 + extent.width / (figure.get_size_inches()[0] * figure.dpi) + 0.025
    figure.text(0.985, 0.95, f"line {offence.line}: {offence.kind}", size=10.5, va="center", ha="right")
