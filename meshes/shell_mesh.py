"""Shell meshes of links: flat triangles and quads on the mid-surface, in the frame of the body."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from robots import InputError
from robots.arrays import Array, Integers
from robots.errors import raise_any

# Height of a corner over the element's longest edge; thinner slivers lose the digits of their own area.
SMALLEST_ASPECT = 1e-6


@dataclass(frozen=True)
class ShellMesh:
    """Mid-surface mesh with m triangles and q quads, in the body's frame.

    ``nodes`` (k, 3) m; ``triangles`` (m, 3) and ``quads`` (q, 4), corners in turn, either sense;
    ``thickness`` (m + q,) m, triangles first; ``youngs_modulus`` Pa; ``interfaces``: ring of nodes of each
    named interface, the first one being the root.

    Raises
    ------
    InputError
        Wrong shapes, numbers that are not finite, indices out of range, repeated corners, degenerate or
        folded elements, thickness or material out of range, nodes that no element uses.
    """

    name: str
    nodes: Array
    triangles: Integers
    quads: Integers
    thickness: Array
    youngs_modulus: float
    poissons_ratio: float
    interfaces: dict[str, Integers]

    def __post_init__(self) -> None:
        for check in (_shapes, _indices, _values):
            raise_any(f"shell mesh {self.name}", list(check(self)))

    @property
    def triangle_corners(self) -> Array:
        """Corners (m, 3, 3) of the triangles, m."""
        return self.nodes[self.triangles]

    @property
    def quad_corners(self) -> Array:
        """Corners (q, 4, 3) of the quads, m."""
        return self.nodes[self.quads]

    @property
    def edges(self) -> Integers:
        """All element edges (3m + 4q, 2) as pairs of nodes; an inner edge appears once for each element."""
        return np.concatenate([sides(self.triangles), sides(self.quads)])


def sides(cells: Integers) -> Integers:
    """Sides (e n, 2) of cells (e, n), each from a corner to the next one; an inner side stands there twice."""
    return np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2)


def used_only(nodes: Array, faces: Integers) -> tuple[Array, Integers]:
    """The nodes that faces use, in their order, and the faces by these nodes' numbers."""
    used, place = np.unique(faces, return_inverse=True)
    return nodes[used], place.reshape(faces.shape)


def connected(count: int, pairs: Integers) -> Integers:
    """Number of the piece (count,) that each of the nodes belongs to, where pairs (p, 2) of them are joined."""
    # Meshes are also weighed and listed, where nobody needs SciPy.
    import scipy.sparse as sp
    from scipy.sparse.csgraph import connected_components

    graph = sp.coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _shapes(mesh: ShellMesh) -> Iterator[InputError]:
    """Faults that make the arrays unreadable."""
    where = f"shell mesh {mesh.name}"
    for name, array, width in (("nodes", mesh.nodes, 3), ("triangles", mesh.triangles, 3), ("quads", mesh.quads, 4)):
        if array.ndim != 2 or array.shape[1] != width:
            yield InputError(
                f"{where}, {name}", code="L007", value=f"shape {array.shape}", allowed=f"shape (n, {width})"
            )
    elements = len(mesh.triangles) + len(mesh.quads)
    if elements == 0:
        yield InputError(f"{where} has no elements", code="L007", remedy="give triangles, quads or both")
    if mesh.thickness.shape != (elements,):
        yield InputError(
            f"{where}, thickness",
            code="L007",
            value=f"shape {mesh.thickness.shape}",
            allowed=f"shape ({elements},), one number an element, triangles first",
        )


def _indices(mesh: ShellMesh) -> Iterator[InputError]:
    """Faults of elements and interfaces as lists of nodes."""
    where, k = f"shell mesh {mesh.name}", len(mesh.nodes)
    lists = {"triangles": mesh.triangles, "quads": mesh.quads}
    lists |= {f"interface {name}": ring for name, ring in mesh.interfaces.items()}
    for name, array in lists.items():
        if not np.issubdtype(array.dtype, np.integer):
            yield InputError(f"{where}, {name}", code="L007", value=f"type {array.dtype}", allowed="whole numbers")
        elif array.size and not 0 <= array.min() <= array.max() < k:
            bad = array.min() if array.min() < 0 else array.max()
            yield InputError(f"{where}, {name}, node", code="L007", value=int(bad), allowed=f"0 to {k - 1}")
    for name, ring in mesh.interfaces.items():
        if ring.ndim != 1 or ring.size == 0 or np.unique(ring).size != ring.size:
            yield InputError(
                f"{where}, interface {name}: not a list of different nodes", code="L007", allowed="one node or more"
            )


def _values(mesh: ShellMesh) -> Iterator[InputError]:
    """Faults of geometry, thickness and material."""
    where = f"shell mesh {mesh.name}"
    if not np.isfinite(mesh.nodes).all():
        row = int(np.flatnonzero(~np.isfinite(mesh.nodes).all(axis=1))[0])
        yield InputError(f"{where}, node {row}", code="L007", value=mesh.nodes[row].tolist(), allowed="finite numbers")
        return
    unused = np.ones(len(mesh.nodes), dtype=bool)
    unused[mesh.triangles] = unused[mesh.quads] = False
    if unused.any():
        yield InputError(
            f"{where}: {int(unused.sum())} node(s) belong to no element, the first is node {int(np.argmax(unused))}",
            code="L007",
            remedy="remove them: nothing holds their freedoms",
        )
    kinds = {"triangle": mesh.triangle_corners, "quad": mesh.quad_corners}
    yield from _element_faults(where, kinds, mesh.thickness, mesh.youngs_modulus, mesh.poissons_ratio)


def _element_faults(
    where: str, kinds: Mapping[str, Array], thickness: Array, youngs_modulus: float, poissons_ratio: float
) -> Iterator[InputError]:
    """Faults of elements by their corners, thickness and material."""
    for name, corners in kinds.items():
        flat = np.flatnonzero(~(_aspect(corners) >= SMALLEST_ASPECT))
        if flat.size:
            yield InputError(
                f"{where}: {flat.size} {name}(s) without area, folded, not convex or not finite, the first is {name} "
                f"{flat[0]}",
                code="L007",
                value=f"corners {corners[flat[0]].tolist()} m",
                remedy="merge double nodes and remesh slivers",
            )
    solid = np.isfinite(thickness) & (thickness > 0.0)
    if not solid.all():
        bad = int(np.argmin(solid))
        value = float(thickness[bad])
        yield InputError(f"{where}, thickness of element {bad} (m)", code="L007", value=value, allowed="greater than 0")
    if not 0.0 < youngs_modulus < np.inf:
        yield InputError(f"{where}, Young's modulus (Pa)", code="L007", value=youngs_modulus, allowed="greater than 0")
    if not -1.0 < poissons_ratio < 0.5:
        yield InputError(f"{where}, Poisson's ratio", code="L007", value=poissons_ratio, allowed="between -1 and 0.5")


def refuse_bad_elements(
    name: str, corners: Array, sides: int, thickness: Array, youngs_modulus: float, poissons_ratio: float
) -> None:
    """Raise InputError where corners are not (e, sides, 3), thickness is not (e,), or for what a mesh refuses too."""
    if corners.ndim != 3 or corners.shape[1:] != (sides, 3):
        raise InputError(
            f"corners of {name} shells", code="L007", value=f"shape {corners.shape}", allowed=f"shape (e, {sides}, 3)"
        )
    if thickness.shape != corners.shape[:1]:
        raise InputError(
            f"thickness of {name} shells",
            code="L007",
            value=f"shape {thickness.shape}",
            allowed=f"shape ({len(corners)},)",
        )
    for fault in _element_faults(f"{name} shells", {name: corners}, thickness, youngs_modulus, poissons_ratio):
        raise fault


def _aspect(corners: Array) -> Array:
    """Smallest corner height over the longest edge (e,), negative where a quad is folded or not convex."""
    ahead = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(ahead, np.roll(ahead, -1, axis=1))
    mean = normal.sum(axis=1, keepdims=True)
    size = np.linalg.norm(mean, axis=2, keepdims=True)
    height = (normal * (mean / np.where(size > 0.0, size, 1.0))).sum(axis=2).min(axis=1, initial=np.inf)
    longest = (ahead**2).sum(axis=2).max(axis=1, initial=0.0)
    return np.asarray(height / np.where(longest > 0.0, longest, 1.0))
