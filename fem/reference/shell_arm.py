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
from fem.elements.couplings import Coupling, rigid_motion
from fem.elements.shell import CoupledShell, couple
from fem.model import ArmModel, LinkPart, independent_springs
from fem.statics.inputs import as_points, as_wrenches
from fem.statics.transfers import axial_transfers
from meshes import ShellMesh
from robots import InputError
from robots.arrays import Array, Integers
from robots.kinematics import BodyFrames, as_poses, forward_kinematics, tool_position


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


@dataclass(frozen=True)
class _Node:
    """A point's displacement as a combination of the unknowns: u = G x[freedoms]; G (6, k)."""

    freedoms: Integers
    G: Array

    def carried(self, r: Array) -> _Node:
        """Displacement of a point rigidly connected, r (3,) m away."""
        return _Node(self.freedoms, rigid_motion(r[None])[0] @ self.G)

    def over(self, size: int) -> Array:
        """G over all unknowns (6, size)."""
        G = np.zeros((6, size))
        G[:, self.freedoms] = self.G
        return G


@dataclass
class _System:
    """What the parts add: unknowns, links' reduced freedoms (r, columns so far) from them, springs."""

    size: int = 0
    links: dict[str, tuple[CoupledShell, Array, sp.csc_array]] = field(default_factory=dict)
    springs: list[tuple[int, float]] = field(default_factory=list)

    def new(self, count: int) -> Integers:
        self.size += count
        return np.arange(self.size - count, self.size)

    def relative(self, node: _Node, directions: Array, stiffness: Array) -> _Node:
        """Add freedoms along ``directions`` (6, k) with spring constants (k,)."""
        new = self.new(len(stiffness))
        self.springs += zip(new.tolist(), stiffness.tolist(), strict=True)
        return _Node(np.concatenate([node.freedoms, new]), np.hstack([node.G, directions]))

    def link(self, link: LinkPart, shell: CoupledShell, root: _Node, R: Array) -> dict[str, _Node]:
        """Fasten a link to its root; returns the nodes of its other interfaces."""
        names = link.element.interfaces
        count = shell.stiffness.shape[0]
        first = count - 6 * len(names)  # the interface points come last, in the interfaces' order
        own = np.setdiff1d(np.arange(count), first + np.arange(6))
        new = self.new(own.size)
        turn = both(R)
        at_root = turn.T @ root.G
        rows = np.concatenate([own, np.repeat(first + np.arange(6), root.freedoms.size)])
        columns = np.concatenate([new, np.tile(root.freedoms, 6)])
        values = np.concatenate([np.ones(own.size), at_root.ravel()])
        led = sp.coo_array((values, (rows, columns)), shape=(count, self.size)).tocsc()
        self.links[link.name] = (shell, R, sp.csc_array(shell.led_by_points() @ led))
        return {name: _Node(new[first + 6 * j : first + 6 * j + 6], turn) for j, name in enumerate(names[1:])}

    def reduced(self, name: str) -> sp.csc_array:
        """Reduced freedoms (r, n) of a link from all unknowns."""
        B = self.links[name][2]
        later = sp.csc_array((B.shape[0], self.size - B.shape[1]))
        return sp.csc_array(sp.hstack([B, later]))

    def matrix(self) -> sp.csc_array:
        """Stiffness (n, n) of all unknowns."""
        diagonal = np.zeros(self.size)
        for freedom, stiffness in self.springs:
            diagonal[freedom] = stiffness
        K = sp.diags_array(diagonal, format="csc")
        for name, (shell, *_) in self.links.items():
            B = self.reduced(name)
            K = K + B.T @ shell.stiffness @ B
        return sp.csc_array(K)


def shell_of(link: LinkPart) -> ShellMesh:
    """Shell mesh of a link; without one it raises an InputError."""
    if link.shell is None:
        raise InputError(f"link {link.name}", value="no shell mesh", allowed="a model built with links='shell'")
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
        raise InputError(f"links of {model.robot.name}", value=model.link_kind, allowed="shell")
    return {link.name: couple(shell_of(link), link.element.points, _flanges(link)) for link in all_links(model)}


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
    model : built with ``links="shell"``, either load path
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
    Equals :func:`fem.statics.flexibility.deflection` to round-off, which walls far stiffer than the springs enlarge to
    some 1e-9 (tests/fem/reference/test_shell_arm.py).
    """
    model.without_housings("solution of the whole shell arm")
    pose, loads, at = one_pose(model, q, wrench, point)
    shells = couple_links(model) if shells is None else shells
    frames = forward_kinematics(model.robot, pose)
    tool = tool_position(model.robot, frames, at)
    list(axial_transfers(model, frames, tool))  # raises InputError if the parallelogram is flat
    system = _System()
    end, bar = _assemble(system, model, shells, frames, pose, tool[0])
    K, to_tool = system.matrix(), end.over(system.size)
    force = np.asarray(to_tool.T @ loads.T)
    try:
        x = _solve(K, force, bar, 0.0 if model.bar is None else model.bar.compliance)
    except ArithmeticError as error:
        raise InputError(
            f"{model.robot.name}: {error}", value=pose[0].tolist(), remedy="check the joint angles and the springs"
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
        raise InputError("poses of a full solve", value=len(pose), allowed="one at a time")
    loads = np.asarray(wrench, dtype=np.float64)
    loads = as_wrenches(loads, len(loads) if loads.ndim == 2 else 1)
    return pose, loads, as_points(point, 1)


def _assemble(
    system: _System, model: ArmModel, shells: Mapping[str, CoupledShell], frames: BodyFrames, q: Array, tool: Array
) -> tuple[_Node, Array | None]:
    """Walk down the chain; returns the tool's node and the bar's elongation as a row (n,) of the unknowns."""
    robot = model.robot
    links = {link.body: link for link in model.links}
    p = robot.parallelogram if model.bar is not None else None
    R, origin, axis = frames.R[0], frames.p[0], frames.axis[0]
    node, at = _Node(np.zeros(0, dtype=np.int64), np.zeros((6, 0))), np.zeros(3)
    node = _in_axes(system, R[0], node, *independent_springs(model.base))
    crank = pin = None
    for body in range(robot.dof + 1):
        tip = frames.p_flange[0] if body == robot.dof else origin[body + 1]
        if body > 0:
            joint = body - 1
            node = node.carried(origin[body] - at)
            if p is not None and joint == p.crank_about:
                turned = _turn(system, model, axis[p.driven], node, p.driven, q)
                crank = _crank(system, model, shells, turned, R[p.driven + 1])
            free = p is not None and joint == p.driven
            R_joint = R[body] @ robot.R_post[joint].T
            if model.joints[joint].is_coupled:
                node = _coupled(system, model, R_joint, node, joint, q)
            else:
                node = _turn(system, model, axis[joint], node, joint, q, free=free)
                node = _other_directions(system, model, R_joint, node, joint)
        link = links.get(body)
        ends = {} if link is None else system.link(link, shells[link.name], node, R[body])
        if p is not None and body == p.driven + 1:
            pin = ends.get("pin", node.carried(R[body] @ p.pin))
        node, at = ends.get("tip", node.carried(tip - origin[body])), tip
    own = tool_position(robot, frames)[0]
    node = node.carried(own - at)
    node = _in_axes(system, frames.R_flange[0], node, *independent_springs(model.tool)).carried(tool - own)
    if p is None or crank is None or pin is None:
        return node, None
    u = origin[p.driven + 1] - origin[p.crank_about + 1]
    return node, u @ (pin.over(system.size) - crank.over(system.size))[:3] / np.linalg.norm(u)


def _turn(
    system: _System, model: ArmModel, axis: Array, node: _Node, joint: int, q: Array, *, free: bool = False
) -> _Node:
    """Turn about the joint's axis against its spring (or freely, as a parallelogram's elbow does)."""
    compliance = model.joints[joint].axial.compliance(q)[:1]
    if not free and not compliance.any():
        return node
    direction = np.concatenate([np.zeros(3), axis])[:, None]
    return system.relative(node, direction, np.zeros(1) if free else 1.0 / compliance)


def _other_directions(system: _System, model: ArmModel, R: Array, node: _Node, joint: int) -> _Node:
    return _in_axes(system, R, node, *model.joints[joint].springs())


def _in_axes(system: _System, R: Array, node: _Node, directions: Array, stiffness: Array) -> _Node:
    """Springs along constant ``directions`` (6, k) in axes R (3, 3)."""
    return system.relative(node, both(R) @ directions, stiffness)


def _coupled(system: _System, model: ArmModel, R: Array, node: _Node, joint: int, q: Array) -> _Node:
    """A joint whose axis and bearing are coupled."""
    part = model.joints[joint]
    C = part.bearing.copy()
    C[5, 5] = part.axial.compliance(q)[0]
    return _in_axes(system, R, node, *independent_springs(C))


def _crank(system: _System, model: ArmModel, shells: Mapping[str, CoupledShell], node: _Node, R: Array) -> _Node:
    assert model.bar is not None and model.robot.parallelogram is not None  # noqa: S101, PT018 - the caller knows
    crank = model.bar.crank
    if crank is None:
        return node.carried(R @ model.robot.parallelogram.pin)
    return system.link(crank, shells[crank.name], node, R)["tip"]


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
