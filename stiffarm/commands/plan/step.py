"""The step `plan`: which set-ups to measure next, in which order, and what they will tell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from doe import Measurements
from doe.certainty.uncertainty import ParameterEstimate
from doe.estimation.campaign import NoiseChoice, campaign_of
from doe.estimation.estimate import unaided
from doe.estimation.noise import Noise
from doe.estimation.problem import problem
from doe.planning.forecast import Forecast, forecast
from doe.planning.outset import Outset, check_plannable, first_outset, helped_outset, outset
from doe.planning.plan import (
    Foresight,
    MeasurementPlan,
    expected,
    experiments,
    foresee,
    idle_coordinates,
    plan,
    seen_by,
)
from doe.planning.pose_designs import pose_design, short_tour
from doe.planning.protocol import Protocol, new_labels, usual_directions, usual_point
from doe.planning.zones import Zone
from fem.arm import Arm
from fem.free.parameters import Parameter, parameter
from fem.springs import ConstantSpring
from robots import InputError, Robot, require_one_of
from robots.arm_class import arm_class
from robots.arrays import Array
from robots.progress import Progress
from stiffarm.commands.calibrate import step as calibrating
from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.commands.plan import words
from stiffarm.commands.plan.request import (
    PlanRequest,
    components_of,
    directions_of,
    resting_pose,
    usual_components,
    usual_loads,
)
from stiffarm.session import steps
from stiffarm.session.reading_checks import refuse_useless

# Poses in which a coordinate is moved to see whether it matters.
PROBES = 40


@dataclass(frozen=True)
class Planned:
    """A plan in the order of measuring.

    ``labels`` (n,) of its set-ups; ``candidates``: poses it was chosen from; ``expected`` (n, 6) m and rad under
    the largest load, None before any reading; ``held_deg``: coordinates that stand still; ``notes``: remarks;
    ``calibrated``: what the readings so far say, as `calibrate` finds it, None where they are too few.
    """

    request: PlanRequest
    start: Outset
    made: MeasurementPlan
    forecast: Forecast
    labels: tuple[str, ...]
    candidates: int
    expected: Array | None
    held_deg: dict[str, float]
    notes: tuple[str, ...]
    calibrated: Calibrated | None = None

    @property
    def found(self) -> tuple[ParameterEstimate | None, ...]:
        """What the readings so far say on each parameter."""
        return self.start.found or (None,) * len(self.start.parameters)

    @property
    def rows(self) -> list[tuple[Foresight, ParameterEstimate | None]]:
        """Each parameter's prospects beside what is known of it."""
        return list(zip(self.made.foresight, self.found, strict=True))

    @property
    def sentences(self) -> list[str]:
        """What the plan will tell."""
        out = [words.told(f, found) for f, found in self.rows]
        return out if self.request.is_plain else [*out, words.against_chance(self.made)]


def make_plan(given: Arm, data: Measurements | None, request: PlanRequest, progress: Progress | None = None) -> Planned:
    """Estimate what the data say, choose the set-ups that tell most beyond it, and order them.

    Raises
    ------
    InputError
        Unknown parameters or coordinates, no pose that can be taken, more set-ups than candidates, loads that
        nothing tells, readings that tell nothing, or that move with none of the parameters.
    """
    robot, zone = given.robot, request.zone(given)
    rng = np.random.default_rng(request.seed)
    protocol = _protocol(given, data, request)
    probes = pose_design(robot, PROBES, fixed=resting_pose(robot, {}), rng=np.random.default_rng(request.seed))
    free, notes = _free(given, data, request, protocol, probes)
    start, calibrated = _outset(given, data, free, request.gauge)
    if not seen_by(experiments(start, probes, protocol), start.vague).any():
        raise InputError(
            f"no reading of this plan moves with {', '.join(p.name for p in free)}",
            code="C004",
            remedy="load in other --directions, or --read more components",
        )
    vary, held, remarks = _coordinates(start, protocol, probes, request, rng)
    poses = _candidates(robot, request, zone, vary, held, rng)
    if request.is_plain:
        made = foresee(start, poses, protocol, request.criterion)
    else:
        _check_size(request, len(poses) * len(protocol.directions))
        made = plan(start, poses, request.count, protocol, request.criterion, rng=rng, progress=progress)
    made = _ordered(made, request, rng)
    # Numbers of its own: what is promised moves no choice.
    promise = forecast(start, made, np.random.default_rng([request.seed, 1]))
    told = zip(made.foresight, promise.half95.tolist(), strict=True)
    made = replace(made, foresight=tuple(replace(f, half95=half) for f, half in told))
    still = zip(robot.coordinates, np.degrees(held).tolist(), strict=True)
    held_deg = {name: angle for name, angle in still if name not in vary}
    return Planned(
        request,
        start,
        made,
        promise,
        new_labels(len(made.q), "N", () if data is None else data.pose),
        len(poses),
        expected(start, made.q, made.direction * protocol.forces.max(), protocol),
        held_deg,
        (*notes, *remarks, *_remarks(start, request, zone, data)),
        calibrated,
    )


def _protocol(given: Arm, data: Measurements | None, request: PlanRequest) -> Protocol:
    forces = usual_loads(given.description, data) if not request.loads else np.array(sorted(set(request.loads)))
    read = np.zeros((0, 3)) if data is None else data.wrench[:, :3]
    directions = usual_directions(read) if request.directions is None else directions_of(request.directions)
    components = usual_components(data) if request.read is None else components_of(request.read)
    # A table leaves the point empty where it is the model's tool point.
    tool = given.robot.T_flange_tool[:3, 3] - given.model.load_point
    point = None if data is None else usual_point(data.point, tool)
    return Protocol(forces, directions, components, request.repeats, request.unloading, point)


def _free(
    given: Arm, data: Measurements | None, request: PlanRequest, protocol: Protocol, probes: Array
) -> tuple[list[Parameter], list[str]]:
    """Parameters to be told: those named, else the springs that the data or the new readings move with."""
    names = None if request.free is None else tuple(request.free)
    notes = []
    if names is None:
        joints = given.robot.joint_names
        springs = first_outset(
            given.model, [parameter(given.model, f"{j}.stiffness") for j in joints], Noise((1.0, 1.0)), _usual(given)
        )
        visible = seen_by(experiments(springs, probes, protocol), springs.vague)
        known = set() if data is None else set(steps.springs_seen(given, data))
        chosen = [j for j, seen in zip(joints, visible, strict=True) if seen or j in known]
        if not chosen:
            raise InputError(
                "no joint spring moves a reading of this plan", code="C004", remedy="load in other --directions"
            )
        names = tuple(f"{j}.stiffness" for j in chosen)
    free = [parameter(given.model, name) for name in names]
    check_plannable(free)
    for p in free:
        if p.spring_of is not None:
            joint = given.model.joints[given.robot.joint_names.index(p.spring_of)]
            if not isinstance(joint.axial, ConstantSpring):
                notes.append(f"{p.name}: the model's spring depends on joint angles; the plan takes it as constant")
    return free, notes


def _usual(given: Arm) -> dict[str, float]:
    """Springs that arms of this size have, the middle of the class, N m/rad."""
    size = arm_class(given.description, given.robot)
    middle = np.sqrt(size.low * size.high).tolist()
    return {f"{joint}.stiffness": k for joint, k in zip(given.robot.joint_names, middle, strict=True)}


def _outset(
    given: Arm, data: Measurements | None, free: list[Parameter], gauge: tuple[float, float]
) -> tuple[Outset, Calibrated | None]:
    """Where the plan starts, and the calibration that it rests on where there are readings enough for one."""
    if data is None:
        return first_outset(given.model, free, Noise(white=gauge), _usual(given)), None
    p = problem(given.model, data, free)
    if len(unaided(p)) > len(p):
        refuse_useless(given, data, data)
        return helped_outset(p, gauge), None
    noise = NoiseChoice(gauge_mm=1e3 * gauge[0], gauge_mrad=1e3 * gauge[1])
    campaign = campaign_of(given.robot.name, tuple(q.name for q in free)).model_copy(update={"noise": noise})
    found = calibrating.calibrate(given, data, calibrating.Request(campaign))
    (stage,) = found.found.stages
    return outset(stage.estimate, stage.certainty), found


def _coordinates(
    start: Outset, protocol: Protocol, probes: Array, request: PlanRequest, rng: np.random.Generator
) -> tuple[tuple[str, ...], Array, list[str]]:
    """Coordinates that vary, where the others stand (dof,) rad, and why."""
    robot = start.free.model.robot
    hold = request.hold or {}
    if not isinstance(hold, Mapping):
        raise InputError("--hold", code="A004", value=hold, allowed="angles in deg by name, as in q1_deg=30")
    held = resting_pose(robot, hold)
    if request.vary is not None:
        for name in request.vary:
            require_one_of("--vary", name, robot.coordinates, code="A001", remedy="choose from these")
        if clash := [name for name in hold if name in request.vary]:
            raise InputError(f"{', '.join(clash)}: both in --vary and in --hold", code="A002", allowed="one of them")
        return tuple(request.vary), held, []
    idle = idle_coordinates(start, protocol, probes, rng)
    vary = tuple(n for n in robot.coordinates if n not in idle and n not in hold)
    if not vary:
        raise InputError("every coordinate stands still", code="C005", remedy="name those that vary with --vary")
    free_idle = [n for n in idle if n not in hold]
    if not free_idle:
        return vary, held, []
    stand = ", ".join(f"{n} = {np.degrees(held[robot.coordinate_index(n)]):g}" for n in free_idle)
    return vary, held, [f"{stand}: makes no difference to what is read, so it stands still (--vary overrides)"]


def _candidates(
    robot: Robot, request: PlanRequest, zone: Zone, vary: tuple[str, ...], held: Array, rng: np.random.Generator
) -> Array:
    """Poses (N, dof) rad to choose from, in whole degrees where they are drawn: a sheet is set by hand."""
    n = request.count if request.is_plain else request.candidates
    poses = pose_design(
        robot, n, request.design, coordinates=vary, fixed=held, levels=request.levels, zone=zone, rng=rng
    )
    if not len(poses):
        raise InputError(
            f"poses of the {request.design} design that {robot.name} can take: none",
            code="C005",
            remedy="let more coordinates vary, move the floor or the boxes, or take --design sobol",
        )
    if request.design in ("factorial", "fractional"):
        if request.is_plain and len(poses) > request.count:
            raise InputError(
                f"--design-only with --design {request.design}: it has {len(poses)} poses",
                code="C005",
                value=request.count,
                allowed=f"{len(poses)} or more",
                remedy="give that number, fewer --levels, or fewer coordinates with --vary",
            )
        return poses
    poses = _wrapped(robot, poses)
    whole = np.radians(np.round(np.degrees(poses)))
    fits = robot.reachable(whole)
    fits[fits] = zone.free(robot, whole[fits])
    poses = np.where(fits[:, None], whole, poses)
    return poses[np.sort(np.unique(np.round(poses, 9), axis=0, return_index=True)[1])]


def _wrapped(robot: Robot, q: Array) -> Array:
    """Angles within half a turn of 0 where the limits allow: the same poses, without cables wound up."""
    turned = (q + np.pi) % (2.0 * np.pi) - np.pi
    inside = (turned >= robot.limits[:, 0]) & (turned <= robot.limits[:, 1])
    # Coupled limits are about angles as they are counted, so their joints stay.
    coupled = np.any([c.factors != 0.0 for c in robot.couplings], axis=0) if robot.couplings else False
    return np.where(inside & ~np.broadcast_to(coupled, q.shape), turned, q)


def _check_size(request: PlanRequest, candidates: int) -> None:
    if not 1 <= request.count <= candidates:
        raise InputError(
            "--poses",
            code="C005",
            value=request.count,
            allowed=f"1 to {candidates}, the number of candidate set-ups",
            remedy="ask for fewer, or give more --candidates",
        )


def _ordered(made: MeasurementPlan, request: PlanRequest, rng: np.random.Generator) -> MeasurementPlan:
    order = rng.permutation(len(made.q)) if request.random_order else short_tour(made.q)
    return replace(made, q=made.q[order], direction=made.direction[order])


def _remarks(start: Outset, request: PlanRequest, zone: Zone, data: Measurements | None) -> list[str]:
    out = []
    if data is None:
        out.append(
            "no readings yet: planned for the model's own values (where a joint is rigid the middle of its "
            "arm's class) and chosen for the gauge's scatter alone"
        )
    elif not start.found:
        out.append(f"{start.readings} reading(s) are fewer than the parameters: a vague prior stands in for the rest")
    kept = [] if zone.floor is None else [f"above z = {1e3 * zone.floor:g} mm"]
    kept += [f"out of {len(zone.boxes)} box(es)"] if zone.boxes else []
    kept += [f"wrist and tool {1e3 * zone.own:.0f} mm from the lines of base and upper arm"] if zone.own else []
    out.append(f"poses keep {'; '.join(['the joint limits', *kept])}. That is no collision check")
    if data is not None and request.repeats > 1 and not start.noise.has_common:
        out.append("the choice counts repeats as independent readings: those so far show no scatter between set-ups")
    if request.random_order:
        out.append("random order: slow drift of gauge and robot does not look like an effect of the pose")
    else:
        out.append(
            "order: a short way through joint space; with drift to fear take --random-order, "
            "or read the first set-up again at the end"
        )
    if request.unloading:
        out.append("readings while unloading tell of friction and hysteresis; they are not counted in the prediction")
    return out
