"""The one place that opens what a user gives: ordinary files of bounded size, each read once and hashed as read.

A file that changes or vanishes while a command runs cannot be recorded wrongly, nor take the results with it: within
:func:`recording` every file is read once, later readers get the same bytes, and its hash is that of those bytes.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import stat
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

from robots.errors import InputError, shortened, twice
from robots.files.published import heal_above

# Far above any model, table or tool path (170 bytes of memory a move); a mesh of a million triangles has 50 MB.
LARGEST_FILE = 256 * 2**20
# Bytes kept for later readers of the same file; beyond that a file is read again and must still be the same.
MOST_KEPT = 16 * 2**20
# No file of ours nests deeper than ten; parsers and those who walk their results recurse.
DEEPEST = 64
# Beyond 64 bits whole numbers fit no array.
_LARGEST_WHOLE = 2**63 - 1
_SCALARS = {int, float, bool, type(None)}
# A key of more parts than that; in a list of numbers commas stand between the dots.
_DOTTED = re.compile(rf"""(?<![\w.-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{DEEPEST}}}""")
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


@dataclass
class Ledger:
    """What was read: ``sha256`` of each file by its absolute path, in the order of reading."""

    sha256: dict[str, str] = field(default_factory=dict)
    _kept: dict[str, bytes] = field(default_factory=dict)
    _room: int = MOST_KEPT

    def kept(self, place: str) -> bytes | None:
        """The bytes read before, if they were kept."""
        return self._kept.get(place)

    def enter(self, place: str, data: bytes) -> bool:
        """Record a file as read; False if it was read before with another content."""
        found = hashlib.sha256(data).hexdigest()
        if self.sha256.setdefault(place, found) != found:
            return False
        if place not in self._kept and len(data) <= self._room:
            self._kept[place] = data
            self._room -= len(data)
        return True

    def of(self, path: Path) -> str | None:
        """SHA-256 of a file as it was read, None if it was not."""
        return self.sha256.get(_place(path))


_ledger: ContextVar[Ledger | None] = ContextVar("ledger", default=None)


@contextmanager
def recording() -> Iterator[Ledger]:
    """Within this every file is read once and its hash kept; inside another recording it is that one."""
    around = _ledger.get()
    if around is not None:
        yield around
        return
    ledger = Ledger()
    token = _ledger.set(ledger)
    try:
        yield ledger
    finally:
        _ledger.reset(token)


def recorded() -> Ledger | None:
    """The ledger of the recording around, if there is one."""
    return _ledger.get()


def read_bytes(
    path: Path | str, kind: str, *, most: int = LARGEST_FILE, remedy: str = "check the path", kept: bool = True
) -> bytes:
    """Content of an ordinary file.

    Parameters
    ----------
    path : the file; links to files are followed
    kind : what it is to the user ("measurement file"); begins the message of an error
    most : largest size in bytes
    remedy : what to do if it cannot be read
    kept : False where a file that changes is meant (what the program itself has just written)

    Results of a killed run that were moving into the file's folder are put right first (:mod:`robots.files.published`).

    Raises
    ------
    InputError
        There is no such file, it is a folder, a pipe or a device, it is larger than ``most``, it may not be read, or
        it has changed since it was read first in this recording.
    """
    ledger = _ledger.get() if kept else None
    place = _place(path)
    if ledger is not None and (before := ledger.kept(place)) is not None:
        return before
    data = _read(path, kind, most, remedy)
    if ledger is not None and not ledger.enter(place, data):
        raise InputError(
            f"{kind} {path} has changed while this command was running", code="F003", remedy="run the command again"
        )
    return data


def read_start(path: Path | str, kind: str, size: int) -> bytes:
    """The first ``size`` bytes of an ordinary file of any size, not recorded; errors as :func:`read_bytes`."""
    return _read(path, kind, None, "check the path", size)


def read_sha256(path: Path | str, kind: str, *, remedy: str = "check the path") -> str:
    """SHA-256 of an ordinary file; arguments and errors as :func:`read_bytes`."""
    return hashlib.sha256(read_bytes(path, kind, remedy=remedy)).hexdigest()


def read_text(
    path: Path | str, kind: str, *, most: int = LARGEST_FILE, remedy: str = "check the path", kept: bool = True
) -> str:
    """Text of a UTF-8 file, with or without a byte order mark; arguments and errors as :func:`read_bytes`."""
    data = read_bytes(path, kind, most=most, remedy=remedy, kept=kept).removeprefix(BYTE_ORDER_MARK)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{kind} {path} cannot be read (no UTF-8 text from byte {error.start} on)",
            code="F004",
            remedy="save it as UTF-8 text",
        ) from error


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Parse TOML; raises InputError with the place of a syntax error, ``where`` naming the file.

    Whole numbers beyond 64 bits and tables nested deeper than :data:`DEEPEST` are refused.
    """
    remedy = "mend the file at that line"
    try:
        _check_keys(text)
        data = tomllib.loads(text.removeprefix("\ufeff"))
        _check_content(data)
    except (ValueError, RecursionError) as error:
        reason = _reason(error)
        if closed := _closed_list(text, reason):
            reason, remedy = f"{closed} is above it", f"remove the line {closed}"
        raise InputError(f"{where} is not valid TOML ({reason})", code="F005", remedy=remedy) from error
    return data


def _closed_list(text: str, reason: str) -> str | None:
    """The line ``link = []`` that stands in the way of the table [[link]] of which a parser complains."""
    line = re.search(r"immutable namespace.*line (\d+)", reason)
    table = line and re.match(r"\s*\[\[\s*([\w-]+)", text.splitlines()[int(line[1]) - 1])
    return f"{table[1]} = []" if table and re.search(rf"^{table[1]}\s*=\s*\[\s*\]", text, re.M) else None


def parse_json(text: str, where: str, *, remedy: str = "mend the file at that place") -> Any:
    """Parse JSON; raises InputError with the place of a syntax error, ``where`` naming the file.

    NaN, infinite numbers (``1e999`` too), whole numbers beyond 64 bits, a key twice in one object, and nesting deeper
    than :data:`DEEPEST` are refused: none of them is a value that a program wrote on purpose.
    """
    try:
        data = _loaded(text)
        if not _check_content(data):
            # Once more, to say which number it is.
            _loaded(text, _finite)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where} is not valid JSON ({_reason(error)})", code="F005", remedy=remedy) from error
    return data


def _loaded(text: str, number: Callable[[str], float] | None = None) -> Any:
    """JSON without constants that are no numbers and without a key twice; ``number`` reads floats."""
    return json.loads(
        text.removeprefix("\ufeff"), parse_constant=_no_constant, parse_float=number, object_pairs_hook=_each_once
    )


def _place(path: Path | str) -> str:
    try:
        return os.path.realpath(path)
    except (OSError, ValueError):
        return str(path)


def _read(path: Path | str, kind: str, most: int | None, remedy: str, start: int = -1) -> bytes:
    """Read a file as :func:`_ordinary` does; what the system says against it becomes one error."""
    heal_above(Path(_place(path)))
    try:
        return _ordinary(path, kind, most, remedy, start)
    except (OSError, ValueError) as error:  # ValueError: no path at all, as with a null character in it
        if isinstance(error, InputError):
            raise
        reason = "it does not exist" if isinstance(error, FileNotFoundError) else getattr(error, "strerror", None)
        raise InputError(f"{kind} {path} cannot be read ({reason or error})", code="F001", remedy=remedy) from error


def _ordinary(path: Path | str, kind: str, most: int | None, remedy: str, start: int = -1) -> bytes:
    """Read a file that is neither folder, pipe nor device; opening one of these would wait for ever, or never end.

    ``most``: its largest size; None: any, and only ``start`` bytes of it are read.
    """
    # Without O_NONBLOCK opening a pipe waits for its other end.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)
    if not stat.S_ISREG(mode := os.stat(path).st_mode):
        what = "a folder" if stat.S_ISDIR(mode) else "a pipe, socket or device"
        raise InputError(
            f"{kind} {path} cannot be read (it is {what})",
            code="F001",
            allowed="an ordinary file",
            remedy=remedy if stat.S_ISDIR(mode) else "save what comes from there as a file, and give that",
        )
    with os.fdopen(os.open(path, flags), "rb") as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):  # it was changed between the two calls
            raise InputError(f"{kind} {path} cannot be read (no ordinary file)", code="F001", remedy=remedy)
        if most is None:
            return file.read(start)
        data = file.read(status.st_size + 1) if status.st_size <= most else b""
        # A file may be longer than it says, as those in /proc; one byte more than allowed tells.
        if len(data) > status.st_size:
            data += file.read(most + 1 - len(data))
    if status.st_size > most or len(data) > most:
        raise InputError(
            f"{kind} {path}: size",
            code="F002",
            value=f"{max(status.st_size, len(data))} bytes",
            allowed=f"up to {most} bytes",
            remedy="split it, or leave out what is not needed",
        )
    return data


def _check_keys(text: str) -> None:
    """Refuse keys of too many parts before tomllib takes minutes over one of a hundred thousand."""
    if _DOTTED.search(text):
        raise ValueError(f"nested more than {DEEPEST} deep")


def _check_content(data: object) -> bool:
    """Refuse what is nested deeper than :data:`DEEPEST`, and whole numbers of no array; whether all are finite."""
    level: list[Any] = [[data]]
    finite = True
    for _ in range(DEEPEST + 1):
        inner = [
            node
            for outer in level
            for node in (outer.values() if isinstance(outer, dict) else () if _plain(outer) else outer)
        ]
        for node in inner:
            if type(node) is int and not -_LARGEST_WHOLE <= node <= _LARGEST_WHOLE:
                raise ValueError(f"the whole number {shortened(str(node), 20)} is beyond 64 bits")
            finite = finite and (type(node) is not float or math.isfinite(node))
        level = [node for node in inner if type(node) in (dict, list)]
        if not level:
            return finite
    raise ValueError(f"nested more than {DEEPEST} deep")


def _plain(row: list[Any]) -> bool:
    """Whether a list has nothing but numbers, all of them of a usual size: most rows of a table."""
    return _SCALARS.issuperset(map(type, row)) and max(map(abs, filter(None, row)), default=0) <= _LARGEST_WHOLE


def _reason(error: Exception) -> str:
    if isinstance(error, RecursionError):
        return f"nested more than {DEEPEST} deep"
    # Python's own words on numbers of thousands of digits advise on Python.
    return "a whole number beyond 64 bits" if "sys.set_int_max_str_digits" in str(error) else str(error)


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:20]} is beyond the largest number")
    return value


def _each_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError(f"key {twice(key for key, _ in pairs)[0][:40]!r} stands twice in one object")
    return found
