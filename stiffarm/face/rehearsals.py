"""Rehearsals: an effect is hidden in made-up readings; the diagnosis is to find it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from stiffarm.commands.rehearse.sheet import SETUP_PERCENT
from stiffarm.face.arms import Arm
from stiffarm.face.calls import called
from stiffarm.face.shown import Shown, frame
from stiffarm.pages.picture import Picture

if TYPE_CHECKING:
    import pandas as pd

    from stiffarm.commands.rehearse.step import Rehearsed


@dataclass(frozen=True, repr=False)
class Rehearsal(Shown):
    """Finished rehearsals, unveiled.

    ``hidden``: codes that were hidden, one a draw; ``outcomes``: what came of each: "named", "family", "candidate",
    "unnamed", "not testable", "nothing" or "wrong"; ``gaps_mm``: RMS errors at poses held out, before and after, None
    where no poses could be held out. ``draws`` have everything else.
    """

    hidden: tuple[str, ...]
    outcomes: tuple[str, ...]
    gaps_mm: tuple[tuple[float, float] | None, ...]
    draws: tuple[Rehearsed, ...]

    def title(self) -> str:
        """What was hidden and what came of it; of several draws how many were right."""
        from stiffarm.commands.rehearse.words import summary

        return " ".join(summary(self.draws))

    def to_frame(self) -> pd.DataFrame:
        """One row a draw: hidden, what the diagnosis said, outcome, whether readings could show it, errors in mm."""
        from stiffarm.commands.rehearse.words import outcome, said

        nan = float("nan")
        gaps = [(nan, nan) if gap is None else gap for gap in self.gaps_mm]
        return frame(
            {
                "hidden": self.hidden,
                "diagnosis": [said(r) for r in self.draws],
                "outcome": [outcome(r) for r in self.draws],
                "visible": [r.is_visible for r in self.draws],
                "before_mm": [before for before, _ in gaps],
                "after_mm": [after for _, after in gaps],
            }
        )

    def plot(self, file: str | Path | None = None) -> Picture:
        """Draw the gap before and after, or of several draws the tally; ``file``: a PNG to write."""
        from stiffarm.commands.rehearse.report import answer_figure

        return Picture.of(answer_figure(self.draws)).kept(file)


def rehearse(
    arm: Arm,
    sheet: str | Path | None = None,
    *,
    hide: str | None = None,
    draws: int = 1,
    poses: int | None = None,
    reads: str | None = None,
    noise_percent: float | None = None,
    noise_um: float | None = None,
    setup_percent: float = SETUP_PERCENT,
    seed: int = 0,
) -> Rehearsal:
    """Hide an effect in made-up readings of an arm, diagnose them blind, and unveil what was hidden.

    Parameters
    ----------
    arm : the arm as its model has it, without effects
    sheet : measurement table or sheet whose poses, loads and order are used; default: the bundled table, else a
        campaign of 27 poses
    hide : code of the effect, as "friction:j2", or "none"; default: drawn at random
    draws : how many rehearsals, each with a new truth
    poses : of a campaign in place of a sheet
    reads : axes that the campaign reads, as "z"; default: all three
    noise_percent, noise_um : standard deviation of a reading; default: as the sheet tells it, else 3 % and 3 um
    setup_percent : true scatter between set-ups, in percent of the deflection
    seed : of the random numbers

    Raises
    ------
    InputError
        A model with effects or shell links, a code that the arm cannot have, or a sheet that does not fit.

    Examples
    --------
    >>> import stiffarm as sa
    >>> sa.rehearse(sa.load("kr60-3", links="rigid"), poses=8, hide="payload").outcomes
    ('named',)
    """
    from stiffarm.commands.rehearse.sheet import Gauge
    from stiffarm.commands.rehearse.step import Request, places, rehearsals

    with called():
        request = Request(hide, draws, seed, poses, Gauge(noise_percent, noise_um, setup_percent, reads))
        with places(draws) as folders:
            done = tuple(rehearsals(arm, None if sheet is None else Path(sheet), request, folders))
    return Rehearsal(
        tuple(r.world.code for r in done), tuple(r.outcome for r in done), tuple(r.gap_mm for r in done), done
    )
