"""Readings kept out of every calibration of the whole chain: which variant predicts them best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from doe import Measurements
from doe.published.readings import rms_mm
from doe.tables.checks import refuse_seen
from fem.arm import Arm
from stiffarm.commands.calibrate.prediction import prediction_error
from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.session.console import say
from stiffarm.session.json_text import number
from stiffarm.session.reading_checks import read_held_out

# Angles this far (deg) beyond a law's range are beyond it, less is rounding.
_ROUNDING_DEG = 1e-6


@dataclass(frozen=True)
class HeldOut:
    """``rms_mm``: of the translations, by the variant's name; ``beyond``: poses outside the range of its laws."""

    data: Measurements
    rms_mm: Mapping[str, float]
    beyond: Mapping[str, tuple[str, ...]]


def read(file: Path, given: Arm, seen: Measurements, *, confirm_units: bool = False) -> Measurements:
    """Read the table held out.

    Raises
    ------
    InputError
        It does not fit the robot, looks like other units, or has poses that are among those ``seen``.
    """
    data = read_held_out(given, file, confirm_units=confirm_units)
    refuse_seen(seen, data, "the calibration")
    return data


def judge(variants: Sequence[Calibrated], data: Measurements) -> HeldOut:
    """Predict the readings held out with every variant, and say how well."""
    rms, beyond = {}, {}
    for v in variants:
        error, system = prediction_error(v.model, data)
        rms[v.name], beyond[v.name] = rms_mm(error, system.component), _beyond(v, data)
        more = f"; poses {', '.join(beyond[v.name])} are beyond the angles of its laws" if beyond[v.name] else ""
        say(f"held out, {v.name}: RMS {rms[v.name]:.3f} mm{more}")
    return HeldOut(data, rms, beyond)


def _beyond(v: Calibrated, data: Measurements) -> tuple[str, ...]:
    """Poses whose angles a law of the variant was not made for."""
    out = np.zeros(data.n, dtype=np.bool_)
    for law in (law for s in v.found.studies for law in s.laws.values()):
        for name, centre, half in zip(law.inputs, law.centre_deg, law.half_range_deg, strict=True):
            angle = np.degrees(data.q[:, v.model.robot.coordinate_index(name)])
            out |= np.abs(angle - centre) > half + _ROUNDING_DEG
    return tuple(dict.fromkeys(label for label, far in zip(data.pose, out, strict=True) if far))


def payload(h: HeldOut) -> dict[str, Any]:
    """As JSON."""
    return {
        "data": h.data.source,
        "data_sha256": h.data.sha256,
        "readings": int(h.data.used.sum()),
        "rms_mm": {name: number(v) for name, v in h.rms_mm.items()},
        "beyond_the_laws": {name: list(poses) for name, poses in h.beyond.items() if poses},
    }


def sentences(h: HeldOut) -> tuple[str, ...]:
    """What the report says about it."""
    best = min(h.rms_mm, key=lambda name: h.rms_mm[name] if np.isfinite(h.rms_mm[name]) else np.inf)
    out = [
        f"Held out: {int(h.data.used.sum())} readings of {h.data.source}, at poses that no calibration has seen. "
        f"{best} predicts them best, to {h.rms_mm[best]:.3f} mm RMS."
    ]
    out += [
        f"{name}: poses {', '.join(poses)} are beyond the angles its laws were fitted on; polynomials run away there."
        for name, poses in h.beyond.items()
        if poses
    ]
    return tuple(out)
