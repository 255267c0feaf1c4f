"""What a plan says: set-ups in the order of measuring, what they will tell of each parameter, and the sheet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from shlex import join
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from doe import Measurements
from doe.planning.forecast import HOLDS, KEPT
from doe.tables.columns import DISPLACEMENTS
from fem.arm import Arm
from robots.arrays import Array
from robots.constants import NORMAL_95
from robots.quantities import Quantity, angle, rounded, rounded_all, significant
from stiffarm.commands.calibrate import payload as calibration_payload
from stiffarm.commands.plan import sheets, words
from stiffarm.commands.plan.step import Planned
from stiffarm.pages.report import KeyFigure, data_words
from stiffarm.result import Drawing, Result, Table
from stiffarm.session.console import progress
from stiffarm.session.words.directions import direction_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stiffarm.session.outputs import OutputFolder

TABLE: Final = "measurement_sheet.csv"
# Parameters that the first screen names.
NAMED: Final = 3
# Narrower by less than this is not called narrower.
NARROWER: Final = 1.05
SHRINK: Final = Quantity("promised_shrink", label="times narrower", digits=2, stored=4)
RULES: Final = (
    "Take the set-ups in this order. The small number in a box is the row (column step) of measurement_sheet.csv.",
    "Zero the gauge on the unloaded arm before each repeat; for a repeat take the whole load off and put it on again.",
    "Displacements are those of the loaded point, in mm along the base's axes (x forward at q1 = 0, z up): "
    "a downward load gives a negative dz. Rotations are in mrad about the same axes.",
    "Leave a box empty where nothing was read. Write what else happened into the remarks.",
    "The plan knows joint limits, floor and boxes, not cables and fixtures: drive slowly the first time.",
)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Plan(Result):
    """Set-ups to measure next, in order."""

    sheet: sheets.Sheet

    @property
    def sentences(self) -> tuple[str, ...]:
        """What the set-ups will tell of each parameter."""
        return tuple(self.found.sentences)

    def save(self, folder: str | Path) -> Path:
        """Write everything into a folder; or the measurement sheet alone, to fill in and read back, into a .csv.

        Raises
        ------
        InputError
            The folder or the file cannot be written.
        """
        path = Path(folder)
        if path.suffix.lower() != ".csv":
            return super().save(path)
        sheets.write_table(self.sheet, path)
        return path


def result(given: Arm, data: Measurements | None, asked_of: Path | None, planned: Planned) -> Plan:
    """A plan; ``asked_of``: the file of the readings, None for the bundled ones or a data frame."""
    made, protocol, robot = planned.made, planned.made.protocol, given.robot
    better = {f.parameter.name: f for f in made.foresight if f.seen and f.promised_shrink >= NARROWER}
    order = sorted(better.values(), key=lambda f: -f.promised_shrink)
    count = len(planned.labels)
    loads = ", ".join(f"{v:g}" for v in protocol.forces.tolist())
    sheet = _sheet(given, data, planned, loads)
    sure = words.rests_on(planned.start, planned.forecast)
    before = () if data is None else (str(asked_of or "bundled"),)
    reads_it = join(["stiffarm", "calibrate", "MODEL", *before, TABLE])
    effects = [e.effect.code for e in given.effects]

    def more(folder: OutputFolder) -> Mapping[str, Any]:
        from stiffarm.pages.pose_pictures import pose_pictures

        sheets.write_table(sheet, folder.path(TABLE))
        with progress("pictures of the set-ups") as bar:
            pictures = pose_pictures(given.description, robot, sheet.q, sheet.direction, bar)
        folder.write_text("measurement_sheet.html", sheets.render_sheet(sheet, pictures))
        return {}

    return Plan(
        name="plan",
        title=given.description.title.split(" (")[0],
        question="what to measure next?",
        answer=f"{count} set-ups under {loads} N, {protocol.repeats} times each: they make the intervals of "
        f"{len(better)} of {len(made.foresight)} parameters narrower.",
        how_sure=f"{sure[0].upper()}{sure[1:]}.",
        what_next="Print measurement_sheet.html, measure in its order, fill in measurement_sheet.csv, and run "
        f"`{reads_it}`.",
        facts=_facts(given, data, planned),
        tables=(_set_ups(planned), _parameters(planned)),
        drawings=(
            *(
                (
                    Drawing(
                        "narrower",
                        "Promised with the model's lack of fit; 2 is half as wide.",
                        "how many times narrower",
                        partial(_narrower, {f.parameter.name: f.promised_shrink for f in order}),
                    ),
                )
                if order
                else ()
            ),
            Drawing(
                "plan",
                "Intervals before and after, over the value planned for; at the right what set-ups chosen at random "
                "give.",
                "what the set-ups tell",
                partial(_intervals, planned, robot.name),
            ),
        ),
        key=(
            KeyFigure(f"{count} set-ups", f"{count * len(protocol.course) * protocol.repeats} readings"),
            *(
                KeyFigure(f"{SHRINK.text(f.promised_shrink)} times", f"narrower, the interval of {f.parameter.name}")
                for f in order[:NAMED]
            ),
        ),
        remarks=(
            *planned.sentences,
            *(() if data is None else data.notes),
            *planned.notes,
            *((f"not in the plan: {', '.join(effects)}",) if effects else ()),
        ),
        caution="",
        found=planned,
        more=more,
        made_of="no readings yet" if data is None else data_words(data),
        sheet=sheet,
    )


def _narrower(shrink: Mapping[str, float]) -> Figure:
    from stiffarm.pages.bars import ranked_figure

    return ranked_figure("How many times narrower", shrink, "interval before over interval after", 12)


def _intervals(planned: Planned, robot: str) -> Figure:
    from stiffarm.commands.plan.figures import plan_figure

    return plan_figure(planned.made, planned.found, robot)


def _sheet(given: Arm, data: Measurements | None, planned: Planned, loads: str) -> sheets.Sheet:
    made, protocol, point = planned.made, planned.made.protocol, planned.made.protocol.point
    source = "no readings yet" if data is None else f"{data.source}, {planned.start.readings} readings"
    at = "the tool point"
    if point is not None:
        at = f"x, y, z = {', '.join(f'{1e3 * v:g}' for v in point)} mm from the flange"
    facts = [
        ("robot", given.description.title or given.robot.name),
        ("made from", f"{source}; model {given.robot.name}, {given.model.load_path}, {given.model.link_kind} links"),
        ("chosen to tell", ", ".join(p.name for p in planned.start.parameters)),
        ("loads", f"{loads} N at {at}, {protocol.repeats} times each"),
    ]
    if planned.held_deg:
        facts.append(("standing still", ", ".join(f"{k} = {v:g}" for k, v in planned.held_deg.items())))
    return sheets.Sheet(
        given.robot,
        f"Measurement sheet {given.robot.name}",
        made.q,
        made.direction,
        planned.labels,
        tuple(_hint(planned, k) for k in range(len(planned.labels))),
        protocol,
        tuple(facts),
        RULES,
    )


def _hint(planned: Planned, k: int) -> str:
    """What to expect under the largest load: a gauge read in the wrong unit or sign shows at once."""
    if planned.expected is None:
        return ""
    parts = []
    for c in planned.made.protocol.components:
        name, _, unit = DISPLACEMENTS[c].rpartition("_")
        parts.append(f"{name} ≈ {significant(1e3 * float(planned.expected[k, c]), 1)} {unit}")
    return f"to expect at {planned.made.protocol.forces.max():g} N, roughly: {', '.join(parts)}"


def _set_ups(planned: Planned) -> Table:
    made = planned.made
    coordinates = planned.start.free.model.robot.coordinates
    in_files: dict[Quantity, Array] = {
        Quantity(f"load_{axis}"): made.direction[:, k] + 0.0 for k, axis in enumerate("xyz")
    }
    if planned.expected is not None:
        for c in made.protocol.components:
            name, _, unit = DISPLACEMENTS[c].rpartition("_")
            in_files[Quantity(f"expected_{name}", unit, 1e3, stored=3)] = planned.expected[:, c]
    kind = "plain design" if planned.request.is_plain else f"{made.criterion}-optimal choice"
    return Table(
        "setups",
        f"The set-ups, in the order of measuring: {kind} of {planned.candidates} poses",
        {"pose": planned.labels, "load": [direction_words(way) for way in made.direction]},
        dict(zip(map(angle, coordinates), made.q.T, strict=True)),
        in_files=in_files,
    )


def _parameters(planned: Planned) -> Table:
    """Each parameter before and after, SI; standard deviations of ln value where ``sd_of`` says so."""
    some, found = planned.made.foresight, planned.found
    open_ones = [words.rigid_from(f) if f.parameter.scale == "compliance" and f.seen else np.nan for f in some]
    return Table(
        "parameters",
        "Parameters before and after",
        {
            "name": [f.parameter.name for f in some],
            "unit": [f.parameter.unit for f in some],
            "status": ["no readings" if one is None else one.status for one in found],
            "sd_of": ["value" if f.parameter.scale == "linear" else "ln value" for f in some],
            "seen": [f.seen for f in some],
        },
        {
            Quantity("planned_for"): np.array([f.planned_for for f in some]),
            Quantity("sd_before"): np.array([f.before for f in some]),
            Quantity("sd_after"): np.array([f.after for f in some]),
            Quantity("shrink", stored=4): np.array([f.shrink for f in some]),
            Quantity("promised_half_width95"): NORMAL_95 * np.array([f.promised for f in some]),
            SHRINK: np.array([f.promised_shrink for f in some]),
            Quantity("distinguished_from_rigid_up_to", digits=3, stored=3): np.array(open_ones),
        },
        extra={"interval95": [None if one is None else rounded_all(one.interval) for one in found]},
        folded=True,
    )


def _facts(given: Arm, data: Measurements | None, planned: Planned) -> dict[str, Any]:
    made, start = planned.made, planned.start
    protocol, noise, lack = made.protocol, start.noise, planned.forecast.lack
    out: dict[str, Any] = {
        "kind": "design" if planned.request.is_plain else "optimal",
        "robot": given.robot.name,
        "load_path": given.model.load_path,
        "links": given.model.link_kind,
        "data": None if data is None else data.source,
        "readings": start.readings,
        "loads_N": rounded_all(protocol.forces),
        "read": list(protocol.columns),
        "repeats": protocol.repeats,
        "unloading": protocol.unloading,
        "noise": {
            "reading_mm": rounded(noise.white[0] * 1e3),
            "reading_mrad": rounded(noise.white[1] * 1e3),
            "share_of_deflection": rounded(noise.share),
            "setup_mm": rounded(noise.pose[0] * 1e3),
            "setup_mrad": rounded(noise.pose[1] * 1e3),
            "setup_share_of_deflection": rounded(noise.pose_share),
            "source": start.noise_origin,
        },
        "promise": {
            "aims_at": HOLDS,
            "kept_in_simulations": list(KEPT),
            "lack_of_fit": "of the readings" if planned.forecast.seen else "usual",
            "share_of_deflection": rounded(lack[1]),
            "share_of_deflection_from_to": rounded_all((lack[0], lack[2])),
        },
        "candidate_poses": planned.candidates,
        "held_deg": {name: rounded(v) for name, v in planned.held_deg.items()},
        "calibration": None if planned.calibrated is None else calibration_payload.answer(planned.calibrated),
        "criterion": made.criterion,
        "value": rounded(made.value),
        "words": planned.sentences,
    }
    if not planned.request.is_plain:
        typical, random = made.per_parameter(made.value), made.per_parameter(made.random_median)
        out["random"] = {
            "median_value": rounded(made.random_median),
            "sd_ratio": rounded(float(random / typical), 4),
            "efficiency": None if made.random_needed is None else rounded(made.random_needed / len(made.q), 3),
            "setups_for_the_same": made.random_needed,
            "most_tried": len(made.random),
        }
    return out
