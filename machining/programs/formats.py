"""The formats by name; programs written, read back, and compared with what they were written from.

Every module of :mod:`machining.programs.languages` is a format: ``krl`` (KUKA), ``rapid`` (ABB), ``val3`` (Staubli),
``sinumerik`` (Siemens; joint programs only), and the neutral ``json`` (everything; what a verification reads) and
``csv``, which hold both kinds of coordinates at once.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path, PurePath

from machining.cell import Cell
from machining.cell.schema import Strict
from machining.programs import languages
from machining.programs.controller import Controller
from machining.programs.format import Format, Neutral, RoundTrip, Written, digest
from machining.programs.job import Kind, external_count
from machining.programs.program import Fault, JointProgram
from machining.programs.replay import held_against, replayed
from machining.programs.write_options import NAME_KEYS, WriteOptions
from robots import InputError, Robot, require_one_of
from robots.files.reading import parse_json, parse_toml, read_text
from robots.files.validated import tuples, validated

_FOUND: list[Format] = [
    importlib.import_module(f"{languages.__name__}.{module.name}").FORMAT
    for module in pkgutil.iter_modules(languages.__path__)
]
# Those of controllers first, each by its name.
FORMATS: dict[str, Format] = {f.name: f for f in sorted(_FOUND, key=lambda f: (f.neutral, f.name))}
# Main files of controllers' programs, by their endings.
CONTROLLERS: dict[str, Controller] = {
    PurePath(f"x{f.grammar.main}").suffix.lower(): f for f in FORMATS.values() if isinstance(f, Controller)
}
# What a verification reads, by the ending of the file.
NEUTRAL: dict[str, Neutral] = {f".{f.name}": f for f in FORMATS.values() if isinstance(f, Neutral)}


def format_of(name: str, kind: str) -> Format:
    """The format of a name. Raises InputError for an unknown name, or a kind that it does not write."""
    require_one_of("format of programs", name, FORMATS, code="Q002")
    FORMATS[name].check_kind(kind)
    return FORMATS[name]


def write_program(
    program: JointProgram,
    name: str,
    kind: Kind = "cartesian",
    options: WriteOptions | None = None,
    templates: str | Path | None = None,
) -> Written:
    """Write a program; the texts are made when the files are written.

    Parameters
    ----------
    name : of the format
    kind : "cartesian" (tool frames in the part frame) or "joint"; neutral formats hold both
    templates : a folder whose templates come before the bundled ones

    Raises
    ------
    InputError
        Unknown format or kind; an arm whose convention on that controller is not known; moves without a feed; external
        axes that the format cannot hold; an arm without a spherical wrist in a Cartesian program; names that mean
        something in the language.
    """
    chosen, o = format_of(name, kind), options or WriteOptions()
    chosen.check(program.robot, external_count(program), o)
    return chosen.write(program, kind, o, None if templates is None else Path(templates))


def round_trip(
    program: JointProgram, files: Mapping[str, str], name: str, kind: Kind, options: WriteOptions | None = None
) -> RoundTrip:
    """Read a program and compare it with what it was written from.

    ``files``: texts by name, the main one first, as :meth:`Written.texts` gives them.

    Raises
    ------
    InputError
        What the readers refuse, or another number of moves than was written.
    """
    return format_of(name, kind).round_trip(program, files, kind, options or WriteOptions())


# Bytes of a neutral program: a million moves are 300 MB of JSON.
LARGEST = 2**30


def read_program(
    path: Path, robot: Robot, cell: Cell, options: WriteOptions | None = None, against: Path | None = None
) -> JointProgram:
    """A program for the robot and cell that it was written for: a neutral one, or the main file of a controller's.

    ``against``: the neutral program that a controller's is held against; see :mod:`machining.programs.replay`.

    Raises
    ------
    InputError
        Another kind of file, what the readers refuse, and ``against`` beside a neutral program.
    """
    kind = path.suffix.lower()
    if kind in NEUTRAL and against is None:
        return NEUTRAL[kind].program(read_text(path, "program", most=LARGEST), robot, cell, path.name)
    language = CONTROLLERS.get(kind)
    if language is None:
        raise InputError(
            f"program {path.name}",
            code="Q002",
            value=kind or "no ending",
            allowed=f"{' or '.join(CONTROLLERS if kind in NEUTRAL else [*NEUTRAL, *CONTROLLERS])}",
            remedy="give a program that `stiffarm post` wrote, its main file where it has several",
        )
    options, stem = options or WriteOptions(), path.stem.lower()
    others = sorted(path.parent.iterdir()) if path.is_file() else []
    mine = [file for file in others if file != path and (kind == ".pgx" or file.stem.lower().startswith(f"{stem}_"))]
    files = {file.name: read_text(file, "program", most=LARGEST) for file in (path, *mine) if file.is_file()}
    found = replayed(language, files, robot, cell, options, path.name)
    record = path.resolve().parent.parent / "post.json"
    edited = tuple(Fault(0, f"{name} was changed after it was posted") for name in changed_since(record, path))
    found = replace(found, faults=(*found.faults, *edited))
    if against is None:
        return found
    return held_against(found, read_program(against, robot, cell), language, files, options)


def neutral_twin(program: Path) -> Path | None:
    """The neutral program that ``post`` wrote in the same run as a controller's; None where there is none."""
    folder = program.resolve().parent.parent / "json"
    found = sorted(folder.glob("*.json")) if program.suffix.lower() in CONTROLLERS else []
    return found[0] if len(found) == 1 else None


def changed_since(record: Path, program: Path) -> tuple[str, ...]:
    """Files of a program that are not as ``post`` wrote them, by the checksums in its ``post.json``."""
    if not record.is_file():
        return ()
    said: object = parse_json(read_text(record, "post.json", most=LARGEST), "post.json")
    programs = said.get("programs") if isinstance(said, dict) else None
    # A list of programs, in files of version 1 by the folder's name.
    named = (
        {one.get("program"): one for one in programs if isinstance(one, dict)}
        if isinstance(programs, list)
        else programs
    )
    one = named.get(program.parent.name) if isinstance(named, dict) else None
    said = one.get("sha256") if isinstance(one, dict) else None
    if not isinstance(said, dict) or program.name not in said:
        return ()
    files = {name: program.parent / Path(str(name)).name for name in said}
    return tuple(
        name
        for name, file in files.items()
        if not file.is_file() or digest(read_text(file, "program", most=LARGEST)) != said[name]
    )


def read_options(path: str | Path) -> WriteOptions:
    """Options of a TOML file, or of a JSON file (by its suffix).

    Raises
    ------
    InputError
        The file cannot be read, or keys do not fit.
    """
    file = Path(path)
    parse = parse_json if file.suffix.lower() == ".json" else parse_toml
    return parse_options(parse(read_text(file, "options"), str(file)), str(file))


def parse_options(data: object, where: str) -> WriteOptions:
    """Options from the table of a file; ``where`` names it in messages. Errors as :func:`read_options`."""
    given = tuples(data)
    tables: dict[str, Strict] = {}
    if isinstance(given, Mapping):
        for key, model in (f.table for f in FORMATS.values() if f.table is not None):
            if key in given:
                tables[key] = validated(model, given[key], where, table=key)
        given = {key: value for key, value in given.items() if key not in tables}
    options = validated(WriteOptions, given, where)
    words = {word for f in FORMATS.values() for word in f.words}
    for key in NAME_KEYS:
        if getattr(options, key).lower() in words:
            raise InputError(
                f"{where}, {key}",
                code="Q004",
                value=getattr(options, key),
                allowed="no word of a language",
                remedy="correct it in the file",
            )
    return options.with_tables(tables)
