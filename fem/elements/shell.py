"""Meshes of links as mechanics, shells or solids: interfaces coupled to points, condensation to superelements.

A solid's nodes have rotations too in what is handed around, so that one code serves both; they are zero, and no
reduced freedom moves them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import block_diag

from fem.elements.assembly import assemble_link, freedoms
from fem.elements.condensation import Superelement, is_solution, solve_positive_definite
from fem.elements.couplings import (
    Coupling,
    distributing_coupling,
    drilling_axes,
    giving_way,
    led_by,
    rigid_coupling,
    rigid_motion,
    ring_weights,
)
from meshes.shell_mesh import ShellMesh, connected
from meshes.solid_mesh import SolidMesh
from robots import InputError, require_at_least
from robots.arrays import Array, Integers

LinkMesh = ShellMesh | SolidMesh

# Round-off makes the flexibility of casings asymmetric by 1e-14 to 1e-11 (walls of 0.5 mm, 50 000 freedoms).
ASYMMETRY = 1e-7


@dataclass(frozen=True)
class CoupledShell:
    """A link's mesh whose i interfaces are coupled to points; n reduced freedoms.

    ``nodes`` (k, 3) m. ``expansion`` (6k, n): the mesh's freedoms from the reduced ones. ``stiffness`` (n, n).
    ``reading`` (6i, n): motion of the interface points, root first; its transpose applies wrenches there.
    ``points`` (i, 3) m. ``held`` (6,): reduced freedoms that hold the body in place without strain.
    """

    nodes: Array
    expansion: sp.csc_array
    stiffness: sp.csc_array
    reading: sp.csc_array
    points: Array
    held: Integers

    @property
    def transport(self) -> Array:
        """Motion (6(i-1), 6) of the other interfaces as a rigid body moves with the root."""
        return rigid_motion(self.points[1:] - self.points[0]).reshape(-1, 6)

    def led_by_points(self) -> sp.csc_array:
        """Change of variables (n, n): reduced freedoms from others that end with the points' motion, root first.

        Six freedoms of each ring give way to the motion of its point; those of a rigid ring are that motion
        already. The stiffness in the new freedoms, ``S.T @ stiffness @ S``, has a full block for each distributing
        ring: (3r)^2 entries for r nodes.
        """
        return led_by(self.reading, np.eye(6 * len(self.points)))

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
        reduced, flexibility = self.solution()
        root = self.reading[:6] @ reduced
        shapes = self.expansion @ reduced - rigid_motion(self.nodes - self.points[0]).reshape(-1, 6) @ root
        return np.asarray(shapes), flexibility

    def solution(self) -> tuple[Array, Array]:
        """As :meth:`modes`, but the reduced freedoms (n, 6(i-1)), of which six are held."""
        relative = self._relative()
        free = np.setdiff1d(np.arange(self.stiffness.shape[0]), self.held)
        reduced = np.zeros((self.stiffness.shape[0], len(relative)))
        reduced[free] = solve_positive_definite(self.stiffness[free][:, free], relative[:, free].T.copy())
        flexibility = relative @ reduced
        scale = np.sqrt(np.abs(np.diag(flexibility)))
        if not (np.abs(flexibility - flexibility.T) <= ASYMMETRY * scale[:, None] * scale).all():
            raise ArithmeticError("the flexibility has lost its symmetry to round-off")
        return reduced, 0.5 * (flexibility + flexibility.T)

    def solves(self, reduced: Array, wrench: Array, motion: Array) -> bool:
        """Whether reduced freedoms (n,) are in equilibrium with a wrench (6(i-1),) and show this motion (6(i-1),).

        One product instead of a solve: it tells whether a flexibility that was kept is this shell's, as far as it
        makes ``motion`` of ``wrench``.
        """
        relative = self._relative()
        loads = relative.T @ wrench
        # What round-off may have taken from the flexibility's symmetry.
        unsure = ASYMMETRY * float(np.sum(np.abs(wrench * motion)))
        apart = np.abs(relative @ reduced - motion) * np.abs(wrench)
        return bool((apart <= unsure).all()) and is_solution(self.stiffness, reduced[:, None], loads[:, None])

    def _relative(self) -> Array:
        """Motion (6(i-1), n) of the other interface points to the root's; its transpose, wrenches with reaction.

        They balance, so whatever holds the body carries nothing.
        """
        return np.asarray(self.reading[6:].toarray() - self.transport @ self.reading[:6].toarray())


def couple(mesh: LinkMesh, points: Array, coupling: Coupling | Mapping[str, Coupling] = "rigid") -> CoupledShell:
    """Couple the interfaces of a mesh to ``points`` (i, 3) m, in the order of ``mesh.interfaces``, root first.

    ``coupling``: one kind for all interfaces, or one by name. A distributing ring on several bodies (the two tubes
    of a driven link meet at its root alone) joins them: each body's part follows the point by itself.

    Raises
    ------
    InputError
        Points do not match the interfaces, unknown coupling, rigid rings that share nodes, rings that share so many
        that their points cannot move apart, a ring on a line with a distributing coupling, or a mesh that falls
        apart into bodies that no ring joins.
    """
    points, rings = np.asarray(points, dtype=np.float64), list(mesh.interfaces.values())
    kinds = _kinds(mesh, points, coupling)
    rigid = [j for j, kind in enumerate(kinds) if kind == "rigid"]
    parts = ring_parts(mesh, rings, kinds)
    T = _expansion(mesh, {j: rings[j] for j in rigid}, points)
    first_master = T.shape[1] - 6 * len(rigid)
    reading = []
    for j, (point, kind) in enumerate(zip(points, kinds, strict=True)):
        if kind == "rigid":
            reading.append(_columns(np.eye(6), first_master + 6 * rigid.index(j) + np.arange(6), T.shape[1]))
            continue
        means = [distributing_coupling(mesh.nodes, part, point, ring_weights(mesh, part)) for part in parts[j]]
        spread = [_columns(M, freedoms(part).ravel(), T.shape[0]) for M, part in zip(means, parts[j], strict=True)]
        reading.append(sp.csc_array(sp.vstack(spread) @ T))
    # Any six freedoms of one point will do; rings that lead hold best, else a node of the root's ring, or where nodes
    # have no rotations of their own six freedoms that say how the root moves.
    if rigid:
        held = first_master + np.arange(6)
    else:
        held = freedoms(rings[0][:1]).ravel() if isinstance(mesh, ShellMesh) else giving_way(reading[0][:6])[0]
    joints = [j for j, pieces in enumerate(parts) if len(pieces) > 1]
    if joints:
        T, reading, held = _joined(T, reading, joints)
    motion = sp.csc_array(sp.vstack(reading))
    giving_way(motion)
    # By rows throughout, and its rows for columns in the end: it is symmetric, and no product needs a conversion.
    free, moved = assemble_link(mesh)
    by_rows = T.tocsr() if moved.size == T.shape[0] else T.tocsr()[moved]
    K = sp.csc_array((by_rows.T.tocsr() @ free.T @ by_rows).T)
    return CoupledShell(mesh.nodes, T, K, motion, points, held)


def shell_superelement(
    mesh: LinkMesh, points: Array, coupling: Coupling | Mapping[str, Coupling] = "rigid"
) -> Superelement:
    """Exact static condensation of a shell or solid mesh to its interface points, root first.

    Arguments and errors as in :func:`couple`, and fewer than two interfaces or walls so thin that round-off
    eats the result are an InputError too. One factorisation: the free stiffness is ``G f^-1 G^T`` with the
    flexibility f and statics G.
    """
    _, flexibility = shell_solution(mesh, couple(mesh, points, coupling))
    return superelement(mesh, points, flexibility)


def shell_solution(mesh: LinkMesh, shell: CoupledShell) -> tuple[Array, Array]:
    """:meth:`CoupledShell.solution` of a mesh; errors as of :func:`shell_superelement`."""
    require_at_least(f"interfaces of {mesh_kind(mesh)} mesh {mesh.name}", len(mesh.interfaces), 2, code="L006")
    try:
        return shell.solution()
    except ArithmeticError as error:
        value, remedy = None, "choose another element size: the mesh has slivers"
        if isinstance(mesh, ShellMesh):
            value = f"thickness {mesh.thickness.min():.3g} to {mesh.thickness.max():.3g} m"
            remedy = "look for walls far too thin and for slivers"
        raise InputError(
            f"{mesh_kind(mesh)} mesh {mesh.name}: {error}", code="L006", value=value, remedy=remedy
        ) from error


def mesh_kind(mesh: LinkMesh) -> str:
    """What messages call it."""
    return "shell" if isinstance(mesh, ShellMesh) else "solid"


def superelement(mesh: LinkMesh, points: Array, flexibility: Array) -> Superelement:
    """The superelement of a mesh whose flexibility (6(i-1), 6(i-1)) between ``points`` (i, 3) is known."""
    points = np.asarray(points, dtype=np.float64)
    transport = rigid_motion(points[1:] - points[0]).reshape(-1, 6)
    statics = np.hstack([-transport, np.eye(len(flexibility))]).T
    stiffness = statics @ np.linalg.solve(flexibility, statics.T)
    return Superelement(mesh.name, tuple(mesh.interfaces), points, 0.5 * (stiffness + stiffness.T), flexibility)


def _kinds(mesh: LinkMesh, points: Array, coupling: Coupling | Mapping[str, Coupling]) -> list[Coupling]:
    """Coupling of each interface, checked with the points."""
    names = list(mesh.interfaces)
    if points.shape != (len(names), 3) or not np.isfinite(points).all():
        raise InputError(
            f"interface points of {mesh_kind(mesh)} mesh {mesh.name}",
            code="L006",
            value=f"shape {points.shape}" if np.isfinite(points).all() else points.tolist(),
            allowed=f"finite, shape ({len(names)}, 3), m, for {', '.join(names)}",
        )
    by_name: Mapping[str, Coupling] = dict.fromkeys(names, coupling) if isinstance(coupling, str) else coupling
    wrong = {name: by_name.get(name) for name in names if by_name.get(name) not in ("rigid", "distributing")}
    if wrong or set(by_name) - set(names):
        raise InputError(
            f"coupling of {mesh_kind(mesh)} mesh {mesh.name}",
            code="L006",
            value=dict(by_name),
            allowed=f"'rigid' or 'distributing' for {', '.join(names)}",
        )
    return [by_name[name] for name in names]


def _expansion(mesh: LinkMesh, rigid: Mapping[int, Integers], points: Array) -> sp.csc_array:
    """Mesh freedoms (6k, n) from those of free nodes, drilling rotations of rigid rings, then six for each ring."""
    k = len(mesh.nodes)
    tied = np.concatenate([np.zeros(0, np.int64), *rigid.values()])
    if np.unique(tied).size != tied.size:
        raise InputError(
            f"rigid interfaces of {mesh_kind(mesh)} mesh {mesh.name} share nodes",
            code="L006",
            remedy="choose separate rings, or the distributing coupling for one of them",
        )
    own = 6 if isinstance(mesh, ShellMesh) else 3
    kept = freedoms(np.setdiff1d(np.arange(k), tied))[:, :own].ravel()
    rows, columns, values = [kept], [np.arange(kept.size)], [np.ones(kept.size)]
    first_master = kept.size
    if isinstance(mesh, ShellMesh):
        axes = drilling_axes(mesh, tied)
        smooth = axes.any(axis=1)
        first_master += int(smooth.sum())
        rows.append(freedoms(tied[smooth])[:, 3:].ravel())
        columns.append(np.repeat(np.arange(kept.size, first_master), 3))
        values.append(axes[smooth].ravel())
    for number, (j, ring) in enumerate(rigid.items()):
        rows.append(np.repeat(freedoms(ring)[:, :own].ravel(), 6))
        columns.append(np.tile(first_master + 6 * number + np.arange(6), own * ring.size))
        values.append(rigid_coupling(mesh.nodes, ring, points[j]).reshape(-1, 6, 6)[:, :own].ravel())
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sp.coo_array(entries, shape=(6 * k, first_master + 6 * len(rigid))).tocsc()


def _columns(block: Array, columns: Integers, width: int) -> sp.csc_array:
    """Spread a dense block (6, c) over the given columns of (6, width)."""
    rows = np.repeat(np.arange(len(block)), columns.size)
    return sp.coo_array((block.ravel(), (rows, np.tile(columns, len(block)))), shape=(len(block), width)).tocsc()


def _joined(
    T: sp.csc_array, reading: list[sp.csc_array], joints: list[int]
) -> tuple[sp.csc_array, list[sp.csc_array], Integers]:
    """Let the points of ``joints`` lead all parts of their rings; new expansion, readings and held freedoms."""
    rows = sp.csc_array(sp.vstack([reading[j] for j in joints]))
    follows = [np.tile(np.eye(6), (reading[j].shape[0] // 6, 1)) for j in joints]
    S = led_by(rows, block_diag(*follows))
    lead = S.shape[1] - 6 * len(joints) + np.arange(6 * len(joints)).reshape(-1, 6)
    reading = [
        _columns(np.eye(6), lead[joints.index(j)], S.shape[1]) if j in joints else sp.csc_array(rows @ S)
        for j, rows in enumerate(reading)
    ]
    return sp.csc_array(T @ S), reading, lead[0]


def ring_parts(mesh: LinkMesh, rings: list[Integers], kinds: list[Coupling]) -> list[list[Integers]]:
    """Each ring's parts that only the ring itself joins: one for a rigid ring; refuses bodies that nothing joins."""
    pairs = [np.stack([np.full(ring.size, ring[0]), ring], axis=1) for ring in rings]
    rigid = [pair for pair, kind in zip(pairs, kinds, strict=True) if kind == "rigid"]
    bodies, whole = (connected(len(mesh.nodes), np.concatenate([mesh.edges, *some])) for some in (rigid, pairs))
    if whole.max() > 0:
        raise InputError(
            f"{mesh_kind(mesh)} mesh {mesh.name}",
            code="L007",
            value=f"{whole.max() + 1} separate bodies of {np.bincount(whole).tolist()} nodes",
            allowed="one body",
            remedy="merge the nodes where the bodies touch, or drop the loose ones",
        )
    return [[ring[bodies[ring] == body] for body in np.unique(bodies[ring])] for ring in rings]
