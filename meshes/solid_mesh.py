"""Solid meshes of links: ten-noded tetrahedra, in the frame of the body."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robots import InputError
from robots.arrays import Array, Integers
from robots.errors import raise_any

# Corners of a tetrahedron's edges, in the order of its middle nodes; corners and middles of its faces, outward.
EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
FACES = np.array([[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6]])


@dataclass(frozen=True)
class SolidMesh:
    """Tetrahedra with straight or curved edges, e elements, in the body's frame.

    ``nodes`` (k, 3) m; ``tetrahedra`` (e, 10): corners, right-handed, then the middles of the edges 01, 12, 02, 03,
    13, 23; ``youngs_modulus`` Pa; ``interfaces``: nodes of each named interface's seat, the first one being the root.

    Raises
    ------
    InputError
        Wrong shapes, numbers that are not finite, indices out of range, material out of range, nodes that no element
        uses.
    """

    name: str
    nodes: Array
    tetrahedra: Integers
    youngs_modulus: float
    poissons_ratio: float
    interfaces: dict[str, Integers]

    def __post_init__(self) -> None:
        for check in (_shapes, _values):
            raise_any(f"solid mesh {self.name}", list(check(self)))

    @property
    def edges(self) -> Integers:
        """Pairs of nodes that elements join: each edge's corners and middle, once for each element (12 e, 2)."""
        corners = self.tetrahedra[:, EDGES]
        middles = self.tetrahedra[:, 4:, None]
        pairs = np.concatenate([np.concatenate([corners[..., i : i + 1], middles], axis=2) for i in (0, 1)], axis=1)
        return np.asarray(pairs.reshape(-1, 2))

    @property
    def skin(self) -> Integers:
        """Faces (f, 6) that one element has alone: corners counterclockwise seen from outside, then the middles."""
        return outer_faces(self.tetrahedra)[0]


def outer_faces(tetrahedra: Integers) -> tuple[Integers, Integers]:
    """Faces (f, 6) of ten-noded tetrahedra that one of them has alone (:attr:`SolidMesh.skin`), and which one (f,)."""
    faces = tetrahedra[:, FACES].reshape(-1, 6)
    corners = np.sort(faces[:, :3], axis=1)
    # One number a face: sorting those takes a tenth of the time.
    count = int(corners.max()) + 1
    key = (corners[:, 0] * count + corners[:, 1]) * count + corners[:, 2]
    _, first, times = np.unique(key, return_index=True, return_counts=True)
    outer = np.sort(first[times == 1])
    return np.asarray(faces[outer]), np.asarray(outer // len(FACES))


def least_jacobian(nodes: Array, tetrahedra: Integers) -> Array:
    """Least Jacobian of each element (e,) at corners and centre over that of its straight one; 1 where it is straight.

    Negative: turned inside out. NaN: no volume.
    """
    corners = nodes[tetrahedra]
    straight = np.linalg.det(corners[:, 1:4] - corners[:, :1])
    at = np.vstack([np.eye(4), np.full((1, 4), 0.25)])
    least = np.full(len(tetrahedra), np.inf)
    for share in at:
        # Slopes of the shapes by the four shares; the first is one less the others.
        slopes = np.zeros((10, 4))
        slopes[:4] = np.diag(4.0 * share - 1.0)
        for middle, (i, j) in enumerate(EDGES):
            slopes[4 + middle, i], slopes[4 + middle, j] = 4.0 * share[j], 4.0 * share[i]
        jacobian = np.einsum("eni,nj->eji", corners, slopes[:, 1:] - slopes[:, :1], optimize=True)
        least = np.minimum(least, np.linalg.det(jacobian))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(straight > 0.0, least / straight, -1.0))


def untangled(nodes: Array, tetrahedra: Integers, least: float = 0.2) -> Array:
    """Nodes with less curved edges, in the end straight ones, where edges all but turn an element inside out."""
    done = nodes.copy()
    for keep in (0.7, 0.7, 0.7, 0.5, 0.5, 0.0, 0.0):
        bad = tetrahedra[least_jacobian(done, tetrahedra) < least]
        if not len(bad):
            break
        ends = 0.5 * done[bad[:, EDGES]].sum(axis=2)
        done[bad[:, 4:]] = keep * done[bad[:, 4:]] + (1.0 - keep) * ends
    return done


def with_middles(nodes: Array, corners: Integers) -> tuple[Array, Integers]:
    """Ten-noded tetrahedra with straight edges from four-noded ones: nodes (k, 3), tetrahedra (e, 10)."""
    ends, place = np.unique(np.sort(corners[:, EDGES].reshape(-1, 2), axis=1), axis=0, return_inverse=True)
    middles = len(nodes) + place.reshape(-1, len(EDGES))
    return np.vstack([nodes, nodes[ends].mean(axis=1)]), np.hstack([corners, middles])


def _shapes(mesh: SolidMesh) -> Iterator[InputError]:
    where = f"solid mesh {mesh.name}"
    for name, array, width in (("nodes", mesh.nodes, 3), ("tetrahedra", mesh.tetrahedra, 10)):
        if array.ndim != 2 or array.shape[1] != width or not len(array):
            yield InputError(
                f"{where}, {name}", code="L007", value=f"shape {array.shape}", allowed=f"shape (n, {width}), n > 0"
            )
    lists = {"tetrahedra": mesh.tetrahedra} | {f"interface {name}": ring for name, ring in mesh.interfaces.items()}
    for name, array in lists.items():
        if not np.issubdtype(array.dtype, np.integer):
            yield InputError(f"{where}, {name}", code="L007", value=f"type {array.dtype}", allowed="whole numbers")
        elif array.size and not 0 <= array.min() <= array.max() < len(mesh.nodes):
            yield InputError(
                f"{where}, {name}", code="L007", value=int(array.max()), allowed=f"0 to {len(mesh.nodes) - 1}"
            )
    for name, ring in mesh.interfaces.items():
        if ring.ndim != 1 or ring.size == 0 or np.unique(ring).size != ring.size:
            yield InputError(
                f"{where}, interface {name}: not a list of different nodes", code="L007", allowed="one node or more"
            )


def _values(mesh: SolidMesh) -> Iterator[InputError]:
    where = f"solid mesh {mesh.name}"
    if not np.isfinite(mesh.nodes).all():
        row = int(np.flatnonzero(~np.isfinite(mesh.nodes).all(axis=1))[0])
        yield InputError(f"{where}, node {row}", code="L007", value=mesh.nodes[row].tolist(), allowed="finite numbers")
    unused = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.tetrahedra)
    if unused.size:
        yield InputError(
            f"{where}: {unused.size} node(s) belong to no element, the first is node {unused[0]}",
            code="L007",
            remedy="remove them: nothing holds their freedoms",
        )
    if not 0.0 < mesh.youngs_modulus < np.inf:
        yield InputError(
            f"{where}, Young's modulus (Pa)", code="L007", value=mesh.youngs_modulus, allowed="greater than 0"
        )
    if not -1.0 < mesh.poissons_ratio < 0.5:
        yield InputError(
            f"{where}, Poisson's ratio", code="L007", value=mesh.poissons_ratio, allowed="between -1 and 0.5"
        )
