"""Cross-section properties of hollow boxes and tubes, vectorised over stations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from robots.arrays import Array
from robots.schema.description import BoxSection, TubeSection

SectionKind = Literal["box", "tube"]


@dataclass(frozen=True)
class SectionProperties:
    """Section constants, each of one shape: area m^2, second moments and torsion constant m^4.

    ``shear_y`` and ``shear_z`` are Timoshenko shear areas (coefficient times area), m^2. ``iyy`` resists
    bending about the local y axis (deflection along z), ``izz`` about z.
    """

    area: Array
    shear_y: Array
    shear_z: Array
    torsion: Array
    iyy: Array
    izz: Array


def section_dimensions(section: BoxSection | TubeSection) -> Array:
    """Return the dimensions in m: (width, height, wall) of a box, (diameter, wall) of a tube."""
    if isinstance(section, BoxSection):
        return np.array([section.width.si, section.height.si, section.wall.si])
    return np.array([section.diameter.si, section.wall.si])


def section_properties(kind: SectionKind, dimensions: Array, poissons_ratio: float) -> SectionProperties:
    """Section constants from dimensions (..., k) in m.

    Bending constants are exact. Torsion of the box is Bredt's thin-wall formula (2 % low at a wall of a
    tenth of the width, worse beyond); shear coefficients are Cowper's (J. Appl. Mech. 33, 1966,
    doi:10.1115/1.3625046) for hollow circles and thin-walled boxes.
    """
    if kind == "box":
        return _box(dimensions[..., 0], dimensions[..., 1], dimensions[..., 2], poissons_ratio)
    return _tube(dimensions[..., 0], dimensions[..., 1], poissons_ratio)


def _box(width: Array, height: Array, wall: Array, nu: float) -> SectionProperties:
    b, h = width - 2.0 * wall, height - 2.0 * wall
    bm, hm = width - wall, height - wall
    area = width * height - b * h
    return SectionProperties(
        area=area,
        shear_y=area * _cowper_box(hm, bm, nu),
        shear_z=area * _cowper_box(bm, hm, nu),
        torsion=2.0 * wall * (bm * hm) ** 2 / (bm + hm),
        iyy=(width * height**3 - b * h**3) / 12.0,
        izz=(height * width**3 - h * b**3) / 12.0,
    )


def _cowper_box(flange: Array, web: Array, nu: float) -> Array:
    """Shear coefficient of a thin-walled box of even wall, shear along the webs."""
    m = n = flange / web
    return np.asarray(
        10.0
        * (1.0 + nu)
        * (1.0 + 3.0 * m) ** 2
        / (
            12.0
            + 72.0 * m
            + 150.0 * m**2
            + 90.0 * m**3
            + nu * (11.0 + 66.0 * m + 135.0 * m**2 + 90.0 * m**3)
            + 10.0 * n**2 * ((3.0 + nu) * m + 3.0 * m**2)
        )
    )


def _tube(diameter: Array, wall: Array, nu: float) -> SectionProperties:
    inner = diameter - 2.0 * wall
    area = np.pi / 4.0 * (diameter**2 - inner**2)
    second = np.pi / 64.0 * (diameter**4 - inner**4)
    m = inner / diameter
    cowper = 6.0 * (1.0 + nu) * (1.0 + m**2) ** 2 / ((7.0 + 6.0 * nu) * (1.0 + m**2) ** 2 + (20.0 + 12.0 * nu) * m**2)
    return SectionProperties(area, area * cowper, area * cowper, 2.0 * second, second, second)
