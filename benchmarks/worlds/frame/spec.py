"""What a set is made from, all of it in its key: arm, what is hidden, what was measured, and how badly."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arms import Arm, load

Array = NDArray[np.float64]
ANGLE_DIGITS = 4


@dataclass(frozen=True)
class Effect:
    """A law by its family, where it acts, and its numbers."""

    family: str
    place: str
    numbers: dict[str, Any]


@dataclass(frozen=True)
class Spec:
    """One set. Lengths in m, loads in N, springs in N m/rad; a stated spring of 0 is a rigid joint."""

    seed: int
    kind: str
    arm: str
    path: str
    springs: tuple[float, ...]
    stated: tuple[float, ...]
    reads: str
    poses: int
    grid: bool
    loads: tuple[float, ...]
    down: bool
    repeats: int
    second: tuple[float, ...]  # direction of every other set-up's load; none: all go down
    sessions: int
    columns: tuple[str, ...]
    scatter: float
    outliers: bool
    noise: dict[str, Any]
    balance: float
    settle_s: float
    moves: bool  # the arm goes away and comes back between two cycles
    soft_links: float  # share of the deflection that links give
    point: tuple[float, ...]  # loaded and read in the flange frame; none: the model's tool point
    effects: tuple[Effect, ...] = ()

    @property
    def of(self) -> Arm:
        """The arm as it is stated."""
        return load(self.arm)

    def rng(self, *what: int) -> np.random.Generator:
        """Chance that goes by the set and by what it is asked for."""
        return np.random.default_rng([self.seed, *what])

    def text(self) -> dict[str, Any]:
        """As JSON takes it."""
        return asdict(self)


def from_text(raw: dict[str, Any]) -> Spec:
    """A set as ``Spec.text`` gave it, through JSON or not."""
    given = {key: tuple(value) if isinstance(value, list) else value for key, value in raw.items()}
    given["effects"] = tuple(Effect(**one) for one in raw["effects"])
    return Spec(**given)


@dataclass(frozen=True)
class Row:
    """A reading to be taken, as the table states it."""

    visit: int
    cycle: int
    session: int
    since_s: float  # the session's start
    time_s: float
    zero_s: float  # when the gauge was zeroed, at no load
    phase: str
    pose: str
    angles: Array  # (n,) deg
    force: Array  # (3,) N, base axes
    point: Array  # (3,) m, flange frame
    moment: Array  # (3,) N m

    @property
    def load(self) -> float:
        """N."""
        return float(np.linalg.norm(self.force))
