"""The whole chain: `run`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from fem.arm import Arm
from stiffarm.capability import capability
from stiffarm.request import READINGS, TABLE, Readings, Request, argument, option, seed
from stiffarm.result import Result

if TYPE_CHECKING:
    from stiffarm.session.outputs import OutputFolder


@dataclass(frozen=True, kw_only=True)
class RunRequest(Request):
    """Run everything from readings to report, surrogate and maps.

    Diagnosis, first model, sensitivity, calibration, surrogate, maps and one report of it all. If there is a
    published scheme, it is carried out stage by stage; otherwise all springs are calibrated at once.
    """

    data: tuple[Readings, ...] = argument(
        "One or more measurement tables (CSV/XLSX), combined. Pass a filled-in sheet together with the table it "
        "extends. Default: the robot's bundled table, also available as `bundled`.",
        READINGS,
        metavar="DATA",
        several=True,
    )
    scheme_file: Path | None = option("Calibration scheme (TOML). Default: the robot's bundled scheme.")
    holdout: Readings | None = option(
        "Measurement table of other poses (CSV/XLSX), kept out of every calibration to test its prediction.",
        TABLE,
        metavar="PATH",
    )
    confirm_units: bool = option(
        "Accept the table although its values look like other units; use it after checking them.", default=False
    )
    out: Path = option("Folder for the results; it is created if needed.", default=Path("out"))
    points: int = option("Number of values of each swept coordinate in the map.", default=21, least=2, most=200)
    rehearse: bool = option(
        "End with a rehearsal: hide an effect in simulated readings at the same set-ups and check whether the "
        "diagnosis finds it.",
        default=True,
        spelled=("--rehearse/--no-rehearse",),
    )
    seed: int = seed()

    writes_itself: ClassVar[bool] = True

    @property
    def folder(self) -> Path:
        """The folder of the results."""
        return self.out


def answer(given: Arm, asked: RunRequest, folder: OutputFolder) -> Result:
    """Every step, with models, surrogates, maps, pictures and the report in the folder."""
    from stiffarm.commands.run.workflow import run_all

    return run_all(given, asked, folder)


run = capability("run", RunRequest, answer, built=("links",), model="xr701")
