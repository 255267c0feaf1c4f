"""What a column holds, in the words that options and mapping files use: ``z mm before``, ``hung kg``, ``x mm of ball``.

MEANING [UNIT] [before|after] [negated] [of TARGET]
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

from doe.instruments.units import UNITS, dimension, unit_of
from robots import InputError

When = Literal["", "before", "after"]
# Meaning: dimension, column of the table. "turn": small rotations of a deflection.
AXES: Final = ("x", "y", "z")
QUANTITIES: Final = {
    **{axis: ("length", f"{axis}_mm") for axis in AXES},
    **{f"d{axis}": ("length", f"d{axis}_mm") for axis in AXES},
    **{f"r{axis}": ("turn", f"r{axis}_mrad") for axis in AXES},
    **{f"f{axis}": ("force", f"f{axis}_N") for axis in AXES},
    **{f"m{axis}": ("moment", f"m{axis}_Nm") for axis in AXES},
    **{f"p{axis}": ("length", f"p{axis}_mm") for axis in AXES},
    **{f"payload_{axis}": ("length", f"payload_{axis}_mm") for axis in AXES},
    "hung": ("hung", "fz_N"),
    "payload": ("mass", "payload_kg"),
    "rail": ("length", "rail_mm"),
    "sigma": ("length", "sigma_mm"),
    "temperature": ("temperature", "temperature_C"),
    "time": ("time", "time_s"),
    "date": ("time", "time_s"),
}
WORDS: Final = ("pose", "repeat", "phase", "step", "session", "target", "operator", "instrument", "approach")
# Columns that go into the table as they are, and columns that are left out.
LEFT: Final = ("keep", "ignore")
# Meanings that a reading has twice where it was taken before and after the load.
TWICE: Final = frozenset(
    (*AXES, *(f"d{axis}" for axis in AXES), *(f"r{axis}" for axis in AXES), "sigma", "temperature", "time")
)
# Of what a load is hung: a mass, or the force that a scale shows.
_DIMENSIONS: Final = {"hung": ("mass", "force"), "turn": ("angle",), "joint": ("angle",)}
_JOINT: Final = re.compile(r"q[1-9]\d*[a-z]*")
FORM: Final = "MEANING [UNIT] [before|after] [negated] [of TARGET]"


@dataclass(frozen=True)
class Meaning:
    """What a column holds; ``unit`` is None where none was said, ``target`` "" where none is named."""

    what: str
    unit: str | None = None
    when: When = ""
    target: str = ""
    negated: bool = False

    @property
    def kind(self) -> str:
        """Its dimension ("joint" for angles of joints), "" of words and of columns that are left as they are."""
        if self.what in QUANTITIES:
            return QUANTITIES[self.what][0]
        return "" if self.what in (*WORDS, *LEFT) else "joint"

    @property
    def needs_unit(self) -> bool:
        """Whether the unit is still to be said."""
        return bool(self.kind) and self.unit is None

    def __str__(self) -> str:
        parts = [self.what, self.unit or "", self.when, "negated" * self.negated]
        return " ".join(part for part in (*parts, self.target and f"of {self.target}") if part)

    def same(self, other: Meaning) -> bool:
        """Whether two columns would hold the same thing."""
        plain = replace(self, unit=None, negated=False)
        return self.what not in LEFT and plain == replace(other, unit=None, negated=False)


def joint_words(names: Sequence[str]) -> dict[str, str]:
    """Columns of a model's joints by the word that means each: joint_1 for joint_1_deg; in full what is a word here."""
    words = {name: name.rpartition("_")[0] for name in names}
    return {name if word in (*QUANTITIES, *WORDS, *LEFT) else word: name for name, word in words.items()}


def meaning_of(text: str, where: str, joints: Sequence[str] = ()) -> Meaning:
    """The meaning that a user has written; ``where`` names the option or the place in the mapping file.

    ``joints``: columns of the model's joints, as joint_1_deg, which are meant by joint_1 and by joint_1_deg.

    Raises
    ------
    InputError
        An unknown meaning, unit or word, or a unit of another dimension.
    """
    first, _, target = text.strip().partition(" of ")
    what, *rest = first.split() or [""]
    known, own = (*QUANTITIES, *WORDS, *LEFT), joint_words(joints)
    what = next((word for word, name in own.items() if name == what), what)
    if what not in known and what not in own and not _JOINT.fullmatch(what):
        allowed = f"{', '.join(own) or 'q1, q2 ...'}, {', '.join(known)}"
        more = "" if own else "; a model's own joints are known with --model"
        raise InputError(f"{where}: meaning", code="I004", value=what, allowed=allowed, remedy=f"write {FORM}{more}")
    made = Meaning(what, target=target.strip())
    for word in rest:
        if word in ("before", "after") and what in TWICE:
            made = replace(made, when="before" if word == "before" else "after")
        elif word == "negated" and made.kind:
            made = replace(made, negated=True)
        elif made.unit is None and (unit := unit_of(word)):
            made = with_unit(made, unit, where)
        else:
            allowed = ", ".join((*units_for(made), *(("before", "after") if what in TWICE else ()), "negated"))
            raise InputError(
                f"{where}: word after {what}",
                code="I004",
                value=word,
                allowed=allowed if made.kind else "none: it has no unit",
                remedy=f"write {FORM}",
            )
    if made.target and what not in (*AXES, "sigma"):
        raise InputError(
            f"{where}: of {made.target}",
            code="I004",
            allowed="of TARGET behind x, y, z and sigma",
            remedy="leave it out",
        )
    return made


def units_for(meaning: Meaning) -> tuple[str, ...]:
    """Units that a column of this meaning can be in."""
    kinds = _DIMENSIONS.get(meaning.kind, (meaning.kind,)) if meaning.kind else ()
    return tuple(unit for kind in kinds for unit in UNITS[kind])


def with_unit(meaning: Meaning, unit: str, where: str) -> Meaning:
    """The meaning with its unit.

    Raises
    ------
    InputError
        A unit of another dimension.
    """
    if unit not in units_for(meaning):
        allowed = ", ".join(units_for(meaning)) or "none: it has no unit"
        raise InputError(
            f"{where}: unit of {meaning.what}", code="I004", value=unit, allowed=allowed, remedy="choose one of them"
        )
    return replace(meaning, unit=unit)


def takes(meaning: Meaning, unit: str) -> bool:
    """Whether a unit that is stated for the whole file is that of this column.

    Not of small rotations and standard deviations, which are often in others, nor of masses, which may hang or be
    carried, nor of clocks.
    """
    stated = {"length": "length", "joint": "angle", "force": "force", "moment": "moment", "temperature": "temperature"}
    return meaning.what != "sigma" and stated.get(meaning.kind) == dimension(unit)
