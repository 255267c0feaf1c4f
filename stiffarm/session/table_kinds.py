"""What a file is that somebody gives, told by its first line: so that a table meant for another command says so.

A table is refused only where its header is surely of another kind; whatever is unclear is left to its reader.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from robots import InputError, ModelDescription, load_description
from robots.files.reading import BYTE_ORDER_MARK, read_bytes, read_start

if TYPE_CHECKING:
    from doe.tables.columns import RawTable


class Kind(NamedTuple):
    """A kind of file: what it is in words, its columns, and what takes it; MODEL and FILE stand for names."""

    words: str
    columns: str
    usage: str


DEFLECTIONS: Final = Kind(
    "a table of tool deflections",
    "joint angles, loads as fz_N and readings as dz_mm",
    "`stiffarm calibrate MODEL FILE` (or diagnose, run, rehearse)",
)
TWISTS: Final = Kind(
    "a table of joint twists",
    "joint angles, joint, phase, loads as fz_N and readings as rz_mrad or reflectors",
    "`stiffarm identify MODEL FILE`",
)
PENDANT: Final = Kind(
    "a table of positions",
    "joint angles, x_mm, y_mm and z_mm",
    "`stiffarm robots check MODEL FILE` if they were read at the controller, `stiffarm calibrate MODEL FILE` if by a "
    "tracker",
)
DH: Final = Kind(
    "a table of Denavit-Hartenberg parameters",
    "joint, alpha_deg, a_mm, d_mm and limits",
    "`stiffarm new NAME --mdh FILE` (or --dh)",
)
POSES: Final = Kind(
    "a table of poses without loads and readings", "joint angles", "`stiffarm index MODEL FILE` (or query)"
)
PATH: Final = Kind(
    "a tool path",
    "x_mm, y_mm, z_mm, nx, ny and nz, or APT or G-code",
    "`stiffarm posture MODEL FILE` (or place, post)",
)
PROGRAM: Final = Kind(
    "a robot program", "as `stiffarm post` writes it", "`stiffarm verify MODEL FILE --cell cell.toml`"
)
SURROGATE: Final = Kind("a surrogate", "as `stiffarm fit` writes it", "`stiffarm query FILE --pose ...`")
MODEL: Final = Kind(
    "a model file", "as `stiffarm new` writes it", "`stiffarm robots FILE` to see it; give it where a model is named"
)

# Kinds that each reader takes itself, or has better words for: a table of poses is one of readings not yet complete.
_TAKES: Final = {
    DEFLECTIONS: (DEFLECTIONS, POSES),
    TWISTS: (TWISTS, POSES),
    PENDANT: (PENDANT, POSES),
    POSES: (POSES, DEFLECTIONS, TWISTS, PENDANT),
}
_JOINT: Final = re.compile(r"q_?\d+[a-z]*(_[a-z]+)?|(a|j|joint|axis|theta)_?\d+[a-z]*_(deg|rad)", re.I)
_LOAD: Final = re.compile(r"f[xyz]_[a-z]*N|m[xyz]_[a-z]*Nm+", re.I)
_READ: Final = re.compile(r"d[xyz]_([munµ]?m|inch)|r[xyz]_(m?rad|[munµ]rad)", re.I)
_AT: Final = frozenset(("x_mm", "y_mm", "z_mm"))
_SUFFIXES: Final = {
    **dict.fromkeys((".apt", ".aptsource", ".cls", ".clsf", ".ncl", ".cldata"), PATH),
    **dict.fromkeys((".nc", ".ngc", ".tap", ".cnc", ".mpf", ".gcode", ".eia"), PATH),
    **dict.fromkeys((".urdf", ".xacro"), MODEL),
}
# A joint's table of a model file, in TOML; of a robot, in URDF.
_MODEL: Final = re.compile(rb"^\[\[joint\]\]", re.M)
# Bytes in which a table's header or a mark of the kind stands.
START: Final = 65536
_SCHEMA: Final = re.compile(rb'"schema"\s*:\s*"stiffarm-(program|surrogate)')


def kind_of(path: Path) -> Kind | None:
    """The kind of a file; None where it is no file, cannot be read, or is none of these."""
    if not path.is_file():
        return None
    suffix = path.suffix.lower()
    if suffix == ".xlsx":
        return _of_workbook(path)
    try:
        data = _enough(path, suffix).removeprefix(BYTE_ORDER_MARK)
    except InputError:
        return None
    if suffix == ".toml":
        return MODEL if _MODEL.search(data) else None
    if suffix in (".json", ".csv") and (found := _SCHEMA.search(data[:4096])):
        return PROGRAM if found[1] == b"program" else SURROGATE
    if data[:512].lstrip().startswith((b"<?xml", b"<robot")) and b"<robot" in data:
        return MODEL
    if suffix == ".csv":
        return _of_text(data)
    return _SUFFIXES.get(suffix)


def _enough(path: Path, suffix: str) -> bytes:
    """So much of a file that its kind can be told; joints may stand anywhere in a model's."""
    return read_bytes(path, "file") if suffix == ".toml" else read_start(path, "file", START)


def _of_text(start: bytes) -> Kind | None:
    line = start.decode("utf-8", errors="replace").lstrip("\r\n").split("\n", 1)[0].strip()
    if line.startswith("# stiffarm-program"):
        return PROGRAM
    if line.startswith("# stiffarm motions"):
        return PATH
    mark = next((m for m in ",;\t" if m in line), ",")
    try:
        return of_header(next(csv.reader([line], delimiter=mark), []))
    except csv.Error:
        return None


def _of_workbook(path: Path) -> Kind | None:
    from doe.tables.columns import read_table

    try:
        return of_header(read_table(path).header)
    except InputError:
        return None


def of_header(header: Sequence[str]) -> Kind | None:
    """The kind of table that has these column names; None where that is not clear."""
    names = {name.strip() for name in header}
    has_joints = any(_JOINT.fullmatch(name) for name in names)
    has_load, has_read = (any(p.fullmatch(name) for name in names) for p in (_LOAD, _READ))
    if "alpha_deg" in names and names & {"a_mm", "d_mm"}:
        return DH
    if "reflector" in names or ({"joint", "phase"} <= names and has_load and has_read):
        return TWISTS
    if has_load and has_read:
        return DEFLECTIONS
    if names >= _AT and not has_load:
        return PATH if {"nx", "ny", "nz"} <= names else PENDANT if has_joints else None
    return POSES if has_joints and not has_load and not has_read else None


def expect(
    path: Path, wanted: Kind, *, model: str = "MODEL", better: Callable[[Kind], str | None] = lambda _: None
) -> None:
    """Refuse a file that is surely of another kind than ``wanted``, naming the command that takes it.

    ``model``: the model's name in that command; ``better``: a command line that goes further than the usual one.

    Raises
    ------
    InputError
        It is of another kind.
    """
    found = kind_of(path)
    if found is None or found in _TAKES.get(wanted, (wanted,)):
        return
    usage = better(found) or found.usage
    usage = re.sub(r"\b(MODEL|FILE)\b", lambda m: {"MODEL": model, "FILE": _quoted(path)}[m[1]], usage)
    raise InputError(
        f"{path} is {found.words}", code="A009", allowed=f"{wanted.words} ({wanted.columns})", remedy=f"use {usage}"
    )


def open_table(
    path: Path, kind: Kind, words: str, row: str, *, option: str, model: str = "MODEL", more: str = ""
) -> RawTable:
    """A table of some kind as text; ``words``, ``row``: what messages call it, and what each of its rows is.

    ``option``: what names the file in a command, ``more``: what else to do where there is none.

    Raises
    ------
    InputError
        It is not there, is surely of another kind, or cannot be read.
    """
    from doe.tables.columns import read_table

    if not path.is_file():
        allowed = "an existing CSV or XLSX file"
        raise InputError(option, code="A007", value=str(path), allowed=allowed, remedy=f"check the path{more}")
    expect(path, kind, model=model)
    return read_table(path, words, row)


def are_positions(data: Sequence[object] | None) -> bool:
    """Whether tables, files or data frames, hold positions of targets and not deflections.

    Raises
    ------
    InputError
        Some do, and some do not.
    """
    found = [_is_absolute(one) for one in data or ()]
    if any(found) and not all(found):
        other = next(one for one, positions in zip(data or (), found, strict=True) if not positions)
        raise InputError(
            "measurement tables",
            code="T008",
            value=f"{other if isinstance(other, Path) else 'a data frame'} has no positions (x_mm, y_mm, z_mm), "
            "others have",
            allowed="tables of positions, or tables of deflections",
            remedy="calibrate them one after the other",
        )
    return any(found)


def _is_absolute(table: object) -> bool:
    header: Sequence[str] = [str(name) for name in getattr(table, "columns", ())]
    if (kind_of(table) if isinstance(table, Path) else of_header(header)) is not PENDANT:
        return False
    from doe.absolute.table import is_absolute
    from doe.tables.columns import read_table

    return is_absolute(read_table(table).header if isinstance(table, Path) else header)


def described(name: str) -> ModelDescription:
    """The description of a model by name or from its file.

    Raises
    ------
    InputError
        No such model, or a table or another file of ours in its place.
    """
    # A path with a null character in it is no file, and no table.
    if "\0" not in name and Path(name).suffix.lower() in (".csv", ".xlsx", ".json"):
        expect(Path(name), MODEL)
    return load_description(name)


def _quoted(path: Path) -> str:
    return f'"{path}"' if " " in str(path) else str(path)
