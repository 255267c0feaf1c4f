"""Beam meshes of links, in the frame of the body they belong to."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from meshes.sections import SectionKind, section_dimensions
from robots import InputError, ModelDescription, Robot
from robots.arrays import Array, Integers
from robots.schema.description import Link, Material

# Tapered force-based elements are exact but for the quadrature of 1/EI; four a segment keep that
# error below 1e-11 for the bundled links (tests/fem/elements/test_beam.py measures it).
ELEMENTS_PER_SEGMENT = 4


@dataclass(frozen=True)
class BeamMesh:
    """Straight beam elements between nodes, m elements, in the body's frame.

    ``nodes`` (k, 3) m; ``elements`` (m, 2); ``dimensions`` (m, 2, d): section dimensions at both ends;
    ``up`` (3,): direction of the section's height; ``interfaces``: node of each named interface, the
    first one being the root; ``axes`` (3,): of the joints at interfaces, where they are known; ``points``
    (3,) m: of interfaces that stand off their node, rigidly.
    """

    name: str
    nodes: Array
    elements: Integers
    kind: SectionKind
    dimensions: Array
    up: Array
    youngs_modulus: float
    poissons_ratio: float
    interfaces: dict[str, int]
    axes: dict[str, Array] = field(default_factory=dict)
    points: dict[str, Array] = field(default_factory=dict)

    @property
    def interface_points(self) -> Array:
        """Positions of the interfaces (i, 3), root first."""
        return np.stack([self.points.get(name, self.nodes[node]) for name, node in self.interfaces.items()])


def element_axes(mesh: BeamMesh) -> tuple[Array, Array]:
    """Lengths (m,) and rotations (m, 3, 3): columns are the local x (along), y (width), z (height) axes."""
    span = mesh.nodes[mesh.elements[:, 1]] - mesh.nodes[mesh.elements[:, 0]]
    length = np.linalg.norm(span, axis=1)
    x = span / length[:, None]
    up = np.broadcast_to(mesh.up, x.shape)
    # A height direction along the beam says nothing; any normal will do then.
    parallel = np.linalg.norm(np.cross(up, x), axis=1) < 1e-6 * np.linalg.norm(mesh.up)
    spare = np.eye(3)[np.argmin(np.abs(x), axis=1)]
    up = np.where(parallel[:, None], spare, up)
    y = np.cross(up, x)
    y /= np.linalg.norm(y, axis=1)[:, None]
    return length, np.stack([x, y, np.cross(x, y)], axis=2)


def body_tip(robot: Robot, body: int) -> Array:
    """Where the next joint (or the flange) sits in the frame of a body (3,)."""
    T = robot.T_last_flange if body == robot.dof else robot.T_pre[body]
    return np.array(T[:3, 3])


def body_axes(robot: Robot, body: int) -> dict[str, Array]:
    """Axes (3,) of the joints at a body's root and tip, in its frame.

    The base has its joint's at both, and so has the last body.
    """
    own = robot.T_pre[0][:3, 2] if body == 0 else robot.R_post[body - 1].T[:, 2]
    return {"root": own, "tip": own if body == robot.dof else robot.T_pre[body][:3, 2]}


def body_index(robot: Robot, body: str) -> int:
    """0 for the base, i for the body that joint i moves."""
    return 0 if body == "base" else 1 + robot.joint_names.index(body)


def link_beam_mesh(
    description: ModelDescription, robot: Robot, link: Link, elements_per_segment: int = ELEMENTS_PER_SEGMENT
) -> BeamMesh:
    """Beam mesh of a link: root at its own joint, through ``via``, to the next joint or the flange.

    The link that a parallelogram drives gets a third interface ``pin`` and the lever to it, with the
    section of the link's root.

    Raises
    ------
    InputError
        The link's centre line has length zero.
    """
    body = body_index(robot, link.body)
    ends = {"root": np.zeros(3), "tip": body_tip(robot, body)}
    first, last = (
        end if given is None else given.si_array
        for end, given in zip(ends.values(), (link.rigid_to, link.rigid_from), strict=True)
    )
    path = np.vstack([first, *[p.si_array for p in link.via], last])
    start = section_dimensions(link.section)
    end = start if link.section_end is None else section_dimensions(link.section_end)
    lever = None
    if robot.parallelogram is not None and body == robot.parallelogram.driven + 1:
        lever = robot.parallelogram.pin
    mesh = _polyline_mesh(
        f"{description.name}: link {link.name}",
        path,
        start,
        end,
        link.section.kind,
        np.array(link.beam_up),
        _material(description, link),
        elements_per_segment,
        lever,
    )
    stood_off = {"root": link.rigid_to, "tip": link.rigid_from}
    points = {name: ends[name] for name, given in stood_off.items() if given is not None}
    return replace(mesh, axes=body_axes(robot, body), points=points)


def _material(description: ModelDescription, link: Link) -> Material:
    """The link's material, with its own modulus if it has one."""
    material = description.materials[link.material]
    own = link.youngs_modulus
    return material if own is None else material.model_copy(update={"youngs_modulus": own})


def crank_beam_mesh(
    description: ModelDescription, robot: Robot, elements_per_segment: int = ELEMENTS_PER_SEGMENT
) -> BeamMesh:
    """Beam mesh of the parallelogram's crank, from its axis to the bar's pin, driven body's orientation."""
    p = description.parallelogram
    if p is None or robot.parallelogram is None:
        raise InputError(f"{description.name} has no parallelogram", code="R002")
    dimensions = section_dimensions(p.crank)
    axis = robot.R_post[robot.parallelogram.driven].T[:, 2]
    path = np.vstack([np.zeros(3), robot.parallelogram.pin])
    return _polyline_mesh(
        f"{description.name}: crank",
        path,
        dimensions,
        dimensions,
        p.crank.kind,
        np.cross(axis, robot.parallelogram.pin),
        description.materials[p.crank_material],
        elements_per_segment,
        None,
    )


def _polyline_mesh(
    name: str,
    path: Array,
    start: Array,
    end: Array,
    kind: SectionKind,
    up: Array,
    material: Material,
    per_segment: int,
    lever: Array | None,
) -> BeamMesh:
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    path = np.vstack([path[:1], path[1:][lengths > 1e-9]])
    lengths = lengths[lengths > 1e-9]
    if lengths.size == 0:
        raise InputError(
            f"{name} has length zero", code="L007", remedy="remove the link: a body without one is a rigid connection"
        )
    t = np.linspace(0.0, 1.0, per_segment + 1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    stations = np.unique(np.concatenate([a + t * n for a, n in zip(along, lengths, strict=False)]))
    nodes = np.stack([np.interp(stations, along, path[:, k]) for k in range(3)], axis=1)
    sections = start + (stations / along[-1])[:, None] * (end - start)
    elements = np.stack([np.arange(len(nodes) - 1), np.arange(1, len(nodes))], axis=1)
    dimensions = np.stack([sections[:-1], sections[1:]], axis=1)
    interfaces = {"root": 0, "tip": len(nodes) - 1}
    if lever is not None:
        first = len(nodes)
        nodes = np.vstack([nodes, nodes[0] + t[1:, None] * (lever - nodes[0])])
        chain = np.concatenate([[0], np.arange(first, len(nodes))])
        elements = np.vstack([elements, np.stack([chain[:-1], chain[1:]], axis=1)])
        dimensions = np.concatenate([dimensions, np.broadcast_to(start, (per_segment, 2, len(start)))])
        interfaces["pin"] = len(nodes) - 1
    return BeamMesh(
        name,
        nodes,
        elements,
        kind,
        dimensions,
        up,
        material.youngs_modulus.si,
        material.poissons_ratio.si,
        interfaces,
    )
