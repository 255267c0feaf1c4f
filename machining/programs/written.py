"""Files of a written program, made when they are asked for; and moves read back from them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from machining.magnitudes import LARGEST
from robots import InputError
from robots.arrays import Array, Bools
from robots.files.written import written_whole

STRAIGHT, IN_ORDER = "motion line after line", "keep moves out of loops, conditions and jumps in the template"
_STRING = re.compile(r'"[^"]*"')


@dataclass(frozen=True, eq=False)
class ProgramFile:
    """A file of a program: ``name``, and ``pieces``, called for its text each time it is needed."""

    name: str
    pieces: Callable[[], Iterator[str]]

    def text(self) -> str:
        """The whole text."""
        return "".join(self.pieces())

    def write(self, path: Path) -> None:
        """Write it piece by piece, whole or not at all."""
        with written_whole(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
            file.writelines(self.pieces())


@dataclass(frozen=True, eq=False)
class Written:
    """A program's files, the main one first, and ``notes``: what a user has to know before it runs."""

    files: tuple[ProgramFile, ...]
    notes: tuple[str, ...]

    def save(self, path_of: Callable[[str], Path]) -> None:
        """Write all files; ``path_of`` gives the place of a name (as ``OutputFolder.path`` does)."""
        for file in self.files:
            file.write(path_of(file.name))

    def texts(self) -> dict[str, str]:
        """All texts by name."""
        return {file.name: file.text() for file in self.files}


@dataclass(frozen=True, eq=False)
class ReadMoves:
    """n moves of a program as its file has them.

    ``words`` (n, k): coordinates, mm and deg (RAPID's quaternion without unit); ``external`` (n, e) mm and deg;
    ``configuration``: a tuple a move, empty where there is none; ``speed`` (n,) m/s, ``duration`` (n,) s, either NaN
    where the file does not say; ``joint`` (n,) joint moves.
    """

    kind: str
    words: Array
    external: Array
    configuration: tuple[tuple[object, ...], ...]
    speed: Array
    duration: Array
    joint: Bools


class Collector:
    """Collects moves while a file is read."""

    def __init__(self) -> None:
        self.kind = ""
        self._words: list[Sequence[float]] = []
        self._external: list[Sequence[float]] = []
        self._configuration: list[tuple[object, ...]] = []
        self._speed: list[float] = []
        self._duration: list[float] = []
        self._joint: list[bool] = []

    def add(
        self,
        where: str,
        kind: str,
        words: Sequence[float],
        external: Sequence[float],
        configuration: tuple[object, ...] = (),
        *,
        joint: bool,
        speed: float = np.nan,
        duration: float = np.nan,
    ) -> None:
        """Add a move; ``where`` names its place. Raises InputError for another kind or number of axes than before."""
        if self.kind and kind != self.kind:
            raise InputError(f"{where}: {kind} coordinates after {self.kind} ones", allowed="one kind in a program")
        self.kind = kind
        if self._words and (len(words), len(external)) != (len(self._words[0]), len(self._external[0])):
            raise InputError(
                f"{where}: {len(words)} + {len(external)} coordinates", allowed="as many as in other moves"
            )
        self._words.append(words)
        self._external.append(external)
        self._configuration.append(configuration)
        self._speed.append(speed)
        self._duration.append(duration)
        self._joint.append(joint)

    def moves(self) -> ReadMoves:
        """The result. Raises InputError where nothing was read, or a number is not finite."""
        if not self._words:
            raise InputError("program", value="no move in it", allowed="one or more")
        words, external = np.array(self._words), np.array(self._external).reshape(len(self._words), -1)
        if not (np.isfinite(words).all() and np.isfinite(external).all()):
            raise InputError("coordinate in a program", allowed="finite numbers")
        speed, duration = np.array(self._speed), np.array(self._duration)
        return ReadMoves(self.kind, words, external, tuple(self._configuration), speed, duration, np.array(self._joint))


def called(files: Mapping[str, str], calls: Sequence[str], suffix: str) -> list[tuple[str, str]]:
    """Name and text of the files called, in their order. Raises InputError for one that is not there."""
    by_stem = {name.rsplit("/", 1)[-1].removesuffix(suffix).lower(): name for name in files if name.endswith(suffix)}
    missing = [call for call in calls if call.lower() not in by_stem]
    if missing:
        raise InputError("sub-program", value=missing[0], allowed="a file of the program", remedy="give all its files")
    return [(by_stem[call.lower()], files[by_stem[call.lower()]]) for call in calls]


def number(where: str, text: str) -> float:
    """A number that a program can hold. Raises InputError for anything else."""
    try:
        value = float(text) if text.isascii() and "_" not in text else np.nan
    except ValueError as error:
        raise InputError(where, value=text.strip(), allowed="a number") from error
    if not abs(value) <= LARGEST:
        raise InputError(where, value=text.strip(), allowed=f"a finite number of at most {LARGEST:g}")
    return value


def whole(where: str, text: str) -> int:
    """A whole number. Raises InputError for anything else."""
    value = number(where, text)
    if value != int(value):
        raise InputError(where, value=text.strip(), allowed="a whole number")
    return int(value)


@dataclass(frozen=True)
class Language:
    """What of a controller's language a reader must not pass over.

    ``comment``: sign that starts one; ``motion``: words that move, anywhere in a line; ``opens`` and ``closes``: of
    loops and conditions; ``jumps``.
    """

    comment: str
    motion: re.Pattern[str]
    opens: re.Pattern[str]
    closes: re.Pattern[str]
    jumps: re.Pattern[str]

    def program(
        self, files: Mapping[str, str], main: tuple[str, str], call: re.Pattern[str], suffix: str
    ) -> Iterator[Statement]:
        """Statements of a main file (name and text), then of the sub-programs that its lines ``call`` in their order.

        Errors as :meth:`statements` and :func:`called`.
        """
        calls = [found[1] for line in main[1].splitlines() if (found := call.match(line)) is not None]
        for source, body in [main, *called(files, calls, suffix)]:
            yield from self.statements(source, body)

    def statements(self, source: str, body: str) -> Iterator[Statement]:
        """The lines of a file, without comments.

        Raises
        ------
        InputError
            A jump: the order of the lines is not that of the motion.
        """
        depth = 0
        for i, line in enumerate(body.splitlines(), 1):
            code = _STRING.sub('""', line).partition(self.comment)[0]
            where = f"{source}, line {i}"
            if self.jumps.search(code):
                raise InputError(f"{where}: a jump", value=code.strip()[:80], allowed=STRAIGHT, remedy=IN_ORDER)
            depth += len(self.opens.findall(code)) - len(self.closes.findall(code))
            yield Statement(where, line, code, depth > 0, self.motion.search(code) is not None)


@dataclass(frozen=True)
class Statement:
    """A line: ``where`` it stands, its ``text``, its ``code`` without comment, within a loop or condition, motion."""

    where: str
    text: str
    code: str
    nested: bool
    moves: bool

    def check_read(self, allowed: str, *, read: bool) -> None:
        """Raise InputError where motion is not read, or would run once for each turn of a loop, or not at all."""
        if self.moves and not read:
            raise InputError(self.where, value=self.code.strip()[:80], allowed=allowed)
        if self.nested and self.moves:
            what = f"{self.where}: motion within a loop or a condition"
            raise InputError(what, value=self.code.strip()[:80], allowed=STRAIGHT, remedy=IN_ORDER)


def main_file(files: Mapping[str, str], suffix: str) -> tuple[str, str]:
    """Name and text of the first file of a kind. Raises InputError where there is none."""
    for name, text in files.items():
        if name.endswith(suffix):
            return name, text
    raise InputError("files of a program", value=", ".join(files) or "none", allowed=f"a main file *{suffix} first")
