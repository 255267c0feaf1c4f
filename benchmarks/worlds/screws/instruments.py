"""Gauges, a load cell and a laser tracker: covariance of a reading's noise, and noise drawn with it, in m.

Laser tracker: range noise of a few um along the beam, angle noise of 1.5 to 5 um a metre of distance across it (makers
state some 10 to 15 um + 5 to 6 um/m as limits of error for absolute points; a difference of two near ones is better).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .screws import Array, Whole

KINDS = ("share-of-component", "share-of-vector", "load", "white", "by-axis", "heavy-tailed", "session")


@dataclass(frozen=True)
class Instrument:
    """An instrument: kind, its size (a share, or m; m a metre for the tracker), floor, place (3,), session's offset."""

    kind: str
    size: float
    floor: float
    place: tuple[float, float, float]
    offset: float
    resolution: float

    def covariance(self, d: Array, point: Array, force: Array, full: float) -> Array:
        """Covariance (n, 3, 3) of independent noise of each reading, with that of rounding."""
        square = np.full_like(d, self.size**2)
        if self.kind == "share-of-component":
            square = self.floor**2 + (self.size * d) ** 2
        elif self.kind == "share-of-vector":
            square = self.floor**2 + self.size**2 * np.sum(d**2, axis=1, keepdims=True) * np.ones(3)
        elif self.kind == "load":
            square = self.floor**2 + (self.size * np.linalg.norm(force, axis=1, keepdims=True) / full) ** 2 * np.ones(3)
        out = square[:, :, None] * np.eye(3)
        if self.kind == "by-axis":
            beam = point - np.asarray(self.place)
            away = np.linalg.norm(beam, axis=1)
            along = beam / away[:, None]
            across = np.eye(3) - along[:, :, None] * along[:, None, :]
            out = (
                self.floor**2 * along[:, :, None] * along[:, None, :] + (self.size * away[:, None, None]) ** 2 * across
            )
        return np.asarray(out + self.resolution**2 / 12.0 * np.eye(3))

    def noise(self, rng: np.random.Generator, covariance: Array, session: Whole) -> Array:
        """Noise (n, 3) with that covariance; heavy tails by a common divisor of a reading's axes; session's offset."""
        rows = len(covariance)
        rounding = self.resolution**2 / 12.0 * np.eye(3)
        root = np.linalg.cholesky(covariance - rounding + 1e-24 * np.eye(3))
        draw = rng.normal(size=(rows, 3))
        if self.kind == "heavy-tailed":
            draw = draw / np.sqrt(rng.chisquare(3.0, size=(rows, 1)))  # t with 3 degrees of freedom, of variance 1
        out = np.einsum("nij,nj->ni", root, draw)
        if self.offset > 0.0:
            names, where = np.unique(session, return_inverse=True)
            out = out + rng.normal(scale=self.offset, size=(len(names), 3))[where]
        return np.asarray(out)

    def rounded(self, d: Array) -> Array:
        """Readings as the display shows them."""
        return np.asarray(np.round(d / self.resolution) * self.resolution)


def instrument(kind: str, rng: np.random.Generator, reach: float) -> Instrument:
    """An instrument of that kind with drawn sizes; a tracker stands 2 to 6 m away from the arm's base."""
    um = 1e-6
    size = {
        "share-of-component": rng.uniform(0.01, 0.03),
        "share-of-vector": rng.uniform(0.01, 0.03),
        "load": rng.uniform(8, 25) * um,
        "white": rng.uniform(5, 30) * um,
        "by-axis": rng.uniform(1.5, 5.0) * um,
        "heavy-tailed": rng.uniform(5, 20) * um,
        "session": rng.uniform(5, 15) * um,
    }[kind]
    floor = rng.uniform(2, 5) * um
    heading, away = rng.uniform(-1.0, 1.0), reach + rng.uniform(1.0, 4.0)
    place = (away * float(np.cos(heading)), away * float(np.sin(heading)), float(rng.uniform(0.5, 1.8)))
    offset = float(rng.uniform(8, 25)) * um if kind == "session" else 0.0
    return Instrument(kind, float(size), float(floor), place, offset, float(rng.choice([1e-6, 1e-6, 1e-5])))
