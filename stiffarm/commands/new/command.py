"""The command `new`: a model file of an arm, with what it takes to check and to measure it."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

import fem.arm
from doe.planning.starts import first_loads, pendant_table, write_sheet
from robots import InputError, ModelDescription, load_description, read_urdf, require_one_of, require_positive
from robots.arm_class import CLASS_PRIOR, arm_class
from robots.files.written import sha256_of
from robots.library.commented import SCHEMA_FILE, commented_toml
from robots.library.dh import description_from_dh
from robots.library.models import bundled_names, library_names, parse_description
from robots.quantities import Quantity, angle, significant
from robots.robot import robot_from
from robots.schema.key_words import json_schema
from robots.schema.quantities import Mass, RotationalStiffness
from robots.urdf.expanding import expanded
from stiffarm.arm import Arm, as_face
from stiffarm.capability import capability_without_arm
from stiffarm.commands.new.dh_table import empty_table, read_dh
from stiffarm.request import FILE, NAMES, READINGS, TEXT, Request, argument, option, word
from stiffarm.result import Result, Table
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import refuse_given

TABLE, PENDANT, SHEET = "dh.csv", "pendant.csv", "sheet.csv"
SOURCES = ("mdh", "dh", "urdf", "like")
# No arm bears or weighs less or more.
LIGHTEST_kg, HEAVIEST_kg = 0.01, 1e5
STIFFNESS = Quantity("stiffness", "N m/rad")
Springs = Literal["none", "class"]


@dataclass(frozen=True, kw_only=True)
class NewRequest(Request):
    """Make a model file of a new arm, and tables to check it with.

    Give one of --mdh, --dh, --urdf and --like. Without any, an empty table is written to fill in. The folder gets the
    model with every key explained, a table of poses to read at the pendant (for `stiffarm robots check`), a first
    measuring sheet, and a JSON schema for editors.

    Examples
    --------
    >>> import stiffarm as sa
    >>> mine = sa.new_arm("mine", like="gp25", springs="class", payload_kg=20.0)
    >>> mine.arm.coordinates[0], mine.arm.joints_without_springs
    ('q1_deg', ())
    """

    name: str = argument("Name of the new model, as in my-arm.", TEXT, metavar="NAME", required=True)
    mdh: Path | str | None = option(
        "Table of modified Denavit-Hartenberg parameters (Craig's; CSV/XLSX): joint, alpha_deg, a_mm, d_mm, theta_deg, "
        "lower_deg, upper_deg, sign; last row flange.",
        READINGS,
    )
    dh: Path | str | None = option(
        "The same columns with standard Denavit-Hartenberg parameters; flange row optional.", READINGS
    )
    urdf: Path | str | None = option(
        "URDF or xacro file (xacro: with the extra `xacro`): kinematics and limits. `stiffarm import` takes meshes "
        "too.",
        FILE,
    )
    like: Path | str | None = option(
        "Begin with this arm: a name of `stiffarm robots`, or a model TOML.", TEXT, metavar="ARM"
    )
    title: str | None = option("Full name, for pages. Default: NAME.")
    payload_kg: float | None = option("Rated payload, in kg.")
    mass_kg: float | None = option("Mass of the arm, in kg.")
    springs: Springs = option(
        "Springs of joints that have none: none (rigid until calibrated), or class (the middle of the range for arms "
        "of this size, marked as a prior).",
        word(Springs),
        default="none",
    )
    tip: str | None = option("With --urdf: link at the end of the arm. Default: where most revolute joints lead.")
    base: str | None = option("With --urdf: link at the base of the arm. Default: the root link.")
    controller: tuple[str, ...] | str | None = option(
        "Program formats of its controller (see `stiffarm post --format`), which counts the joints as this model does; "
        "another sign, zero or coupling goes into [controller] of the model file.",
        NAMES,
        metavar="FORMAT,...",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_name(self.name)
        for mass, value in (("--payload-kg", self.payload_kg), ("--mass-kg", self.mass_kg)):
            require_positive(mass, value, "kg", code="R006")
            if value is not None and not LIGHTEST_kg <= value <= HEAVIEST_kg:
                allowed = f"{LIGHTEST_kg:g} to {HEAVIEST_kg:g} kg"
                raise InputError(mass, code="R006", value=value, allowed=allowed, remedy="give kg")
        given = self.given(*SOURCES)
        if len(given) > 1:
            raise InputError(
                ", ".join(given), code="A002", allowed="one of them", remedy="an arm comes from one source"
            )
        if self.urdf is None:
            refuse_given({"--tip": self.tip, "--base": self.base}, "only with --urdf", "leave it out")
        if not given:
            changes = self.given("title", "payload_kg", "mass_kg", "springs", "controller")
            remedy = "give --mdh, --dh, --urdf or --like too"
            refuse_given(dict.fromkeys(changes, "given"), "nothing to apply it to yet", remedy)

    @property
    def folder(self) -> Path:
        """The folder of the files where ``--out`` names none."""
        return Path(self.name)


def _check_name(name: str) -> None:
    """Refuse a name that files and tables cannot bear, or that an arm has."""
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


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class NewArm(Result):
    """A new arm, or an empty table where it comes from nothing yet. ``save`` writes its files.

    These are the model, its schema, and tables to check and to measure by.
    """

    arm: Arm | None = None

    def write(self, folder: OutputFolder) -> dict[str, Any]:
        """The files of the new arm, and none about them."""
        assert self.more is not None  # noqa: S101 - all have it
        self.more(folder)
        return self.as_json

    def save(self, folder: str | Path) -> Path:
        """Write the files into a folder; returns the path of the model, or of the empty table."""
        return super().save(folder) / str(self.facts["files"][0])


def answer(asked: NewRequest) -> NewArm:
    """The arm that is described, or an empty table to describe it with."""
    if not asked.given(*SOURCES):
        return _empty(asked.name)
    description = _described(asked)
    if asked.springs == "class":
        description = _with_class_springs(description)
    if asked.controller is not None:
        description = _with_controller(description, tuple(asked.controller))
    robot, model = robot_from(description), f"{asked.name}.toml"
    text = commented_toml(description)
    parse_description(text, model)  # what is written can be read
    low, high = robot.limits.T
    arm = as_face(fem.arm.Arm.of(description))
    rigid = [joint.name for joint in description.joint if joint.stiffness is None]
    loads = first_loads(robot, description).tolist()
    formats = [] if description.controller is None else list(description.controller.formats)
    stiffness = arm.describe()["stiffness_Nm_per_rad"].to_numpy()
    remarks = [
        f"{SHEET} is a first sheet ({', '.join(significant(load) for load in loads)} N); `stiffarm plan` chooses "
        "set-ups that tell more"
    ]
    if not formats:
        remarks.append(
            "programs for its controller need its joint convention: which formats does it read, and does it count the "
            "angles as this model? If so, give --controller FORMAT; if not, fill in [controller] of the model file"
        )
    if rigid:
        remarks.append(
            f"no springs yet, rigid until calibrated: {', '.join(rigid)} (--springs class takes the middle of the "
            "arm's class, marked as a prior)"
        )

    def write(folder: OutputFolder) -> Mapping[str, Any]:
        folder.write_text(model, text)
        folder.write_json(SCHEMA_FILE, json_schema())
        folder.write_text(PENDANT, pendant_table(robot))
        write_sheet(folder.path(SHEET), robot, description)
        return {}

    return NewArm(
        name="new",
        title=description.title,
        question="what is known of this arm?",
        answer=f"{description.title}: {len(description.joint)} joint{'s' * (len(description.joint) != 1)}; model "
        f"{model}, every key explained.",
        what_next=f"Drive to the poses of {PENDANT}, fill in what the controller shows, then: "
        f"stiffarm robots check FOLDER/{model} FOLDER/{PENDANT}",
        facts={
            "name": asked.name,
            "model": model,
            "joints_without_springs": rigid,
            "controller_formats": formats,
            "files": [model, SCHEMA_FILE, PENDANT, SHEET],
            "sheet_loads_N": loads,
        },
        tables=(
            Table(
                "joints",
                "Joints",
                {"joint": robot.joint_names, "coordinate": robot.coordinates},
                {angle("from"): low, angle("to"): high, STIFFNESS: stiffness},
            ),
        ),
        remarks=tuple(remarks),
        arm=arm,
        more=write,
    )


def _empty(name: str) -> NewArm:
    def write(folder: OutputFolder) -> Mapping[str, Any]:
        folder.write_text(TABLE, empty_table())
        return {}

    return NewArm(
        name="new",
        title=name,
        question="what is known of this arm?",
        answer=f"An empty table to fill in: {TABLE}.",
        what_next=f"Fill it in, then: stiffarm new {name} --mdh FOLDER/{TABLE}",
        facts={"name": name, "table": TABLE, "files": [TABLE]},
        remarks=(
            "one row per joint: alpha_deg and a_mm from the previous axis, d_mm along its own axis (modified "
            "Denavit-Hartenberg parameters), theta_deg where its coordinate reads 0, its limits; last row: the flange",
            "for standard parameters (alpha_deg and a_mm to the next axis) use --dh in place of --mdh, and remove the "
            "row flange unless there is an offset after the last joint",
        ),
        more=write,
    )


def _described(asked: NewRequest) -> ModelDescription:
    """A description from the source that is given.

    Raises
    ------
    InputError
        Every fault of a table, a URDF that cannot be read, or an arm that is not known.
    """
    table = asked.mdh or asked.dh
    if table is not None:
        lines, flange = read_dh(Path(table), "--dh" if asked.mdh is None else "--mdh")
        return description_from_dh(
            lines,
            flange,
            "standard" if asked.mdh is None else "modified",
            name=asked.name,
            title=asked.title or asked.name,
            where=Path(table).name,
            sha256=sha256_of(Path(table)),
            payload_kg=asked.payload_kg,
            mass_kg=asked.mass_kg,
        )
    if asked.urdf is not None:
        found = _from_urdf(Path(asked.urdf), asked.tip, asked.base)
    else:  # without a calibration, which was of another specimen
        found = load_description(str(asked.like)).model_copy(update={"calibration": None})
    masses = {"payload": asked.payload_kg, "mass": asked.mass_kg}
    changes: dict[str, Any] = {"name": asked.name} | ({} if asked.title is None else {"title": asked.title})
    given = {key: Mass(value=v, unit="kg", source="given") for key, v in masses.items() if v is not None}
    if given:
        changes["sources"] = {**found.sources, "given": "given when this file was made"}
    return _changed(found, **changes | {key: one.model_dump(exclude_none=True) for key, one in given.items()})


def _changed(description: ModelDescription, **changes: Any) -> ModelDescription:
    """A description with other values, checked as a whole again."""
    return ModelDescription.model_validate(description.model_dump(by_alias=True, exclude_none=True) | changes)


def _from_urdf(path: Path, tip: str | None, base: str | None) -> ModelDescription:
    """A description from a URDF, or from a xacro file that is expanded first."""
    if path.suffix.lower() != ".xacro":
        return read_urdf(path, tip=tip, base=base).description
    text = expanded(path)
    with tempfile.TemporaryDirectory() as folder:
        urdf = Path(folder) / f"{path.name.split('.')[0]}.urdf"
        urdf.write_text(text, encoding="utf-8")
        found = read_urdf(urdf, tip=tip, base=base).description
    sources = {key: f"{path.name}, SHA-256 {sha256_of(path)}, expanded by xacro" for key in found.sources}
    return found.model_copy(update={"sources": sources, "title": f"{found.title.split(',')[0]}, from {path.name}"})


def _with_class_springs(description: ModelDescription) -> ModelDescription:
    """Springs about the axes where there are none: the middle of what arms of this size have, and marked so."""
    prior = arm_class(description, robot_from(description))
    joints = [
        joint if joint.stiffness is not None else joint.model_copy(update={"stiffness": _middle(low, high)})
        for joint, low, high in zip(description.joint, prior.low.tolist(), prior.high.tolist(), strict=True)
    ]
    said = f"class prior: the middle of the range for arms of this size ({prior.size}); not measured on this arm"
    sources: Mapping[str, str] = {**description.sources, CLASS_PRIOR: said}
    return _changed(description.model_copy(update={"joint": tuple(joints), "sources": sources}))


def _middle(low: float, high: float) -> RotationalStiffness:
    """The geometric mean, to two digits: more would look like a measurement."""
    note = f"range of the class: {low:.2g} to {high:.2g}"
    value = float(f"{np.sqrt(low * high):.2g}")
    return RotationalStiffness(value=value, unit="N m/rad", source=CLASS_PRIOR, note=note)


def _with_controller(description: ModelDescription, formats: tuple[str, ...]) -> ModelDescription:
    """With a controller that reads these program formats, and counts joints as the model does.

    Raises
    ------
    InputError
        A format that is none of a controller.
    """
    from machining.programs.formats import FORMATS

    for name in formats:
        require_one_of("--controller", name, [key for key, one in FORMATS.items() if not one.neutral], code="R006")
    own = description.model_dump(by_alias=True, exclude_none=True).get("controller", {})
    return _changed(description, controller=own | {"formats": formats})


new_arm = capability_without_arm("new", NewRequest, answer, function="new_arm")
