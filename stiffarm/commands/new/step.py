"""A new model's description: from a table, a URDF, or an arm that is known."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from robots import InputError, ModelDescription, load_description, read_urdf, require_one_of, require_positive
from robots.arm_class import CLASS_PRIOR, arm_class
from robots.files.written import sha256_of
from robots.library.commented import SCHEMA_FILE, commented_toml
from robots.library.dh import Form, description_from_dh
from robots.library.models import bundled_names, library_names, parse_description
from robots.robot import robot_from
from robots.schema.key_words import json_schema
from robots.schema.quantities import Mass, RotationalStiffness
from robots.urdf.expanding import expanded
from stiffarm.commands.new.dh_table import read_dh
from stiffarm.commands.new.starts import pendant_table, write_sheet
from stiffarm.session.outputs import OutputFolder

# No arm bears or weighs less or more.
LIGHTEST_kg, HEAVIEST_kg = 0.01, 1e5


def checked_name(name: str) -> str:
    """A name that files and tables can bear."""
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,60}", name) or name.endswith("."):
        raise InputError(
            "NAME",
            code="R006",
            value=name,
            allowed="up to 61 letters, digits, - _ . beginning with a letter or digit",
            remedy="give a short name, as in my-arm",
        )
    if name in (*bundled_names(), *library_names()):
        raise InputError(
            "NAME",
            code="R006",
            value=name,
            allowed="a name that no arm of `stiffarm robots` has",
            remedy=f"call it my-{name}, say: commands would take the one for the other",
        )
    return name


def check_masses(given: Mapping[str, float | None]) -> None:
    """Refuse masses in other units than kg."""
    for option, value in given.items():
        require_positive(option, value, "kg", code="R006")
        if value is not None and not LIGHTEST_kg <= value <= HEAVIEST_kg:
            raise InputError(
                option, code="R006", value=value, allowed=f"{LIGHTEST_kg:g} to {HEAVIEST_kg:g} kg", remedy="give kg"
            )


def given_of(sources: Mapping[str, str | Path | None]) -> dict[str, str | Path]:
    """The one source that is given by its option; empty where none is.

    Raises
    ------
    InputError
        More than one.
    """
    given = {key: value for key, value in sources.items() if value is not None}
    if len(given) > 1:
        raise InputError(", ".join(given), code="A002", allowed="one of them", remedy="an arm comes from one source")
    return given


def described(
    name: str,
    given: Mapping[str, str | Path],
    title: str | None,
    payload_kg: float | None,
    mass_kg: float | None,
    tip: str | None = None,
    base: str | None = None,
) -> ModelDescription:
    """A description from the source that is given by its option: --mdh, --dh, --urdf or --like.

    Raises
    ------
    InputError
        Every fault of a table, a URDF that cannot be read, or an arm that is not known.
    """
    ((option, source),) = given.items()
    if option in ("--mdh", "--dh"):
        form: Form = "modified" if option == "--mdh" else "standard"
        return from_table(Path(source), form, name, title, payload_kg, mass_kg)
    found = from_urdf(Path(source), tip, base) if option == "--urdf" else from_arm(str(source))
    return changed(found, name, title, payload_kg, mass_kg)


def from_table(
    path: Path, form: Form, name: str, title: str | None, payload_kg: float | None, mass_kg: float | None
) -> ModelDescription:
    """A description from a table of Denavit-Hartenberg parameters."""
    lines, flange = read_dh(path, "--mdh" if form == "modified" else "--dh")
    return description_from_dh(
        lines,
        flange,
        form,
        name=name,
        title=title or name,
        where=path.name,
        sha256=sha256_of(path),
        payload_kg=payload_kg,
        mass_kg=mass_kg,
    )


def from_urdf(path: Path, tip: str | None, base: str | None) -> ModelDescription:
    """A description from a URDF, or from a xacro file that is expanded first."""
    if not path.is_file():
        raise InputError(
            "--urdf", code="A007", value=str(path), allowed="an existing URDF or xacro file", remedy="check the path"
        )
    if path.suffix.lower() != ".xacro":
        return read_urdf(path, tip=tip, base=base).description
    text = expanded(path)
    with tempfile.TemporaryDirectory() as folder:
        urdf = Path(folder) / f"{path.name.split('.')[0]}.urdf"
        urdf.write_text(text, encoding="utf-8")
        found = read_urdf(urdf, tip=tip, base=base).description
    sources = {key: f"{path.name}, SHA-256 {sha256_of(path)}, expanded by xacro" for key in found.sources}
    return found.model_copy(update={"sources": sources, "title": f"{found.title.split(',')[0]}, from {path.name}"})


def from_arm(arm: str) -> ModelDescription:
    """The description of an arm that is known, without a calibration: that was of another specimen."""
    return load_description(arm).model_copy(update={"calibration": None})


def changed(
    description: ModelDescription, name: str, title: str | None, payload_kg: float | None, mass_kg: float | None
) -> ModelDescription:
    """The same under another name, with figures given; checked as a whole again."""
    data: dict[str, Any] = description.model_dump(by_alias=True, exclude_none=True)
    data |= {"name": name} | ({} if title is None else {"title": title})
    given = {"payload": payload_kg, "mass": mass_kg}
    if any(value is not None for value in given.values()):
        data["sources"] = {**data["sources"], "given": "given when this file was made"}
        data |= {
            key: Mass(value=v, unit="kg", source="given").model_dump(exclude_none=True)
            for key, v in given.items()
            if v is not None
        }
    return ModelDescription.model_validate(data)


def with_class_springs(description: ModelDescription) -> ModelDescription:
    """Springs about the axes where there are none: the middle of what arms of this size have, and marked so."""
    prior = arm_class(description, robot_from(description))
    joints = [
        joint if joint.stiffness is not None else joint.model_copy(update={"stiffness": _middle(low, high)})
        for joint, low, high in zip(description.joint, prior.low.tolist(), prior.high.tolist(), strict=True)
    ]
    said = f"class prior: the middle of the range for arms of this size ({prior.size}); not measured on this arm"
    sources: Mapping[str, str] = {**description.sources, CLASS_PRIOR: said}
    changed_ = description.model_copy(update={"joint": tuple(joints), "sources": sources})
    return ModelDescription.model_validate(changed_.model_dump(by_alias=True, exclude_none=True))


def with_controller(description: ModelDescription, formats: str) -> ModelDescription:
    """With a controller that reads these program formats, separated by commas, and counts joints as the model does.

    Raises
    ------
    InputError
        A format that is none of a controller.
    """
    from machining.programs.formats import FORMATS

    names = [name.strip() for name in formats.split(",")]
    for name in names:
        require_one_of("--controller", name, [key for key, one in FORMATS.items() if not one.neutral], code="R006")
    data: dict[str, Any] = description.model_dump(by_alias=True, exclude_none=True)
    data["controller"] = data.get("controller", {}) | {"formats": tuple(names)}
    return ModelDescription.model_validate(data)


def _middle(low: float, high: float) -> RotationalStiffness:
    """The geometric mean, to two digits: more would look like a measurement."""
    value = float(f"{np.sqrt(low * high):.2g}")
    note = f"range of the class: {low:.2g} to {high:.2g}"
    return RotationalStiffness(value=value, unit="N m/rad", source=CLASS_PRIOR, note=note)


def write_files(folder: OutputFolder, description: ModelDescription, name: str) -> dict[str, Any]:
    """The model with every key explained, its schema, the pendant's table and a first sheet; what there is, as JSON."""
    robot = robot_from(description)
    text = commented_toml(description)
    parse_description(text, f"{name}.toml")  # what is written can be read
    folder.write_text(f"{name}.toml", text)
    folder.write_json(SCHEMA_FILE, json_schema())
    folder.write_text("pendant.csv", pendant_table(robot))
    loads = write_sheet(folder.path("sheet.csv"), robot, description)
    rigid = [joint.name for joint in description.joint if joint.stiffness is None]
    return {
        "name": name,
        "model": f"{name}.toml",
        "joints": len(description.joint),
        "joints_without_springs": rigid,
        "controller_formats": [] if description.controller is None else list(description.controller.formats),
        "files": [f"{name}.toml", SCHEMA_FILE, "pendant.csv", "sheet.csv"],
        "sheet_loads_N": list(loads),
    }
