"""The command `post`: from a tool path to programs for the robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np

from doe.absolute.readings import Payload
from doe.absolute.table import ways_of
from fem.arm import Arm
from machining import Objective
from machining.cell import Cell
from machining.cutting import stiffness_uncertainty
from machining.placement import Placement, read_placement
from machining.programs.approach import ANGLE, LARGEST, Approach
from machining.programs.compensation import RAMP
from machining.programs.format import BOTH
from machining.programs.formats import FORMATS, read_options
from machining.programs.posting import PostSettings
from machining.programs.program import JointProgram, frame_distance, tool_in_part
from machining.programs.run import PostRequest as Asked
from machining.programs.run import Target, run_post
from machining.programs.write_options import WriteOptions
from machining.toolpaths import Motions
from robots import InputError, ModelDescription, Remark, Robot, require_one_of
from robots.arrays import Array
from robots.quantities import angle, length
from stiffarm.capability import capability
from stiffarm.commands.post.result import result
from stiffarm.path_request import GAMMA, CourseRequest
from stiffarm.request import ANY_PATH, NAMES, numbers_of, option, row, seed, word
from stiffarm.result import Result
from stiffarm.session.console import progress
from stiffarm.session.parsing import payload_of
from stiffarm.session.task_options import gammas_of

# Tool frames (m, rad) that a placement and the program made with it may differ by, and joint angles (rad).
SAME_FRAME, SAME_POSTURE = 1e-5, 1e-4
DEGREES, LARGEST_DEG = round(float(np.degrees(ANGLE)), 9), round(float(np.degrees(LARGEST)), 9)
NUMBERS: Final = row(allowed="finite numbers", example="0,500")
KNOWN_NOT_CORRECTED: Final = (
    "the model has errors of the arm's geometry, which are not in this program: --compensate takes them in"
)


@dataclass(frozen=True, kw_only=True)
class PostRequest(CourseRequest):
    """Write robot programs from a tool path and read them back.

    Cartesian and joint programs come from one run. Writes the programs, post.json and a report into --out.

    Examples
    --------
    >>> import stiffarm as sa
    >>> files = "docs/examples/kr60_posture"
    >>> made = sa.post("kr60-3", f"{files}/path.csv", cell=f"{files}/cell.toml", gamma=80, tolerance_um=200)
    >>> bool(made["off_path_um"][0] < 1)
    True
    """

    format: Sequence[str] = option(
        f"Program formats, separated by commas: {', '.join(FORMATS)}.", NAMES, default=("json",)
    )
    coordinates: Literal["cartesian", "joint", "both"] = option(
        "Coordinates of the programs: cartesian, joint or both.", word((*BOTH, "both")), default="both"
    )
    gamma: float | Sequence[float] | None = option(
        "Angle gamma about the tool axis, in deg, or a range from which the best is chosen. Default: 0.",
        GAMMA,
        metavar="DEG|FROM:TO:STEP",
    )
    placement: Path | str | None = option(
        "Result of `stiffarm place` (placement.json): use its linear axes, turntable and gamma.", ANY_PATH
    )
    travel: Sequence[float] | None = option(
        "Positions of the linear axes, in mm, separated by commas. Default: 0.", NUMBERS, metavar="MM,..."
    )
    table: float = option("Turntable angle, in deg.", metavar="DEG", default=0.0)
    tolerance_um: float = option(
        "Maximum deviation from a straight line between points, in um.", default=10.0, least=0.1
    )
    rapid: Literal["linear", "joint"] = option(
        "Rapid moves: linear, or joint: point-to-point joint interpolation.",
        word(("linear", "joint")),
        default="linear",
    )
    compensate: bool = option(
        "Correct the path for the deflection under --force or --milling and, with a model calibrated from positions, "
        "for the arm's geometry, joint errors and own weight.",
        default=False,
    )
    payload: Sequence[float] | float | None = option(
        "What the flange carries (spindle and tool), for the arm's sag: mass in kg and its centre in the flange frame, "
        "in mm. Default: nothing.",
        replace(
            row(allowed="KG or KG,X,Y,Z", example="25,0,0,120"),
            checked=lambda value, name: numbers_of(value, name, "KG or KG,X,Y,Z"),
        ),
        metavar="KG[,X,Y,Z]",
    )
    cap_um: float | None = option(
        "Maximum correction of a point, in um. Default: 1000; 5000 with a calibrated geometry, where more is refused.",
        least=0.1,
    )
    ramp_mm: float = option(
        "Length of path before and after a cut over which its correction fades in and out, in mm; 0 for one step.",
        default=RAMP * 1e3,
        least=0.0,
    )
    approach: str | None = option(
        "End positioning moves from the side that was calibrated: for each joint + or -, the way it turns last, or 0 "
        "where it does not matter, as in +-+00+. Moves at feed are not changed. Default: from any side.",
        metavar="SIGNS",
    )
    approach_deg: float | None = option(
        f"Angle of that last turn, in deg, up to {LARGEST_DEG:g}. Default: {DEGREES:g}."
    )
    force_measured: float | None = option(
        "Standard deviation of each component of --force, where it was measured, in N. Default: assumed, 10 %.",
        metavar="N",
        least=0.0,
    )
    options: Path | str | None = option("Options of the program formats (TOML or JSON).", ANY_PATH)
    template: Path | str | None = option("Folder with your own program templates.", ANY_PATH)
    seed: int = seed()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.force_measured is not None and self.force is None:
            raise InputError(
                "--force-measured without --force", code="K004", remedy="give the force that was measured with --force"
            )
        if (self.force is not None or self.milling is not None) and not self.compensate:
            raise InputError(
                "--force or --milling without --compensate",
                code="A003",
                remedy="add --compensate, or leave the force out; `stiffarm posture` predicts the error it leaves",
            )
        for name, value in {"--travel": self.travel, "--gamma": self.gamma}.items():
            if value is not None and self.placement is not None:
                raise InputError(f"{name} with --placement", code="A002", remedy="the placement says it; leave one out")

    @property
    def writes_by(self) -> str | None:
        """What needs a folder on the command line: the programs."""
        return "post"


def answer(given: Arm, asked: PostRequest) -> Result:
    """Programs, read back and compared with the tool path."""
    targets = targets_of(asked.format, asked.coordinates)
    arm = asked.at_its_load(given)
    setup = asked.setup(arm)
    carried = _carried(arm.description, asked)
    side = approach_of(asked.approach, asked.approach_deg, arm.robot)
    motions = asked.motions()
    cut = asked.cut(setup.cell, motions, asked.force_measured) if asked.compensate else None
    if asked.compensate and cut is None and carried is None:
        raise InputError(
            "--compensate needs a cutting force",
            code="A003",
            remedy="give --force or --milling, or a model that positions have calibrated",
        )
    followed = None if asked.placement is None else _followed(Path(asked.placement), setup.cell, motions)
    written = WriteOptions() if asked.options is None else read_options(Path(asked.options))
    settings = PostSettings(
        gamma=gammas_of(0.0 if asked.gamma is None else asked.gamma),
        objective=Objective(),
        drive=setup.drive(asked.limits(arm.robot, turn_gain=0.01 * asked.turn_gain), clear=False),
        travel=_travel(setup.cell, asked.travel),
        table=float(np.radians(asked.table)),
        tolerance=1e-6 * asked.tolerance_um,
        rapid=asked.rapid,
        reference=asked.counts_from,
        seed=asked.seed,
    )
    if followed is not None:
        settings = replace(settings, **followed.at_every_move(motions.rapid))
    settings = replace(settings, clearance=setup.clearance(motions, settings.table))
    request = Asked(
        motions,
        setup,
        settings,
        targets,
        written.model_copy(update={"rapid": settings.rapid}),
        None if asked.template is None else Path(asked.template),
        cut,
        None if asked.cap_um is None else 1e-6 * asked.cap_um,
        1e-3 * asked.ramp_mm,
        stiffness=stiffness_uncertainty(arm.model.as_designed, arm.description, arm.own),
        payload=carried,
        approach=side,
    )
    with progress("posture along the path") as bar:
        run = run_post(arm.model, request, bar)
    remarks = [] if followed is None else _check(run.posted.program, followed)
    if arm.description.positions is not None and not asked.compensate:
        remarks.append(KNOWN_NOT_CORRECTED)
    return result(arm, run, remarks)


def targets_of(names: Sequence[str], coordinates: str) -> tuple[Target, ...]:
    """Formats ``krl``, ``json`` ... and ``cartesian``, ``joint`` or ``both``: the targets.

    Raises
    ------
    InputError
        An unknown format, or one that does not have these coordinates.
    """
    kinds = tuple(k for k in BOTH if coordinates in (k, "both"))
    out: list[Target] = []
    for name in names:
        require_one_of("--format", name, FORMATS, code="Q002", remedy="choose from these")
        if FORMATS[name].neutral:
            out.append(Target(name, "joint"))
            continue
        wanted = [k for k in kinds if k in FORMATS[name].kinds]
        if not wanted:
            raise InputError(
                f"--coordinates of {name}", code="Q002", value=coordinates, allowed=", ".join(FORMATS[name].kinds)
            )
        out += [Target(name, k) for k in wanted]
    return tuple(out)


def approach_of(signs: str | None, deg: float | None, robot: Robot) -> Approach | None:
    """The side that positioning moves come from; None: any.

    Raises
    ------
    InputError
        Other signs, as many as the arm has no joints, all of them 0; an angle that is none or too large, or alone.
    """
    if deg is not None and not 0.0 < deg <= LARGEST_DEG:
        raise InputError(
            "--approach-deg",
            code="Q009",
            value=deg,
            allowed=f"above 0, up to {LARGEST_DEG:g} deg",
            remedy="give several times the lost motion of the joints, as 0.5",
        )
    if signs is None:
        if deg is not None:
            raise InputError(
                "--approach-deg without --approach", code="A003", remedy="add --approach with a sign for each joint"
            )
        return None
    ways = ways_of(signs.strip(), robot.dof)
    if ways is None or not ways.any():
        raise InputError(
            "--approach",
            code="A004",
            value=signs,
            allowed=f"a +, - or 0 for each of {robot.dof} joints, not all 0",
            remedy="write + for a joint that shall turn the positive way as it arrives, as in the column approach",
        )
    return Approach(ways, float(np.radians(DEGREES if deg is None else deg)))


def _carried(description: ModelDescription, asked: PostRequest) -> Payload | None:
    """What the flange carries, where geometry is compensated; None where it is not."""
    corrects = asked.compensate and description.positions is not None
    if asked.payload is None:
        return Payload(0.0, np.zeros(3)) if corrects else None
    if not corrects:
        raise InputError(
            "--payload",
            code="A002",
            allowed="with --compensate, and a model that positions have calibrated",
            remedy="leave it out, or run `stiffarm calibrate` on a table of positions and take its model.toml",
        )
    return payload_of(numbers_of(asked.payload, "--payload", "KG or KG,X,Y,Z"))


def _followed(file: Path, cell: Cell, motions: Motions) -> Placement:
    """The placement of a file, for this cell and path."""
    found = read_placement(file)
    names = tuple(axis.name for axis in cell.linear_axes)
    if found.axes != names or found.count != motions.n:
        raise InputError(
            f"placement {file}",
            code="A010",
            value=f"axes {', '.join(found.axes)}, {found.count} moves",
            allowed=f"axes {', '.join(names)}, {motions.n} moves: those of this cell and path",
            remedy="run `stiffarm place` again with this path and cell",
        )
    return found


def _check(program: JointProgram, followed: Placement) -> list[str]:
    """Raise InputError unless the placement's tool frames are the program's; a remark where its branches are not."""
    given = np.flatnonzero(~program.inserted)[followed.moves]
    axes = followed.q, followed.travel, program.table[given]
    wanted = tool_in_part(program.robot, program.cell, *axes, program.tool_at(given))
    away, turned = frame_distance(wanted, program.T_part_tool[given])
    if max(away.max(), turned.max()) > SAME_FRAME:
        place, turn = length("place"), angle("turn")
        raise InputError(
            "--placement: its postures are not those of this path in this cell",
            code="A010",
            value=f"tool {place.text(away.max(), unit=True)} and {turn.text(turned.max(), unit=True)} away",
            allowed=f"{place.text(SAME_FRAME, unit=True)}, {turn.text(SAME_FRAME, unit=True)}",
            remedy="run `stiffarm place` again with this path, cell and tool",
        )
    other = int((np.abs(program.q[given] - followed.q).max(axis=1) > SAME_POSTURE).sum())
    if not other:
        return []
    words = (
        f"{other} of {len(given)} points take another branch or turn than the placement, which jumps on a rapid move; "
        "with --rapid joint its own are taken"
    )
    return [Remark(words, code="W032")]


def _travel(cell: Cell, given: Sequence[float] | None) -> Array | None:
    """Travels (k,) m of ``--travel``."""
    if given is None:
        return None if not cell.linear_axes else np.zeros(len(cell.linear_axes))
    if len(given) != len(cell.linear_axes):
        names = ", ".join(axis.name for axis in cell.linear_axes) or "the cell has no linear axis"
        raise InputError("--travel", code="A004", value=given, allowed=f"one number (mm) for each of: {names}")
    return 1e-3 * np.asarray(given)


post = capability("post", PostRequest, answer)
