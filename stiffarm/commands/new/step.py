"""A new model's description: from a table, a URDF, or an arm that is known."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from robots import InputError, ModelDescription, load_description, read_urdf
from robots.arm_class import arm_class
from robots.files.written import sha256_of
from robots.library.dh import Form, description_from_dh
from robots.robot import robot_from
from robots.schema.quantities import Mass, RotationalStiffness
from robots.urdf.expanding import expanded
from stiffarm.commands.new.dh_table import read_dh
from stiffarm.session.caution import CLASS_PRIOR


def checked_name(name: str) -> str:
    """A name that files and tables can bear."""
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,60}", name) or name.endswith("."):
        raise InputError("NAME", value=name, allowed="up to 61 letters, digits, - _ . beginning with a letter or digit",
                         remedy="give a short name, as in my-arm")  # fmt: skip
    return name


def from_table(
    path: Path, form: Form, name: str, title: str | None, payload_kg: float | None, mass_kg: float | None
) -> ModelDescription:
    """A description from a table of Denavit-Hartenberg parameters."""
    lines, flange = read_dh(path, "--mdh" if form == "modified" else "--dh")
    return description_from_dh(
        lines, flange, form, name=name, title=title or name, where=path.name, sha256=sha256_of(path),
        payload_kg=payload_kg, mass_kg=mass_kg,
    )  # fmt: skip


def from_urdf(path: Path, tip: str | None, base: str | None) -> ModelDescription:
    """A description from a URDF, or from a xacro file that is expanded first."""
    if not path.is_file():
        raise InputError("--urdf", value=str(path), allowed="an existing URDF or xacro file", remedy="check the path")
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
        data |= {key: Mass(value=v, unit="kg", source="given").model_dump(exclude_none=True)
                 for key, v in given.items() if v is not None}  # fmt: skip
    return ModelDescription.model_validate(data)


def with_class_springs(description: ModelDescription) -> ModelDescription:
    """Springs about the axes where there are none: the middle of what arms of this size have, and marked so."""
    prior = arm_class(description, robot_from(description))
    joints = [
        joint if joint.stiffness is not None else joint.model_copy(update={"stiffness": _middle(low, high)})
        for joint, low, high in zip(description.joint, prior.low.tolist(), prior.high.tolist(), strict=True)
    ]
    said = f"class prior: the middle of what arms of this size have ({prior.size}); not measured on this arm"
    sources: Mapping[str, str] = {**description.sources, CLASS_PRIOR: said}
    changed_ = description.model_copy(update={"joint": tuple(joints), "sources": sources})
    return ModelDescription.model_validate(changed_.model_dump(by_alias=True, exclude_none=True))


def _middle(low: float, high: float) -> RotationalStiffness:
    """The geometric mean, to two digits: more would look like a measurement."""
    value = float(f"{np.sqrt(low * high):.2g}")
    note = f"range of the class: {low:.2g} to {high:.2g}"
    return RotationalStiffness(value=value, unit="N m/rad", source=CLASS_PRIOR, note=note)
