"""The reference: direct stiffness assembly of the same parts, batched over poses.

Every flexible link enters with its stiffness matrix, every joint spring with a relative freedom of its
own, the bar with its force as an unknown (so a rigid bar is exact too). Rigid connections are
eliminated, not penalised. Slower than :mod:`fem.statics.flexibility` and independent of its unit-load statics.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise, product

import numpy as np

from fem.elements import beam
from fem.model import ArmModel, LinkPart, independent_springs
from fem.statics.inputs import as_points, as_wrenches
from robots import InputError
from robots.arrays import Array, Integers
from robots.kinematics import as_poses, forward_kinematics, tool_position

# Systems solved at once; measured best among 16 to 1024 (benchmarks/statics/fast_path.py), and 1e5 of them would
# fill 2 GB.
CHUNK = 256


@dataclass(frozen=True)
class _Node:
    """A node's displacement as a combination of the unknowns: u = G x[freedoms]; G (n, 6, k)."""

    freedoms: Integers
    G: Array


@dataclass
class _System:
    """Unknowns and stiffness contributions, collected part by part."""

    n: int
    size: int = 0
    blocks: list[tuple[Integers, Array]] = field(default_factory=list)

    def new(self, count: int) -> Integers:
        self.size += count
        return np.arange(self.size - count, self.size)

    def free_node(self) -> _Node:
        return _Node(self.new(6), np.broadcast_to(np.eye(6), (self.n, 6, 6)))

    def matrix(self) -> Array:
        K = np.zeros((self.n, self.size, self.size))
        for freedoms, block in self.blocks:
            # Freedoms come in a few runs of consecutive numbers; slices add faster than index arrays.
            cuts = [0, *(np.flatnonzero(np.diff(freedoms) != 1) + 1), len(freedoms)]
            runs = [(slice(i, j), slice(freedoms[i], freedoms[j - 1] + 1)) for i, j in pairwise(cuts)]
            for (rows, to_rows), (columns, to_columns) in product(runs, runs):
                K[:, to_rows, to_columns] += block[:, rows, columns]
        return K


def compliance_direct(model: ArmModel, q: Array, point: Array | None = None, *, condensed: bool = True) -> Array:
    """Cartesian compliance (n, 6, 6) at the tool point by direct stiffness.

    ``condensed=False`` assembles every beam element instead of the superelements. Same units, frame and
    errors as :func:`fem.statics.flexibility.compliance`, except that a flat parallelogram is not looked for.
    """
    model.without_housings("direct stiffness method")
    q = as_poses(model.robot, q)
    points = as_points(point, len(q))
    out = np.empty((len(q), 6, 6))
    for rows in _batches(len(q)):
        at = None if points is None else points[rows]
        K, G = assemble_direct(model, q[rows], at, condensed=condensed)
        out[rows] = G @ np.linalg.solve(K, np.swapaxes(G, 1, 2))
    return out


def deflection_direct(model: ArmModel, q: Array, wrench: Array, point: Array | None = None) -> Array:
    """Tool displacement (n, 6) under a wrench (6,) or (n, 6), by direct stiffness.

    Same arguments, units and errors as :func:`fem.statics.flexibility.deflection`, except that a flat parallelogram
    is not looked for.
    """
    model.without_housings("direct stiffness method")
    q = as_poses(model.robot, q)
    points, loads = as_points(point, len(q)), as_wrenches(wrench, len(q))
    out = np.empty((len(q), 6))
    for rows in _batches(len(q)):
        K, G = assemble_direct(model, q[rows], None if points is None else points[rows])
        load = np.swapaxes(G, 1, 2) @ loads[rows, :, None]
        out[rows] = (G @ np.linalg.solve(K, load))[:, :, 0]
    return out


def _batches(n: int) -> Iterator[slice]:
    for start in range(0, n, CHUNK):
        yield slice(start, min(start + CHUNK, n))


def assemble_direct(
    model: ArmModel, q: Array, point: Array | None = None, *, condensed: bool = True
) -> tuple[Array, Array]:
    """Assemble the system matrix (n, m, m) and the tool's displacement as (n, 6, m) times the unknowns."""
    frames = forward_kinematics(model.robot, q)
    tool = tool_position(model.robot, frames, point)
    rotations = np.ascontiguousarray(frames.R)
    system = _System(len(q))
    links = {link.body: link for link in model.links}
    p = model.robot.parallelogram if model.bar is not None else None
    node = _Node(np.zeros(0, dtype=np.int64), np.zeros((len(q), 6, 0)))
    node = _in_axes(system, rotations[:, 0], node, *independent_springs(model.base))
    at = np.zeros((len(q), 3))
    crank_node = pin_node = None
    for body in range(model.robot.dof + 1):
        R, origin = rotations[:, body], frames.p[:, body]
        tip = frames.p_flange if body == model.robot.dof else frames.p[:, body + 1]
        if body > 0:
            node = _carry(node, origin - at)
            joint = body - 1
            if p is not None and joint == p.crank_about:
                R_crank = rotations[:, p.driven + 1]
                turned = _turn(system, model, frames.axis[:, p.driven], node, p.driven, q)
                crank_node = _crank(system, model, turned, R_crank, condensed)
            free = p is not None and joint == p.driven
            R_joint = R @ model.robot.R_post[joint].T
            if model.joints[joint].is_coupled:
                node = _coupled(system, model, R_joint, node, joint, q)
            else:
                node = _turn(system, model, frames.axis[:, joint], node, joint, q, free=free)
                node = _other_directions(system, model, R_joint, node, joint)
        link = links.get(body)
        ends = {} if link is None else _flexible(system, link, node, R, condensed)
        if p is not None and body == p.driven + 1:
            pin_node = ends.get("pin", _carry(node, R @ p.pin))
        node, at = ends.get("tip", _carry(node, tip - origin)), tip
    if p is not None and model.bar is not None and crank_node is not None and pin_node is not None:
        _bar(system, model, crank_node, pin_node, frames.p[:, p.driven + 1] - frames.p[:, p.crank_about + 1])
    own = tool_position(model.robot, frames)
    node = _carry(node, own - at)
    node = _in_axes(system, np.ascontiguousarray(frames.R_flange), node, *independent_springs(model.tool))
    node = _carry(node, tool - own)
    G = np.zeros((len(q), 6, system.size))
    G[:, :, node.freedoms] = node.G
    return system.matrix(), G


def _carry(node: _Node, r: Array) -> _Node:
    """Displace a point rigidly connected, r (n, 3) away: u + theta x r."""
    X = np.zeros((len(r), 6, 6))
    X[:] = np.eye(6)
    X[:, 0, 4], X[:, 0, 5] = r[:, 2], -r[:, 1]
    X[:, 1, 3], X[:, 1, 5] = -r[:, 2], r[:, 0]
    X[:, 2, 3], X[:, 2, 4] = r[:, 1], -r[:, 0]
    return _Node(node.freedoms, X @ node.G)


def _relative(system: _System, node: _Node, directions: Array, stiffness: Array) -> _Node:
    """Add relative freedoms along ``directions`` (n, 6, k) with spring constants (n, k)."""
    new = system.new(directions.shape[2])
    system.blocks.append((new, stiffness[:, :, None] * np.eye(len(new))))
    return _Node(np.concatenate([node.freedoms, new]), np.concatenate([node.G, directions], axis=2))


def _turn(
    system: _System, model: ArmModel, axis: Array, node: _Node, joint: int, q: Array, *, free: bool = False
) -> _Node:
    """Turn about the joint's axis against its spring (or freely, as a parallelogram's elbow does)."""
    compliance = model.joints[joint].axial.compliance(q)
    if not free and not compliance.any():
        return node
    stiffness = np.zeros(len(q)) if free else 1.0 / compliance
    direction = np.concatenate([np.zeros_like(axis), axis], axis=1)[:, :, None]
    return _relative(system, node, direction, stiffness[:, None])


def _other_directions(system: _System, model: ArmModel, R: Array, node: _Node, joint: int) -> _Node:
    directions, stiffness = model.joints[joint].springs()
    return _in_axes(system, R, node, directions, stiffness)


def _in_axes(system: _System, R: Array, node: _Node, directions: Array, stiffness: Array) -> _Node:
    """Springs along constant ``directions`` (6, k) in axes R (n, 3, 3)."""
    if stiffness.size == 0:
        return node
    turned = np.concatenate([R @ directions[:3], R @ directions[3:]], axis=1)
    return _relative(system, node, turned, np.broadcast_to(stiffness, (len(R), stiffness.size)))


def _coupled(system: _System, model: ArmModel, R: Array, node: _Node, joint: int, q: Array) -> _Node:
    """A joint whose axis and bearing are coupled: C = L L^T, and springs of stiffness one along the columns of L."""
    part = model.joints[joint]
    C = np.repeat(part.bearing[None], len(q), axis=0)
    C[:, 5, 5] = part.axial.compliance(q)
    size = np.sqrt(np.maximum(np.diagonal(C, axis1=1, axis2=2), 1e-300))
    values, vectors = np.linalg.eigh(C / (size[:, :, None] * size[:, None, :]))
    L = size[:, :, None] * vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    return _relative(system, node, np.concatenate([R @ L[:, :3], R @ L[:, 3:]], axis=1), np.ones((len(q), 6)))


def _flexible(system: _System, link: LinkPart, root: _Node, R: Array, condensed: bool) -> dict[str, _Node]:
    """Add a link's stiffness between its root and new nodes; returns the nodes of its other interfaces."""
    if condensed:
        K, names = link.element.stiffness, dict.fromkeys(link.element.interfaces)
        index = {name: i for i, name in enumerate(names)}
    elif link.shell is not None:
        raise InputError(
            f"full assembly of link {link.name}",
            value="shell",
            allowed="beam links, or condensed=True",
            remedy="use fem.solve_shell_arm",
        )
    else:
        K, index = beam.assemble(link.mesh).toarray(), link.mesh.interfaces
    count = len(K) // 6
    nodes = [root if i == index["root"] else system.free_node() for i in range(count)]
    freedoms = np.unique(np.concatenate([node.freedoms for node in nodes]))
    G = np.zeros((system.n, 6 * count, len(freedoms)))
    local = np.swapaxes(R, 1, 2)
    for i, node in enumerate(nodes):
        columns = np.searchsorted(freedoms, node.freedoms)
        G[:, 6 * i : 6 * i + 3, columns] = local @ node.G[:, :3]
        G[:, 6 * i + 3 : 6 * i + 6, columns] = local @ node.G[:, 3:]
    system.blocks.append((freedoms, np.swapaxes(G, 1, 2) @ K @ G))
    return {name: nodes[i] for name, i in index.items() if name != "root"}


def _crank(system: _System, model: ArmModel, node: _Node, R: Array, condensed: bool) -> _Node:
    assert model.bar is not None and model.robot.parallelogram is not None  # noqa: S101, PT018
    if model.bar.crank is None:
        return _carry(node, R @ model.robot.parallelogram.pin)
    return _flexible(system, model.bar.crank, node, R, condensed)["tip"]


def _bar(system: _System, model: ArmModel, crank: _Node, pin: _Node, span: Array) -> None:
    """Add the bar's force N as an unknown: its elongation u . (u_pin - u_crank) is c N.

    ``span``: from crank pin to forearm pin.
    """
    assert model.bar is not None  # noqa: S101
    u = span / np.linalg.norm(span, axis=1)[:, None]
    force = system.new(1)
    for node, sign in ((pin, 1.0), (crank, -1.0)):
        row = sign * np.einsum("ni,nik->nk", u, node.G[:, :3])
        block = np.zeros((system.n, len(node.freedoms) + 1, len(node.freedoms) + 1))
        block[:, :-1, -1] = block[:, -1, :-1] = row
        system.blocks.append((np.concatenate([node.freedoms, force]), block))
    system.blocks.append((force, np.full((system.n, 1, 1), -model.bar.compliance)))
