"""What the tests of effects share: an arm of one joint and one lever, and the xr701 with springs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fem import ArmModel
from fem.effects import Effect, History, PlacedEffect, catalogue, observed
from fem.model import BodyMass
from fem.statics.loads import LoadedPoses
from robots import ModelDescription
from robots.arrays import Array

LENGTH, STIFFNESS = 1.5, 2e5
# A dozen products of numbers of order one.
ROUND_OFF = 1e-12
SPRINGS = {"j1": 3e6, "j2": 1.4e6, "j3": 0.8e6, "j4": 1.0e6, "j5": 1.2e6, "j6": 0.7e6}


def lever_loads(angle: float, *newtons: float) -> LoadedPoses:
    """The one-joint arm at an angle from the horizontal (deg) under loads downward."""
    n = len(newtons)
    wrench = np.zeros((n, 6))
    wrench[:, 2] = -np.array(newtons)
    return LoadedPoses(np.full((n, 1), np.radians(angle)), wrench, np.zeros((n, 3)))


def torque(at: LoadedPoses) -> Array:
    """Torque (n,) of the loads at the joint by hand."""
    return np.asarray(-at.wrench[:, 2] * LENGTH * np.cos(at.q[:, 0]))


def angle_of(d: Array, at: LoadedPoses) -> Array:
    """Turn (n,) of the joint from the vertical displacement at the end of the lever."""
    return np.asarray(-d[:, 2] / (LENGTH * np.cos(at.q[:, 0])))


def extra(model: ArmModel, at: LoadedPoses, placed: PlacedEffect, history: History | None = None) -> Array:
    """What an effect adds to the displacement (n, 6)."""
    return observed(model, at, [placed], history) - observed(model, at, [], history)


def of(model: ArmModel, code: str, description: ModelDescription | None = None, **values: float) -> PlacedEffect:
    """An effect of the catalogue with its numbers."""
    return catalogue(model, description)[code].placed(values)


def plausible(effect: Effect, scale: float = 1.0) -> PlacedEffect:
    """An effect at the middle of its plausible sizes, times ``scale``; shapes at the first of their grid."""
    values = [p.grid[0] if p.role == "shape" else scale * float(np.mean(p.size)) for p in effect.parameters]
    return PlacedEffect(effect, np.array(values))


def with_weight(model: ArmModel, kg: float, at: float) -> ArmModel:
    """The one-joint arm with a mass ``at`` m from the joint."""
    return replace(model, masses=(BodyMass(1, kg, np.array([at, 0.0, 0.0])),))
