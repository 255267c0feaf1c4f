"""Section constants against sums of rectangles, thin-wall limits and Cowper's published values."""

from __future__ import annotations

import numpy as np
import pytest

from meshes import section_dimensions, section_properties
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
