"""What an effect may do: nine places at which it can act on the arm, the load, the pose or the reading."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from .arm import Arm, Vector
from .laws import Extra, Moment

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
