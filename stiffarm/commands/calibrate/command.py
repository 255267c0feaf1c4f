"""The command `calibrate`: the published scheme, any parameters of the model, or a table of positions."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast

import numpy as np

from doe import Measurements
from doe.estimation.campaign import Campaign, NoiseChoice, bundled_campaign, load_campaign
from doe.tables.loaded import history_of
from fem.arm import Arm
from meshes.array_cache import user_cache
from robots import InputError, require_one_of
from stiffarm.capability import capability
from stiffarm.commands.calibrate import step
from stiffarm.commands.calibrate.results import Calibration, of_deflections
from stiffarm.commands.calibrate.step import springs_campaign
from stiffarm.request import (
    FILE,
    LOADS,
    NAMES,
    READINGS,
    Readings,
    Request,
    argument,
    option,
    readings_asked,
    seed,
    word,
)
from stiffarm.session import inputs, parsing, readings, steps
from stiffarm.session.console import progress, say
from stiffarm.session.reading_checks import history_notes
from stiffarm.session.table_kinds import are_positions
from stiffarm.session.words.loads import loads_words

MOST_DRAWS = 10_000
# Options of one way to calibrate, which the others have no use for.
OF_STAGED = ("spacing",)
OF_GLOBAL = ("joints", "free", "campaign", "low", "high", "holdout", "bootstrap", "robust")
NOT_OF_POSITIONS = ("spacing", "scheme", "joints", "campaign", "loads", "low", "high", "bootstrap", "scheme_file")


@dataclass(frozen=True, kw_only=True)
class CalibrateRequest(Request):
    """Identify parameters from measured deflections.

    Tables with x_mm, y_mm and z_mm hold absolute positions in a tracker's frame; --free then takes geometry, zeros,
    ratios, coupling, periodic, springs, tilts, base, rail, payload, or single parameters.

    Writes the calibrated model, the parameters with their intervals and a report into --out.

    Examples
    --------
    >>> import stiffarm as sa
    >>> cal = sa.calibrate("xr701", free=["j2.stiffness", "j3.stiffness"])
    >>> cal["j2.stiffness"].status
    'determined'
    """

    data: Sequence[Readings] = argument(
        "One or more measurement tables (CSV/XLSX), combined. Pass a filled-in sheet together with the table it "
        "extends. Default: the robot's bundled table, also available as `bundled`.",
        READINGS,
        metavar="DATA",
        several=True,
    )
    scheme: Literal["staged", "global"] | None = option(
        "Calibration scheme: staged (the published one) or global (all parameters at once). Default: staged if a "
        "scheme is known for the robot.",
        word(Literal["staged", "global"]),
    )
    joints: Sequence[str] | None = option(
        "Joints, separated by commas, as in j2,j3. Default: the scheme's, otherwise all that matter.", NAMES
    )
    free: Sequence[str] | None = option(
        "Parameters to identify, separated by commas, as in j2.stiffness,j3.rx,forearm.modulus; replaces --joints.",
        NAMES,
    )
    campaign: Path | None = option(
        "Campaign file (TOML): parameters to identify, their ranges, priors, laws and stages.", FILE
    )
    loads: Sequence[float] | float | Literal["all"] | None = option(
        "Loads to use, in N, separated by commas, as in 150,650, or all. Default: the scheme's, otherwise all.", LOADS
    )
    spacing: Literal["log", "linear"] | None = option(
        "Spacing of the factor levels in a staged calibration: log or linear. Default: log.",
        word(Literal["log", "linear"]),
    )
    low: float | None = option(
        "Lower bound for joint stiffnesses in a global calibration, in N m/rad. Default: the scheme's, otherwise that "
        "of arms of this size."
    )
    high: float | None = option(
        "Upper bound for joint stiffnesses in a global calibration, in N m/rad. Default: the scheme's, otherwise that "
        "of arms of this size."
    )
    holdout: Readings | None = option(
        "Measurement table of other poses (CSV/XLSX), kept out of the calibration to test its prediction.", READINGS
    )
    robust: bool = option("Give outliers less weight.", default=True)
    bootstrap: int = option(
        "Number of bootstrap samples of the poses (drawn with replacement); 0 for none.",
        default=0,
        least=0,
        most=MOST_DRAWS,
    )
    seed: int = seed()
    confirm_units: bool = option(
        "Accept the table although its values look like other units; use it after checking them.", default=False
    )
    scheme_file: Path | None = option("Calibration scheme (TOML). Default: the robot's bundled scheme.", FILE)

    def __post_init__(self) -> None:
        super().__post_init__()
        parsing.refuse_together({"--joints": self.joints, "--free": self.free, "--campaign": self.campaign})
        parsing.refuse_together({"--campaign": self.campaign, "--low or --high": self.low or self.high})
        if isinstance(self.holdout, Path) and not self.holdout.is_file():
            raise InputError(
                "--holdout",
                code="A007",
                value=str(self.holdout),
                allowed="an existing file",
                remedy="check the path",
            )

    def refuse(self, names: Sequence[str], what: str, remedy: str) -> None:
        """Refuse those of these options that were given.

        Raises
        ------
        InputError
            One of them was.
        """
        if given := self.given(*names):
            raise InputError(f"{', '.join(given)}: no option {what}", code="A002", remedy=remedy)


def answer(given: Arm, asked: CalibrateRequest) -> Calibration:
    """What the readings say of the parameters, and the calibrated arm."""
    if are_positions(asked.data):
        from stiffarm.commands.calibrate.positions import of_positions

        asked.refuse(NOT_OF_POSITIONS, "for tables of positions", "leave it out")
        return of_positions(given, asked.data, asked.free, asked.holdout, robust=asked.robust, seed=asked.seed)
    table = readings_asked(given, asked.data, confirm_units=asked.confirm_units)
    staged = is_staged(given, asked)
    notes = list(table.notes)
    if staged:
        inputs.refuse_effects(given, "the staged scheme", "give --scheme global, which takes them in")
        asked.refuse(OF_GLOBAL, "of --scheme staged", "give --scheme global")
    else:
        asked.refuse(OF_STAGED, "of --scheme global", "give --scheme staged, or leave it out")
        if given.description.effect:
            notes.append(f"with effects: {', '.join(described.code for described in given.description.effect)}")
            notes += history_notes(given.effects, history_of(table))
    request = plan(given, table, asked, staged=staged)
    held = None
    if asked.holdout is not None:
        held = readings_asked(given, asked.holdout, confirm_units=asked.confirm_units)
        notes += [f"{held.source}: {note}" for note in held.notes]
    say(f"loads used: {loads_words(request.loads or table.levels_N)}")
    with progress("poses left out, draws") as bar:
        found = step.calibrate(given, table, request, holdout=held, store=user_cache(), say=say, count=bar)
    return of_deflections(given, found, notes, diagnose_command(asked))


def diagnose_command(asked: CalibrateRequest) -> str:
    """How to ask the same readings what is missing."""
    files = [str(one) if isinstance(one, Path) else "DATA" for one in asked.data]
    loads = ["--loads", ",".join(f"{v:g}" for v in cast("Sequence[float]", asked.loads))] if asked.loads else []
    confirmed = ["--confirm-units"] if asked.confirm_units else []
    return shlex.join(["stiffarm", "diagnose", "MODEL", *files, *loads, *confirmed])


def is_staged(given: Arm, asked: CalibrateRequest) -> bool:
    """The published scheme where one is known and nothing says otherwise."""
    if asked.scheme is not None:
        return asked.scheme == "staged"
    if asked.free is not None or asked.campaign is not None or given.description.effect:
        return False
    return asked.scheme_file is not None or bundled_campaign(given.robot.name) is not None


def plan(given: Arm, table: Measurements, asked: CalibrateRequest, *, staged: bool) -> step.Request:
    """The campaign of a file, or of the parameters named; bounds and gauge are the scheme's where there is one.

    The scheme is the one given, or the bundled one of the bundled readings.
    """
    scheme: Campaign | None = None
    if staged or asked.scheme_file is not None:
        scheme = readings.read_scheme(given.robot, asked.scheme_file)
    elif steps.is_bundled(given.robot, table):
        scheme = bundled_campaign(given.robot.name)
    expected: tuple[float, float] | None = None
    if staged and scheme is not None:
        campaign, expected = scheme, scheme.springs.ends
    elif asked.campaign is not None:
        campaign = load_campaign(asked.campaign)
    else:
        campaign, expected = _at_once(given, table, scheme, asked)
    if not asked.robust:
        campaign = campaign.model_copy(update={"noise": campaign.noise.model_copy(update={"robust": False})})
    loads = cast("tuple[float, ...] | None", asked.loads)
    return step.Request(
        campaign,
        campaign.loads_N if loads is None else loads,
        expected,
        asked.bootstrap,
        asked.seed,
        asked.spacing or "log",
    )


def _at_once(
    given: Arm, table: Measurements, scheme: Campaign | None, asked: CalibrateRequest
) -> tuple[Campaign, tuple[float, float]]:
    joints = tuple(asked.joints or ())
    for joint in joints:
        require_one_of("--joints", joint, given.robot.joint_names, code="A001", remedy="choose from these")
    usual, gauge = steps.usual_springs(given, joints), steps.DEFAULT_GAUGE_mm
    if scheme is not None:
        usual, gauge = scheme.springs.ends, scheme.noise.gauge_mm
        joints = joints or (scheme.compare.constant.joints if scheme.compare is not None else ())
    low, high = usual[0] if asked.low is None else asked.low, usual[1] if asked.high is None else asked.high
    if not (0.0 < low < high and np.isfinite(high)):
        raise InputError(
            "--low, --high",
            code="M002",
            value=f"{low:g}, {high:g}",
            allowed="0 < low < high, finite, N m/rad",
            remedy="give the range in which the springs are expected; it is widened where the data ask for it",
        )
    free = None if asked.free is None else tuple(asked.free)
    seen = joints or (() if free else steps.springs_seen(given, table))
    campaign = springs_campaign(given.robot.name, seen, free, (low, high), NoiseChoice(gauge_mm=gauge))
    loads = () if scheme is None else scheme.loads_N
    return campaign.model_copy(update={"loads_N": loads}), (low, high)


calibrate = capability("calibrate", CalibrateRequest, answer, own_effects=True)
