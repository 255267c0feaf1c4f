"""Section constants against sums of rectangles, thin-wall limits and Cowper's published values."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from refusals import refuses
from scipy.spatial.transform import Rotation

from meshes import BeamMesh, crank_beam_mesh, link_beam_mesh, section_dimensions, section_properties
from meshes.link_sections import equivalent_section
from robots import ModelDescription, load_description
from robots.library.models import parse_description
from robots.robot import robot_from
from robots.schema.description import BoxSection, TubeSection

# Closed forms in another order of operations: only round-off is left.
ROUND_OFF = 1e-13


def _rectangle(along: float, across: float, offset: float) -> float:
    """Second moment of a rectangle about a parallel axis ``offset`` away (Steiner)."""
    return across * along**3 / 12.0 + across * along * offset**2


@pytest.mark.parametrize(("width", "height", "wall"), [(0.2, 0.3, 0.01), (0.3, 0.2, 0.02), (0.1, 0.1, 0.004)])
def test_box_is_the_sum_of_its_four_plates(width: float, height: float, wall: float) -> None:
    p = section_properties("box", np.array([width, height, wall]), 0.3)
    clear = height - 2.0 * wall
    area = 2.0 * width * wall + 2.0 * clear * wall
    iyy = 2.0 * _rectangle(wall, width, (height - wall) / 2.0) + 2.0 * _rectangle(clear, wall, 0.0)
    izz = 2.0 * _rectangle(width, wall, 0.0) + 2.0 * _rectangle(wall, clear, (width - wall) / 2.0)
    assert p.area == pytest.approx(area, rel=ROUND_OFF)
    assert p.iyy == pytest.approx(iyy, rel=ROUND_OFF)
    assert p.izz == pytest.approx(izz, rel=ROUND_OFF)


def test_box_torsion_is_bredts_second_formula() -> None:
    width, height, wall = 0.24, 0.34, 0.01
    enclosed = (width - wall) * (height - wall)
    around = 2.0 * (width - wall) + 2.0 * (height - wall)
    p = section_properties("box", np.array([width, height, wall]), 0.3)
    assert p.torsion == pytest.approx(4.0 * enclosed**2 / (around / wall), rel=ROUND_OFF)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
def test_shear_coefficient_of_a_square_box_is_cowpers(nu: float) -> None:
    p = section_properties("box", np.array([0.2, 0.2, 0.002]), nu)
    # Cowper 1966, table 1: thin-walled square tube.
    published = 20.0 * (1.0 + nu) / (48.0 + 39.0 * nu)
    assert p.shear_y / p.area == pytest.approx(published, rel=ROUND_OFF)
    assert p.shear_z / p.area == pytest.approx(published, rel=ROUND_OFF)


def test_a_tall_box_is_stiffer_in_shear_along_its_height() -> None:
    p = section_properties("box", np.array([0.1, 0.4, 0.005]), 0.3)
    # The webs carry the shear: their share of the area is 0.8 along z and 0.2 along y, and the
    # coefficient lies below that share (the flanges add nothing, the webs' stress is uneven).
    assert 0.5 < p.shear_z / p.area < 0.8
    assert 0.05 < p.shear_y / p.area < 0.2


def test_turning_a_box_swaps_its_two_directions() -> None:
    nu = 0.3
    lying = section_properties("box", np.array([0.3, 0.2, 0.01]), nu)
    standing = section_properties("box", np.array([0.2, 0.3, 0.01]), nu)
    # The same operations on swapped arguments: products may round differently by their order.
    for turned, own in (("iyy", "izz"), ("shear_y", "shear_z"), ("area", "area"), ("torsion", "torsion")):
        assert getattr(lying, turned) == pytest.approx(getattr(standing, own), rel=ROUND_OFF)
        assert getattr(lying, own) == pytest.approx(getattr(standing, turned), rel=ROUND_OFF)
    assert lying.izz > 1.5 * lying.iyy


def test_thin_tube_limits() -> None:
    diameter, wall, nu = 1.0, 1e-5, 0.3
    p = section_properties("tube", np.array([diameter, wall]), nu)
    # Thin-wall formulas on the outer diameter are off by a few times wall / diameter.
    thin = 5.0 * wall / diameter
    assert p.area == pytest.approx(np.pi * diameter * wall, rel=thin)
    assert p.iyy == pytest.approx(np.pi * diameter**3 * wall / 8.0, rel=thin)
    assert p.torsion == pytest.approx(np.pi * diameter**3 * wall / 4.0, rel=thin)
    # Cowper 1966, table 1: thin-walled round tube.
    assert p.shear_y / p.area == pytest.approx(2.0 * (1.0 + nu) / (4.0 + 3.0 * nu), rel=thin)


def test_a_tube_without_a_hole_is_a_solid_circle() -> None:
    diameter, nu = 0.2, 0.25
    p = section_properties("tube", np.array([diameter, diameter / 2.0]), nu)
    assert p.area == pytest.approx(np.pi * diameter**2 / 4.0, rel=ROUND_OFF)
    assert p.izz == pytest.approx(np.pi * diameter**4 / 64.0, rel=ROUND_OFF)
    assert p.torsion == pytest.approx(np.pi * diameter**4 / 32.0, rel=ROUND_OFF)
    # Cowper 1966, table 1: solid circle.
    assert p.shear_z / p.area == pytest.approx(6.0 * (1.0 + nu) / (7.0 + 6.0 * nu), rel=ROUND_OFF)


@pytest.mark.parametrize(("kind", "width"), [("box", 3), ("tube", 2)])
def test_stations_are_independent_of_each_other(kind: str, width: int) -> None:
    sizes = np.array([[0.3, 0.2, 0.01], [0.2, 0.2, 0.02]])[:, 3 - width :]
    sizes = np.broadcast_to(sizes, (4, 2, width))
    together = section_properties(kind, sizes, 0.3)  # type: ignore[arg-type]
    alone = section_properties(kind, sizes[2, 1], 0.3)  # type: ignore[arg-type]
    for name in ("area", "shear_y", "shear_z", "torsion", "iyy", "izz"):
        assert getattr(together, name).shape == (4, 2)
        # The same operations on the same numbers; a scalar power may round in the last place.
        assert getattr(together, name)[2, 1] == pytest.approx(getattr(alone, name), rel=ROUND_OFF)


def test_dimensions_come_in_metres() -> None:
    mm = {"unit": "mm", "source": "assumed"}
    box = BoxSection.model_validate(
        {
            "kind": "box",
            "width": {"value": 200, **mm},
            "height": {"value": 300, **mm},
            "wall": {"value": 10, **mm},
        }
    )
    tube = TubeSection.model_validate({"kind": "tube", "diameter": {"value": 500, **mm}, "wall": {"value": 20, **mm}})
    # mm -> m is one product, exact to the last place.
    assert section_dimensions(box) == pytest.approx([0.2, 0.3, 0.01], rel=1e-15)
    assert section_dimensions(tube) == pytest.approx([0.5, 0.02], rel=1e-15)


# ------------------------------------------------------------
# Beam meshes of links: where the nodes are, how the section runs, what the interfaces are

# Interpolation along a centre line of about 1 m.
ROUND_OFF_M = 1e-14


def _mesh(model: ModelDescription, link: str, per_segment: int = 4) -> BeamMesh:
    entry = next(entry for entry in model.link if entry.name == link)
    return link_beam_mesh(model, robot_from(model), entry, per_segment)


def _span(mesh: BeamMesh) -> np.ndarray:
    return np.linalg.norm(np.diff(mesh.nodes[mesh.elements], axis=1)[:, 0], axis=1)


def test_a_straight_link_runs_from_its_joint_to_the_next() -> None:
    mesh = _mesh(load_description("xr701"), "upper-arm", 5)
    assert list(mesh.interfaces) == ["root", "tip"]
    np.testing.assert_allclose(mesh.interface_points, [[0, 0, 0], [0, 0, 1.10]], atol=ROUND_OFF_M)
    np.testing.assert_allclose(_span(mesh), 0.22, atol=ROUND_OFF_M)
    np.testing.assert_array_equal(mesh.elements, [[0, 1], [1, 2], [2, 3], [3, 4], [4, 5]])


def test_the_section_tapers_linearly_along_the_whole_link() -> None:
    mesh = _mesh(load_description("xr701"), "upper-arm")
    np.testing.assert_allclose(mesh.dimensions[0, 0], [0.24, 0.34, 0.01], rtol=1e-14)
    np.testing.assert_allclose(mesh.dimensions[-1, 1], [0.22, 0.28, 0.01], rtol=1e-14)
    np.testing.assert_allclose(mesh.dimensions[1, 1], [0.23, 0.31, 0.01], rtol=1e-14)
    # Neighbours share the station, so they share its section exactly.
    np.testing.assert_array_equal(mesh.dimensions[:-1, 1], mesh.dimensions[1:, 0])


def test_via_points_are_nodes() -> None:
    mesh = _mesh(load_description("kr60-3"), "forearm")
    corner = np.linalg.norm(mesh.nodes - [0.145, 0.0, 0.0], axis=1)
    assert corner.min() < ROUND_OFF_M
    assert len(mesh.elements) == 8
    tip = mesh.nodes[mesh.interfaces["tip"]]
    assert _span(mesh).sum() == pytest.approx(0.145 + np.linalg.norm(tip - [0.145, 0, 0]), rel=1e-14)


def test_the_driven_link_carries_the_lever_of_the_bar() -> None:
    mesh = _mesh(load_description("xr701"), "forearm")
    assert list(mesh.interfaces) == ["root", "tip", "pin"]
    np.testing.assert_allclose(mesh.interface_points, [[0, 0, 0], [0, 0, 1.25], [0, 0, -0.40]], atol=ROUND_OFF_M)
    # The lever starts at the root and keeps the root's section.
    lever = mesh.elements[4:]
    assert lever[0, 0] == mesh.interfaces["root"]
    np.testing.assert_allclose(mesh.dimensions[4:], np.broadcast_to([0.32, 0.32, 0.01], (4, 2, 3)), rtol=1e-14)


def test_the_crank_goes_to_the_bars_pin() -> None:
    model = load_description("xr701")
    mesh = crank_beam_mesh(model, robot_from(model), 3)
    np.testing.assert_allclose(mesh.interface_points, [[0, 0, 0], [0, 0, -0.40]], atol=ROUND_OFF_M)
    # The section's height lies in the plane in which the crank bends, that is across its axis (y).
    assert abs(mesh.up @ [0.0, 1.0, 0.0]) < ROUND_OFF_M


def test_a_robot_without_a_parallelogram_has_no_crank() -> None:
    model = load_description("kr60-3")
    refuses("R002", "no parallelogram", crank_beam_mesh, model, robot_from(model))


def test_a_link_of_length_zero_is_refused() -> None:
    model = load_description("xr701")
    # Body j4's next joint sits at the same point: there is nothing to mesh.
    entry = next(link for link in model.link if link.name == "wrist").model_copy(update={"body": "j4"})
    refuses("L007", r"length zero.*remove the link", link_beam_mesh, model, robot_from(model), entry)


def test_repeated_points_make_no_empty_elements() -> None:
    text = """
schema = "stiffarm-model/1"
name = "stub"
title = "one joint, one link with a via point on its root"
sources = {}
[materials.steel]
youngs_modulus = { value = 206, unit = "GPa", source = "assumed" }
poissons_ratio = { value = 0.3, unit = "1", source = "assumed" }
density = { value = 7850, unit = "kg/m^3", source = "assumed" }
[[joint]]
name = "j1"
coordinate = "q1_deg"
limits = { value = [-90, 90], unit = "deg", source = "assumed" }
frame = { xyz = { value = [0, 0, 0], unit = "m", source = "assumed" } }
[flange]
xyz = { value = [1, 0, 0], unit = "m", source = "assumed" }
[[link]]
name = "link"
body = "j1"
material = "steel"
via = [{ value = [0, 0, 0], unit = "m", source = "assumed" }]
[link.section]
kind = "tube"
diameter = { value = 100, unit = "mm", source = "assumed" }
wall = { value = 10, unit = "mm", source = "assumed" }
"""
    mesh = _mesh(parse_description(text, "stub"), "link")
    np.testing.assert_allclose(_span(mesh), 0.25, rtol=1e-14)


# ------------------------------------------------------------
# Sections that stand for casings: exact for prismatic ones, a mean of compliances for others

WALL_M = 0.008
ROOT, TIP = np.zeros(3), np.array([0.0, 0.0, 1.0])


def box(width: float, height: float, length: float, middle: float) -> trimesh.Trimesh:
    """Mid-surface of a box with outer sides ``width`` along x and ``height`` along y."""
    mid = trimesh.creation.box((width - WALL_M, height - WALL_M, length))
    return mid.subdivide().apply_translation([0.0, 0.0, middle])


def section(mesh: trimesh.Trimesh, root: np.ndarray = ROOT, tip: np.ndarray = TIP):
    return equivalent_section("link", np.asarray(mesh.vertices), np.asarray(mesh.faces), WALL_M, root, tip)


def test_a_box_gives_its_own_section_back_wherever_it_stands() -> None:
    turn = Rotation.from_euler("xyz", [0.4, -0.8, 1.1]).as_matrix()
    mesh = box(0.2, 0.3, 1.4, 0.5).apply_translation([0.25, -0.1, 0.0])
    found = section(trimesh.Trimesh(mesh.vertices @ turn.T, mesh.faces, process=False), turn @ ROOT, turn @ TIP)
    np.testing.assert_allclose(section_dimensions(found.section), [0.2, 0.3, WALL_M], atol=1e-6)  # written to 1 um
    np.testing.assert_allclose(np.abs(turn @ [0, 1, 0] @ found.up), 1.0, atol=1e-12)
    assert found.cover == 1.0
    assert found.torsion_ratio == pytest.approx(1.0)
    assert found.section.wall.source == "derived"


def test_a_tube_gives_its_own_diameter_back() -> None:
    mesh = trimesh.creation.cylinder((0.2 - WALL_M) / 2, 1.4, sections=96).apply_translation([0, 0, 0.5])
    found = section(mesh)
    assert found.section.kind == "tube"
    # The moment of 96 sides is 0.1 % below the circle's.
    np.testing.assert_allclose(section_dimensions(found.section), [0.2, WALL_M], rtol=1e-3)


def test_compliances_are_averaged_and_absent_stations_are_rigid() -> None:
    thick, thin = box(0.3, 0.3, 0.5, 0.25), box(0.2, 0.2, 0.5, 0.75)
    both = section(trimesh.util.concatenate([thick, thin]))

    def second(width: float) -> float:
        return float(section_properties("box", np.array([width, width, WALL_M]), 0.3).iyy)

    mean = 1.0 / (0.5 / second(0.3) + 0.5 / second(0.2))
    width = section_dimensions(both.section)[0]
    # Thin walls in the equivalent, thick ones in the reference: (t / b)^2, 0.2 %; 41 stations do not halve evenly.
    assert second(width) == pytest.approx(mean, rel=0.03)
    half = section(thick)
    assert half.cover == pytest.approx(0.5, abs=0.02)
    assert second(section_dimensions(half.section)[0]) == pytest.approx(second(0.3) / half.cover, rel=0.02)


def test_a_boss_that_sticks_out_is_no_station_of_the_casing() -> None:
    boss = trimesh.creation.cylinder(0.01, 0.3).apply_translation([0, 0, 0.8])
    with_boss = section(trimesh.util.concatenate([box(0.2, 0.3, 0.7, 0.3), boss]))
    assert with_boss.cover == pytest.approx(0.65, abs=0.03)
    assert section_dimensions(with_boss.section)[0] > 0.2


def test_what_no_beam_can_stand_for_is_refused() -> None:
    refuses("L009", r"covers 22 % of the way", section, box(0.2, 0.2, 0.2, 0.5))
    refuses("L009", "coincide", section, box(0.2, 0.2, 1.4, 0.5), ROOT, ROOT)
