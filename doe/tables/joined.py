"""Several measurement tables as one: set-ups kept apart, contradictions noticed across files."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace

from doe.tables.checks import check_duplicates, joint_keys
from doe.tables.measurements import Measurements, stacked
from robots import InputError
from robots.faults import Faults

# Column that says which file a reading came from; it is written with the table and kept when that is read back.
FILE = "data file"


def join(tables: Sequence[Measurements]) -> Measurements:
    """One table of several of the same robot, in their order.

    A set-up is a label with its joint angles: the same label stands for other set-ups in other files where the angles
    differ, and then carries the file's name. Line numbers stay those of the files; :func:`files_of` names these.

    Raises
    ------
    InputError
        No table, the same file twice, or tables of robots with different numbers of joints.
    InputErrors
        The same reading in two of them without a repeat number that tells them apart, contradicting or not.
    """
    if not tables:
        raise InputError("measurement tables to join", code="T008", value=0, allowed="1 or more")
    if len(tables) == 1:
        return tables[0]
    names = _names(tables)
    parts = [replace(t, pose=labels) for t, labels in zip(tables, _labels(tables, names), strict=True)]
    columns = dict.fromkeys(name for t in tables for name in t.extra if name != FILE)
    extra = {c: tuple(v for t in tables for v in t.extra.get(c, ("",) * t.n)) for c in columns}
    extra[FILE] = tuple(name for t, name in zip(tables, names, strict=True) for _ in range(t.n))
    whole = stacked(parts) | {
        "extra": extra,
        "notes": tuple(f"{name}: {note}" for t, name in zip(tables, names, strict=True) for note in t.notes),
        "source": " + ".join(names),
        "sha256": hashlib.sha256("".join(t.sha256 for t in tables).encode()).hexdigest(),
    }
    joined = replace(parts[0], **whole)  # type: ignore[arg-type]
    faults = Faults(joined.source)
    check_duplicates(joined, faults, joined.extra[FILE])
    faults.raise_if_any("measurements")
    return joined


def files_of(m: Measurements) -> tuple[str, ...] | None:
    """The file (n,) of each reading; None where all are from one."""
    return m.extra.get(FILE)


def _names(tables: Sequence[Measurements]) -> list[str]:
    """Names of the files, numbered where two are the same."""
    if len({t.q.shape[1] for t in tables}) > 1:
        raise InputError(
            "measurement tables to join", code="T008", value="different robots", allowed="tables of one robot"
        )
    first: dict[str, str] = {}
    names: list[str] = []
    for t in tables:
        if t.sha256 in first:
            raise InputError(
                f"measurement tables {first[t.sha256]} and {t.source} are the same",
                code="T008",
                allowed="each table once",
                remedy="leave one of them out",
            )
        earlier = sum(t.source == other.source for other in tables[: len(names)])
        names.append(f"{t.source} ({earlier + 1})" if earlier else t.source)
        first[t.sha256] = t.source
    return names


def _labels(tables: Sequence[Measurements], names: Sequence[str]) -> list[tuple[str, ...]]:
    """Labels of each table, those that stand for other angles in an earlier one with the file's name."""
    known: dict[str, tuple[float, ...]] = {}
    out = []
    for t, name in zip(tables, names, strict=True):
        labels = tuple(
            label if known.get(label, key) == key else f"{label} ({name})"
            for label, key in zip(t.pose, joint_keys(t.q), strict=True)
        )
        out.append(labels)
        known |= dict(zip(labels, joint_keys(t.q), strict=True))
    return out
