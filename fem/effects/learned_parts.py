"""What laws that are learned are made of: how far readings go, pieces with a number each, and numbers that are held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem.effects.base import EffectParameter
from fem.model import ArmModel
from robots.arrays import Array

FAMILY = "learned"
SOURCE = "learned from readings"
# Shares of a joint's turn or of a displacement that a piece may have.
PIECE = 0.5
# Angles that a joint may have stood at, rad, to either side.
TURN = 4.0 * np.pi
# Sessions that a law in a file may tell apart.
SESSIONS = 12


@dataclass(frozen=True)
class Reach:
    """How far the readings go: torques (dof,) N m, travel (dof, 2) rad, moment at the base N m, force N, reading m.

    ``sessions``: how many there were.
    """

    torque: Array
    travel: Array
    moment: float
    force: float
    size: float
    sessions: int = 1


def plain_reach(model: ArmModel) -> Reach:
    """A reach to write laws down with, where their numbers come from a file."""
    dof = model.robot.dof
    return Reach(np.full(dof, 1000.0), np.asarray(model.robot.limits, dtype=np.float64), 1000.0, 1000.0, 1e-3, SESSIONS)


def held(name: str, dimension: str, unit: str, value: float, meaning: str) -> EffectParameter:
    """A shape that the readings fix: one point on its grid."""
    lower, upper = (-TURN, TURN) if dimension == "angle" else (1e-4 * value, 1e4 * value)
    return EffectParameter(name, dimension, unit, lower, upper, SOURCE, role="shape", grid=(value,), meaning=meaning)


def pieces(names: Sequence[str], meaning: str) -> tuple[EffectParameter, ...]:
    """Amplitudes of either sign."""
    return tuple(
        EffectParameter(name, "ratio", "1", 0.01, PIECE, SOURCE, signed=True, meaning=meaning) for name in names
    )
