"""Offences: what is wrong with a program, at which move and source line, and in which pose it first shows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum

from robots.arrays import Array


class Kind(StrEnum):
    """What is wrong; of one move the worse kinds come first."""

    COLLISION = "collision"
    RAPID_CONTACT = "cutter touches the part in rapid"
    LIMIT = "axis limit"
    BRANCH_JUMP = "branch jump"
    UNFOLLOWED = "straight line cannot be followed"
    SINGULARITY = "singularity"
    CLEARANCE = "clearance below the safety distance"
    UNPROVEN = "not proven free of collision"
    SPEED = "axis speed"
    ACCELERATION = "axis acceleration"
    DEVIATION = "deviation from the path"


KIND_WORDS = {
    Kind.COLLISION: "bodies overlap; cutter and part may touch while cutting",
    Kind.RAPID_CONTACT: "the cutter overlaps the part in a rapid move; material removal is not simulated",
    Kind.UNPROVEN: "between two free poses a touch could not be excluded at the stated resolution",
    Kind.CLEARANCE: "bodies come nearer than the safety distance",
    Kind.LIMIT: "a joint, a coupling of joints or an external axis beyond its range",
    Kind.SPEED: "the feed asks for more than an axis' greatest speed; the controller would slow down",
    Kind.ACCELERATION: "corners smoothed over the stated time ask for more than an axis' greatest acceleration",
    Kind.SINGULARITY: "nearer to a singularity than allowed: small tool motion needs large joint motion",
    Kind.BRANCH_JUMP: "shoulder, elbow or wrist change sides, or a joint steps far while the tool hardly moves",
    Kind.UNFOLLOWED: "inverse kinematics lost the straight line between two points",
    Kind.DEVIATION: "the tool leaves the programmed point or line",
}
RANK = {kind: place for place, kind in enumerate(Kind)}


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

    @property
    def moves(self) -> int:
        """How many moves it lasts."""
        return self.last - self.move + 1

    @property
    def what(self) -> str:
        """Bodies, axis or words that it is about."""
        return " and ".join(self.bodies) if self.bodies else self.axis or self.text

    @property
    def same(self) -> tuple[object, ...]:
        """What neighbouring moves must share to be one offence."""
        return self.kind, self.severity, frozenset(self.bodies or ()), self.axis, self.text


def merged(offences: Iterable[Offence]) -> tuple[Offence, ...]:
    """Offences in the order of the program; equal ones of neighbouring moves become one that lasts.

    Of equal offences the first's pose is kept, and the value farthest beyond the limit.
    """
    ordered = sorted(offences, key=lambda o: (o.move, o.severity, RANK[o.kind], o.at))
    out: list[Offence] = []
    running: dict[tuple[object, ...], int] = {}
    for offence in ordered:
        place = running.get(offence.same)
        if place is not None and offence.move - out[place].last <= 1:
            before = out[place]
            worse = abs(offence.value - before.limit) > abs(before.value - before.limit)
            out[place] = replace(before, last=offence.last, value=offence.value if worse else before.value)
        else:
            running[offence.same] = len(out)
            out.append(offence)
    return tuple(out)
