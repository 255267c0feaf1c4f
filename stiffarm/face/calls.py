"""How the face calls a step: nothing is printed, remarks are kept, and errors speak of arguments, not of options."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from robots import InputError, InputErrors, require_one_of
from robots.files.reading import recording
from stiffarm.session.console import kept_messages

# Numbers by name, or all of them in the order of the names.
ByName = Mapping[str, float] | Sequence[float]
_OPTION = re.compile(r"--([a-z][a-z0-9]*(?:-[a-z0-9]+)*)")


@contextmanager
def called() -> Iterator[list[str]]:
    """Run a step: its messages become the list that is handed out.

    Raises
    ------
    InputError
        As the step raises it, with the names of options as those of arguments: ``--load-path`` is ``load_path``.
    """
    with kept_messages() as messages, recording():
        try:
            yield messages
        except InputErrors as error:
            raise InputErrors(_words(error.what), [_of_arguments(e) for e in error.errors], error.count) from error
        except InputError as error:
            raise _of_arguments(error) from error


def in_order(values: ByName, names: Sequence[str], argument: str, unit: str = "number") -> list[float]:
    """The values of ``names``, one after the other, 0 where one is not given; a row of numbers has them all.

    Raises
    ------
    InputError
        A name that is not one of them, a row of another length, or a value that is not finite.
    """
    if not isinstance(values, Mapping):
        row = numbers(values, argument) or ()
        if len(row) != len(names):
            raise InputError(
                argument,
                code="B003",
                value=f"{len(row)} numbers",
                allowed=f"{len(names)}, those of {', '.join(names)}, or by name",
            )
        values = dict(zip(names, row, strict=True))
    for name, value in values.items():
        require_one_of(f"{argument}: name", name, names, code="B003", remedy="use these names")
        if not _is_finite(value):
            raise InputError(f"{argument}: {name}", code="B003", value=value, allowed=f"a finite {unit}")
    return [float(values.get(name, 0.0)) for name in names]


def _is_finite(value: Any) -> bool:
    try:
        return math.isfinite(value)
    except TypeError:
        return False


def one_or_several(given: ByName | Sequence[ByName]) -> list[ByName]:
    """A row of numbers or numbers by name, or several of them, as a list of them."""
    rows: list[Any] = [given] if isinstance(given, Mapping) else list(given)
    return [rows] if rows and not any(isinstance(row, Mapping | Sequence | np.ndarray) for row in rows) else rows


def words_of(given: Sequence[str] | str | None, argument: str) -> tuple[str, ...] | None:
    """Names in a sequence, or in one text with commas between them; None for none.

    Raises
    ------
    InputError
        Something else.
    """
    if given is None:
        return None
    names = given.split(",") if isinstance(given, str) else given
    if not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
        raise InputError(argument, code="B003", value=given, allowed="names, as in ['j2.stiffness', 'j3.stiffness']")
    return tuple(name.strip() for name in names)


def numbers(given: ArrayLike | None, argument: str) -> tuple[float, ...] | None:
    """Numbers in a row, or one; None for none.

    Raises
    ------
    InputError
        Something else.
    """
    if given is None:
        return None
    try:
        row = np.atleast_1d(np.asarray(given, dtype=np.float64))
    except (TypeError, ValueError):
        row = np.zeros((0, 0))
    if row.ndim != 1:
        raise InputError(argument, code="B003", value=str(given), allowed="numbers in a row")
    return tuple(row.tolist())


def _of_arguments(error: InputError) -> InputError:
    allowed, remedy = (None if text is None else _words(text) for text in (error.allowed, error.remedy))
    return InputError(_words(error.what), code=error.code, value=error.value, allowed=allowed, remedy=remedy)


def _words(text: str) -> str:
    return _OPTION.sub(lambda found: found[1].replace("-", "_"), text)
