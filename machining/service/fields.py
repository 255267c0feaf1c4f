"""Keys of a request, each read once with its type and range; what is left over at the end is unknown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robots import InputError
from robots.arrays import Array

# Figures beyond this are mistakes; squares of them are still numbers.
MOST = 1e9
# Points of a block, poses of a list.
MOST_ROWS = 100_000


class Fields:
    """A request's keys. Every reader takes its key out; :meth:`done` refuses what nobody asked for."""

    def __init__(self, request: Mapping[str, Any], do: str) -> None:
        self.left = {key: value for key, value in request.items() if key not in ("id", "do") and value is not None}
        self.do, self.seen = do, [] if do == "batch" else ["id", "do"]

    def has(self, key: str) -> bool:
        """Whether a key is given and not null."""
        return key in self.left

    def done(self) -> None:
        """Refuse keys that the command does not know."""
        if self.left:
            known = ", ".join(dict.fromkeys(self.seen))
            raise InputError(
                f"{self.do}: unknown key", value=next(iter(self.left)), allowed=known, remedy="correct or remove it"
            )

    def take(self, key: str) -> Any:
        """The value of a key, None where it is not given."""
        self.seen.append(key)
        return self.left.pop(key, None)

    def fault(self, key: str, value: object, allowed: str, remedy: str | None = None) -> InputError:
        """An error about a key."""
        return InputError(f"{self.do}: {key}", value=value, allowed=allowed, remedy=remedy)

    def needed(self, key: str, allowed: str) -> InputError:
        """An error about a key that is missing."""
        return InputError(f"{self.do}: {key} is missing", allowed=allowed, remedy=f"give {key}")

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self.take(key)
        if value is None:
            return default
        if not isinstance(value, bool):
            raise self.fault(key, value, "true, false")
        return value

    def choice(self, key: str, allowed: Sequence[str], default: str) -> str:
        """One of some words."""
        value = self.take(key)
        if value is None:
            return default
        if not isinstance(value, str) or value not in allowed:
            raise self.fault(key, value, ", ".join(allowed))
        return value

    def number(self, key: str, low: float = -MOST, high: float = MOST) -> float | None:
        """A number from ``low`` to ``high``; None where it is not given."""
        value = self.take(key)
        if value is None:
            return None
        if not _is_number(value) or not low <= value <= high:
            raise self.fault(key, value, f"a number from {low:g} to {high:g}")
        return float(value)

    def vector(self, key: str, size: int) -> tuple[float, ...] | None:
        """A list of ``size`` numbers; None where it is not given."""
        value = self.take(key)
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != size or not all(map(_is_number, value)):
            raise self.fault(key, value, f"{size} numbers of at most {MOST:g}")
        return tuple(map(float, value))

    def direction(self, key: str) -> tuple[float, float, float] | None:
        """A unit vector along three numbers that are not all zero."""
        value = self.vector(key, 3)
        return None if value is None else self.unit(key, value)

    def unit(self, key: str, value: Sequence[float]) -> tuple[float, float, float]:
        """A unit vector; InputError where all is zero."""
        size = max(map(abs, value))
        if size == 0.0:
            raise self.fault(key, list(value), "three numbers, not all zero", "give a direction")
        x, y, z = (v / size for v in value)
        length = math.sqrt(x * x + y * y + z * z)
        return x / length, y / length, z / length

    def rows(self, key: str, size: int, most: int = MOST_ROWS) -> Array | None:
        """Lists (n, size) of numbers, or one list (size,); None where the key is not given."""
        value = self.take(key)
        if value is None:
            return None
        form = f"{size} numbers of at most {MOST:g}, or a list of 1 to {most} such lists"
        if not isinstance(value, list) or not value:
            raise self.fault(key, value, form)
        if not isinstance(value[0], list):
            if len(value) != size or not all(map(_is_number, value)):
                raise self.fault(key, value, form)
            return np.array(value, dtype=np.float64)
        if len(value) > most:
            raise self.fault(key, f"{len(value)} lists", form)
        for i, row in enumerate(value):
            if not isinstance(row, list) or len(row) != size or not all(map(_is_number, row)):
                raise self.fault(f"{key}, row {i}", row, form)
        return np.array(value, dtype=np.float64)

    def names(self, key: str, allowed: Sequence[str]) -> list[str] | None:
        """One word or a list of words; None where the key is not given."""
        value = self.take(key)
        if value is None:
            return None
        words = [value] if isinstance(value, str) else value
        if not isinstance(words, list) or not words or not all(isinstance(w, str) and w in allowed for w in words):
            raise self.fault(key, value, ", ".join(allowed))
        return list(dict.fromkeys(words))


def _is_number(value: object) -> bool:
    kind = type(value)
    # NaN is not less than anything. Integers of any length compare.
    return (kind is float or kind is int) and -MOST <= value <= MOST  # type: ignore[operator]
