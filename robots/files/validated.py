"""Tables of a user's file checked against a schema; what does not fit is said in the words of the file, all at once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from robots.errors import InputError, InputErrors
from robots.schema.description import ReferenceFaults

T = TypeVar("T", bound=BaseModel)

CORRECT = "correct it in the file"


def validated(
    model: type[T],
    data: object,
    where: str,
    *,
    missing: str = "add it",
    remedy: str = CORRECT,
    table: str | None = None,
) -> T:
    """The data of a TOML or JSON file as a model.

    Parameters
    ----------
    where : names the file in messages
    missing, remedy : what to do about a key that is missing, and about other faults
    table : of the file that ``data`` is; None: all of it

    Raises
    ------
    InputError
        The one key that does not fit.
    InputErrors
        Several of them, each with its place, value and remedy.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        words = {
            "missing": ("this key is missing", missing),
            "extra_forbidden": ("unknown key", "check its spelling, or remove it"),
        }
        faults = [fault for item in error.errors() for fault in _faults(where, data, item, words, remedy, table)]
        raise (faults[0] if len(faults) == 1 else InputErrors(where, faults)) from error


def tuples(node: Any) -> Any:
    """The same with tuples in place of lists: TOML and JSON have lists only."""
    if isinstance(node, Mapping):
        return {key: tuples(value) for key, value in node.items()}
    return tuple(tuples(value) for value in node) if isinstance(node, list | tuple) else node


def _faults(
    where: str, data: object, item: Any, words: Mapping[str, tuple[str, str]], remedy: str, table: str | None
) -> list[InputError]:
    message, remedy = words.get(item["type"], (_in_plain_words(str(item["msg"])), remedy))
    cause = item.get("ctx", {}).get("error")
    messages = cause.faults if isinstance(cause, ReferenceFaults) else (message,)
    value = item["input"]
    # Where a key is missing or a table contradicts itself, the value is the whole table: no help to a reader.
    shown = value if isinstance(value, str | int | float | list | tuple) and item["type"] != "missing" else None
    place = ".".join(([table] if table else []) + _steps(data, item["loc"])) or "file"
    return [InputError(f"{where}: {place}: {text}", code="F011", value=shown, remedy=remedy) for text in messages]


def _in_plain_words(message: str) -> str:
    """What pydantic says, without its own name for lists."""
    said = message.removeprefix("Value error, ").replace("Input should", "must")
    return said.replace("valid tuple", "list").replace("Tuple should", "must")


def _steps(data: object, loc: tuple[int | str, ...]) -> list[str]:
    """The path to a key as a reader of the file would name it: entries of a list by their name."""
    steps: list[str] = []
    node = data
    for step in loc:
        if isinstance(node, dict) and step in node:
            node = node[step]
        elif isinstance(node, list | tuple) and isinstance(step, int) and step < len(node):
            node = node[step]
            label = (node.get("name") or node.get("code")) if isinstance(node, dict) else None
            if isinstance(label, str):
                step = label
        # Else the step is pydantic's own (the branch of a union) or the missing key: the path goes on.
        steps.append(str(step))
    return steps
