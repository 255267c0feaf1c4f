"""Effects that the catalogue does not have, most of them in time or in the history of loads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from .arm import Arm, Vector
from .effect import Effect, Parameters, Row, Site, loaded_joints, scaled, signed, uniform
from .elastic import LoadPath, WristCoupling
from .laws import Creep, Dahl, Extra, Memoryless, Moment, Step
from .nonlinear import Friction


class Creeping(Effect):
    """A gear that goes on giving, and recovers: 5 to 20 % within minutes, 10 to 35 % within the hour."""

    family = "creep"
    axis: ClassVar[tuple[str, ...]] = ("clock", "load history")
    remembers = True

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Loaded joints."""
        return loaded_joints(site, 0.1)

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw shares and times."""
        return {
            "shares": [uniform(rng, 0.05, 0.2), uniform(rng, 0.1, 0.35)],
            "times_s": [scaled(rng, 60, 300), scaled(rng, 1200, 5400)],
        }

    def extras(self, where: Mapping[str, int], site: Site) -> list[Extra]:
        """One law that remembers."""
        (a, b), (s, t) = self.vector("shares"), self.vector("times_s")
        return [Creep(where[self.place], 1 / site.springs[self.place], (a, b), (s, t))]


class StickSlip(Friction):
    """Friction that lets go by chance: another limit in each load cycle."""

    family = "stick-slip"

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw the largest limit and how much of it each cycle finds."""
        slips = [uniform(rng, 0.1, 1.0) for _ in range(37)]
        return {"torque_Nm": uniform(rng, 100, 225), "stick_ratio": scaled(rng, 8, 30), "slips": slips}

    def extras(self, where: Mapping[str, int], site: Site) -> list[Extra]:
        """One law that remembers."""
        k = site.springs[self.place]
        stick, slips = k * self.number("stick_ratio"), tuple(self.vector("slips").tolist())
        return [Dahl(where[self.place], 1 / k, self.number("torque_Nm"), stick, slips)]


class Slip(Effect):
    """A fixture slips once in the middle of the campaign: the base, a gear's flange or the tool."""

    family = "slip"
    axis: ClassVar[tuple[str, ...]] = ("clock", "pose")
    fading = True
    timed = True

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Base, shoulder, elbow and tool."""
        return ["base", *site.arm.main(), "tool"]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw when, and by how much: rad of the base's tilt or a joint, m of the tool."""
        sizes = {"base": (2e-5, 8e-5), "tool": (4e-5, 1.2e-4)}
        low, high = sizes.get(place, (5e-5, 2e-4))
        return {"amount": [signed(rng, low, high) for _ in range(2)], "when": uniform(rng, 0.25, 0.75)}

    def _names(self) -> tuple[str, ...]:
        return {"base": ("base.rx", "base.ry"), "tool": ("tool.tx", "tool.ty")}.get(self.place, (self.place,))

    def freedoms(self, arm: Arm) -> dict[str, tuple[str, ...]]:
        """Hinges of the base or slides of the tool, which are stiff."""
        return {self.place: tuple(name.split(".")[1] for name in self._names() if "." in name)}

    def extras(self, where: Mapping[str, int], site: Site) -> list[Extra]:
        """A step in each."""
        amounts = self.vector("amount")
        return [
            Step(where[name], float(a), self.number("when")) for name, a in zip(self._names(), amounts, strict=False)
        ]


class Warming(Effect):
    """A joint's gear softens (or, preloaded, stiffens) by 10 to 40 % over the day, and is cold next morning."""

    family = "warming"
    axis: ClassVar[tuple[str, ...]] = ("clock", "temperature", "session")
    timed = True

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Loaded joints."""
        return loaded_joints(site, 0.1)

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw how much and how fast."""
        change = uniform(rng, 0.12, 0.4) if rng.random() < 0.7 else -uniform(rng, 0.1, 0.25)
        return {"change": change, "time_s": scaled(rng, 1800, 9000)}

    def factors(self, table: Vector, moment: Moment, where: Mapping[str, int], site: Site) -> dict[int, float]:
        """Factor on the joint's compliance."""
        warm = 1 - np.exp(-moment.day_s / self.number("time_s"))
        return {where[self.place]: float(1 + self.number("change") * warm)}


class RunIn(Warming):
    """Bearings settle: a joint is 20 to 60 % softer at first and gets stiffer with each load cycle."""

    family = "other:run-in"
    axis: ClassVar[tuple[str, ...]] = ("clock", "load history")

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw how much and how fast."""
        return {"change": uniform(rng, 0.2, 0.6), "share": uniform(rng, 0.1, 0.5)}

    def factors(self, table: Vector, moment: Moment, where: Mapping[str, int], site: Site) -> dict[int, float]:
        """Factor on the joint's compliance."""
        return {where[self.place]: float(1 + self.number("change") * np.exp(-moment.used / self.number("share")))}


class LooseBase(Effect):
    """Anchors without tension: an edge of the foot lifts beyond some moment."""

    family = "loose-base"
    axis: ClassVar[tuple[str, ...]] = ("pose", "load")

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw moment and softness."""
        shoulder = site.arm.names[1]
        least = 0.3 * site.torques[shoulder]
        moment = site.held[shoulder] + rng.uniform(-0.3, 0.5) * site.torques[shoulder]
        return {"moment_Nm": float(f"{max(least, moment):.4g}"), "stiffness_Nm_per_rad": scaled(rng, 2e6, 1.5e7)}

    def freedoms(self, arm: Arm) -> dict[str, tuple[str, ...]]:
        """Two hinges in the floor."""
        return {"base": ("rx", "ry")}

    def extras(self, where: Mapping[str, int], site: Site) -> list[Extra]:
        """Both lift alike."""
        c, moment = 1 / self.number("stiffness_Nm_per_rad"), self.number("moment_Nm")
        return [Memoryless(where[name], "lifting", c, 1.0, moment) for name in ("base.rx", "base.ry")]


class CablePackage(Effect):
    """Hoses along the hand: stiffer by up to 20 to 60 % where they are wound up, and they rub."""

    family = "cable-package"
    axis: ClassVar[tuple[str, ...]] = ("pose", "load history")
    remembers = True

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The hand."""
        return [site.arm.wrist()[0]]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw stiffness, where they hang free, and friction."""
        return {"share": uniform(rng, 0.2, 0.6), "free_rad": uniform(rng, -1.0, 1.0), "torque_Nm": uniform(rng, 5, 25)}

    def factors(self, table: Vector, moment: Moment, where: Mapping[str, int], site: Site) -> dict[int, float]:
        """Both joints of the hand."""
        i, j = (where[name] for name in site.arm.wrist())
        wound = np.sin((table[i] - self.number("free_rad")) / 2) ** 2
        factor = float(1 / (1 + self.number("share") * wound))
        return {i: factor, j: factor}

    def extras(self, where: Mapping[str, int], site: Site) -> list[Extra]:
        """Friction of the bend."""
        bend = site.arm.wrist()[1]
        k = site.springs[bend]
        return [Dahl(where[bend], 1 / k, self.number("torque_Nm"), 3 * k)]


class PartialLoadPath(LoadPath):
    """A bar so soft, or so badly hung, that the forearm's moment goes down it only in part: 30 to 80 %."""

    family = "partial-load-path"

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw the part."""
        return {"share": uniform(rng, 0.3, 0.8)}


class JointCoupling(WristCoupling):
    """Shoulder and elbow sit in one housing that gives: each turns under the other's torque."""

    family = "other:joint-coupling"

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The shoulder."""
        return [site.arm.main()[0]]

    def compliance(self, C: Vector, where: Mapping[str, int], site: Site) -> None:
        """Set both off-diagonal entries."""
        i, j = (where[name] for name in site.arm.main())
        C[i, j] = C[j, i] = self.number("kappa") * np.sqrt(C[i, i] * C[j, j])


class LoadCellLag(Effect):
    """The load cell remembers: unloading, the true load is 1.5 to 5 % above what it says, most halfway."""

    family = "other:load-cell-lag"
    axis: ClassVar[tuple[str, ...]] = ("load history", "load")

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The load."""
        return ["load"]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw it."""
        return {"lag": uniform(rng, 0.015, 0.05), "full_N": float(f"{site.force:.5g}")}

    def force(self, force: Vector, row: Row) -> Vector:
        """Return more on the way back."""
        part = float(np.linalg.norm(force)) / self.number("full_N")
        back = 1.0 if row.phase == "unloading" else 0.0
        return np.asarray(force * (1 + back * self.number("lag") * (1.15 - part)))


class GaugeStick(Effect):
    """The gauge's rod sticks: it follows only once it is 12 to 45 um behind."""

    family = "other:gauge-stick"
    axis: ClassVar[tuple[str, ...]] = ("load history",)
    remembers = True
    fading = True

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The gauge."""
        return ["gauge"]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw it."""
        return {"width_m": scaled(rng, 12e-6, 45e-6)}

    def begin(self) -> None:
        """Nothing read yet."""
        self._pose, self._says = "", np.zeros(3)

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """Follow with play."""
        if row.pose != self._pose:
            self._pose, self._says = row.pose, np.zeros(3)
        width = self.number("width_m")
        self._says = np.clip(self._says, displacement - width, displacement + width)
        return self._says


KINDS: list[type[Effect]] = [
    Creeping,
    StickSlip,
    Slip,
    Warming,
    RunIn,
    LooseBase,
    CablePackage,
    PartialLoadPath,
    JointCoupling,
    LoadCellLag,
    GaugeStick,
]
