"""Diagnosis: which effect the model is missing by some readings, how sure that is, and the arm with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from doe.diagnosis.nested import FOLDS
from doe.diagnosis.scatter import SETUP
from stiffarm.face.arms import Arm, as_face
from stiffarm.face.calls import called, numbers, words_of
from stiffarm.face.readings import AnyReadings, table_of
from stiffarm.face.shown import Shown, frame
from stiffarm.pages.picture import Picture

if TYPE_CHECKING:
    import pandas as pd

    from stiffarm.commands.diagnose.step import Diagnosed


@dataclass(frozen=True)
class Gap:
    """RMS errors in mm, before and after what was found joined the model.

    ``fit``: on the readings themselves; ``held_out``: at poses that the fit has not seen, or on the readings that
    were held out; ``noise_floor``: what noise alone would give.
    """

    fit_before_mm: float
    fit_after_mm: float
    held_out_before_mm: float
    held_out_after_mm: float
    noise_floor_mm: float


@dataclass(frozen=True, repr=False)
class Diagnosis(Shown):
    """A finished diagnosis.

    ``verdict``: "nothing", "named", "family", "unknown" ... with its ``reason`` in words; ``effects``: codes of the
    effects in the new model, sure and provisional ones; ``gap``: errors before and after; ``arm``: the arm with what
    was found, the arm as it was given where the readings tell nothing. ``found`` has everything else.
    """

    arm: Arm
    verdict: str
    reason: str
    effects: tuple[str, ...]
    gap: Gap
    remarks: tuple[str, ...]
    found: Diagnosed

    def title(self) -> str:
        """Verdict, effects and the error at unseen poses before and after."""
        g, names = self.gap, ", ".join(self.effects) or "no effect"
        return (
            f"Diagnosis of {self.arm.name}: {self.verdict} ({names}); error at unseen poses "
            f"{g.held_out_before_mm:.4f} -> {g.held_out_after_mm:.4f} mm"
        )

    def to_frame(self) -> pd.DataFrame:
        """One row a candidate, most probable first: code, probability, log evidence, error at unseen poses in mm."""
        told = self.found.found.ranking.hypotheses if self.found.tells else ()
        return frame(
            {
                "candidate": [h.code for h in told],
                "probability": [h.probability for h in told],
                "log_evidence": [h.log_evidence for h in told],
                "left_out_rms_mm": [h.lopo_rms_mm for h in told],
            }
        )

    def plot(self, file: str | Path | None = None) -> Picture:
        """Draw the gap before and after; ``file``: a PNG to write."""
        from doe.diagnosis.where import least_rms_mm
        from stiffarm.commands.diagnose.figures import gap_figure

        g = self.gap
        rows = {
            "readings fitted": (g.fit_before_mm, g.fit_after_mm),
            "unseen poses": (g.held_out_before_mm, g.held_out_after_mm),
        }
        least = least_rms_mm(self.found.found)
        return Picture.of(gap_figure(rows, g.noise_floor_mm, least)).kept(file)


def diagnose(
    arm: Arm,
    readings: AnyReadings,
    *,
    load_path: str | None = None,
    free: Sequence[str] | str | None = None,
    loads_N: Sequence[float] | float = (),
    holdout: AnyReadings | None = None,
    next_poses: int = 3,
    setup_percent: float = 100.0 * SETUP,
    folds: int = FOLDS,
    seed: int = 0,
) -> Diagnosis:
    """Find what the model is missing: where it disagrees with readings, which effect explains it, how sure that is.

    Parameters
    ----------
    arm : the arm before; it is not changed
    readings : measured deflections (:func:`stiffarm.read_readings`)
    load_path : "parallelogram" or "serial"; default: the arm's
    free : joints whose springs are fitted, as "j2"; default: all that the readings see
    loads_N : load magnitudes to use, N; default: all
    holdout : readings to judge the result by
    next_poses : how many set-ups to propose where something is not settled
    setup_percent : scatter between set-ups to expect, in percent of the deflection
    folds : in which the whole diagnosis is made anew to predict poses that it has not seen; 0 for none
    seed : of the random numbers

    Raises
    ------
    InputError
        Readings of one pose only, a gauge that stood still, or fewer readings than springs.

    Examples
    --------
    >>> import stiffarm as sa
    >>> arm = sa.load("xr701")
    >>> data = sa.read_readings(sa.bundled("xr701"), arm)
    >>> sa.diagnose(arm, data, loads_N=[650], load_path="serial", next_poses=0, folds=0).effects
    ('load-path',)
    """
    from doe.diagnosis.where import noise_floor_mm
    from stiffarm.commands.diagnose.model import described
    from stiffarm.commands.diagnose.step import Request
    from stiffarm.commands.diagnose.step import diagnose as ask
    from stiffarm.session.inputs import as_load_path

    with called():
        given = arm if load_path is None else arm.with_load_path(as_load_path(load_path))
        request = Request(
            numbers(loads_N, "loads_N") or (), words_of(free, "free"), next_poses, seed, setup_percent / 100.0, folds
        )
        found = ask(
            given, table_of(readings, arm), request, holdout=None if holdout is None else table_of(holdout, arm)
        )
        made = arm
        if found.tells:
            description = described(found)
            made = as_face(Arm.of(description, arm.model.link_kind, None, arm.own))
    before, after = found.found.before, found.found.after
    codes = tuple(f.code for f in found.in_model)
    gap = Gap(before.fit_rms_mm, after.fit_rms_mm, *found.unseen_rms_mm, noise_floor_mm(found.found))
    return Diagnosis(made, found.found.verdict, found.found.reason, codes, gap, found.remarks, found)
