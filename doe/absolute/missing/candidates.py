"""What may act on positions beside geometry, frames and targets: each effect as unknowns of the calibration.

A candidate has one shape or several, each a set of unknowns with their sizes relative to one another; how large all of
them are is left open.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations

from doe.absolute.readings import AbsoluteReadings
from doe.absolute.unknowns import (
    BUMPS,
    SETTLING,
    Unknown,
    coupling_error,
    growth,
    moved,
    payload,
    periodic_error,
    rail,
    ratio_error,
    reversals,
    spring,
)
from doe.absolute.weight import has_weight
from fem import ArmModel

# Highest order of an error curve, and orders beyond which it falls off: a gear that runs out, and its finer errors. The
# first order alone is a wheel off its centre, which over part of a turn looks much like another ratio.
CURVE, FALL_OFF = 16, (1.5, 8.0)
# Orders of a rail's laws: a bow alone, and all.
LENGTHWISE = (3, 6)
# Lengths over which a metre's turn moves a target as far as a metre's shift would.
ARM_LENGTH = 1.0

# Unknowns of a shape with their relative sizes.
Shape = tuple[tuple[Unknown, float], ...]


@dataclass(frozen=True)
class Candidate:
    """An effect: ``code`` (family, colon, place), what it is in ``words``, its shapes.

    ``free``: what ``calibrate --free`` has for it; empty where that is the unknowns of the shape found.
    """

    code: str
    words: str
    shapes: tuple[Shape, ...]
    free: str = ""

    @property
    def family(self) -> str:
        """What it is, wherever."""
        return self.code.partition(":")[0]

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """All that any of its shapes sets free."""
        return tuple(dict.fromkeys(one for shape in self.shapes for one, _ in shape))


def candidates(model: ArmModel, data: AbsoluteReadings) -> tuple[Candidate, ...]:
    """Everything that these readings of this arm may be asked for."""
    return tuple(c for group in (_joints, _gears, _structure, _around) for c in group(model, data) if c.unknowns)


def kinds(some: Sequence[Candidate]) -> Iterator[tuple[str, list[Candidate]]]:
    """Candidates by family."""
    for family in dict.fromkeys(c.family for c in some):
        yield family, [c for c in some if c.family == family]


def _joints(model: ArmModel, data: AbsoluteReadings) -> Iterator[Candidate]:
    if not has_weight(model, data.payloads):
        return
    for j, name in enumerate(model.robot.joint_names):
        axial = spring(name, j, 5)
        yield Candidate(
            f"joint-compliance:{name}",
            f"joint {name} deflects about its axis under the arm's weight",
            (((axial, axial.sd),),),
            axial.name,
        )
        tilting = [spring(name, j, row) for row in (3, 4)]
        yield Candidate(
            f"joint-tilt:{name}",
            f"joint {name} tilts across its axis under the arm's weight",
            (_equal(tilting), *(_equal([one]) for one in tilting)),
            ",".join(one.name for one in tilting),
        )


def _gears(model: ArmModel, data: AbsoluteReadings) -> Iterator[Candidate]:
    robot = model.robot
    for j, name in enumerate(robot.joint_names):
        curve = [(periodic_error(robot, j, n, phase), n) for n in range(1, CURVE + 1) for phase in (0, 1)]
        finer = tuple(tuple((one, 1.0 / (1.0 + (n / b) ** 2)) for one, n in curve) for b in FALL_OFF)
        first = _equal([one for one, n in curve if n == 1])
        yield Candidate(
            f"joint-error:{name}",
            f"joint {name} is off by a curve over its angle",
            (first, *finer),
            f"{name}.periodic",
        )
        lost = [one for one in reversals(robot, data) if one.index == (j,)]
        yield Candidate(
            f"lost-motion:{name}", f"joint {name} loses motion where it turns back", (_equal(lost),), f"{name}.reversal"
        )
        ratio = ratio_error(robot, j)
        yield Candidate(f"gear-ratio:{name}", f"joint {name} turns by another ratio", (_equal([ratio]),), ratio.name)
    for j, k in permutations(range(robot.dof), 2):
        one = coupling_error(robot, j, k)
        name, other = robot.joint_names[j], robot.joint_names[k]
        yield Candidate(
            f"joint-coupling:{name}.{other}", f"joint {name} turns with joint {other}", (_equal([one]),), one.name
        )


def _structure(model: ArmModel, data: AbsoluteReadings) -> Iterator[Candidate]:
    if has_weight(model, data.payloads):
        tilting = [spring("base", -1, row) for row in (3, 4)]
        yield Candidate("base-tilt", "the base tilts under the arm's weight", (_equal(tilting),), "base")
    if any(one.start > 0.0 for one in payload(model.robot, data)):
        off = tuple((one, one.sd) for one in payload(model.robot, data))
        # Most are only heavier or lighter, with their centres where they were said to be.
        heavier = tuple((one, size) for one, size in off if one.index[1] == 0)
        yield Candidate("payload", "payloads weigh other than the table says", (heavier, off), "payload")
    bent = [one for one in rail(model.robot, data) if one.index[1] > 1 or one.index[0]]
    if bent:
        shapes = tuple(shape for highest in LENGTHWISE for shape in _with_parts(_bowing(bent, highest)))
        yield Candidate("rail-bow", "the rail bows, or turns its carriage", shapes, "rail")


def _bowing(bent: Sequence[Unknown], highest: int) -> Shape:
    """Laws of a rail up to an order: shifts, and turns that move a target alike."""
    return tuple(
        (one, 1.0 / one.index[1] / (ARM_LENGTH if _turns(one) else 1.0)) for one in bent if one.index[1] <= highest
    )


def _around(model: ArmModel, data: AbsoluteReadings) -> Iterator[Candidate]:
    grown = tuple(growth(model.robot, data))
    yield Candidate("arm-growth", "the arm grows with the temperature", (_equal(grown),), "growth")
    even = tuple(moved(data, 0))
    settling = tuple(moved(data, SETTLING))
    shapes = (*_with_parts(_moving(even)), *_with_parts(_moving(settling)))
    yield Candidate("drift", "the arm and the tracker drift apart", shapes if even else ((),))
    bumps = tuple(shape for k in range(1, BUMPS) for shape in _with_parts(_moving(tuple(moved(data, k)))))
    yield Candidate("bump", "the arm or the tracker was moved on the way", bumps if even else ((),))


def _equal(some: Sequence[Unknown]) -> Shape:
    return tuple((one, 1.0) for one in some)


def _with_parts(shape: Shape) -> tuple[Shape, ...]:
    """A shape of shifts and turns, and its shifts alone: fewer numbers are the likelier ones where they do."""
    shifts = tuple((one, size) for one, size in shape if not _turns(one))
    return (shape, shifts) if 0 < len(shifts) < len(shape) else (shape,)


def _turns(one: Unknown) -> bool:
    """Whether an unknown of what moves or bows is a turn."""
    return bool(one.index[1] if one.kind == "drift" else one.index[0])


def _moving(some: Sequence[Unknown]) -> Shape:
    """Shifts and turns that move a target alike."""
    return tuple((one, 1.0 / ARM_LENGTH if _turns(one) else 1.0) for one in some)
