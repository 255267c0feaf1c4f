"""True numbers by the names that model files use, where they mean the same; all in SI units.

A truth with a law of its own (a kink where a file has a smooth bend) has no number of that name.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


def meant(effect: dict[str, Any]) -> dict[str, float]:
    """Parameters of a hidden effect as a model file would name them."""
    make = MEANINGS.get(effect["kind"])
    return {} if make is None else {name: float(value) for name, value in make(effect).items()}


def _pair(e: dict[str, Any]) -> dict[str, Any]:
    return dict(zip(("stiffness_x", "stiffness_y"), e["k_Nm_per_rad"], strict=True))


def _offset(e: dict[str, Any]) -> dict[str, Any]:
    return dict(zip("xyz", e["at_flange_m"], strict=True))


def _waves(e: dict[str, Any]) -> dict[str, Any]:
    if e["law"] != "harmonics":
        return {}
    out: dict[str, Any] = {}
    for k, (a, phase) in enumerate(zip(e["amplitudes"][:2], e["phases_rad"][:2], strict=True), start=1):
        out |= {f"cos{k}": a * np.cos(phase), f"sin{k}": a * np.sin(phase)}
    return out


def _friction(e: dict[str, Any]) -> dict[str, Any]:
    if e["law"] != "play":
        return {}
    return {"share": 1 - e["stuck_share"], "friction": e["slip_Nm"][0]}


def _drift(e: dict[str, Any]) -> dict[str, Any]:
    return dict.fromkeys("xyz", e["size_m"]) | ({"settling": e["T"]} if e["law"] == "exponential" else {})


def _ripple(e: dict[str, Any]) -> dict[str, Any]:
    a, phase = e["amplitude"], e["phase_rad"]
    return {"cos": a * np.sin(phase), "sin": a * np.cos(phase), "teeth": e["teeth"]}


MEANINGS: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
    "joint-compliance": lambda e: {"stiffness": e["k_Nm_per_rad"]},
    "joint-tilt": _pair,
    "angle-dependent-stiffness": _waves,
    # Half the way on either side of the middle.
    "backlash": lambda e: {"gap": 2 * e["gap_rad"]},
    "friction": _friction,
    "payload": lambda e: {"force": e["weight_N"]},
    "base-tilt": _pair,
    "base-vertical": lambda e: {"stiffness": e["k_N_per_m"]},
    "parallelogram-bar": lambda e: {"stiffness": e["k_N_per_m"]},
    "link-flexibility": lambda e: {"share": e["phi"]},
    "tool-compliance": lambda e: {f"stiffness_{a}": 1 / c for a, c in zip("xyz", e["c_m_per_N"], strict=True)},
    "load-point-offset": _offset,
    "load-misalignment": lambda e: {
        "tilt_x": -e["tilt_rad"] * np.sin(e["azimuth_rad"]),
        "tilt_y": e["tilt_rad"] * np.cos(e["azimuth_rad"]),
    },
    "joint-zero-offset": lambda e: {"angle": e["zero_rad"]},
    "gauge-zero": lambda e: dict.fromkeys("xyz", e["zero_m"]),
    "gauge-scale": lambda e: {"share": e["scale"]},
    "drift": _drift,
    "gear-ripple": _ripple,
    "wrist-coupling": lambda e: {"coupling": np.mean(e["per_Nm"])},
    "turned-frame": lambda e: {f"r{a}": v for a, v in zip("xyz", e["turn_rad"], strict=True)},
    "tool-point-offset": _offset,
    "angle-offset": lambda e: {"offset": e["offset_rad"]},
    "angle-coupling": lambda e: {"share": e["share"]},
}
