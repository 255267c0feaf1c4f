"""Diagnosis by absolute positions of targets: what an arm's model is missing beside its geometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from stiffarm.face.arms import Arm
from stiffarm.face.calls import called
from stiffarm.face.shown import Shown, frame
from stiffarm.pages.picture import Picture
from stiffarm.request import positions_asked

if TYPE_CHECKING:
    import pandas as pd

    from doe.absolute.missing.diagnose import Missing


@dataclass(frozen=True, repr=False)
class PositionDiagnosis(Shown):
    """What positions say is missing from an arm's model.

    ``verdict``: none, named, ambiguous or unknown, and the ``reason``; ``effects``: codes that are sure;
    ``provisional``: codes that are not; ``left_out_rms_mm``: of readings left out, before and after; ``free``: what
    ``calibrate`` frees to have them in the model; ``found`` has all else.
    """

    name: str
    verdict: str
    reason: str
    effects: tuple[str, ...]
    provisional: tuple[str, ...]
    left_out_rms_mm: tuple[float, float]
    free: tuple[str, ...]
    found: Missing

    def title(self) -> str:
        """Robot, verdict and error."""
        before, after = self.left_out_rms_mm
        return f"Positions of {self.name}: {self.verdict}; readings left out {before:.3f} mm RMS, {after:.3f} mm after"

    def to_frame(self) -> pd.DataFrame:
        """One row an effect: code, whether it is sure, probability, by how much it moves the readings (RMS, mm)."""
        found = self.found.found
        return frame(
            {
                "effect": [one.candidate.code for one in found],
                "sure": [one in self.found.effects for one in found],
                "probability": [one.probability for one in found],
                "acts_rms_mm": [1e3 * one.acts for one in found],
            }
        )

    def plot(self, file: str | Path | None = None) -> Picture:
        """Draw how far each effect moves the readings; ``file``: a PNG to write."""
        from stiffarm.commands.diagnose.positions.report import acts_figure

        return Picture.of(acts_figure(self.found)).kept(file)


def diagnose_positions(
    arm: Arm,
    source: str | Path | pd.DataFrame | Sequence[str | Path | pd.DataFrame],
    *,
    holdout: str | Path | pd.DataFrame | None = None,
    seed: int = 0,
) -> PositionDiagnosis:
    """Find what an arm's model is missing by positions of targets, its geometry free beside every candidate.

    Parameters
    ----------
    arm : the arm as described
    source : as of :func:`calibrate`
    holdout : a table that is only predicted, before and after
    seed : of the random parts that are left out

    Raises
    ------
    InputError
        A table that cannot be read, or positions that no frame brings together with the arm.
    """
    from doe.absolute.missing.diagnose import diagnose_positions as diagnosed
    from stiffarm.commands.diagnose.positions.payload import free

    with called():
        table = positions_asked(arm, source)
        kept = None if holdout is None else positions_asked(arm, [holdout])
        found = diagnosed(arm.model, table, holdout=kept, seed=seed)
    before, after = (1e3 * x for x in found.left_out_rms())
    names = free(found)
    return PositionDiagnosis(
        arm.name,
        found.verdict,
        found.reason,
        tuple(one.candidate.code for one in found.effects),
        tuple(one.candidate.code for one in found.provisional),
        (before, after),
        () if names is None else tuple(names.split(",")),
        found,
    )
