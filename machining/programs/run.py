"""From a tool path to programs for the robot's controller, written, read back and compared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

import fem
from doe.absolute.readings import Payload
from doe.absolute.real_arm import RealArm
from machining.cutting import Cut, Drawn, StiffnessUncertainty, assumed_uncertainty, drawn_objective
from machining.cutting.each_tool import BendingOfEach, ForceOfEach
from machining.programs.approach import Approach, Approached, approached, with_home, with_leads
from machining.programs.calibrated_arm import CAP as ARM_CAP
from machining.programs.calibrated_arm import Corrected, correct
from machining.programs.compensation import CAP, RAMP, Compensated, compensate
from machining.programs.format import RoundTrip, Written, digest
from machining.programs.formats import FORMATS, round_trip, write_program
from machining.programs.job import Kind
from machining.programs.posting import Posted, PostSettings, post
from machining.programs.program import JointProgram
from machining.programs.write_options import WriteOptions
from machining.setup import Setup
from machining.stiffness.objective import ROOM, Objective
from machining.toolpaths import Motions
from robots import InputError
from robots.progress import Progress
from robots.robot import middle_pose

# A controller cannot hold the path better than this, m and rad: a program that is farther off is refused.
WRITTEN_TO = 1e-6
# Moves, evenly along the program, that the interval of its stiffness is taken from.
JUDGED = 400


@dataclass(frozen=True)
class Target:
    """A format and the coordinates that it is written in."""

    name: str
    kind: Kind

    @property
    def folder(self) -> str:
        """Where its files go."""
        return FORMATS[self.name].folder(self.kind)


@dataclass(frozen=True, eq=False)
class PostRequest:
    """What is asked.

    ``cut``: taken off the path where it is given; ``cap`` m of that, None for the usual one; ``ramp`` m of the moves
    beside a cut over which it comes and goes. ``payload``: what the flange carries, where geometry and weight are taken
    off too, which needs an arm that positions have calibrated; None: neither. ``stiffness``: how uncertain the arm is,
    None for :func:`machining.cutting.stiffness_uncertainty`'s assumption. ``approach``: the side that positioning moves
    come from; None: any.
    """

    motions: Motions
    setup: Setup
    settings: PostSettings
    targets: tuple[Target, ...]
    options: WriteOptions
    templates: Path | None = None
    cut: Cut | None = None
    cap: float | None = None
    ramp: float = RAMP
    stiffness: StiffnessUncertainty | None = None
    payload: Payload | None = None
    approach: Approach | None = None


@dataclass(frozen=True, eq=False)
class PostRun:
    """What came of it; ``written`` and ``trips`` by target.

    ``corrected``: where geometry and weight are taken off too. ``stiffness``: how uncertain the arm is; ``drawn``: what
    the course was judged by at some of its moves, for arms drawn from that; both None where nothing deflects.
    ``approached``: with points put in to come from one side, where that was asked for. ``digests``: SHA-256 of each
    file.
    """

    request: PostRequest
    model: fem.ArmModel
    posted: Posted
    compensated: Compensated | None
    written: dict[Target, Written] = field(default_factory=dict)
    trips: dict[Target, RoundTrip] = field(default_factory=dict)
    stiffness: StiffnessUncertainty | None = None
    drawn: Drawn | None = None
    corrected: Corrected | None = None
    approached: Approached | None = None
    digests: dict[Target, dict[str, str]] = field(default_factory=dict)

    @cached_property
    def program(self) -> JointProgram:
        """The program as it is written."""
        if self.approached is not None:
            return with_home(self.approached.program)
        made = next((one.posted for one in (self.corrected, self.compensated) if one is not None), self.posted)
        return with_home(made.program)

    def save(self, place_of: Callable[[str], Path]) -> None:
        """Write all files; ``place_of``: where one goes, by its name with the target's folder in front."""
        for target, written in self.written.items():
            written.save(lambda name, folder=target.folder: place_of(f"{folder}/{name}"))  # type: ignore[misc]


def run_post(model: fem.ArmModel, request: PostRequest, progress: Progress | None = None) -> PostRun:
    """Make the programs, read their texts back and compare; :meth:`PostRun.save` writes them.

    Raises
    ------
    InputError
        As :func:`machining.programs.posting.post`; a written program that is off the path by more than 1 um or 1 urad.
    """
    cell = request.setup.cell
    externals = len(cell.linear_axes) + (cell.turntable is not None)
    for target in request.targets:
        # Before the work, not after it: whether the controller counts this arm's joints in a known way.
        FORMATS[target.name].check(model.robot, externals, request.options)
        FORMATS[target.name].check_commands(cell.commands)
    compensated = request.cut is not None or request.payload is not None
    words = {word for target in request.targets for word in FORMATS[target.name].words}
    options = request.options.named(request.motions.source, "_c" if compensated else "", words)
    request = replace(request, options=options)
    # Controllers compute with the arm as designed.
    real, model = model, model.as_designed
    flexible = deflects(model)
    if not flexible:
        # Nothing is known in N/mm: no branch and no gamma is stiffer than another.
        request = replace(request, settings=replace(request.settings, objective=Objective(ROOM)))
    motions, row, led = with_leads(request.motions, cell.moves)
    posted = post(model, cell, motions, request.settings.at(row), progress, led=led)
    found, corrected = None, None
    cut = None if request.cut is None else _with_each_tool(request.cut, posted)
    if request.payload is not None:
        cap = ARM_CAP if request.cap is None else request.cap
        arm = RealArm(real, request.payload)
        corrected = correct(model, arm, posted, cut=cut, stiffness=request.stiffness, cap=cap, ramp=request.ramp)
    elif cut is not None:
        cap = CAP if request.cap is None else request.cap
        found = compensate(
            model, posted, cut.force, tool=cut.tool, stiffness=request.stiffness, cap=cap, ramp=request.ramp
        )
    stiffness = (request.stiffness or assumed_uncertainty(model)) if flexible else None
    drawn = None if stiffness is None else _drawn(model, posted, stiffness)
    run = PostRun(request, model, posted, found, stiffness=stiffness, drawn=drawn, corrected=corrected)
    if request.approach is not None:
        straight = request.settings.rapid == "linear" and any(target.kind == "cartesian" for target in request.targets)
        last = next((one.posted for one in (corrected, found) if one is not None), posted).program
        run = replace(run, approached=approached(last, request.approach, straight=straight))
    program = run.program
    for target in request.targets:
        written = write_program(program, target.name, target.kind, request.options, request.templates)
        texts = written.texts()
        trip = round_trip(program, texts, target.name, target.kind, request.options)
        wrong = trip.difference(WRITTEN_TO)
        if wrong is not None:
            raise InputError(
                f"{target.name} program, {target.kind} coordinates, read back: {wrong.what}",
                code="Q001",
                value=wrong.value,
                allowed=wrong.allowed,
                remedy=wrong.remedy,
            )
        run.written[target], run.trips[target] = written, trip
        run.digests[target] = {name: digest(text) for name, text in texts.items()}
    return run


def deflects(model: fem.ArmModel) -> bool:
    """Whether anything in the model gives way."""
    return bool(fem.compliance(model, middle_pose(model.robot)[None]).any())


def _with_each_tool(cut: Cut, posted: Posted) -> Cut:
    """The cut at the points of a program; forces of each tool go by the tool that is there."""
    tool = posted.program.motions.tool[posted.state.places[0]]
    return replace(
        cut,
        force=cut.force.at(tool) if isinstance(cut.force, ForceOfEach) else cut.force,
        tool=cut.tool.at(tool) if isinstance(cut.tool, BendingOfEach) else cut.tool,
    )


def _drawn(model: fem.ArmModel, posted: Posted, stiffness: StiffnessUncertainty) -> Drawn:
    """The objective at moves that mill, spread evenly along the program, its worst one among them."""
    task, (kept, _) = posted.state.task, posted.state.places
    objective, value = posted.settings.objective, posted.course.value[kept]
    judged = np.flatnonzero(posted.judged[kept])
    worst = judged[int(np.argmin((objective.sign * value)[judged]))]
    rows = np.union1d(judged[np.linspace(0, len(judged) - 1, min(JUDGED, len(judged))).astype(np.int64)], [worst])
    force = objective.forces(len(kept))
    there = replace(objective, force=None if force is None else force[rows])
    return drawn_objective(model, task.at(rows), {"": posted.program.q[kept][rows]}, there, stiffness)[""]
