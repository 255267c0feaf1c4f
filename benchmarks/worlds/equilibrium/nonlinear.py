"""Catalogue effects whose share is not proportional to the load: gears that harden, soften, have play or rub."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from .effect import Effect, Parameters, Site, loaded_joints, scaled, uniform
from .laws import Dahl, Extra, Memoryless


class Hardening(Effect):
    """Compliance falls by 35 to 75 %: smoothly (asinh), or where a second pair of teeth comes to bear."""

    family = "hardening"
    kinds: tuple[str, ...] = ("asinh", "two-teeth")

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Loaded joints."""
        return loaded_joints(site, 0.1)

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw how much, and at which torque."""
        full = site.torques[place] + 0.5 * site.held[place]
        return {
            "law": float(rng.integers(len(cls.kinds))),
            "size": uniform(rng, 0.35, 0.75),
            "reference_Nm": float(f"{full * rng.uniform(0.25, 0.6):.4g}"),
        }

    def extras(self, where: Mapping[str, int], site: Site) -> list[Extra]:
        """One law."""
        kind = self.kinds[int(self.number("law"))]
        compliance = 1 / site.springs[self.place]
        shape = float(self.parameters.get("exponent", 2.0))  # type: ignore[arg-type]
        size, reference = self.number("size"), self.number("reference_Nm")
        return [Memoryless(where[self.place], kind, compliance, size, reference, shape)]


class Softening(Hardening):
    """Ramberg and Osgood's law: 20 to 70 % more at the largest torque, with an exponent of 2.5 to 4."""

    family = "softening"
    kinds = ("ramberg-osgood",)

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw how much, and how suddenly."""
        full = site.torques[place] + 0.5 * site.held[place]
        return {
            "law": 0.0,
            "size": uniform(rng, 0.2, 0.7),
            "reference_Nm": float(f"{full * rng.uniform(0.7, 1.0):.4g}"),
            "exponent": uniform(rng, 2.5, 4.0),
        }


class Backlash(Hardening):
    """A clearance of 0.3 to 0.9 mrad whose corners are rounded."""

    family = "backlash"
    kinds = ("dead-zone",)

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Joints that the arm's weight does not hold on one flank throughout."""
        return [name for name in loaded_joints(site, 0.05) if site.held[name] < 2 * site.torques[name]]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw the clearance, and the torque at which it is closed to 70 %."""
        closing = float(f"{site.torques[place] * rng.uniform(0.02, 0.08):.4g}")
        return {"law": 0.0, "size": uniform(rng, 3e-4, 9e-4), "reference_Nm": closing}


class Friction(Effect):
    """Dahl's friction beside the gear's spring, 60 to 225 N m at shoulder or elbow."""

    family = "friction"
    axis: ClassVar[tuple[str, ...]] = ("load history", "load")
    remembers = True

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Shoulder and elbow, where they are loaded."""
        return [name for name in site.arm.main() if name in loaded_joints(site, 0.1)]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw the limit, and how stiff the rubbing parts are against the gear."""
        return {"torque_Nm": uniform(rng, 60, 225), "stick_ratio": scaled(rng, 1.5, 10.0)}

    def extras(self, where: Mapping[str, int], site: Site) -> list[Extra]:
        """One law that remembers."""
        k = site.springs[self.place]
        return [Dahl(where[self.place], 1 / k, self.number("torque_Nm"), k * self.number("stick_ratio"))]


KINDS: list[type[Effect]] = [Hardening, Softening, Backlash, Friction]
