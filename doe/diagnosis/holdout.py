"""Readings that a diagnosis has not seen: how far off the model is there, before and after."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from doe.diagnosis.diagnose import Diagnosis
from doe.diagnosis.setting import Setting
from doe.estimation.problem import problem
from doe.tables.checks import refuse_seen
from doe.tables.load_history import history_of
from doe.tables.loaded import rms_mm
from doe.tables.measurements import Measurements
from robots.arrays import Array


@dataclass(frozen=True)
class HeldOutReadings:
    """Errors (m,), read minus predicted, of a model before and after; ``setting``: the model after on these readings.

    ``remarks``: what of an effect these readings cannot follow, in words.
    """

    data: Measurements
    setting: Setting
    before: Array
    after: Array
    remarks: tuple[str, ...]

    @property
    def rms_before_mm(self) -> float:
        """RMS of the translations before."""
        return rms_mm(self.before, self.setting.data.component)

    @property
    def rms_after_mm(self) -> float:
        """RMS of the translations after."""
        return rms_mm(self.after, self.setting.data.component)


def hold_out(d: Diagnosis, seen: Measurements, held_out: Measurements) -> HeldOutReadings:
    """Predict readings by the model before and after a diagnosis, with the numbers that are written into its file.

    Raises
    ------
    InputError
        As of :func:`doe.tables.checks.refuse_seen`.
    """
    refuse_seen(seen, held_out)
    before, after = applied(d.before.setting, held_out), applied(d.after.setting, held_out)
    return HeldOutReadings(held_out, after, before.residual, after.residual, tuple(_remarks(after)))


def applied(s: Setting, data: Measurements) -> Setting:
    """A setting's model with its numbers, on other readings."""
    # Errors that every model has are columns on the setting's own readings.
    p = problem(s.model, data, ())
    return replace(s, data=p, history=history_of(data), errors=np.zeros((len(p), 0)))


def _remarks(s: Setting) -> list[str]:
    out = []
    for placed in s.accepted:
        code = placed.effect.code
        if placed.effect.needs_history and not s.history.is_known:
            out.append(f"{code}: these readings do not tell loading from unloading; all are taken as loading from zero")
        if placed.effect.needs_clock:
            out.append(f"{code}: another campaign has a clock of its own; nothing of the {code} need repeat there")
    return out
