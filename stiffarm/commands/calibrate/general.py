"""From the options of `calibrate` to its request, run and files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from doe import Measurements
from doe.estimation.campaign import Campaign, NoiseChoice, bundled_campaign, load_campaign
from fem.arm import Arm
from meshes.array_cache import user_cache
from robots import InputError, save_description
from stiffarm.commands.calibrate import payload as calibration_payload
from stiffarm.commands.calibrate import step as calibrating
from stiffarm.commands.calibrate.step import Calibrated, Request
from stiffarm.session import readings, steps
from stiffarm.session.console import progress, say
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.words.loads import loads_words

MOST_DRAWS = 10_000


@dataclass(frozen=True)
class Options:
    """What was typed, parsed: names of ``joints`` and of ``free`` parameters, ``campaign`` file; None: not given.

    ``staged``: the plan itself is run, stage by stage, with levels at this ``spacing``; ``diagnose``: the command that
    asks the same readings what is missing.
    """

    joints: tuple[str, ...] | None = None
    free: tuple[str, ...] | None = None
    campaign: Path | None = None
    loads: tuple[float, ...] | None = None
    low: float | None = None
    high: float | None = None
    staged: bool = False
    spacing: str = "log"
    robust: bool = True
    bootstrap: int = 0
    seed: int = 0
    diagnose: str = Request.diagnose


def is_staged(scheme: str | None, given: Arm, scheme_file: Path | None, *, named: bool) -> bool:
    """The published scheme where one is known and nothing says otherwise."""
    if scheme is not None:
        return scheme == "staged"
    if named or given.description.effect:
        return False
    return scheme_file is not None or bundled_campaign(given.robot.name) is not None


def plan_of(given: Arm, table: Measurements, scheme_file: Path | None, *, staged: bool) -> Campaign | None:
    """The scheme whose loads, bounds and gauge hold: the one given, or the bundled one of the bundled readings."""
    if staged or scheme_file is not None:
        return readings.read_scheme(given.robot, scheme_file)
    return bundled_campaign(given.robot.name) if steps.is_bundled(given.robot, table) else None


def run(
    given: Arm, table: Measurements, plan: Campaign | None, options: Options, holdout: Measurements | None
) -> Calibrated:
    """Calibrate as asked; progress and remarks are said."""
    request = request_of(given, table, plan, options)
    say(f"loads used: {loads_words(request.loads or table.levels_N)}")
    with progress("poses left out, draws") as bar:
        return calibrating.calibrate(given, table, request, holdout=holdout, store=user_cache(), say=say, count=bar)


def request_of(given: Arm, table: Measurements, plan: Campaign | None, options: Options) -> Request:
    """The campaign of a file, or of the numbers named; bounds and gauge are the scheme's where there is one."""
    if options.staged and plan is not None:
        campaign, expected = plan, plan.springs.ends
    elif options.campaign is not None:
        campaign, expected = load_campaign(options.campaign), None
    else:
        campaign, expected = _at_once(given, table, plan, options)
    if not options.robust:
        campaign = campaign.model_copy(update={"noise": campaign.noise.model_copy(update={"robust": False})})
    loads = options.loads if options.loads is not None else campaign.loads_N
    return Request(campaign, loads, expected, options.bootstrap, options.seed, options.spacing, options.diagnose)


def _at_once(
    given: Arm, table: Measurements, plan: Campaign | None, options: Options
) -> tuple[Campaign, tuple[float, float]]:
    usual, gauge, joints = steps.usual_springs(given, options.joints or ()), steps.DEFAULT_GAUGE_mm, options.joints
    if plan is not None:
        usual, gauge = plan.springs.ends, plan.noise.gauge_mm
        joints = joints or (plan.compare.constant.joints if plan.compare is not None else None)
    low, high = usual[0] if options.low is None else options.low, usual[1] if options.high is None else options.high
    if not (0.0 < low < high and np.isfinite(high)):
        raise InputError(
            "--low, --high",
            code="M002",
            value=f"{low:g}, {high:g}",
            allowed="0 < low < high, finite, N m/rad",
            remedy="give the range in which the springs are expected; it is widened where the data ask for it",
        )
    seen = joints or (() if options.free else steps.springs_seen(given, table))
    noise = NoiseChoice(gauge_mm=gauge)
    campaign = calibrating.springs_campaign(given.robot.name, seen, options.free, (low, high), noise)
    loads = () if plan is None else plan.loads_N
    return campaign.model_copy(update={"loads_N": loads}), (low, high)


def write(c: Calibrated, content: dict[str, Any], folder: OutputFolder) -> None:
    """calibration.json, model.toml, parameters.csv, pictures and report.html."""
    from stiffarm.commands.calibrate.report import write_report

    folder.write_json("calibration.json", content)
    save_description(c.description, folder.path("model.toml"))
    folder.write_text("parameters.csv", calibration_payload.parameters_csv(c))
    with folder.timed("report"):
        write_report(c, folder)
