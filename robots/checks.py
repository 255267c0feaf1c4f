"""What is asked of single arguments everywhere: a known word, a number above zero, a number that is large enough."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TypeVar

from robots.errors import InputError

Word = TypeVar("Word", bound=str)


def one_of(what: str, value: object, allowed: Iterable[Word], remedy: str | None = None) -> Word:
    """The value as one of the words that are allowed.

    Raises
    ------
    InputError
        It is none of them; the message names them all.
    """
    known = tuple(allowed)
    for word in known:
        if word == value:
            return word
    raise InputError(what, value=value, allowed=", ".join(known), remedy=remedy)


def above_zero(what: str, value: float | None, unit: str = "", remedy: str | None = None) -> None:
    """Raise InputError unless a number, in its ``unit``, is finite and greater than 0, or not given."""
    if value is not None and not 0.0 < value < math.inf:
        raise InputError(what, value=value, allowed=f"greater than 0 {unit}".rstrip(), remedy=remedy)


def at_least(what: str, value: float | None, least: float, unit: str = "", remedy: str | None = None) -> None:
    """Raise InputError unless a number, in its ``unit``, is finite and not below ``least``, or not given."""
    if value is not None and not least <= value < math.inf:
        raise InputError(what, value=value, allowed=f"{least:g} or more{unit and f', {unit}'}", remedy=remedy)
