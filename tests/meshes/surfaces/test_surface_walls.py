"""Walls by mass, masses that cannot be, thick bosses, hulls and closed openings."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from meshes.surfaces.doubts import is_hull, openings
from meshes.surfaces.remesh import remesh
from meshes.surfaces.rings import Interface, Ring
from meshes.surfaces.walls import (
    BOSS,
    HULL,
    USUAL_WALL,
    Areas,
    Casing,
    areas_of,
    boss_elements,
    masses_at_fault,
    material_by_mass,
    walls_of,
)

STEEL, ALUMINIUM = 7850.0, 2700.0
AREAS = Areas(barrel=0.5, bosses=0.2, flanges_m3=1e-3)


def casing(kg: float | None, *, tube: bool = False, hull: bool = False) -> Casing:
    return Casing(AREAS, kg, tube, hull)


def test_a_wall_is_what_is_left_of_the_mass_by_drives_and_flanges() -> None:
    wall = 8e-3
    kg = STEEL * (wall * (0.5 + BOSS * 0.2) + 1e-3)
    assert AREAS.kg(wall, STEEL) == pytest.approx(kg)
    links = {"arm": casing(kg / 0.6), "tube": casing(kg / 0.8, tube=True)}
    found = walls_of(links, {}, STEEL, None, use_masses=True)
    assert {name: one.metres for name, one in found.items()} == pytest.approx({"arm": wall, "tube": wall})
    assert {one.basis for one in found.values()} == {"mass"}


def test_walls_that_are_given_come_first_and_the_arm_s_mass_before_the_assumption() -> None:
    links = {"one": casing(None), "two": casing(None)}
    assert walls_of(links, {"one": 0.01}, STEEL, None, use_masses=True)["one"].metres == 0.01
    assert walls_of(links, {}, STEEL, None, use_masses=True)["two"].metres == USUAL_WALL
    arm = walls_of(links, {}, STEEL, 400.0, use_masses=True)
    assert 2.0 * AREAS.kg(arm["one"].metres, STEEL) == pytest.approx(0.6 * 400.0)
    hull = walls_of({"one": casing(None, hull=True)}, {}, STEEL, None, use_masses=True)
    assert hull["one"].metres == pytest.approx(HULL * USUAL_WALL)


@pytest.mark.parametrize(
    ("masses", "fault"),
    [
        ((100.0, 90.0, 80.0), False),
        ((2.0, 2.0, 2.0), True),  # a filling
        ((981.0, 880.0, 780.0), True),  # newtons
        ((0.2, 0.1, 0.3), True),  # lighter than foil
    ],
)
def test_masses_that_cannot_be(masses: tuple[float, ...], fault: bool) -> None:
    links = {str(i): casing(kg) for i, kg in enumerate(masses)}
    assert (masses_at_fault(links, ALUMINIUM) is not None) is fault


def test_walls_too_thin_for_steel_are_aluminium() -> None:
    assert material_by_mass({"arm": casing(AREAS.kg(2e-3, STEEL) / 0.6)}, STEEL) == "aluminium"
    assert material_by_mass({"arm": casing(AREAS.kg(6e-3, STEEL) / 0.6)}, STEEL) == "steel"
    assert material_by_mass({"arm": casing(None)}, STEEL) == "steel"


def test_a_boss_is_as_wide_as_its_seat_all_through_the_link() -> None:
    box = trimesh.creation.box((1.0, 0.2, 0.2))
    nodes, faces = remesh(np.asarray(box.vertices), np.asarray(box.faces), 0.04)
    across = Ring(np.arange(6), 0.1, "", across=True, seat=True)
    ends = {"root": Interface(np.array([-0.3, 0, 0]), np.array([0, 1.0, 0])), "tip": Interface(np.array([0.5, 0, 0]))}
    boss = boss_elements(nodes, faces, ends, {"root": across, "tip": Ring(np.arange(6), 0.1, "")})
    middle = nodes[faces].mean(axis=1)
    far = np.hypot(middle[:, 0] + 0.3, middle[:, 2])
    assert boss[far < 0.09].all()
    assert not boss[far > 0.12].any()
    assert set(np.sign(middle[boss, 1])) >= {1.0, -1.0}
    areas = areas_of(nodes, faces, boss, {})
    assert areas.barrel + areas.bosses == pytest.approx(box.area, rel=1e-6)


def test_a_hull_is_told_from_a_tube_and_from_a_link() -> None:
    ball, tube = trimesh.creation.icosphere(radius=0.2), trimesh.creation.cylinder(0.1, 0.8)
    small = trimesh.creation.icosphere(radius=0.1).apply_translation([0.6, 0, 0])
    hull = trimesh.util.concatenate([ball, small]).convex_hull
    bent = trimesh.creation.annulus(0.1, 0.2, 0.1)
    verdicts = [is_hull(np.asarray(one.vertices), np.asarray(one.faces)) for one in (hull, tube, bent)]
    assert verdicts == [True, False, False]


def test_an_opening_that_was_closed_is_as_wide_as_its_middle_is_far_from_the_surface() -> None:
    plate = trimesh.creation.box((0.4, 0.4, 0.05))
    nodes, faces = remesh(np.asarray(plate.vertices), np.asarray(plate.faces), 0.03)
    # A round opening of 240 mm in the top face.
    off = np.where(nodes[:, 2] > 0.0, np.maximum(0.12 - np.hypot(nodes[:, 0], nodes[:, 1]), 0.0), 0.0)
    (found,) = openings(nodes, faces, off, 0.03, np.zeros(0, dtype=np.int64))
    assert found.width == pytest.approx(0.24, abs=0.03)
    at_ring = np.flatnonzero(off > 0.1)
    assert openings(nodes, faces, off, 0.03, at_ring) == []
    assert openings(nodes, faces, np.zeros(0), 0.03, at_ring) == []
