"""Published shell problems: mesh of triangles or quads, supports, loads and the reference deflection.

Sources. [MH] R. H. MacNeal, R. L. Harder, Finite Elem. Anal. Des. 1 (1985) 3-20, doi:10.1016/0168-874X(85)90003-4:
roof, hemisphere, twisted beam. [B] T. Belytschko et al., CMAME 51 (1985) 221-258, doi:10.1016/0045-7825(85)90035-0:
the obstacle course of roof, cylinder and hemisphere. [S] J. C. Simo, D. D. Fox, M. S. Rifai, CMAME 73 (1989)
53-92, doi:10.1016/0045-7825(89)90098-4: the thin twisted beam. [Z] D. Zupan, M. Saje, Finite Elem. Anal. Des.
40 (2004) 1445-1451: the thick twisted beam as a curved beam, 5.42453e-3 and 1.75325e-3. [K] Y. Ko, Y. Lee,
P.-S. Lee, K.-J. Bathe, Comput. Struct. 193 (2017) 187-206, tables 12 and 13: both twisted beams.
None of the papers was read here. The twisted beam's values are as two codes quote them independently of each
other: P. Krysl's FinEtoolsFlexStructures.jl (tutorials/twisted_beam_tut.md) from [MH], [S] and [Z], and a test
suite from [K]; and ``test_twisted_beam_theory.py`` derives them by rod theory.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from fem.elements.assembly import assemble_shell, freedoms
from fem.elements.condensation import solve_positive_definite
from meshes.shell_mesh import ShellMesh
from robots.arrays import Array, Bools, Integers

Shape = Literal["tri", "quad"]
Direction = Literal["in-plane", "out-of-plane"]
U, V, W, RX, RY, RZ = range(6)


@dataclass(frozen=True)
class Problem:
    """A mesh with supports and loads whose deflection ``reading . u`` is known.

    ``fixed``: freedoms held at zero; ``load`` (6k,); ``reading`` (6k,); ``reference``: published deflection.
    """

    mesh: ShellMesh
    fixed: Integers
    load: Array
    reading: Array
    reference: float

    def solve(self) -> Array:
        """Displacements (6k,)."""
        K = assemble_shell(self.mesh)
        free = np.setdiff1d(np.arange(K.shape[0]), self.fixed)
        u = np.zeros(K.shape[0])
        u[free] = solve_positive_definite(K[free][:, free], self.load[free][:, None])[:, 0]
        return u

    def ratio(self) -> float:
        """Computed over published deflection."""
        return float(self.reading @ self.solve()) / self.reference


def grid(
    n: int, m: int, place: Callable[[Array, Array], Array], shape: Shape, *, falling: bool = False
) -> tuple[Array, dict[str, Integers]]:
    """Nodes and elements of n x m cells; ``place(s, t)`` maps the unit square, node number ``i (m + 1) + j``.

    Triangles: each cell is cut along its rising diagonal, from (s, t) = (0, 0), or the falling one.
    """
    s, t = np.meshgrid(np.linspace(0.0, 1.0, n + 1), np.linspace(0.0, 1.0, m + 1), indexing="ij")
    nodes = place(s.ravel(), t.ravel())
    i, j = (index.ravel() for index in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    corner = i * (m + 1) + j
    quads = np.stack([corner, corner + m + 1, corner + m + 2, corner + 1], axis=1)
    if shape == "quad":
        return nodes, {"triangles": np.zeros((0, 3), np.int64), "quads": quads}
    if falling:
        quads = np.roll(quads, 1, axis=1)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return nodes, {"triangles": triangles, "quads": np.zeros((0, 4), np.int64)}


def _mesh(name: str, nodes: Array, cells: dict[str, Integers], t: float, E: float, nu: float) -> ShellMesh:
    count = sum(len(c) for c in cells.values())
    return ShellMesh(name, nodes, cells["triangles"], cells["quads"], np.full(count, t), E, nu, interfaces={})


def _dofs(nodes: Bools, *components: int) -> Integers:
    return np.asarray(freedoms(np.flatnonzero(nodes))[:, list(components)].ravel())


def _unit(k: int, entries: dict[int, float]) -> Array:
    out = np.zeros(6 * k)
    for dof, value in entries.items():
        out[dof] += value
    return out


def scordelis_lo_roof(n: int, shape: Shape) -> Problem:
    """Cylindrical roof on rigid diaphragms under its weight, a quarter; drop of the free edge's middle [MH].

    R = 25, length 50, half angle 40 deg, t = 0.25, E = 4.32e8, nu = 0, 90 per unit area; reference 0.3024.
    """
    radius, half, weight = 25.0, 25.0, 90.0

    def place(s: Array, t: Array) -> Array:
        angle = np.radians(40.0) * s
        return np.stack([radius * np.sin(angle), half * t, radius * np.cos(angle)], axis=1)

    nodes, cells = grid(n, n, place, shape)
    mesh = _mesh("Scordelis-Lo roof", nodes, cells, 0.25, 4.32e8, 0.0)
    load = np.zeros(6 * len(nodes))
    for corners in cells.values():
        diagonals = nodes[corners[:, [2, -1]]] - nodes[corners[:, [0, 1]]]
        area = 0.5 * np.linalg.norm(np.cross(diagonals[:, 0], diagonals[:, 1]), axis=1)
        share = np.repeat(area / corners.shape[1], corners.shape[1])
        np.add.at(load, 6 * corners.ravel() + W, -weight * share)
    i, j = np.divmod(np.arange(len(nodes)), n + 1)
    fixed = [
        _dofs(i == 0, U, RY, RZ),  # symmetry at the crown
        _dofs(j == 0, V, RX, RZ),  # symmetry at mid-length
        _dofs(j == n, U, W),  # diaphragm
    ]
    edge = n * (n + 1)
    return Problem(mesh, np.unique(np.concatenate(fixed)), load, _unit(len(nodes), {6 * edge + W: -1.0}), 0.3024)


def pinched_cylinder(n: int, shape: Shape) -> Problem:
    """Cylinder on rigid diaphragms between two opposite unit forces, an eighth; deflection under a force [B].

    R = 300, length 600, t = 3, E = 3e6, nu = 0.3; reference 1.8248e-5.
    """
    radius, half = 300.0, 300.0

    def place(s: Array, t: Array) -> Array:
        angle = 0.5 * np.pi * s
        return np.stack([radius * np.sin(angle), half * t, radius * np.cos(angle)], axis=1)

    nodes, cells = grid(n, n, place, shape, falling=True)
    i, j = np.divmod(np.arange(len(nodes)), n + 1)
    fixed = [
        _dofs(i == 0, U, RY, RZ),
        _dofs(i == n, W, RX, RY),
        _dofs(j == 0, V, RX, RZ),
        _dofs(j == n, U, W),
    ]
    k = len(nodes)
    mesh = _mesh("pinched cylinder", nodes, cells, 3.0, 3e6, 0.3)
    # The force sits on two planes of symmetry: a quarter of it is on this eighth.
    return Problem(mesh, np.unique(np.concatenate(fixed)), _unit(k, {W: -0.25}), _unit(k, {W: -1.0}), 1.8248e-5)


def pinched_hemisphere(n: int, shape: Shape) -> Problem:
    """Hemisphere with an 18 deg hole under four forces of 2 in turn outward and inward, a quarter [MH].

    R = 10, t = 0.04, E = 6.825e7, nu = 0.3; deflection along a force. [MH] give 0.094 (elsewhere 0.0935).
    """
    radius = 10.0

    def place(s: Array, t: Array) -> Array:
        around, up = 0.5 * np.pi * s, np.radians(72.0) * t
        return radius * np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=1)

    nodes, cells = grid(n, n, place, shape)
    i = np.arange(len(nodes)) // (n + 1)
    on_y = n * (n + 1)
    fixed = [
        _dofs(i == 0, V, RX, RZ),  # plane y = 0
        _dofs(i == n, U, RY, RZ),  # plane x = 0
        np.array([W]),  # the height is free otherwise
    ]
    k = len(nodes)
    load = _unit(k, {U: 1.0, 6 * on_y + V: -1.0})
    mesh = _mesh("pinched hemisphere", nodes, cells, 0.04, 6.825e7, 0.3)
    return Problem(mesh, np.unique(np.concatenate(fixed)), load, _unit(k, {U: 1.0}), 0.0940)


# Tip deflection per unit force by thickness: along the width of the tip's section and across it.
TWISTED_BEAM = {
    (0.32, "in-plane"): 5.424e-3,  # [MH], [Z], [K]
    (0.32, "out-of-plane"): 1.754e-3,  # [MH], [Z], [K]
    (0.0032, "in-plane"): 5.256e3,  # [S], [K]: 5.256e-3 at a force of 1e-6
    (0.0032, "out-of-plane"): 1.294e3,  # [S], [K]: 1.294e-3 at a force of 1e-6
}


def twisted_beam(n: int, shape: Shape, thickness: float = 0.32, direction: Direction = "in-plane") -> Problem:
    """Cantilever strip that turns 90 deg over its length, n elements long and n/6 wide, unit tip force.

    Length 12, width 1.1, E = 29e6, nu = 0.22, thickness 0.32 [MH] or 0.0032 [S]. The force lies along the
    width of the section at the tip (in-plane) or across it, spread over the tip's nodes.
    """
    m = max(2, n // 6)
    length, width = 12.0, 1.1

    def place(s: Array, t: Array) -> Array:
        angle, across = 0.5 * np.pi * s, width * (t - 0.5)
        return np.stack([length * s, across * np.cos(angle), across * np.sin(angle)], axis=1)

    nodes, cells = grid(n, m, place, shape)
    component = W if direction == "in-plane" else V
    tip = n * (m + 1) + np.arange(m + 1)
    share = np.full(m + 1, 1.0 / m)
    share[[0, -1]] *= 0.5
    load = np.zeros(6 * len(nodes))
    load[6 * tip + component] = share
    mesh = _mesh("twisted beam", nodes, cells, thickness, 29e6, 0.22)
    # Read at the middle of the tip, as published, and not by the work of the spread force.
    middle = _unit(len(nodes), {6 * int(tip[m // 2]) + component: 1.0})
    return Problem(mesh, freedoms(np.arange(m + 1)).ravel(), load, middle, TWISTED_BEAM[thickness, direction])


COURSE: dict[str, Callable[[int, Shape], Problem]] = {
    "Scordelis-Lo roof": scordelis_lo_roof,
    "pinched cylinder": pinched_cylinder,
    "pinched hemisphere": pinched_hemisphere,
    "twisted beam 0.32 in-plane": partial(twisted_beam, thickness=0.32, direction="in-plane"),
    "twisted beam 0.32 out-of-plane": partial(twisted_beam, thickness=0.32, direction="out-of-plane"),
    "twisted beam 0.0032 in-plane": partial(twisted_beam, thickness=0.0032, direction="in-plane"),
    "twisted beam 0.0032 out-of-plane": partial(twisted_beam, thickness=0.0032, direction="out-of-plane"),
}
