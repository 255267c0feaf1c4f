"""Where models come from and go to: bundled names and TOML files."""

from __future__ import annotations

import hashlib
import json
import os
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import ValidationError

from robots.errors import InputError, InputErrors
from robots.robot import Robot, robot_from
from robots.schema import ModelDescription


def bundled_names() -> tuple[str, ...]:
    """Names of the bundled robots."""
    files = resources.files("robots").joinpath("data").iterdir()
    return tuple(sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml")))


def load_description(model: str | Path) -> ModelDescription:
    """Read a model by bundled name or from a TOML file.

    Raises
    ------
    InputError
        Unknown name, unreadable file, or a file that does not fit the schema (all faults at once).
    """
    name = str(model)
    if name in bundled_names():
        text = resources.files("robots").joinpath("data", f"{name}.toml").read_text(encoding="utf-8")
        return parse_description(text, f"bundled robot {name}")
    path = Path(model)
    if not path.is_file():
        raise InputError(
            "model", value=name, allowed=f"{', '.join(bundled_names())}, or the path of a model TOML",
            remedy="`stiffarm robots` lists the bundled ones",
        )
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"model file {path} cannot be read ({error})") from error
    return parse_description(text, str(path))


def parse_description(text: str, where: str) -> ModelDescription:
    """Parse and validate a model TOML; ``where`` names it in messages."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where} is not valid TOML ({error})", remedy="mend the file at that line") from error
    try:
        return ModelDescription.model_validate(data)
    except ValidationError as error:
        faults = [_fault(where, item) for item in error.errors()]
        raise (faults[0] if len(faults) == 1 else InputErrors(where, faults)) from error


def _fault(where: str, item: Any) -> InputError:
    place = ".".join(str(step) for step in item["loc"]) or "file"
    message = str(item["msg"]).removeprefix("Value error, ")
    shown = item["input"] if isinstance(item["input"], str | int | float | bool) else None
    return InputError(f"{where}: {place}: {message}", value=shown)


def load_robot(model: str | Path) -> Robot:
    """Read a model and return its kinematics as arrays."""
    return robot_from(load_description(model))


def to_toml(description: ModelDescription) -> str:
    """The description as TOML text; reading it back gives the same description."""
    data = description.model_dump(mode="json", by_alias=True, exclude_none=True)
    return tomlkit.dumps(data)


def save_description(description: ModelDescription, path: Path) -> None:
    """Write a model TOML under a temporary name, then rename. Never over an existing file.

    Raises
    ------
    InputError
        The file exists already.
    """
    if path.exists():
        raise InputError(
            f"model file {path} exists already", remedy="choose another name; models are never overwritten"
        )
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    temporary.write_text(to_toml(description), encoding="utf-8")
    temporary.replace(path)


def content_hash(description: ModelDescription) -> str:
    """SHA-256 of the description's content, independent of layout and comments."""
    data = description.model_dump(mode="json", by_alias=True)
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
