"""How thick the walls of a casing are that shows its outside only: by its mass, thicker in the bosses around joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import trimesh

from meshes.surfaces.rings import Interface, Ring
from robots.arrays import Array, Bools, Integers

# Has no type hints.
_triangles: Any = trimesh.triangles

# Walls of a boss over those of the barrel beside it: castings carry their bearings on walls 2 to 3 times as thick.
BOSS = 2.5
# The hull of a link shows no bosses, and encloses more than the link does: with one wall all over, that of a casting of
# known geometry is stiffer by 1 / 0.81 (docs/validation/imported_links.md), which a thinner wall makes good.
HULL = 0.8
# Share of a link's published mass that is its casing: of castings with drives in them, and of bare tubes.
CASING_SHARE, TUBE_SHARE = 0.6, 0.8
# Walls (m) that are assumed where no mass is known; between which a wall may be; of steel, below which it is not cast.
USUAL_WALL, LEAST_WALL, MOST_WALL, THIN_STEEL = 6e-3, 1.2e-3, 30e-3, 3e-3
HEAVIEST, GRAVITY = 7850.0, 9.81  # kg/m^3 of steel; m/s^2
# A boss reaches this much further from the axis than its seat does.
BESIDE = 1.05


@dataclass(frozen=True)
class Areas:
    """What a casing's mass is spread over: area of barrel and of bosses (m^2), solid flanges (m^3)."""

    barrel: float
    bosses: float
    flanges_m3: float
    boss: float = BOSS

    @property
    def weighted(self) -> float:
        """Area (m^2) of barrel's wall with the same mass."""
        return self.barrel + self.boss * self.bosses

    def wall(self, kg: float, density: float) -> float:
        """Thickness of the barrel's wall (m) with which the casing weighs ``kg``; not positive where flanges do."""
        return (kg / density - self.flanges_m3) / self.weighted

    def kg(self, wall: float, density: float) -> float:
        """What the casing weighs with a barrel's wall of ``wall`` m."""
        return density * (wall * self.weighted + self.flanges_m3)


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


def areas_of(nodes: Array, faces: Integers, boss: Bools, rings: Mapping[str, Ring], times: float = BOSS) -> Areas:
    """Areas of barrel and bosses, whose walls are ``times`` as thick; solid flanges count as these, not as walls."""
    area = _triangles.area(nodes[faces])
    solid = np.zeros(len(nodes), dtype=bool)
    for ring in rings.values():
        if ring.flange_m3:
            solid[ring.nodes] = True
    wall = ~solid[faces].all(axis=1)
    volume = sum(ring.flange_m3 for ring in rings.values())
    return Areas(float(area[wall & ~boss].sum()), float(area[wall & boss].sum()), float(volume), times)


@dataclass(frozen=True)
class Wall:
    """A barrel's wall (m) and what it rests on: "given", "mass", "robot" (the whole arm's mass) or "assumed"."""

    metres: float
    basis: Literal["given", "mass", "robot", "assumed"]
    words: str


@dataclass(frozen=True)
class Casing:
    """What is known of a link's casing: its areas, published mass (kg) or None, whether it is a tube or a hull."""

    areas: Areas
    kg: float | None
    tube: bool
    hull: bool = False

    @property
    def share(self) -> float:
        """Share of the published mass that is casing; the rest is drives, gears and cables."""
        return TUBE_SHARE if self.tube else CASING_SHARE

    def wall(self, kg: float, density: float) -> float:
        """The barrel's wall (m) by a published mass."""
        return self.areas.wall(self.share * kg, density)


def masses_at_fault(casings: Mapping[str, Casing], density: float) -> str | None:
    """Why published masses cannot be these links' masses; None where they can.

    ``density``: of the lightest material in question, kg/m^3.
    """
    given = {name: one.kg for name, one in casings.items() if one.kg is not None}
    values = np.array(list(given.values()))
    if len(values) > 2 and np.ptp(values) <= 1e-9 * values.max():
        return f"all links have the same mass, {values[0]:g} kg: a filling"
    walls = {name: casings[name].wall(kg, HEAVIEST) for name, kg in given.items()}
    thick = {name: wall for name, wall in walls.items() if wall > MOST_WALL}
    if thick:
        name = max(thick, key=thick.__getitem__)
        tenth = all(casings[one].wall(kg / GRAVITY, HEAVIEST) <= MOST_WALL for one, kg in given.items())
        newtons = ": they look like newtons" if tenth else ""
        return f"{name} at {given[name]:.4g} kg would have steel walls of {1e3 * thick[name]:.3g} mm{newtons}"
    thin = {name: casings[name].wall(kg, density) for name, kg in given.items()}
    thin = {name: wall for name, wall in thin.items() if wall < LEAST_WALL}
    if len(thin) > len(given) / 2:
        name = min(thin, key=thin.__getitem__)
        wall = max(thin[name], 0.0)
        return f"{name} at {given[name]:.4g} kg would have walls of {1e3 * wall:.2g} mm even in aluminium"
    return None


def material_by_mass(casings: Mapping[str, Casing], steel: float) -> Literal["steel", "aluminium"]:
    """Aluminium where steel of density ``steel`` (kg/m^3) would make walls thinner than anyone casts, by all masses."""
    known = [one for one in casings.values() if one.kg is not None]
    kg = sum(one.share * one.kg for one in known if one.kg is not None)
    area = sum(one.areas.weighted for one in known)
    solid = sum(one.areas.flanges_m3 for one in known)
    return "steel" if not known or kg / steel - solid >= THIN_STEEL * area else "aluminium"


def walls_of(
    casings: Mapping[str, Casing], given: Mapping[str, float], density: float, robot_kg: float | None, use_masses: bool
) -> dict[str, Wall]:
    """The barrel's wall of each link: as given, by its mass, by the whole arm's, or assumed.

    ``given`` m, by link; ``use_masses``: whether links' published masses are to be believed.
    """
    believed = {name: one.kg for name, one in casings.items() if use_masses and one.kg is not None}
    by_mass = {name: casings[name].wall(kg, density) for name, kg in believed.items()}
    by_mass = {name: wall for name, wall in by_mass.items() if LEAST_WALL <= wall <= MOST_WALL}
    spread = None if robot_kg is None else _of_the_arm(casings, robot_kg, density)
    out = {}
    for name, one in casings.items():
        if name in given:
            out[name] = Wall(given[name], "given", "as given")
        elif name in by_mass:
            words = f"{one.share:g} of its {one.kg:.4g} kg as {'a bare tube' if one.tube else 'a casing with drives'}"
            out[name] = Wall(by_mass[name], "mass", f"by mass: {words}")
        elif by_mass:
            usual = float(np.median(list(by_mass.values())))
            out[name] = Wall(usual, "robot", "the median of the other links' walls: its own mass gives none")
        elif spread is not None:
            out[name] = Wall(spread, "robot", f"by the arm's {robot_kg:g} kg, of which {CASING_SHARE:g} is casings")
        else:
            out[name] = Wall(USUAL_WALL, "assumed", "assumed: no mass is known")
        if one.hull and name not in given:
            words = f"{out[name].words}, {HULL:g} of it because the surface is a hull, which is stiffer than its link"
            out[name] = Wall(HULL * out[name].metres, out[name].basis, words)
    return out


def _of_the_arm(casings: Mapping[str, Casing], robot_kg: float, density: float) -> float | None:
    """One wall for all links by the mass of the arm, None where none can be."""
    area = sum(one.areas.weighted for one in casings.values())
    solid = sum(one.areas.flanges_m3 for one in casings.values())
    wall = (CASING_SHARE * robot_kg / density - solid) / area
    return wall if LEAST_WALL <= wall <= MOST_WALL else None
