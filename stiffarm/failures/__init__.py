"""Every failure that the program can report, by a code that never changes: what it means, and what to do about it.

The entries are data (``catalogue/*.toml``, a file for each area). An entry says which errors it covers by the places in
the code that make them: a package, a module or one function of it, and, where one function finds several things wrong,
words of the message. The narrowest place counts. Warnings are known by their words.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from robots import InputError, InputErrors

# Failures that are no InputError: the command line says them itself.
SYSTEM, INTERNAL, HIDDEN = "X001", "X002", "X003"
MORE = "More: stiffarm help"


@dataclass(frozen=True)
class Failure:
    """One kind of error or warning.

    ``covers``: places of errors, as ``module:function ~ words``, the last two if need be; ``says``: words of warnings;
    ``finding``: a kind of finding of a verification; ``named``: the command line uses the code itself.
    """

    code: str
    area: str
    title: str
    cause: str
    remedy: str
    example: str
    covers: tuple[str, ...] = ()
    says: tuple[str, ...] = ()
    finding: str | None = None
    named: bool = False

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
                found[code] = Failure(code, area, **{key: _fixed(value) for key, value in entry.items()})
    return dict(sorted(found.items()))


def _fixed(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def covering(site: str, text: str) -> list[tuple[str, Failure]]:
    """The entries of an error made at ``site`` (``module:function``) that says ``text``, each with its place.

    The catalogue is sound where this is exactly one.
    """
    for place in _wider(site):
        here = _by_place().get(place, [])
        worded = [(f"{place} ~ {words}", failure) for words, failure in here if words and words in text]
        if found := worded or [(place, failure) for words, failure in here if not words]:
            return found
    return []


def failure_of(error: InputError) -> Failure | None:
    """What the catalogue says of an error; None of several at once, and of errors that others make."""
    if isinstance(error, InputErrors):
        return None
    found = covering(error.site, str(error))
    return found[0][1] if found else None


def code_of(error: BaseException) -> str | None:
    """The code of an error of any kind; None of several at once, and of errors that others make."""
    if not isinstance(error, InputError):
        return INTERNAL
    failure = failure_of(error)
    return None if failure is None else failure.code


def warning_of(text: str) -> Failure | None:
    """What the catalogue says of a warning; None of a mere remark."""
    for failure in catalogue().values():
        if any(words in text for words in failure.says):
            return failure
    return None


def finding_code(kind: str) -> str:
    """The code of a kind of finding of a verification."""
    return next(code for code, failure in catalogue().items() if failure.finding == kind)


def with_code(text: str, code: str) -> str:
    """A message, and where to read more of it."""
    return f"{text.rstrip('.')}. {MORE} {code}"


def said(error: InputError) -> str:
    """An error as the command line says it: with its code; several faults each with theirs."""
    if isinstance(error, InputErrors):
        return _said_of_several(error)
    failure = failure_of(error)
    return str(error) if failure is None else with_code(str(error), failure.code)


def _said_of_several(error: InputErrors) -> str:
    head, *lines = str(error).split("\n")
    if len(lines) < len(error.errors) or any(isinstance(one, InputErrors) for one in error.errors):
        codes = dict.fromkeys(failure.code for one in _single(error) if (failure := failure_of(one)))
        return with_code("\n".join([head, *lines]), ", ".join(codes)) if codes else str(error)
    found = [failure_of(one) for one in error.errors[: len(lines)]]
    marked = [
        line if failure is None else f"{line} [{failure.code}]" for line, failure in zip(lines, found, strict=False)
    ]
    head = with_code(head, "CODE") if any(found) else head
    return "\n".join([head, *marked, *lines[len(marked) :]])


def _single(error: InputErrors) -> Iterator[InputError]:
    """The faults in it, one by one."""
    for one in error.errors:
        if isinstance(one, InputErrors):
            yield from _single(one)
        else:
            yield one


@cache
def _by_place() -> Mapping[str, list[tuple[str, Failure]]]:
    """Words (or none) and failure, by place."""
    found: dict[str, list[tuple[str, Failure]]] = {}
    for failure in catalogue().values():
        for cover in failure.covers:
            place, _, words = cover.partition(" ~ ")
            found.setdefault(place, []).append((words, failure))
    return found


def _wider(site: str) -> Iterator[str]:
    """A place and those around it: the function, its module, the packages that hold it."""
    yield site
    module = site.partition(":")[0]
    while module:
        yield module
        module = module.rpartition(".")[0]
