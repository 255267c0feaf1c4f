"""Offences made from what the checks measured."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from machining.cell.cell import LIMIT_TOLERANCE
from machining.verification.courses import PIECES, Courses
from machining.verification.demands import Demands
from machining.verification.offences import Kind, Offence, Severity
from machining.verification.path_checks import SIGNS, PathChecks, counts
from machining.verification.sweep import Swept
from machining.verification.timing import Timing
from robots.arrays import Array, Bools

# Rates that exceed their limits by less are rounding.
RATE_TOLERANCE = 1e-6
# A move nearer to the tool axis than this cosine (18 deg) draws the tool out.
RETRACT = 0.95


@dataclass(frozen=True, eq=False)
class Reported:
    """Makes offences of moves: looks up lines and poses."""

    courses: Courses
    nc_lines: Sequence[int] | None

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
        q, travel, table = self.courses.axes.parts(values)
        line = int(self.courses.program.motions.line[move])
        nc_line = None if self.nc_lines is None else int(self.nc_lines[move])
        return Offence(
            kind, severity, int(move), int(move), line, nc_line, float(at), float(value), float(limit), unit, bodies,
            axis, text, q[0], travel[0], float(table[0]),
        )  # fmt: skip


def body_offences(reported: Reported, swept: Swept, rapid: Swept | None, safety: float) -> Iterator[Offence]:
    """Collisions, small clearances, and what could not be proven."""
    names = swept.names
    for move in _where(np.isfinite(swept.hit)):
        bodies = names[swept.hit_pair[move]]
        yield reported.offence(Kind.COLLISION, move, swept.hit[move], 0.0, 0.0, "m", bodies=bodies)
    for move in _where(np.isfinite(swept.low) & np.isnan(swept.hit)):
        bodies = names[swept.low_pair[move]]
        value = swept.distance[move]
        yield reported.offence(Kind.CLEARANCE, move, swept.low[move], value, safety, "m", bodies=bodies)
    for move in _where(np.isfinite(swept.unproven) & np.isnan(swept.hit)):
        yield _unproven(reported, move, swept)
    for move in _where(np.isfinite(swept.lost)):
        text = "joints jump, or the line leaves the reach"
        yield reported.offence(Kind.UNFOLLOWED, move, swept.lost[move], np.nan, np.nan, "", text=text)
    if rapid is not None:
        yield from _rapid_contacts(reported, rapid)


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
            Kind.SPEED, move, 0.5, timing.speed[move, axis], axes.speed[axis], axes.unit(axis, "/s"),
            axis=axes.names[axis],
        )  # fmt: skip
    for move, axis, rate in zip(timing.corners, timing.corner_axis, timing.corner_rate, strict=True):
        yield reported.offence(
            Kind.ACCELERATION, int(move), 0.0, rate, axes.acceleration[axis], axes.unit(int(axis), "/s^2"),
            axis=axes.names[axis],
        )  # fmt: skip


def _looked_at(courses: Courses) -> Iterator[tuple[int, float, Array]]:
    """Move, share and coordinates (a,) of points beyond limits, the farthest beyond of each move.

    Between two points inside, axes that move evenly stay inside: the limits bound a convex set.
    """
    for move in _where(_beyond(courses, courses.points) > 0.0):
        if not courses.straight[move]:
            yield move, 1.0, courses.points[move]
    straight = np.flatnonzero(courses.straight)
    if len(straight):
        values, _ = courses.sampled(straight)
        beyond = _beyond(courses, values.reshape(-1, values.shape[2])).reshape(values.shape[:2])
        for row in _where(beyond.max(axis=1) > 0.0):
            piece = int(beyond[row].argmax())
            yield int(straight[row]), piece / PIECES, values[row, piece]


def _beyond(courses: Courses, values: Array) -> Array:
    """How far (m,) coordinates (m, a) are beyond the worst limit, less the tolerance; rad or m."""
    axes = courses.axes
    out = np.maximum(axes.lower - values, values - axes.upper).max(axis=1)
    for c in courses.program.robot.couplings:
        v = c.offset + values[:, : axes.dof] @ c.factors
        out = np.maximum(out, np.maximum(c.lower - v, v - c.upper))
    return np.asarray(out - LIMIT_TOLERANCE)


def _limits(reported: Reported, move: int, at: float, values: Array) -> Iterator[Offence]:
    axes = reported.courses.axes
    checked = [(axes.names[i], values[i], axes.lower[i], axes.upper[i], axes.unit(i)) for i in range(axes.count)]
    for c in reported.courses.program.robot.couplings:
        checked.append((c.name, c.offset + float(c.factors @ values[: axes.dof]), c.lower, c.upper, "rad"))
    for name, value, lower, upper, unit in checked:
        if value < lower - LIMIT_TOLERANCE or value > upper + LIMIT_TOLERANCE:
            limit = lower if value < lower else upper
            yield reported.offence(Kind.LIMIT, move, at, value, limit, unit, axis=name)


def path_offences(reported: Reported, path: PathChecks, demands: Demands) -> Iterator[Offence]:
    """Singularities, branch jumps and deviations."""
    courses = reported.courses
    counted, tolerance = counts(courses), demands.tolerance
    for move in _where(counted & (path.singular < demands.singular_least)):
        at, value = path.singular_at[move], path.singular[move]
        yield reported.offence(Kind.SINGULARITY, move, at, value, demands.singular_least, "")
    for move in _where(path.changed.any(axis=1) | path.jumped):
        yield _branch_jump(reported, move, path, demands, bool(counted[move]))
    for move in range(courses.program.n):
        if path.point[move] > tolerance:
            yield reported.offence(
                Kind.DEVIATION, move, 1.0, path.point[move], tolerance, "m", text="the point reached is another"
            )
        elif path.point_turn[move] > demands.axis_tolerance:
            yield reported.offence(
                Kind.DEVIATION, move, 1.0, path.point_turn[move], demands.axis_tolerance, "rad",
                text="the tool stands otherwise at the point",
            )  # fmt: skip
        # Where points are off, so is the line between them; that is said once.
        known = max(path.point[move], path.point[move - 1]) if move else 0.0
        if path.run_line[move] > tolerance + (known if known > tolerance else 0.0):
            text = "between points the tip leaves the straight line"
            yield reported.offence(Kind.DEVIATION, move, 0.5, path.run_line[move], tolerance, "m", text=text)
        elif not courses.straight[move] and path.line_turn[move] > demands.axis_tolerance:
            text = "between points the tool turns otherwise"
            yield reported.offence(
                Kind.DEVIATION, move, 0.5, path.line_turn[move], demands.axis_tolerance, "rad", text=text
            )


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
