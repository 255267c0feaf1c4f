"""Run a calibration file: stage by stage or all at once, resumable, with what each stage can and cannot tell."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from doe.certainty.identifiability import TradeOff, trade_offs, unseen
from doe.certainty.lack_of_fit import LackOfFit, lack_of_fit
from doe.certainty.uncertainty import Certainty, certainty
from doe.estimation.campaign import Campaign, Stage
from doe.estimation.estimate import Estimate, estimate, estimate_at, unrest
from doe.estimation.noise import NAMES, Noise, within_readings
from doe.estimation.problem import Problem, problem
from doe.model_file.applied import apply_estimates, with_springs
from doe.published.parametric import LevelStudy, level_study
from doe.published.pose_studies import PoseStudies, study_poses
from doe.tables.loaded import PointOf, history_of, history_of_part, points_of, rms_mm, select_loads, select_poses
from doe.tables.measurements import Measurements
from fem import ArmModel
from fem.effects import LOAD_PATH, History, Maker, PlacedEffect, described_effects
from fem.elements.walls import wall_flexibilities
from fem.free.parameters import FreeLaw
from fem.springs import spring_from
from meshes.array_cache import ArrayCache, add_to, formulation_hash
from robots import InputError, ModelDescription, content_hash
from robots.arrays import Array
from robots.progress import Messages
from robots.schema.description import LogPolynomialLaw
from robots.schema.quantities import RotationalStiffness

Build = Callable[[ModelDescription], ArmModel]

FORMAT = "stiffarm-stage/3"
# Numbers that were kept are those of these readings if one more round of the estimator moves predictions by no more
# than this share of their standard deviations, and the noise and the weights of readings by no more than that one.
KEPT_STILL, KEPT_WITHIN = 1e-2, 0.1


@dataclass(frozen=True)
class StageResult:
    """One stage: its estimate on its own readings, and what that can and cannot tell.

    ``study``: the parametric study, if the stage was one; its numbers have no noise model, so their intervals are
    those of least squares around the best levels. ``resumed``: its numbers were found by an earlier run.
    """

    stage: Stage
    estimate: Estimate
    certainty: Certainty
    trade_offs: tuple[TradeOff, ...]
    unseen: tuple[str, ...]
    lack_of_fit: LackOfFit
    laws: tuple[FreeLaw, ...]
    study: LevelStudy | None = None
    resumed: bool = False


@dataclass(frozen=True)
class Count:
    """Parameters that were free; of them those that stand at a bound, and those that the readings identify."""

    free: int
    at_bound: int
    identified: int

    def __str__(self) -> str:
        return f"{self.free} free parameters ({self.identified} identified, {self.at_bound} at a bound)"


@dataclass(frozen=True)
class Calibration:
    """A finished calibration: stages, the calibrated description and model, residuals over all readings used.

    ``overall``: all readings evaluated with the final numbers, nothing set free (``residual`` read minus predicted).
    ``model`` has none of ``effects``, which take part in every prediction. ``studies``: stages of level studies pose
    by pose, which have no estimate of their own and are not among ``stages``.
    """

    campaign: Campaign
    stages: tuple[StageResult, ...]
    description: ModelDescription
    model: ArmModel
    overall: Problem
    residual: Array
    effects: tuple[PlacedEffect, ...] = ()
    studies: tuple[PoseStudies, ...] = ()

    @property
    def rms_mm(self) -> float:
        """RMS of the translational residuals over all readings used."""
        return rms_mm(self.residual, self.overall.component)

    @property
    def count(self) -> Count:
        """How many parameters were free, and what became of them."""
        status = [e.status for s in self.stages for e in s.certainty.estimates]
        return Count(
            len(status) + sum(s.free for s in self.studies),
            status.count("at bound") + sum(s.at_bound for s in self.studies),
            len(status)
            - status.count("at bound")
            - status.count("not identified")
            + sum(s.identified for s in self.studies),
        )


def run_campaign(
    description: ModelDescription,
    build: Build,
    data: Measurements,
    campaign: Campaign,
    *,
    store: ArrayCache | None = None,
    progress: Messages | None = None,
    own: Sequence[Maker] = (),
    history: History | None = None,
    spacing: str = "log",
) -> Calibration:
    """Estimate a campaign's numbers; earlier stages' numbers are held in later ones.

    The description's effects take part in all predictions; those of their numbers that are not free are held.

    Parameters
    ----------
    build : makes the mechanical model of a description (kind of links and load path as wanted), without its effects
        (:func:`fem.effects.build_plain`)
    store : where finished stages are kept; a run that was stopped goes on from there with the same numbers, once one
        more round of the estimator has left them where they are
    history : of the readings where these are part of a campaign; by default what the table says
    spacing : of the levels of studies pose by pose, "log" or "linear"
    own : the user's own effects; stages with them are not kept, for their laws may change

    Raises
    ------
    InputError
        A stage names a pose, load or number that is not there, or has too few readings; a stage at some loads only
        of a model with a memory, where readings were taken while unloading.
    """
    stages = campaign.stage or (Stage(name="all at once", parameters=campaign.names),)
    history = history or history_of(data)
    key = _key(description, data, campaign, history) if store is not None and not own else None
    store = None if key is None else store
    model = build(description)
    campaign.check_against(model.robot)
    description, model = _at_start(description, model, campaign)
    effects = _effects(description, model, own)
    for stage in stages:
        refuse_cut_cycles(effects, data, stage.loads_N, f"stage {stage.name!r}: loads_N", history)
    done: list[StageResult] = []
    studies: list[PoseStudies] = []
    regressions = {f"{law.joint}.law" for law in campaign.regressions}
    for number, stage in enumerate(stages):
        if regressions.intersection(stage.parameters):
            earlier = [pose for s in studies for pose in s.stage.poses]
            studies.append(study_poses(model, data, campaign, stage, earlier, spacing, progress))
            description, model = _with_springs(description, model, studies[-1].laws)
            continue
        result = _run_stage(description, (model, effects, history), data, campaign, stage, store, f"{key}:{number}")
        done.append(result)
        description, model = _after(description, model, build, result, points_of(readings_of(data, stage)))
        effects = _effects(description, model, own)
        if progress is not None:
            if result.resumed and store is not None:
                progress(f"resumed: stage {stage.name} from {store.folder}")
            e = result.estimate
            error = rms_mm(e.residual, e.problem.component)
            progress(f"{stage.name}: {len(e.u)} parameters on {len(e.problem)} readings, RMS {error:.3f} mm")
    whole = problem(model, data, (), effects=effects, history=history)
    residual = whole.value - whole.evaluate(np.zeros(0))[0]
    return Calibration(campaign, tuple(done), description, model, whole, residual, effects, tuple(studies))


def _at_start(description: ModelDescription, model: ArmModel, campaign: Campaign) -> tuple[ModelDescription, ArmModel]:
    """Springs that are to be studied pose by pose stand where the campaign says until their stage."""
    start = RotationalStiffness(value=campaign.springs.start_Nm_per_rad, unit="N m/rad", source="assumed")
    return _with_springs(description, model, {law.joint: start for law in campaign.regressions})


def _with_springs(
    description: ModelDescription, model: ArmModel, springs: Mapping[str, RotationalStiffness | LogPolynomialLaw]
) -> tuple[ModelDescription, ArmModel]:
    """Description and model with other springs; links and the rest stay as they are built."""
    if not springs:
        return description, model
    laws = {
        joint: spring.si if isinstance(spring, RotationalStiffness) else spring_from(model.robot, spring)
        for joint, spring in springs.items()
    }
    return with_springs(description, springs), model.with_springs(laws)


def _after(
    description: ModelDescription, model: ArmModel, build: Build, found: StageResult, points: Sequence[PointOf]
) -> tuple[ModelDescription, ArmModel]:
    """Description and model with what a stage found; links are built again only where these have changed."""
    estimates = found.certainty.estimates
    description = apply_estimates(description, estimates, found.laws, points=points)
    springs = {e.parameter.place: e.value for e in estimates if not math.isnan(e.value)}
    if all(e.parameter.spring_of is not None for e in estimates):
        return description, model.with_springs(springs)
    return description, build(description)


def _effects(description: ModelDescription, model: ArmModel, own: Sequence[Maker]) -> tuple[PlacedEffect, ...]:
    """Effects beyond a model that :func:`fem.effects.build_plain` made: it has the load path already."""
    return tuple(e for e in described_effects(description, model, own) if e.effect.code != LOAD_PATH)


def refuse_cut_cycles(
    effects: Sequence[PlacedEffect],
    data: Measurements,
    loads: tuple[float, ...],
    where: str,
    history: History | None = None,
) -> None:
    """Readings while unloading hang on the largest load before: without it a memory remembers something else.

    ``history`` of the readings, by default what the table says: steps tell the way down as phases do.
    """
    memory = [e.effect.code for e in effects if e.effect.needs_history]
    if not (memory and loads):
        return
    down = (history or history_of(data)).unloading(np.linalg.norm(data.wrench, axis=1))
    if down.any() or "unloading" in data.phase:
        raise InputError(
            f"{where}, with {', '.join(memory)} and readings while unloading",
            code="C002",
            value=", ".join(f"{v:g} N" for v in loads),
            allowed="all loads: these effects remember the largest",
            remedy="leave the loads out, or remove the effect",
        )


def _key(description: ModelDescription, data: Measurements, campaign: Campaign, history: History) -> str | None:
    """Hash of everything that the stages' numbers depend on, the program too; None where its source is not there."""
    program = formulation_hash(
        "doe.estimation.estimate", "doe.tables.loaded", "fem.free.model", "fem.effects.described"
    )
    if program is None:
        return None
    digest = hashlib.sha256()
    for text in (FORMAT, program, content_hash(description), campaign.model_dump_json(by_alias=True), *data.pose):
        add_to(digest, text)
    for array in (data.q, data.wrench, data.displacement, data.point, data.sigma, data.step):
        add_to(digest, array)
    for array in (history.cycle.astype(np.float64), history.order.astype(np.float64), history.clock):
        add_to(digest, array)
    add_to(digest, json.dumps([data.phase, data.repeat]))
    return digest.hexdigest()


def _run_stage(
    description: ModelDescription,
    arm: tuple[ArmModel, tuple[PlacedEffect, ...], History],
    data: Measurements,
    campaign: Campaign,
    stage: Stage,
    store: ArrayCache | None,
    key: str,
) -> StageResult:
    used, (model, effects, history) = readings_of(data, stage), arm
    then = history_of_part(data, lambda whole: readings_of(whole, stage), history)
    parameters, laws = campaign.free(model, stage.parameters, effects)
    walls = wall_flexibilities(description, model, parameters)
    p = problem(model, used, parameters, laws, walls, effects, then)
    gauge = campaign.noise.floor
    file = hashlib.sha256(f"{key}:{model.link_kind}:{model.load_path}:{stage.model_dump_json()}".encode()).hexdigest()
    robust = campaign.noise.robust
    kept = store.get(file, lambda arrays: _fault(arrays, p, gauge, robust)) if store is not None else None
    study = None
    if kept is not None:
        found = estimate_at(p, kept["u"], Noise.of(kept["noise"]), kept["weight"], settled=True)
    elif stage.levels is None:
        found = estimate(p, gauge, robust=robust)
    else:
        study = level_study(p, stage.levels, refine=stage.refine)
        found = estimate_at(p, study.u, _scatter(p, study.u, gauge), np.ones(len(p)), settled=True)
    if store is not None and kept is None and study is None and found.settled:
        store.put(file, {"u": found.u, "noise": found.noise.numbers, "weight": found.weight})
    sure = certainty(found)
    return StageResult(
        stage, found, sure, trade_offs(found, sure), unseen(found), lack_of_fit(found), laws, study, kept is not None
    )


def readings_of(data: Measurements, stage: Stage) -> Measurements:
    """The readings that a stage uses; raises InputError if there are none."""
    used = select_loads(data, stage.loads_N)
    if stage.poses:
        used = select_poses(used, stage.poses, f"stage {stage.name!r}")
    if used.n == 0:
        raise InputError(f"stage {stage.name!r} has no reading", code="C001", remedy="check its poses and loads")
    return used


def _scatter(p: Problem, u: Array, gauge: tuple[float, float]) -> Noise:
    """Standard deviations of what a study leaves, never below the gauge's."""
    f = p.evaluate(u)[0]
    residual = p.value - f
    spare = max(len(p) - len(u), 1)
    turn = p.component >= 3
    parts = [float(np.sqrt(np.sum(residual[mask] ** 2) / spare)) for mask in (~turn, turn)]
    return within_readings(p, f, Noise(white=(parts[0], parts[1])), gauge)


def _fault(arrays: Mapping[str, Array], p: Problem, gauge: tuple[float, float], robust: bool) -> str | None:
    """What is wrong with numbers that were kept, None if they are where the estimator comes to rest."""
    expected = {"u": (len(p.parameters),), "noise": (len(NAMES) + 1,), "weight": (len(p),)}
    if {name: a.shape for name, a in arrays.items()} != expected:
        return "arrays of other shapes"
    if not all(np.isfinite(a).all() for a in arrays.values()):
        return "numbers that are not finite"
    moved, noise, weight = unrest(p, gauge, arrays["u"], Noise.of(arrays["noise"]), arrays["weight"], robust=robust)
    if moved <= KEPT_STILL and noise <= KEPT_WITHIN and weight <= KEPT_WITHIN:
        return None
    return (
        f"its numbers are no estimate from these readings: one more round moves predictions by up to {moved:.2g} "
        f"standard deviations, the noise by {100.0 * noise:.2g} %, weights by {weight:.2g}"
    )


def without_outliers(result: StageResult) -> StageResult:
    """The same stage estimated with all readings at full weight, to show what outliers do."""
    e = result.estimate
    found = estimate(e.problem, e.noise.white, robust=False)
    sure = certainty(found)
    return replace(result, estimate=found, certainty=sure)
