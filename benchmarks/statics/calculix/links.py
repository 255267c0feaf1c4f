"""A link for CalculiX: its shell as S8R and S6, or its solid as C3D10, tied to interface points. Units mm, N, MPa.

An interface has a reference node (directions 1 to 3: displacement) and a rotation node (1 to 3: rotation).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from benchmarks.statics.calculix.deck import Deck, Freedom, QuadraticMesh, ascii_text, number, safe_name, with_middles
from fem.elements.couplings import Coupling, distributing_coupling, giving_way, rigid_motion, ring_weights
from fem.elements.shell import ring_parts
from fem.model import LinkPart
from fem.reference.shell_arm import mesh_of
from meshes import ShellMesh, SolidMesh
from robots import InputError
from robots.arrays import Array, Bools, Integers
from robots.constants import M_TO_MM

# The beams: side as a share of the thinnest wall, modulus as a share of the wall's.
BEAM_SIDE, BEAM_SOFTNESS = 0.1, 1e-3
# Weights of a quadratic edge's ends and of its middle (Simpson's rule), times its length.
END_WEIGHT, MIDDLE_WEIGHT = 1.0 / 6.0, 4.0 / 6.0
# Freedoms of mid-side nodes that are sure to hold six good ones: those of four edges.
ENOUGH = 12


@dataclass(frozen=True)
class Motion:
    """A point's displacement and rotation from free ones: u = G x[freedoms]; G (6, k), mm and rad."""

    freedoms: tuple[Freedom, ...]
    G: Array

    @classmethod
    def of_nodes(cls, reference: int, rotation: int) -> Motion:
        """Motion that a reference node and a rotation node have."""
        return cls(tuple((node, i) for node in (reference, rotation) for i in (1, 2, 3)), np.eye(6))

    def carried(self, r: Array) -> Motion:
        """Motion of a point rigidly connected, r (3,) m away."""
        return Motion(self.freedoms, rigid_motion(M_TO_MM * r[None])[0] @ self.G)

    def plus(self, freedom: Freedom, direction: Array) -> Motion:
        """With one freedom more, along ``direction`` (6,)."""
        return Motion((*self.freedoms, freedom), np.column_stack([self.G, direction]))

    def along(self, direction: Array) -> dict[Freedom, float]:
        """Terms of the motion along ``direction`` (6,)."""
        return dict(zip(self.freedoms, (direction @ self.G).tolist(), strict=True))


@dataclass(frozen=True)
class _Interface:
    """An interface: name of its sets, words for people, ring (r,) of the mesh's nodes, its point (3,) mm."""

    label: str
    what: str
    ring: Integers
    point: Array
    reference: int
    rotation: int


@dataclass(frozen=True)
class _Placed:
    """A link's quadratic mesh in the deck: nodes (k + e, 3) mm in base axes, number of the first one, thinnest wall.

    ``middle`` (k + e,): whether a node is in the middle of an edge.
    """

    mesh: QuadraticMesh | SolidMesh
    nodes: Array
    first: int
    wall: float
    middle: Bools

    def numbers(self, nodes: Integers) -> Integers:
        """Numbers in the deck."""
        return np.asarray(self.first + nodes)


def add_link(deck: Deck, link: LinkPart, index: int, root: Motion, R: Array, origin: Array) -> dict[str, Motion]:
    """Write a link in its place: body's axes R (3, 3), origin (3,) m; its root makes the motion ``root``.

    Returns the motions of the other interfaces by name. ``index`` keeps apart links whose names look alike once
    they are spelt in ASCII.

    Raises
    ------
    InputError
        A ring without edges, a distributing ring whose nodes lie on one line, or rings that share too many nodes.
    """
    mesh, label, where = mesh_of(link), f"L{index}_{safe_name(link.name)}".rstrip("_"), ascii_text(link.name)
    if isinstance(mesh, ShellMesh):
        placed = _placed_shell(deck, mesh, label, where, R, origin)
    else:
        placed = _placed_solid(deck, mesh, label, where, R, origin)
    interfaces = {}
    for name, point, ring in zip(mesh.interfaces, link.element.points, mesh.interfaces.values(), strict=True):
        tag, what = f"{label}_{safe_name(name)}", f"interface {ascii_text(name)} of {where}"
        interfaces[name] = _interface(deck, tag, what, ring, M_TO_MM * (origin + R @ point))
    kinds: list[Coupling] = [link.flanges.get(name, "rigid") for name in interfaces]
    parts = ring_parts(mesh, list(mesh.interfaces.values()), kinds)
    # Rigid rings first: a distributing one that shares nodes with them must know which freedoms are taken.
    for kind, interface in zip(kinds, interfaces.values(), strict=True):
        if kind == "rigid":
            _rigid(deck, placed, interface)
    for kind, interface, bodies in zip(kinds, interfaces.values(), parts, strict=True):
        if kind == "distributing":
            _distributing(deck, placed, interface, bodies)
    first_name, *others = interfaces
    follow(deck, interfaces[first_name].reference, interfaces[first_name].rotation, root)
    return {name: Motion.of_nodes(interfaces[name].reference, interfaces[name].rotation) for name in others}


def _placed_shell(deck: Deck, mesh: ShellMesh, label: str, where: str, R: Array, origin: Array) -> _Placed:
    quadratic = with_middles(mesh)
    nodes = M_TO_MM * (origin + quadratic.nodes @ R.T)
    what = f"link {where}, the first {quadratic.corners} are the corners in stiffarm's order, then mid-side nodes"
    first = int(deck.nodes(nodes, f"N_{label}", what)[0])
    middle = np.arange(len(nodes)) >= quadratic.corners
    placed = _Placed(quadratic, nodes, first, M_TO_MM * float(mesh.thickness.min()), middle)
    _shell(deck, mesh, placed, quadratic, label, where)
    _beams(deck, mesh, placed, quadratic, label, where)
    return placed


def _placed_solid(deck: Deck, mesh: SolidMesh, label: str, where: str, R: Array, origin: Array) -> _Placed:
    nodes = M_TO_MM * (origin + mesh.nodes @ R.T)
    first = int(deck.nodes(nodes, f"N_{label}", f"link {where}, in stiffarm's order")[0])
    middle = np.zeros(len(nodes), dtype=bool)
    middle[mesh.tetrahedra[:, 4:]] = True
    name = f"E_{label}"
    deck.elements("C3D10", first + mesh.tetrahedra, name, f"the solid of link {where}")
    material = deck.material(mesh.youngs_modulus, mesh.poissons_ratio)
    deck.section(f"*SOLID SECTION,ELSET={name},MATERIAL={material}")
    return _Placed(mesh, nodes, first, 0.0, middle)


def _interface(deck: Deck, label: str, what: str, ring: Integers, point: Array) -> _Interface:
    reference = int(deck.nodes(point[None], f"REF_{label}", f"{what}; directions 1 to 3: displacement (mm)")[0])
    rotation = int(deck.nodes(point[None], f"ROT_{label}", f"{what}; directions 1 to 3: rotation (rad)")[0])
    return _Interface(label, what, ring, point, reference, rotation)


def follow(deck: Deck, reference: int, rotation: int, motion: Motion) -> None:
    """Let a node and its rotation node make a motion."""
    for i, direction in enumerate(np.eye(6)):
        deck.equation((reference if i < 3 else rotation, i % 3 + 1), motion.along(direction))


def _shell(deck: Deck, mesh: ShellMesh, placed: _Placed, quadratic: QuadraticMesh, label: str, where: str) -> None:
    """Elements of a link, a section for each thickness."""
    material = deck.material(mesh.youngs_modulus, mesh.poissons_ratio)
    m = len(mesh.triangles)
    members = []
    walls = _walls(mesh)
    for i, wall in enumerate(np.unique(walls).tolist()):
        same = walls == wall
        for kind, cells in (
            ("S6", quadratic.triangles[same[:m]]),
            ("S8R", quadratic.quads[same[m:]]),
        ):
            if len(cells):
                members.append(f"{kind}_{label}_T{i + 1}")
                deck.elements(kind, placed.numbers(cells), members[-1], f"link {where}, wall {wall:g} mm")
                deck.section(f"*SHELL SECTION,ELSET={members[-1]},MATERIAL={material}", number(wall))
    deck.element_set(members, f"E_{label}", f"the shell of link {where}")


def _beams(deck: Deck, mesh: ShellMesh, placed: _Placed, quadratic: QuadraticMesh, label: str, where: str) -> None:
    """Soft beams along the rings and along steps of the wall.

    On the rings they give the nodes rotations. At a step CalculiX makes a node of two shells that meet in one
    normal; on a curved wall it leaves their common turn about that normal without any stiffness.
    """
    edges = [_steps(_walls(mesh), quadratic), *map(quadratic.edges_within, mesh.interfaces.values())]
    along = np.unique(np.concatenate(edges))
    ends, middles = quadratic.edges[along], quadratic.corners + along
    # The beams' normal must not lie along them: the base axis they are least aligned with.
    across = np.argmin(np.abs(placed.nodes[ends[:, 1]] - placed.nodes[ends[:, 0]]), axis=1)
    side = number(BEAM_SIDE * placed.wall)
    soft = deck.material(BEAM_SOFTNESS * mesh.youngs_modulus, mesh.poissons_ratio)
    what = f"beams too soft to count, on rings and steps of the wall of link {where}"
    for k in np.unique(across).tolist():
        name, some = f"B{k + 1}_{label}", across == k
        cells = np.stack([ends[some, 0], middles[some], ends[some, 1]], axis=1)
        deck.elements("B32", placed.numbers(cells), name, what)
        normal = ",".join("1." if i == k else "0." for i in range(3))
        deck.section(f"*BEAM SECTION,ELSET={name},MATERIAL={soft},SECTION=RECT", f"{side},{side}", normal)


def _walls(mesh: ShellMesh) -> Array:
    """Thickness of each element (m + q,) mm to the digits that are written, so that round-off makes no step."""
    return np.array([float(number(M_TO_MM * t)) for t in mesh.thickness.tolist()])


def _steps(thickness: Array, mesh: QuadraticMesh) -> Integers:
    """Numbers of the edges at which walls of different thickness (m + q,) meet."""
    sides = np.concatenate([mesh.triangles[:, 3:].ravel(), mesh.quads[:, 4:].ravel()]) - mesh.corners
    m = len(mesh.triangles)
    wall = np.concatenate([np.repeat(thickness[:m], 3), np.repeat(thickness[m:], 4)])
    thinnest, thickest = np.full(len(mesh.edges), np.inf), np.zeros(len(mesh.edges))
    np.minimum.at(thinnest, sides, wall)
    np.maximum.at(thickest, sides, wall)
    return np.flatnonzero(thickest > thinnest)


def _rigid(deck: Deck, placed: _Placed, interface: _Interface) -> None:
    """The ring and its middles move as a rigid body, walls included."""
    if isinstance(placed.mesh, SolidMesh):
        ring = placed.numbers(interface.ring).tolist()
        deck.node_set(ring, f"RING_{interface.label}", f"rigid seat of {interface.what}")
        deck.rigid_body(f"RING_{interface.label}", ring, interface.reference, interface.rotation)
        return
    edges = placed.mesh.edges_within(interface.ring)
    if not edges.size:
        raise InputError(
            f"{interface.what}: its ring has no edges, so that it cannot hold the wall",
            code="L006",
            value=f"{interface.ring.size} node(s)",
            allowed="neighbouring nodes",
        )
    on_edges = np.union1d(placed.mesh.edges[edges], placed.mesh.corners + edges)
    ring = placed.numbers(np.union1d(interface.ring, on_edges)).tolist()
    deck.node_set(ring, f"RING_{interface.label}", f"rigid ring of {interface.what}, mid-side nodes included")
    deck.rigid_body(f"RING_{interface.label}", ring, interface.reference, interface.rotation)
    for node in placed.numbers(on_edges).tolist():
        for i in (1, 2, 3):
            deck.equation((node, i + 3), {(interface.rotation, i): 1.0})


def _distributing(deck: Deck, placed: _Placed, interface: _Interface, bodies: list[Integers]) -> None:
    """The weighted mean motion of the ring is the interface's; of each of its parts if it joins several bodies.

    Six freedoms of a part follow the interface and the rest of the part. The other way round every ring tied to
    this interface would follow hundreds of freedoms, and CalculiX would fill its matrix (or fail).
    """
    members = []
    for part in bodies:
        nodes, weights = _weighted(placed, part)
        members += placed.numbers(nodes).tolist()
        mean = distributing_coupling(placed.nodes, nodes, interface.point, weights)
        mean = mean.reshape(6, -1, 6)[:, :, :3].reshape(6, -1)  # rotations of the nodes have no part
        ring = [(node, i) for node in placed.numbers(nodes).tolist() for i in (1, 2, 3)]
        free = np.array([i for i, freedom in enumerate(ring) if not deck.depends(freedom)], dtype=np.int64)
        # Mid-side nodes belong to fewer elements than corners, so that fewer of them see the ring's whole rows.
        middle = free[placed.middle[nodes[free // 3]]]
        free = middle if middle.size >= ENOUGH else free
        pivots = free[np.sort(giving_way(sp.csc_array(mean[:, free]))[0])]
        others = np.setdiff1d(np.arange(len(ring)), pivots)
        by_motion = np.linalg.inv(mean[:, pivots])
        given = (*Motion.of_nodes(interface.reference, interface.rotation).freedoms, *(ring[i] for i in others))
        motion = Motion(given, np.hstack([by_motion, -by_motion @ mean[:, others]]))
        for i, direction in zip(pivots.tolist(), np.eye(6), strict=True):
            deck.equation(ring[i], motion.along(direction))
    deck.node_set(members, f"RING_{interface.label}", f"distributing ring of {interface.what}, mid-side nodes included")


def _weighted(placed: _Placed, ring: Integers) -> tuple[Integers, Array]:
    """Nodes of a ring with middles and weights that integrate over its edges; equal ones if a node has no edge.

    Of a solid's seat the nodes with weights that integrate over its faces.
    """
    if isinstance(placed.mesh, SolidMesh):
        share = ring_weights(placed.mesh, ring)
        return ring[share > 0.0], share[share > 0.0]
    edges = placed.mesh.edges_within(ring)
    ends, middles = placed.mesh.edges[edges], placed.mesh.corners + edges
    length = np.linalg.norm(placed.nodes[ends[:, 1]] - placed.nodes[ends[:, 0]], axis=1)
    weights = np.zeros(len(placed.nodes))
    np.add.at(weights, ends.ravel(), np.repeat(END_WEIGHT * length, 2))
    if not (weights[ring] > 0.0).all():
        return ring, np.ones(ring.size)
    weights[middles] = MIDDLE_WEIGHT * length
    nodes = np.concatenate([ring, middles])
    return nodes, weights[nodes]
