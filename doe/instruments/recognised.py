"""Names of columns as instruments and people write them, in English and German: what each surely holds, or a question.

What a name leaves open is asked about with the option that answers it, and never decided by the figures below it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from doe.instruments.meanings import AXES, Meaning, When, joint_words, meaning_of, takes, units_for, with_unit
from doe.instruments.units import dimension, unit_of
from doe.instruments.vocabulary import (
    AFTER,
    AROUND_JOINTS,
    BEFORE,
    GAUGES,
    JOINT_WORDS,
    LOCAL,
    MEANINGS,
    MEASURED,
    NO_JOINT,
    NOMINAL,
    RATES,
    UNDIRECTED,
    URDF_JOINTS,
    WORDS,
)
from doe.tables.columns import DISPLACEMENTS, LOADS, POINT
from robots import InputError

_UNIT: Final = re.compile(r"^(.*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])]|[/,]\s*([^\s/,]+)|_([^_\s]+))\s*$")
_JOINT: Final = re.compile(r"(q|j|joint|axis|achse|gelenk|theta|a)\s*(\d+)([a-z]*)")
_TARGET: Final = re.compile(
    r"(?:(?:(?:target|smr|reflector|reflektor|ziel|nest)\s*(\w+?)|[tn]\s*(\d+))\s+)([xyz])|([xyz])\s*(\d+)"
)
# Units that are offered, the usual one first; others are taken too.
_USUAL: Final = {"length": ("mm", "inch", "um", "m"), "joint": ("deg", "rad"), "turn": ("mrad", "deg", "rad")}
# Behind an underscore these are letters of a name as a rule: x_t is no x in tons.
_LETTERS: Final = ("t", "g", "h")
_OWN: Final = re.compile(r"q[1-9]\d*[a-z]*_(deg|rad)")
# Units of a table by the first letter of the meaning.
_TABLE_UNIT: Final = {"f": "N", "m": "Nm", "d": "mm", "r": "mrad"}
# Arrays of a log: position[0], as ROS and its tools write them.
_ARRAY: Final = re.compile(r".*?position\s*\[\d+\]", re.I)
_AXIS_BEHIND: Final = re.compile(r"[\s_.-]*[xyz]\s*$", re.I)


@dataclass(frozen=True)
class Question:
    """What is not sure of a column, what may be meant, and the options that say it (the first stands for usual)."""

    column: str
    problem: str
    options: tuple[str, ...]

    def error(self, file: str) -> InputError:
        """As an error with the exact options."""
        return InputError(
            f"{file}, column {self.column!r}: {self.problem}",
            code="I004",
            allowed=" or ".join(self.options),
            remedy="give the option that is true, or write it into the mapping file",
        )


@dataclass(frozen=True)
class Recognised:
    """Meanings of columns by name, why (in words), and what has to be asked."""

    meanings: dict[str, Meaning]
    why: dict[str, str]
    questions: tuple[Question, ...]


def recognise(
    header: Sequence[str],
    units: Sequence[str],
    kinds: Sequence[str],
    *,
    given: Mapping[str, Meaning],
    stated: Sequence[str] = (),
    said: Sequence[str] = (),
    joints: Sequence[str] = (),
) -> Recognised:
    """What each column holds.

    Parameters
    ----------
    header, units : names of the columns, units in a line below them ("" without)
    kinds : what a column's cells are: "number", "text", or a form of time ("iso", "dmy", "mdy", "clock")
    given : meanings that the user or a mapping file has said
    stated, said : units of columns without any, as lines of the file and as the user state them
    joints : names of the model's joint columns, as q3real_deg
    """
    run = _joint_run(header)
    targets = _target_names(header)
    nominal = any(_words(name) & NOMINAL for name in header)
    out, why, questions = dict[str, Meaning](), dict[str, str](), list[Question]()
    for name, below, kind in zip(header, units, kinds, strict=True):
        if name in given:
            meaning, reason = given[name], "as given"
            if meaning.needs_unit and unit_of(below) in units_for(meaning):
                meaning = replace(meaning, unit=unit_of(below))
        else:
            found = _recognised(name, below, kind, run, targets, nominal, joints)
            if isinstance(found, Question):
                questions.append(found)
                continue
            meaning, reason = found, "by its name"
        if meaning.needs_unit:
            stating = [(u, "as given") for u in said] + [(u, "as the file states") for u in stated]
            fitting = list(dict.fromkeys((u, w) for u, w in stating if takes(meaning, u)))
            if len({u for u, w in fitting if w == fitting[0][1]}) == 1:
                meaning, reason = replace(meaning, unit=fitting[0][0]), f"{reason}, unit {fitting[0][1]}"
            else:
                questions.append(_unit_question(name, meaning))
                continue
        out[name], why[name] = meaning, reason
    return Recognised(out, why, (*questions, *_twice(out)))


def _recognised(
    name: str,
    below: str,
    kind: str,
    run: Mapping[str, str],
    targets: Mapping[str, tuple[str, str] | None],
    nominal: bool,
    joints: Sequence[str],
) -> Meaning | Question:
    if exact := _exact(name, joints):
        return exact
    stem, unit = split_unit(name)
    unit = unit or unit_of(below)
    words = _plain(stem)
    when, rest = _when(words)
    if joint := _of_model(stem, joints):
        return _with(Meaning(joint), unit, name)
    if kind == "number" and _ARRAY.fullmatch(name):
        return _ask(
            name,
            "no column names the joint of this place in the array",
            *_joint_options("", joints, unit or "rad"),
            "keep",
        )
    if name in run:
        return _with(Meaning(run[name]), unit, name)
    if name in targets:
        found = targets[name]
        if found is None:
            return _ask(
                name,
                "it may belong to a second target, or to a position before or after the load",
                *(f"{stem[0].lower()} mm of {stem[-1]}", f"{stem[0].lower()} mm before", f"{stem[0].lower()} mm after"),
            )
        return _with(Meaning(found[0], target=found[1], when=when), unit, name)
    if set(words.split()) & NOMINAL and any(axis in words.split() for axis in AXES):
        return Meaning("keep")
    if (axis := _axis(rest)) is not None:
        return _with(Meaning(axis, when=when), unit, name)
    if rest not in MEANINGS:
        rest = " ".join(word for word in rest.split() if word not in MEASURED) or rest
    if rest in MEANINGS:
        what = MEANINGS[rest]
        if nominal and what in ("dx", "dy", "dz") and "gauge" not in rest and not when:
            return Meaning("keep")  # beside nominal coordinates it is the deviation from these
        if what in ("time", "date") and unit is None and kind != "number":
            return _time(name, what) if kind == "text" else Meaning(what, kind, when)
        return _with(Meaning(what, when=when), unit, name)
    return _open(name, rest, unit, when, kind == "number", joints)


def _of_model(stem: str, joints: Sequence[str]) -> str | None:
    """The word of the model's joint that a column is called after, as the model or a log of its controller does."""
    known, words = joint_words(joints), _plain(stem).split()
    if stem in known:
        return stem
    found = []
    for word, name in known.items():
        own = _plain(name.rpartition("_")[0]).split()
        at = next((k for k in range(len(words) - len(own) + 1) if words[k : k + len(own)] == own), None)
        if at is not None and not {*words[:at], *words[at + len(own) :]} - AROUND_JOINTS:
            found.append(word)
    return found[0] if len(found) == 1 else None


def _joint_options(number: str, joints: Sequence[str], unit: str) -> list[str]:
    """Meanings for a column that may be a joint: the model's, those of the same number first; without a model q1."""
    known = sorted(joint_words(joints), key=lambda word: number not in re.findall(r"\d+", word))
    return [f"{word} {unit}" for word in known or [f"q{number or '1'}"]]


def _open(
    name: str, rest: str, unit: str | None, when: When, has_numbers: bool, joints: Sequence[str]
) -> Meaning | Question:
    """A column whose name says too little: a question where it may matter, else it is kept."""
    tail = f" {when}" if when else ""
    plain = " ".join(word for word in rest.split() if word not in LOCAL)
    if plain != rest and (what := MEANINGS.get(plain, ""))[:1] in ("f", "m", "d", "r") and what[1:] in AXES:
        return _ask(
            name,
            "its axes may be those of the sensor, the tool or the flange: convert its values to base "
            "axes first, or say that they are in base axes",
            f"{what} {unit or _TABLE_UNIT[what[0]]}{tail}",
            "keep",
        )
    if rest in GAUGES:
        return _ask(
            name,
            "the direction that the gauge reads is not said",
            *(f"d{axis} {unit or 'mm'}{tail}" for axis in "zyx"),
            "keep",
        )
    if rest in UNDIRECTED or (unit and dimension(unit) == "force"):
        if unit and dimension(unit) == "mass":
            return _ask(
                name,
                "it may be a mass hung on the tool, or a payload that the flange carries",
                f"hung {unit}",
                f"payload {unit}",
            )
        return _ask(
            name,
            "the direction of the load, in base axes, is not said",
            *([f"hung {unit or 'N'}", f"fz {unit or 'N'}", f"fx {unit or 'N'}", f"fy {unit or 'N'}", "keep"]),
        )
    found = _JOINT.fullmatch(rest)
    if found or rest in ("e1", "e 1", "track"):
        number, size = (found[2] if found and int(found[2]) else "1") if found else "7", dimension(unit) if unit else ""
        meanings = _joint_options(number, joints, unit or "deg") * (size != "length")
        meanings += [f"rail {unit or 'mm'}"] * (size != "angle")
        return _ask(name, "it may be a joint", *meanings, "keep")
    if has_numbers and JOINT_WORDS & set(rest.split()) and not RATES & set(rest.split()):
        return _ask(name, "it may be a joint", *_joint_options("", joints, unit or "deg"), "keep")
    if has_numbers and unit and dimension(unit) == "angle" and not set(rest.split()) & NO_JOINT:
        return _ask(name, "an angle whose name is not known may be a joint", *_joint_options("", joints, unit), "keep")
    return Meaning("keep")


def split_unit(name: str) -> tuple[str, str | None]:
    """A column's name without its unit, and the unit, None where there is none."""
    found = _UNIT.match(name)
    if found and found[1]:
        unit = unit_of(next(part for part in found.groups()[1:] if part is not None))
        if unit and not (found[4] and unit in _LETTERS):
            return found[1], unit
        if found[2] is not None:
            return found[1] if found[2] in ("", "-", "1") else f"{found[1]} {found[2]}", None
    stem, _, last = name.rpartition(" ")
    # "X mm", but not "temp in" or "delta m": without brackets only what is no word or letter of its own.
    unit = unit_of(last) if len(last) > 1 and last.lower() not in ("in", "min") else None
    return (stem, unit) if stem and unit else (name, None)


def _exact(name: str, joints: Sequence[str]) -> Meaning | None:
    """The meaning of a name of the measurement table itself."""
    stem, _, unit = name.rpartition("_")
    if name in (
        *LOADS,
        *POINT,
        *DISPLACEMENTS,
        "x_mm",
        "y_mm",
        "z_mm",
        "sigma_mm",
        "payload_kg",
        "rail_mm",
        "payload_x_mm",
        "payload_y_mm",
        "payload_z_mm",
        "temperature_C",
        "time_s",
    ) or _OWN.fullmatch(name):
        return meaning_of(f"{stem} {unit}", name)
    if word := {column: word for word, column in joint_words(joints).items()}.get(name):
        return Meaning(word, unit)
    return Meaning(name) if name in WORDS else None


def _plain(text: str) -> str:
    text = text.replace("\u0394", "delta ").lower()
    return re.sub(r"\s+", " ", re.sub(r"[^\w#]+|_", " ", text)).strip()


def _words(name: str) -> set[str]:
    return set(_plain(split_unit(name)[0]).split())


def _when(words: str) -> tuple[When, str]:
    parts = words.split()
    if len(parts) < 2:
        return "", words
    for when, known in (("before", BEFORE), ("after", AFTER)):
        if set(parts) & known:
            rest = " ".join(part for part in parts if part not in known)
            return ("before" if when == "before" else "after"), rest
    return "", words


def _axis(rest: str) -> str | None:
    """The axis of a coordinate that was measured."""
    parts = [part for part in rest.split() if part not in MEASURED]
    return parts[0] if len(parts) == 1 and parts[0] in AXES else None


def _joint_run(header: Sequence[str]) -> dict[str, str]:
    """Columns of joints by name: all of one sort, counted from 1 without a gap, three or more of them."""
    runs: dict[str, dict[int, list[tuple[str, str]]]] = {}
    for name in header:
        stem = re.sub(r"\b(angle|winkel|pos|position|actual|ist)\b", " ", _plain(split_unit(name)[0])).strip()
        if found := _JOINT.fullmatch(stem):
            runs.setdefault(found[1], {}).setdefault(int(found[2]), []).append((name, f"q{found[2]}{found[3]}"))
    whole = [run for run in runs.values() if sorted(run) == list(range(1, len(run) + 1)) and len(run) > 2]
    whole = [run for run in whole if all(len(columns) == 1 for columns in run.values())]
    if len(whole) == 1:
        return dict(column for columns in whole[0].values() for column in columns)
    named = {re.sub(r"\bjoint\b", " ", _plain(split_unit(name)[0])).strip(): name for name in header}
    if not whole and all(word in named for word in URDF_JOINTS):
        return {named[word]: f"q{k}" for k, word in enumerate(URDF_JOINTS, 1)}
    return {}


def _target_names(header: Sequence[str]) -> dict[str, tuple[str, str] | None]:
    """Columns of coordinates with a target in their name: axis and target; None where X2 may be something else."""
    found: dict[str, tuple[str, str]] = {}
    numbered = set[str]()
    for name in header:
        one = _TARGET.fullmatch(_plain(split_unit(name)[0]))
        if one and one[3]:
            found[name] = (one[3], _AXIS_BEHIND.sub("", split_unit(name)[0]).strip())
        elif one:
            found[name] = (one[4], one[5])
            numbered.add(name)
    labels = {found[name][1] for name in numbered}
    unclear = bool(numbered) and len(labels) < 3
    return {name: None if unclear and name in numbered else value for name, value in found.items()}


def _with(meaning: Meaning, unit: str | None, name: str) -> Meaning | Question:
    if unit is None:
        return meaning
    if unit not in units_for(meaning):
        if meaning.kind == "force" and dimension(unit) == "mass" and f"{unit}f" in units_for(meaning):
            return _ask(name, f"{unit} is a mass, and the column is a force", f"{meaning.what} {unit}f", f"hung {unit}")
        if meaning.kind == "mass" and dimension(unit) == "force":
            return _ask(name, f"{unit} is a force, and a payload is a mass", f"hung {unit}", "keep")
        if not meaning.kind:
            return Meaning("keep")
        return _ask(
            name,
            f"{unit} is no unit of it",
            *(f"{meaning.what} {one}" for one in _USUAL.get(meaning.kind, units_for(meaning))),
            "keep",
        )
    return with_unit(meaning, unit, f"column {name}")


def _time(name: str, what: str = "time") -> Question:
    return _ask(
        name,
        "how dates and times are written is not said",
        *(f"{what} {form}" for form in ("dmy", "mdy", "iso", "clock")),
        "keep",
    )


def _unit_question(name: str, meaning: Meaning) -> Question:
    if meaning.kind == "time":
        return _ask(
            name, "the unit of the clock is not said", *(f"{meaning.what} {u}" for u in ("s", "min", "h", "ms")), "keep"
        )
    units = units_for(meaning)
    usual, *others = _USUAL.get(meaning.kind, units)
    options = tuple(f'--column "{name}={replace(meaning, unit=unit)}"' for unit in (usual, *others))
    whole = f"--units {usual}, for all columns without one"
    return Question(
        name,
        f"it is taken as {meaning}, and its unit is not said",
        (*((whole,) if takes(meaning, usual) else ()), *dict.fromkeys(options)),
    )


def _ask(name: str, problem: str, *meanings: str) -> Question:
    return Question(name, problem, tuple(f'--column "{name}={meaning}"' for meaning in meanings))


def _twice(meanings: Mapping[str, Meaning]) -> list[Question]:
    """Columns that would hold the same."""
    plain = {
        name: replace(m, unit=None, negated=False) for name, m in meanings.items() if m.what not in ("keep", "ignore")
    }
    counts = Counter(plain.values())
    seen = set[Meaning]()
    out = []
    for name, meaning in plain.items():
        if counts[meaning] > 1 and meaning in seen:
            others = [other for other, m in plain.items() if m == meaning and other != name]
            out.append(_ask(name, f"it would hold the same ({meaning}) as column {others[0]!r}", "keep", "ignore"))
        seen.add(meaning)
    return out
