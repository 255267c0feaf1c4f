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
        faces = self.tetrahedra[:, FACES].reshape(-1, 6)
        _, first, count = np.unique(np.sort(faces[:, :3], axis=1), axis=0, return_index=True, return_counts=True)
        return np.asarray(faces[np.sort(first[count == 1])])


def with_middles(nodes: Array, corners: Integers) -> tuple[Array, Integers]:
    """Ten-noded tetrahedra with straight edges from four-noded ones: nodes (k, 3), tetrahedra (e, 10)."""
    ends, place = np.unique(np.sort(corners[:, EDGES].reshape(-1, 2), axis=1), axis=0, return_inverse=True)
    middles = len(nodes) + place.reshape(-1, len(EDGES))
    return np.vstack([nodes, nodes[ends].mean(axis=1)]), np.hstack([corners, middles])


def _shapes(mesh: SolidMesh) -> Iterator[InputError]:
    where = f"solid mesh {mesh.name}"
    for name, array, width in (("nodes", mesh.nodes, 3), ("tetrahedra", mesh.tetrahedra, 10)):
        if array.ndim != 2 or array.shape[1] != width or not len(array):
            yield InputError(f"{where}, {name}", value=f"shape {array.shape}", allowed=f"shape (n, {width}), n > 0")
    lists = {"tetrahedra": mesh.tetrahedra} | {f"interface {name}": ring for name, ring in mesh.interfaces.items()}
    for name, array in lists.items():
        if not np.issubdtype(array.dtype, np.integer):
            yield InputError(f"{where}, {name}", value=f"type {array.dtype}", allowed="whole numbers")
        elif array.size and not 0 <= array.min() <= array.max() < len(mesh.nodes):
            yield InputError(f"{where}, {name}", value=int(array.max()), allowed=f"0 to {len(mesh.nodes) - 1}")
    for name, ring in mesh.interfaces.items():
        if ring.ndim != 1 or ring.size == 0 or np.unique(ring).size != ring.size:
            yield InputError(f"{where}, interface {name}: not a list of different nodes", allowed="one node or more")


def _values(mesh: SolidMesh) -> Iterator[InputError]:
    where = f"solid mesh {mesh.name}"
    if not np.isfinite(mesh.nodes).all():
        row = int(np.flatnonzero(~np.isfinite(mesh.nodes).all(axis=1))[0])
        yield InputError(f"{where}, node {row}", value=mesh.nodes[row].tolist(), allowed="finite numbers")
    unused = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.tetrahedra)
    if unused.size:
        yield InputError(
            f"{where}: {unused.size} node(s) belong to no element, the first is node {unused[0]}",
            remedy="remove them: nothing holds their freedoms",
        )
    if not 0.0 < mesh.youngs_modulus < np.inf:
        yield InputError(f"{where}, Young's modulus (Pa)", value=mesh.youngs_modulus, allowed="greater than 0")
    if not -1.0 < mesh.poissons_ratio < 0.5:
        yield InputError(f"{where}, Poisson's ratio", value=mesh.poissons_ratio, allowed="between -1 and 0.5")
