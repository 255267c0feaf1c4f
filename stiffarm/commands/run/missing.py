"""What the model is missing, in a run: one diagnosis, or two where the load path itself is a question."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from doe import Measurements
from doe.estimation.campaign import Campaign
from fem.arm import Arm
from stiffarm.commands.diagnose import step
from stiffarm.commands.diagnose.files import Written, write_files
from stiffarm.commands.diagnose.step import Diagnosed, Request
from stiffarm.pages.numbers import significant
from stiffarm.session import inputs
from stiffarm.session.outputs import OutputFolder


@dataclass(frozen=True, eq=False)
class Look:
    """One diagnosis of a run. ``title``: what it was made with, in words; ``stem``: folder of its files."""

    title: str
    stem: str
    found: Diagnosed
    written: Written


def looks(
    given: Arm,
    table: Measurements,
    scheme: Campaign,
    kept: Measurements | None,
    seed: int,
    folder: OutputFolder,
    say: Callable[[str], None],
) -> tuple[Look, ...]:
    """Diagnose the model on all readings, and write what was found.

    An arm with a parallelogram is first taken for the serial chain that a plain model makes of it, at the scheme's
    loads: whether the load path is missing there is what the readings have to say.
    """
    loads = scheme.loads_N
    asked = [("All readings", "diagnosis", given, Request(seed=seed))]
    if given.model.load_path == "parallelogram":
        serial = inputs.with_load_path(given, "serial")
        at = f" at {', '.join(f'{v:g}' for v in loads)} N" if loads else ""
        asked.insert(0, (f"The serial chain{at}", "diagnosis_serial", serial, Request(loads, next_poses=0, seed=seed)))
    out = []
    for title, stem, arm, request in asked:
        say(f"diagnosis: {title[0].lower()}{title[1:]}")
        found = step.diagnose(arm, table, request, holdout=kept, say=say)
        out.append(Look(title, stem, found, write_files(found, folder, f"{stem}/")))
    return tuple(out)


def headline(found: Sequence[Look]) -> Look | None:
    """The last look that named something; what is only suspected, or left to readings in doubt, is no headline."""
    return next((look for look in reversed(found) if look.found.found.effects), None)


def sentences(found: Sequence[Look]) -> list[str]:
    """What was named, and the errors at poses not seen without and with it."""
    out = []
    for look in found:
        if look.found.found.effects:
            codes = " and ".join(e.code for e in look.found.found.effects)
            before, after = (significant(v) for v in look.found.unseen_rms_mm)
            out.append(f"missing ({look.title.lower()}): {codes}; error at poses not seen {before} -> {after} mm RMS")
    return out


def payload(found: tuple[Look, ...]) -> list[dict[str, Any]]:
    """What each diagnosis found, in short; all of it stands in the diagnosis.json of its folder."""
    return [
        {
            "of": look.title,
            "files": look.stem,
            "verdict": look.found.found.verdict,
            "effects": [f.code for f in look.found.found.effects],
            "provisional": [f.code for f in look.found.found.provisional],
            "gap": look.written.content["gap"],
            "next": look.written.content["next"],
            "cost_of_leaving_out": look.written.content.get("cost_of_leaving_out"),
        }
        for look in found
    ]
