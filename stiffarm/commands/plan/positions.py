"""`plan --positions`: which poses to read with a tracker, and the table to read them into."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from doe.absolute.campaign import Expected, PlannedCampaign, Wanted, plan_campaign
from fem.arm import Arm
from robots import Robot, forward_kinematics
from robots.arrays import Array
from robots.constants import NORMAL_95
from robots.files.csv_text import rows_text
from robots.quantities import Quantity, angle, rounded, significant
from stiffarm.pages.report import Bullets, KeyFigure, Section, Text
from stiffarm.result import Drawing, Result, Table, plain
from stiffarm.session.console import progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stiffarm.session.outputs import OutputFolder

SHEET: Final = "positions_sheet.csv"
NOTES: Final = (
    "intervals scale with the scatter of a coordinate; errors that a calibration leaves out (error curves of joints, "
    "0.1 to 0.4 mm on measured arms) are usually larger than the tracker's own scatter",
    "a target with a direction counts as visible within 30 deg of it and where the beam stays 120 mm away from the "
    "lines through the arm's joints; collisions and cables are not checked",
    "parameters that no poses can determine are left out; error curves are determined where a joint's angles are "
    "spread",
    "a stiffness 'up to' a value can be distinguished from a rigid joint if it is below that value",
)
APPROACH: Final = (
    "approach each pose twice, as the column approach states for each joint: over the last few degrees in the positive "
    "(+) or the negative (-) direction"
)


def plan_positions(given: Arm, wanted: Wanted) -> Result:
    """Poses that determine most, what of it, and the table to fill in."""
    with progress("choosing poses") as bar:
        p = plan_campaign(given.model, wanted, bar)
    names, angles = _angles(given.robot, p.q)
    known = sum(e.identified for e in p.expected)
    twice = ", each approached from both sides" if p.approach.size else ""
    gain = significant(_gain(p), 2)
    poses = range(len(p.q))

    def more(folder: OutputFolder) -> Mapping[str, Any]:
        folder.write_text(SHEET, _sheet(given.robot, p))
        return {}

    return Result(
        name="plan",
        title=given.description.title.split(" (")[0],
        question="which poses should be read with a tracker?",
        answer=f"{len(p.q)} poses{twice}, {p.readings} readings of {len(wanted.targets)} target(s): {known} of "
        f"{len(p.expected)} parameters are identified, with intervals {gain} times narrower than with as many random "
        "poses.",
        how_sure="A forecast from the model's derivatives, with the given scatter of a coordinate.",
        what_next=f"Read the targets, fill in {SHEET} (leave out rows that were not read), and run "
        f"`stiffarm calibrate MODEL {SHEET}`.",
        facts={
            "kind": "positions",
            "robot": given.robot.name,
            "poses": len(p.q),
            "readings": p.readings,
            "scatter_sd_mm": rounded(1e3 * wanted.sigma),
            "tracker_mm": plain(wanted.tracker, 1e3),
            "targets": [one.name for one in wanted.targets],
            "candidates": p.candidates,
            "not_separable_by_any_readings": [{"name": t.name, "moved_by": list(t.others)} for t in p.twins],
            "narrower_than_random_poses": rounded(_gain(p)),
        },
        tables=(
            Table(
                "plan",
                "The poses, in an order of short moves",
                {"pose": [str(k + 1) for k in poses], "targets": [", ".join(_seen(p, k)) for k in poses]},
                dict(zip(map(angle, names), angles.T, strict=True)),
                extra={"approaches": [[text for text in _approaches(p, k) if text] for k in poses]},
            ),
            Table(
                "parameters",
                f"What {len(p.q)} poses identify, at {1e3 * wanted.sigma:g} mm of scatter",
                {
                    "name": [e.name for e in p.expected],
                    "unit": [e.unit for e in p.expected],
                    "identified": [e.identified for e in p.expected],
                    "known_to_95": [_known(e, e.sd) for e in p.expected],
                    "with_random_poses": [_known(e, e.random_sd) for e in p.expected],
                },
                {},
                in_files={
                    Quantity("sd"): np.array([e.sd for e in p.expected]),
                    Quantity("sd_by_random_poses"): np.array([e.random_sd for e in p.expected]),
                    Quantity("sd_before"): np.array([e.before for e in p.expected]),
                },
            ),
        ),
        drawings=(
            Drawing(
                "places",
                "Targets are read where the tracker sees them.",
                "where the flange is, and the tracker",
                partial(_places, given.robot, p),
            ),
        ),
        key=(
            KeyFigure(f"{len(p.q)} poses", f"{p.readings} readings"),
            KeyFigure(f"{gain} times", "narrower intervals than with as many random poses"),
        ),
        sections=(
            Section(
                "What no poses can identify",
                (Text("Held at the model's values:"), Bullets(tuple(f"{one.words}." for one in p.twins))),
                folded=True,
            ),
        ),
        remarks=(*NOTES, APPROACH) if p.approach.size else NOTES,
        caution="",
        found=p,
        more=more,
    )


def _gain(p: PlannedCampaign) -> float:
    """How many times narrower than by as many random poses, geometric mean over parameters."""
    return float(np.exp(np.mean([math.log(e.random_sd / e.sd) for e in p.expected]))) if p.expected else 1.0


def _seen(p: PlannedCampaign, k: int) -> list[str]:
    return [one.name for one, sees in zip(p.wanted.targets, p.seen[k], strict=True) if sees]


def _angles(robot: Robot, q: Array) -> tuple[tuple[str, ...], Array]:
    """Names and angles (n, dof) rad as the controller has them, else the model's."""
    if robot.controller is None:
        return robot.coordinates, q
    return robot.controller.names, robot.controller.controller(q)


def _sheet(robot: Robot, p: PlannedCampaign) -> str:
    """The table to fill in: one row a target at a pose, twice where it is come to from either side."""
    names, angles = _angles(robot, p.q)
    ways = ("approach",) if p.approach.size else ()
    rows: list[tuple[str, ...]] = [("pose", *names, "session", "target", *ways, "x_mm", "y_mm", "z_mm")]
    for k, row in enumerate(np.degrees(angles)):
        for signs in _approaches(p, k):
            came = (signs,) if signs else ()
            for target in _seen(p, k):
                rows.append((str(k + 1), *(f"{v:.3f}" for v in row), "1", target, *came, "", "", ""))
    return rows_text(rows)


def _approaches(p: PlannedCampaign, k: int) -> tuple[str, ...]:
    """Which ways the joints come to a pose, as in ``+-++-+``, then the other way; one empty text where no matter."""
    if not p.approach.size:
        return ("",)
    first = "".join("+" if way > 0.0 else "-" for way in p.approach[k])
    return first, first.translate(str.maketrans("+-", "-+"))


def _known(e: Expected, sd: float) -> str:
    """To what a parameter is known with 95 %; a stiffness by its compliance: stiffnesses up to this show."""
    if e.unit.startswith("1/"):
        return f"up to {significant(1.0 / (NORMAL_95 * sd))} {e.unit[3:-1]}"
    return f"± {significant(NORMAL_95 * sd, 2)} {e.unit}"


def _places(robot: Robot, p: PlannedCampaign) -> Figure:
    """Where the flange is at the poses, from above and from the side, with the tracker."""
    from stiffarm.pages.figure_parts import drawing
    from stiffarm.pages.style import OKABE_ITO

    at = 1e3 * forward_kinematics(robot, p.q).p_flange
    tracker = 1e3 * p.wanted.tracker
    with drawing("Where the flange is, and the tracker", (10.0, 4.6), 1, 2) as (figure, axes):
        for ax, (a, b, view) in zip(axes, ((0, 1, "from above"), (0, 2, "from the side")), strict=True):
            ax.scatter(at[:, a], at[:, b], s=18, color=OKABE_ITO["blue"], label="poses")
            ax.scatter([tracker[a]], [tracker[b]], marker="^", s=60, color=OKABE_ITO["vermillion"], label="tracker")
            ax.scatter([0.0], [0.0], marker="s", s=40, color="0.3", label="base")
            ax.set_aspect("equal")
            ax.set(xlabel=f"{'xyz'[a]} (mm)", ylabel=f"{'xyz'[b]} (mm)", title=view)
        axes[0].legend(loc="best")
    return figure
