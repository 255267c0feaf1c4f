"""Couplings of a ring of nodes to an interface point.

*Rigid*: the ring moves as a rigid body, ``u_i = u_p + theta x (x_i - p)``, ``theta_i = theta + phi_i n_i``, so that
p's six freedoms replace the ring's. Only about the wall's normal n_i a node turns by itself: a clamp holds an edge
and its slope, while the rotation of a wall in its own plane is half its shear. It holds the section's shape and
warping: an upper bound of the stiffness of a flange. *Distributing* (the RBE3 of MSC/Nastran): p follows the
ring's displacements by weighted least squares, the ring stays free, and a force at p spreads over it with the same
resultant: a lower bound. The truth of a bolted flange lies between them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.linalg import block_diag, qr

from fem.elements.condensation import Superelement
from meshes.shell_mesh import ShellMesh
from meshes.solid_mesh import SolidMesh
from robots import InputError
from robots.arrays import Array, Integers
from robots.schema.description import FlangeCoupling

Coupling = FlangeCoupling

# A node is on a smooth wall where the normals around it share this much of one direction: folds up to 60 deg.
SMOOTH = 0.75
# Least of the ring's three spreads over the greatest: below it the nodes lie on a line and feel no twist.
SMALLEST_SPREAD = 1e-6
# Least share of a ring's motion that other rings with the same nodes leave to it; equal rings leave 1e-16.
SMALLEST_SHARE = 1e-6


def rigid_motion(offsets: Array) -> Array:
    """Motion (n, 6, 6) of points at ``offsets`` (n, 3) m on a rigid body from the body's motion at the origin."""
    x, y, z = np.moveaxis(np.asarray(offsets, dtype=np.float64), 1, 0)
    R = np.tile(np.eye(6), (len(offsets), 1, 1))
    R[:, 0, 4], R[:, 0, 5] = z, -y
    R[:, 1, 3], R[:, 1, 5] = -z, x
    R[:, 2, 3], R[:, 2, 4] = y, -x
    return R


def rigidly_at(element: Superelement, points: Array) -> Superelement:
    """A superelement whose interfaces are rigidly carried on to other points (i, 3) m."""
    if np.array_equal(points, element.points):
        return element
    T = block_diag(*rigid_motion(element.points - points))
    back = block_diag(*rigid_motion(points[1:] - element.points[1:]))
    # The root's node at rest is its point at rest.
    return replace(
        element, points=points, stiffness=T.T @ element.stiffness @ T, flexibility=back @ element.flexibility @ back.T
    )


def rigid_coupling(nodes: Array, ring: Integers, point: Array) -> Array:
    """Transformation (6r, 6) from the motion of ``point`` (3,) m to the freedoms of the ring's r nodes.

    ``nodes`` (k, 3) m. The transpose gives the resultant force and moment at the point of forces at the ring.
    """
    return rigid_motion(nodes[ring] - point).reshape(-1, 6)


def drilling_axes(mesh: ShellMesh, ring: Integers) -> Array:
    """Unit normals (r, 3) of the wall at the ring's nodes, either sense; zero at folds, where walls share a node.

    The principal axis of the normals around the node, by area.
    """
    place = np.full(len(mesh.nodes), -1)
    place[ring] = np.arange(ring.size)
    spread = np.zeros((ring.size, 3, 3))
    for cells in (mesh.triangles, mesh.quads):
        near = cells[(place[cells] >= 0).any(axis=1)]
        corners = mesh.nodes[near]
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])
        area = np.linalg.norm(normal, axis=1)[:, None, None]
        at = place[near]
        element, corner = np.nonzero(at >= 0)
        np.add.at(spread, at[element, corner], (normal[:, :, None] * normal[:, None] / area)[element])
    share, axes = np.linalg.eigh(spread)
    return np.where(share[:, 2:] > SMOOTH * share.sum(axis=1, keepdims=True), axes[:, :, 2], 0.0)


def distributing_coupling(nodes: Array, ring: Integers, point: Array, weights: Array | None = None) -> Array:
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
        raise InputError(
            "weights of a distributing coupling", code="L006", value=w.tolist(), allowed=f"{r} numbers, none negative"
        )
    centre = w @ nodes[ring] / w.sum()
    arms = nodes[ring] - centre
    spread = np.linalg.svd(np.sqrt(w)[:, None] * arms, compute_uv=False)
    if r < 3 or not spread[1] > SMALLEST_SPREAD * spread[0]:
        raise InputError(
            "a distributing coupling whose nodes lie on one line",
            code="L006",
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


def led_by(reading: sp.csc_array, follows: Array) -> sp.csc_array:
    """Change of variables x = S y under which ring motions follow points: ``reading @ x = follows @ p``.

    Six of the freedoms x give way for each ring, those that determine its motion best (QR with column pivoting);
    y is the rest of x, in its order, and then p. Rows of S that give way fill the columns of
    their ring, so that ``S.T K S`` has a full block for each ring: (3r)^2 entries for r nodes.

    Parameters
    ----------
    reading : (6g, n) motion of g rings from n freedoms
    follows : (6g, p) that motion from the points'

    Returns
    -------
    (n, n - 6g + p)

    Raises
    ------
    InputError
        Rings that share so many nodes that their points cannot move apart.
    """
    given_up, rest = giving_way(reading)
    n = reading.shape[1]
    kept = np.setdiff1d(np.arange(n), given_up)
    M, others = reading[:, given_up].toarray(), reading[:, rest].toarray()
    block = np.linalg.solve(M, np.hstack([-others, follows]))
    full = np.concatenate([np.searchsorted(kept, rest), kept.size + np.arange(follows.shape[1])])
    rows = np.concatenate([kept, np.repeat(given_up, full.size)])
    columns = np.concatenate([np.arange(kept.size), np.tile(full, given_up.size)])
    values = np.concatenate([np.ones(kept.size), block.ravel()])
    S = sp.coo_array((values, (rows, columns)), shape=(n, kept.size + follows.shape[1])).tocsc()
    S.eliminate_zeros()
    return S


def giving_way(reading: sp.csc_array) -> tuple[Integers, Integers]:
    """Freedoms (6g,) that determine the motion (6g, n) of g rings best, and the others that have a part in it.

    Raises
    ------
    InputError
        As :func:`led_by`.
    """
    count = reading.shape[0]
    used = np.flatnonzero(np.diff(reading.indptr))
    M = reading[:, used].toarray()
    # Pivots mean something only where the rows of a ring are of one size and at right angles, whatever their units.
    level = np.vstack([np.linalg.qr(rows.T)[0].T for rows in np.split(M, count // 6)])
    factor, pivots = qr(level, mode="r", pivoting=True)
    if used.size < count or not abs(factor[count - 1, count - 1]) > SMALLEST_SHARE:
        raise InputError(
            "interfaces of a shell mesh that share nodes: their points cannot move apart",
            code="L006",
            remedy="choose separate rings",
        )
    return used[pivots[:count]], np.sort(used[pivots[count:]])


def ring_weights(mesh: ShellMesh | SolidMesh, ring: Integers) -> Array:
    """Share of the ring at each node (r,), so that uneven spacing has no say; else equal.

    Of a shell half the length of the ring's edges there, of a solid what an even pressure on the seat's faces gives.
    """
    place = np.full(len(mesh.nodes), -1)
    place[ring] = np.arange(ring.size)
    if isinstance(mesh, SolidMesh):
        faces = mesh.skin[(place[mesh.skin] >= 0).all(axis=1)]
        corners = mesh.nodes[faces[:, :3]]
        area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        # All of it at the middles of the sides: the integrals of the corners' shapes vanish.
        weights = np.bincount(place[faces[:, 3:]].ravel(), np.repeat(area / 3.0, 3), minlength=ring.size)
        return np.asarray(weights, dtype=np.float64) if np.count_nonzero(weights) >= 3 else np.ones(ring.size)
    edges = mesh.edges[(place[mesh.edges] >= 0).all(axis=1)]
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    length = np.linalg.norm(mesh.nodes[edges[:, 1]] - mesh.nodes[edges[:, 0]], axis=1)
    weights = np.bincount(place[edges].ravel(), np.repeat(0.5 * length, 2), minlength=ring.size)
    return np.asarray(weights, dtype=np.float64) if (weights > 0.0).all() else np.ones(ring.size)
