"""Solids of links that are described by centre line and section: hulls of the sections, rounded off at the joints.

They hold all of the link's casing (outer size, no openings) and the hubs it ends in, as pictures of the robot show
them. Motors, cables and covers are in no description, so they are not in here.
"""

from __future__ import annotations

import numpy as np

from machining.cell.solids import Solid, hull, ring, surface
from meshes.beams import BeamMesh, body_index, body_tip, crank_beam_mesh, element_axes, link_beam_mesh
from meshes.link_shells import link_shell_mesh
from meshes.sections import section_dimensions
from meshes.surfaces.checks import SurfaceFault, repair_surface
from robots import InputError, ModelDescription, Robot
from robots.arrays import Array
from robots.schema.description import Link

# Sides of tubes and hubs; drawn around the circle, so 0.9 % of the radius too large at the edges.
AROUND = 24
# Below this cosine between joint axis and centre line the link ends in a hub across it.
ACROSS = 0.6


def link_solids(description: ModelDescription, robot: Robot, link: Link) -> tuple[tuple[Solid, ...], list[str]]:
    """Solids of a link in its body's frame, and notes on what was assumed.

    A prepared surface takes the casing's place: its mid-surface, rings and openings closed, thickened by half of the
    wall; its hull where that cannot be closed. Errors as :func:`meshes.link_shells.link_shell_mesh`.
    """
    beam = link_beam_mesh(description, robot, link, elements_per_segment=1)
    if link.surface is not None:
        return _of_surface(link, beam)
    body = body_index(robot, link.body)
    own = None if body == 0 else robot.R_post[body - 1].T[:, 2]
    after = None if body == robot.dof else robot.T_pre[body][:3, 2]
    ends = {"root": own, "tip": after, "pin": own}
    return beam_solids(beam, ends), []


def beam_solids(beam: BeamMesh, axes: dict[str, Array | None]) -> tuple[Solid, ...]:
    """One hull for each straight element of a beam mesh; ``axes``: joint axis (3,) at interfaces that have one."""
    return tuple(
        hull(np.vstack([_end(beam, axes, element, 0), _end(beam, axes, element, 1)]))
        for element in range(len(beam.elements))
    )


def crank_and_bar(description: ModelDescription, robot: Robot) -> tuple[Solid, Solid]:
    """Crank in the driven body's axes from its own joint, and bar in the crank-carrying link's axes from its pin.

    Raises
    ------
    InputError
        The robot has no parallelogram.
    """
    p = robot.parallelogram
    if p is None or description.parallelogram is None:
        raise InputError(f"{robot.name} has no parallelogram")
    axis = robot.R_post[p.driven].T[:, 2]
    (crank,) = beam_solids(crank_beam_mesh(description, robot, elements_per_segment=1), {"root": axis, "tip": axis})
    way = body_tip(robot, p.crank_about + 1)
    width = float(section_dimensions(description.parallelogram.bar)[:-1].max())
    x = way / np.linalg.norm(way)
    y = np.cross(x, np.eye(3)[np.argmin(np.abs(x))])
    y /= np.linalg.norm(y)
    outline = _outline("tube", width, width) @ np.stack([y, np.cross(x, y)])
    return crank, hull(np.vstack([outline, outline + way]))


def _of_surface(link: Link, beam: BeamMesh) -> tuple[tuple[Solid, ...], list[str]]:
    mesh = link_shell_mesh(link, beam)
    faces = np.vstack([mesh.triangles, mesh.quads[:, [0, 1, 2]], mesh.quads[:, [0, 2, 3]]])
    half = 0.5 * float(mesh.thickness.max())
    try:
        nodes, closed, _ = repair_surface(link.name, mesh.nodes, faces, np.inf)
        return (surface(link.name, nodes, closed, half),), []
    except (SurfaceFault, InputError) as fault:
        note = f"link {link.name}: the hull of its surface is taken, which cannot be closed ({fault})"
        return (hull(mesh.nodes, half),), [note]


def _end(beam: BeamMesh, axes: dict[str, Array | None], element: int, end: int) -> Array:
    """Corners (c, 3) of an element's first or second end."""
    node = int(beam.elements[element, end])
    lengths, frames = element_axes(beam)
    R = frames[element]
    inward = -R[:, 0] if end else R[:, 0]
    size = beam.dimensions[element, end]
    width, height = float(size[0]), float(size[1 if beam.kind == "box" else 0])
    square = _outline(beam.kind, width, height) @ R[:, 1:].T
    axis = next((axes.get(name) for name, at in beam.interfaces.items() if at == node), None)
    if axis is not None:
        across = abs(axis @ R[:, 0]) < ACROSS
        return np.asarray(beam.nodes[node] + (_hub(axis, R, width, height) if across else _cut(axis, inward, square)))
    # Over the mitre of a kink, whose outer corner stands beyond the node.
    beyond = min(_mitre(beam, frames, element, node) * max(width, height), float(lengths[element]))
    return np.asarray(beam.nodes[node] + np.vstack([square, square - beyond * inward]))


def _outline(kind: str, width: float, height: float) -> Array:
    """Corners (c, 2) of a section's outer edge: local width and height."""
    if kind == "tube":
        return ring(0.5 * width, AROUND)[:, :2]
    return 0.5 * np.array([[width, height], [-width, height], [-width, -height], [width, -height]])


def _hub(axis: Array, R: Array, width: float, height: float) -> Array:
    """Corners of a cylinder about a joint axis, as wide as the link's end along it."""
    a = axis / np.linalg.norm(axis)
    if abs(a @ R[:, 2]) > ACROSS:
        width, height = height, width
    x = R[:, 0] - (R[:, 0] @ a) * a
    x /= np.linalg.norm(x)
    circle = ring(0.5 * height, AROUND)[:, :2] @ np.stack([x, np.cross(a, x)])
    return np.vstack([circle - 0.5 * width * a, circle + 0.5 * width * a])


def _cut(axis: Array, inward: Array, corners: Array) -> Array:
    """Corners of a link's end that is cut flat across a joint axis, from its section's (c, 3) square to the link.

    The section's own corners on the link's side of the cut stay: on tapered links they stick out of what the cut
    leaves. ``inward``: direction of the link from its end.
    """
    height = corners @ axis / (inward @ axis)
    return np.vstack([corners - height[:, None] * inward, corners[height > 0.0]])


def _mitre(beam: BeamMesh, frames: Array, element: int, node: int) -> float:
    """How far the mitre at a node reaches beyond it, over the section's size; 0 at interfaces."""
    if node in beam.interfaces.values():
        return 0.0
    other = [i for i, nodes in enumerate(beam.elements) if node in nodes and i != element]
    cosines = [float(np.clip(frames[element][:, 0] @ frames[i][:, 0], -1.0, 1.0)) for i in other]
    return max((0.5 * np.tan(0.5 * np.arccos(c)) for c in cosines), default=0.0)
