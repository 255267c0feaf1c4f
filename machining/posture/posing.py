"""A posture study: from a part's path to the posture along it, beside other choices, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import fem
from machining.cutting import (
    Comparison,
    Cut,
    Drawn,
    Estimated,
    StiffnessUncertainty,
    SurfaceError,
    assumed_uncertainty,
    compare,
    drawn_objective,
    surface_error,
)
from machining.posture.axes_map import AxesMap, axes_map
from machining.posture.drive import Drive
from machining.posture.path import PathPosture, optimise_path
from machining.posture.points import GammaRange
from machining.posture.problem import Course
from machining.posture.stretches import course_at
from machining.stiffness.objective import ROOM, Objective
from machining.task import Task
from robots import InputError
from robots.arrays import Array
from robots.progress import Progress

# Passes of finer grids of gamma: from 5 deg to 0.02 deg.
PASSES = 4


@dataclass(frozen=True, eq=False)
class PostureRequest:
    """What is asked.

    ``before`` rad: gamma of the program as it stands, that the result is compared with; ``cut``: the cutting force,
    None where no error is to be predicted; ``left_out``: effects of the model that the postures know nothing of;
    ``stiffness``: how uncertain the arm is, None for :func:`machining.cutting.assumed_uncertainty`.
    """

    task: Task
    objective: Objective
    gammas: GammaRange
    drive: Drive
    before: float = 0.0
    seed: int = 0
    cut: Cut | None = None
    left_out: tuple[str, ...] = ()
    stiffness: StiffnessUncertainty | None = None


@dataclass(frozen=True, eq=False)
class MillingErrors:
    """Predicted surface errors by course, and the recommended one compared with another, None without another."""

    errors: dict[str, SurfaceError]
    against: str | None
    comparison: Comparison | None


@dataclass(frozen=True, eq=False)
class Posed:
    """The result: the recommended course beside others.

    ``before``: the course at the gamma that the program has now, None where ``why_no_before`` says that there is none.
    ``stiffness``: how uncertain the arm is; ``drawn``: the objective along each course, for arms drawn from that.
    """

    request: PostureRequest
    model: fem.ArmModel
    found: PathPosture
    before: Course | None
    why_no_before: str | None
    stiffness: StiffnessUncertainty
    drawn: dict[str, Drawn]
    milling: MillingErrors | None = None

    @property
    def course(self) -> Course:
        """What is recommended."""
        return self.found.course

    @property
    def others(self) -> dict[str, Course]:
        """The courses that the recommended one is compared with, by what they are called."""
        named = {BEFORE: self.before, FIXED: self.found.fixed, EACH: self.found.each_point}
        return {name: course for name, course in named.items() if course is not None}

    def estimated(self, name: str) -> tuple[Estimated, Estimated]:
        """Mean and worst value of the objective along a course, with 95 % intervals."""
        worst = np.max if self.request.objective.minimised else np.min
        drawn = self.drawn[name]
        return drawn.estimated(_mean), drawn.estimated(lambda v: np.asarray(worst(v, axis=-1)))

    def gain(self, name: str) -> Estimated:
        """By what factor the recommended course's mean is better than another's, with its 95 % interval."""
        chosen, other = self.drawn[CHOSEN], self.drawn[name]
        return other.ratio(chosen, _mean) if self.request.objective.minimised else chosen.ratio(other, _mean)


CHOSEN, BEFORE, FIXED, EACH = "recommended", "as programmed", "best fixed gamma", "each point by itself"


def pose_along(model: fem.ArmModel, request: PostureRequest, progress: Progress | None = None) -> Posed:
    """Find the course along the path, and the one it is compared with.

    Raises
    ------
    InputError
        As :func:`machining.optimise_path`.
    """
    seeds = np.random.default_rng(request.seed).spawn(2)
    found = optimise_path(
        model,
        request.task,
        request.objective,
        request.gammas,
        request.drive,
        passes=PASSES,
        generator=seeds[0],
        progress=progress,
    )
    before, why = None, None
    try:
        before = course_at(model, request.task, request.before, request.objective, request.drive, generator=seeds[1])
    except InputError as error:
        why = error.prose
    stiffness = request.stiffness or assumed_uncertainty(model)
    posed = Posed(request, model, found, before, why, stiffness, {})
    postures = {name: course.q for name, course in ({CHOSEN: posed.course} | posed.others).items()}
    if request.objective.quantity == ROOM:
        # Of the kinematics alone, which are the same for all arms that could be drawn.
        values = {name: course.value for name, course in ({CHOSEN: posed.course} | posed.others).items()}
        drawn = {name: Drawn(value, value[None], {}) for name, value in values.items()}
    else:
        drawn = drawn_objective(model, request.task, postures, request.objective, stiffness, request.seed)
    posed = replace(posed, drawn=drawn)
    return posed if request.cut is None else replace(posed, milling=_milling(posed, request.cut))


def _mean(values: Array) -> Array:
    return np.asarray(values.mean(axis=-1))


def _milling(posed: Posed, cut: Cut) -> MillingErrors:
    """Errors of the recommended course and of what it is compared with: as programmed, else the best fixed gamma."""
    task, model = posed.request.task, posed.model
    against = next((name for name in (BEFORE, FIXED) if name in posed.others), None)
    courses = ({} if against is None else {against: posed.others[against]}) | {CHOSEN: posed.course}
    errors = {
        name: surface_error(model, task, c.q, cut.force, stiffness=posed.stiffness, tool=cut.tool)
        for name, c in courses.items()
    }
    if against is None:
        return MillingErrors(errors, None, None)
    generator = np.random.default_rng(posed.request.seed)
    return MillingErrors(errors, against, compare(errors[against], errors[CHOSEN], generator))


def map_of(posed: Posed) -> AxesMap | None:
    """The axes map behind a course; None for a path of one point or a single gamma."""
    request = posed.request
    if request.task.path.n < 2 or request.gammas.count < 3:
        return None
    generator = np.random.default_rng(request.seed)
    return axes_map(
        posed.model, request.task, request.objective, request.drive, request.gammas.angles, generator=generator
    )
