"""Several files as one: readings below one another, or the angles of one file beside the readings of another."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from doe.instruments.meanings import Meaning
from doe.instruments.values import Read
from robots import InputError
from robots.arrays import Indices
from robots.errors import listed
from robots.faults import Faults


def combined(parts: Sequence[Read], join: str | None) -> tuple[Read, tuple[str, ...]]:
    """All rows as one, and what was done, in words. ``join``: how angles find their readings, "pose" or "order".

    Raises
    ------
    InputError
        No joint angles, files that do not belong together, or no sure way to join them.
    """
    angles = [part for part in parts if part.joints and not part.reads]
    readings = [part for part in parts if part.reads]
    if other := [part for part in parts if not part.joints and not part.reads]:
        raise InputError(
            f"{other[0].name}: no joint angles and no readings among its columns",
            code="I005",
            allowed=_columns_of(other[0]),
            remedy='say what they hold, as in --column "NAME=q1 deg"',
        )
    if not readings:
        raise InputError(
            f"{parts[0].name}: no readings among its columns",
            code="I005",
            allowed=_columns_of(parts[0]),
            remedy='say what they hold, as in --column "NAME=dz mm", or give the file with them too',
        )
    bare = [part for part in readings if not part.joints]
    if bare and not angles:
        raise InputError(
            f"{bare[0].name}: no joint angles among its columns",
            code="I005",
            allowed=_columns_of(bare[0]),
            remedy='say what they hold, as in --column "NAME=q1 deg", or give the file with them too',
        )
    if angles and len(bare) < len(readings):
        raise InputError(
            f"{angles[0].name} has joint angles alone, and other files have theirs",
            code="I005",
            allowed="one file of angles for files without any",
            remedy="convert these files one by one",
        )
    if len(angles) > 1:
        raise InputError(
            "files with joint angles alone",
            code="I005",
            value=", ".join(part.name for part in angles),
            allowed="one",
            remedy="convert the campaigns one by one",
        )
    if len(parts) > 1 and any(not part.dated for part in parts):
        raise InputError(
            "several files have clock times without a date",
            code="I005",
            allowed="times with a date",
            remedy='keep these columns without using them, as in --column "Time=keep"',
        )
    notes = list[str]()
    whole = _stacked(readings, notes)
    if angles:
        whole = _joined(angles[0], whole, join, notes)
    return whole, tuple(notes)


def _columns_of(part: Read) -> str:
    return "columns " + listed(f"{c.name!r}" for c in part.columns)


def _stacked(parts: Sequence[Read], notes: list[str]) -> Read:
    if len(parts) == 1:
        return parts[0]
    keys = dict.fromkeys(key for part in parts for key in part.numbers)
    for key in keys:
        without = [part.name for part in parts if key not in part.numbers]
        if without and (Meaning(key[0]).kind == "joint" or key[0] in ("x", "y", "z")):
            raise InputError(
                f"{without[0]} has no column {key[0]}, other files have",
                code="I006",
                allowed="the same joints and axes",
                remedy="convert these files one by one",
            )
    numbers = {key: np.concatenate([part.numbers.get(key, np.full(part.n, np.nan)) for part in parts]) for key in keys}
    for key, values in numbers.items():
        if key[0] in ("fx", "fy", "fz", "mx", "my", "mz", "hung", "rail"):
            values[np.isnan(values)] = 0.0

    def texts(name: str) -> dict[str, tuple[str, ...]]:
        found = dict.fromkeys(word for part in parts for word in getattr(part, name))
        return {w: tuple(t for part in parts for t in getattr(part, name).get(w, ("",) * part.n)) for w in found}

    without = [part.name for part in parts if "target" not in part.words]
    if without and len(without) < len(parts):
        raise InputError(
            f"{without[0]} has no column of targets, other files have",
            code="I006",
            allowed="targets in all, or none",
            remedy="convert it by itself, with --fill target=NAME",
        )
    words = texts("words")
    named = [part.words.get("session", (_session(part.name),) * part.n) for part in parts]
    if bare := [part.name for part in parts if "session" not in part.words]:
        notes.append(f"without a session, so each is one, named after the file: {listed(bare)}")
    words["session"] = tuple(word for words in named for word in words)
    places = tuple(place for part in parts for place in part.places)
    columns = tuple(column for part in parts for column in part.columns)
    return Read(" + ".join(part.name for part in parts), numbers, words, texts("kept"), places, columns)


def _session(name: str) -> str:
    file, _, sheet = name.partition(", sheet ")
    return sheet or Path(file).stem


def _joined(angles: Read, readings: Read, join: str | None, notes: list[str]) -> Read:
    if join not in (None, "pose", "order"):
        raise InputError("--join", code="I006", value=join, allowed="pose, order", remedy="choose one of them")
    both = "pose" in angles.words and "pose" in readings.words
    if join == "pose" and not both:
        raise InputError(
            "--join pose",
            code="I006",
            allowed="a pose column in both files",
            remedy='say which it is, as in --column "NAME=pose"',
        )
    if join is None and not both:
        raise InputError(
            f"{angles.name} and {readings.name}: it is not known which rows belong together",
            code="I006",
            allowed="--join order, or --join pose with a pose column in both",
            remedy="give --join order if both are in the same order, row by row",
        )
    rows = _by_pose(angles, readings) if join != "order" else _by_order(angles, readings)
    notes.append(
        f"angles of {angles.name} joined to {readings.name} {'in order, row by row' if join == 'order' else 'by pose'}"
    )
    if idle := sorted(set(range(angles.n)) - set(rows.tolist())):
        notes.append(f"{len(idle)} rows of {angles.name} have no reading")
    taken = {key: values[rows] for key, values in angles.numbers.items() if key not in readings.numbers}
    words = {w: tuple(cells[k] for k in rows) for w, cells in angles.words.items() if w not in readings.words}
    kept = {w: tuple(cells[k] for k in rows) for w, cells in angles.kept.items() if w not in readings.kept}
    return replace(
        readings,
        numbers={**taken, **readings.numbers},
        words={**words, **readings.words},
        kept={**readings.kept, **kept},
        columns=(*angles.columns, *readings.columns),
    )


def _by_order(angles: Read, readings: Read) -> Indices:
    if angles.n != readings.n:
        raise InputError(
            f"--join order: {angles.name} has {angles.n} rows, {readings.name} {readings.n}",
            code="I006",
            allowed="as many rows in both",
            remedy="leave out rows that are not readings with --rows, or join by pose",
        )
    return np.arange(angles.n, dtype=np.intp)


def _by_pose(angles: Read, readings: Read) -> Indices:
    faults = Faults(readings.name)
    known = {label: k for k, label in enumerate(angles.words["pose"])}
    if twice := [label for label, count in Counter(angles.words["pose"]).items() if count > 1]:
        raise InputError(
            f"{angles.name}: poses {listed(twice)} stand there twice",
            code="I006",
            allowed="each pose once",
            remedy="remove one of each, or join with --join order",
        )
    for (_, line), label in zip(readings.places, readings.words["pose"], strict=True):
        if label not in known:
            faults.add(
                line,
                "column of the pose",
                code="I006",
                value=label,
                allowed=f"a pose of {angles.name}",
                remedy="correct the label, or add the pose's angles there",
            )
    faults.raise_if_any("readings")
    return np.array([known[label] for label in readings.words["pose"]], dtype=np.intp)
