"""The whole arm as one shell model: every node of every link, springs and bar in one sparse solve.

The reference of the condensed path with shell links (:mod:`fem.statics.flexibility`), and independent of its unit-load
statics. Unknowns are the reduced freedoms of each link (free nodes and interface points, body's axes), where
rigid rings are eliminated and a link's root is replaced by what it is fastened to; each joint spring has a
relative freedom of its own. The bar, pinned at both ends, lengthens by ``u . (u_pin - u_crank)``: its elongation
takes the place of one freedom of that sum, so that a rigid bar is exact too and the matrix stays positive
definite. Nothing is penalised. One pose at a time; cost and memory are those of one factorisation of all links.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from fem.elements.condensation import solve_positive_definite
from fem.elements.couplings import Coupling
from fem.elements.shell import CoupledShell, couple
from fem.model import ArmModel, LinkPart
from fem.reference.chain import Node, Unknowns, build_chain
from fem.statics.loads import as_points, as_wrenches
from fem.statics.transfers import axial_transfers
from meshes import ShellMesh, SolidMesh
from robots import InputError
from robots.arrays import Array
from robots.kinematics import as_poses, forward_kinematics, tool_position


@dataclass(frozen=True)
class ShellArmSolution:
    """Solution of the full shell model for one pose and l loads.

    ``displacement`` (l, 6): tool point, m and rad, base axes. ``links``: nodal displacements (l, k, 6) of each
    link's shell mesh by name, m and rad, base axes; "crank" is the parallelogram's crank. ``bar_force`` (l,) N,
    positive when the bar pushes the forearm; None for the serial load path. ``unknowns``: how many freedoms
    the arm has before the bar ties its pins together.
    """

    displacement: Array
    links: dict[str, Array]
    bar_force: Array | None
    unknowns: int


@dataclass
class _System(Unknowns):
    """What the parts add beside springs: links' reduced freedoms (r, columns so far) from the unknowns of one pose."""

    shells: Mapping[str, CoupledShell] = field(default_factory=dict)
    links: dict[str, tuple[CoupledShell, Array, sp.csc_array]] = field(default_factory=dict)

    def linked(self, link: LinkPart, root: Node, R: Array, origin: Array) -> dict[str, Node]:
        shell = self.shells[link.name]
        names = link.element.interfaces
        count = shell.stiffness.shape[0]
        first = count - 6 * len(names)  # the interface points come last, in the interfaces' order
        own = np.setdiff1d(np.arange(count), first + np.arange(6))
        new = self.new(own.size)
        turn = both(R[0])
        at_root = turn.T @ root.G[0]
        rows = np.concatenate([own, np.repeat(first + np.arange(6), root.freedoms.size)])
        columns = np.concatenate([new, np.tile(root.freedoms, 6)])
        values = np.concatenate([np.ones(own.size), at_root.ravel()])
        led = sp.coo_array((values, (rows, columns)), shape=(count, self.size)).tocsc()
        self.links[link.name] = (shell, R[0], sp.csc_array(shell.led_by_points() @ led))
        return {name: Node(new[first + 6 * j : first + 6 * j + 6], turn[None]) for j, name in enumerate(names[1:])}

    def reduced(self, name: str) -> sp.csc_array:
        """Reduced freedoms (r, n) of a link from all unknowns."""
        B = self.links[name][2]
        later = sp.csc_array((B.shape[0], self.size - B.shape[1]))
        return sp.csc_array(sp.hstack([B, later]))

    def matrix(self) -> sp.csc_array:
        """Stiffness (n, n) of all unknowns."""
        diagonal = np.zeros(self.size)
        for freedoms, stiffness in self.springs:
            diagonal[freedoms] = stiffness[0]
        K = sp.diags_array(diagonal, format="csc")
        for name, (shell, *_) in self.links.items():
            B = self.reduced(name)
            K = K + B.T @ shell.stiffness @ B
        return sp.csc_array(K)


def mesh_of(link: LinkPart) -> ShellMesh | SolidMesh:
    """Shell or solid mesh of a link; without one it raises an InputError."""
    if link.shell is None:
        raise InputError(
            f"link {link.name}",
            code="M003",
            value="no shell mesh",
            allowed="a model built with links='shell' or links='solid'",
        )
    return link.shell


def all_links(model: ArmModel) -> list[LinkPart]:
    """Links from base to tip, then the parallelogram's crank if it is flexible."""
    crank = None if model.bar is None else model.bar.crank
    return list(model.links) if crank is None else [*model.links, crank]


def couple_links(model: ArmModel) -> dict[str, CoupledShell]:
    """Shells of all links by name, the crank's included, coupled as the model's superelements are.

    They depend on the links alone: compute them once for many poses, springs or loads.

    Raises
    ------
    InputError
        The model has no links, or links that are not shells.
    """
    if not model.links:
        raise InputError(f"links of {model.robot.name}", code="M003", value=model.link_kind, allowed="shell, solid")
    return {link.name: couple(mesh_of(link), link.element.points, _flanges(link)) for link in all_links(model)}


def _flanges(link: LinkPart) -> dict[str, Coupling]:
    return {name: link.flanges.get(name, "rigid") for name in link.element.interfaces}


def solve_shell_arm(
    model: ArmModel,
    q: ArrayLike,
    wrench: ArrayLike,
    point: ArrayLike | None = None,
    *,
    shells: Mapping[str, CoupledShell] | None = None,
) -> ShellArmSolution:
    """Solve the assembled shell model of the whole arm for one pose.

    Parameters
    ----------
    model : built with ``links="shell"`` or ``"solid"``, either load path
    q : (dof,) rad; limits are not checked here
    wrench : (6,) or (l, 6) loads, force N and moment N m in base axes at the tool point
    point : (3,) m in the flange frame instead of the model's tool point
    shells : what :func:`couple_links` gave for these links, to save its work

    Raises
    ------
    InputError
        Shapes, values that are not finite, links that are not shells, a flat parallelogram, or an arm too close
        to a mechanism for the solver.

    Notes
    -----
    Equals :func:`fem.deflection` to round-off, which walls far stiffer than the springs enlarge to some
    1e-9 (tests/fem/reference/test_shell_arm.py).
    """
    pose, loads, at = one_pose(model, q, wrench, point)
    shells = couple_links(model) if shells is None else shells
    frames = forward_kinematics(model.robot, pose)
    tool = tool_position(model.robot, frames, at)
    list(axial_transfers(model, frames, tool))  # raises InputError if the parallelogram is flat
    system = _System(1, shells=shells)
    chain = build_chain(model, frames, pose, tool, system)
    bar = None
    if chain.pins is not None:
        crank, pin = chain.pins
        u = chain.span[0] / np.linalg.norm(chain.span[0])
        bar = np.asarray(u @ (pin.over(system.size) - crank.over(system.size))[0, :3])
    K, to_tool = system.matrix(), chain.tool.over(system.size)[0]
    force = np.asarray(to_tool.T @ loads.T)
    try:
        x = _solve(K, force, bar, 0.0 if model.bar is None else model.bar.compliance)
    except ArithmeticError as error:
        raise InputError(
            f"{model.robot.name}: {error}",
            code="B003",
            value=pose[0].tolist(),
            remedy="check the joint angles and the springs",
        ) from error
    push = None
    if bar is not None:
        pivot = int(np.argmax(np.abs(bar)))
        # Equilibrium of one freedom the bar pushes at.
        push = np.asarray((K[[pivot]] @ x)[0] - force[pivot]) / bar[pivot]
    links = {name: _nodal(system, name, x) for name in system.links}
    return ShellArmSolution(np.asarray((to_tool @ x).T), links, push, system.size)


def both(R: Array) -> Array:
    """Rotation (6, 6) of displacement and rotation, or of force and moment, by R (3, 3)."""
    return np.asarray(np.kron(np.eye(2), R), dtype=np.float64)


def one_pose(
    model: ArmModel, q: ArrayLike, wrench: ArrayLike, point: ArrayLike | None
) -> tuple[Array, Array, Array | None]:
    """Check one pose (dof,), loads (6,) or (l, 6) and a point (3,); returned as (1, dof), (l, 6) and (1, 3)."""
    pose = as_poses(model.robot, np.atleast_2d(np.asarray(q, dtype=np.float64)))
    if len(pose) != 1:
        raise InputError("poses of a full solve", code="B003", value=len(pose), allowed="one at a time")
    loads = np.asarray(wrench, dtype=np.float64)
    loads = as_wrenches(loads, len(loads) if loads.ndim == 2 else 1)
    return pose, loads, as_points(point, 1)


def _solve(K: sp.csc_array, force: Array, bar: Array | None, compliance: float) -> Array:
    """Unknowns (n, l) under ``force`` (n, l); the bar's elongation ``e = bar . x`` replaces one of them."""
    if bar is None:
        return solve_positive_definite(K, force)
    n, pivot = bar.size, int(np.argmax(np.abs(bar)))
    kept = np.delete(np.arange(n), pivot)
    used = kept[bar[kept] != 0.0]
    rows = np.concatenate([kept, np.full(used.size, pivot), [pivot]])
    columns = np.concatenate([np.arange(n - 1), np.searchsorted(kept, used), [n - 1]])
    values = np.concatenate([np.ones(n - 1), -bar[used] / bar[pivot], [1.0 / bar[pivot]]])
    Z = sp.coo_array((values, (rows, columns)), shape=(n, n)).tocsc()
    if compliance == 0.0:
        Z = Z[:, :-1]
    reduced = Z.T @ K @ Z
    if compliance > 0.0:
        reduced = reduced + sp.coo_array(([1.0 / compliance], ([n - 1], [n - 1])), shape=(n, n))
    return np.asarray(Z @ solve_positive_definite(sp.csc_array(reduced), np.asarray(Z.T @ force)))


def _nodal(system: _System, name: str, x: Array) -> Array:
    """Displacements (l, k, 6) of a link's nodes in base axes from the unknowns (n, l)."""
    shell, R = system.links[name][:2]
    local = np.asarray(shell.expansion @ (system.reduced(name) @ x))
    return np.asarray(local.T.reshape(x.shape[1], -1, 2, 3) @ R.T).reshape(x.shape[1], -1, 6)
