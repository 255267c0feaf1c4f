"""Direct stiffness assembly of the same parts as the statics have, batched over poses.

Every flexible link enters with its stiffness matrix, every spring with a relative freedom of its own, the bar with its
force as an unknown (so a rigid bar is exact too). Rigid connections are eliminated, not penalised. Slower than
:func:`fem.compliance` and independent of its unit-load statics; it covers all that a model can hold.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise, product

import numpy as np

from fem.elements import beam
from fem.model import ArmModel, LinkPart
from fem.reference.chain import Node, Unknowns, build_chain
from fem.statics.loads import as_points, as_wrenches
from robots import InputError
from robots.arrays import Array, Integers, in_blocks
from robots.kinematics import as_poses, forward_kinematics, tool_position

# Systems solved at once; measured best among 16 to 1024 (benchmarks/statics/fast_path.py), and 1e5 of them would
# fill 2 GB.
CHUNK = 256


@dataclass
class _System(Unknowns):
    """Unknowns and stiffness contributions, collected part by part; links condensed or with all their elements."""

    condensed: bool = True
    blocks: list[tuple[Integers, Array]] = field(default_factory=list)

    def free_node(self) -> Node:
        return Node(self.new(6), np.broadcast_to(np.eye(6), (self.n, 6, 6)))

    def linked(self, link: LinkPart, root: Node, R: Array, origin: Array) -> dict[str, Node]:
        """Add a link's stiffness between its root and new nodes."""
        if self.condensed:
            K, names = link.element.stiffness, dict.fromkeys(link.element.interfaces)
            index = {name: i for i, name in enumerate(names)}
        elif link.shell is not None:
            raise InputError(
                f"full assembly of link {link.name}",
                code="B003",
                value="shell or solid",
                allowed="beam links, or condensed=True",
                remedy="use fem.solve_shell_arm",
            )
        else:
            K, index = beam.assemble(link.mesh).toarray(), link.mesh.interfaces
        count = len(K) // 6
        nodes = [root if i == index["root"] else self.free_node() for i in range(count)]
        freedoms = np.unique(np.concatenate([node.freedoms for node in nodes]))
        G = np.zeros((self.n, 6 * count, len(freedoms)))
        local = np.swapaxes(R, 1, 2)
        for i, node in enumerate(nodes):
            columns = np.searchsorted(freedoms, node.freedoms)
            G[:, 6 * i : 6 * i + 3, columns] = local @ node.G[:, :3]
            G[:, 6 * i + 3 : 6 * i + 6, columns] = local @ node.G[:, 3:]
        self.blocks.append((freedoms, np.swapaxes(G, 1, 2) @ K @ G))
        return {name: nodes[i] for name, i in index.items() if name != "root"}

    def bar(self, pins: tuple[Node, Node], span: Array, compliance: float) -> None:
        """Add the bar's force N as an unknown: its elongation u . (u_pin - u_crank) is c N."""
        u = span / np.linalg.norm(span, axis=1)[:, None]
        force = self.new(1)
        for node, sign in zip(pins, (-1.0, 1.0), strict=True):
            row = sign * np.einsum("ni,nik->nk", u, node.G[:, :3])
            block = np.zeros((self.n, len(node.freedoms) + 1, len(node.freedoms) + 1))
            block[:, :-1, -1] = block[:, -1, :-1] = row
            self.blocks.append((np.concatenate([node.freedoms, force]), block))
        self.blocks.append((force, np.full((self.n, 1, 1), -compliance)))

    def matrix(self) -> Array:
        K = np.zeros((self.n, self.size, self.size))
        for freedoms, stiffness in self.springs:
            K[:, freedoms, freedoms] = stiffness
        for freedoms, block in self.blocks:
            # Freedoms come in a few runs of consecutive numbers; slices add faster than index arrays.
            cuts = [0, *(np.flatnonzero(np.diff(freedoms) != 1) + 1), len(freedoms)]
            runs = [(slice(i, j), slice(freedoms[i], freedoms[j - 1] + 1)) for i, j in pairwise(cuts)]
            for (rows, to_rows), (columns, to_columns) in product(runs, runs):
                K[:, to_rows, to_columns] += block[:, rows, columns]
        return K


def compliance(model: ArmModel, q: Array, point: Array | None = None, *, condensed: bool = True) -> Array:
    """Cartesian compliance (n, 6, 6) at the tool point.

    ``condensed=False`` assembles every beam element instead of the superelements. Same units, frame and errors as
    :func:`fem.compliance`, except that a flat parallelogram is not looked for.
    """
    q = as_poses(model.robot, q)
    points = as_points(point, len(q))
    out = np.empty((len(q), 6, 6))
    for rows in in_blocks(len(q), CHUNK):
        K, G = assemble(model, q[rows], None if points is None else points[rows], condensed=condensed)
        out[rows] = G @ np.linalg.solve(K, np.swapaxes(G, 1, 2))
    return out


def deflection(model: ArmModel, q: Array, wrench: Array, point: Array | None = None) -> Array:
    """Tool displacement (n, 6) under a wrench (6,) or (n, 6).

    Arguments, units and errors as of :func:`fem.deflection`, except that a flat parallelogram is not looked for.
    """
    q = as_poses(model.robot, q)
    points, loads = as_points(point, len(q)), as_wrenches(wrench, len(q))
    out = np.empty((len(q), 6))
    for rows in in_blocks(len(q), CHUNK):
        K, G = assemble(model, q[rows], None if points is None else points[rows])
        load = np.swapaxes(G, 1, 2) @ loads[rows, :, None]
        out[rows] = (G @ np.linalg.solve(K, load))[:, :, 0]
    return out


def assemble(model: ArmModel, q: Array, point: Array | None = None, *, condensed: bool = True) -> tuple[Array, Array]:
    """Assemble the system matrix (n, m, m) and the tool's displacement as (n, 6, m) times the unknowns."""
    frames = forward_kinematics(model.robot, q)
    system = _System(len(q), condensed=condensed)
    chain = build_chain(model, frames, q, tool_position(model.robot, frames, point), system)
    if chain.pins is not None and model.bar is not None:
        system.bar(chain.pins, chain.span, model.bar.compliance)
    return system.matrix(), chain.tool.over(system.size)
