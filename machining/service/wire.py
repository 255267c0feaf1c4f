"""What goes over the line: one JSON object each way, UTF-8 in, ASCII out, no NaN, no surprises."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from robots import InputError, InputErrors
from robots.files.reading import parse_json

# Bytes of one request: room for a block of 100 000 points with tool axes.
LONGEST_LINE = 32 * 1024 * 1024
# Characters of an offending value that go into an answer.
SHOWN = 200
# Characters of an id, and largest number that every JSON reader keeps exactly.
LONGEST_ID = 200
LARGEST_ID = 2**53


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
        raise NotReadError("line", value=f"byte {error.start} is not UTF-8", allowed="UTF-8") from None
    form = 'one JSON object a line, as in {"id": 1, "do": "ping"}'
    if not text:
        raise NotReadError("line", value="empty", allowed=form)
    try:
        request = parse_json(text, "line", remedy=form)
    except InputError as error:
        raise NotReadError("line", value=error.what.removeprefix("line is ")[:SHOWN], allowed=form) from None
    if not isinstance(request, dict):
        raise NotReadError("line", value=f"a JSON {type(request).__name__}", allowed=form)
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
    raise InputError("id", value=_short(given), allowed=f"a number, or a string of at most {LONGEST_ID} characters")


def write_line(answer: Mapping[str, Any]) -> bytes:
    """An answer as a line."""
    return _ENCODER.encode(answer).encode("ascii") + b"\n"


def error_of(error: BaseException) -> dict[str, Any]:
    """What an answer says of an error: what, value, allowed, remedy; ``point`` of a path, ``problems`` of several."""
    if not isinstance(error, InputError):
        return {
            "what": f"internal error: {type(error).__name__}: {str(error)[:SHOWN]}",
            "value": None,
            "allowed": None,
            "remedy": "report it, with the request",
        }
    if isinstance(error, InputErrors):
        problems = [error_of(one) for one in error.errors[:20]]
        what = f"{str(error).splitlines()[0][:SHOWN]}"
        return {"what": what, "value": None, "allowed": None, "remedy": None, "problems": problems}
    said: dict[str, Any] = {
        "what": error.what,
        "value": _short(error.value),
        "allowed": error.allowed,
        "remedy": error.remedy,
    }
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
