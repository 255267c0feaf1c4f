"""What goes over the line: one JSON object each way, UTF-8 in, ASCII out, no NaN; each key read once, none unknown."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from robots import InputError, InputErrors
from robots.arrays import Array
from robots.files.reading import parse_json

# Bytes of one request: room for a block of 100 000 points with tool axes.
LONGEST_LINE = 32 * 1024 * 1024
# Characters of an offending value that go into an answer.
SHOWN = 200
# Characters of an id, and largest number that every JSON reader keeps exactly.
LONGEST_ID = 200
LARGEST_ID = 2**53
# Figures beyond this are mistakes; squares of them are still numbers.
MOST = 1e9
# Points of a block, poses of a list.
MOST_ROWS = 100_000


class NotReadError(InputError):
    """A line that is no request."""


_ENCODER = json.JSONEncoder(ensure_ascii=True, allow_nan=False, separators=(", ", ": "))


def read_line(line: bytes) -> dict[str, Any]:
    """The request on a line.

    Raises
    ------
    InputError
        Not UTF-8, no JSON, no object, nested too deep, or a number that is not finite.
    """
    try:
        text = line.decode("utf-8").removeprefix("\ufeff").strip()
    except UnicodeDecodeError as error:
        raise NotReadError("line", code="V001", value=f"byte {error.start} is not UTF-8", allowed="UTF-8") from None
    form = 'one JSON object a line, as in {"id": 1, "do": "ping"}'
    if not text:
        raise NotReadError("line", code="V001", value="empty", allowed=form)
    try:
        request = parse_json(text, "line", remedy=form)
    except InputError as error:
        raise NotReadError(
            "line", code="V001", value=error.what.removeprefix("line is ")[:SHOWN], allowed=form
        ) from None
    if not isinstance(request, dict):
        raise NotReadError("line", code="V001", value=f"a JSON {type(request).__name__}", allowed=form)
    return request


def id_of(request: Mapping[str, Any]) -> str | int | float | None:
    """The request's id.

    Raises
    ------
    InputError
        Neither a string nor a number, or a very long one.
    """
    given: object = request.get("id")
    if given is None or (isinstance(given, str) and len(given) <= LONGEST_ID):
        return given
    if isinstance(given, int | float) and not isinstance(given, bool) and abs(given) <= LARGEST_ID:
        return given
    raise InputError(
        "id", code="V001", value=_short(given), allowed=f"a number, or a string of at most {LONGEST_ID} characters"
    )


def write_line(answer: Mapping[str, Any]) -> bytes:
    """An answer as a line."""
    return _ENCODER.encode(answer).encode("ascii") + b"\n"


def error_of(error: BaseException) -> dict[str, Any]:
    """What an answer says of an error: what, value, allowed, remedy, code.

    Besides ``point`` of a path, or ``problems`` of several errors. The code of several is null.
    """
    said: dict[str, Any] = {"what": "", "value": None, "allowed": None, "remedy": None, "code": None}
    if isinstance(error, InputErrors):
        problems = [error_of(one) for one in error.errors[:20]]
        return said | {"what": str(error).splitlines()[0][:SHOWN], "problems": problems}
    if not isinstance(error, InputError):
        what = f"internal error: {type(error).__name__}: {str(error)[:SHOWN]}"
        return said | {"what": what, "remedy": "report it, with the request", "code": "X002"}
    said |= {"what": error.what, "value": _short(error.value), "allowed": error.allowed, "remedy": error.remedy}
    said |= {"code": error.code}
    point = getattr(error, "point", None)
    return said if point is None else said | {"point": int(point)}


def number(value: float, digits: int | None = None) -> float | None:
    """A number for an answer; None where it is not finite."""
    value = float(value)
    if not math.isfinite(value):
        return None
    return value if digits is None else round(value, digits) + 0.0


def numbers(values: Any, digits: int | None = 9) -> Any:
    """An array as nested lists, rounded to ``digits`` decimals; None where a number is not finite."""
    array = np.asarray(values, dtype=np.float64)
    if digits is not None:
        array = np.asarray(np.round(array, digits) + 0.0)
    if np.isfinite(array).all():
        return array.tolist()
    shown = np.array(array, dtype=object)
    shown[~np.isfinite(array)] = None
    return shown.tolist()


def _short(value: Any) -> Any:
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, int | float) and abs(value) <= LARGEST_ID:
        return number(value)
    text = value if isinstance(value, str) else _words(value)
    return text if len(text) <= SHOWN else text[:SHOWN] + " ..."


def _words(value: Any) -> str:
    try:
        return str(value)
    except (ValueError, RecursionError):  # an integer of thousands of digits
        return f"a very long {type(value).__name__}"


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
                f"{self.do}: unknown key",
                code="V002",
                value=next(iter(self.left)),
                allowed=known,
                remedy="correct or remove it",
            )

    def take(self, key: str) -> Any:
        """The value of a key, None where it is not given."""
        self.seen.append(key)
        return self.left.pop(key, None)

    def fault(self, key: str, value: object, allowed: str, remedy: str | None = None) -> InputError:
        """An error about a key."""
        return InputError(f"{self.do}: {key}", code="V002", value=value, allowed=allowed, remedy=remedy)

    def needed(self, key: str, allowed: str) -> InputError:
        """An error about a key that is missing."""
        return InputError(f"{self.do}: {key} is missing", code="V002", allowed=allowed, remedy=f"give {key}")

    def given(self, key: str, fits: Callable[[Any], bool], allowed: str) -> Any:
        """The value of a key that fits, None where it is not given."""
        value = self.take(key)
        if value is not None and not fits(value):
            raise self.fault(key, value, allowed)
        return value

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self.given(key, lambda v: isinstance(v, bool), "true, false")
        return default if value is None else value

    def choice(self, key: str, allowed: Sequence[str], default: str) -> str:
        """One of some words."""
        value = self.given(key, lambda v: isinstance(v, str) and v in allowed, ", ".join(allowed))
        return default if value is None else value

    def number(self, key: str, low: float = -MOST, high: float = MOST) -> float | None:
        """A number from ``low`` to ``high``; None where it is not given."""
        value = self.given(key, lambda v: _is_number(v) and low <= v <= high, f"a number from {low:g} to {high:g}")
        return None if value is None else float(value)

    def vector(self, key: str, size: int) -> tuple[float, ...] | None:
        """A list of ``size`` numbers; None where it is not given."""
        value = self.given(key, lambda v: _are_numbers(v, size), f"{size} numbers of at most {MOST:g}")
        return None if value is None else tuple(map(float, value))

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
            if not _are_numbers(value, size):
                raise self.fault(key, value, form)
            return np.array(value, dtype=np.float64)
        if len(value) > most:
            raise self.fault(key, f"{len(value)} lists", form)
        for i, row in enumerate(value):
            if not _are_numbers(row, size):
                raise self.fault(f"{key}, row {i}", row, form)
        return np.array(value, dtype=np.float64)

    def positive(self, key: str, n: int) -> Array | None:
        """Numbers (n,) above 0, of a list or one for all; None where the key is not given."""
        value = self.take(key)
        if value is None:
            return None
        values = value if isinstance(value, list) else [value] * n
        if len(values) != n or not all(_is_number(v) and v > 0.0 for v in values):
            raise self.fault(key, value, f"a number above 0, or {n} of them")
        return np.array(values, dtype=np.float64)

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


def _are_numbers(value: object, size: int) -> bool:
    return isinstance(value, list) and len(value) == size and all(map(_is_number, value))
