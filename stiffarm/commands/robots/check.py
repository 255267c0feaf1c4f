"""`robots check`: what is wrong between a model and the controller, in words and as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from robots import ModelDescription, Robot, require_positive
from robots.arrays import Array
from robots.frames import rpy_of
from robots.joint_errors import designed
from robots.quantities import angle, length, rounded, significant
from robots.robot import robot_from
from stiffarm.capability import capability_without_arm
from stiffarm.pages.report import KeyFigure, Section, Text
from stiffarm.request import READINGS, TEXT, Request, argument, option
from stiffarm.result import Drawing, Result, Table
from stiffarm.session.table_kinds import described

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fem.arm import Arm
    from robots.pendant.check import PendantCheck
    from robots.pendant.explanations import Explanation
    from robots.pendant.slips import Slip
else:
    # The list of robots is made by this module's neighbour and needs no mechanics.
    Arm = Any

# Explanations that are written out.
MOST_TOLD: Final = 4
# An offset this near to a quarter turn is one, rad.
QUARTER_rad: Final = float(np.radians(0.05))
# A pitch this near to 90 deg leaves roll and yaw to one another, deg.
GIMBAL_deg: Final = 0.05
# Orientations agree up to this, deg; controllers show hundredths.
SAME_deg: Final = 0.1
DISTANCE, PUT_RIGHT = length("distance"), length("put_right", "put right")
HOW_READ: Final = (
    "x, y, z: as the controller shows them. dx, dy, dz: these less the model's, along the axes of its base. Put right: "
    "what is left when all that is named first is changed in the model."
)


@dataclass(frozen=True, kw_only=True)
class CheckRequest(Request):
    r"""Compare a model's kinematics with positions read at the controller, and name what is wrong.

    Finds a wrong sign or zero of a joint, a coupled joint, a wrong length, another base or tool frame, and radians in
    place of degrees.

    Examples
    --------
    >>> import stiffarm as sa, tempfile
    >>> file = tempfile.mkdtemp() + "/pendant.csv"
    >>> head, read = "q1_deg,q2_deg,q3_deg,x_mm,y_mm,z_mm", ["0,-90,90,495,0,675", "10,-20,30,1102.6,194.4,105.6"]
    >>> _ = open(file, "w").write("\n".join([head, *read, "30,-60,60,796.7,460.0,561.1"]))
    >>> sa.check_kinematics("kr60-3", file).verdict
    'agrees'
    """

    model: Arm | Path | str = argument(
        "A bundled name (see `stiffarm robots`), a model TOML or a URDF.", TEXT, metavar="MODEL", required=True
    )
    pendant: Path | str = argument(
        "Table (CSV/XLSX) with a row for each pose: joint angles in deg, x_mm, y_mm, z_mm of the tool as the "
        "controller shows them, and optionally an orientation (a_deg b_deg c_deg, w_deg p_deg r_deg, qw qx qy qz and "
        "others).",
        READINGS,
        metavar="PENDANT",
        required=True,
    )
    tolerance_mm: float = option("Positions closer than this agree, in mm.", default=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive("--tolerance-mm", self.tolerance_mm, "mm", code="R007")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class KinematicsCheck(Result):
    """A model's kinematics beside positions read at the controller."""

    found: PendantCheck

    @property
    def verdict(self) -> str:
        """One of "agrees", "explained", "orientation" (only that is off), "misread" (a few poses) or "unexplained"."""
        return str(self.facts["verdict"])

    @property
    def largest_mm(self) -> float:
        """The largest difference as the model stands."""
        return float(self.facts["largest_mm"])

    @property
    def remedies(self) -> dict[str, str]:
        """What to write in the model, by what is wrong."""
        return {one["words"]: one["remedy"] for one in _named_first(self.facts)}


def _named_first(facts: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The changes of the first explanation, or of what is closest to one."""
    first = (facts["explanations"] or [facts["closest"]])[0]
    return [] if first is None else first["changes"]


def answer(asked: CheckRequest) -> KinematicsCheck:
    """Compare, and name what is wrong."""
    given = described(str(asked.model)) if isinstance(asked.model, str | Path) else asked.model.description
    description, name = designed(given), asked.model if isinstance(asked.model, str) else given.name
    robot = robot_from(description)
    from robots.pendant.check import check_pendant
    from stiffarm.commands.robots.pendant_table import read_pendant

    readings, convention, remarks = read_pendant(Path(asked.pendant), robot, str(name))
    found = check_pendant(robot, readings, 1e-3 * asked.tolerance_mm)
    facts = _facts(description, robot, found, convention)
    verdict, changes = facts["verdict"], _named_first(facts)
    then = np.linalg.norm(found.left if found.misread else found.best.fit.left, axis=1)
    agree = facts["largest_mm"] <= facts["tolerance_mm"]
    but = agree and found.orientation is not None and verdict != "agrees"
    title = description.title.split(" (")[0]
    fewest = (
        f"{len(changes)} change{'s' * (len(changes) != 1)} of the model explain{'s' * (len(changes) == 1)} all poses"
    )
    sure = {
        "agrees": "Nothing needs to be changed.",
        "orientation": "Positions agree; orientations do not.",
        "explained": f"{fewest}: the fewest of signs, zeros, couplings, lengths and frames that do.",
        "misread": "All other poses agree, and no usual slip of the model explains these.",
        "unexplained": "No usual slip, up to three at once, explains this.",
    }[verdict]
    said = _said(facts)
    by_pose = {
        **{length(f"d{axis}"): found.left[:, k] for k, axis in enumerate("xyz")},
        DISTANCE: found.distance,
        PUT_RIGHT: then,
    }
    read = {length(axis): readings.position[:, k] for k, axis in enumerate("xyz")}
    read |= {angle(name): readings.q[:, k] for k, name in enumerate(robot.coordinates)}
    distances = {"as it stands": found.distance} | ({"with that put right": then} if changes else {})
    key = [KeyFigure(DISTANCE.text(found.distance.max(), unit=True), "largest difference as the model stands")]
    if changes:
        key.append(KeyFigure(PUT_RIGHT.text(then.max(), unit=True), "with what is named put right"))
    return KinematicsCheck(
        name="check",
        title=title,
        question="do the kinematics agree with the controller?",
        answer=f"{description.title}: positions {'agree' if agree else 'do NOT agree'} with the controller, "
        f"{'orientations do NOT, ' if but else ''}largest difference "
        f"{DISTANCE.text(found.distance.max(), unit=True)} over {facts['poses']} poses, tolerance "
        f"{asked.tolerance_mm:g} mm.",
        how_sure=sure,
        what_next=next((remedy for _, remedy in said if remedy), ""),
        facts=facts,
        tables=(
            Table(
                "by_pose",
                "Difference as the model stands, and with what is named put right",
                {"pose": readings.labels},
                by_pose,
                in_files=read,
                folded=verdict in ("agrees", "orientation"),
            ),
        ),
        drawings=(
            Drawing(
                "skeleton",
                "The arm in the pose that is farthest off, and the tool of all poses, from the side and from above.",
                "the arm and where its tool is",
                partial(_skeleton, robot, found),
            ),
            Drawing(
                "distances",
                "How far the tool is from where the controller shows it, pose by pose.",
                "distance between controller and model",
                partial(_bars, readings.labels, distances, asked.tolerance_mm),
            ),
        ),
        key=tuple(key),
        sections=(Section("How to read the table", (Text(HOW_READ),), folded=True),),
        remarks=(*remarks, *(f"{words}{f'. To fix it: {remedy}' if remedy else ''}" for words, remedy in said)),
        caution="",
        found=found,
        made_of=f"{facts['poses']} poses read at the controller",
    )


def _skeleton(robot: Robot, found: PendantCheck) -> Figure:
    from stiffarm.commands.robots.figures import skeleton_figure

    return skeleton_figure(robot, found)


def _bars(labels: tuple[str, ...], distances: Mapping[str, Array], tolerance_mm: float) -> Figure:
    from stiffarm.pages.bars import bars_figure

    series = {name: dict(zip(labels, (1e3 * d).tolist(), strict=True)) for name, d in distances.items()}
    heading = "Distance between controller and model"
    return bars_figure(heading, series, "distance (mm)", "pose", {"allowed": tolerance_mm})


def _facts(description: ModelDescription, robot: Robot, found: PendantCheck, convention: str | None) -> dict[str, Any]:
    """The answer; ``verdict``: agrees, explained, orientation, misread or unexplained."""
    shown = found.explanations[:MOST_TOLD]
    positions_agree = bool(shown) and shown[0].things == 0
    verdict = "orientation" if positions_agree else "explained" if shown else "unexplained"
    verdict = "misread" if found.misread else "agrees" if found.agrees else verdict
    turned = None
    if (compared := found.orientation) is not None:
        turn = None if compared.tool_turn is None else _plain_rpy(compared.tool_turn)
        turned = {
            "convention": convention,
            "agrees_as": compared.convention,
            "largest_deg": rounded(float(np.degrees(compared.angle.max()))),
            "constant_tool_turn_rpy_deg": None if turn is None else turn.tolist(),
        }
    return {
        "robot": description.name,
        "verdict": verdict,
        "poses": len(found.readings.q),
        "tolerance_mm": rounded(1e3 * found.tolerance),
        "frame": "controller" if robot.controller is not None and robot.controller.T_base is not None else "base",
        "largest_mm": rounded(float(1e3 * found.distance.max())),
        "still_joints": list(found.still),
        "misread_poses": list(found.misread),
        "orientation": turned,
        "explanations": [_explanation(robot, e) for e in shown],
        "more_explanations": len(found.explanations) - len(shown),
        "closest": None if shown or found.misread else _explanation(robot, found.best),
    }


def _said(facts: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What is wrong, and what to write in the model or to do."""
    out: list[tuple[str, str]] = []
    if facts["misread_poses"]:
        poses = ", ".join(facts["misread_poses"])
        remedy = f"read {poses} again; mind signs and the order of the columns"
        out.append((f"read or typed wrong: {poses} (all other poses agree)", remedy))
    for i, one in enumerate(facts["explanations"]):
        out += _explained("what is wrong" if i == 0 else "or, which the table cannot tell apart", one)
    if facts["more_explanations"]:
        out.append((f"and {facts['more_explanations']} more", "read poses in which every joint moves"))
    if facts["closest"] is not None:
        out += [
            (
                "no usual slip (sign, zero, coupling, length, base, tool, radians), up to three at once, explains this",
                "check that positions are in mm, in the robot's own frame and of the point that the model's tool is",
            ),
            *_explained("the closest is", facts["closest"]),
        ]
    if not facts["misread_poses"] and facts["orientation"] is not None:
        out += _orientation(facts["orientation"])
    if facts["still_joints"]:
        out.append((f"not checked, because they hardly move over the poses: {', '.join(facts['still_joints'])}", ""))
    return out


def _explained(opening: str, explanation: Mapping[str, Any]) -> list[tuple[str, str]]:
    """One explanation: each change and how to mend it; with the last one what is left then."""
    out = [
        (f"{'and' if k else opening}: {change['words']}", _typed(change["remedy"]))
        for k, change in enumerate(explanation["changes"])
    ]
    if out:
        words = f"{out[-1][0]} (then the largest difference is {significant(explanation['largest_mm'])} mm)"
        out[-1] = (words, out[-1][1])
    return out


def _typed(remedy: str) -> str:
    """A remedy in a sentence: as code where it is to be written."""
    return f"`{remedy}`" if " = " in remedy else remedy


def _orientation(turned: Mapping[str, Any]) -> list[tuple[str, str]]:
    """How orientations compare."""
    out = []
    largest = significant(turned["largest_deg"], 2)
    if turned["agrees_as"] is not None:
        convention, _, columns = turned["agrees_as"].partition(": ")
        words = "orientations are not in the convention that their columns are named after: they agree as "
        out.append((f"{words}{convention}", f"name the table's orientation so: {columns}"))
    if turned["largest_deg"] <= SAME_deg:
        return out or [(f"orientations agree, largest difference {largest} deg", "")]
    if turned["constant_tool_turn_rpy_deg"] is not None:
        rpy = ", ".join(f"{v:g}" for v in turned["constant_tool_turn_rpy_deg"])
        words = f"orientations differ by one constant turn of the tool: rpy {rpy} deg in the flange frame"
        return [*out, (words, f"set [tool] rpy (or [controller] flange rpy) to [{rpy}] deg")]
    why = "no other convention, constant turn of the tool or slip of one joint explains that"
    remedy = "check the order of the columns, and that they are of the same tool and robot frame"
    return [*out, (f"orientations differ by up to {largest} deg; {why}", remedy)]


def _plain_rpy(R: Array) -> Array:
    """Roll, pitch and yaw (3,) deg; near a pitch of 90 deg, where they are shared out at will, with no roll."""
    roll, pitch, yaw = np.degrees(rpy_of(R))
    if abs(pitch) > 90.0 - GIMBAL_deg:
        yaw, roll = (yaw - np.sign(pitch) * roll + 180.0) % 360.0 - 180.0, 0.0
    return np.asarray(np.round([roll, pitch, yaw], 3) + 0.0)


def _explanation(robot: Robot, e: Explanation) -> dict[str, Any]:
    changes = [_slip(robot, slip, e.fit.sizes.get(slip.code)) for slip in e.chosen]
    changes += [_frame(name, e.fit.shift[name]) for name in e.frames]
    if not e.base_known:
        changes.append(
            {
                "code": "model-base",
                "size": None,
                "unit": None,
                "words": "positions are in the model's base frame, not in the controller's robot frame of the file",
                "remedy": "nothing, if the controller's world frame was set so; else read positions in its robot frame",
            }
        )
    return {"largest_mm": rounded(1e3 * e.fit.worst), "changes": changes}


def _slip(robot: Robot, slip: Slip, size: float | None) -> dict[str, Any]:
    words, remedy, unit = slip.words, slip.remedy, None
    if slip.kind == "offset" and size is not None:
        quarter = round(size / (0.5 * np.pi)) * 0.5 * np.pi
        size = quarter if abs(size - quarter) < QUARTER_rad else size
        degrees, unit = float(np.degrees(size)), "deg"
        name, total = robot.joint_names[slip.joint], float(np.degrees(robot.offset[slip.joint]))
        total = (total + robot.sign[slip.joint] * degrees + 180.0) % 360.0 - 180.0
        words = f"{name} counts from another zero: {degrees:+.4g} deg"
        remedy = f'in [[joint]] {name}: offset = {{ value = {total:.6g}, unit = "deg", source = "derived" }}'
        size = degrees
    elif slip.kind == "length" and size is not None:
        axis, joint = "xyz"[slip.along], robot.joint_names[slip.joint]
        words, unit, size = f"{words}: {1e3 * size:+.4g} mm", "mm", 1e3 * size
        remedy = f"check a, d or xyz of [[joint]] {joint} (here along {axis}) against the data sheet"
    return {
        "code": slip.code,
        "words": words,
        "size": None if size is None else rounded(size),
        "unit": unit,
        "remedy": remedy,
    }


def _frame(name: str, shift: Array) -> dict[str, Any]:
    words = {
        "base": "the controller's robot frame is elsewhere",
        "tool": "the tool point is elsewhere",
        "turned-base": "the controller's robot frame is elsewhere and turned",
    }[name]
    mm = (1e3 * shift[-3:]).round(3) + 0.0
    size: list[float] = mm.tolist()
    text = ", ".join(f"{v:g}" for v in size)
    if name == "tool":
        remedy = f"[tool] xyz: add [{text}] mm (flange axes), or choose the tool on the controller that the model has"
    elif name == "base":
        remedy = f"[controller] base xyz: add [{', '.join(f'{0.0 - v:g}' for v in size)}] mm"
    else:
        turn = np.degrees(shift[:3]).round(3) + 0.0
        text += f" mm, turned by {', '.join(f'{v:g}' for v in turn.tolist())} deg about the base's x, y, z"
        remedy = "set [controller] base to where the controller's robot frame is"
    shown = text if name == "turned-base" else f"{text} mm"
    return {"code": name, "words": f"{words}: by {shown}", "size": size, "unit": "mm", "remedy": remedy}


check_kinematics = capability_without_arm("robots check", CheckRequest, answer, function="check_kinematics")
