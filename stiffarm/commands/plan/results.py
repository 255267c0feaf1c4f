"""What the command `plan` leaves behind: figures as JSON, a table on the screen, the sheet."""

from __future__ import annotations

from typing import Any

import numpy as np

from doe import Measurements
from doe.certainty.uncertainty import ParameterEstimate
from doe.planning.forecast import HOLDS, KEPT
from doe.planning.plan import Foresight
from doe.planning.protocol import Protocol
from doe.tables.columns import DISPLACEMENTS
from fem.arm import Arm
from robots import Robot
from robots.constants import NORMAL_95
from robots.quantities import rounded
from stiffarm.commands.calibrate import payload as calibration_payload
from stiffarm.commands.calibrate import tables as calibration_tables
from stiffarm.commands.plan import words
from stiffarm.commands.plan.sheets import Sheet
from stiffarm.commands.plan.step import Planned
from stiffarm.session.console import say, say_notes, show_table
from stiffarm.session.words.directions import set_up_rows

SCHEMA = "stiffarm-plan/1"

RULES = (
    "Take the set-ups in this order. The small number in a box is the row (column step) of measurement_sheet.csv.",
    "Zero the gauge on the unloaded arm before each repeat; for a repeat take the whole load off and put it on again.",
    "Displacements are those of the loaded point, in mm along the base's axes (x forward at q1 = 0, z up): "
    "a downward load gives a negative dz. Rotations are in mrad about the same axes.",
    "Leave a box empty where nothing was read. Write what else happened into the remarks.",
)


def robot_title(given: Arm) -> str:
    """The robot's own title."""
    return given.description.title or given.robot.name


def _place(protocol: Protocol) -> str:
    """Where the loads act, in words."""
    if protocol.point is None:
        return "the tool point"
    return f"x, y, z = {', '.join(f'{1e3 * v:g}' for v in protocol.point)} mm from the flange"


def plan_sheet(given: Arm, data: Measurements | None, planned: Planned) -> Sheet:
    """The sheet of a plan."""
    made, protocol = planned.made, planned.made.protocol
    loads = ", ".join(f"{f:g}" for f in protocol.forces.tolist())
    source = "no readings yet" if data is None else f"{data.source}, {planned.start.readings} readings"
    facts = [
        ("robot", robot_title(given)),
        ("made from", f"{source}; model {given.robot.name}, {given.model.load_path}, {given.model.link_kind} links"),
        ("chosen to tell", ", ".join(p.name for p in planned.start.parameters)),
        ("loads", f"{loads} N at {_place(protocol)}, {protocol.repeats} times each"),
    ]
    if planned.held_deg:
        facts.append(("standing still", ", ".join(f"{k} = {v:g}" for k, v in planned.held_deg.items())))
    rules = [
        *RULES,
        "The plan knows joint limits, floor and boxes, not cables and fixtures: drive slowly the first time.",
    ]
    return Sheet(
        given.robot,
        f"Measurement sheet {given.robot.name}",
        made.q,
        made.direction,
        planned.labels,
        tuple(_hint(planned, k) for k in range(len(planned.labels))),
        protocol,
        tuple(facts),
        tuple(rules),
    )


def _hint(planned: Planned, k: int) -> str:
    """What to expect under the largest load: a gauge read in the wrong unit or sign shows at once."""
    if planned.expected is None:
        return ""
    force = float(planned.made.protocol.forces.max())
    parts = []
    for c in planned.made.protocol.components:
        name, _, unit = DISPLACEMENTS[c].rpartition("_")
        parts.append(f"{name} ≈ {1e3 * planned.expected[k, c]:.1g} {unit}")
    return f"to expect at {force:g} N, roughly: {', '.join(parts)}".replace("-", "−")


def payload(given: Arm, data: Measurements | None, planned: Planned) -> dict[str, Any]:
    """plan.json."""
    made, start = planned.made, planned.start
    protocol, noise = made.protocol, start.noise
    out: dict[str, Any] = {
        "schema": SCHEMA,
        "kind": "design" if planned.request.plain else "optimal",
        "robot": given.robot.name,
        "load_path": given.model.load_path,
        "links": given.model.link_kind,
        "data": None if data is None else data.source,
        "readings": start.readings,
        "loads_N": [rounded(float(f)) for f in protocol.forces],
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
            "share_of_deflection": rounded(planned.forecast.lack[1]),
            "share_of_deflection_from_to": [rounded(v) for v in (planned.forecast.lack[0], planned.forecast.lack[2])],
            "words": words.rests_on(start, planned.forecast),
        },
        "candidate_poses": planned.candidates,
        "held_deg": {name: rounded(v) for name, v in planned.held_deg.items()},
        "setups": [_setup(given.robot, planned, k) for k in range(len(planned.labels))],
        "calibration": None if planned.calibrated is None else calibration_payload.answer(planned.calibrated),
        "parameters": [parameter_payload(f, found) for f, found in planned.rows],
        "criterion": made.criterion,
        "value": rounded(made.value),
        "words": planned.sentences,
        "notes": list(planned.notes),
    }
    if not planned.request.plain:
        typical, random = made.per_parameter(made.value), made.per_parameter(made.random_median)
        out["random"] = {
            "median_value": rounded(made.random_median),
            "sd_ratio": rounded(float(random / typical), 4),
            "efficiency": None if made.random_needed is None else rounded(made.random_needed / len(made.q), 3),
            "setups_for_the_same": made.random_needed,
            "most_tried": len(made.random),
        }
    return out


def _setup(robot: Robot, planned: Planned, k: int) -> dict[str, Any]:
    q = np.degrees(planned.made.q[k])
    out: dict[str, Any] = {"pose": planned.labels[k]}
    out |= {name: rounded(float(v)) for name, v in zip(robot.coordinates, q, strict=True)}
    out["direction"] = [rounded(float(v)) for v in planned.made.direction[k]]
    if planned.expected is not None:
        read = planned.made.protocol.components
        out["expected_at_largest_load"] = {
            DISPLACEMENTS[c]: rounded(1e3 * float(planned.expected[k, c]), 3) for c in read
        }
    return out


def parameter_payload(f: Foresight, found: ParameterEstimate | None) -> dict[str, Any]:
    """One parameter before and after; SI units, standard deviations of ln value where ``sd_of`` says so."""
    p = f.parameter
    out: dict[str, Any] = {
        "name": p.name,
        "unit": p.unit,
        "status": "no readings" if found is None else found.status,
        "interval95": None if found is None else [rounded(v) for v in found.interval],
        "planned_for": rounded(f.planned_for),
        "sd_of": "value" if p.scale == "linear" else "ln value",
        "sd_before": rounded(f.before),
        "sd_after": rounded(f.after),
        "shrink": rounded(f.shrink, 4),
        "promised_half_width95": rounded(NORMAL_95 * f.promised),
        "promised_shrink": rounded(f.promised_shrink, 4),
        "seen": f.seen,
    }
    if p.scale == "compliance" and f.seen:
        out["told_from_rigid_up_to"] = rounded(words.rigid_from(f), 3)
    return out


def show(given: Arm, planned: Planned) -> None:
    """Set-ups and prospects on the screen."""
    rows = [list(row) for row in set_up_rows(planned.labels, planned.made.q, planned.made.direction)]
    kind = "plain design" if planned.request.plain else f"{planned.made.criterion}-optimal choice"
    count = f"{len(planned.labels)} set-ups for {given.robot.name}, {kind} of {planned.candidates} poses"
    show_table(count, ["set-up", *given.robot.coordinates, "load"], rows)
    if planned.calibrated is not None:
        calibration_tables.show_answer(planned.calibrated)
    say(f"what {len(planned.labels)} set-ups tell (95 %):")
    for sentence in planned.sentences:
        say(f"  {sentence}")
    say_notes(planned.notes)
