"""Everything that is looked at before a cell moves, put together."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from machining.cell import ArmBodies, Scene, scene_of
from machining.cell.scene import CUTTER, PART
from machining.programs.actions import run_up
from machining.programs.program import REPLAYED, JointProgram
from machining.tooling import tools_of
from machining.verification.commands import command_offences, has_commands
from machining.verification.courses import Courses, MovingAxes, courses_of
from machining.verification.demands import Demands
from machining.verification.offences import (
    Kind,
    Offence,
    Reported,
    Severity,
    axis_offences,
    body_offences,
    low_rapid_offences,
    merged,
    path_offences,
    worst_first,
)
from machining.verification.path_checks import PathChecks, path_checks
from machining.verification.sweep import Swept, sweep, together
from machining.verification.timing import Timing, timing_of
from robots import InputError
from robots.arrays import Bools, Integers
from robots.progress import Progress, report_progress


@dataclass(frozen=True, eq=False)
class Verification:
    """Result of :func:`verify`; arrays are over the program's n moves.

    ``scenes``: of each of the path's tools. ``offences`` in the order of the program, equal ones of neighbouring moves
    merged. ``swept``: distances of all
    checked pairs; ``rapid``: of cutter and part in rapid moves, None where there is neither. ``not_looked_at``: what
    could not be checked, and why. ``notes``: what was assumed about bodies.
    """

    program: JointProgram
    demands: Demands
    scenes: tuple[Scene, ...]
    courses: Courses
    offences: tuple[Offence, ...]
    swept: Swept
    rapid: Swept | None
    timing: Timing
    path: PathChecks
    not_looked_at: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def axes(self) -> MovingAxes:
        """All axes."""
        return self.courses.axes

    def scene_at(self, move: int) -> Scene:
        """The bodies that are there in a move."""
        return self.scenes[int(self.program.motions.tool[move])]

    def by_scene(self, move: Integers) -> list[tuple[Integers, Scene]]:
        """Places in ``move`` (m,) with the bodies that are there in these moves."""
        return _by_scene(self.scenes, self.program.motions.tool[move])

    @property
    def errors(self) -> tuple[Offence, ...]:
        """Offences that forbid running the program."""
        return tuple(o for o in self.offences if o.severity is Severity.ERROR)

    @cached_property
    def ranked(self) -> tuple[Offence, ...]:
        """All offences, the worst first (:func:`machining.verification.offences.worst_first`)."""
        return worst_first(self.offences)

    @property
    def clean(self) -> bool:
        """Whether there is no error; warnings may be left."""
        return not self.errors

    @property
    def counts(self) -> dict[tuple[Kind, Severity], int]:
        """How many offences there are of each kind and severity, in the order of their first ones."""
        return dict(Counter((o.kind, o.severity) for o in self.offences))

    @property
    def safety(self) -> float:
        """Distance (m) that bodies were to keep."""
        return self.program.cell.safety if self.demands.safety is None else self.demands.safety


def verify(
    program: JointProgram,
    arm: ArmBodies,
    demands: Demands | None = None,
    *,
    progress: Progress | None = None,
) -> Verification:
    """Replay a program in its cell and find everything that is wrong with it.

    Bodies are checked on whole moves (:mod:`machining.verification.sweep`), rapid moves without a part and a cutter by
    the height of the last retract (:mod:`machining.verification.rapids`), axes and path at the points and at eight
    pieces a move. Cutter and part may touch in cutting moves; in rapid moves an overlap of them is an offence, the
    safety distance is not asked of them. The part does not change: what the cutter removes stays.

    Parameters
    ----------
    arm : bodies of the program's robot
    progress : called with (moves done, moves)

    Raises
    ------
    InputError
        An empty program, or another robot than the arm's.
    """
    demands = demands or Demands()
    if program.n == 0:
        raise InputError(f"program {program.motions.source} has no motion", code="Q011")
    if arm.robot.coordinates != program.robot.coordinates:
        raise InputError(
            "program of another robot",
            code="A010",
            value=", ".join(program.robot.coordinates),
            allowed=", ".join(arm.robot.coordinates),
            remedy="give the model that the program was made for",
        )
    scenes = _scenes(program, arm)
    courses = courses_of(program, demands.interpolation)
    safety = program.cell.safety if demands.safety is None else demands.safety
    swept = together(
        [
            sweep(
                courses,
                scene,
                moves=moves,
                safety=safety,
                resolution=demands.resolution,
                horizon=demands.horizon,
                progress=_from(progress, done, program.n),
            )
            for moves, done, scene in _in_turn(program, scenes)
        ]
    )
    rapid = _rapid_contacts(courses, scenes, demands)
    timing = timing_of(courses, demands.smoothing)
    path = path_checks(courses, demands)
    reported = Reported(courses)
    found = [
        *body_offences(reported, swept, rapid, safety),
        # Without the part's surface, or a cutter's, this is all that can be said of rapid moves.
        *(low_rapid_offences(reported, path, demands.tolerance) if rapid is None else ()),
        *axis_offences(reported, timing),
        *path_offences(reported, path, demands),
        *command_offences(reported),
    ]
    notes = tuple(
        dict.fromkeys([*(note for scene in scenes for note in scene.notes), *map(str, program.motions.notes)])
    )
    unknown = _not_looked_at(courses, scenes, timing)
    return Verification(program, demands, scenes, courses, merged(found), swept, rapid, timing, path, unknown, notes)


def _scenes(program: JointProgram, arm: ArmBodies) -> tuple[Scene, ...]:
    """The bodies that are there with each of the path's tools; those without a move share the first's."""
    tools = tools_of(program.cell, program.motions)
    made: dict[int, Scene] = {}
    for i in np.unique(program.motions.tool).tolist():
        if id(tools[i]) not in made:
            made[id(tools[i])] = scene_of(program.cell.with_tool(tools[i]), arm)
    first = next(iter(made.values()))
    return tuple(made.get(id(tool), first) for tool in tools)


def _by_scene(scenes: tuple[Scene, ...], tool: Integers) -> list[tuple[Integers, Scene]]:
    which = np.array([scenes.index(scene) for scene in scenes], dtype=np.int64)[tool]
    return [(np.flatnonzero(which == i), scenes[i]) for i in np.unique(which).tolist()]


def _in_turn(program: JointProgram, scenes: tuple[Scene, ...]) -> list[tuple[Bools, int, Scene]]:
    """Moves (n,) with each set of bodies, how many come before in the count of progress, and the bodies."""
    out, done = [], 0
    for rows, scene in _by_scene(scenes, program.motions.tool):
        moves = np.zeros(program.n, dtype=np.bool_)
        moves[rows] = True
        out.append((moves, done, scene))
        done += len(rows)
    return out


def _from(progress: Progress | None, before: int, total: int) -> Progress | None:
    """Progress of a part of the moves, with so many done before."""
    return None if progress is None else lambda done, _: report_progress(progress, before + done, total)


def _rapid_contacts(courses: Courses, scenes: tuple[Scene, ...], demands: Demands) -> Swept | None:
    """Sweeps of cutter and part alone, in rapid moves."""
    rapid = courses.program.motions.rapid
    parts = [
        _rapid_contacts_with(courses, scene, rapid & moves, demands)
        for moves, _, scene in _in_turn(courses.program, scenes)
    ]
    found = [part for part in parts if part is not None]
    return together(found) if found else None


def _rapid_contacts_with(courses: Courses, scene: Scene, moves: Bools, demands: Demands) -> Swept | None:
    cutters = [i for i, m in enumerate(scene.members) if m.kind == CUTTER]
    parts = [i for i, m in enumerate(scene.members) if m.kind == PART]
    if not (moves.any() and cutters and parts):
        return None
    pairs = tuple((i, j) for i in cutters for j in parts)
    rows = [
        (k, a, b)
        for k, (i, j) in enumerate(pairs)
        for a in np.flatnonzero(scene.owner == i)
        for b in np.flatnonzero(scene.owner == j)
    ]
    alone = replace(scene, pairs=pairs, floor_members=(), solid_pairs=np.array(rows, dtype=np.int64).reshape(-1, 3))
    return sweep(courses, alone, moves=moves, resolution=demands.resolution, horizon=demands.horizon)


def _not_looked_at(courses: Courses, scenes: tuple[Scene, ...], timing: Timing) -> tuple[str, ...]:
    """What could not be checked, in words."""
    axes, cell, motions = courses.axes, courses.program.cell, courses.program.motions
    slow, weak = ([axes.names[i] for i in np.flatnonzero(np.isinf(rate))] for rate in (axes.speed, axes.acceleration))
    no_feed, no_time = int((motions.cutting & np.isnan(motions.feed)).sum()), int(np.isnan(timing.time).sum())
    no_shapes = not axes.dof or not any(m.frame for m in scenes[0].members)
    bare = not any(tool.holder or tool.cutter for tool in (scene.cell.tool for scene in scenes))
    said = (
        (slow, f"Speeds of {', '.join(slow)}: the cell gives no limits."),
        (weak, f"Accelerations of {', '.join(weak)}: the cell gives no limits."),
        (no_feed, f"Speeds and accelerations at {no_feed} cutting moves: they have no feed."),
        (no_time, f"Time of {no_time} moves, so that of the program."),
        (not has_commands(motions), "Commands to spindle, coolant and tool changer: the program has none."),
        (cell.part is None, "Collisions with the part: the cell gives no surface of it."),
        (bare, "Collisions of the tool: the cell gives no bodies of it."),
        (cell.floor is None and not scenes[0].on_base, "Collisions with the floor: there is none."),
        (no_shapes, "Collisions of the arm: the model gives no shapes."),
        (
            not courses.program.at_home[:1].all(),
            "The way to the first point and from the last: the cell file has no home in [moves].",
        ),
        (
            any(event.kind == "spindle" for event in motions.events) and not run_up(cell.commands),
            "Whether the spindle is up to speed as a cut begins: the cell file has no spindle_ready and no "
            "spindle_dwell_s.",
        ),
        (
            courses.program.names == (REPLAYED,),
            "Whether the program is that of its tool path: no neutral program was there to hold it against.",
        ),
    )
    return (
        *(text for unknown, text in said if unknown),
        *dict.fromkeys(
            f"Collisions of {a} with {b}: they overlap at home." for scene in scenes for a, b in scene.switched_off
        ),
        *(f"Collisions of {a} with {b}: the cell allows them." for a, b in cell.allowed_contacts),
    )
