"""The command `robots`: the bundled robots and the library's arms, one with its figures, its poses, its kinematics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer
from typer.core import TyperGroup

from doe import bundled_data
from robots import InputError, ModelDescription, Robot, bundled_names, load_description
from robots.arm_class import arm_class
from robots.joint_errors import designed
from robots.library.models import library_table
from robots.quantities import Quantity, angle, significant
from robots.robot import robot_from
from robots.schema.description import Joint
from robots.schema.quantities import RotationalStiffness
from stiffarm.capability import capability_without_arm
from stiffarm.commands.robots.check import CheckRequest, check_kinematics
from stiffarm.request import POSE, TEXT, ByName, Request, argument, option, pose_of
from stiffarm.result import Result, Table
from stiffarm.session.table_kinds import described

if TYPE_CHECKING:
    from fem.arm import Arm
else:
    # The list needs no mechanics.
    Arm = Any

__all__ = ["CheckRequest", "check_kinematics", "group", "robots"]
PAYLOAD, MASS = Quantity("payload", "kg"), Quantity("mass", "kg")
STIFFNESS = Quantity("stiffness", "N m/rad")
CLASS = tuple(Quantity(f"class_{end}", "N m/rad", label=f"class, {end}", digits=2) for end in ("low", "high"))
CASING, REST = Quantity("casing", "kg"), Quantity("rest", "kg", label="drives and the rest")
DECLARED = Quantity("declared", "kg")


class _Robots(TyperGroup):
    """`stiffarm robots NAME` is short for `stiffarm robots show NAME`."""

    def parse_args(self, ctx: Any, args: list[str]) -> Any:
        named = bool(args) and (args[0] in self.commands or args[0] == "--help")
        return super().parse_args(ctx, args if named else ["show", *args])


group = typer.Typer(
    cls=_Robots,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="""List robots, show one, or check its kinematics.

    `stiffarm robots` lists all; `stiffarm robots NAME` is short for `stiffarm robots show NAME`.
    """,
)


@dataclass(frozen=True, kw_only=True)
class RobotsRequest(Request):
    """List the robots, or show one in detail.

    Details are joint limits, stiffnesses and masses, with their sources. With --pose: where the tool is.

    Examples
    --------
    >>> import stiffarm as sa
    >>> "xr701" in list(sa.robots().to_frame()["name"])
    True
    """

    name: Arm | Path | str | None = argument(
        "Show this robot in detail: a name of the list, a model TOML or a URDF.", TEXT, metavar="[NAME]"
    )
    pose: ByName | None = option(
        "Joint angles in deg, as in q2_deg=-90,q3_deg=90 (others 0), or the controller's angles. Shows where the tool "
        "is, in the usual controllers' conventions.",
        POSE,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.name is None and self.pose is not None:
            raise InputError(
                "--pose",
                code="A003",
                allowed="with a robot's name",
                remedy="name the robot first, as in `stiffarm robots kr60-3 --pose q2_deg=-90,q3_deg=90`",
            )


def answer(asked: RobotsRequest) -> Result:
    """All robots, one of them, or where its tool is."""
    if asked.name is None:
        return _list()
    description = described(str(asked.name)) if isinstance(asked.name, str | Path) else asked.name.description
    if asked.pose is None:
        return _one(description)
    description = designed(description)
    robot = robot_from(description)
    from stiffarm.commands.robots.pose import of_pose

    return of_pose(description, robot, pose_of(robot, asked.pose, "--pose"))


def _list() -> Result:
    found = [load_description(name) for name in bundled_names()]
    library = library_table()
    bundled: dict[str, Sequence[str | bool]] = {
        "name": [d.name for d in found],
        "title": [d.title for d in found],
        "load_path": [d.load_path for d in found],
        "measured_readings": [_readings(d.name) for d in found],
    }
    others: dict[str, Sequence[str | bool]] = {
        "name": [a["name"] for a in library],
        "title": [a["title"] for a in library],
        "programs": [", ".join(a["formats"]) for a in library],
        "mass_not_verified": [a["mass_kg"] is not None and not a["mass_verified"] for a in library],
    }
    values = {
        quantity: np.array([np.nan if a[quantity.column] is None else a[quantity.column] for a in library])
        for quantity in (PAYLOAD, MASS)
    }
    return Result(
        name="robots",
        title="Robots",
        question="which arms are here?",
        answer=f"{len(found)} robots are bundled, and the library has {len(library)} more arms.",
        what_next="`stiffarm robots NAME` shows one.",
        tables=(
            Table("robots", "Bundled robots", bundled, {}, extra={"joints": [len(d.joint) for d in found]}),
            Table(
                "library",
                "Library: kinematics, limits and conventions, no springs",
                others,
                values,
                extra={key: [a[key] for a in library] for key in library[0] if key not in ("name", "title")},
                shown=len(library),
            ),
        ),
        remarks=("masses that are not verified were not found published, but recalled from data sheets",),
    )


def _readings(name: str) -> str:
    """The file of the measured readings that come with a robot; empty without any."""
    try:
        return bundled_data(name).name
    except InputError:
        return ""


def _one(description: ModelDescription) -> Result:
    """Joints, limits, springs, masses and notes of one robot."""
    robot, joints = robot_from(description), description.joint
    prior, masses = arm_class(description, robot), _masses(description, robot)
    low, high = np.array([joint.limits.si_array for joint in joints]).T
    without = np.array([joint.stiffness is None for joint in joints])
    springs = [j.stiffness.si if isinstance(j.stiffness, RotationalStiffness) else np.nan for j in joints]
    ends = (np.where(without, end, np.nan) for end in (prior.low, prior.high))
    labels = {
        "joint": [joint.name for joint in joints],
        "coordinate": [joint.coordinate for joint in joints],
        "stiffness_from": [_source(joint) for joint in joints],
    }
    values = {angle("from"): low, angle("to"): high, STIFFNESS: np.array(springs)}
    values |= dict(zip(CLASS, ends, strict=True)) if without.any() else {}
    remarks = [*_couplings(description), *description.notes]
    if without.any():
        remarks.insert(
            0, f"class: the range that arms of this size have ({prior.size}), a prior and no measurement of this arm"
        )
    return Result(
        name="robot",
        title=description.title,
        question="what is known of this arm?",
        answer=f"{description.title}: {len(joints)} joints, {int((~without).sum())} of them with a spring.",
        facts={
            "model": description.model_dump(mode="json", by_alias=True, exclude_none=True),
            "class": prior.size,
        },
        tables=(Table("joints", "Joints", labels, values), *masses[0]),
        warnings=masses[1],
        remarks=tuple(remarks),
        caution="",
    )


def _source(joint: Joint) -> str:
    if joint.stiffness is None:
        return "none, rigid"
    if isinstance(joint.stiffness, RotationalStiffness):
        return joint.stiffness.source
    return f"depends on {', '.join(joint.stiffness.inputs)}"


def _couplings(description: ModelDescription) -> list[str]:
    """Limits that couple joints, and how the controller counts."""
    out = []
    for coupling in description.coupling:
        terms = " ".join(f"{t.factor:+g} {t.coordinate}" for t in coupling.terms)
        low, high = (significant(v, 4) for v in np.degrees(coupling.limits.si_array))
        offset = 0.0 if coupling.offset is None else float(np.degrees(coupling.offset.si))
        out.append(
            f"coupled limit {coupling.name}: {low} <= {significant(offset, 4)} {terms} <= {high} deg "
            f"({coupling.limits.source})"
        )
    for one in description.controller.angle if description.controller is not None else ():
        terms = " ".join(f"{t.factor:+g} {t.axis}" for t in one.terms)
        offset = 0.0 if one.offset is None else float(np.degrees(one.offset.si))
        out.append(f"controller: {one.coordinate} = {significant(offset, 4)} {terms}")
    return out


def _masses(description: ModelDescription, robot: Robot) -> tuple[tuple[Table, ...], tuple[str, ...]]:
    """Masses of casings and what the file declares, up to the robot's own mass; and what cannot be."""
    from meshes import robot_masses

    masses = robot_masses(description, robot)
    rows: list[tuple[str, float | None, float | None, float | None]]
    rows = [(link.name, link.casing.kg, link.rest_kg, link.declared_kg) for link in masses.links]
    if masses.crank is not None:  # they declare none: they weigh what their sections do
        rows += [(name, kg, None, kg) for name, kg in (("bar", masses.bar_kg), ("crank", masses.crank.kg))]
    rows += [("all parts", None, None, masses.sum_kg), ("the robot", None, None, masses.robot_kg)]
    columns = np.array([[np.nan if kg is None else kg for kg in row[1:]] for row in rows]).T
    light = [link.name for link in masses.links if link.rest_kg is not None and link.rest_kg < 0.0]
    table = Table(
        "masses",
        "Masses",
        {"part": [row[0] for row in rows]},
        dict(zip((CASING, REST, DECLARED), columns, strict=True)),
    )
    said = (f"declared lighter than the casing: {', '.join(light)}",) if light else ()
    return (table,) if masses.links else (), said


robots = capability_without_arm("robots show", RobotsRequest, answer, function="robots")
