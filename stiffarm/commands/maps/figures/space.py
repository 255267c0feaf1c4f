"""A map in space: iso-surfaces of a box or a cylinder, or the points of a joint sweep, with the robot in its pose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from robots import ModelDescription, Robot, require_one_of
from robots.arrays import Array, Bools, Indices, Integers
from robots.constants import M_TO_MM
from stiffarm.commands.maps.looks import Look, category_patches, look_bar
from stiffarm.pages import style
from stiffarm.pages.rendering import VIEWS, show
from stiffarm.pages.robot_drawing import DrawnBody, draw_robot
from stiffarm.pages.scenes import Scene, Surface
from surrogate.maps.data import MapData

# Points of a grid that surfaces are made from, and triangles that are drawn: a page shows no more.
MOST_POINTS: Final = 1_000_000
MOST_TRIANGLES: Final = 60_000
MOST_DRAWN: Final = 150_000
# A cell's range over the scale that is a jump, if it also is this many times the median range.
_JUMP: Final = 0.15
_STANDS_OUT: Final = 3.0
# Shares of the points with smaller values, where surfaces are put.
_SHARES: Final = (0.25, 0.6, 0.9)
# The cut goes through the base's axis unless that leaves less than this share of the map on one side.
_LEAST_SIDE: Final = 0.1


def iso_levels(look: Look, values: Array, count: int = 3) -> Array:
    """Two or three values (k,) for surfaces, ascending: about evenly through the points, rounded to two digits."""
    known = values[np.isfinite(values)]
    shares = _SHARES if count == 3 else (0.35, 0.8)
    levels = np.unique([float(f"{v:.2g}") for v in np.quantile(known, shares)])
    return np.asarray(levels[(levels > known.min()) & (levels < known.max())])


def iso_surfaces(data: MapData, look: Look, levels: Array, cut_mm: float | None) -> list[tuple[Array, Any]]:
    """Surface of each level: vertices (k, 3) mm and triangles (m, 3), where cells are whole and smooth.

    Parameters
    ----------
    look : of the quantity; jumps are judged on its scale
    cut_mm : leave out what lies at y below this

    Raises
    ------
    InputError
        The map is no box or cylinder.
    """
    import pyvista as pv

    require_one_of("iso-surfaces of a map", data.layout.kind, ("box", "cylinder"), code="B002")
    points, values, shape = _thinned(data, look.name)

    def scaled(raw: Array) -> Array:
        return np.asarray(np.clip(np.ma.filled(look.norm(np.ma.masked_invalid(raw)), np.nan), 0.0, 1.0))

    grid = pv.StructuredGrid()
    grid.points = M_TO_MM * points
    # VTK counts the fastest axis first.
    grid.dimensions = shape[::-1]
    grid.point_data["value"] = np.nan_to_num(values)
    # pyvista's hints know no arrays of numpy's own bool.
    cells: Any = _smooth_cells(scaled(values).reshape(shape)).ravel()
    whole = grid.extract_cells(cells)
    out: list[tuple[Array, Any]] = []
    for level in levels:
        surface = whole.contour([float(level)], scalars="value") if whole.n_cells else pv.PolyData()
        if cut_mm is not None and surface.n_cells:
            surface = surface.clip("-y", origin=(0.0, cut_mm, 0.0))
        if surface.n_cells:
            surface = surface.triangulate()
            if surface.n_cells > MOST_TRIANGLES:
                surface = surface.decimate(1.0 - MOST_TRIANGLES / surface.n_cells)
        triangles = np.asarray(surface.regular_faces if surface.n_cells else np.zeros((0, 3)), dtype=np.int64)
        out.append(_without_slivers(np.asarray(surface.points, dtype=np.float64).reshape(-1, 3), triangles))
    return out


def _smooth_cells(scaled: Array) -> Bools:
    """Which cells of a grid (a, b, c) of values from 0 to 1 have eight finite corners and no jump between them.

    Where another posture takes over, stiffness jumps; a surface there would be a wall that is not in the quantity.
    """
    corners = np.stack(
        [
            scaled[tuple(slice(c, n - 1 + c) for c, n in zip(corner, scaled.shape, strict=True))]
            for corner in np.ndindex(2, 2, 2)
        ]
    )
    span: Array = np.ptp(corners, axis=0)
    known = np.isfinite(span)
    if not known.any():
        return np.asarray(known)
    return np.asarray(known & ~(span > max(_JUMP, _STANDS_OUT * float(np.median(span[known])))))


def _without_slivers(points: Array, triangles: Integers) -> tuple[Array, Integers]:
    """Triangles with an area: contours through a grid's point leave some that have none, and no normal."""
    if not len(triangles):
        return points, triangles
    a, b, c = (points[triangles[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return points, triangles[area > 1e-9 * max(float(area.max()), 1e-30)]


def _thinned(data: MapData, name: str) -> tuple[Array, Array, tuple[int, ...]]:
    """Points (n, 3) m, values (n,) and shape; of a large grid every k-th along each axis; full turns are closed."""
    shape = data.layout.shape
    step = max(1, int(np.ceil((data.layout.n / MOST_POINTS) ** (1 / 3))))
    # A short axis keeps both its ends.
    kept = [np.unique(np.append(np.arange(0, n, step), n - 1)) for n in shape]
    if data.layout.kind == "cylinder" and data.layout.axes[1].full_turn:
        kept[1] = np.append(kept[1], 0)
    rows = np.arange(data.layout.n).reshape(shape)[np.ix_(*kept)]
    values = np.where(np.asarray(data.reached)[rows], np.asarray(data.fields[name].values)[rows], np.nan)
    return np.asarray(data.points)[rows.ravel()], values.ravel(), rows.shape


def cut_plane(points: Array) -> float:
    """Y in mm of the plane that the viewer's side is cut off at: the base's axis, or the middle of the map."""
    y = M_TO_MM * points[:, 1]
    low, high = float(y.min()), float(y.max())
    if high - low < 1e-6 or min(-low, high) >= _LEAST_SIDE * (high - low):
        return 0.0 if low <= 0.0 <= high else low
    return 0.5 * (low + high)


def iso_figure(
    data: MapData, look: Look, description: ModelDescription, robot: Robot, heading: str, facts: str, works: bool
) -> Figure:
    """Draw iso-surfaces of a box or a cylinder, cut open towards the viewer, with the robot at a stiff point.

    Raises
    ------
    InputError
        Nothing is reached, or the map is no box or cylinder.
    """
    data.require_reached("move the grid to where the robot reaches")
    reached = np.flatnonzero(np.asarray(data.reached))
    # Ten million points would say the same about the frame, the levels and the best place for the robot.
    reached = reached[:: max(1, len(reached) // MOST_POINTS)]
    points = np.asarray(data.points)[reached]
    cut = cut_plane(points)
    values = np.asarray(data.fields[look.name].values)[reached]
    levels = iso_levels(look, values)
    found = iso_surfaces(data, look, levels, cut)
    surfaces = tuple(
        Surface(vertices, triangles, np.tile(look.rgb(np.array([level])), (len(triangles), 1)))
        for (vertices, triangles), level in zip(found, levels, strict=True)
        if len(triangles)
    )
    bodies = robot_at_best(data, look, reached, M_TO_MM * points[:, 1] - cut, description, robot)
    nothing = np.zeros((0, 3))
    scene = Scene(VIEWS["oblique"], nothing, nothing, tuple(bodies), surfaces)
    # What is left of the map after the cut, so that pictures of several quantities have one frame.
    kept = points[M_TO_MM * points[:, 1] >= cut - 1e-6] * M_TO_MM
    words = ", ".join(f"{level:g}" for level in levels)
    lines = f"surfaces at {words} {look.unit}".rstrip() + f"; cut open at y = {cut:.4g} mm"
    return _space(
        scene, np.vstack([kept.min(axis=0), kept.max(axis=0)]), look, levels, heading, _joined(facts, lines), works
    )


def cloud_figure(
    data: MapData,
    look: Look,
    description: ModelDescription,
    robot: Robot,
    heading: str,
    facts: str,
    works: bool,
    view: str = "oblique",
) -> Figure:
    """Draw the reached points of any map as balls in their colours; those in front of the base's axis are left out.

    Raises
    ------
    InputError
        Nothing is reached, or an unknown view.
    """
    require_one_of("view of the map", view, VIEWS, code="B002")
    values = np.asarray(data.fields[look.name].values)
    known = np.asarray(data.reached) & np.isfinite(values) & (values >= 0.0 if look.kind == "category" else True)
    data.require_reached("move the grid to where the robot reaches")
    rows = np.flatnonzero(known)
    poses = len(rows)
    rows = rows[:: max(1, poses // MOST_POINTS)]
    points = np.asarray(data.points)[rows] * M_TO_MM
    far = points[:, 1] >= cut_plane(np.asarray(data.points)[rows]) - 5e-4
    drawn = rows[far][:: max(1, int(far.sum()) // MOST_DRAWN)]
    bodies = robot_at_best(data, look, rows, points[:, 1], description, robot)
    scene = Scene(VIEWS[view], np.asarray(data.points)[drawn] * M_TO_MM, look.rgb(values[drawn]), tuple(bodies))
    count = f"{poses:,} poses" + ("" if far.all() else ", the nearer side left out")
    corners = np.vstack([scene.points.min(axis=0), scene.points.max(axis=0)])
    return _space(scene, corners, look, (), heading, _joined(facts, count), works, flat=view == "side")


def _joined(*parts: str) -> str:
    return "; ".join(part for part in parts if part)


def robot_at_best(
    data: MapData, look: Look, rows: Indices, depth_mm: Array, description: ModelDescription, robot: Robot
) -> list[DrawnBody]:
    """The robot at the stiffest point near the cut (depth 0), where it stands free; of other quantities the largest."""
    q = np.asarray(data.q)[rows]
    posed = np.isfinite(q).all(axis=1)
    if not posed.any():
        return []
    depth = np.where(posed, np.abs(depth_mm), np.inf)
    near = depth <= depth.min() + 0.02 * max(float(np.ptp(depth_mm)), 1.0)
    regular = data.regular(rows)
    near &= regular if (near & posed & regular).any() else True
    values = np.asarray(data.fields[look.name].values, dtype=np.float64)[rows]
    order = {"soft": -values, "category": -depth}.get(look.kind, values)
    best = int(np.nanargmax(np.where(near & np.isfinite(order), order, -np.inf)))
    return draw_robot(description, robot, q[best])


def _space(
    scene: Scene,
    corners: Array,
    look: Look,
    levels: Sequence[float] | Array,
    heading: str,
    facts: str,
    works: bool,
    *,
    flat: bool = False,
) -> Figure:
    figure, _ = style.new_figure("picture", rows=0)
    with style.house_style():
        every = np.vstack([corners, *[body.mesh.bounds for body in scene.bodies]])
        axes = style.frame_axes(figure, scene.camera, style.box_ticks(every), flat=flat)
        style.headings(figure, heading, facts)
        if look.kind == "category":
            handles = [
                Line2D(
                    [],
                    [],
                    marker="o",
                    linestyle="none",
                    markersize=9,
                    color=to_rgb(p.get_facecolor()),
                    label=p.get_label(),
                )
                for p in category_patches(look)
            ]
            figure.legend(handles=handles, loc="center left", bbox_to_anchor=(0.84, 0.5), fontsize=10)
        else:
            look_bar(figure, look, cax=style.beside_picture(figure), levels=levels)
        show(figure, axes, scene, works)
    return figure
