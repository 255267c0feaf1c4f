"""Catalogue effects of what the table says: loads, points, angles, axes and the gauge."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from .arm import Vector
from .effect import Effect, Parameters, Row, Site, scaled, signed, turn, uniform


class OfLoad(Effect):
    """What is wrong with the load."""

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The load."""
        return ["load"]


class Payload(OfLoad):
    """Hook and shackle that nobody weighed: 20 to 60 N that hang with every load, never without."""

    family = "payload"
    axis: ClassVar[tuple[str, ...]] = ("load",)

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw it."""
        return {"force_N": uniform(rng, 20, 60)}

    def force(self, force: Vector, row: Row) -> Vector:
        """Add it downward."""
        hung = np.linalg.norm(force) > 0
        return np.asarray(force - np.array([0, 0, self.number("force_N") * hung]))


class LoadPointOffset(OfLoad):
    """The load hangs 15 to 45 mm beside the point that is read."""

    family = "load-point-offset"
    axis: ClassVar[tuple[str, ...]] = ("pose", "load")

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw it in the flange's frame, any direction."""
        way = rng.normal(size=3)
        return {"offset_m": [float(f"{x:.4g}") for x in way / np.linalg.norm(way) * rng.uniform(0.015, 0.045)]}

    def lever(self, loaded: Vector, read: Vector) -> tuple[Vector, Vector]:
        """Shift one."""
        return loaded + self.vector("offset_m"), read


class ToolPointOffset(LoadPointOffset):
    """Both points are 15 to 45 mm from where the table has them."""

    family = "tool-point-offset"

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The tool."""
        return ["tool"]

    def lever(self, loaded: Vector, read: Vector) -> tuple[Vector, Vector]:
        """Shift both."""
        return loaded + self.vector("offset_m"), read + self.vector("offset_m")


class LoadMisalignment(OfLoad):
    """The load pulls 1.5 to 4.5 deg aside."""

    family = "load-misalignment"
    axis: ClassVar[tuple[str, ...]] = ("load", "direction", "pose")

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw where to."""
        way = rng.uniform(0, 2 * np.pi)
        return {"axis": [float(np.cos(way)), float(np.sin(way)), 0.0], "angle_deg": uniform(rng, 1.5, 4.5)}

    def force(self, force: Vector, row: Row) -> Vector:
        """Turn it."""
        return turn(self.vector("axis"), np.radians(self.number("angle_deg"))) @ force


class TurnedFrame(LoadMisalignment):
    """The table's forces and displacements stand in axes turned by 1.5 to 6 deg against the arm's."""

    family = "turned-frame"
    axis: ClassVar[tuple[str, ...]] = ("direction", "pose", "load")

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The base, where three directions are read."""
        return ["base"] if site.xyz else []

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw one of the base's axes."""
        return {"axis": np.eye(3)[int(rng.integers(3))].tolist(), "angle_deg": signed(rng, 1.5, 6.0)}

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """Say it in the table's axes."""
        return turn(self.vector("axis"), -np.radians(self.number("angle_deg"))) @ displacement


class JointZero(Effect):
    """A joint stands 0.3 to 3 deg off, one way or the other."""

    family = "joint-zero-offset"
    axis: ClassVar[tuple[str, ...]] = ("pose",)
    low, high = 0.3, 3.0

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Joints whose angle matters: all but the first."""
        return list(site.arm.names[1:-1])

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw it."""
        return {"offset_deg": float(rng.choice([-1, 1])) * scaled(rng, cls.low, cls.high)}

    def angles(self, real: Vector, site: Site) -> Vector:
        """Turn the hinge on."""
        out = real.copy()
        out[site.arm.index(self.place)] += np.radians(self.number("offset_deg"))
        return out


class AngleOffset(JointZero):
    """The table counts an angle from another zero: the horizontal, or the arm folded."""

    family = "angle-offset"

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw a customary zero."""
        return {"offset_deg": float(rng.choice([-90, 90, 180, -30, 45]))}


class AngleSign(JointZero):
    """The table counts an angle the other way round."""

    family = "angle-sign"

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Nothing to draw."""
        return {"sign": -1.0}

    def angles(self, real: Vector, site: Site) -> Vector:
        """Mirror about the table's zero."""
        out, i = real.copy(), site.arm.index(self.place)
        out[i] = 2 * site.arm.joints[i].offset - out[i]
        return out


class AngleCoupling(JointZero):
    """The table's elbow counts from the horizontal: the shoulder's angle is part of it."""

    family = "angle-coupling"

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The elbow of arms whose elbow follows the shoulder directly."""
        first, second = site.arm.main()
        return [second] if site.arm.index(second) == site.arm.index(first) + 1 else []

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw its sign."""
        return {"factor": float(rng.choice([-1, 1]))}

    def angles(self, real: Vector, site: Site) -> Vector:
        """Add the shoulder's."""
        out, i = real.copy(), site.arm.index(self.place)
        shoulder = site.arm.joints[i - 1]
        out[i] += self.number("factor") * shoulder.sign * (real[i - 1] - shoulder.offset)
        return out


class GaugeZero(Effect):
    """The gauge was set a little beside its zero: 15 to 45 um in each direction that it reads."""

    family = "gauge-zero"
    axis: ClassVar[tuple[str, ...]] = ("load",)

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The gauge."""
        return ["gauge"]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw each direction."""
        return {"offset_m": [signed(rng, 15e-6, 45e-6) for _ in range(3)]}

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """Add it."""
        return displacement + self.vector("offset_m")


class GaugeScale(GaugeZero):
    """The gauge's lever is 2 to 8 % off: all springs at once, so nobody can tell."""

    family = "gauge-scale"

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw it."""
        return {"scale": 1 + signed(rng, 0.02, 0.08)}

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """Scale."""
        return displacement * self.number("scale")


class Drift(GaugeZero):
    """The gauge wanders by 25 to 90 um: quickly at first and on for ever (log), or late, with the sun (logistic)."""

    family = "drift"
    axis: ClassVar[tuple[str, ...]] = ("clock",)
    fading = True
    timed = True

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw amount, law and where in the campaign it happens."""
        return {
            "amount_m": [signed(rng, 25e-6, 90e-6) for _ in range(3)],
            "law": float(rng.integers(2)),
            "when": uniform(rng, 0.2, 0.7),
        }

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """Add what the clock says."""
        t, when = row.moment.progress, self.number("when")
        late = 1 / (1 + np.exp(-12 * (t - when)))
        course = late if self.number("law") else np.log1p(t / (0.1 * when)) / np.log1p(1 / (0.1 * when))
        return np.asarray(displacement + self.vector("amount_m") * course)


KINDS: list[type[Effect]] = [
    Payload,
    LoadPointOffset,
    ToolPointOffset,
    LoadMisalignment,
    TurnedFrame,
    JointZero,
    AngleOffset,
    AngleSign,
    AngleCoupling,
    GaugeZero,
    GaugeScale,
    Drift,
]
