"""Moves read back from the files of a written program, by what a reader knows of its language."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from machining.magnitudes import LARGEST
from machining.programs.actions import Action, Reader
from robots import InputError
from robots.arrays import Array, Bools

STRAIGHT, IN_ORDER = "motion line after line", "keep moves out of loops, conditions and jumps in the template"
# Moves that are kept as objects.
BLOCK = 4096
_STRING = re.compile(r'"[^"]*"')


class ReadMove(NamedTuple):
    """A move as its file has it, ``where`` it stands; fields as those of :class:`ReadMoves`."""

    where: str
    kind: str
    words: Sequence[float]
    external: Sequence[float]
    joint: bool
    configuration: Sequence[object] = ()
    speed: float = np.nan
    duration: float = np.nan


@dataclass(frozen=True, eq=False)
class ReadMoves:
    """n moves of a program as its file has them.

    ``words`` (n, k): coordinates, mm and deg (RAPID's quaternion without unit); ``external`` (n, e) mm and deg;
    ``joint`` (n,) joint moves; ``configuration``: of each move, empty where there is none; ``speed`` (n,) m/s,
    ``duration`` (n,) s, either NaN where the file does not say. ``where`` each stands; ``actions``: what is done
    besides, each with the move that it comes before.
    """

    kind: str
    words: Array
    external: Array
    joint: Bools
    configuration: list[Sequence[object]]
    speed: Array
    duration: Array
    where: Sequence[str] = ()
    actions: Sequence[tuple[int, Action]] = ()


def collected(moves: Iterable[ReadMove | Action]) -> ReadMoves:
    """All moves of a program, and what is done between them.

    Raises
    ------
    InputError
        Nothing was read, a move of another kind or number of axes than those before, a number that is not finite.
    """
    rows: list[ReadMove] = []
    actions: list[tuple[int, Action]] = []
    parts: list[ReadMoves] = []
    first: ReadMove | None = None
    for move in moves:
        if isinstance(move, Action):
            actions.append((BLOCK * len(parts) + len(rows), move))
            continue
        first = first or move
        sizes = len(move.words), len(move.external)
        if move.kind != first.kind:
            what = f"{move.where}: {move.kind} coordinates after {first.kind} ones"
            raise InputError(what, code="Q005", allowed="one kind in a program")
        if sizes != (len(first.words), len(first.external)):
            raise InputError(
                f"{move.where}: {sizes[0]} + {sizes[1]} coordinates", code="Q005", allowed="as many as in other moves"
            )
        rows.append(move)
        if len(rows) == BLOCK:
            parts.append(_table(rows))
            rows = []
    if first is None:
        raise InputError("program", code="Q005", value="no move in it", allowed="one or more")
    if rows:
        parts.append(_table(rows))
    names = ("words", "external", "joint", "speed", "duration")
    arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    if not (np.isfinite(arrays["words"]).all() and np.isfinite(arrays["external"]).all()):
        raise InputError("coordinate in a program", code="Q005", allowed="finite numbers")
    configuration = [row for part in parts for row in part.configuration]
    where = [place for part in parts for place in part.where]
    return ReadMoves(first.kind, configuration=configuration, where=where, actions=actions, **arrays)


def _table(rows: Sequence[ReadMove]) -> ReadMoves:
    """Some moves as arrays, a tenth of what they are as objects."""
    where, kinds, words, external, joint, configuration, speed, duration = zip(*rows, strict=True)
    axes = np.array(external, dtype=np.float64).reshape(len(rows), -1)
    rates = np.array(speed, dtype=np.float64), np.array(duration, dtype=np.float64)
    return ReadMoves(
        kinds[0], np.array(words, dtype=np.float64), axes, np.array(joint), list(configuration), *rates, where
    )


def number(where: str, text: str) -> float:
    """A number that a program can hold. Raises InputError for anything else."""
    try:
        value = float(text) if text.isascii() and "_" not in text else np.nan
    except ValueError as error:
        raise InputError(where, code="Q005", value=text.strip(), allowed="a number") from error
    if not abs(value) <= LARGEST:
        raise InputError(where, code="Q005", value=text.strip(), allowed=f"a finite number of at most {LARGEST:g}")
    return value


def numbers(where: str, texts: Sequence[str]) -> list[float]:
    """Numbers that a program can hold; errors as :func:`number`."""
    try:
        values = list(map(float, texts))
    except ValueError:
        return [number(where, text) for text in texts]
    joined = "".join(texts)
    # The sum tells of what is not a number, which least and greatest may miss.
    bounded = not values or (min(values) >= -LARGEST and max(values) <= LARGEST and abs(sum(values)) < np.inf)
    if bounded and joined.isascii() and "_" not in joined:
        return values
    return [number(where, text) for text in texts]


def whole(where: str, text: str) -> int:
    """A whole number. Raises InputError for anything else."""
    value = number(where, text)
    if value != int(value):
        raise InputError(where, code="Q005", value=text.strip(), allowed="a whole number")
    return int(value)


@dataclass
class Scan:
    """What is known at a line of a program: ``data`` of other files or sections, the ``tool`` named last.

    ``speeds`` m/s by name ("" where the language has one only), ``own`` what a language has to remember besides.
    """

    data: Mapping[str, Mapping[int, Mapping[str, str]]]
    tool: str = ""
    speeds: dict[str, float] = field(default_factory=dict)
    own: dict[str, list[float]] = field(default_factory=dict)

    def speed(self, name: str = "") -> float:
        """Speed of that name; NaN where none was said."""
        return self.speeds.get(name, np.nan)


class Line(NamedTuple):
    """A line of a program: ``where`` it stands, its ``code`` without comment, the ``move`` or ``action`` that it is."""

    where: str
    code: str
    move: re.Match[str] | None
    action: Action | None = None


@dataclass(frozen=True)
class Grammar:
    """What a reader knows of a language, and what it must not pass over.

    ``main``: how the main file's name ends; ``comment``: sign that starts one; ``move``: the moves that are read, in
    words ``readable``; ``motion``: words that move, anywhere in a line; ``opens`` and ``closes``: of loops and
    conditions; ``jumps``; ``call`` of a part, and how its file's name ends, None where there are no parts.
    """

    main: str
    comment: str
    move: re.Pattern[str]
    readable: str
    motion: re.Pattern[str]
    opens: re.Pattern[str]
    closes: re.Pattern[str]
    jumps: re.Pattern[str]
    call: tuple[re.Pattern[str], str] | None = None

    def lines(self, files: Mapping[str, str], reader: Reader) -> Iterator[Line]:
        """Lines of the main file, then of the sub-programs that it calls, in their order.

        Actions within conditions do not count, but for a stop that waits for the input of optional stops.

        Raises
        ------
        InputError
            Files that are not there; motion that is not read, or would run once for each turn of a loop, or not at
            all; a jump: the order of the lines is not that of the motion.
        """
        bodies = [file_of(files, self.main)]
        if self.call is not None:
            pattern, suffix = self.call
            calls = [found[1] for line in bodies[0][1].splitlines() if (found := pattern.match(line)) is not None]
            names = {
                name.rsplit("/", 1)[-1].removesuffix(suffix).lower(): name for name in files if name.endswith(suffix)
            }
            missing = [call for call in calls if call.lower() not in names]
            if missing:
                what = "a file of the program"
                raise InputError(
                    "sub-program", code="Q005", value=missing[0], allowed=what, remedy="give all its files"
                )
            bodies += [(names[call.lower()], files[names[call.lower()]]) for call in calls]
        for source, body in bodies:
            yield from self._statements(source, body, reader)

    def _statements(self, source: str, body: str, reader: Reader) -> Iterator[Line]:
        depth, asked = 0, ("", -1)
        for i, line in enumerate(body.splitlines(), 1):
            code = _STRING.sub('""', line).partition(self.comment)[0]
            where = f"{source}, line {i}"
            move = self.move.match(code)
            if move is not None and depth == 0 and not self.jumps.search(code):
                # Most lines: nothing begins, ends or is switched in them.
                yield Line(where, code, move)
                continue
            if self.jumps.search(code):
                raise InputError(
                    f"{where}: a jump", code="Q005", value=code.strip()[:80], allowed=STRAIGHT, remedy=IN_ORDER
                )
            before = depth
            depth = max(0, depth + len(self.opens.findall(code)) - len(self.closes.findall(code)))
            if self.motion.search(code):
                if move is None:
                    raise InputError(where, code="Q005", value=code.strip()[:80], allowed=self.readable)
                if depth > 0:
                    what = f"{where}: motion within a loop or a condition"
                    raise InputError(what, code="Q005", value=code.strip()[:80], allowed=STRAIGHT, remedy=IN_ORDER)
            asks, action = reader.optional(code), reader.found(code)
            if asks is not None:
                asked = asks, depth
            # Some languages wait for an input in a loop that does nothing else.
            if action is not None and depth > 0 and not (action.kind == "await" and before == 0):
                is_asked = action.kind == "stop" and asked[1] == depth
                action = Action("optional_stop", asked[0], action.name) if is_asked else None
            yield Line(where, code, move, action)


def file_of(files: Mapping[str, str], suffix: str) -> tuple[str, str]:
    """Name and text of the first file of a kind. Raises InputError where there is none."""
    for name, text in files.items():
        if name.endswith(suffix):
            return name, text
    raise InputError(
        "files of a program", code="Q005", value=", ".join(files) or "none", allowed=f"a main file *{suffix} first"
    )
