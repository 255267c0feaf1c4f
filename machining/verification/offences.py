"""Offences: what is wrong with a program, at which move, line and pose it first shows; and how they are found."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from machining.cell.cell import LIMIT_TOLERANCE
from machining.verification.courses import BLOCK, PIECES, Courses
from machining.verification.demands import Demands
from machining.verification.path_checks import SIGNS, PathChecks, counts
from machining.verification.rapids import low_rapids
from machining.verification.sweep import Swept
from machining.verification.timing import Timing
from robots.arrays import Array, Bools, Integers, in_blocks

# Values that exceed their limits by a smaller share are equal to them: rounding.
RATE_TOLERANCE = 1e-6
# A move nearer to the tool axis than this cosine (18 deg) draws the tool out.
RETRACT = 0.95


class Kind(StrEnum):
    """What is wrong; of one move the worse kinds come first."""

    COLLISION = "collision"
    RAPID_CONTACT = "cutter touches the part in rapid"
    LOW_RAPID = "rapid across below the retract"
    COMMAND = "spindle, coolant or tool command"
    LIMIT = "axis limit"
    BRANCH_JUMP = "branch jump"
    UNFOLLOWED = "straight line cannot be followed"
    SINGULARITY = "singularity"
    CLEARANCE = "clearance below the safety distance"
    UNPROVEN = "not proven free of collision"
    SPEED = "axis speed"
    ACCELERATION = "axis acceleration"
    OTHER_POINT = "another point than the path's"
    DEVIATION = "deviation from the path"


KIND_WORDS = {
    Kind.COLLISION: "bodies overlap; cutter and part may touch while cutting",
    Kind.RAPID_CONTACT: "the cutter overlaps the part in a rapid move; material removal is not simulated",
    Kind.LOW_RAPID: "a rapid move across, below the height of the last retract; looked for where the part is not",
    Kind.COMMAND: "spindle, coolant, rest or tool change are commanded otherwise than the moves need it",
    Kind.UNPROVEN: "between two free poses a touch could not be excluded at the stated resolution",
    Kind.CLEARANCE: "bodies come nearer than the safety distance",
    Kind.LIMIT: "a joint, a coupling of joints or an external axis beyond its range",
    Kind.SPEED: "the feed asks for more than an axis' greatest speed; the controller would slow down",
    Kind.ACCELERATION: "corners smoothed over the stated time ask for more than an axis' greatest acceleration",
    Kind.SINGULARITY: "nearer to a singularity than allowed: small tool motion needs large joint motion",
    Kind.BRANCH_JUMP: "shoulder, elbow or wrist change sides, or a joint steps far while the tool hardly moves",
    Kind.UNFOLLOWED: "inverse kinematics lost the straight line between two points",
    Kind.OTHER_POINT: "with this tool and this part frame the joints lead elsewhere than the program says",
    Kind.DEVIATION: "between its points the tool leaves the programmed line",
}
# Codes in the catalogue of failures.
KIND_CODES = {
    Kind.COLLISION: "Z001",
    Kind.RAPID_CONTACT: "Z002",
    Kind.LOW_RAPID: "Z014",
    Kind.COMMAND: "Z003",
    Kind.LIMIT: "Z004",
    Kind.BRANCH_JUMP: "Z005",
    Kind.UNFOLLOWED: "Z006",
    Kind.SINGULARITY: "Z007",
    Kind.CLEARANCE: "Z008",
    Kind.UNPROVEN: "Z009",
    Kind.SPEED: "Z010",
    Kind.ACCELERATION: "Z011",
    Kind.OTHER_POINT: "Z013",
    Kind.DEVIATION: "Z012",
}
RANK = {kind: place for place, kind in enumerate(Kind)}
# Kinds whose values are compared as shares of their limits: they may be in different units.
RELATIVE = (Kind.SPEED, Kind.ACCELERATION, Kind.OTHER_POINT, Kind.DEVIATION)


class Severity(StrEnum):
    """``ERROR``: the program must not run like this. ``WARNING``: to be looked at; it does not fail the program."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, eq=False)
class Offence:
    """Something wrong from move ``move`` on to move ``last``, all moves between them included.

    Attributes
    ----------
    kind, severity : what it is
    move, last : numbers of moves; move i leads from point i - 1 to point i
    line, nc_line : line in the source, and in the program written if known, of ``move``
    at : share of the move after which it first shows, 0 to 1
    value, limit : worst value over the moves and what is allowed, SI; NaN where nothing is measured. Bodies that
        overlap have the value 0
    unit : "rad", "m", "rad/s", ... of both
    bodies : the two bodies, for collisions and clearances
    axis : name of the axis, for limits and rates
    text : more in words
    values : (a,) coordinates of all axes in the pose in which it first shows
    worst, worst_values : the move with the worst value, and the coordinates (a,) there
    """

    kind: Kind
    severity: Severity
    move: int
    last: int
    line: int
    nc_line: int | None
    at: float
    value: float
    limit: float
    unit: str
    bodies: tuple[str, str] | None
    axis: str
    text: str
    values: Array
    worst: int
    worst_values: Array

    @property
    def moves(self) -> int:
        """How many moves it lasts."""
        return self.last - self.move + 1

    @property
    def same(self) -> tuple[object, ...]:
        """What neighbouring moves must share to be one offence."""
        return self.kind, self.severity, frozenset(self.bodies or ()), self.axis, self.text


def merged(offences: Iterable[Offence]) -> tuple[Offence, ...]:
    """Offences in the order of the program; equal ones of neighbouring moves become one that lasts.

    Of equal offences the first's pose is kept, and the value farthest beyond the limit with its pose.
    """
    ordered = sorted(offences, key=lambda o: (o.move, o.severity, RANK[o.kind], o.at))
    out: list[Offence] = []
    running: dict[tuple[object, ...], int] = {}
    for offence in ordered:
        place = running.get(offence.same)
        if place is not None and offence.move - out[place].last <= 1:
            before = out[place]
            worse = abs(offence.value - before.limit) > abs(before.value - before.limit)
            out[place] = replace(before, last=offence.last)
            if worse:
                values = offence.worst_values
                out[place] = replace(out[place], value=offence.value, worst=offence.worst, worst_values=values)
        else:
            running[offence.same] = len(out)
            out.append(offence)
    return tuple(out)


# What the order is, for people.
ORDER = "errors first, then by kind and how far beyond the limit, collisions by how long they last"


def worst_first(offences: Iterable[Offence]) -> tuple[Offence, ...]:
    """Offences by what they would do: errors before warnings, then by kind, then how far beyond the limit.

    Of collisions those that last longer come first; what is left equal stays in the order of the program.
    """
    return tuple(sorted(offences, key=lambda o: (o.severity is not Severity.ERROR, RANK[o.kind], *_badness(o))))


def _badness(offence: Offence) -> tuple[float, int]:
    """How bad an offence is among those of its kind: less is worse."""
    beyond = abs(offence.value - offence.limit)
    if offence.kind in RELATIVE and offence.limit > 0.0:
        beyond /= offence.limit
    # What differs by rounding only is as bad.
    return -round(beyond, 9) if np.isfinite(beyond) else 0.0, -offence.moves


@dataclass(frozen=True, eq=False)
class Reported:
    """Makes offences of moves: looks up lines and poses."""

    courses: Courses

    def offence(
        self,
        kind: Kind,
        move: int,
        at: float,
        value: float,
        limit: float,
        unit: str,
        *,
        bodies: tuple[str, str] | None = None,
        axis: str = "",
        text: str = "",
        severity: Severity = Severity.ERROR,
    ) -> Offence:
        """An offence of one move."""
        values, _ = self.courses.at(np.array([move]), np.array([float(at)]))
        program = self.courses.program
        line, nc_line = int(program.motions.line[move]), None
        if program.file_lines is not None:
            nc_line = int(program.file_lines[move])
        return Offence(
            kind,
            severity,
            int(move),
            int(move),
            line,
            nc_line,
            float(at),
            float(value),
            float(limit),
            unit,
            bodies,
            axis,
            text,
            values[0],
            int(move),
            values[0],
        )

    def each(
        self, kind: Kind, moves: Bools, at: Array | float, value: Array, limit: float, unit: str, *, text: str = ""
    ) -> Iterator[Offence]:
        """An offence of each of ``moves`` (n,), ``at`` and ``value`` (n,)."""
        shares = np.broadcast_to(at, moves.shape)
        for move in _where(moves):
            yield self.offence(kind, move, shares[move], value[move], limit, unit, text=text)

    def touching(
        self, kind: Kind, swept: Swept, at: Array, pair: Integers, value: Array, limit: float = 0.0
    ) -> Iterator[Offence]:
        """An offence of two bodies, by ``pair`` (n,), at each of the shares ``at`` (n,) that are not NaN."""
        for move in _where(np.isfinite(at)):
            yield self.offence(kind, move, at[move], value[move], limit, "m", bodies=swept.names[pair[move]])


def body_offences(reported: Reported, swept: Swept, rapid: Swept | None, safety: float) -> Iterator[Offence]:
    """Collisions, small clearances, and what could not be proven."""
    nothing, free = np.zeros(len(swept.hit)), np.isnan(swept.hit)
    yield from reported.touching(Kind.COLLISION, swept, swept.hit, swept.hit_pair, nothing)
    low = np.where(free, swept.low, np.nan)
    yield from reported.touching(Kind.CLEARANCE, swept, low, swept.low_pair, swept.distance, safety)
    for move in _where(np.isfinite(swept.unproven) & free):
        yield _unproven(reported, move, swept)
    text = "joints jump, or the line leaves the reach"
    lost = np.isfinite(swept.lost)
    yield from reported.each(Kind.UNFOLLOWED, lost, swept.lost, nothing + np.nan, np.nan, "", text=text)
    if rapid is not None:
        yield from _rapid_contacts(reported, rapid)


def low_rapid_offences(reported: Reported, path: PathChecks, tolerance: float) -> Iterator[Offence]:
    """Rapid moves across below the last retract."""
    for low in low_rapids(reported.courses, path.point <= tolerance, tolerance):
        yield reported.offence(
            Kind.LOW_RAPID,
            low.move,
            low.share,
            low.height,
            low.retract,
            "m",
            text="not straight on its way" if low.beside else "height along the tool axis",
            severity=Severity.WARNING if low.beside else Severity.ERROR,
        )


def _unproven(reported: Reported, move: int, swept: Swept, severity: Severity = Severity.ERROR) -> Offence:
    bodies = swept.names[swept.pair[move]] if swept.pair[move] >= 0 else None
    value, at = max(float(swept.distance[move]), 0.0), float(swept.unproven[move])
    return reported.offence(Kind.UNPROVEN, move, at, value, 0.0, "m", bodies=bodies, severity=severity)


def _rapid_contacts(reported: Reported, rapid: Swept) -> Iterator[Offence]:
    """Touches of cutter and part in rapid moves; a retract along the tool from where the cut ended is a warning."""
    retracts: set[int] = set()
    for move in _where(np.isfinite(rapid.hit)):
        if rapid.hit[move] == 0.0 and _retracts(reported, move, retracts):
            retracts.add(move)
        yield reported.offence(
            Kind.RAPID_CONTACT,
            move,
            rapid.hit[move],
            0.0,
            0.0,
            "m",
            bodies=rapid.names[rapid.hit_pair[move]],
            text="retract from where the cut ended" if move in retracts else "",
            severity=Severity.WARNING if move in retracts else Severity.ERROR,
        )
    for move in _where(np.isfinite(rapid.unproven) & np.isnan(rapid.hit)):
        # A retract begins where the cut touched the part.
        if not _retracts(reported, move, retracts):
            yield _unproven(reported, move, rapid, Severity.WARNING)


def _retracts(reported: Reported, move: int, retracts: set[int]) -> bool:
    """Whether a move draws the tool out along itself, after a cut or more of the same."""
    motions = reported.courses.program.motions
    if move == 0 or not (motions.cutting[move - 1] or move - 1 in retracts):
        return False
    way = motions.points[move] - motions.points[move - 1]
    return bool(way @ motions.axes[move - 1] > RETRACT * np.linalg.norm(way))


def axis_offences(reported: Reported, timing: Timing) -> Iterator[Offence]:
    """Limits, speeds and accelerations."""
    courses, axes = reported.courses, reported.courses.axes
    for move, at, values in _looked_at(courses):
        yield from _limits(reported, move, at, values)
    with np.errstate(invalid="ignore"):
        fast = np.argwhere(timing.speed > axes.speed * (1.0 + RATE_TOLERANCE))
    for move, axis in fast.tolist():
        yield reported.offence(
            Kind.SPEED,
            move,
            0.5,
            timing.speed[move, axis],
            axes.speed[axis],
            axes.unit(axis, "/s"),
            axis=axes.names[axis],
        )
    for move, axis, rate in zip(timing.corners, timing.corner_axis, timing.corner_rate, strict=True):
        yield reported.offence(
            Kind.ACCELERATION,
            int(move),
            0.0,
            rate,
            axes.acceleration[axis],
            axes.unit(int(axis), "/s^2"),
            axis=axes.names[axis],
        )


def _looked_at(courses: Courses) -> Iterator[tuple[int, float, Array]]:
    """Move, share and coordinates (a,) of points beyond limits, the farthest beyond of each move.

    Between two points inside, axes that move evenly stay inside: the limits bound a convex set.
    """
    for move in _where(_beyond(courses, courses.points) > 0.0):
        if not courses.straight[move]:
            yield move, 1.0, courses.points[move]
    straight = np.flatnonzero(courses.straight)
    for some in in_blocks(len(straight), BLOCK):
        values, _ = courses.sampled(straight[some])
        beyond = _beyond(courses, values.reshape(-1, values.shape[2])).reshape(values.shape[:2])
        for row in _where(beyond.max(axis=1) > 0.0):
            piece = int(beyond[row].argmax())
            yield int(straight[some][row]), piece / PIECES, values[row, piece]


def _bounded(courses: Courses, values: Array) -> list[tuple[str, Array, float, float, str]]:
    """What has limits at coordinates (m, a): name, values (m,), least, most, unit; axes first, then couplings."""
    axes = courses.axes
    out = [(axes.names[i], values[:, i], axes.lower[i], axes.upper[i], axes.unit(i)) for i in range(axes.count)]
    for c in courses.program.robot.couplings:
        out.append((c.name, c.offset + values[:, : axes.dof] @ c.factors, c.lower, c.upper, "rad"))
    return out


def _beyond(courses: Courses, values: Array) -> Array:
    """How far (m,) coordinates (m, a) are beyond the worst limit, less the tolerance; rad or m."""
    beyond = [np.maximum(lower - v, v - upper) for _, v, lower, upper, _ in _bounded(courses, values)]
    return np.asarray(np.max(beyond, axis=0) - LIMIT_TOLERANCE)


def _limits(reported: Reported, move: int, at: float, values: Array) -> Iterator[Offence]:
    for name, (value,), lower, upper, unit in _bounded(reported.courses, values[None]):
        if value < lower - LIMIT_TOLERANCE or value > upper + LIMIT_TOLERANCE:
            limit = lower if value < lower else upper
            yield reported.offence(Kind.LIMIT, move, at, value, limit, unit, axis=name)


def path_offences(reported: Reported, path: PathChecks, demands: Demands) -> Iterator[Offence]:
    """Singularities, branch jumps and deviations."""
    courses, each = reported.courses, reported.each
    counted = counts(courses)
    # A value equal to its limit is no offence, whichever way the last digit falls.
    tolerance, turn = demands.tolerance, demands.axis_tolerance
    most, most_turn = tolerance * (1.0 + RATE_TOLERANCE), turn * (1.0 + RATE_TOLERANCE)
    near = counted & (path.singular < demands.singular_least * (1.0 - RATE_TOLERANCE))
    yield from each(Kind.SINGULARITY, near, path.singular_at, path.singular, demands.singular_least, "")
    for move in _where(path.changed.any(axis=1) | path.jumped):
        yield _branch_jump(reported, move, path, demands, bool(counted[move]))
    off = path.point > most
    text = "the tip is elsewhere"
    yield from each(Kind.OTHER_POINT, off, 1.0, path.point, tolerance, "m", text=text)
    text = "the tool is turned otherwise"
    turned_there = ~off & (path.point_turn > most_turn)
    yield from each(Kind.OTHER_POINT, turned_there, 1.0, path.point_turn, turn, "rad", text=text)
    # Where points are off, so is the line between them; that is said once.
    known = np.maximum(path.point, np.append(0.0, path.point[:-1]))
    known[:1] = 0.0
    left = path.run_line > most + np.where(known > most, known, 0.0)
    text = "between points the tip leaves the straight line"
    yield from each(Kind.DEVIATION, left, 0.5, path.run_line, tolerance, "m", text=text)
    turned = ~left & ~courses.straight & (path.line_turn > most_turn)
    text = "between points the tool turns otherwise"
    yield from each(Kind.DEVIATION, turned, 0.5, path.line_turn, turn, "rad", text=text)


def _branch_jump(reported: Reported, move: int, path: PathChecks, demands: Demands, counted: bool) -> Offence:
    """Sides that change, or the joint that steps; where joints may move as they like it is no more than a remark."""
    sides = [name for name, yes in zip(SIGNS, path.changed[move], strict=True) if yes]
    axis = reported.courses.axes.names[path.step_axis[move]]
    words = [f"{', '.join(sides)} changes sides"] if sides else []
    words += [f"{axis} steps while the tool hardly moves"] if path.jumped[move] else []
    return reported.offence(
        Kind.BRANCH_JUMP,
        move,
        0.5,
        path.step[move],
        demands.jump,
        "rad",
        text="; ".join(words),
        severity=Severity.ERROR if counted else Severity.WARNING,
    )


def _where(flags: Bools) -> list[int]:
    return [int(i) for i in np.flatnonzero(flags)]
