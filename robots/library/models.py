"""Where models come from and go to: bundled names, TOML files with their meshes, URDF files."""

from __future__ import annotations

import hashlib
import json
from contextlib import ExitStack
from importlib import resources
from pathlib import Path
from typing import Any

import tomlkit

from robots.errors import InputError, meant
from robots.files.reading import parse_toml, read_text, recording
from robots.files.validated import validated
from robots.files.written import write_whole
from robots.library.surface_files import with_absolute_surfaces, with_copied_surfaces
from robots.robot import Robot, robot_from
from robots.schema.description import ModelDescription
from robots.urdf.reading import read_urdf
from robots.urdf.xml import is_xml

# The source of figures of the library that were not found published; the class prior of springs goes by such masses.
UNVERIFIED = "recalled"


def bundled_names() -> tuple[str, ...]:
    """Names of the bundled robots: those that somebody measured or described beyond their kinematics."""
    return _names("data")


def library_names() -> tuple[str, ...]:
    """Names of the library's arms: kinematics, limits, payload and the controller's conventions, no springs."""
    return _names("data", "library")


def _names(*folder: str) -> tuple[str, ...]:
    files = resources.files("robots").joinpath(*folder).iterdir()
    return tuple(sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml")))


def library_table() -> list[dict[str, Any]]:
    """What a list says of each arm of the library; its files are ours, so they are read without their checks."""
    out = []
    for name in library_names():
        text = resources.files("robots").joinpath("data", "library", f"{name}.toml").read_text(encoding="utf-8")
        data = parse_toml(text, name)
        figures = {f"{key}_kg": data[key]["value"] if key in data else None for key in ("payload", "mass")}
        formats = data.get("controller", {}).get("formats", [])
        sure = data.get("mass", {}).get("source") != UNVERIFIED
        out.append({"name": name, "title": data["title"], **figures, "mass_verified": sure, "formats": formats})
    return out


@recording()
def load_description(model: str | Path) -> ModelDescription:
    """Read a model by bundled name, from a TOML file, or from a URDF (see :func:`robots.urdf.reading.read_urdf`).

    Surface files of links come back as absolute paths; whether they are there is seen when they are used.

    Raises
    ------
    InputError
        Unknown name, unreadable file, or a file that does not fit the schema (all faults at once).
    """
    name = str(model)
    for names, folder, kind in ((bundled_names, (), "bundled robot"), (library_names, ("library",), "library arm")):
        if name in names():
            text = resources.files("robots").joinpath("data", *folder, f"{name}.toml").read_text(encoding="utf-8")
            return parse_description(text, f"{kind} {name}")
    path = Path(model)
    if not _is_file(path):
        begun = (known for known in library_names() if len(name) > 2 and known.startswith(name.lower()))
        close = meant(name, ", ".join(library_names())) or next(begun, None)
        raise InputError(
            "model",
            code="R001",
            value=name,
            allowed=f"{', '.join((*bundled_names(), *([close] if close else [])))}, an arm of the library, or the path "
            "of a model TOML or a URDF",
            remedy="check the path: there is no such file; `stiffarm robots` lists the names of arms"
            if path.suffix or path.parent != Path()
            else "`stiffarm robots` lists all names; `stiffarm new` makes a model file of another arm",
        )
    if is_xml(path):
        return read_urdf(path).description
    description = parse_description(read_text(path, "model file"), str(path))
    return with_absolute_surfaces(description, path.resolve().parent)


def _is_file(path: Path) -> bool:
    try:
        return path.exists() and not path.is_dir()
    except ValueError:  # a null character in it
        return False


def parse_description(text: str, where: str) -> ModelDescription:
    """Parse and validate a model TOML; ``where`` names it in messages."""
    missing = "add it (a figure is a table { value, unit, source })"
    return validated(ModelDescription, parse_toml(text, where), where, missing=missing)


def load_robot(model: str | Path) -> Robot:
    """Read a model and return its kinematics as arrays."""
    return robot_from(load_description(model))


def to_toml(description: ModelDescription) -> str:
    """Write the description as TOML text; reading it back gives the same description."""
    data = description.model_dump(mode="json", by_alias=True, exclude_none=True)
    # `link = []` would stand in the way of [[link]] tables that a user adds.
    return tomlkit.dumps({key: value for key, value in data.items() if value != []})


def save_description(description: ModelDescription, path: Path) -> None:
    """Write a model TOML, whole or not at all. Never over an existing file.

    The surface files of its links are copied into ``meshes/`` beside it, so that model and meshes travel
    together; a file with the same content that is there already is shared.

    Raises
    ------
    InputError
        The file exists already, its folder does not, or a surface file is gone or not the one that was prepared.
    """
    if path.exists():
        raise InputError(
            f"model file {path} exists already", code="F009", remedy="choose another name; models are never overwritten"
        )
    if not path.parent.is_dir():
        raise InputError(
            f"folder {path.parent} does not exist", code="F008", remedy="make it, or choose another folder"
        )
    with ExitStack() as undo:
        write_whole(path, to_toml(with_copied_surfaces(description, path.parent, undo)))
        undo.pop_all()


def content_hash(description: ModelDescription) -> str:
    """SHA-256 of the description's content, independent of layout, comments and where surface files lie.

    The covariance of calibrated numbers counts where there is one, as notes and sources do: what is made of the model
    with error bars depends on it.
    """
    data = description.model_dump(mode="json", by_alias=True)
    if not data["effect"]:
        del data["effect"]  # models of the time before effects keep their hash
    for key in ("controller", "beam_radius"):
        if data[key] is None:
            del data[key]  # and those of the time before controllers' angles, and before capsules of a given radius
    if data["calibration"] is not None and data["calibration"]["uncertainty"] is None:
        del data["calibration"]["uncertainty"]  # and so do those of the time before covariances
    if data["load"] is not None and data["load"]["point"] is None:
        del data["load"]["point"]  # and those of the time before points could be off
    if data["positions"] is None:
        del data["positions"]  # and those of the time before errors of joints
    for joint in data["joint"]:
        if joint["error"] is None:
            del joint["error"]
    for link in data["link"]:
        for mesh in (link["surface"], link["solid"]):
            if mesh is not None:
                del mesh["file"]  # its sha256 stays
        for key in ("rigid_to", "rigid_from", "solid"):
            if link[key] is None:
                del link[key]  # and those of the time before solids and beams that stop short of a joint
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
