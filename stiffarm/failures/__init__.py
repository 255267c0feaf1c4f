"""Every failure that the program can report, by a code that never changes: what it means, and what to do about it.

The entries are prose (``catalogue/*.toml``, a file for each area). What fails carries the code of its entry. Warnings
are known by their words.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from robots import InputError, InputErrors

# Failures that are no InputError: the command line says them itself.
SYSTEM, INTERNAL = "X001", "X002"
MORE = "More: stiffarm help"


@dataclass(frozen=True)
class Failure:
    """One kind of error or warning; ``says``: words of warnings."""

    code: str
    area: str
    title: str
    cause: str
    remedy: str
    example: str
    says: Sequence[str] = ()

    def text(self) -> str:
        """The entry for people to read."""
        parts = (("Cause", self.cause), ("What to do", self.remedy), ("Example", self.example))
        return "\n\n".join([f"{self.code}: {self.title}", *(f"{name}: {said}" for name, said in parts)])


@cache
def catalogue() -> Mapping[str, Failure]:
    """All failures by code, area by area."""
    found: dict[str, Failure] = {}
    for file in sorted((files(__name__) / "catalogue").iterdir(), key=lambda file: file.name):
        if file.name.endswith(".toml"):
            entries = tomllib.loads(file.read_text(encoding="utf-8"))
            area = entries.pop("area")
            for code, entry in entries.items():
                found[code] = Failure(code, area, **entry)
    return dict(sorted(found.items()))


def warning_of(text: str) -> Failure | None:
    """What the catalogue says of a warning; None of a mere remark."""
    for failure in catalogue().values():
        if any(words in text for words in failure.says):
            return failure
    return None


def with_code(text: str, code: str) -> str:
    """A message, and where to read more of it."""
    return f"{text.rstrip('.')}. {MORE} {code}"


def said(error: InputError) -> str:
    """An error as the command line says it: with its code; several faults each with theirs."""
    if isinstance(error, InputErrors):
        return _said_of_several(error)
    return with_code(str(error), error.code)


def _said_of_several(error: InputErrors) -> str:
    head, *lines = str(error).split("\n")
    if len(lines) < len(error.errors) or any(isinstance(one, InputErrors) for one in error.errors):
        return with_code(str(error), ", ".join(dict.fromkeys(one.code for one in _single(error))))
    marked = [f"{line} [{one.code}]" for line, one in zip(lines, error.errors, strict=False)]
    return "\n".join([with_code(head, "CODE"), *marked, *lines[len(marked) :]])


def _single(error: InputErrors) -> Iterator[InputError]:
    """The faults in it, one by one."""
    for one in error.errors:
        if isinstance(one, InputErrors):
            yield from _single(one)
        else:
            yield one
