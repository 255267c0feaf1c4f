"""The step `calibrate`: numbers of a model from readings, what those can tell, and how well the result predicts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from doe import Measurements, select_loads
from doe.calibration.prediction import Holdout, held_out, left_out
from doe.calibration.run import (
    Calibration,
    StageResult,
    readings_of,
    refuse_cut_cycles,
    run_campaign,
    without_outliers,
)
from doe.calibration.written import with_origin
from doe.certainty.doubts import LEVEL, Doubt, drift, order_of_rows, unexplained
from doe.certainty.lack_of_fit import downweighted
from doe.certainty.left_out import leave_one_pose_out
from doe.certainty.predictive import Coverage
from doe.certainty.uncertainty import Certainty, ParameterEstimate, bootstrap, certainty
from doe.estimation.assumed_walls import remarks as walls_remarks
from doe.estimation.assumed_walls import with_assumed_walls
from doe.estimation.campaign import Campaign, Freed, NoiseChoice, campaign_of
from doe.estimation.estimate import estimate
from doe.tables.checks import refuse_seen
from doe.tables.loaded import history_of_part, points_of, rms_mm
from doe.tables.measurements import load_size
from fem import ArmModel
from fem.arm import Arm
from fem.effects import History, build_plain
from fem.free.parameters import TURN
from meshes.array_cache import ArrayCache
from robots import InputError, ModelDescription
from robots.arrays import Array
from robots.progress import Progress
from stiffarm.commands.calibrate import words
from stiffarm.session.reading_checks import reading_doubts, refuse_useless


@dataclass(frozen=True)
class Request:
    """What is asked of a calibration.

    ``loads`` N, empty for all; ``expected`` N m/rad: where joint springs are expected, to be said when they are
    not; ``bootstrap``: how often to draw poses with replacement; ``spacing`` of the levels of studies pose by pose.
    """

    campaign: Campaign
    loads: tuple[float, ...] = ()
    expected: tuple[float, float] | None = None
    bootstrap: int = 0
    seed: int = 0
    spacing: str = "log"


@dataclass(frozen=True)
class StageFindings:
    """One stage and all that is said about it; ``read``: its readings, of which its m components are.

    ``left_out`` (m,): errors of poses predicted by the others, ``left_out_half95`` (m,): half widths of these
    predictions' 95 % intervals, ``skipped`` why some are not predicted; ``independent``: the
    same estimate as if nothing were common to a set-up, None if nothing is; ``full_weight``: with outliers at full
    weight, None without any; ``drawn`` (times, p): bootstrapped values.
    """

    result: StageResult
    read: Measurements
    left_out: Array
    left_out_half95: Array
    skipped: dict[str, str]
    independent: Certainty | None
    full_weight: StageResult | None
    drawn: Array | None

    @property
    def loads_N(self) -> Array:  # noqa: N802 - the unit's letter
        """Loads (m,) of its components."""
        return self.read.loads_N[self.result.estimate.problem.row]


@dataclass(frozen=True)
class Calibrated:
    """A finished calibration with its judgement; ``data``: the readings used; arrays (m,) as in ``found.overall``.

    ``doubts``: what the readings say against it, or against themselves; their words are the first of ``remarks``.
    """

    request: Request
    data: Measurements
    found: Calibration
    description: ModelDescription
    stages: tuple[StageFindings, ...]
    left_out: Array
    left_out_half95: Array
    skipped: dict[str, str]
    holdout: Holdout | None
    remarks: tuple[str, ...]
    doubts: tuple[Doubt, ...] = ()

    @property
    def scheme(self) -> str:
        """What the model file calls it: "staged" with studies pose by pose, else "global"."""
        return "staged" if self.found.studies else "global"

    @property
    def name(self) -> str:
        """Kind of springs and load path, by which calibrations are told apart."""
        return f"{'staged' if self.found.studies else 'constant'}, {self.model.load_path}"

    @property
    def model(self) -> ArmModel:
        """The calibrated model, without effects."""
        return self.found.model

    @property
    def springs(self) -> tuple[ParameterEstimate, ...]:
        """Constant springs of the joints set free, in all stages."""
        every = (e for s in self.found.stages for e in s.certainty.estimates)
        return tuple(e for e in every if e.parameter.spring_of is not None)

    @property
    def pose(self) -> tuple[str, ...]:
        """Labels (m,) of the poses."""
        return tuple(self.found.overall.poses[k] for k in self.found.overall.pose)

    @property
    def measured_mm(self) -> Array:
        """Readings (m,) in mm (mrad for rotations)."""
        return self.found.overall.value * 1e3

    @property
    def predicted_mm(self) -> Array:
        """Simulated readings (m,) in mm (mrad for rotations)."""
        return (self.found.overall.value - self.found.residual) * 1e3

    @property
    def left_out_rms_mm(self) -> float:
        """RMS of the translations at poses predicted by a calibration that has not seen them."""
        known = ~np.isnan(self.left_out)
        return rms_mm(self.left_out[known], self.found.overall.component[known])

    @property
    def coverage(self) -> Coverage:
        """How many readings at poses left out lie in the 95 % intervals of their predictions."""
        return Coverage.of(self.left_out, self.left_out_half95)


def springs_campaign(
    robot: str,
    joints: tuple[str, ...],
    names: tuple[str, ...] | None,
    expected: tuple[float, float],
    noise: NoiseChoice | None = None,
) -> Campaign:
    """All at once: the numbers named, else constant springs of ``joints``; their range is the widest plausible one."""
    plain = campaign_of(robot, names or tuple(f"{j}.stiffness" for j in joints))
    widest = min(TURN[0], expected[0]), max(TURN[1], expected[1])
    freed = [
        Freed(name=p.name, lower=widest[0], upper=widest[1])
        if words.names_joint_spring(p.name) and widest != TURN
        else p
        for p in plain.parameter
    ]
    return plain.model_copy(update={"parameter": tuple(freed), "noise": noise or plain.noise})


def calibrate(
    given: Arm,
    table: Measurements,
    request: Request,
    *,
    holdout: Measurements | None = None,
    store: ArrayCache | None = None,
    say: Callable[[str], None] | None = None,
    count: Progress | None = None,
) -> Calibrated:
    """Run the campaign, predict each pose from the others, judge outliers and set-ups, predict ``holdout``.

    Raises
    ------
    InputError
        The campaign does not fit model or readings, the readings tell nothing or are too few, or ``holdout`` has
        poses that the calibration has seen.
    """
    if request.campaign.robot != given.robot.name:
        raise InputError(
            "calibration file is for robot",
            code="A010",
            value=request.campaign.robot,
            allowed=given.robot.name,
            remedy="choose the file of this robot, or name this robot in its 'robot' key",
        )
    campaign = with_assumed_walls(request.campaign, given.description, given.model)
    request = replace(request, campaign=campaign)
    if holdout is not None:
        refuse_seen(table, holdout, "the calibration")
    refuse_cut_cycles(given.effects, table, request.loads, "--loads")
    used = select_loads(table, request.loads)
    history = history_of_part(table, lambda whole: select_loads(whole, request.loads))
    refuse_useless(given, table, used, history if used is table else None)
    build = _builder(given)
    found = run_campaign(
        given.description,
        build,
        used,
        request.campaign,
        store=store,
        progress=say,
        own=given.own,
        history=history,
        spacing=request.spacing,
    )
    rng = np.random.default_rng(request.seed)
    stages = tuple(_findings(stage, used, request, rng, count) for stage in found.stages)
    if _all_at_once(found):
        error, half, skipped = stages[0].left_out, stages[0].left_out_half95, stages[0].skipped
    else:
        error, half, skipped = left_out(
            given.description, build, used, request.campaign, found, count, given.own, history, request.spacing
        )
    shifts = [
        e.parameter.name for s in stages for e in s.result.certainty.estimates if e.parameter.kind.shifts == "point"
    ]
    doubts = [*reading_doubts(given, used)]
    for stage in (s for s in found.stages if s.study is None):
        doubts += _doubts(stage, used, history, words.place(stage, found.stages), request)
    remarks = (
        *(doubt.words for doubt in doubts),
        *words.study_remarks(found.studies),
        *words.remarks(found.stages, request.expected),
        *words.points_remark(shifts, points_of(used)),
        *walls_remarks(campaign, given.description, given.model),
    )
    return Calibrated(
        request,
        used,
        found,
        with_origin(found, used, request.loads, remarks),
        stages,
        error,
        half,
        skipped,
        None if holdout is None else held_out(found, holdout),
        remarks,
        tuple(doubts),
    )


def _doubts(stage: StageResult, used: Measurements, history: History, place: str, request: Request) -> list[Doubt]:
    """What the readings of a stage say against it: a drift in their order, and what no springs explain."""
    e, read, floor = stage.estimate, readings_of(used, stage.stage), request.campaign.noise.floor
    then = history_of_part(used, lambda whole: readings_of(whole, stage.stage), history)
    down = then.unloading(load_size(read.wrench))[e.problem.row]
    by_rows = not np.isfinite(then.clock).all()
    moved = drift(e, (order_of_rows(read.q) if by_rows else then.clock)[e.problem.row], floor)
    if moved is None or moved.p_value >= LEVEL:
        said = words.unexplained_doubts(unexplained(e, down, floor[0]))
    else:
        left = unexplained(e, down, floor[0], moved.size)
        said = [words.drift_doubt(stage, moved, by_rows), *words.unexplained_doubts(left)]
    return [replace(one, words=place + one.words) for one in said]


def _builder(given: Arm) -> Callable[[ModelDescription], ArmModel]:
    """Models as the given one, without effects: unchanged links are found in the cache."""

    def build(description: ModelDescription) -> ArmModel:
        if description is given.description and not description.effect:
            return given.model
        return build_plain(description, given.model.link_kind, given.model.load_path)

    return build


def _all_at_once(found: Calibration) -> bool:
    first = found.stages[0].stage if len(found.stages) == 1 and not found.studies else None
    return first is not None and not (first.poses or first.loads_N or first.levels)


def _findings(
    stage: StageResult, used: Measurements, request: Request, rng: np.random.Generator, count: Progress | None
) -> StageFindings:
    nothing = np.full(len(stage.estimate.problem), np.nan)
    left_out, half, skipped = nothing, nothing, {"all": "a parametric study has no noise model to predict with"}
    if stage.study is None:
        left_out, half, skipped = leave_one_pose_out(stage.estimate, count)
    several = request.bootstrap > 0 and stage.study is None
    return StageFindings(
        stage,
        readings_of(used, stage.stage),
        left_out,
        half,
        skipped,
        _independent(stage, request.campaign.noise) if stage.estimate.noise.has_common else None,
        without_outliers(stage) if stage.study is None and downweighted(stage.estimate) else None,
        bootstrap(stage.estimate, rng, request.bootstrap, count) if several else None,
    )


def _independent(stage: StageResult, noise: NoiseChoice) -> Certainty:
    """The same estimate with every reading a set-up of its own, so that no scatter between set-ups can be found."""
    p = stage.estimate.problem
    apart = replace(p, pose=np.arange(len(p)), poses=tuple(map(str, range(len(p)))))
    return certainty(estimate(apart, noise.floor, robust=noise.robust))
