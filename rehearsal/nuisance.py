"""What the model does not know and no effect of the catalogue is meant to explain."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from rehearsal.arm import Arm

MODULUS = 0.05  # links: uniform within
LENGTH_M = 1e-3  # standard deviation of every link dimension that is not zero
ZERO_RAD = np.radians(0.03)  # standard deviation of joint zeros
LOAD = 0.005  # standard deviation of the scale of all loads (a load cell's)


def draw(arm: Arm, rng: np.random.Generator, weight: float) -> dict[str, Any]:
    """Plain values; lengths in the order of ``Arm.translations``, ``shifts`` and ``flange``.

    ``weight`` is the standard deviation of each weight's own error, beside the scale that all share.
    """
    return {
        "modulus": {link.name: float(1 + rng.uniform(-MODULUS, MODULUS)) for link in arm.links},
        "translations_m": (rng.normal(0, LENGTH_M, (arm.dof, 3)) * (arm.translations != 0)).tolist(),
        "shifts_m": (rng.normal(0, LENGTH_M, arm.dof) * (arm.shifts != 0)).tolist(),
        "flange_m": (rng.normal(0, LENGTH_M, 3) * (arm.flange != 0)).tolist(),
        "zeros_rad": rng.normal(0, ZERO_RAD, arm.dof).tolist(),
        "load_scale": float(1 + rng.normal(0, LOAD)),
        "weight_sd": weight,
        "load_seed": int(rng.integers(2**31)),
    }


def nothing(arm: Arm) -> dict[str, Any]:
    """The same without any error."""
    return {
        "modulus": {link.name: 1.0 for link in arm.links},
        "translations_m": np.zeros((arm.dof, 3)).tolist(),
        "shifts_m": [0.0] * arm.dof,
        "flange_m": [0.0] * 3,
        "zeros_rad": [0.0] * arm.dof,
        "load_scale": 1.0,
        "load_seed": None,
    }


def bent(arm: Arm, values: dict[str, Any]) -> Arm:
    """The arm as it was really built."""
    links = tuple(dataclasses.replace(k, youngs=k.youngs * values["modulus"][k.name]) for k in arm.links)
    return dataclasses.replace(
        arm,
        translations=arm.translations + np.array(values["translations_m"]),
        shifts=arm.shifts + np.array(values["shifts_m"]),
        flange=arm.flange + np.array(values["flange_m"]),
        links=links,
    )


def weight_scale(values: dict[str, Any], size: float) -> float:
    """True over stated weight; each weight (to the newton) has an error of its own and keeps it."""
    if values["load_seed"] is None:
        return float(values["load_scale"])
    own = np.random.default_rng([values["load_seed"], round(size)]).normal(0, values["weight_sd"])
    return float(values["load_scale"] * (1 + own))
