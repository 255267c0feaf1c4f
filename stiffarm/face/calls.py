"""How the face calls a step: nothing is printed, remarks are kept, and errors speak of arguments, not of options."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from robots import InputError
from stiffarm.capability import called

__all__ = ["called", "numbers", "words_of"]


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
