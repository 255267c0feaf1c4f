"""What an effect is, and effects of gears, bodies and links."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from .arm import DIRECTIONS, Arm, Dahl, Extra, Memoryless, Moment, Vector, beam, bell, linkage, triangle

Parameters = dict[str, float | list[float]]


@dataclass(frozen=True)
class Site:
    """Where a campaign takes place, as far as sizes depend on it.

    ``torques`` are the largest that the campaign's loads put on each joint (without the arm's own weight), ``held`` the
    typical ones of that weight, N m; ``xyz`` whether three directions are read.
    """

    arm: Arm
    springs: Mapping[str, float]
    torques: Mapping[str, float]
    held: Mapping[str, float]
    xyz: bool
    force: float


@dataclass
class Row:
    """One reading: what the table says about it, and when it is taken."""

    pose: str
    repeat: int
    phase: str
    angles: Vector
    force: Vector
    point: Vector
    level: int = 0
    moment: Moment = field(default_factory=Moment)


class Effect:
    """Something that is missing from the model. Each hook leaves things as they are unless an effect says otherwise.

    ``fading`` effects are those of the gauge and of the clock that a held-out set-up must not carry.
    """

    family = ""
    axis: ClassVar[tuple[str, ...]] = ("pose", "load")
    fading = False
    remembers = False
    timed = False

    def __init__(self, place: str, parameters: Parameters) -> None:
        self.place = place
        self.parameters = parameters

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Sizes, from FACTS' ranges."""
        raise NotImplementedError

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Where it may act in this arm; empty where it cannot."""
        return ["base"]

    def number(self, name: str) -> float:
        """Return one parameter."""
        value = self.parameters[name]
        assert isinstance(value, int | float), name
        return float(value)

    def vector(self, name: str) -> Vector:
        """Return a list of parameters."""
        return np.atleast_1d(np.asarray(self.parameters[name], dtype=float))

    def freedoms(self, arm: Arm) -> dict[str, tuple[str, ...]]:
        """Directions that give way because of it, by place."""
        return {}

    def compliance(self, C: Vector, where: Mapping[str, int], site: Site) -> None:
        """Change the matrix of compliances (rad/(N m), m/N)."""

    def factors(self, table: Vector, moment: Moment, where: Mapping[str, int], site: Site) -> dict[int, float]:
        """Factors on compliances of single freedoms at these angles and this moment."""
        return {}

    def extras(self, where: Mapping[str, int], site: Site) -> list[Extra]:
        """Laws beside the proportional ones."""
        return []

    def angles(self, real: Vector, site: Site) -> Vector:
        """Angles of the hinges from those that the table says they are (both rad, signs of the hinges)."""
        return real

    def force(self, force: Vector, row: Row) -> Vector:
        """Load in truth."""
        return force

    def lever(self, loaded: Vector, read: Vector) -> tuple[Vector, Vector]:
        """Loaded and read point in the flange's frame."""
        return loaded, read

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """Return what the gauge says (m), for a displacement of a point that stands at ``position`` (m)."""
        return displacement

    def begin(self) -> None:
        """Forget everything: a new campaign."""


def uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw between two bounds, to four digits."""
    return float(f"{rng.uniform(low, high):.4g}")


def scaled(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw between two bounds, all magnitudes alike, to four digits."""
    return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.4g}")


def signed(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw between two bounds, of either sign."""
    return float(rng.choice([-1.0, 1.0])) * uniform(rng, low, high)


def turn(axis: Vector, angle: float) -> Vector:
    """Rotation matrix (Rodrigues)."""
    k = axis / np.linalg.norm(axis)
    K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K))


def loaded_joints(site: Site, least: float = 0.02) -> list[str]:
    """Joints that the campaign's loads turn at all: their largest torque is a share of the force in metres."""
    return [name for name in site.arm.names if site.torques[name] > least * site.force]


def family_table(classes: list[type[Effect]]) -> dict[str, type[Effect]]:
    """By family; twice the same is a mistake."""
    table = {kind.family: kind for kind in classes}
    assert len(table) == len(classes)
    return table


Draw = Callable[[np.random.Generator, Site, str], Parameters]


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


NONLINEAR: list[type[Effect]] = [Hardening, Softening, Backlash, Friction]


class JointCompliance(Effect):
    """A joint that the model holds rigid; 5e4 to 2e6 N m/rad."""

    family = "joint-compliance"

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Loaded joints."""
        return loaded_joints(site)

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw about the joint's own spring, within the range."""
        own = site.springs[place]
        return {"stiffness_Nm_per_rad": float(np.clip(own * scaled(rng, 0.6, 1.6), 5e4, 2e6))}

    def compliance(self, C: Vector, where: Mapping[str, int], site: Site) -> None:
        """Set it."""
        i = where[self.place]
        C[i, i] = 1 / self.number("stiffness_Nm_per_rad")


class JointTilt(Effect):
    """Main bearing gives about the two axes across its own, not alike; 5e5 to 5e6 N m/rad."""

    family = "joint-tilt"

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The first four joints."""
        return list(site.arm.names[:4])

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw one stiffness, and how much the other axis differs."""
        first = scaled(rng, 5e5, 5e6)
        return {"stiffness_Nm_per_rad": [first, float(np.clip(first * scaled(rng, 0.6, 1.7), 5e5, 5e6))]}

    def _across(self, arm: Arm) -> tuple[str, str]:
        axis = "xyz"[int(np.argmax(np.abs(arm.joints[arm.index(self.place)].axis)))]
        first, second = (d for d in "xyz" if d != axis)
        return f"r{first}", f"r{second}"

    def freedoms(self, arm: Arm) -> dict[str, tuple[str, ...]]:
        """Two hinges across the joint's."""
        return {self.place: self._across(arm)}

    def compliance(self, C: Vector, where: Mapping[str, int], site: Site) -> None:
        """Add them."""
        for direction, k in zip(self._across(site.arm), self.vector("stiffness_Nm_per_rad"), strict=True):
            i = where[f"{self.place}.{direction}"]
            C[i, i] += 1 / k


class AngleDependent(Effect):
    """A gear that is softer over part of its turn, 10 to 45 %: one or two worn sectors, von Mises' bells."""

    family = "angle-dependent-stiffness"

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Loaded joints but the first, whose angle is often the same."""
        return [name for name in loaded_joints(site) if name != site.arm.names[0]]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw sectors within the joint's limits."""
        low, high = site.arm.joints[site.arm.index(place)].limits
        count = int(rng.integers(1, 3))
        return {
            "softer": [uniform(rng, 0.1, 0.45) for _ in range(count)],
            "centre_rad": [uniform(rng, max(low, -2.5), min(high, 2.5)) for _ in range(count)],
            "sharpness": [uniform(rng, 0.8, 4.0) for _ in range(count)],
        }

    def factors(self, table: Vector, moment: Moment, where: Mapping[str, int], site: Site) -> dict[int, float]:
        """Factor on the joint's compliance."""
        i = where[self.place]
        sectors = zip(self.vector("softer"), self.vector("centre_rad"), self.vector("sharpness"), strict=True)
        return {i: 1 + sum(size * bell(table[i], centre, sharp) for size, centre, sharp in sectors)}


class GearRipple(AngleDependent):
    """Meshing gears: compliance rises and falls as a triangular wave with the teeth, 10 to 30 %."""

    family = "gear-ripple"

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw teeth and size."""
        return {"size": uniform(rng, 0.1, 0.3), "teeth": int(rng.integers(17, 61)), "phase": uniform(rng, 0, 6.28)}

    def factors(self, table: Vector, moment: Moment, where: Mapping[str, int], site: Site) -> dict[int, float]:
        """Factor on the joint's compliance."""
        i = where[self.place]
        wave = triangle(self.number("teeth") * table[i] + self.number("phase"))
        return {i: 1 + self.number("size") * wave}


class GravityCompensator(Effect):
    """A spring past joint 2 adds 10 to 40 % of its stiffness, most where linkage and spring stand best."""

    family = "gravity-compensator"

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The shoulder."""
        return [site.arm.names[1]]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw size and where the linkage is dead."""
        return {"share": uniform(rng, 0.1, 0.4), "centre_rad": uniform(rng, -1.5, 1.5)}

    def factors(self, table: Vector, moment: Moment, where: Mapping[str, int], site: Site) -> dict[int, float]:
        """Stiffness adds to stiffness."""
        i = where[self.place]
        return {i: 1 / (1 + self.number("share") * linkage(table[i], self.number("centre_rad")))}


class BaseTilt(Effect):
    """A foot that rocks about two axes, not alike; 2e6 to 1e8 N m/rad."""

    family = "base-tilt"

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw both axes."""
        first = scaled(rng, 2e6, 3e7)
        return {"stiffness_Nm_per_rad": [first, float(np.clip(first * scaled(rng, 0.5, 2.0), 2e6, 1e8))]}

    def freedoms(self, arm: Arm) -> dict[str, tuple[str, ...]]:
        """Two hinges in the floor."""
        return {"base": ("rx", "ry")}

    def compliance(self, C: Vector, where: Mapping[str, int], site: Site) -> None:
        """Add them."""
        for name, k in zip(("base.rx", "base.ry"), self.vector("stiffness_Nm_per_rad"), strict=True):
            C[where[name], where[name]] += 1 / k


class BaseVertical(Effect):
    """A floor that goes down; 2e6 to 3e7 N/m."""

    family = "base-vertical"

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw it."""
        return {"stiffness_N_per_m": scaled(rng, 2e6, 3e7)}

    def freedoms(self, arm: Arm) -> dict[str, tuple[str, ...]]:
        """One slide."""
        return {"base": ("tz",)}

    def compliance(self, C: Vector, where: Mapping[str, int], site: Site) -> None:
        """Add it."""
        C[where["base.tz"], where["base.tz"]] += 1 / self.number("stiffness_N_per_m")


class ToolCompliance(Effect):
    """A slender tool or sensor: 1.5e-7 to 6e-7 m/N across its axis, the two ways not quite alike."""

    family = "tool-compliance"

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The tool."""
        return ["tool"]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw both ways."""
        first = scaled(rng, 1.5e-7, 6e-7)
        return {"compliance_m_per_N": [first, float(np.clip(first * scaled(rng, 0.8, 1.25), 1.5e-7, 6e-7))]}

    def freedoms(self, arm: Arm) -> dict[str, tuple[str, ...]]:
        """Two slides."""
        return {"tool": ("tx", "ty")}

    def compliance(self, C: Vector, where: Mapping[str, int], site: Site) -> None:
        """Add them."""
        for name, c in zip(("tool.tx", "tool.ty"), self.vector("compliance_m_per_N"), strict=True):
            C[where[name], where[name]] += c


class LinkFlexibility(Effect):
    """A casing that bends and twists as a beam, several times more than its drawing says."""

    family = "link-flexibility"

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Casings between two joints that are apart."""
        arm = site.arm
        found = []
        for link in arm.links:
            after = arm.index(link.body) + 1 if link.body in arm.names else 0
            if link.bending and 2 <= after < len(arm.joints) and np.linalg.norm(arm.joints[after].position) > 0.3:
                found.append(link.name)
        return found

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Factor on the beam's compliance: castings with windows."""
        return {"factor": scaled(rng, 2.0, 8.0)}

    def _next(self, arm: Arm) -> int:
        return arm.index(next(link.body for link in arm.links if link.name == self.place)) + 1

    def freedoms(self, arm: Arm) -> dict[str, tuple[str, ...]]:
        """All six at the next joint."""
        return {arm.names[self._next(arm)]: DIRECTIONS}

    def compliance(self, C: Vector, where: Mapping[str, int], site: Site) -> None:
        """Add the cantilever's tip, turned into the next joint's axes."""
        after = site.arm.joints[self._next(site.arm)]
        link = next(link for link in site.arm.links if link.name == self.place)
        tip = beam(after.position, link.bending, link.twisting, link.stretching) * self.number("factor")
        turned = np.kron(np.eye(2), after.rotation)
        slots = [where[f"{after.name}.{direction}"] for direction in DIRECTIONS]
        C[np.ix_(slots, slots)] += turned.T @ tip @ turned


class WristCoupling(Effect):
    """The hand's two gears share a housing: each turns by 20 to 60 % of what ties them, under the other's torque."""

    family = "wrist-coupling"

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The joint before the bend; arms without such a hand have none."""
        return [site.arm.wrist()[0]] if len(site.arm.joints) >= 6 else []

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw the share of the geometric mean of both compliances."""
        return {"kappa": signed(rng, 0.2, 0.6)}

    def compliance(self, C: Vector, where: Mapping[str, int], site: Site) -> None:
        """Set both off-diagonal entries."""
        i, j = (where[name] for name in site.arm.wrist())
        C[i, j] = C[j, i] = self.number("kappa") * np.sqrt(C[i, i] * C[j, j])


class ParallelogramBar(Effect):
    """The bar stretches: the forearm turns by more where the parallelogram is flat; 2 to 8e7 N/m."""

    family = "parallelogram-bar"

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Arms with a bar."""
        return ["link"] if site.arm.parallelogram else []

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw the bar with its pins: far softer than the tube."""
        return {"stiffness_N_per_m": scaled(rng, 1e7, 6e7)}

    def factors(self, table: Vector, moment: Moment, where: Mapping[str, int], site: Site) -> dict[int, float]:
        """Series with the third spring."""
        bar = 1 / (self.number("stiffness_N_per_m") * (site.arm.pin * np.sin(table[2])) ** 2)
        return {2: 1 + bar * site.springs[site.arm.names[2]]}


class LoadPath(Effect):
    """The model takes the arm for a plain chain, but a parallelogram drives the forearm."""

    family = "load-path"

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Arms with a bar."""
        return ["link"] if site.arm.parallelogram else []

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Nothing to draw."""
        return {"share": 1.0}


ELASTIC: list[type[Effect]] = [
    JointCompliance,
    JointTilt,
    AngleDependent,
    GearRipple,
    GravityCompensator,
    BaseTilt,
    BaseVertical,
    ToolCompliance,
    LinkFlexibility,
    WristCoupling,
    ParallelogramBar,
    LoadPath,
]
