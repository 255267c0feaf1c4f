"""The step `calibrate`: numbers of a model from readings, what those can tell, and how well the result predicts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from doe import Measurements, select_loads
from doe.calibration import (
    Calibration,
    StageResult,
    leave_one_pose_out,
    readings_of,
    run_campaign,
    undetermined,
    without_outliers,
)
from doe.campaign import Campaign, Freed, NoiseChoice, campaign_of
from doe.estimate import estimate
from doe.lack_of_fit import downweighted
from doe.problem import Problem, problem
from doe.readings import rms_mm
from doe.uncertainty import Certainty, bootstrap, certainty
from fem import ArmModel, build_model
from fem.parameters import TURN
from meshes.array_cache import ArrayCache
from robots import InputError, ModelDescription
from robots.schema import Calibration as Origin
from stiffarm import calibration_words as words
from stiffarm.inputs import ModelInput

Array = NDArray[np.float64]
Lines = NDArray[np.int64]
Count = Callable[[int, int], None]

SOURCE_KEY = "calibrated"


@dataclass(frozen=True)
class Request:
    """What is asked of a calibration.

    ``loads`` N, empty for all; ``expected`` N m/rad: where joint springs are expected, to be said when they are
    not; ``bootstrap``: how often to draw poses with replacement.
    """

    campaign: Campaign
    loads: tuple[float, ...] = ()
    expected: tuple[float, float] | None = None
    bootstrap: int = 0
    seed: int = 0


@dataclass(frozen=True)
class StageFindings:
    """One stage and all that is said about it.

    ``lines`` (m,): lines of the table that its m components stand in; ``loads_N`` (m,) and ``phase`` (m,);
    ``left_out`` (m,): errors of poses predicted by the others, ``skipped`` why some are not; ``independent``: the
    same estimate as if nothing were common to a set-up, None if nothing is; ``full_weight``: with outliers at full
    weight, None without any; ``drawn`` (times, p): bootstrapped values.
    """

    result: StageResult
    lines: Lines
    loads_N: Array  # noqa: N815 - the unit's letter
    phase: tuple[str | None, ...]
    left_out: Array
    skipped: dict[str, str]
    independent: Certainty | None
    full_weight: StageResult | None
    drawn: Array | None


@dataclass(frozen=True)
class Holdout:
    """Readings kept out of the calibration: ``error`` (m,) read minus predicted, NaN at poses in ``blind``.

    ``expected`` (m,): standard deviation by the noise found; ``blind``: why the calibrated model cannot predict a
    pose.
    """

    data: Measurements
    system: Problem
    error: Array
    expected: Array
    blind: dict[str, str]

    @property
    def rms_mm(self) -> float:
        """RMS error of the translations predicted."""
        known = ~np.isnan(self.error)
        return rms_mm(self.error[known], self.system.component[known])


@dataclass(frozen=True)
class Calibrated:
    """A finished calibration with its judgement; ``data``: the readings used; arrays (m,) as in ``found.overall``."""

    request: Request
    data: Measurements
    found: Calibration
    description: ModelDescription
    stages: tuple[StageFindings, ...]
    left_out: Array
    skipped: dict[str, str]
    holdout: Holdout | None
    remarks: tuple[str, ...]

    @property
    def left_out_rms_mm(self) -> float:
        """RMS of the translations at poses predicted by a calibration that has not seen them."""
        known = ~np.isnan(self.left_out)
        return rms_mm(self.left_out[known], self.found.overall.component[known])

    @property
    def identified(self) -> int:
        """How many numbers the readings say something about."""
        return sum(e.status != "not identified" for s in self.found.stages for e in s.certainty.estimates)


def springs_campaign(
    robot: str, joints: tuple[str, ...], names: tuple[str, ...] | None, expected: tuple[float, float]
) -> Campaign:
    """All at once: the numbers named, else constant springs of ``joints``; their range is the widest plausible one."""
    plain = campaign_of(robot, names or tuple(f"{j}.stiffness" for j in joints))
    widest = min(TURN[0], expected[0]), max(TURN[1], expected[1])
    freed = [
        Freed(name=p.name, lower=widest[0], upper=widest[1]) if words.is_joint_spring(p.name) and widest != TURN else p
        for p in plain.parameter
    ]
    return plain.model_copy(update={"parameter": tuple(freed)})


def calibrate(
    given: ModelInput,
    table: Measurements,
    request: Request,
    *,
    holdout: Measurements | None = None,
    store: ArrayCache | None = None,
    say: Callable[[str], None] | None = None,
    count: Count | None = None,
) -> Calibrated:
    """Run the campaign, predict each pose from the others, judge outliers and set-ups, predict ``holdout``.

    Raises
    ------
    InputError
        The campaign does not fit model or readings, there are too few readings, or ``holdout`` has poses that the
        calibration has seen.
    """
    if request.campaign.robot != given.robot.name:
        raise InputError(
            "calibration file is for robot",
            value=request.campaign.robot,
            allowed=given.robot.name,
            remedy="choose the file of this robot, or name this robot in its 'robot' key",
        )
    if holdout is not None:
        _refuse_seen(table, holdout)
    used = select_loads(table, request.loads)
    build = _builder(given)
    found = run_campaign(given.description, build, used, request.campaign, store=store, progress=say)
    rng = np.random.default_rng(request.seed)
    stages = tuple(_findings(stage, used, request, rng, count) for stage in found.stages)
    simple = _all_at_once(found)
    left_out, skipped = (
        (stages[0].left_out, stages[0].skipped) if simple else _left_out(given, build, used, request, found, count)
    )
    remarks = words.remarks(found.stages, request.expected)
    return Calibrated(
        request, used, found, _described(given, found, used, request, remarks), stages, left_out, skipped,
        None if holdout is None else _held_out(found, holdout), remarks,
    )  # fmt: skip


def _builder(given: ModelInput) -> Callable[[ModelDescription], ArmModel]:
    """Models as the given one: unchanged links are found in the cache."""
    return lambda description: build_model(description, given.model.link_kind, given.model.load_path)


def _all_at_once(found: Calibration) -> bool:
    (first, *more) = [s.stage for s in found.stages]
    return not (more or first.poses or first.loads_N or first.levels)


def _findings(
    stage: StageResult, used: Measurements, request: Request, rng: np.random.Generator, count: Count | None
) -> StageFindings:
    p, mine = stage.estimate.problem, readings_of(used, stage.stage)
    left_out, skipped = np.full(len(p), np.nan), {"all": "a parametric study has no noise model to predict with"}
    if stage.study is None:
        left_out, skipped = leave_one_pose_out(stage, count)
    several = request.bootstrap > 0 and stage.study is None
    return StageFindings(
        stage,
        np.array(mine.row_numbers, dtype=np.int64)[p.row],
        mine.loads_N[p.row],
        tuple(mine.phase[i] for i in p.row),
        left_out,
        skipped,
        _independent(stage, request.campaign.noise) if stage.estimate.noise.has_common else None,
        without_outliers(stage) if stage.study is None and downweighted(stage.estimate) else None,
        bootstrap(stage.estimate, rng, request.bootstrap, count) if several else None,
    )


def _independent(stage: StageResult, noise: NoiseChoice) -> Certainty:
    """The same estimate with every reading a set-up of its own, so that no scatter between set-ups can be found."""
    p = stage.estimate.problem
    apart = replace(p, pose=np.arange(len(p)), poses=tuple(map(str, range(len(p)))))
    return certainty(estimate(apart, (noise.gauge_mm * 1e-3, noise.gauge_mrad * 1e-3), robust=noise.robust))


def _left_out(
    given: ModelInput,
    build: Callable[[ModelDescription], ArmModel],
    used: Measurements,
    request: Request,
    found: Calibration,
    count: Count | None,
) -> tuple[Array, dict[str, str]]:
    """Errors (m,) of each pose predicted by all stages run again without it."""
    whole, labels = found.overall, np.array(used.pose, dtype=str)
    error, reasons = np.full(len(whole), np.nan), {}
    for k, label in enumerate(whole.poses):
        if count is not None:
            count(k, len(whole.poses))
        fewer = [
            s.model_copy(update={"poses": tuple(q for q in s.poses if q != label)}) for s in request.campaign.stage
        ]
        lost = [a.name for a, b in zip(request.campaign.stage, fewer, strict=True) if a.poses and not b.poses]
        if lost:
            reasons[label] = f"stage {lost[0]} has no other pose"
            continue
        campaign = request.campaign.model_copy(update={"stage": tuple(fewer)})
        try:
            rest = run_campaign(given.description, build, used.select(labels != label), campaign)
        except InputError as reason:
            reasons[label] = str(reason)
            continue
        mine = used.select(labels == label)
        blind = _blind(rest, mine)
        if blind:
            reasons[label] = f"without pose {label} the readings do not determine {', '.join(blind)}"
            continue
        error[whole.pose == k] = _error(rest.model, mine)[0]
    return error, reasons


def _error(model: ArmModel, data: Measurements) -> tuple[Array, Problem]:
    """Read minus predicted (m,)."""
    system = problem(model, data, ())
    return system.value - system.evaluate(np.zeros(0))[0], system


def _blind(found: Calibration, data: Measurements) -> list[str]:
    """Numbers that no stage determined and that readings of ``data`` move with."""
    out: list[str] = []
    for stage in found.stages:
        free = stage.estimate.problem.free
        there = problem(free.model, data, free.parameters, free.laws, free.walls)
        out += undetermined(stage.estimate, there.evaluate(stage.estimate.u)[1])
    return out


def _held_out(found: Calibration, data: Measurements) -> Holdout:
    error, system = _error(found.model, data)
    blind = {}
    for k, label in enumerate(system.poses):
        names = _blind(found, data.select(np.array(data.pose, dtype=str) == label))
        if names:
            blind[label] = f"the calibration does not determine {', '.join(names)}"
            error[system.pose == k] = np.nan
    noise = found.stages[-1].estimate.noise
    f = system.evaluate(np.zeros(0))[0]
    expected = np.sqrt(noise.variance(system, f) + np.sum(noise.common(system, f) ** 2, axis=1))
    return Holdout(data, system, error, expected, blind)


def _refuse_seen(table: Measurements, holdout: Measurements) -> None:
    """Refuse poses by their angles: labels may differ."""
    seen = {tuple(row) for row in np.round(table.q, 9).tolist()}
    both = [
        label for label, row in zip(holdout.pose, np.round(holdout.q, 9).tolist(), strict=True) if tuple(row) in seen
    ]
    if both:
        raise InputError(
            f"--holdout {holdout.source}: poses that are in {table.source} too",
            value=", ".join(dict.fromkeys(both)),
            allowed="poses that the calibration has not seen",
            remedy="remove them from one of the two tables",
        )


def _described(
    given: ModelInput, found: Calibration, used: Measurements, request: Request, remarks: tuple[str, ...]
) -> ModelDescription:
    """The calibrated description with where it came from."""
    source = f"global calibration on {used.source}, SHA-256 {used.sha256}"
    changed = found.description.model_copy(
        update={
            "load_path": given.model.load_path,
            "sources": {**found.description.sources, SOURCE_KEY: source},
            "calibration": Origin(
                scheme="global",
                load_path=given.model.load_path,
                links=given.model.link_kind,
                data=used.source,
                data_sha256=used.sha256,
                rms_mm=found.rms_mm,
                loads_N=request.loads,
                notes=remarks,
            ),
        }
    )
    # Through the validator once more: a written file must be one that can be read.
    return ModelDescription.model_validate(changed.model_dump(by_alias=True))
