"""`plan --positions`: which poses to read with a tracker, and the table to read them into."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from doe.absolute.campaign import Expected, PlannedCampaign, Target, Wanted, plan_campaign
from fem.arm import Arm
from robots import InputError, Robot, forward_kinematics
from robots.arrays import Array
from robots.constants import NORMAL_95
from robots.files.csv_text import rows_text
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.figure_parts import drawing
from stiffarm.pages.report import Answer, Bullets, KeyFigure, Section, Table, Text, write_page
from stiffarm.pages.style import OKABE_ITO
from stiffarm.session.console import progress, say
from stiffarm.session.frame import Frame
from stiffarm.session.json_text import number
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import parse_numbers

SCHEMA: Final = "stiffarm-plan-positions/1"
SHEET, RESULT = "positions_sheet.csv", "plan.json"
FARTHEST_mm: Final = 100_000.0
QUESTION: Final = "which poses should be read with a tracker?"
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


def parse_target(text: str) -> Target:
    """``NAME:X,Y,Z`` or ``NAME:X,Y,Z,DX,DY,DZ``: a point on the flange (mm) and where it looks.

    Raises
    ------
    InputError
        Anything else.
    """
    name, _, rest = text.partition(":")
    values = parse_numbers(rest) or ()
    if not re.fullmatch(r"[\w-]{1,40}", name) or len(values) not in (3, 6) or max(map(abs, values[:3])) > FARTHEST_mm:
        raise InputError(
            "--target",
            code="A004",
            value=text,
            allowed="NAME:X,Y,Z or NAME:X,Y,Z,DX,DY,DZ: mm in the flange frame, and where it looks",
            remedy="write it as in --target ball:0,80,50 or --target srm1:0,80,50,0,0,1",
        )
    axis = np.array(values[3:]) if len(values) == 6 else None
    if axis is not None and not np.linalg.norm(axis) > 0.0:
        raise InputError("--target", code="A004", value=text, allowed="a direction that is not 0,0,0")
    return Target(name, np.array(values[:3]) * 1e-3, axis)


def parse_targets(texts: Sequence[str]) -> tuple[Target, ...]:
    """All targets, each name once."""
    found = tuple(parse_target(text) for text in texts)
    names = [one.name for one in found]
    if not found or len(set(names)) != len(names):
        raise InputError(
            "--target",
            code="A004",
            value=", ".join(names) or "none",
            allowed="one or more, each name once",
            remedy="write it as in --target ball:0,80,50",
        )
    return found


def parse_tracker(text: str | None) -> Array:
    """Where the tracker stands (3,) m in the arm's base frame."""
    values = None if text is None else parse_numbers(text)
    if values is None or len(values) != 3 or max(map(abs, values)) > FARTHEST_mm:
        raise InputError(
            "--tracker",
            code="A004",
            value=text or "none",
            allowed="X,Y,Z in mm, the arm's base frame",
            remedy="say about where it stands, as in --tracker 3000,500,1200",
        )
    return np.array(values) * 1e-3


def plan_positions(given: Arm, wanted: Wanted, frame: Frame) -> None:
    """Plan, answer, and write plan.json, the table to fill in and report.html."""
    with frame.folder_if(wanted.seed) as folder:
        with progress("choosing poses") as bar:
            planned = plan_campaign(given.model, wanted, bar)
        content = payload(given, planned)
        if folder is not None:
            folder.write_json(RESULT, content)
            folder.write_text(SHEET, sheet(given.robot, planned))
            _write_report(given, planned, folder)
    frame.answer(content, lambda: show(planned))


def payload(given: Arm, p: PlannedCampaign) -> dict[str, Any]:
    """Everything, keys with units."""
    names, angles = _angles(given.robot, p.q)
    return {
        "schema": SCHEMA,
        "robot": given.robot.name,
        "poses": len(p.q),
        "readings": p.readings,
        "scatter_sd_mm": number(1e3 * p.wanted.sigma),
        "tracker_mm": (1e3 * p.wanted.tracker).tolist(),
        "targets": [one.name for one in p.wanted.targets],
        "candidates": p.candidates,
        "plan": [
            {
                **{n: number(float(v)) for n, v in zip(names, row, strict=True)},
                "targets": _seen(p, k),
                "approaches": [text for text in approaches(p, k) if text],
            }
            for k, row in enumerate(angles)
        ],
        "parameters": [
            {
                "name": e.name,
                "unit": e.unit,
                "sd": number(e.sd),
                "sd_by_random_poses": number(e.random_sd),
                "sd_before": number(e.before),
                "identified": e.identified,
            }
            for e in p.expected
        ],
        "not_told_apart_by_any_readings": [{"name": t.name, "moved_by": list(t.others)} for t in p.twins],
        "narrower_than_random_poses": number(gain(p)),
        "notes": list(notes(p)),
    }


def gain(p: PlannedCampaign) -> float:
    """How many times narrower than by as many random poses, geometric mean over parameters."""
    return float(np.exp(np.mean([math.log(e.random_sd / e.sd) for e in p.expected]))) if p.expected else 1.0


def _seen(p: PlannedCampaign, k: int) -> list[str]:
    return [one.name for one, sees in zip(p.wanted.targets, p.seen[k], strict=True) if sees]


def _angles(robot: Robot, q: Array) -> tuple[tuple[str, ...], Array]:
    """Names and angles (n, dof) deg as the controller has them, else the model's."""
    if robot.controller is None:
        return robot.coordinates, np.degrees(q)
    return robot.controller.names, np.degrees(robot.controller.controller(q))


def sheet(robot: Robot, p: PlannedCampaign) -> str:
    """The table to fill in: one row a target at a pose, twice where it is come to from either side."""
    names, angles = _angles(robot, p.q)
    ways = ("approach",) if p.approach.size else ()
    rows: list[tuple[str, ...]] = [("pose", *names, "session", "target", *ways, "x_mm", "y_mm", "z_mm")]
    for k, row in enumerate(angles):
        for signs in approaches(p, k):
            came = (signs,) if signs else ()
            for target in _seen(p, k):
                rows.append((str(k + 1), *(f"{v:.3f}" for v in row), "1", target, *came, "", "", ""))
    return rows_text(rows)


def approaches(p: PlannedCampaign, k: int) -> tuple[str, ...]:
    """Which ways the joints come to a pose, as in ``+-++-+``, then the other way; one empty text where no matter."""
    if not p.approach.size:
        return ("",)
    first = "".join("+" if way > 0.0 else "-" for way in p.approach[k])
    return first, first.translate(str.maketrans("+-", "-+"))


def sentence(p: PlannedCampaign) -> str:
    """The answer in a sentence."""
    told = sum(e.identified for e in p.expected)
    twice = ", each approached from both sides" if p.approach.size else ""
    return (
        f"{len(p.q)} poses{twice}, {p.readings} readings of {len(p.wanted.targets)} target(s): "
        f"{told} of {len(p.expected)} parameters are identified, with intervals {gain(p):.2g} times narrower than with "
        "as many random poses"
    )


def notes(p: PlannedCampaign) -> tuple[str, ...]:
    """What to know of a plan."""
    return (*NOTES, APPROACH) if p.approach.size else NOTES


def show(p: PlannedCampaign) -> None:
    """Parameters and the answer."""
    _table(p).show()
    for note in notes(p):
        say(f"note: {note}")
    say(sentence(p))


def _table(p: PlannedCampaign) -> Table:
    rows = tuple((e.name, *_figures(e), "yes" if e.identified else "no") for e in p.expected)
    heads = ("parameter", "known to (95 %)", "with random poses", "unit", "identified")
    title = f"What {len(p.q)} poses identify, at {1e3 * p.wanted.sigma:g} mm of scatter"
    return Table(title, heads, rows, text_columns=(0, 3, 4))


def _figures(e: Expected) -> tuple[str, str, str]:
    if e.unit.startswith("1/"):
        # A stiffness: what is left open of its compliance shows stiffnesses up to this.
        here, chance = (f"up to {1.0 / (NORMAL_95 * sd):.3g}" for sd in (e.sd, e.random_sd))
        return here, chance, e.unit[3:-1]
    here, chance = (f"+-{NORMAL_95 * sd:.2g}" for sd in (e.sd, e.random_sd))
    return here, chance, e.unit


def places_figure(given: Arm, p: PlannedCampaign) -> Figure:
    """Where the flange is at the poses, from above and from the side, with the tracker."""
    at = 1e3 * forward_kinematics(given.robot, p.q).p_flange
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


def _write_report(given: Arm, p: PlannedCampaign, folder: OutputFolder) -> None:
    pictures = Pictures(folder)
    names, angles = _angles(given.robot, p.q)
    rows = tuple((str(k + 1), *(f"{v:.2f}" for v in row), ", ".join(_seen(p, k))) for k, row in enumerate(angles))
    places = pictures.add(places_figure(given, p), "places", "Targets are read where the tracker sees them.")
    poses = Table(
        "Poses, in an order of short moves", ("pose", *names, "targets"), rows, text_columns=(len(names) + 1,)
    )
    twins = Bullets(tuple(f"{one.words}." for one in p.twins))
    sections = [
        Section("What the poses identify", (_table(p),)),
        Section("The poses", (places, poses)),
        Section("What no poses can identify", (Text("Held at the model's values:"), twins), folded=True),
        Section("What to know", (Bullets(tuple(f"{note[0].upper()}{note[1:]}." for note in notes(p))),)),
    ]
    key = [
        KeyFigure(f"{len(p.q)} poses", f"{p.readings} readings"),
        KeyFigure(f"{gain(p):.2g} times", "narrower intervals than with as many random poses"),
    ]
    todo = f"Read the targets, fill in {SHEET} (leave out rows that were not read), and run `stiffarm calibrate` on it."
    answer = Answer("A forecast from the model's derivatives, with the given scatter of a coordinate.", todo)
    title = given.description.title.split(" (")[0]
    write_page(folder, title, f"{sentence(p)}.", key, sections, QUESTION, answer=answer)
