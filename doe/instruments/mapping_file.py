"""The small TOML that keeps how files of one layout are read, so that the next file needs no options."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from doe.instruments.meanings import Meaning, meaning_of
from robots import InputError
from robots.errors import one_line, raise_any
from robots.files.reading import parse_toml, read_text

SCHEMA: Final = "stiffarm-readings/1"
_TEXTS: Final = ("encoding", "separator", "decimal", "kind", "join", "axes", "target")
_KNOWN: Final = ("schema", *_TEXTS, "sheets", "header", "names", "units", "sigma_mm", "fill", "columns")
_LIST: Final = ("sheets", "names", "units")


@dataclass(frozen=True)
class Settings:
    """How files are read, as options or a mapping file say it; None or empty: to be found.

    ``columns``: meaning of columns by name; ``fill``: values that stand in no file, by meaning; ``names``: of the
    columns of a file without any; ``header``, ``rows``: lines of the names and of the readings; ``units``: of columns
    that name none; ``sigma_mm``: standard deviation of one reading of a coordinate; ``axes``: of the instrument, "base"
    or angles a,b,c in deg; ``join``: "pose" or "order"; ``target``: the one to take; ``kind``: "deflections" or
    "positions".
    """

    columns: Mapping[str, Meaning] = field(default_factory=dict)
    fill: Mapping[str, str] = field(default_factory=dict)
    encoding: str | None = None
    separator: str | None = None
    decimal: str | None = None
    sheets: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    header: int | None = None
    rows: tuple[int, int] | None = None
    units: tuple[str, ...] = ()
    sigma_mm: float | None = None
    axes: str | None = None
    join: str | None = None
    target: str | None = None
    kind: str | None = None

    def over(self, other: Settings) -> Settings:
        """These, and where they say nothing what ``other`` says."""
        changes: dict[str, Any] = {
            name: value for name, value in vars(other).items() if getattr(self, name) in (None, (), {})
        }
        changes |= {"columns": {**other.columns, **self.columns}, "fill": {**other.fill, **self.fill}}
        return replace(self, **changes)


def read_mapping(path: Path, joints: Sequence[str] = ()) -> Settings:
    """Settings of a mapping file; ``joints``: columns of the model's joints.

    Raises
    ------
    InputError
        It cannot be read, or is not as :func:`mapping_text` writes it; every fault is named.
    """
    where = f"mapping file {path}"
    data = parse_toml(read_text(path, "mapping file"), where)
    faults = [
        InputError(f"{where}: key", code="I011", value=key, allowed=", ".join(_KNOWN), remedy="remove it")
        for key in data
        if key not in _KNOWN
    ]
    if data.get("schema") != SCHEMA:
        faults.append(
            InputError(
                f"{where}: schema",
                code="F006",
                value=data.get("schema"),
                allowed=SCHEMA,
                remedy="give a file that `stiffarm readings` has written",
            )
        )
    made: dict[str, Any] = {}
    for key in _TEXTS:
        _take(made, data, key, str, "text", faults, where)
    for key in _LIST:
        if key in data:
            value = data[key]
            if isinstance(value, list) and all(isinstance(item, str) for item in value):
                made[key] = tuple(value)
            else:
                faults.append(InputError(f"{where}: {key}", code="I011", value=str(value), allowed="a list of texts"))
    _take(made, data, "header", int, "a line number", faults, where)
    _take(made, data, "sigma_mm", float, "a number", faults, where)
    for key, least in (("header", 1), ("sigma_mm", 0.0)):
        if key in made and not least <= made[key] < math.inf:
            faults.append(InputError(f"{where}: {key}", code="I011", value=made[key], allowed=f"{least:g} or more"))
    if made.get("sigma_mm") == 0.0:
        faults.append(
            InputError(
                f"{where}: sigma_mm", code="I011", value=0, allowed="above 0", remedy="remove it if it is not known"
            )
        )
    for key in ("fill", "columns"):
        table = data.get(key, {})
        if not isinstance(table, dict) or not all(isinstance(item, str) for item in table.values()):
            faults.append(
                InputError(
                    f"{where}: {key}", code="I011", allowed="names with texts", remedy="write every value in quotes"
                )
            )
            continue
        made[key] = dict(table)
    columns = {}
    for name, text in made.get("columns", {}).items():
        try:
            columns[name] = meaning_of(text, f"{where}, column {name!r}", joints)
        except InputError as error:
            faults.append(error)
    raise_any(where, faults)
    return Settings(**made | {"columns": columns})


def _take(
    made: dict[str, Any],
    data: Mapping[str, Any],
    key: str,
    kind: type,
    words: str,
    faults: list[InputError],
    where: str,
) -> None:
    if key not in data:
        return
    value = data[key]
    if kind is float and type(value) is int:
        value = float(value)
    if type(value) is kind:
        made[key] = value
    else:
        faults.append(InputError(f"{where}: {key}", code="I011", value=str(value), allowed=words))


def mapping_text(settings: Settings, source: str) -> str:
    """The TOML of settings; ``source``: the files that it was made from, for its first line."""
    lines = [
        f"# How {one_line(source)} was read. Another file of this layout:",
        "# stiffarm readings FILE --mapping THIS --out table.csv",
        "# A column: MEANING [UNIT] [before|after] [negated] [of TARGET], keep or ignore.",
        f'schema = "{SCHEMA}"',
    ]
    for key in (*_TEXTS, "header", "sigma_mm"):
        value = getattr(settings, key)
        if value is not None:
            lines.append(f"{key} = {_quoted(value) if isinstance(value, str) else value}")
    for key in _LIST:
        if values := getattr(settings, key):
            lines.append(f"{key} = [{', '.join(map(_quoted, values))}]")
    if settings.fill:
        lines += ["", "[fill]", *(f"{_quoted(k)} = {_quoted(v)}" for k, v in settings.fill.items())]
    lines += ["", "[columns]", *(f"{_quoted(k)} = {_quoted(str(v))}" for k, v in settings.columns.items())]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    """A basic string of TOML: with escapes for quotation marks, backslashes and whatever is not printable."""
    out = "".join(
        f"\\{c}"
        if c in '"\\'
        else c
        if c.isprintable()
        else f"\\u{ord(c):04x}"
        if ord(c) < 0x10000
        else f"\\U{ord(c):08x}"
        for c in text
    )
    return f'"{out}"'
