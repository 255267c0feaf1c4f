"""A frame as OpenSees takes it: nodes, beams, springs of no length, materials, each with its tag."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arms import Section

Array = NDArray[np.float64]
# ("Elastic", k), ("ElasticPP", ...), with the arguments of OpenSees behind the tag; ("Parallel", material, ...).
Material = tuple[Any, ...]

STIFF = 1e14  # N/m, N m/rad: gives 1e-8 of what a joint does
RIGID = Section(1e14, 1e14, 1e14, 1.0, 1.0)
# Below this a stiff beam would be a million times stiffer than its neighbours: a constraint does it.
SHORT = 0.1  # m
SAME = 1e-9  # m


def elastic(material: Material) -> bool:
    """Whether force is in proportion to motion, whatever came before."""
    return material[0] == "Elastic" and len(material) == 2


FORGETS = {"Elastic", "ElasticMultiLinear", "ElasticPPGap", "ENT"}


def forgets(material: Material) -> bool:
    """Whether it does not matter what came before. Gaps slide at forces that no arm brings."""
    return all(forgets(m) for m in material[1:]) if material[0] == "Parallel" else material[0] in FORGETS


def viscous(material: Material) -> bool:
    """Whether time matters."""
    return material[0] in {"Maxwell", "Viscous"} or any(viscous(m) for m in material[1:] if isinstance(m, tuple))


class Deck:
    """Commands in order; what they make bears rising tags."""

    def __init__(self) -> None:
        self.commands: list[list[Any]] = []
        self.places: list[Array] = []
        self.materials: dict[Material, int] = {}
        self._elements = 0

    @property
    def linear(self) -> bool:
        """Whether one step is as good as many."""
        return all(elastic(m) for m in self.materials)

    @property
    def forgets(self) -> bool:
        """Whether the order of loads does not matter."""
        return all(forgets(m) for m in self.materials)

    @property
    def viscous(self) -> bool:
        """Whether holding a load matters."""
        return any(viscous(m) for m in self.materials)

    def node(self, place: Array) -> int:
        """A new node at a place (3,) in m."""
        self.places.append(np.asarray(place, dtype=float))
        self.commands.append(["node", len(self.places), *map(float, place)])
        return len(self.places)

    def fix(self, node: int) -> None:
        """Hold a node in all six freedoms."""
        self.commands.append(["fix", node, 1, 1, 1, 1, 1, 1])

    def at(self, node: int) -> Array:
        """Where a node is."""
        return self.places[node - 1]

    def material(self, material: Material) -> int:
        """Its tag; the same material is made once, as elements take copies."""
        if material not in self.materials:
            parts = [self.material(m) if isinstance(m, tuple) else m for m in material[1:]]
            self.materials[material] = len(self.materials) + 1
            self.commands.append(["uniaxialMaterial", material[0], self.materials[material], *parts])
        return self.materials[material]

    def spring(self, i: int, j: int, materials: dict[int, Material], x: Array, y: Array) -> None:
        """Between two nodes at one place: directions 1 to 3 along x, y, z and 4 to 6 about them."""
        self._elements += 1
        tags = [self.material(m) for m in materials.values()]
        along = [*map(float, x), *map(float, y)]
        self.commands.append(
            ["element", "zeroLength", self._elements, i, j, "-mat", *tags, "-dir", *materials, "-orient", *along]
        )

    def hinge(self, i: int, materials: dict[int, Material], x: Array, y: Array) -> int:
        """A node behind node ``i``, stiff in all directions that no material is given for."""
        j = self.node(self.at(i))
        self.spring(i, j, {d: materials.get(d, ("Elastic", STIFF)) for d in range(1, 7)}, x, y)
        return j

    def reach(self, i: int, place: Array, section: Section | None = None) -> int:
        """A node at a place, held by node ``i`` through a beam, which is stiff without a section."""
        length = float(np.linalg.norm(place - self.at(i)))
        if length < SAME:
            return i
        j = self.node(place)
        if section is None and length < SHORT:
            self.commands.append(["rigidLink", "beam", i, j])
            return j
        s = section or RIGID
        self._elements += 1
        way = (place - self.at(i)) / length
        beside = np.cross(way, np.eye(3)[int(np.argmin(np.abs(way)))])
        self.commands.append(["geomTransf", "Linear", self._elements, *map(float, beside)])
        values = [s.area, s.modulus, s.shear, s.torsion, s.inertia, s.inertia]
        self.commands.append(["element", "elasticBeamColumn", self._elements, i, j, *values, self._elements])
        return j

    def bar(self, i: int, j: int, stiffness: float) -> None:
        """Pinned at both ends, stiffness in N/m along it."""
        self._elements += 1
        length = float(np.linalg.norm(self.at(j) - self.at(i)))
        tag = self.material(("Elastic", stiffness * length))
        self.commands.append(["element", "Truss", self._elements, i, j, 1.0, tag])
