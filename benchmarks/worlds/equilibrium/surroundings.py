"""Effects outside of the catalogue that come from the hall, the floor and the people, and act on the reading."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from .arm import Vector
from .effect import Effect, Parameters, Row, Site, scaled, signed, uniform

# Expansion per K: steel, and the aluminium of a gauge's stand.
STEEL, ALUMINIUM = 11.7e-6, 23.1e-6


class People(Effect):
    """From day two on somebody else reads: another lever of the gauge (3 to 9 %), another zero (15 to 60 um)."""

    family = "other:people"
    axis: ClassVar[tuple[str, ...]] = ("session",)
    fading = True
    timed = True

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The gauge."""
        return ["gauge"]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw both."""
        return {"scale": 1 + signed(rng, 0.03, 0.09), "offset_m": [signed(rng, 15e-6, 60e-6) for _ in range(3)]}

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """All days but the first."""
        if row.moment.session == 0:
            return displacement
        return displacement * self.number("scale") + self.vector("offset_m")


class BumpedGauge(People):
    """Someone touched the gauge: 30 to 90 um from then on."""

    family = "other:bumped-gauge"
    axis: ClassVar[tuple[str, ...]] = ("clock",)

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw when and by how much."""
        return {"step_m": [signed(rng, 30e-6, 90e-6) for _ in range(3)], "when": uniform(rng, 0.25, 0.75)}

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """Step."""
        return displacement + self.vector("step_m") * (row.moment.progress >= self.number("when"))


class WarmStand(People):
    """The gauge's aluminium stand, 0.6 to 1.6 m high, grows with the hall's air."""

    family = "other:warm-stand"
    axis: ClassVar[tuple[str, ...]] = ("temperature", "clock")

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw its height, and how far it leans out."""
        return {"stand_m": [signed(rng, 0.1, 0.5), signed(rng, 0.1, 0.5), uniform(rng, 0.6, 1.6)]}

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """The gauge moves, so the arm seems to move the other way."""
        return displacement - self.vector("stand_m") * ALUMINIUM * row.moment.air


class WarmFrame(People):
    """The arm's iron grows with the hall, hours behind the air: the further out, the more."""

    family = "other:warm-frame"
    axis: ClassVar[tuple[str, ...]] = ("temperature", "pose", "clock")

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Links."""
        return ["link"]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw how much of the expansion shows (the gauge's stand does its part)."""
        return {"shown": uniform(rng, 0.6, 1.2)}

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """All of the position grows."""
        return displacement + position * self.number("shown") * STEEL * row.moment.iron


class FloorCreep(People):
    """The floor goes on sagging under the load's moment, by the square of the reach: 20 to 80 um at 1.5 m."""

    family = "other:floor-creep"
    axis: ClassVar[tuple[str, ...]] = ("clock", "pose", "load")
    fading = False

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The base."""
        return ["base"]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw how much, how fast."""
        return {"sag_m": scaled(rng, 20e-6, 80e-6), "share": uniform(rng, 0.15, 1.0), "full_N": site.force}

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """Return more of it as time goes on."""
        course = 1 - np.exp(-max(row.moment.progress, 0) / self.number("share"))
        part = row.force[2] / self.number("full_N")
        sag = self.number("sag_m") * course * part * (position[0] ** 2 + position[1] ** 2) / 1.5**2
        return np.asarray(displacement + np.array([0, 0, sag]))


KINDS: list[type[Effect]] = [People, BumpedGauge, WarmStand, WarmFrame, FloorCreep]
