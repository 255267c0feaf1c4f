"""A verification in words: what is wrong, where, by how much, and what to do about it; in the units of the shop."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np

from machining.verification import KIND_CODES, Kind, Offence, Severity, Verification
from robots.quantities import Quantity

# How values in each SI unit are shown.
UNITS: Final = {
    f"{si}{per}": Quantity("", f"{unit}{per.replace('^', '')}", factor)
    for si, unit, factor in (("rad", "deg", 180.0 / np.pi), ("m", "mm", 1e3), ("", "", 1.0))
    for per in ("", "/s", "/s^2")
}
# Distances of bodies.
DISTANCE: Final = Quantity("distance", "mm", 1e3, digits=3)
REMEDIES: Final = MappingProxyType(
    {
        Kind.COLLISION: "Move the part or the fixture, or write the program anew with another posture:"
        " `stiffarm posture` and `stiffarm place` keep clear of the cell's bodies.",
        Kind.RAPID_CONTACT: "Lift the rapid move clear of the part, or draw the tool out along its axis first.",
        Kind.LOW_RAPID: "Draw the tool out along its axis first, go across at the height of the last retract and then"
        " down. If that way is free of the part, give the cell file the part's surface ([part], with a cutter in"
        " [tool]): then contacts are looked for instead.",
        Kind.COMMAND: "Put the command into the tool path (spindle stop, tool change, rest) and write the program anew"
        " with `stiffarm post`.",
        Kind.LIMIT: "Write the program anew with another branch, turn or gamma (`stiffarm posture`), or another"
        " place of the base (`stiffarm place`).",
        Kind.BRANCH_JUMP: "Let `stiffarm posture` choose one course for the whole path, or part the program there.",
        Kind.UNFOLLOWED: "Put points closer together, or run that move as a joint move.",
        Kind.SINGULARITY: "Choose another gamma (`stiffarm posture`), or another place of the base (`stiffarm place`).",
        Kind.CLEARANCE: "Raise safety_mm in the cell file and choose the posture again (`stiffarm posture`), or allow"
        " less with `--safety`.",
        Kind.UNPROVEN: "Check again with a finer `--resolution`.",
        Kind.SPEED: "Lower the feed there, or choose a posture with smaller joint steps.",
        Kind.ACCELERATION: "Lower the feed at the corner, or state how long the controller blends corners"
        " (`--smoothing`).",
        Kind.OTHER_POINT: "Give the tool and the part frame that the program was made for: its cell file (`--cell`), or"
        " `--tool` and `--part`; is it the robot of the program?",
        Kind.DEVIATION: "Put points closer together (`stiffarm post`), run straight lines (`--interpolation linear`),"
        " or allow more with `--tolerance`.",
    }
)


def value_words(offence: Offence) -> str:
    """What was found and what is allowed, as in "13.1 deg, limit 12 deg"."""
    if offence.kind in (Kind.COLLISION, Kind.RAPID_CONTACT):
        return "overlap"
    if not np.isfinite(offence.value):
        return ""
    unit = UNITS[offence.unit]
    value = unit.text(offence.value, unit=True)
    if offence.kind is Kind.BRANCH_JUMP:
        return f"largest joint step {value}"
    if offence.kind is Kind.UNPROVEN:
        return f"{value} apart where it was seen"
    limit = f"{unit.factor * offence.limit:.4g} {unit.unit}".rstrip()
    # A value that rounds to its limit would look like no offence.
    is_same = f"{unit.factor * offence.value:.4g}" == f"{unit.factor * offence.limit:.4g}"
    return f"{value if not is_same else replace(unit, digits=9).text(offence.value, unit=True)}, limit {limit}"


def offence_words(offence: Offence) -> str:
    """What it is about: bodies, axis, or the words that the check gave."""
    parts = [" and ".join(offence.bodies)] if offence.bodies else []
    parts += [part for part in (offence.axis, offence.text) if part]
    return "; ".join(parts)


def place_words(offence: Offence) -> str:
    """Where it is: line in the source, in the program written if known, and how many moves it lasts."""
    where = f"line {offence.line}"
    if offence.nc_line is not None:
        where += f" (program file line {offence.nc_line})"
    return where if offence.moves == 1 else f"{where}, {offence.moves} moves"


def sentence(offence: Offence) -> str:
    """One offence in one sentence."""
    said = [part for part in (offence_words(offence), value_words(offence)) if part]
    return f"{place_words(offence)}: {offence.kind} [{KIND_CODES[offence.kind]}]" + (
        f": {'; '.join(said)}" if said else ""
    )


def verdict(found: Verification) -> str:
    """What a user needs to know first: how many offences, the worst, and the first line if that is another."""
    warnings = len(found.offences) - len(found.errors)
    aside = f" {counted(warnings, 'warning')}." if warnings else ""
    if found.clean:
        return f"No offence found in {found.program.n} moves.{aside}"
    worst, first = found.ranked[0], found.errors[0]
    earlier = f" The first is in line {first.line}: {first.kind}." if first.line < worst.line else ""
    many = f"{counted(len(found.errors), 'offence')} found. Worst: {sentence(worst)}"
    return f"This program must not run: {many}.{earlier}{aside}"


def counted(n: int, what: str) -> str:
    """As in "1 offence", "2 offences"."""
    return f"{n} {what}{'' if n == 1 else 's'}"


def kinds_words(found: Verification) -> str:
    """How many errors there are of each kind, the worst kind first, as in "1 collision, 4 axis speed"."""
    counts = Counter(o.kind for o in found.ranked if o.severity is Severity.ERROR)
    return ", ".join(f"{n} {kind}" for kind, n in counts.items())


def distance_words(found: Verification) -> str:
    """The least distance of any two bodies, as far as distances were worked out; and between which."""
    if not found.swept.names:
        return "no two are known"
    nearest = int(np.argmin(found.swept.distance))
    least, within, pair = float(found.swept.distance[nearest]), found.swept.within, int(found.swept.pair[nearest])
    if least >= within or pair < 0:
        return f"over {DISTANCE.text(within, unit=True)}"
    said = "overlap" if least < 0.0 else DISTANCE.text(least, unit=True)
    return f"{said} ({' and '.join(found.swept.names[pair])})"
