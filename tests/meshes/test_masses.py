"""Masses against closed forms, and the bundled robots' against their published sums."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from meshes import (
    BeamMesh,
    ShellMesh,
    beam_mass,
    casing_mesh,
    link_beam_mesh,
    robot_masses,
    save_shell,
    shell_mass,
)
from meshes.sections import SectionKind
from robots import bundled_names, load_description
from robots.robot import robot_from
from robots.schema.description import Opening, Rim, Surface
from robots.schema.quantities import PositiveLength

STEEL = 7850.0


def _beam(kind: SectionKind, start: list[float], end: list[float], length: float = 1.2) -> BeamMesh:
    """Two elements along x from (1, 2, 3); height along z."""
    share = np.array([0.0, 0.5, 1.0])[:, None]
    sections = np.array(start) * (1.0 - share) + np.array(end) * share
    return BeamMesh(
        name="beam",
        nodes=np.array([1.0, 2.0, 3.0]) + share * np.array([length, 0.0, 0.0]),
        elements=np.array([[0, 1], [1, 2]]),
        kind=kind,
        dimensions=np.stack([sections[:-1], sections[1:]], axis=1),
        up=np.array([0.0, 0.0, 1.0]),
        youngs_modulus=210e9,
        poissons_ratio=0.3,
        interfaces={"root": 0, "tip": 2},
    )


BOX = _beam("box", [0.3, 0.2, 0.01], [0.3, 0.2, 0.01])


def test_box_casing() -> None:
    mass = shell_mass(casing_mesh(BOX), STEEL)
    # Mid-surface perimeter, wall and length: the same as the hollow section's area, exact but for round-off.
    assert mass.kg == pytest.approx(STEEL * 2.0 * (0.29 + 0.19) * 0.01 * 1.2, rel=1e-12)
    np.testing.assert_allclose(mass.centre, [1.6, 2.0, 3.0], atol=1e-12)
    beam = beam_mass(BOX, STEEL)
    assert beam.kg == pytest.approx(mass.kg, rel=1e-12)
    np.testing.assert_allclose(beam.centre, mass.centre, atol=1e-12)


def test_tube_casing() -> None:
    tube = _beam("tube", [0.4, 0.02], [0.4, 0.02])
    mass = shell_mass(casing_mesh(tube, 0.01), STEEL)
    around = int(np.ceil(np.pi * 0.38 / 0.01))
    # The polygon's perimeter, exact; 0.03 % short of the circle's.
    assert mass.kg == pytest.approx(STEEL * around * 0.38 * np.sin(np.pi / around) * 0.02 * 1.2, rel=1e-12)
    assert mass.kg == pytest.approx(beam_mass(tube, STEEL).kg, rel=3e-4)
    np.testing.assert_allclose(mass.centre, [1.6, 2.0, 3.0], atol=1e-12)


def test_tapered_beam() -> None:
    # Solid in all but a hair: a cone frustum from diameter 0.4 to 0.2, pi h (R^2 + R r + r^2) / 3, and its centre.
    mass = beam_mass(_beam("tube", [0.4, 0.2], [0.2, 0.1]), STEEL)
    assert mass.kg == pytest.approx(STEEL * np.pi * 1.2 * (0.04 + 0.02 + 0.01) / 3.0, rel=1e-12)
    centre = 1.2 * (0.04 + 2.0 * 0.02 + 3.0 * 0.01) / (4.0 * (0.04 + 0.02 + 0.01))
    np.testing.assert_allclose(mass.centre, [1.0 + centre, 2.0, 3.0], rtol=1e-12)


def test_triangles_and_quads_count_with_their_own_thickness() -> None:
    mesh = ShellMesh(
        name="roof",
        nodes=np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [3, 0, 0]]),
        triangles=np.array([[1, 4, 2]]),
        quads=np.array([[0, 1, 2, 3]]),
        thickness=np.array([0.03, 0.01]),
        youngs_modulus=210e9,
        poissons_ratio=0.3,
        interfaces={"root": np.array([0])},
    )
    mass = shell_mass(mesh, 1000.0)
    assert mass.kg == pytest.approx(1000.0 * (0.5 * 0.03 + 2.0 * 0.01), rel=1e-12)
    # The triangle (15 kg) has its centre at (7/3, 1/3), the quad (20 kg) at (1, 1/2).
    np.testing.assert_allclose(mass.centre, [(35.0 + 20.0) / 35.0, (5.0 + 10.0) / 35.0, 0.0], atol=1e-12)


def test_an_opening_takes_its_area_and_moves_the_centre_away() -> None:
    opening = Opening(side="+y", along=(0.25, 0.5), across=(0.5, 0.75), source="assumed")
    whole, open_ = (shell_mass(casing_mesh(BOX, openings=o), STEEL) for o in ([], [opening]))
    hole = STEEL * 0.01 * (0.25 * 1.2) * (0.25 * 0.19)
    assert open_.kg == pytest.approx(whole.kg - hole, rel=1e-12)
    # Middle of the hole: 0.375 of the length, on the wall at +y, 0.625 of its height.
    at = np.array([1.0 + 0.375 * 1.2, 2.0 + 0.145, 3.0 + 0.125 * 0.19])
    np.testing.assert_allclose(open_.kg * open_.centre, whole.kg * whole.centre - hole * at, rtol=1e-12)


def test_rims_add_their_thicker_wall() -> None:
    length, wall = (PositiveLength(value=v, unit="mm", source="assumed") for v in (60.0, 25.0))
    rimmed = shell_mass(casing_mesh(BOX, rim=Rim(length=length, wall=wall)), STEEL)
    added = STEEL * 2.0 * (0.29 + 0.19) * (0.025 - 0.01) * 2.0 * 0.06
    assert rimmed.kg == pytest.approx(shell_mass(casing_mesh(BOX), STEEL).kg + added, rel=1e-12)
    np.testing.assert_allclose(rimmed.centre, [1.6, 2.0, 3.0], atol=1e-12)


@pytest.mark.parametrize("name", [name for name in bundled_names() if load_description(name).link])
def test_bundled_masses_add_up_to_the_robots(name: str) -> None:
    description = load_description(name)
    masses = robot_masses(description, robot_from(description))
    assert [link.name for link in masses.links] == [link.name for link in description.link]
    assert description.mass is not None
    assert masses.robot_kg == description.mass.si
    # 0.5 kg: link masses are given in whole kilograms, bar and crank come from their sections.
    assert masses.difference_kg == pytest.approx(0.0, abs=0.5)
    for link in masses.links:
        assert link.rest_kg is not None
        assert link.rest_kg >= 0.0, link.name


def test_bar_and_crank_of_the_xr701() -> None:
    description = load_description("xr701")
    masses = robot_masses(description, robot_from(description))
    # Tube of 100 mm and 12 mm wall over the upper arm's 1.1 m; box of 160 x 240 mm and 30 mm wall over 0.4 m.
    assert masses.bar_kg == pytest.approx(STEEL * np.pi * 0.088 * 0.012 * 1.1, rel=1e-12)
    assert masses.crank is not None
    assert masses.crank.kg == pytest.approx(STEEL * (0.16 * 0.24 - 0.10 * 0.18) * 0.4, rel=1e-12)
    # Halfway to the pin, which lies 0.4 m behind the elbow.
    np.testing.assert_allclose(masses.crank.centre, [0.0, 0.0, -0.2], atol=1e-12)
    links = sum(link.declared_kg or 0.0 for link in masses.links)
    assert masses.sum_kg == pytest.approx(links + masses.bar_kg + masses.crank.kg, rel=1e-12)


def test_a_link_without_a_declared_mass_leaves_no_sum() -> None:
    description = load_description("kr60-3")
    links = (description.link[0].model_copy(update={"mass": None}), *description.link[1:])
    masses = robot_masses(description.model_copy(update={"link": links}), robot_from(description))
    assert masses.links[0].rest_kg is None
    assert (masses.sum_kg, masses.difference_kg) == (None, None)


def test_a_prepared_surface_is_weighed_in_the_casings_place(tmp_path: Path) -> None:
    description = load_description("kr60-3")
    robot = robot_from(description)
    link = description.link[0]
    mesh = casing_mesh(link_beam_mesh(description, robot, link), 0.1)
    digest = save_shell(mesh, tmp_path / "pedestal.npz")
    wall, size = (PositiveLength(value=v, unit="mm", source="assumed") for v in (20.0, 100.0))
    surface = Surface(file=str(tmp_path / "pedestal.npz"), sha256=digest, wall=wall, size=size, source="assumed")
    links = (link.model_copy(update={"surface": surface, "rim": None}), *description.link[1:])
    weighed = robot_masses(description.model_copy(update={"link": links}), robot).links[0].casing
    # Aluminium, 2700 kg/m^3; the file holds the mesh bit for bit.
    assert weighed.kg == shell_mass(mesh, 2700.0).kg
