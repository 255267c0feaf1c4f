"""Beams that stand for a casing of any shape: along its sections' centroids, as stiff on average from root to tip."""

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
# Points of a beam's path.
PATH = 5
# Share of the way that the casing must cover: of less, a beam over the whole way says nothing.
LEAST_COVER = 0.25
# Of the median perimeter: below, a station has no casing, only what sticks out of it.
LEAST_PERIMETER = 0.3
# A tube has two equal second moments, and as much of them as a circle of the same perimeter.
ROUND = 0.05


@dataclass(frozen=True)
class EquivalentSection:
    """A hollow section with the casing's mean bending stiffness.

    ``up`` (3,): the direction that the section's height follows, at right angles to the way. ``cover``: share of
    the way from root to tip where the casing is. ``torsion_ratio``: the section's torsional stiffness over the
    casing's own (Bredt, one closed cell). ``path`` (p, 3) m: the sections' centroids from root to tip, both ends
    included, level with root and tip along the way.
    """

    section: BoxSection | TubeSection
    up: Array
    cover: float
    torsion_ratio: float
    path: Array


def equivalent_section(
    name: str, nodes: Array, faces: Integers, wall: float, root: Array, tip: Array, thickness: Array | None = None
) -> EquivalentSection:
    """Section that bends like a casing does on average between two points.

    At stations on the way the mid-line of the casing is cut out; its second moments about its own centroid are
    ``I = wall * integral (n . r)^2 ds``. The mean of 1/I over all stations, where the casing is absent with
    1/I = 0 (a shell link is rigid there), is that of a uniform beam with the same end rotation under end moments.
    The box has these two second moments and the same wall.

    Parameters
    ----------
    nodes, faces : closed mid-surface, (n, 3) m and (m, 3)
    wall : m, of the section
    root, tip : (3,) m
    thickness : (m,) m, of the faces; None: ``wall`` everywhere

    Raises
    ------
    InputError
        The points coincide, or the casing covers less than a quarter of the way between them.
    """
    way = tip - root
    length = float(np.linalg.norm(way))
    if not length > 0.0:
        raise InputError(f"{name}: root and tip coincide", code="L009", remedy="leave the link rigid")
    x = way / length
    y = np.cross(x, np.eye(3)[np.argmin(np.abs(x))])
    y /= np.linalg.norm(y)
    axes = np.stack([x, y, np.cross(x, y)])
    share = (np.arange(STATIONS) + 0.5) / STATIONS
    turned = trimesh.Trimesh((nodes - root) @ axes.T, faces, process=False)
    times = np.ones(len(faces)) if thickness is None else thickness / wall
    every = [_cut(turned, s * length, times) for s in share]
    least = _least_perimeter([cut for cut in every if cut is not None])
    cuts = [cut for cut in every if cut is not None and cut.perimeter >= least]
    cover = len(cuts) / STATIONS
    if cover < LEAST_COVER:
        raise InputError(
            f"{name}: its casing covers {100 * cover:.0f} % of the way from root to tip",
            code="L009",
            allowed=f"{100 * LEAST_COVER:.0f} % or more",
            remedy="leave the link rigid",
        )
    # Compliances add up along the way: the mean of the inverse tensors, over the stations without casing too.
    tensors = np.array([cut.second_moments for cut in cuts])
    path = _path([(s, cut) for s, cut in zip(share, every, strict=True) if cut in cuts], axes, root, length)
    mean = np.linalg.inv(np.linalg.inv(tensors).mean(axis=0) * cover)
    values, directions = np.linalg.eigh(mean)
    small, large = (float(v) for v in values)
    # The tensor's direction n has the integral of (n . r)^2: the section's height is along the largest.
    up = directions[0, 1] * axes[1] + directions[1, 1] * axes[2]
    up *= np.sign(up[np.argmax(np.abs(up))])
    torsion = float(1.0 / (np.mean([1.0 / cut.bredt for cut in cuts]) * cover))
    note = "same mean bending stiffness from root to tip as the imported surface"
    circle = np.mean([cut.perimeter for cut in cuts]) ** 3 / (8.0 * np.pi**2) / cover
    if large - small < ROUND * large and abs(small - circle) < ROUND * circle:
        radius = (0.5 * (small + large) / np.pi) ** (1.0 / 3.0)
        own = 2.0 * np.pi * radius**3
        tube = TubeSection(kind="tube", diameter=_length(2.0 * radius + wall, note), wall=_length(wall, note))
        return EquivalentSection(tube, up, cover, own / torsion, path)
    width, height = _box(small, large)
    own = 2.0 * (width * height) ** 2 / (width + height)
    box = BoxSection(
        kind="box", width=_length(width + wall, note), height=_length(height + wall, note), wall=_length(wall, note)
    )
    return EquivalentSection(box, up, cover, own / torsion, path)


def _length(value: float, note: str) -> PositiveLength:
    return PositiveLength(value=round(1e3 * value, 3), unit="mm", source="derived", note=note)


@dataclass(frozen=True, eq=False)
class _Cut:
    """Segments (s, 2, 2) of a plane section, in y and z, and how many times (s,) the usual wall is there."""

    segments: Array
    times: Array

    @property
    def lengths(self) -> Array:
        """Of the segments, m."""
        return np.asarray(np.linalg.norm(self.segments[:, 1] - self.segments[:, 0], axis=1))

    @property
    def perimeter(self) -> float:
        """Of all segments, m."""
        return float(self.lengths.sum())

    @property
    def centroid(self) -> Array:
        """Of the walls (2,) m."""
        weight = self.lengths * self.times
        return np.asarray(weight @ self.segments.mean(axis=1) / weight.sum())

    @property
    def second_moments(self) -> Array:
        """Integral of r r^T ds (2, 2) over the walls, r from their centroid, ds by thickness; m^3."""
        weight = self.lengths * self.times
        middle = self.segments.mean(axis=1) - self.centroid
        half = 0.5 * (self.segments[:, 1] - self.segments[:, 0])
        outer = np.einsum("si,sj->sij", middle, middle) + np.einsum("si,sj->sij", half, half) / 3.0
        return np.asarray(np.einsum("s,sij->ij", weight, outer))

    @property
    def bredt(self) -> float:
        """Torsion constant over the wall (m^3) of closed thin cells: 4 A^2 over the integral of ds / t."""
        start, end = self.segments[:, 0], self.segments[:, 1]
        # Segments come in no order, so each is taken anticlockwise about the centroid: exact for star-shaped cells.
        length = self.lengths
        middle = length @ self.segments.mean(axis=1) / length.sum()
        (y1, z1), (y2, z2) = (start - middle).T, (end - middle).T
        area = 0.5 * float(np.abs(y1 * z2 - z1 * y2).sum())
        return float(4.0 * area**2 / (length / self.times).sum())


def _cut(mesh: trimesh.Trimesh, place: float, times: Array) -> _Cut | None:
    """The plane x = ``place`` through a surface; None where it is not cut."""
    segments, faces = _intersections.mesh_plane(mesh, [1.0, 0.0, 0.0], [place, 0.0, 0.0], return_faces=True)
    return _Cut(np.asarray(segments)[:, :, 1:], times[faces]) if len(segments) >= 3 else None


def _least_perimeter(found: list[_Cut]) -> float:
    """Least perimeter (m) of a station that the casing reaches, and not only a boss or bracket of it."""
    return LEAST_PERIMETER * float(np.median([cut.perimeter for cut in found])) if found else 0.0


def _path(cuts: list[tuple[float, _Cut]], axes: Array, root: Array, length: float) -> Array:
    """Centroids (p, 3) at root, tip and a few places between; those of the nearest station where there is no casing."""
    shares = np.array([share for share, _ in cuts])
    middles = np.array([cut.centroid for _, cut in cuts])
    places = np.linspace(0.0, 1.0, PATH)
    across = np.stack([np.interp(places, shares, middles[:, k]) for k in range(2)], axis=1)
    return np.asarray(root + np.column_stack([places * length, across]) @ axes)


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
