"""Which nodes of a casing are held: at its ends, on its sides, beside its neighbours; and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from refusals import refuses

from meshes.surfaces.doubts import is_hull, openings
from meshes.surfaces.remesh import remesh
from meshes.surfaces.rings import Interface, Ring, choose_rings, one_bearing
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

SIZE_M = 0.03
# An arm of 0.2 x 0.2 m section from z = -0.15 to 0.95 m; its joints turn about y, at z = 0 and 0.8 m.
WIDTH_M, JOINTS_M = 0.2, (0.0, 0.8)
Y, Z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def arm() -> tuple[np.ndarray, np.ndarray]:
    box = trimesh.creation.box((WIDTH_M, WIDTH_M, 1.1)).apply_translation([0, 0, 0.4])
    return remesh(np.asarray(box.vertices), np.asarray(box.faces), SIZE_M)


def at(z: float, y: float = 0.0) -> np.ndarray:
    return np.array([0.0, y, z])


def plate(y: float, z: float) -> np.ndarray:
    """Points of a neighbour's face, a disc of 0.12 m at right angles to y."""
    angle, radius = np.meshgrid(np.linspace(0, 2 * np.pi, 60), np.linspace(0.0, 0.12, 9))
    x, up = radius * np.cos(angle), radius * np.sin(angle)
    return np.stack([x.ravel(), np.full(x.size, y), z + up.ravel()], axis=1)


def rings_of(skin: tuple[np.ndarray, np.ndarray], **interfaces: Interface) -> dict[str, Ring]:
    return choose_rings(interfaces, *skin, SIZE_M)[0]


def test_a_joint_across_the_arm_is_held_on_the_side_that_its_neighbour_is_on(arm) -> None:
    root = Interface(at(JOINTS_M[0]), Y, plate(0.11, JOINTS_M[0]))
    tip = Interface(at(JOINTS_M[1]), -Y, plate(-0.115, JOINTS_M[1]))
    rings = rings_of(arm, root=root, tip=tip)
    for ring, side, z in ((rings["root"], 1.0, JOINTS_M[0]), (rings["tip"], -1.0, JOINTS_M[1])):
        nodes = arm[0][ring.nodes]
        # The face itself, and the nodes on its rim.
        np.testing.assert_allclose(nodes[:, 1], side * WIDTH_M / 2, atol=0.75 * SIZE_M)
        off = np.hypot(nodes[:, 0], nodes[:, 2] - z)
        # The neighbour's disc reaches 120 mm, and 45 mm more is within the depth of a seat on such a coarse mesh.
        assert ring.radius == pytest.approx(off.max())
        assert WIDTH_M / 2 <= ring.radius <= 0.12 + 1.6 * SIZE_M
        assert np.abs(nodes.mean(axis=0) - [0, side * WIDTH_M / 2, z]).max() < 0.5 * SIZE_M


def test_without_a_neighbour_the_side_nearest_to_the_joint_is_held_and_both_of_a_fork(arm) -> None:
    rings = rings_of(arm, root=Interface(at(0.0, 0.25), Y), tip=Interface(at(0.8), Y))
    assert set(np.sign(arm[0][rings["root"].nodes, 1])) == {1.0}
    assert set(np.sign(arm[0][rings["tip"].nodes, 1])) == {1.0, -1.0}
    assert "at +100 and -100 mm" in rings["tip"].words or "at -100 and +100 mm" in rings["tip"].words


def test_a_joint_along_the_arm_has_its_whole_end(arm) -> None:
    rings = rings_of(arm, root=Interface(at(-0.2), Z), tip=Interface(at(1.05), Z))
    for name, z in (("root", -0.15), ("tip", 0.95)):
        nodes = arm[0][rings[name].nodes]
        np.testing.assert_allclose(nodes[:, 2], z, atol=0.5 * SIZE_M)
        assert rings[name].radius == pytest.approx(WIDTH_M / np.sqrt(2))  # the corners are in
        end = np.abs(arm[0][:, 2] - z) < 1e-9
        assert set(np.flatnonzero(end)) <= set(rings[name].nodes)


def test_a_foot_is_held_as_a_whole_and_a_given_radius_is_kept(arm) -> None:
    whole = rings_of(arm, root=Interface(at(0.0, 0.1), Y, whole=True), tip=Interface(at(0.8), Z, radius=0.07))
    side = np.abs(arm[0][:, 1] - WIDTH_M / 2) < 1e-9
    assert set(np.flatnonzero(side)) <= set(whole["root"].nodes)
    assert whole["tip"].radius <= 0.07


def test_rings_that_meet_are_cut_and_that_is_said(arm) -> None:
    near = {"root": Interface(at(0.3, 0.1), Y), "tip": Interface(at(0.42, 0.1), Y)}
    rings, notes = choose_rings(near, *arm, SIZE_M)
    assert not set(rings["root"].nodes) & set(rings["tip"].nodes)
    assert all(ring.radius <= 0.45 * 0.12 + 1e-12 for ring in rings.values())
    assert notes == ["rings of root and tip met: their radii were cut, see below"]
    refuses(
        "L006",
        "root and tip share nodes",
        rings_of,
        arm,
        root=Interface(at(0.3, 0.1), Y, radius=0.1),
        tip=Interface(at(0.42, 0.1), Y, radius=0.1),
    )


def test_a_ball_serves_where_no_flat_place_is_around_the_axis(arm) -> None:
    # The axis runs along an edge of the arm: nothing faces along it but the ends, beside the axis.
    edge = np.array([0.1, 0.1, 0.4])
    rings = rings_of(arm, root=Interface(edge, Z), tip=Interface(at(0.8), Y))
    assert rings["root"].words.startswith("ball")
    assert np.linalg.norm(arm[0][rings["root"].nodes] - edge, axis=1).max() <= rings["root"].radius


def test_no_ring_is_said_with_the_way_to_the_surface(arm) -> None:
    far = Interface(np.array([1.0, 1.0, 0.4]), Z)
    refuses(
        "L006",
        r"no ring found at interface root.*the nearest node is 1\.2",
        rings_of,
        arm,
        root=far,
        tip=Interface(at(0.8), Y),
    )


def test_the_choice_does_not_depend_on_the_order_of_nodes(arm) -> None:
    nodes, faces = arm
    order = np.random.default_rng(0).permutation(len(nodes))
    place = np.argsort(order)
    interfaces = {"root": Interface(at(0.0), Y, plate(0.11, 0.0)), "tip": Interface(at(1.0), Z)}
    first, _ = choose_rings(interfaces, nodes, faces, SIZE_M)
    second, _ = choose_rings(interfaces, nodes[order], place[faces], SIZE_M)
    for name in interfaces:
        assert set(first[name].nodes) == set(order[second[name].nodes])


def test_a_slanting_seat_is_held_as_a_whole(arm) -> None:
    # The side of the arm leans by 15 deg: a slice at right angles to the axis through it would be a strip.
    nodes = arm[0] + np.outer(arm[0][:, 2], [0.0, np.tan(np.deg2rad(15.0)), 0.0])
    root = rings_of((nodes, arm[1]), root=Interface(at(0.0, 0.1), Y), tip=Interface(at(0.8, 0.2), Z, radius=0.05))[
        "root"
    ]
    held = nodes[root.nodes]
    assert np.ptp(held[:, 2]) > 1.6 * root.radius * np.cos(np.deg2rad(15.0))
    assert root.across


def test_a_thin_flange_is_held_with_rim_and_back(arm) -> None:
    outline = [[0.0, 0.0], [0.15, 0.0], [0.15, 0.06], [0.08, 0.06], [0.08, 0.3], [0.0, 0.3]]
    turned = trimesh.creation.revolve(outline, sections=24)
    skin = remesh(np.asarray(turned.vertices), np.asarray(turned.faces), SIZE_M)
    ends = {"root": Interface(at(0.0), Z), "tip": Interface(at(0.3), Z)}
    rings = choose_rings(ends, *skin, SIZE_M)[0]
    held = skin[0][rings["root"].nodes]
    off = np.hypot(held[:, 0], held[:, 1])
    assert ((held[:, 2] > 0.055) & (off > 0.1)).any()
    assert rings["root"].flange_m3 == pytest.approx(np.pi * 0.15**2 * 0.06, rel=0.1)
    # The other end is as wide as the tube: no flange.
    assert rings["tip"].flange_m3 == 0.0
    assert skin[0][rings["tip"].nodes][:, 2].min() > 0.3 - SIZE_M


def test_one_bearing_has_one_radius() -> None:
    small, large = (Ring(np.arange(6), radius, "", seat=True) for radius in (0.1, 0.16))
    assert one_bearing(small, large, 1, 2) == [(1, "tip", 0.16)]
    assert one_bearing(large, small, 1, 2) == [(2, "root", 0.16)]
    assert one_bearing(large, Ring(np.arange(6), 0.12, "", seat=True), 1, 2) == []
    assert one_bearing(large, Ring(np.arange(6), 0.02, "ball"), 1, 2) == []


# ------------------------------------------------------------
# Walls by mass, masses that cannot be, thick bosses, hulls and closed openings

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
