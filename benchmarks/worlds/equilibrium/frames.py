"""Effects on what the table says, and those that no catalogue has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from .arm import Arm, Creep, Dahl, Extra, Memoryless, Moment, Step, Vector
from .effects import (
    Effect,
    Friction,
    LoadPath,
    Parameters,
    Row,
    Site,
    WristCoupling,
    loaded_joints,
    scaled,
    signed,
    turn,
    uniform,
)


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


FRAMES: list[type[Effect]] = [
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


OUTSIDE: list[type[Effect]] = [
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
