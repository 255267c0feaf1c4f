"""The whole arm as one shell model: every node of every link, springs and bar in one sparse solve.

The reference of the condensed path with shell links (:mod:`fem.statics`), and independent of its unit-load
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
from numpy.typing import NDArray

from fem.condensation import solve_positive_definite
from fem.inputs import as_points
from fem.model import ArmModel, LinkPart
from fem.shell import CoupledShell, couple, rigid_motion
from fem.transfers import axial_transfers
from robots import InputError
from robots.kinematics import BodyFrames, as_poses, forward_kinematics, tool_position

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class ShellArmSolution:
    """Solution of the full shell model for one pose and l loads.

    ``displacement`` (l, 6): tool point, m and rad, base axes. ``links``: nodal displacements (l, k, 6) of each
    link's shell mesh by name, m and rad, base axes; "crank" is the parallelogram's crank. ``bar_force`` (l,) N,
    positive when the bar pushes the forearm; None for the serial load path. ``unknowns``: size of the system.
    """

    displacement: Array
    links: dict[str, Array]
    bar_force: Array | None
    unknowns: int


@dataclass(frozen=True)
class _Node:
    """A point's displacement as a combination of the unknowns: u = G x[freedoms]; G (6, k)."""

    freedoms: Indices
    G: Array

    def carried(self, r: Array) -> _Node:
        """Displacement of a point rigidly connected, r (3,) m away."""
        return _Node(self.freedoms, rigid_motion(r[None])[0] @ self.G)


@dataclass
class _System:
    """Unknowns, links (stiffness, freedoms from the unknowns) and relative freedoms with their springs."""

    shells: Mapping[str, CoupledShell]
    size: int = 0
    links: dict[str, tuple[sp.coo_array, Array]] = field(default_factory=dict)
    springs: list[tuple[int, float]] = field(default_factory=list)
    row: Array | None = None

    def new(self, count: int) -> Indices:
        self.size += count
        return np.arange(self.size - count, self.size)

    def matrix(self) -> sp.csc_array:
        """Stiffness (n, n) of all unknowns, bar left out."""
        at = np.array([freedom for freedom, _ in self.springs], dtype=np.int64)
        values = np.array([stiffness for _, stiffness in self.springs])
        K = sp.coo_array((values, (at, at)), shape=(self.size, self.size)).tocsc()
        for name in self.links:
            B = self.freedoms_of(name)
            K = K + B.T @ self.shells[name].stiffness @ B
        return sp.csc_array(K)

    def freedoms_of(self, name: str) -> sp.csc_array:
        """Reduced freedoms (r, n) of a link from all unknowns."""
        B = self.links[name][0]
        return sp.coo_array((B.data, (B.row, B.col)), shape=(B.shape[0], self.size)).tocsc()


def couple_links(model: ArmModel) -> dict[str, CoupledShell]:
    """Couple the shell of each link (the crank's too) to its interface points by rigid rings, as the model's are.

    Raises
    ------
    InputError
        The model's links are not shells.
    """
    return {link.name: couple(mesh_part.shell, mesh_part.element.points) for link, mesh_part in _shells(model)}
