"""Links as integrals of compliant screws along their axis: bending, torsion, shear and stretching of thin casings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .screws import Array, screw_through


@dataclass(frozen=True)
class Section:
    """A thin box (width, height) or tube (width = height = diameter) with its wall, in m."""

    box: bool
    width: float
    height: float
    wall: float

    def stiffness(self, youngs: float, poisson: float) -> Array:
        """Stiffness (6,) per length: torsion, bending about y, about z, stretching, shear along y, along z."""
        w, h, t = self.width, self.height, self.wall
        shear = youngs / (2.0 * (1.0 + poisson))
        if not self.box:
            inner = w - 2.0 * t
            area, second = np.pi / 4.0 * (w**2 - inner**2), np.pi / 64.0 * (w**4 - inner**4)
            return np.array(
                [2 * shear * second, youngs * second, youngs * second, youngs * area, *[shear * area / 2] * 2]
            )
        wi, hi, wm, hm = w - 2 * t, h - 2 * t, w - t, h - t
        area = w * h - wi * hi
        about_y, about_z = (w * h**3 - wi * hi**3) / 12.0, (h * w**3 - hi * wi**3) / 12.0
        torsion = 2.0 * t * (wm * hm) ** 2 / (wm + hm)
        webs = [shear * 2 * t * w * 5 / 6, shear * 2 * t * h * 5 / 6]
        return np.array([shear * torsion, youngs * about_y, youngs * about_z, youngs * area, *webs])


@dataclass(frozen=True)
class Link:
    """A casing: path of points (k, 3) at home in base axes, its body (0 the base), sections at its ends."""

    name: str
    body: int
    path: Array
    up: Array
    start: Section
    end: Section
    youngs: float
    poisson: float

    def compliance(self) -> Array:
        """Spatial compliance (6, 6) at home of the whole link, by three Gauss points a piece of its path."""
        lengths = np.linalg.norm(np.diff(self.path, axis=0), axis=1)
        whole, total, done = float(lengths.sum()), np.zeros((6, 6)), 0.0
        nodes, weights = np.polynomial.legendre.leggauss(8)
        for a, b, length in zip(self.path[:-1], self.path[1:], lengths, strict=True):
            if length < 1e-9:
                continue
            along = (b - a) / length
            frame = _frame(along, self.up)
            for node, weight in zip(nodes, weights, strict=True):
                s = 0.5 * (1.0 + node)
                soft = 1.0 / self._section((done + s * length) / whole).stiffness(self.youngs, self.poisson)
                total += 0.5 * weight * length * _element(frame, a + s * (b - a), soft)
            done += length
        return total

    def _section(self, share: float) -> Section:
        a, b = self.start, self.end
        mixed = [(1 - share) * x + share * y for x, y in ((a.width, b.width), (a.height, b.height), (a.wall, b.wall))]
        return Section(a.box, *mixed)


def _frame(along: Array, up: Array) -> Array:
    """Axes (3, 3) of a section as rows: along the link, its width, its height."""
    height = up - (up @ along) * along
    if np.linalg.norm(height) < 1e-6:
        height = np.array([along[1], along[2], along[0]]) - (along[1] * along[0]) * along
        height -= (height @ along) * along
    height = height / np.linalg.norm(height)
    return np.stack([along, np.cross(height, along), height])


def _element(frame: Array, point: Array, soft: Array) -> Array:
    """Spatial compliance (6, 6) per length of a section at ``point``: six screws with their softness."""
    turns = [screw_through(axis, point) for axis in frame]
    slides = [np.concatenate([np.zeros(3), axis]) for axis in frame]
    screws = np.stack([*turns, *slides])
    return np.asarray(screws.T * soft @ screws)
