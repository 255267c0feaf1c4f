"""The files of a diagnosis: its figures, the new model, the sheet to fill in, the gap and its cost in space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from doe import write_measurements
from doe.diagnosis.space import Gaps
from fem.arm import Arm
from robots import save_description
from stiffarm.commands.diagnose import payload as diagnosis_payload
from stiffarm.commands.diagnose import space
from stiffarm.commands.diagnose.model import described
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.session.outputs import OutputFolder


@dataclass(frozen=True, eq=False)
class Written:
    """What was written: ``content`` of diagnosis.json; the gaps, and the map of what leaving the effects out costs.

    ``arm``: with the new model; as given where nothing was added to it.
    """

    content: dict[str, Any]
    gaps: Gaps
    arm: Arm
    cost: space.CostMap | None


def write_files(d: Diagnosed, folder: OutputFolder, before: str = "") -> Written:
    """Write all but pictures and report; ``before``: what the names of the files begin with."""
    content = diagnosis_payload.diagnosis(d)
    gaps, arm, cost = space.write_gap(d, folder, f"{before}{space.GAP_FILE}"), d.given, None
    if d.tells:
        new = described(d)
        save_description(new, folder.path(f"{before}model.toml"))
        if d.in_model:
            arm, cost = Arm.of(new, d.given.model.link_kind, own=d.given.own), space.cost_map(d, new)
            space.write_cost(cost, d, arm, folder, before)
            content["cost_of_leaving_out"] = space.payload(cost)
    if d.proposal is not None:
        path, columns = folder.path(f"{before}next_readings.csv"), d.proposal.protocol.columns
        write_measurements(d.proposal.sheet, path, d.given.robot, to_fill=columns)
    folder.write_json(f"{before}diagnosis.json", content)
    return Written(content, gaps, arm, cost)
