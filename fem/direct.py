"""The reference: direct stiffness assembly of the same parts, batched over poses.

Every flexible link enters with its stiffness matrix, every joint spring with a relative freedom of its
own, the bar with its force as an unknown (so a rigid bar is exact too). Rigid connections are
eliminated, not penalised. Slower than :mod:`fem.statics` and independent of its unit-load statics.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fem import beam
from fem.model import ArmModel, LinkPart
from robots.kinematics import as_poses, forward_kinematics, tool_position

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Node:
    """A node's displacement as a combination of the unknowns: u = G x[freedoms]; G (n, 6, k)."""

    freedoms: NDArray[np.int64]
    G: Array


@dataclass
class _System:
    """Unknowns and stiffness contributions, collected part by part."""

    n: int
    size: int = 0
    blocks: list[tuple[NDArray[np.int64], Array]] = field(default_factory=list)

    def new(self, count: int) -> NDArray[np.int64]:
        self.size += count
        return np.arange(self.size - count, self.size)

    def free_node(self) -> _Node:
        return _Node(self.new(6), np.broadcast_to(np.eye(6), (self.n, 6, 6)))

    def matrix(self) -> Array:
        K = np.zeros((self.n, self.size, self.size))
        for freedoms, block in self.blocks:
            K[:, freedoms[:, None], freedoms] += block
        return K


def compliance_direct(model: ArmModel, q: Array, point: Array | None = None, *, condensed: bool = True) -> Array:
    """Cartesian compliance (n, 6, 6) at the tool point by direct stiffness.

    ``condensed=False`` assembles every beam element instead of the superelements. Same units and frame
    as :func:`fem.statics.compliance`.
    """
    K, G = assemble_direct(model, q, point, condensed=condensed)
    loads = np.swapaxes(G, 1, 2)
    return np.asarray(G @ np.linalg.solve(K, loads))


def deflection_direct(model: ArmModel, q: Array, wrench: Array, point: Array | None = None) -> Array:
    """Tool displacement (n, 6) under a wrench (6,) or (n, 6), by direct stiffness."""
    K, G = assemble_direct(model, q, point)
    w = np.broadcast_to(wrench, (len(K), 6))
    load = np.einsum("nik,ni->nk", G, w)
    return np.asarray(np.einsum("nik,nk->ni", G, np.linalg.solve(K, load[:, :, None])[:, :, 0]))


def assemble_direct(
    model: ArmModel, q: Array, point: Array | None = None, *, condensed: bool = True
) -> tuple[Array, Array]:
    """System matrix (n, m, m) and the tool's displacement as (n, 6, m) times the unknowns."""
    q = as_poses(model.robot, q)
    frames = forward_kinematics(model.robot, q)
    tool = tool_position(model.robot, frames, point)
    system = _System(len(q))
    links = {link.body: link for link in model.links}
    p = model.robot.parallelogram if model.bar is not None else None
    node = _Node(np.zeros(0, dtype=np.int64), np.zeros((len(q), 6, 0)))
    at = np.zeros((len(q), 3))
    crank_node = pin_node = None
    for body in range(model.robot.dof + 1):
        R, origin = frames.R[:, body], frames.p[:, body]
        tip = frames.p_flange if body == model.robot.dof else frames.p[:, body + 1]
        if body > 0:
            node = _carry(node, origin - at)
            joint = body - 1
            if p is not None and joint == p.crank_about:
                R_crank = frames.R[:, p.driven + 1]
                turned = _turn(system, model, frames.axis[:, p.driven], node, p.driven, q)
                crank_node = _crank(system, model, turned, R_crank, condensed)
            free = p is not None and joint == p.driven
            node = _turn(system, model, frames.axis[:, joint], node, joint, q, free=free)
            node = _other_directions(system, model, R @ model.robot.R_post[joint].T, node, joint)
        link = links.get(body)
        ends = {} if link is None else _flexible(system, link, node, R, condensed)
        if p is not None and body == p.driven + 1:
            pin_node = ends.get("pin", _carry(node, R @ p.pin))
        node, at = ends.get("tip", _carry(node, tip - origin)), tip
    if p is not None and model.bar is not None and crank_node is not None and pin_node is not None:
        _bar(system, model, crank_node, pin_node, frames.p[:, p.driven + 1] - frames.p[:, p.crank_about + 1])
    node = _carry(node, tool - at)
    G = np.zeros((len(q), 6, system.size))
    G[:, :, node.freedoms] = node.G
    return system.matrix(), G


def _carry(node: _Node, r: Array) -> _Node:
    """The displacement at a point rigidly connected, r (n, 3) away: u + theta x r."""
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
    """The joint's rotation about its axis, with its spring (or free, as a parallelogram's elbow is)."""
    compliance = model.joints[joint].axial.compliance(q)
    if not free and not compliance.any():
        return node
    stiffness = np.zeros(len(q)) if free else 1.0 / compliance
    direction = np.concatenate([np.zeros_like(axis), axis], axis=1)[:, :, None]
    return _relative(system, node, direction, stiffness[:, None])


def _other_directions(system: _System, model: ArmModel, R: Array, node: _Node, joint: int) -> _Node:
    other = model.joints[joint].other
    kept = np.flatnonzero(other)
    if kept.size == 0:
        return node
    directions = np.zeros((len(R), 6, 5))
    directions[:, :3, :3] = R
    directions[:, 3:, 3:] = R[:, :, :2]
    return _relative(system, node, directions[:, :, kept], np.broadcast_to(1.0 / other[kept], (len(R), kept.size)))


def _flexible(
    system: _System, link: LinkPart, root: _Node, R: Array, condensed: bool
) -> dict[str, _Node]:
    """Add a link's stiffness between its root and new nodes; returns the nodes of its other interfaces."""
    if condensed:
        K, names = link.element.stiffness, dict.fromkeys(link.element.interfaces)
        index = {name: i for i, name in enumerate(names)}
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


def _crank(
    system: _System, model: ArmModel, node: _Node, R: Array, condensed: bool
) -> _Node:
    assert model.bar is not None and model.robot.parallelogram is not None  # noqa: S101, PT018
    if model.bar.crank is None:
        return _carry(node, R @ model.robot.parallelogram.pin)
    return _flexible(system, model.bar.crank, node, R, condensed)["tip"]


def _bar(system: _System, model: ArmModel, crank: _Node, pin: _Node, span: Array) -> None:
    """The bar's force N as an unknown: elongation u . (u_pin - u_crank) + c N = 0, pushed ends apart."""
    assert model.bar is not None  # noqa: S101
    u = span / np.linalg.norm(span, axis=1)[:, None]
    force = system.new(1)
    for node, sign in ((pin, 1.0), (crank, -1.0)):
        row = sign * np.einsum("ni,nik->nk", u, node.G[:, :3])
        block = np.zeros((system.n, len(node.freedoms) + 1, len(node.freedoms) + 1))
        block[:, :-1, -1] = block[:, -1, :-1] = row
        system.blocks.append((np.concatenate([node.freedoms, force]), block))
    system.blocks.append((force, np.full((system.n, 1, 1), -model.bar.compliance)))
