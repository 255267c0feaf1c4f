"""A power analysis: what planned readings would show of all that may be missing, before anyone measures."""

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
    from collections.abc import Sequence

    import pandas as pd

    from stiffarm.commands.rehearse.power.step import Power


@dataclass(frozen=True, repr=False)
class PowerAnalysis(Shown):
    """What a planned sheet would show.

    ``found``, ``named``: by code, the chance that an effect of usual size is found, and named; ``smallest``: by code,
    the size that is found with 80 %, in the unit of the effect's parameter (of a stiffness the stiffest), or None.
    ``analysis`` has everything else: intervals, twins, springs, what one more set-up, load or repeat adds.
    """

    found: dict[str, float]
    named: dict[str, float]
    smallest: dict[str, float | None]
    analysis: Power

    def title(self) -> str:
        """The answer in a few sentences."""
        from stiffarm.commands.rehearse.power.words import sentences

        return " ".join(sentences(self.analysis))

    def to_frame(self) -> pd.DataFrame:
        """One row an effect: smallest size found and its unit, chances with their intervals, what it looks like."""
        some = self.analysis.judged
        return frame(
            {
                "effect": [p.code for p in some],
                "parameter": [p.parameter for p in some],
                "smallest": [float("nan") if p.smallest is None else p.smallest for p in some],
                "unit": [p.unit for p in some],
                "found": [p.found.value for p in some],
                "found_low": [p.found.low for p in some],
                "found_high": [p.found.high for p in some],
                "named": [p.named.value for p in some],
                "named_low": [p.named.low for p in some],
                "named_high": [p.named.high for p in some],
                "twin": [p.twin for p in some],
            }
        )

    def plot(self, file: str | Path | None = None) -> Picture:
        """Draw the chances of every effect; ``file``: a PNG to write."""
        from stiffarm.commands.rehearse.power.figures import chances_figure

        return Picture.of(chances_figure(self.analysis)).kept(file)


def power(
    arm: Arm,
    sheet: str | Path | None = None,
    *,
    effects: Sequence[str] | None = None,
    one_more: bool = True,
    draws: int = 24,
    poses: int | None = None,
    reads: str | None = None,
    noise_percent: float | None = None,
    noise_um: float | None = None,
    setup_percent: float = SETUP_PERCENT,
    seed: int = 0,
) -> PowerAnalysis:
    """Say what planned readings would show of all that may be missing from a model, before anyone measures.

    Parameters
    ----------
    arm : the arm as its model has it, without effects
    sheet : measurement table or sheet whose poses, loads and order are used; default: the bundled table, else a
        campaign of 27 poses
    effects : codes to judge, as "friction:j2"; default: all that the arm can have
    one_more : whether to work out what one more set-up, load or repeat adds
    draws : usual sizes drawn of each effect
    poses : of a campaign in place of a sheet
    reads : axes that the campaign reads, as "z"; default: all three
    noise_percent, noise_um : standard deviation of a reading; default: as the sheet tells it, else 3 % and 3 um
    setup_percent : true scatter between set-ups, in percent of the deflection
    seed : of the random numbers

    Raises
    ------
    InputError
        A model with effects or shell links, a sheet that does not fit, fewer readings than springs, or an unknown code.

    Examples
    --------
    >>> import stiffarm as sa
    >>> seen = sa.power(
    ...     sa.load("kr60-3", links="rigid"), poses=8, effects=["payload", "gauge-scale"], one_more=False, draws=4
    ... )
    >>> seen.found["payload"] > 0.9 > 0.1 > seen.found["gauge-scale"]
    True
    """
    from stiffarm.commands.rehearse.power.step import power as analysed
    from stiffarm.commands.rehearse.sheet import Gauge
    from stiffarm.commands.rehearse.step import Request

    with called():
        request = Request(None, draws, seed, poses, Gauge(noise_percent, noise_um, setup_percent, reads))
        given = None if sheet is None else Path(sheet)
        found = analysed(arm, given, request, codes=None if effects is None else tuple(effects), compare=one_more)
    some = found.prospects
    return PowerAnalysis(
        {p.code: p.found.value for p in some},
        {p.code: p.named.value for p in some},
        {p.code: p.smallest for p in some},
        found,
    )
