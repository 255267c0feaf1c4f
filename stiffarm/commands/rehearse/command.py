"""What planned readings would show; or an effect hidden in simulated ones, for the diagnosis to find."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fem.arm import Arm
from robots import InputError
from stiffarm.capability import capability
from stiffarm.commands.rehearse.sheet import SETUP_PERCENT
from stiffarm.request import NAMES, TABLE, Request, argument, option, seed
from stiffarm.result import Result
from stiffarm.session.console import progress, say
from stiffarm.session.table_kinds import DEFLECTIONS, expect

# What --hide says where the effect is drawn at random.
ANY, MOST_DRAWS = "any", 1000


@dataclass(frozen=True, kw_only=True)
class RehearseRequest(Request):
    """Forecast what a planned sheet would show, before you measure.

    For the poses, loads, repeats and noise of your sheet: the smallest size of each effect that would be found with a
    chance of 80 %, the chances that usual sizes are found and named, the intervals to expect of the springs, and what
    one more set-up, load or repeat would add.

    With --hide it is a dress rehearsal: readings with a hidden effect are simulated by code that shares nothing with
    the diagnosis, the diagnosis runs blind, and then the true effect is shown. Writes readings.csv and truth.json into
    --out as well.

    Examples
    --------
    >>> import stiffarm as sa
    >>> arm = sa.load("kr60-3", links="rigid")
    >>> sa.rehearse(arm, poses=8, hide="payload").outcomes
    ('named',)
    >>> seen = sa.rehearse(arm, poses=8, effects=["payload", "gauge-scale"], one_more=False, draws=4).to_frame()
    >>> bool(seen["found_percent"][0] > 90.0)
    True
    """

    sheet: Path | str | None = argument(
        "Measurement table or sheet to fill in (CSV/XLSX) whose poses, loads and order are used; its own readings are "
        "used only for the noise. Default: the robot's bundled table, otherwise a campaign of 27 poses.",
        TABLE,
        metavar="[SHEET]",
    )
    hide: str | None = option(
        "Simulate readings with this hidden effect, as in friction:j2, and diagnose them; none hides nothing, any "
        "draws one at random and keeps it secret until the end. Default: a power analysis.",
        metavar="CODE",
    )
    draws: int | None = option(
        "With --hide: number of rehearsals, each with a new truth (default 1). Otherwise: usual sizes drawn of each "
        "effect (default 24).",
        least=1,
        most=MOST_DRAWS,
    )
    effects: Sequence[str] | None = option(
        "Without --hide: effects to judge, as in friction:j2,payload. Default: all that the arm can have.", NAMES
    )
    one_more: bool = option(
        "Without --hide: what one more set-up, load or repeat adds, too.",
        default=True,
        spelled=("--one-more/--no-one-more",),
    )
    poses: int | None = option(
        "Number of poses of a campaign that fills the workspace, in place of a SHEET or a bundled table.",
        least=2,
        most=200,
    )
    reads: str | None = option("Axes that the campaign reads, as in z or xyz. Default: xyz.")
    noise_percent: float | None = option(
        "Standard deviation of a reading, in percent of the deflection. Default: as the sheet's sigma_mm or the "
        "scatter of its repeats says, otherwise 3.",
        least=0.0,
        most=50.0,
    )
    noise_um: float | None = option(
        "Standard deviation of a reading that does not depend on its size, in um. Default: as for --noise-percent, "
        "otherwise 3.",
        least=0.0,
        most=10000.0,
    )
    setup_percent: float = option(
        "True scatter between set-ups, in percent of the deflection.", default=SETUP_PERCENT, least=0.0, most=20.0
    )
    seed: int = seed()

    @property
    def code(self) -> str | None:
        """What to hide, "none" for nothing; None: drawn and kept secret."""
        return None if self.hide == ANY else self.hide


def answer(given: Arm, asked: RehearseRequest) -> Result:
    """A power analysis of a sheet, or rehearsals at its set-ups."""
    if asked.sheet is not None:
        expect(Path(asked.sheet), DEFLECTIONS)
    if asked.hide is None:
        from stiffarm.commands.rehearse.power.results import result as power_result
        from stiffarm.commands.rehearse.power.step import power

        with progress("sheets") as bar:
            return power_result(power(given, asked, progress=bar), asked.seed)
    if wrong := asked.given("effects", "one_more"):
        raise InputError(f"{', '.join(wrong)}: no option of --hide", code="A002", remedy="leave it out")
    from stiffarm.commands.rehearse.results import result
    from stiffarm.commands.rehearse.step import rehearsals

    return result(rehearsals(given, asked, say=say), secret=asked.hide == ANY, seed=asked.seed)


rehearse = capability("rehearse", RehearseRequest, answer)
