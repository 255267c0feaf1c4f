"""The picture of an offence: robot and cell in its worst pose, its bodies in colour, whole and from near."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from machining.cell.assumed_shapes import ASSUMED
from machining.cell.scene import ARM, CARRIAGE, CUTTER, HOLDER
from machining.verification import Contact, Kind, Offence, Verification, contact_of
from machining.verification.contacts import POSES
from robots import forward_kinematics
from robots.arrays import Array
from robots.constants import M_TO_MM
from stiffarm.commands.verify.words import DISTANCE, value_words
from stiffarm.pages import style
from stiffarm.pages.cell_bodies import BodySurface, body_surfaces, placed_in_world
from stiffarm.pages.rendering import Renderer, chosen, show
from stiffarm.pages.scenes import Scene, Surface
from stiffarm.pages.sight import dense, in_the_way, near_points, towards
from stiffarm.session.console import say

OVERLAPS = (Kind.COLLISION, Kind.RAPID_CONTACT)


@dataclass(frozen=True)
class Spot:
    """An offence at its worst.

    Attributes
    ----------
    offence, contact : what, and where its two bodies are nearest; None where it is not about two bodies
    values, move, line : pose (a,) that is shown, its move and line
    place : (3,) m in the world: between the bodies, at the joint beyond its limit, else at the tip
    bodies : names of the bodies that it is about: the two, what the joint moves, or the cutter
    """

    offence: Offence
    contact: Contact | None
    values: Array
    move: int
    line: int
    place: Array
    bodies: tuple[str, ...]

    @property
    def distance_words(self) -> str:
        """How far apart the bodies are, or how far they reach into each other; empty without two bodies."""
        if self.contact is None:
            return ""
        gap = self.contact.gap
        if gap < 0.0:
            return f"{DISTANCE.text(-gap, unit=True)} into each other"
        # One body within the other's surface: no distance is worked out there.
        return "overlap" if self.offence.kind in OVERLAPS else f"{DISTANCE.text(gap, unit=True)} apart"


def spot_of(found: Verification, offence: Offence, poses: int = POSES) -> Spot:
    """Where an offence is worst, of so many poses, and what it is about there."""
    contact = contact_of(found, offence, poses)
    if contact is not None and offence.bodies is not None:
        place = contact.points.mean(axis=0)
        return Spot(offence, contact, contact.values, contact.move, contact.line, place, offence.bodies)
    values, line = offence.worst_values, int(found.program.motions.line[offence.worst])
    names = found.axes.names
    axis = names.index(offence.axis) if offence.axis in names else -1
    place, bodies = _of_axis(found, offence, axis) if axis >= 0 else _of_tool(found, offence)
    return Spot(offence, None, values, offence.worst, line, place, bodies)


def _of_axis(found: Verification, offence: Offence, axis: int) -> tuple[Array, tuple[str, ...]]:
    """The joint's origin and the body that it moves; of a linear axis the foot and what carries it."""
    program, dof, scene = found.program, found.axes.dof, found.scene_at(offence.worst)
    q, travel, _ = found.axes.parts(offence.worst_values[None])
    base = program.cell.T_world_base(travel)[0]
    if axis < dof:
        origin = forward_kinematics(program.robot, q).p[0, axis + 1]
        moved = [m.body.name for m in scene.members if m.kind == ARM and m.frame == axis + 1]
        # The last joint's link may have no shape of its own: what it turns is the tool.
        moved = moved or [m.body.name for m in scene.members if m.kind in (HOLDER, CUTTER)]
        return base[:3, :3] @ origin + base[:3, 3], tuple(moved[:1])
    carried = [m.body.name for m in scene.members if m.kind == CARRIAGE or (m.kind == ARM and m.frame == 0)]
    return base[:3, 3], tuple(carried[-1:]) if axis < dof + found.axes.travels else ()


def _of_tool(found: Verification, offence: Offence) -> tuple[Array, tuple[str, ...]]:
    """The tip and the cutter."""
    values = offence.worst_values[None]
    table = found.axes.parts(values)[2]
    tip = found.program.cell.T_world_part(table)[0] @ found.courses.frames(values, np.array([offence.worst]))[0]
    cutters = [m.body.name for m in found.scene_at(offence.worst).members if m.kind == CUTTER]
    return np.asarray(tip[:3, 3]), tuple(cutters[:1])


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
# As high as the first screen of a page, in half of its width.
SIZE_IN = (5.0, 5.9)
# Half the width of the near view, m; what is smaller than this around the touch is seen.
NEAR = 0.22
# Of a joint beyond its limit more is needed to see which it is.
NEAR_JOINT = 0.5
# Triangles of a body that sight is judged by.
COARSE = 300
# Width of the stripes of assumed shapes, along the diagonal of their frames, m.
STRIPE = 0.12
FLOOR_COLOUR = "#E8EAED"


def draw_offence(found: Verification, offence: Offence, *, renderer: Renderer | None = None) -> Figure:
    """Draw an offence at its worst: the place of the offence above, the whole cell below.

    Raises
    ------
    InputError
        pyvista was asked for and cannot draw here.
    """
    works, message = chosen(renderer)
    if not works and offence is found.ranked[0]:
        say(f"note: {message}")
    spot = spot_of(found, offence)
    near, (camera, hidden) = _half_width(spot), view_of(found, spot)
    surfaces = body_surfaces(found.scene_at(spot.move))
    placed = _placed(found, surfaces, spot)
    floor = _floor(found, placed)
    whole = [*_painted(surfaces, placed, spot), *floor]
    behind = [*_painted(surfaces, placed, spot, hidden), *floor]
    figure, _ = style.new_figure(SIZE_IN, rows=0)
    with style.house_style():
        near_axes = figure.add_axes((0.015, 0.39, 0.97, 0.525))
        far_axes = figure.add_axes((0.015, 0.01, 0.97, 0.365))
        corners = np.vstack([M_TO_MM * np.vstack(placed), *(surface.vertices for surface in floor)])
        at = camera(M_TO_MM * spot.place)[:2]
        _frame(figure, near_axes, at + M_TO_MM * near * np.array([[-1.0, -1.0], [1.0, 1.0]]))
        box = np.stack([near_axes.get_xlim(), near_axes.get_ylim()], axis=1)
        _frame(figure, far_axes, np.vstack([camera(corners)[:, :2], box]))
        nothing = np.zeros((0, 3))
        for axes, drawn in ((far_axes, whole), (near_axes, behind)):
            show(figure, axes, Scene(camera, nothing, nothing, (), tuple(drawn)), works)
        _box_of_near(far_axes, near_axes)
        _distance(near_axes, camera, spot)
        _names(figure, spot, hidden)
    return figure


def _placed(found: Verification, surfaces: list[BodySurface], spot: Spot) -> list[Array]:
    """Vertices of all bodies in the world, in the pose of the offence."""
    q, travel, table = found.axes.parts(spot.values[None])
    return placed_in_world(found.scene_at(spot.move), surfaces, q[0], travel[0], float(table[0]))


def _half_width(spot: Spot) -> float:
    return NEAR if spot.contact is not None or not spot.offence.axis else NEAR_JOINT


def view_of(found: Verification, spot: Spot) -> tuple[style.Camera, tuple[str, ...]]:
    """The camera that shows most of an offence's bodies, and the names of bodies that still stand before its place."""
    near = _half_width(spot)
    surfaces = body_surfaces(found.scene_at(spot.move), COARSE)
    corners = [x[b.triangles] for b, x in zip(surfaces, _placed(found, surfaces, spot), strict=True)]
    seen = [
        near_points(spot.place, dense(x.reshape(-1, 3), np.arange(x.size // 3).reshape(-1, 3)), 0.3 * near)
        for b, x in zip(surfaces, corners, strict=True)
        if b.name in spot.bodies
    ] or [spot.place[None]]
    base = found.program.cell.T_world_base(found.axes.parts(spot.values[None])[1])[0, :3, 3]
    way = towards(base, spot.place, seen, np.concatenate(corners))
    others = [k for k, b in enumerate(surfaces) if b.name not in spot.bodies]
    blocking = in_the_way(np.concatenate(seen), way, [corners[k] for k in others])
    return style.Camera(way), tuple(surfaces[others[i]].name for i in blocking)


def _painted(
    surfaces: list[BodySurface], placed: list[Array], spot: Spot, without: Sequence[str] = ()
) -> list[Surface]:
    """Bodies in their colours, but for those left out."""
    return [
        Surface(M_TO_MM * x, body.triangles, _paint(spot, body))
        for body, x in zip(surfaces, placed, strict=True)
        if body.name not in without
    ]


def _paint(spot: Spot, body: BodySurface) -> Array:
    """Colours (k, 3) of a body's triangles; assumed shapes are in stripes."""
    colour = np.tile(to_rgb(_colour(spot, body)), (len(body.triangles), 1))
    if body.name.endswith(ASSUMED):
        middle = body.vertices[body.triangles].mean(axis=1).sum(axis=1)
        colour[np.floor(middle / STRIPE) % 2 == 0] += 0.6 * (1.0 - np.array(to_rgb(_colour(spot, body))))
    return colour


def _colour(spot: Spot, body: BodySurface) -> str:
    if body.name in spot.bodies:
        return FIRST if body.name == spot.bodies[0] else SECOND
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


def _box_of_near(far: Axes, near: Axes) -> None:
    """Mark in the whole picture what the near one shows."""
    (u0, u1), (v0, v1) = near.get_xlim(), near.get_ylim()
    far.plot([u0, u1, u1, u0, u0], [v0, v0, v1, v1, v0], color=style.INK, linewidth=0.9, zorder=5)
    for spine in near.spines.values():
        spine.set(visible=True, color=style.INK, linewidth=0.9)


def _distance(axes: Axes, camera: style.Camera, spot: Spot) -> None:
    """Draw the place, or the line between the nearest points, with its length."""
    points = spot.place[None] if spot.contact is None else spot.contact.points
    flat = camera(M_TO_MM * points)[:, :2]
    # Black on white is seen on every colour of a body.
    for colour, width in (("white", 5.0), (style.INK, 2.0)):
        axes.plot(*flat.T, color=colour, linewidth=width, zorder=6, solid_capstyle="round")
        axes.plot(
            *flat.mean(axis=0),
            "o",
            markersize=26,
            markerfacecolor="none",
            markeredgecolor=colour,
            markeredgewidth=width,
            zorder=6,
        )
    said = spot.distance_words or value_words(spot.offence)
    if said:
        look = {"boxstyle": "round,pad=0.3", "facecolor": "white", "edgecolor": style.INK, "linewidth": 0.9}
        axes.annotate(
            said,
            flat.mean(axis=0),
            (0, -20),
            textcoords="offset points",
            ha="center",
            va="top",
            size=11.0,
            bbox=look,
            zorder=7,
        )


def _names(figure: Figure, spot: Spot, hidden: Sequence[str]) -> None:
    """Say what it is, which colour is which body, and what would hide the place and is left out of the near view."""
    if hidden:
        figure.text(0.025, 0.4, f"not drawn here: {', '.join(hidden)}", size=8.5, va="bottom")
    figure.text(0.015, 0.975, f"line {spot.line}: {spot.offence.kind}", size=11.0, weight="bold", va="center")
    x = 0.015
    for name, colour in zip(spot.bodies, (FIRST, SECOND), strict=False):
        figure.text(x, 0.937, "■", color=colour, size=13, va="center")
        label = figure.text(x + 0.036, 0.937, name, size=10.5, va="center")
        extent = label.get_window_extent(figure.canvas.get_renderer())  # type: ignore[attr-defined]
        x += 0.036 + extent.width / (figure.get_size_inches()[0] * figure.dpi) + 0.04
