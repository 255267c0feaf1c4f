"""The command `readings`: what instruments and people write, made a measurement table."""

from __future__ import annotations

import datetime as dt
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from doe.instruments.convert import Converted, convert, meaning_words
from doe.instruments.mapping_file import Settings, mapping_text, read_mapping
from doe.instruments.meanings import meaning_of
from doe.instruments.times import FORMS
from doe.instruments.values import Column
from fem.arm import Arm
from robots import InputError, require_positive
from robots.files.csv_text import write_rows
from robots.files.written import written_whole
from robots.quantities import ranged, rounded
from robots.robot import robot_from
from stiffarm.capability import called, capability_without_arm
from stiffarm.request import NAMES, PAIR, READINGS, TEXT, Kind, Request, argument, option, united
from stiffarm.result import Result, Table
from stiffarm.session.table_kinds import described

if TYPE_CHECKING:
    import pandas as pd

MAPPING: Final = ".mapping.toml"
COLUMNS: Final = "Columns"
LAYOUT: Final = "Layout of the files"


def _lines(text: str, name: str) -> tuple[int, ...]:
    found = re.fullmatch(r"\s*(\d{1,9})\s*-\s*(\d{1,9})\s*", text, re.ASCII)
    return _in_order((int(found[1]), int(found[2])) if found else text, name)


def _in_order(value: Any, name: str) -> tuple[int, ...]:
    if not (
        isinstance(value, Sequence) and not isinstance(value, str) and len(value) == 2 and 0 < value[0] <= value[1]
    ):
        allowed = "first and last line, as in 8-40"
        raise InputError(name, code="A004", value=value, allowed=allowed, remedy="count lines from 1")
    return tuple(value)


@dataclass(frozen=True, kw_only=True)
class ReadingsRequest(Request):
    r"""Make a measurement table from instrument files or sheets.

    Reads exports of laser trackers, controllers' logs and sheets filled in by hand, and writes a table that
    `calibrate` and `diagnose` read, with a mapping file for the next file of the same layout. Anything ambiguous is
    refused, with the option that settles it.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> import stiffarm as sa
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "dial.txt"
    >>> head, *read = "J1;J2;J3;Load;Dial before;Dial after", "0;-90;30;20;1,000;0,705", "10;-80;40;20;1,000;0,612"
    >>> _ = file.write_text("\n".join([head, *read]))
    >>> columns = {"Load": "hung kg", "Dial before": "dz mm before", "Dial after": "dz mm after"}
    >>> made = sa.convert_readings(file, columns=columns, units=["deg"])
    >>> made.to_frame()["dz_mm"].tolist()
    [-0.295, -0.388]
    """

    files: Sequence[Path | str] | Path | str = argument(
        "Files from an instrument or filled in by hand: text with any separator, or XLSX. Joint angles may be in a "
        "separate file.",
        READINGS,
        metavar="FILE...",
        required=True,
        several=True,
    )
    out: Path | None = option("Table to write (CSV). Default: none; only show how the files are understood.")
    arm: Arm | Path | str | None = option(
        "Arm that was measured: its joint names are used, and its limits are checked.",
        TEXT,
        spelled=("--model",),
        metavar="MODEL",
    )
    mapping: Path | None = option(
        "Mapping file (TOML) that an earlier run wrote with its table. Default: none.", READINGS
    )
    kind: str | None = option("Table to make: deflections or positions. Default: what the columns hold.")
    replace: bool = option("Replace an existing table; the old one moves to previous/TIME beside it.", default=False)
    columns: Mapping[str, str] | Sequence[Mapping[str, str]] = option(
        "What a column holds, as in 'Dial 1=dz um before', 'Load=hung kg', 'A3=q3 deg' or 'Note=ignore'. May be "
        "repeated.",
        PAIR,
        several=True,
        spelled=("--column",),
        metavar="NAME=MEANING",
        group=COLUMNS,
    )
    units: Sequence[str] | None = option("Units of columns that state none, as in mm,deg,N.", NAMES, group=COLUMNS)
    fill: Mapping[str, str] | Sequence[Mapping[str, str]] = option(
        "A value for all rows that no file contains, as in 'session=day 1' or 'hung=20 kg'. May be repeated.",
        PAIR,
        several=True,
        group=COLUMNS,
    )
    sigma_mm: float | None = option(
        "Standard deviation of one reading of a coordinate, in mm. Default: from a column, otherwise none.",
        group=COLUMNS,
    )
    axes: str | None = option(
        "Axes of an instrument whose positions are subtracted: base, their orientation A,B,C in the base frame, in deg "
        "about fixed x, then y, then z, or found (from the positions without a load, with --model).",
        group=COLUMNS,
    )
    target: str | None = option("Use the readings of this target only.", group=COLUMNS)
    join: str | None = option(
        "How joint angles of one file find the readings of another: pose (same label) or order (row by row). Default: "
        "pose, if both have it.",
        group=COLUMNS,
    )
    names: Sequence[str] | None = option(
        "Names of the columns of a file without any, separated by commas, as in pose,target,x_mm,y_mm,z_mm.",
        NAMES,
        group=LAYOUT,
    )
    header: int | None = option("Line with the names of the columns. Default: found.", group=LAYOUT)
    rows: Sequence[int] | None = option(
        "First and last line of the readings, as in 8-40. Default: all below the names.",
        Kind("FIRST-LAST", _lines, _in_order),
        group=LAYOUT,
    )
    sheets: Sequence[str] | str = option(
        "Sheet of a workbook. May be repeated. Default: the one that holds readings.",
        TEXT,
        several=True,
        spelled=("--sheet",),
        group=LAYOUT,
    )
    encoding: str | None = option("Encoding, as in utf-8, utf-16 or windows-1252. Default: found.", group=LAYOUT)
    separator: str | None = option(
        "Separator: comma, semicolon, tab, bar, blank (one or more) or blanks (two or more). Default: found.",
        group=LAYOUT,
    )
    decimal: str | None = option("Decimal mark: point or comma. Default: found if the numbers settle it.", group=LAYOUT)

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive("--sigma-mm", self.sigma_mm, "mm", code="A001")

    def settings(self, joints: Sequence[str]) -> Settings:
        """What was said of the files, in front of what the mapping file says; ``joints``: those that may be named."""
        columns, fill = united(self.columns, "--column"), united(self.fill, "--fill")  # type: ignore[arg-type]
        given = {one.name: getattr(self, one.name) for one in fields(Settings)}
        given |= {name: tuple(given[name] or ()) for name in ("names", "units")}
        given["columns"] = {name: meaning_of(text, f"--column {name}", joints) for name, text in columns.items()}
        own = Settings(**given | {"fill": fill})
        return own if self.mapping is None else own.over(read_mapping(self.mapping, joints))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ConvertedReadings(Result):
    """A measurement table made of files. ``save`` writes it, with the mapping for the next file of this layout."""

    found: Converted

    @property
    def kind(self) -> str:
        """What it holds: "deflections", as `read_readings` takes them, or "positions"."""
        return self.found.kind

    @property
    def meanings(self) -> dict[str, str]:
        """What each column was taken as."""
        return {column.name: str(column.meaning) for column in self.found.columns}

    def __len__(self) -> int:
        return len(self.found.rows)

    def to_frame(self, table: str | None = None) -> pd.DataFrame:
        """The table, one row a reading, NaN where a number was not read; or the table of the result of this name."""
        import pandas as pd

        if table is not None:
            return super().to_frame(table)
        ranges, cells = self.found.ranges(), zip(*self.found.rows, strict=True)
        return pd.DataFrame(
            {
                name: np.array([float(cell) if cell else np.nan for cell in column]) if name in ranges else list(column)
                for name, column in zip(self.found.header, cells, strict=True)
            }
        )

    def save(self, folder: str | Path, *, replace: bool = False) -> Path:
        """Write the table, a file that ends in .csv, and beside it its mapping file; returns the table's path.

        ``replace``: an existing table moves to previous/TIME beside it.

        Raises
        ------
        InputError
            The file exists already and may not be replaced, or cannot be written.
        """
        with called():
            _write(self.found, Path(folder), first=True, replace=replace)
        return Path(folder)


def answer(asked: ReadingsRequest) -> ConvertedReadings:
    """The table made of the files, which is written if there is a place for it."""
    robot = None
    if asked.arm is not None:
        robot = asked.arm.robot if isinstance(asked.arm, Arm) else robot_from(described(str(asked.arm)))
    first, files = asked.mapping is None, [Path(file) for file in asked.files]  # type: ignore[union-attr]
    out = None if asked.out is None else Path(asked.out)
    settings = asked.settings(robot.angle_names if robot else ())
    if out is not None:  # before any work
        _check_place(out, files, first=first, replace=asked.replace)
    made = convert(files, settings, robot)
    mapping, previous = None, None
    what_next = "Nothing was written; --out table.csv writes the table."
    if out is not None:
        mapping, previous = _write(made, out, first=first, replace=asked.replace)
        also = f", and {mapping} for the next file of this layout (--mapping)" if mapping else ""
        moved = f" The old table was moved to {previous}." if previous else ""
        model = asked.arm if isinstance(asked.arm, str) else "MODEL"
        what_next = f"Written: {out}{also}.{moved} Next: stiffarm calibrate {model} {out} --out calibrated"
    ranges = made.ranges()
    columns = {
        "column": [c.name for c in made.columns],
        "taken_as": [meaning_words(c.meaning) for c in made.columns],
        "why": [c.why for c in made.columns],
        "range_in_the_table": [_range(c) for c in made.columns],
    }
    more: dict[str, Sequence[Any]] = {
        "file": [c.file for c in made.columns],
        "meaning": [str(c.meaning) for c in made.columns],
        "empty": [c.empty for c in made.columns],
        "lowest": [rounded(c.lowest) for c in made.columns],
        "highest": [rounded(c.highest) for c in made.columns],
    }
    ends: dict[str, Sequence[Any]] = {
        end: [ranges.get(name, (None, None))[i] for name in made.header] for i, end in enumerate(("lowest", "highest"))
    }
    return ConvertedReadings(
        name="readings",
        title=made.source,
        question="how are the files understood?",
        answer=f"{len(made.rows)} readings: a table of {made.kind} with {len(made.header)} columns.",
        what_next=what_next,
        facts={
            "kind": made.kind,
            "readings": len(made.rows),
            **{key: path and str(path) for key, path in (("table", out), ("mapping", mapping), ("previous", previous))},
        },
        tables=(
            Table(
                "files", "Files", {"file": list(made.files), "read_as": list(map("; ".join, made.files.values()))}, {}
            ),
            Table("columns", "Columns", columns, {}, extra=more),
            Table("written", "Columns of the table", {"column": made.header}, {}, extra=ends, folded=True),
        ),
        remarks=made.notes,
        found=made,
    )


def _range(column: Column) -> str:
    empty = f"{column.empty} empty" if column.empty else ""
    known = math.isfinite(column.lowest) and column.meaning.unit not in FORMS
    return "; ".join(filter(None, (ranged(column.lowest, column.highest, digits=4) if known else "", empty)))


def _check_place(out: Path, files: Sequence[Path], *, first: bool, replace: bool) -> list[Path]:
    """Files that stand where a table of ``files`` is to be written, and may be moved.

    Raises
    ------
    InputError
        They may not, or it is no place for a table.
    """
    allowed, remedy = "", "choose another name"
    if out.suffix.lower() != ".csv" or out.is_dir() or not out.parent.is_dir():
        allowed, remedy = "a file ending in .csv, in an existing folder", "choose another name, or make the folder"
    elif any(file.exists() and out.exists() and os.path.samefile(file, out) for file in files):
        allowed = "a file other than those that are read"
    if allowed:
        raise InputError("--out", code="F009", value=str(out), allowed=allowed, remedy=remedy)
    old = [path for path in (out, out.with_name(out.stem + MAPPING))[: 1 + first] if os.path.lexists(path)]
    if old and not replace:
        raise InputError(
            f"{' and '.join(map(str, old))}: it exists already",
            code="F009",
            allowed="a new file",
            remedy="choose another name with --out, or give --replace: the old one is then kept in previous/",
        )
    return old


def _write(made: Converted, out: Path, *, first: bool, replace: bool) -> tuple[Path | None, Path | None]:
    """Write the table, with ``first`` the mapping file beside it too; returns that, and where old ones went.

    Raises
    ------
    InputError
        It may not or cannot be written there; then nothing is.
    """
    old, previous = _check_place(out, (), first=first, replace=replace), None
    mapping = out.with_name(out.stem + MAPPING) if first else None
    try:
        with written_whole(out) as draft:
            with draft.open("w", encoding="utf-8", newline="") as stream:
                write_rows(stream, [made.header, *made.rows])
            if old:
                previous = out.parent / "previous" / dt.datetime.now(dt.UTC).strftime("%Y%m%dT%H%M%S.%fZ")
                previous.mkdir(parents=True)
                for path in old:
                    os.link(path, previous / path.name, follow_symlinks=False)
            if mapping is not None:
                with written_whole(mapping) as other:
                    other.write_text(mapping_text(made.settings, made.source), encoding="utf-8")
    except OSError as error:
        why = f"table {out} cannot be written ({error.strerror or error})"
        raise InputError(why, code="F008", remedy="choose another place with --out") from error
    return mapping, previous


convert_readings = capability_without_arm("readings", ReadingsRequest, answer, function="convert_readings")
