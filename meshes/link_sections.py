"""Beam sections that stand for a casing of any shape: as stiff on average from root to tip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from scipy.optimize import brentq

from robots import InputError
from robots.arrays import Array, Integers
from robots.schema.description import BoxSection, TubeSection
from robots.schema.quantities import PositiveLength

# Has no type hints.
_intersections: Any = trimesh.intersections

STATIONS = 41
# Share of the way that the casing must cover: of less, a beam over the whole way says nothing.
LEAST_COVER = 0.1
# Of the median perimeter: below, a station has no casing, only what sticks out of it.
LEAST_PERIMETER = 0.3
# A tube has two equal second moments, and as much of them as a circle of the same perimeter.
ROUND = 0.05


@dataclass(frozen=True)
class EquivalentSection:
    """A hollow section with the casing's mean bending stiffness.

    ``up`` (3,): the direction that the section's height follows, at right angles to the way. ``cover``: share of
    the way from root to tip where the casing is. ``torsion_ratio``: the section's torsional stiffness over the
    casing's own (Bredt, one closed cell).
    """

    section: BoxSection | TubeSection
    up: Array
    cover: float
    torsion_ratio: float


def equivalent_section(
    name: str, nodes: Array, faces: Integers, wall: float, root: Array, tip: Array
) -> EquivalentSection:
    """Section that bends like a casing does on average between two points.

    At stations on the way the mid-line of the casing is cut out; its second moments about its own centroid are
    ``I = wall * integral (n . r)^2 ds``. The mean of 1/I over all stations, where the casing is absent with
    1/I = 0 (a shell link is rigid there), is that of a uniform beam with the same end rotation under end moments.
    The box has these two second moments and the same wall.

    Parameters
    ----------
    nodes, faces : closed mid-surface, (n, 3) m and (m, 3)
    wall : m
    root, tip : (3,) m

    Raises
    ------
    InputError
        The points coincide, or the casing covers less than a tenth of the way between them.
    """
    way = tip - root
    length = float(np.linalg.norm(way))
    if not length > 0.0:
        raise InputError(f"{name}: root and tip coincide", remedy="leave the link rigid")
    x = way / length
    y = np.cross(x, np.eye(3)[np.argmin(np.abs(x))])
    y /= np.linalg.norm(y)
    axes = np.stack([x, y, np.cross(x, y)])
    share = (np.arange(STATIONS) + 0.5) / STATIONS
    turned = trimesh.Trimesh((nodes - root) @ axes.T, faces, process=False)
    cuts = _casing_cuts([_cut(turned, s * length) for s in share])
    cover = len(cuts) / STATIONS
    if cover < LEAST_COVER:
        raise InputError(
            f"{name}: its casing covers {100 * cover:.0f} % of the way from root to tip",
            allowed=f"{100 * LEAST_COVER:.0f} % or more",
            remedy="leave the link rigid",
        )
    # Compliances add up along the way: the mean of the inverse tensors, over the stations without casing too.
    tensors = np.array([_second_moments(cut) for cut in cuts])
    mean = np.linalg.inv(np.linalg.inv(tensors).mean(axis=0) * cover)
    values, directions = np.linalg.eigh(mean)
    small, large = (float(v) for v in values)
    # The tensor's direction n has the integral of (n . r)^2: the section's height is along the largest.
    up = directions[0, 1] * axes[1] + directions[1, 1] * axes[2]
    up *= np.sign(up[np.argmax(np.abs(up))])
    torsion = float(1.0 / (np.mean([1.0 / _bredt(cut) for cut in cuts]) * cover))
    note = "same mean bending stiffness from root to tip as the imported surface"
    circle = np.mean([_perimeter(cut) for cut in cuts]) ** 3 / (8.0 * np.pi**2) / cover
    if large - small < ROUND * large and abs(small - circle) < ROUND * circle:
        radius = (0.5 * (small + large) / np.pi) ** (1.0 / 3.0)
        own = 2.0 * np.pi * radius**3
        tube = TubeSection(kind="tube", diameter=_length(2.0 * radius + wall, note), wall=_length(wall, note))
        return EquivalentSection(tube, up, cover, own / torsion)
    width, height = _box(small, large)
    own = 2.0 * (width * height) ** 2 / (width + height)
    box = BoxSection(
        kind="box", width=_length(width + wall, note), height=_length(height + wall, note), wall=_length(wall, note)
    )
    return EquivalentSection(box, up, cover, own / torsion)


def _length(value: float, note: str) -> PositiveLength:
    return PositiveLength(value=round(1e3 * value, 3), unit="mm", source="derived", note=note)


def _cut(mesh: trimesh.Trimesh, place: float) -> Array | None:
    """Segments (s, 2, 2) of the plane x = ``place`` through a surface, in y and z; None where it is not cut."""
    segments = np.asarray(_intersections.mesh_plane(mesh, [1.0, 0.0, 0.0], [place, 0.0, 0.0]))
    return segments[:, :, 1:] if len(segments) >= 3 else None


def _perimeter(segments: Array) -> float:
    return float(np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum())


def _casing_cuts(cuts: list[Array | None]) -> list[Array]:
    """Leave out stations that the casing does not reach, or only a boss or bracket of it."""
    found = [cut for cut in cuts if cut is not None]
    least = LEAST_PERIMETER * float(np.median([_perimeter(cut) for cut in found])) if found else 0.0
    return [cut for cut in found if _perimeter(cut) >= least]


def _second_moments(segments: Array) -> Array:
    """Integral of r r^T ds (2, 2) over segments, r from their centroid; m^3."""
    length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    middle = segments.mean(axis=1)
    middle = middle - length @ middle / length.sum()
    half = 0.5 * (segments[:, 1] - segments[:, 0])
    outer = np.einsum("si,sj->sij", middle, middle) + np.einsum("si,sj->sij", half, half) / 3.0
    return np.asarray(np.einsum("s,sij->ij", length, outer))


def _bredt(segments: Array) -> float:
    """Torsion constant over the wall (m^3) of closed thin cells: 4 A^2 / perimeter."""
    start, end = segments[:, 0], segments[:, 1]
    # Segments come in no order, so each is taken anticlockwise about the centroid: exact for star-shaped cells.
    length = np.linalg.norm(end - start, axis=1)
    middle = length @ segments.mean(axis=1) / length.sum()
    (y1, z1), (y2, z2) = (start - middle).T, (end - middle).T
    area = 0.5 * float(np.abs(y1 * z2 - z1 * y2).sum())
    return float(4.0 * area**2 / length.sum())


def _box(small: float, large: float) -> tuple[float, float]:
    """Mid-line width and height (m) of a box with second moments over the wall ``small`` and ``large`` (m^3).

    About the width's axis ``h^3 / 6 + b h^2 / 2``, about the height's ``b^3 / 6 + h b^2 / 2``.
    """

    def excess(ratio: float) -> float:
        return (ratio**3 / 6.0 + ratio**2 / 2.0) / (1.0 / 6.0 + ratio / 2.0) - large / small

    # ratio = h / b; both moments are equal at 1, and the ratio of moments grows without limit.
    ratio = float(brentq(excess, 1.0, 2.0 + 3.0 * np.sqrt(large / small))) if large > small * (1.0 + 1e-9) else 1.0
    width = (small / (1.0 / 6.0 + ratio / 2.0)) ** (1.0 / 3.0)
    return width, ratio * width
