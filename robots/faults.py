"""Faults of one file while it is read: reported all at once in the order of its lines, the first ones in full."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from robots.errors import FAULTS_SHOWN, InputError, InputErrors

_FAULTS_KEPT: Final = 10 * FAULTS_SHOWN


@dataclass
class Faults:
    """Collects what is wrong in one file, to report it all at once in the order of the lines.

    ``lines``: those with a fault; ``count``: of all faults. Of the faults themselves the first are kept: a table can
    have a million.
    """

    file: str
    lines: set[int] = field(default_factory=set)
    count: int = 0
    _found: list[tuple[int, InputError]] = field(default_factory=list)
    _beyond: float = math.inf

    def __bool__(self) -> bool:
        return self.count > 0

    def add(
        self,
        line: int,
        problem: str,
        *,
        code: str,
        value: str | None = None,
        allowed: str,
        remedy: str,
        file: str | None = None,
    ) -> None:
        """Record a problem of one row (of ``file``, where there are several); ``problem`` starts with its column."""
        what = f"{file or self.file}, row {line}, {problem}"
        self.say(line, what, code=code, value=value, allowed=allowed, remedy=remedy)

    def say(self, line: int, what: str, *, code: str, **parts: Any) -> None:
        """Record a fault of a line in the words of :class:`robots.InputError`."""
        if self._takes(line):
            self._found.append((line, InputError(what, code=code, **parts)))

    def each(self, lines: Sequence[int], fault: Callable[[int], Mapping[str, Any]], *, code: str) -> None:
        """Record a problem of each of many lines; ``fault``: other arguments of :meth:`add` by place among them.

        It is asked for the first ones only: a table can have a million.
        """
        self.count += len(lines)
        self.lines.update(lines)
        for k in sorted(range(len(lines)), key=lines.__getitem__)[:_FAULTS_KEPT]:
            self.count -= 1  # counted once more
            self.add(lines[k], code=code, **fault(k))

    def record(self, line: int, error: InputError) -> None:
        """Record an error that somebody else has found in a line."""
        if self._takes(line):
            self._found.append((line, error))

    def _takes(self, line: int) -> bool:
        """Count a fault; whether it may be among the first."""
        self.count += 1
        self.lines.add(line)
        if len(self._found) == 2 * _FAULTS_KEPT:
            self._found = sorted(self._found, key=lambda item: item[0])[:_FAULTS_KEPT]
            self._beyond = self._found[-1][0]
        return line < self._beyond

    def raise_if_any(self, what: str) -> None:
        """Raise InputErrors if anything was recorded; ``what`` the file is begins the message."""
        if self.count:
            ordered = sorted(self._found, key=lambda item: item[0])
            raise InputErrors(f"{what} {self.file}", [error for _, error in ordered], self.count)
