"""Picture of the deformed arm: shells coloured by strain energy density, the unloaded arm as an outline, the load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from matplotlib.patheffects import withStroke

from fem import ArmFields
from fem.elements.couplings import distributing_coupling
from robots import ModelDescription, Robot, forward_kinematics, require_one_of, tool_position
from robots.arrays import Array
from robots.constants import M_TO_MM
from stiffarm.commands.simulate.budgets import PoseBudget
from stiffarm.commands.simulate.field_files import FieldGrid
from stiffarm.pages import style
from stiffarm.pages.rendering import VIEWS, Picture, Renderer, chosen, drawn, show
from stiffarm.pages.robot_drawing import DrawnBody, draw_robot
from stiffarm.pages.scenes import Scene, Surface

# Colour stands for the largest densities and two decades below; what is less takes the darkest.
_DECADES: Final = 2.0
_TOP_PERCENTILE: Final = 99.5
# Length of the load's arrow over the size of the picture.
_ARROW: Final = 0.13
_LOAD_COLOUR: Final = style.OKABE_ITO["vermillion"]
_GHOST: Final = "#5A6068"
# Parts named in the picture: so many at most, with this share at least; height of a line and width of a letter over the
# height of the picture.
_NAMED: Final = 5
_WORTH_NAMING: Final = 0.05
_LINE: Final = 0.032
_LETTER: Final = 0.0125


# Viridis: lightness rises all the way for every kind of colour vision; not the map of stiffness, which says the
# opposite. Its darkest purple is left out: shading would turn it black.
ENERGY_COLOURS: Final = style.stretch_of("viridis", 0.12, 1.0)


@dataclass(frozen=True)
class DeformedArm:
    """An arm in one pose under one load, ready to draw: fields, energy budget, how many times motion is drawn."""

    description: ModelDescription
    robot: Robot
    q: Array
    wrench: Array
    point: Array | None
    fields: ArmFields
    grid: FieldGrid
    budget: PoseBudget
    scale: float

    @property
    def tool_mm(self) -> tuple[Array, Array]:
        """The loaded point (3,) in mm, unloaded and as drawn."""
        frames = forward_kinematics(self.robot, self.q[None])
        at = tool_position(self.robot, frames, None if self.point is None else self.point[None])[0]
        return at * M_TO_MM, (at + self.scale * self.fields.displacement[:3]) * M_TO_MM


def render_field(
    arm: DeformedArm,
    path: Path,
    *,
    heading: str,
    subtitle: str,
    view: str = "oblique",
    renderer: Renderer | None = None,
) -> Picture:
    """Draw the deformed arm; PNG of 1600 x 1200 pixels.

    Parameters
    ----------
    view : ``oblique`` or ``side`` (see ``stiffarm.pages.rendering.VIEWS``)
    renderer : None takes pyvista where OpenGL works and a z-buffer in numpy elsewhere

    Raises
    ------
    InputError
        Unknown view, a folder that does not exist, or pyvista asked for where it cannot draw.
    """
    require_one_of("view of the deformed arm", view, VIEWS, code="B002")
    works, message = chosen(renderer)
    style.require_folder(path)
    unloaded, loaded = _scene(arm, VIEWS[view], 0.0), _scene(arm, VIEWS[view], arm.scale)
    vertices = np.concatenate([s.surfaces[0].vertices for s in (unloaded, loaded)])
    start, moved = arm.tool_mm
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    arrows = _load_arrows(arm.wrench, moved, _ARROW * size)
    corners = np.vstack(
        [vertices, *[b.mesh.bounds for s in (unloaded, loaded) for b in s.bodies], start, *arrows.values()]
    )
    norm, ticks = _density_scale(arm.grid.density)
    figure, _ = style.new_figure("picture", rows=0)
    with style.house_style():
        axes = style.frame_axes(figure, loaded.camera, style.box_ticks(corners), flat=view == "side")
        show(figure, axes, loaded, works)
        _outline(figure, axes, unloaded, works)
        taken = [loaded.camera(place) for a, b in arrows.values() for place in np.linspace(a, b, 5)]
        _share_labels(axes, loaded.camera, arm, loaded.bodies, taken)
        _draw_load(axes, loaded.camera, arrows)
        style.headings(figure, heading, subtitle)
        cut, place = style.ends_cut(arm.grid.density, ticks), {"cax": style.beside_picture(figure)}
        bar = style.colour_bar(figure, ENERGY_COLOURS, norm, ticks, cut, place)
        bar.set_label("strain energy density (J/m³), log scale", size=11, labelpad=10)
    style.save_png(figure, path)
    return Picture(path, "pyvista" if works else "matplotlib", "" if works else message)


def _scene(arm: DeformedArm, camera: style.Camera, scale: float) -> Scene:
    """Shells in their colours and, in grey, what has no shell, moved with the shells' ends."""
    triangles, cell = arm.grid.triangles()
    norm, _ = _density_scale(arm.grid.density)
    colours = ENERGY_COLOURS(norm(arm.grid.density[cell]))[:, :3]
    surface = Surface(arm.grid.deformed(scale) * M_TO_MM, triangles, colours)
    bodies = _moved_bodies(arm, scale)
    return Scene(camera, np.zeros((0, 3)), np.zeros((0, 3)), tuple(bodies), (surface,))


def _density_scale(density: Array) -> tuple[Normalize, Array]:
    top = float(np.percentile(density, _TOP_PERCENTILE))
    top = float(f"{top:.1g}") if top > 0.0 else 1.0
    return style.colour_scale(density, (top / 10.0**_DECADES, top))


def _moved_bodies(arm: DeformedArm, scale: float) -> list[DrawnBody]:
    """Hubs, flange, tool and bar of the robot's drawing, each moved with the nearest ring of a shell."""
    rings = [(link, ring) for link in arm.fields.links for ring in link.mesh.interfaces.values()]
    centres = np.array([link.positions[ring].mean(axis=0) for link, ring in rings])
    # From displacements: about the wall's normal the nodes of a ring turn by themselves.
    motion = np.array(
        [
            distributing_coupling(link.positions, ring, centre) @ link.displacement[ring].ravel()
            for (link, ring), centre in zip(rings, centres, strict=True)
        ]
    )
    centres, motion = centres * M_TO_MM, motion * ([M_TO_MM] * 3 + [1.0] * 3)
    out = []
    # The serial load path has no parallelogram.
    pinned = ("bar", "crank pin", "lever pin")
    linked = any(link.name == "crank" for link in arm.fields.links)
    for body in draw_robot(arm.description, arm.robot, arm.q):
        if not (linked if body.name in pinned else body.role in ("joint", "flange", "tool")):
            continue
        vertices = np.asarray(body.mesh.vertices)
        # Each of its ends goes with the ring that is nearest to it.
        ends = (vertices[:, None] - centres) if body.name == "bar" else (body.mesh.bounds.mean(axis=0) - centres)[None]
        nearest = np.linalg.norm(ends, axis=-1).argmin(axis=-1).ravel()
        shift, turn = motion[nearest, :3], motion[nearest, 3:]
        mesh = body.mesh.copy()
        mesh.vertices = vertices + scale * (shift + np.cross(turn, vertices - centres[nearest]))
        out.append(body._replace(mesh=mesh))
    return out


def _outline(figure: Figure, axes: Axes, scene: Scene, works: bool) -> None:
    """Dashed outline of a scene, over everything else."""
    image, window = drawn(figure, axes, scene, works)
    u0, u1, v0, v1 = window.extent
    u = u0 + (np.arange(window.width) + 0.5) / window.width * (u1 - u0)
    v = v1 - (np.arange(window.height) + 0.5) / window.height * (v1 - v0)
    look: dict[str, Any] = {"colors": _GHOST, "linewidths": 1.1, "linestyles": "--", "zorder": 3}
    axes.contour(u, v, image[..., 3] > 0, levels=[0.5], **look)


def _share_labels(
    axes: Axes, camera: style.Camera, arm: DeformedArm, bodies: Sequence[DrawnBody], taken: Sequence[Array]
) -> None:
    """Name the parts that store most, with their share, where they are drawn and nothing else is ``taken``."""
    places: dict[str, Array] = {body.name: body.mesh.bounds.mean(axis=0) for body in bodies}
    nodes = arm.grid.deformed(arm.scale) * M_TO_MM
    ends = np.cumsum([len(link.mesh.nodes) for link in arm.fields.links])[:-1]
    places |= {link.name: part.mean(axis=0) for link, part in zip(arm.fields.links, np.split(nodes, ends), strict=True)}
    stand_in = {"base": "base plate", "tool": "mounting plate"}
    places = {own: places[drawn_as] for own, drawn_as in stand_in.items() if drawn_as in places} | places
    height = float(np.ptp(axes.get_ylim()))
    line, letter = _LINE * height, _LETTER * height
    halo = [withStroke(linewidth=3.5, foreground="white")]
    # Middles and half widths of what is there already.
    there = [(float(place[0]), float(place[1]), 3.0 * letter) for place in taken]
    for i in arm.budget.order[:_NAMED]:
        name, share = arm.budget.parts[i], float(arm.budget.share[i])
        place = places.get(name.removesuffix(" other directions"))
        if place is None or share < _WORTH_NAMING:
            continue
        text = f"{name} {100.0 * share:.0f} %"
        (u, v), half = camera(place)[:2], 0.5 * letter * len(text)
        shifts = [0.0] + [sign * k * 0.5 * line for k in range(1, 12) for sign in (1.0, -1.0)]
        free = [d for d in shifts if not any(abs(u - a) < half + w and abs(v + d - b) < line for a, b, w in there)]
        v += (free or shifts)[0]
        there.append((u, v, half))
        axes.text(u, v, text, ha="center", va="center", size=10.5, weight="bold", zorder=6, path_effects=halo)


def _draw_load(axes: Axes, camera: style.Camera, arrows: Mapping[str, Array]) -> None:
    """Arrows from the tool point: a force has one head, a moment two along its axis (right hand)."""
    look: dict[str, Any] = {"arrowstyle": "-|>", "linewidth": 2.6, "color": _LOAD_COLOUR, "zorder": 5}
    for label, arrow in arrows.items():
        tail, head = camera(arrow)[:, :2]
        ends = [head, tail + 0.78 * (head - tail)] if label.endswith("N m") else [head]
        for end in ends:
            axes.add_patch(FancyArrowPatch(tuple(tail), tuple(end), mutation_scale=22, shrinkA=0, shrinkB=0, **look))
        axes.plot(*tail, "o", color=_LOAD_COLOUR, markersize=6, zorder=5)
        axes.annotate(
            label, tuple(head), (9, -4), textcoords="offset points", size=11, weight="bold", color=_LOAD_COLOUR
        )


def _load_arrows(wrench: Array, at: Array, length: float) -> dict[str, Array]:
    """Tail and head (2, 3) mm of the force's and the moment's arrow, by their labels."""
    parts = {"N": wrench[:3], "N m": wrench[3:]}
    sizes = {unit: float(np.linalg.norm(vector)) for unit, vector in parts.items()}
    return {
        f"{sizes[unit]:.4g} {unit}": np.stack([at, at + length * vector / sizes[unit]])
        for unit, vector in parts.items()
        if sizes[unit] > 0.0
    }


def load_text(wrench: Array) -> str:
    """Size of the force and of the moment, as in ``650 N, 40 N m``."""
    return ", ".join(_load_arrows(wrench, np.zeros(3), 1.0))
