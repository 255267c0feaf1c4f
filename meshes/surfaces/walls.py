"""How thick the walls of a casing are that shows its outside only: by its mass, thicker in the bosses around joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

from meshes.surfaces.rings import Interface, Ring
from robots.arrays import Array, Bools, Integers

# Has no type hints.
_triangles: Any = trimesh.triangles

# Walls of a boss over those of the barrel beside it: castings carry their bearings on walls 2 to 3 times as thick.
BOSS = 2.5
# A boss reaches this much further from the axis than its seat does.
BESIDE = 1.05


@dataclass(frozen=True)
class Areas:
    """What a casing's mass is spread over: area of barrel and of bosses (m^2), solid flanges (m^3)."""

    barrel: float
    bosses: float
    flanges_m3: float

    def wall(self, kg: float, density: float) -> float:
        """Thickness of the barrel's wall (m) with which the casing weighs ``kg``; not positive where flanges do."""
        return (kg / density - self.flanges_m3) / (self.barrel + BOSS * self.bosses)

    def kg(self, wall: float, density: float) -> float:
        """What the casing weighs with a barrel's wall of ``wall`` m."""
        return density * (wall * (self.barrel + BOSS * self.bosses) + self.flanges_m3)


def boss_elements(
    nodes: Array, faces: Integers, interfaces: Mapping[str, Interface], rings: Mapping[str, Ring]
) -> Bools:
    """Which triangles (m,) of a casing belong to a boss: as near to an axis across the link as its seat reaches."""
    middle = nodes[faces].mean(axis=1)
    boss = np.zeros(len(faces), dtype=bool)
    for name, ring in rings.items():
        here = interfaces[name]
        if not ring.across or here.axis is None:
            continue
        axis = here.axis / np.linalg.norm(here.axis)
        arm = middle - here.point
        boss |= np.linalg.norm(arm - (arm @ axis)[:, None] * axis, axis=1) <= BESIDE * ring.radius
    return boss


def areas_of(nodes: Array, faces: Integers, boss: Bools, rings: Mapping[str, Ring]) -> Areas:
    """Areas of barrel and bosses; the nodes of solid flanges count as these, not as walls."""
    area = _triangles.area(nodes[faces])
    solid = np.zeros(len(nodes), dtype=bool)
    for ring in rings.values():
        if ring.flange_m3:
            solid[ring.nodes] = True
    wall = ~solid[faces].all(axis=1)
    volume = sum(ring.flange_m3 for ring in rings.values())
    return Areas(float(area[wall & ~boss].sum()), float(area[wall & boss].sum()), float(volume))
