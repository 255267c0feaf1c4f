"""Sections that stand for casings: exact for prismatic ones, a mean of compliances for others."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from refusals import refuses
from scipy.spatial.transform import Rotation

from meshes import section_dimensions, section_properties
from meshes.link_sections import equivalent_section

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
