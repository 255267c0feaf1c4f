"""The arm's bodies for collision checks, from whatever a model says of its shape.

Links that are described by centre line and section become hulls of the sections, rounded off at the joints. They hold
all of the link's casing (outer size, no openings) and the hubs it ends in, as pictures of the robot show them. Motors,
cables and covers are in no description, so they are not in here.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from machining.cell.assumed_shapes import ASSUMED, assumed_solids, overlapping
from machining.cell.solids import Body, Solid, capsule, hull, ring, surface
from meshes.beams import BeamMesh, body_index, body_tip, crank_beam_mesh, element_axes, link_beam_mesh
from meshes.link_shells import link_shell_mesh
from meshes.sections import section_dimensions
from meshes.surfaces.checks import SurfaceFault, repair_surface
from robots import InputError, ModelDescription, Robot, UrdfRobot, load_description, read_urdf
from robots.arrays import Array
from robots.kinematics import moving_frames
from robots.robot import robot_from
from robots.schema.description import Link
from robots.urdf.reading import Visual
from robots.urdf.xml import is_xml

# Sides of tubes and hubs; drawn around the circle, so 0.9 % of the radius too large at the edges.
AROUND = 24
# Below this cosine between joint axis and centre line the link ends in a hub across it.
ACROSS = 0.6


@dataclass(frozen=True, eq=False)
class ArmBodies:
    """Bodies of an arm and the frames they move with.

    ``frame`` (one number a body) counts the frames of :meth:`frames`. ``neighbours``: pairs of places in ``bodies``
    that a joint connects and that overlap there by design. ``last``: place of the
    body that the tool stands on. ``notes``: what was assumed, merged or left out.
    """

    robot: Robot
    bodies: tuple[Body, ...]
    frame: tuple[int, ...]
    neighbours: frozenset[tuple[int, int]]
    last: int
    notes: tuple[str, ...]

    @property
    def flange(self) -> int:
        """Number of the flange's frame."""
        return self.robot.dof + 1

    @property
    def count(self) -> int:
        """How many frames :meth:`frames` gives."""
        return self.robot.dof + (2 if self.robot.parallelogram is None else 4)

    def frames(self, q: Array) -> tuple[Array, Array]:
        """Rotations and origins as :func:`robots.kinematics.moving_frames` has them."""
        return moving_frames(self.robot, q)


def arm_of(
    model: str | Path, description: ModelDescription | None = None, *, beam_radius: float | None = None
) -> ArmBodies:
    """Bodies of a bundled robot, a model file or a URDF; see :func:`arm_bodies`.

    ``description``: the model's with other values (zero errors of joints), in place of what the file says.
    """
    path = Path(model)
    urdf = read_urdf(path) if path.is_file() and is_xml(path) else None
    if description is None:
        description = load_description(model) if urdf is None else urdf.description
    return arm_bodies(description, urdf, beam_radius=beam_radius)


def arm_bodies(
    description: ModelDescription, urdf: UrdfRobot | None = None, *, beam_radius: float | None = None
) -> ArmBodies:
    """Bodies of an arm: links of the description first, then shapes of a URDF, then capsules between joints.

    Of an arm without any shape all bodies are capsules (:mod:`machining.cell.assumed_shapes`), which their names say;
    ``beam_radius`` m: all as thick as that; 0: none, the arm has no bodies then.

    Of a URDF the collision shapes are taken, the visual ones of bodies that have none of these. A shape that is not
    closed gives its hull. A body without link or shape whose next joint stands off its own gets a capsule as thick as
    the largest section next to it, or of ``beam_radius`` (m); without either it is left out. Each is said in ``notes``.

    Raises
    ------
    InputError
        Shapes that cannot be read, or no body with a shape.
    """
    robot = robot_from(description)
    names = ("base", *robot.joint_names)
    if beam_radius is None and description.beam_radius is not None:
        beam_radius = description.beam_radius.si
    if not description.link and (urdf is None or not (urdf.collisions or urdf.visuals)):
        return _assumed(description, robot, names, beam_radius)
    solids: dict[int, tuple[Solid, ...]] = {}
    label: dict[int, str] = {}
    notes: list[str] = []
    for link in description.link:
        body = body_index(robot, link.body)
        made, said = link_solids(description, robot, link)
        solids[body] = (*solids.get(body, ()), *made)
        label[body] = f"{label[body]} and {link.name}" if body in label else link.name
        notes += said
    for body, name in enumerate(names):
        if body in solids:
            continue
        made = ()
        if urdf is not None:
            made, said = _shape_solids(name, urdf)
            notes += said
        if not made:
            made, said = _capsule(description, robot, body, name, beam_radius)
            notes += said
            assumed = bool(made) and not description.link
            label[body] = f"{name}{ASSUMED}" if assumed else name
        if made:
            solids[body] = made
            label.setdefault(body, name)
    return _put_together(description, robot, solids, label, notes)


def _assumed(
    description: ModelDescription, robot: Robot, names: tuple[str, ...], beam_radius: float | None
) -> ArmBodies:
    """An arm of capsules; pairs of them that overlap by design count as neighbours."""
    if beam_radius == 0.0:
        return ArmBodies(robot, (), (), frozenset(), -1, ())
    solids = assumed_solids(robot, beam_radius)
    order = sorted(solids)
    bodies = tuple(Body(f"{names[body]}{ASSUMED}", solids[body]) for body in order)
    met = {(order.index(a), order.index(b)) for a, b in overlapping(robot, solids)} | set(pairwise(range(len(order))))
    thick = [1e3 * s.radius for body in order for s in solids[body]]
    note = (
        f"{robot.name} has no shape of its own: capsules from its kinematics stand for it, {min(thick):.0f} to "
        f"{max(thick):.0f} mm in radius (assumed shape); --beam-radius, or meshes, say better"
    )
    return ArmBodies(robot, bodies, tuple(order), frozenset(met), len(order) - 1, (note,))


def _put_together(
    description: ModelDescription,
    robot: Robot,
    solids: dict[int, tuple[Solid, ...]],
    label: dict[int, str],
    notes: list[str],
) -> ArmBodies:
    order = sorted(solids)
    bodies = [Body(label[body], solids[body]) for body in order]
    frame = list(order)
    # Bodies without a shape between two others do not make these strangers: their joints are in one place.
    neighbours = set(pairwise(range(len(order))))
    p = robot.parallelogram
    if p is not None and description.parallelogram is not None:
        crank, bar = len(bodies), len(bodies) + 1
        bodies += [
            Body(name, (s,)) for name, s in zip(("crank", "bar"), crank_and_bar(description, robot), strict=True)
        ]
        frame += [robot.dof + 2, robot.dof + 3]
        neighbours |= {(order.index(b), crank) for b in (p.crank_about, p.crank_about + 1) if b in solids}
        neighbours.add((crank, bar))
        if p.driven + 1 in solids:
            neighbours.add((order.index(p.driven + 1), bar))
    return ArmBodies(robot, tuple(bodies), tuple(frame), frozenset(neighbours), len(order) - 1, tuple(notes))


def _shape_solids(name: str, urdf: UrdfRobot) -> tuple[tuple[Solid, ...], list[str]]:
    """Solids of a body's shapes in a URDF."""
    shapes = urdf.collisions.get(name, ())
    notes = []
    if not shapes and urdf.visuals.get(name):
        shapes = urdf.visuals[name]
        notes.append(f"body {name}: no collision shape, its visual shape is taken")
    solids = []
    for shape in shapes:
        solid, said = _shape_solid(name, shape)
        solids.append(solid)
        notes += said
    return tuple(solids), notes


def _shape_solid(name: str, shape: Visual) -> tuple[Solid, list[str]]:
    # Only the shapes of a URDF need what prepares surfaces, and its pictures' libraries.
    from meshes.surfaces.bodies import body_surface

    read = body_surface([shape])
    try:
        return surface(read.sources[0], read.nodes, read.faces), []
    except InputError as fault:
        note = f"body {name}: the hull of {read.sources[0]} is taken ({fault.what})"
        return hull(read.nodes), [note]


def _capsule(
    description: ModelDescription, robot: Robot, body: int, name: str, beam_radius: float | None
) -> tuple[tuple[Solid, ...], list[str]]:
    """A capsule along the way to the next joint, for a body of which nothing else is known."""
    tip = body_tip(robot, body)
    if not np.linalg.norm(tip) > 1e-6 or beam_radius == 0.0:
        return (), []
    radius, origin = beam_radius, "as asked for"
    if radius is None:
        near = sorted(description.link, key=lambda link: abs(body_index(robot, link.body) - body))
        if not near:
            made = assumed_solids(robot).get(body, ())
            return made, [f"body {name}: no shape known, capsules from the kinematics are taken (assumed shape)"]
        sections = [s for s in (near[0].section, near[0].section_end) if s is not None]
        radius = max(0.5 * float(section_dimensions(s)[:-1].max()) for s in sections)
        origin = f"half the largest section of {near[0].name}"
    said = f"body {name}: no shape known, a capsule of radius {1e3 * radius:.0f} mm ({origin}) is taken"
    return (capsule(np.zeros(3), tip, radius),), [said]


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
        raise InputError(f"{robot.name} has no parallelogram", code="R002")
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
        why = fault.prose if isinstance(fault, InputError) else fault
        note = f"link {link.name}: the hull of its surface is taken, which cannot be closed ({why})"
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
