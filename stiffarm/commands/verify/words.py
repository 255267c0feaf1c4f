"""Offences in words and numbers, in the units of the shop."""

from __future__ import annotations

import numpy as np

from machining.verification import Kind, Offence, Verification

_SCALES = {"rad": (180.0 / np.pi, "deg"), "m": (1e3, "mm"), "": (1.0, "")}


def shown(value: float, unit: str) -> tuple[float, str]:
    """A number in SI in the shop's unit: deg for rad, mm for m; rates likewise."""
    base, _, per = unit.partition("/")
    factor, name = _SCALES[base]
    return value * factor, f"{name}/{per}" if per else name


def value_words(offence: Offence) -> str:
    """What was found and what is allowed, as in "13.1 deg, limit 12 deg"."""
    if offence.kind in (Kind.COLLISION, Kind.RAPID_CONTACT):
        return "overlap"
    if not np.isfinite(offence.value):
        return ""
    value, unit = shown(offence.value, offence.unit)
    limit, _ = shown(offence.limit, offence.unit)
    if offence.kind is Kind.BRANCH_JUMP:
        return f"largest joint step {value:.3g} {unit}"
    if offence.kind is Kind.UNPROVEN:
        apart = f"{value:.2g}" if value >= 1e-3 else "less than 0.001"
        return f"{apart} {unit} apart where it was seen"
    # A value that rounds to its limit would look like no offence.
    digits = 4 if f"{value:.4g}" != f"{limit:.4g}" else 9
    return f"{value:.{digits}g} {unit}".strip() + f", limit {limit:.4g} {unit}".rstrip()


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
    return f"{place_words(offence)}: {offence.kind}" + (f": {'; '.join(said)}" if said else "")


def verdict(found: Verification) -> str:
    """What a user needs to know first."""
    warnings = len(found.offences) - len(found.errors)
    aside = f" {warnings} warning{'s' if warnings > 1 else ''}." if warnings else ""
    if found.clean:
        return f"No offence found in {found.program.n} moves.{aside}"
    n = len(found.errors)
    return f"{n} offence{'s' if n > 1 else ''} found. First: {sentence(found.errors[0])}.{aside}"
