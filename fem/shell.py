"""Shell meshes as mechanics: assembly, rings coupled to interface points, condensation to superelements.

A ring of nodes meets its interface point p by one of two couplings. *Rigid*: the ring moves as a rigid body,
``u_i = u_p + theta x (x_i - p)``, ``theta_i = theta``, so that p's six freedoms replace the ring's. It holds the
section's shape and warping: an upper bound of the stiffness of a flange. *Distributing* (the RBE3 of
MSC/Nastran): p follows the ring's displacements by weighted least squares, the ring stays free, and a force
at p spreads over it with the same resultant: a lower bound. The truth of a bolted flange lies between them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from fem.condensation import Superelement, solve_positive_definite
from fem.shell_quad import quad_stiffness
from fem.shell_triangle import triangle_stiffness
from meshes.shell_mesh import ShellMesh
from robots import InputError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Coupling = Literal["rigid", "distributing"]

# Least of the ring's three spreads over the greatest: below it the nodes lie on a line and feel no twist.
SMALLEST_SPREAD = 1e-6
# Round-off makes the flexibility of casings asymmetric by 1e-14 to 1e-11 (walls of 0.5 mm, 50 000 freedoms).
ASYMMETRY = 1e-7


def assemble_shell(mesh: ShellMesh) -> sp.csc_array:
    """Stiffness of the whole free mesh, (6k, 6k), six freedoms a node (u, rotation), body's axes."""
    first_quad = len(mesh.triangles)
    material = (mesh.youngs_modulus, mesh.poissons_ratio)
    parts = []
    if first_quad:
        seam = beside_quads(mesh)
        K = triangle_stiffness(mesh.triangle_corners, *material, mesh.thickness[:first_quad], seam)
        parts.append(_scatter(K, mesh.triangles))
    if len(mesh.quads):
        K = quad_stiffness(mesh.quad_corners, *material, mesh.thickness[first_quad:])
        parts.append(_scatter(K, mesh.quads))
    values, rows, columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    size = 6 * len(mesh.nodes)
    return sp.coo_array((values, (rows, columns)), shape=(size, size)).tocsc()


def beside_quads(mesh: ShellMesh) -> NDArray[np.bool_]:
    """Which sides (m, 3) of the triangles are quads' sides too."""
    edges = np.sort(mesh.edges, axis=1)
    key = edges[:, 0] * np.int64(len(mesh.nodes)) + edges[:, 1]
    first_quad = 3 * len(mesh.triangles)
    return np.isin(key[:first_quad], key[first_quad:]).reshape(-1, 3)


def _scatter(K: Array, elements: Indices) -> tuple[Array, NDArray[np.int32], NDArray[np.int32]]:
    """Values, rows and columns of element matrices (e, 6n, 6n) in the global one."""
    dofs = freedoms(elements).reshape(len(elements), -1).astype(np.int32)
    n = dofs.shape[1]
    return K.ravel(), np.repeat(dofs, n, axis=1).ravel(), np.tile(dofs, (1, n)).ravel()


def freedoms(nodes: Indices) -> Indices:
    """Numbers (..., 6) of the freedoms of nodes (...)."""
    return np.asarray(6 * np.asarray(nodes, dtype=np.int64)[..., None] + np.arange(6))


def rigid_motion(offsets: Array) -> Array:
    """Motion (n, 6, 6) of points at ``offsets`` (n, 3) m on a rigid body from the body's motion at the origin."""
    x, y, z = np.moveaxis(np.asarray(offsets, dtype=np.float64), 1, 0)
    R = np.tile(np.eye(6), (len(offsets), 1, 1))
    R[:, 0, 4], R[:, 0, 5] = z, -y
    R[:, 1, 3], R[:, 1, 5] = -z, x
    R[:, 2, 3], R[:, 2, 4] = y, -x
    return R


def rigid_coupling(nodes: Array, ring: Indices, point: Array) -> Array:
    """Transformation (6r, 6) from the motion of ``point`` (3,) m to the freedoms of the ring's r nodes.

    ``nodes`` (k, 3) m. The transpose gives the resultant force and moment at the point of forces at the ring.
    """
    return rigid_motion(nodes[ring] - point).reshape(-1, 6)


def distributing_coupling(nodes: Array, ring: Indices, point: Array, weights: Array | None = None) -> Array:
    """Weighted mean motion (6, 6r) at ``point`` (3,) m of the freedoms of the ring's r nodes.

    Displacement and rotation are those of the rigid motion that fits the nodes' displacements best by least
    squares with ``weights`` (r,), by default all equal; nodes' own rotations have no part. The transpose
    distributes a wrench at the point over the ring with exactly that force and moment.

    Raises
    ------
    InputError
        Fewer than three nodes with weight, all on one line, or weights that are negative or not finite.
    """
    r = len(ring)
    w = np.ones(r) if weights is None else np.asarray(weights, dtype=np.float64)
    if w.shape != (r,) or not np.isfinite(w).all() or (w < 0.0).any() or not w.any():
        raise InputError("weights of a distributing coupling", value=w.tolist(), allowed=f"{r} numbers, none negative")
    centre = w @ nodes[ring] / w.sum()
    arms = nodes[ring] - centre
    spread = np.linalg.svd(np.sqrt(w)[:, None] * arms, compute_uv=False)
    if r < 3 or not spread[1] > SMALLEST_SPREAD * spread[0]:
        raise InputError(
            "a distributing coupling whose nodes lie on one line",
            value=f"{r} node(s)",
            allowed="three nodes or more that span a surface",
            remedy="choose more nodes or the rigid coupling",
        )
    # Fitted about the centre and scaled by the ring's size, where displacement and rotation do not mix.
    size = spread[0] / np.sqrt(w.sum())
    fit = rigid_motion(arms / size)[:, :3]
    moments = np.einsum("r,rki,rkj->ij", w, fit, fit)
    mean = np.zeros((6, r, 6))
    mean[..., :3] = np.linalg.solve(moments, np.einsum("r,rki->irk", w, fit).reshape(6, -1)).reshape(6, r, 3)
    mean[3:] /= size
    return np.asarray(rigid_motion((point - centre)[None])[0] @ mean.reshape(6, -1))


@dataclass(frozen=True)
class CoupledShell:
    """A shell mesh whose i interfaces are coupled to points; n reduced freedoms.

    ``nodes`` (k, 3) m. ``expansion`` (6k, n): the mesh's freedoms from the reduced ones. ``stiffness`` (n, n).
    ``reading`` (6i, n): motion of the interface points, root first; its transpose applies wrenches there.
    ``points`` (i, 3) m. ``held`` (6,): reduced freedoms that hold the body in place without strain.
    """

    nodes: Array
    expansion: sp.csc_array
    stiffness: sp.csc_array
    reading: sp.csc_array
    points: Array
    held: Indices

    @property
    def transport(self) -> Array:
        """Motion (6(i-1), 6) of the other interfaces as a rigid body moves with the root."""
        return rigid_motion(self.points[1:] - self.points[0]).reshape(-1, 6)

    def modes(self) -> tuple[Array, Array]:
        """Solve once for unit wrenches at the other interfaces, reaction at the root.

        Returns
        -------
        shapes : (6k, 6(i-1)) displacements of the mesh, the root point at rest
        flexibility : (6(i-1), 6(i-1)) motion of the other interface points, the root point at rest

        Raises
        ------
        ArithmeticError
            The stiffness is singular to working precision.
        """
        # Wrenches with their reaction at the root balance, so whatever holds the body carries nothing.
        relative = np.asarray(self.reading[6:].toarray() - self.transport @ self.reading[:6].toarray())
        free = np.setdiff1d(np.arange(self.stiffness.shape[0]), self.held)
        reduced = np.zeros((self.stiffness.shape[0], len(relative)))
        reduced[free] = solve_positive_definite(self.stiffness[free][:, free], relative[:, free].T.copy())
        flexibility = relative @ reduced
        scale = np.sqrt(np.abs(np.diag(flexibility)))
        if not (np.abs(flexibility - flexibility.T) <= ASYMMETRY * scale[:, None] * scale).all():
            raise ArithmeticError("the flexibility has lost its symmetry to round-off")
        root = self.reading[:6] @ reduced
        shapes = self.expansion @ reduced - rigid_motion(self.nodes - self.points[0]).reshape(-1, 6) @ root
        return np.asarray(shapes), 0.5 * (flexibility + flexibility.T)


def couple(mesh: ShellMesh, points: Array, coupling: Coupling | Mapping[str, Coupling] = "rigid") -> CoupledShell:
    """Couple the interfaces of a mesh to ``points`` (i, 3) m, in the order of ``mesh.interfaces``, root first.

    ``coupling``: one kind for all interfaces, or one by name.

    Raises
    ------
    InputError
        Points do not match the interfaces, unknown coupling, rigid rings that share nodes, a ring on a line
        with a distributing coupling, or a mesh that falls apart into several bodies.
    """
    points, rings = np.asarray(points, dtype=np.float64), list(mesh.interfaces.values())
    kinds = _kinds(mesh, points, coupling)
    rigid = [j for j, kind in enumerate(kinds) if kind == "rigid"]
    _check_one_body(mesh, [rings[j] for j in rigid])
    T = _expansion(mesh, {j: rings[j] for j in rigid}, points)
    first_master = T.shape[1] - 6 * len(rigid)
    blocks = []
    for j, (ring, kind) in enumerate(zip(rings, kinds, strict=True)):
        if kind == "rigid":
            blocks.append(_columns(np.eye(6), first_master + 6 * rigid.index(j) + np.arange(6), T.shape[1]))
        else:
            mean = distributing_coupling(mesh.nodes, ring, points[j], _edge_weights(mesh, ring))
            blocks.append(_columns(mean, freedoms(ring).ravel(), T.shape[0]) @ T)
    reading = sp.csc_array(sp.vstack(blocks))
    # Any six freedoms of one point will do; rings made rigid hold best, else a node of the root's ring.
    held = first_master + np.arange(6) if rigid else freedoms(rings[0][:1]).ravel()
    K = sp.csc_array(T.T @ assemble_shell(mesh) @ T)
    return CoupledShell(mesh.nodes, T, K, reading, points, held)


def shell_superelement(
    mesh: ShellMesh, points: Array, coupling: Coupling | Mapping[str, Coupling] = "rigid"
) -> Superelement:
    """Exact static condensation of a shell mesh to its interface points, root first.

    Arguments and errors as in :func:`couple`, and fewer than two interfaces or walls so thin that round-off
    eats the result are an InputError too. One factorisation: the free stiffness is ``G f^-1 G^T`` with the
    flexibility f and statics G.
    """
    if len(mesh.interfaces) < 2:
        raise InputError(f"shell mesh {mesh.name}", value=f"{len(mesh.interfaces)} interface(s)", allowed="2 or more")
    shell = couple(mesh, points, coupling)
    try:
        _, flexibility = shell.modes()
    except ArithmeticError as error:
        raise InputError(
            f"shell mesh {mesh.name}: {error}",
            value=f"thickness {mesh.thickness.min():.3g} to {mesh.thickness.max():.3g} m",
            remedy="look for walls far too thin and for slivers",
        ) from error
    statics = np.hstack([-shell.transport, np.eye(len(flexibility))]).T
    stiffness = statics @ np.linalg.solve(flexibility, statics.T)
    return Superelement(mesh.name, tuple(mesh.interfaces), shell.points, 0.5 * (stiffness + stiffness.T), flexibility)


def _kinds(mesh: ShellMesh, points: Array, coupling: Coupling | Mapping[str, Coupling]) -> list[Coupling]:
    """Coupling of each interface, checked with the points."""
    names = list(mesh.interfaces)
    if points.shape != (len(names), 3) or not np.isfinite(points).all():
        raise InputError(
            f"interface points of shell mesh {mesh.name}",
            value=f"shape {points.shape}" if np.isfinite(points).all() else points.tolist(),
            allowed=f"finite, shape ({len(names)}, 3), m, for {', '.join(names)}",
        )
    by_name: Mapping[str, Coupling] = dict.fromkeys(names, coupling) if isinstance(coupling, str) else coupling
    wrong = {name: by_name.get(name) for name in names if by_name.get(name) not in ("rigid", "distributing")}
    if wrong or set(by_name) - set(names):
        raise InputError(
            f"coupling of shell mesh {mesh.name}",
            value=dict(by_name),
            allowed=f"'rigid' or 'distributing' for {', '.join(names)}",
        )
    return [by_name[name] for name in names]


def _expansion(mesh: ShellMesh, rigid: Mapping[int, Indices], points: Array) -> sp.csc_array:
    """Mesh freedoms from those of the free nodes, then six for each rigid ring (6k, n)."""
    k = len(mesh.nodes)
    tied = np.concatenate([np.zeros(0, np.int64), *rigid.values()])
    if np.unique(tied).size != tied.size:
        raise InputError(
            f"rigid interfaces of shell mesh {mesh.name} share nodes",
            remedy="choose separate rings, or the distributing coupling for one of them",
        )
    kept = freedoms(np.setdiff1d(np.arange(k), tied)).ravel()
    rows, columns, values = [kept], [np.arange(kept.size)], [np.ones(kept.size)]
    for number, (j, ring) in enumerate(rigid.items()):
        rows.append(np.repeat(freedoms(ring).ravel(), 6))
        columns.append(np.tile(kept.size + 6 * number + np.arange(6), 6 * ring.size))
        values.append(rigid_coupling(mesh.nodes, ring, points[j]).ravel())
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sp.coo_array(entries, shape=(6 * k, kept.size + 6 * len(rigid))).tocsc()


def _columns(block: Array, columns: Indices, width: int) -> sp.csc_array:
    """Spread a dense block (6, c) over the given columns of (6, width)."""
    rows = np.repeat(np.arange(len(block)), columns.size)
    return sp.coo_array((block.ravel(), (rows, np.tile(columns, len(block)))), shape=(len(block), width)).tocsc()


def _edge_weights(mesh: ShellMesh, ring: Indices) -> Array:
    """Half the length of the ring's edges at each node (r,), so that uneven spacing has no say; else equal."""
    place = np.full(len(mesh.nodes), -1)
    place[ring] = np.arange(ring.size)
    edges = mesh.edges[(place[mesh.edges] >= 0).all(axis=1)]
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    length = np.linalg.norm(mesh.nodes[edges[:, 1]] - mesh.nodes[edges[:, 0]], axis=1)
    weights = np.bincount(place[edges].ravel(), np.repeat(0.5 * length, 2), minlength=ring.size)
    return np.asarray(weights, dtype=np.float64) if (weights > 0.0).all() else np.ones(ring.size)


def _check_one_body(mesh: ShellMesh, rigid: Sequence[Indices]) -> None:
    """Refuse meshes in pieces; rigid rings join what they hold."""
    links = [mesh.edges, *[np.stack([np.full(ring.size, ring[0]), ring], axis=1) for ring in rigid]]
    rows, columns = np.concatenate(links).T
    graph = sp.coo_array((np.ones(rows.size), (rows, columns)), shape=(len(mesh.nodes),) * 2)
    bodies, label = connected_components(graph, directed=False)
    if bodies > 1:
        raise InputError(
            f"shell mesh {mesh.name}",
            value=f"{bodies} separate bodies of {np.bincount(label).tolist()} nodes",
            allowed="one body",
            remedy="merge the nodes where the bodies touch, or drop the loose ones",
        )
