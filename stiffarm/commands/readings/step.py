"""From options to settings, from files to a table on the disk that never takes the place of another one unasked."""

from __future__ import annotations

import datetime as dt
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from doe.instruments.convert import Converted
from doe.instruments.mapping_file import Settings, mapping_text, read_mapping
from doe.instruments.meanings import meaning_of
from robots import InputError, Robot, require_positive
from robots.files.csv_text import write_rows
from robots.files.written import written_whole
from robots.robot import robot_from
from stiffarm.session.table_kinds import described

MAPPING = ".mapping.toml"


@dataclass(frozen=True)
class Written:
    """A table that was made; ``table``, ``mapping``: the files that were written, ``previous``: where old ones went."""

    converted: Converted
    table: Path | None
    mapping: Path | None
    previous: Path | None


def settings_of(
    mapping: Path | None,
    columns: Mapping[str, str],
    fill: Mapping[str, str],
    arm: Robot | None,
    *,
    sigma_mm: float | None,
    **given: Any,
) -> Settings:
    """Settings of a mapping file, with what the user says in front of it; ``columns``: meanings as text, by name.

    ``arm``: whose joints may be named.

    Raises
    ------
    InputError
        A meaning that is none; the mapping file's faults.
    """
    require_positive("--sigma-mm", sigma_mm, "mm", code="A001")
    joints = arm.angle_names if arm else ()
    meanings = {name: meaning_of(text, f"--column {name}", joints) for name, text in columns.items()}
    own = Settings(columns=meanings, fill=dict(fill), sigma_mm=sigma_mm, **given)
    return own if mapping is None else own.over(read_mapping(mapping, joints))


def pairs(texts: Sequence[str] | None, option: str) -> dict[str, str]:
    """``NAME=VALUE`` by name; a name may have an equals sign in it, a value never has.

    Raises
    ------
    InputError
        No equals sign, nothing before or behind it, or a name twice.
    """
    out: dict[str, str] = {}
    for text in texts or ():
        name, equals, value = text.rpartition("=")
        if not equals or not name.strip() or not value.strip():
            raise InputError(
                option, code="A004", value=text, allowed="NAME=VALUE", remedy="put it in quotes where it has blanks"
            )
        if name.strip() in out:
            raise InputError(f"{option}: name", code="A004", value=name.strip(), allowed="each name once")
        out[name.strip()] = value.strip()
    return out


def words_of(text: str | None, option: str) -> tuple[str, ...]:
    """Words between commas.

    Raises
    ------
    InputError
        Nothing between two of them.
    """
    if text is None:
        return ()
    words = tuple(part.strip() for part in text.split(","))
    if not all(words):
        raise InputError(
            option, code="A004", value=text, allowed="words separated by commas", remedy="remove the empty entry"
        )
    return words


def lines_of(text: str | None) -> tuple[int, int] | None:
    """First and last line, as in 8-40.

    Raises
    ------
    InputError
        It is no such pair.
    """
    if text is None:
        return None
    found = re.fullmatch(r"\s*(\d{1,9})\s*-\s*(\d{1,9})\s*", text, re.ASCII)
    if found is None or not 0 < int(found[1]) <= int(found[2]):
        raise InputError(
            "--rows", code="A004", value=text, allowed="first and last line, as in 8-40", remedy="count lines from 1"
        )
    return int(found[1]), int(found[2])


def arm_of(model: str | None) -> Robot | None:
    """The arm whose joints the table is for."""
    return None if model is None else robot_from(described(model))


def save(made: Converted, out: Path, *, first: bool, replace: bool) -> Written:
    """Write the table; with ``first`` the mapping file beside it too.

    Raises
    ------
    InputError
        It may not or cannot be written there; then nothing is.
    """
    old = check_place(out, (), first=first, replace=replace)
    mapping = out.with_name(out.stem + MAPPING) if first else None
    try:
        return Written(made, out, mapping, _write(made, out, mapping, old))
    except OSError as error:
        raise InputError(
            f"table {out} cannot be written ({error.strerror or error})",
            code="F008",
            remedy="choose another place with --out",
        ) from error


def check_place(out: Path, files: Sequence[Path], *, first: bool, replace: bool) -> list[Path]:
    """Files that stand where a table of ``files`` is to be written, and may be moved.

    Raises
    ------
    InputError
        They may not, or it is no place for a table.
    """
    if out.suffix.lower() != ".csv" or out.is_dir() or not out.parent.is_dir():
        raise InputError(
            "--out",
            code="F009",
            value=str(out),
            allowed="a file ending in .csv, in an existing folder",
            remedy="choose another name, or make the folder",
        )
    mapping = out.with_name(out.stem + MAPPING) if first else None
    if any(file.exists() and out.exists() and os.path.samefile(file, out) for file in files):
        raise InputError(
            "--out",
            code="F009",
            value=str(out),
            allowed="a file other than those that are read",
            remedy="choose another name",
        )
    old = [path for path in (out, mapping) if path is not None and os.path.lexists(path)]
    if old and not replace:
        raise InputError(
            f"{' and '.join(map(str, old))}: it exists already",
            code="F009",
            allowed="a new file",
            remedy="choose another name with --out, or give --replace: the old one is then kept in previous/",
        )
    return old


def _write(made: Converted, out: Path, mapping: Path | None, old: Sequence[Path]) -> Path | None:
    previous = None
    with written_whole(out) as draft:
        with draft.open("w", encoding="utf-8", newline="") as stream:
            write_rows(stream, [made.header, *made.rows])
        if old:
            stamp = dt.datetime.now(dt.UTC).strftime("%Y%m%dT%H%M%S.%fZ")
            previous = out.parent / "previous" / stamp
            previous.mkdir(parents=True)
            for path in old:
                os.link(path, previous / path.name, follow_symlinks=False)
        if mapping is not None:
            with written_whole(mapping) as other:
                other.write_text(mapping_text(made.settings, made.source), encoding="utf-8")
    return previous


def payload(made: Written) -> dict[str, Any]:
    """What was made, as JSON."""
    converted = made.converted
    ranges: Mapping[str, tuple[float, float]] = converted.ranges()
    return {
        "kind": converted.kind,
        "readings": len(converted.rows),
        "table": None if made.table is None else str(made.table),
        "mapping": None if made.mapping is None else str(made.mapping),
        "previous": None if made.previous is None else str(made.previous),
        "files": {name: list(how) for name, how in converted.files.items()},
        "columns": [
            {
                "file": c.file,
                "name": c.name,
                "meaning": str(c.meaning),
                "why": c.why,
                "empty": c.empty,
                "lowest": _finite(c.lowest),
                "highest": _finite(c.highest),
            }
            for c in converted.columns
        ],
        "written": {
            name: {"lowest": ranges[name][0], "highest": ranges[name][1]} if name in ranges else {}
            for name in converted.header
        },
        "notes": list(converted.notes),
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
