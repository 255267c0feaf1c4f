"""What the model is missing, in a run: one diagnosis, or two where the load path itself is a question."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from doe import Measurements
from doe.estimation.campaign import Campaign
from fem.arm import Arm
from robots.quantities import significant
from stiffarm.commands.diagnose import step
from stiffarm.commands.diagnose.command import DiagnoseRequest
from stiffarm.commands.diagnose.page import Story
from stiffarm.commands.diagnose.result import made_arm, result_of, tables_of
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.commands.diagnose.words import VERDICTS
from stiffarm.commands.run.doubts import Without, without_doubted
from stiffarm.session import inputs
from stiffarm.session.outputs import OutputFolder


@dataclass(frozen=True, eq=False)
class Look:
    """One diagnosis of a run. ``title``: what it was made with, in words; ``stem``: folder of its files.

    ``story``: its files and sections; ``content``: its JSON; ``without``: what it says without the readings in doubt,
    None where there are none.
    """

    title: str
    stem: str
    found: Diagnosed
    story: Story
    content: Mapping[str, Any]
    without: Without | None = None

    @property
    def named(self) -> tuple[str, ...]:
        """Codes of the effects named; none that is not even likely without the readings in doubt."""
        codes = tuple(f.code for f in self.found.found.effects)
        return codes if self.without is None or set(codes) <= set(self.without.likely) else ()

    @property
    def value(self) -> str:
        """The verdict as a headline; readings in doubt decide none."""
        verdict, named, w = self.found.found.verdict, self.named, self.without
        if named:
            return named[0] + (f" and {len(named) - 1} more" if len(named) > 1 else "")
        same = w is None or (verdict, self.named) == (w.verdict, w.codes)
        return VERDICTS[verdict if same and verdict != "named" else "ambiguous"]

    @property
    def label(self) -> str:
        """What the value is of, both errors at poses not seen, and what hangs on readings in doubt."""
        d, w, (before, after) = self.found, self.without, self.found.unseen_rms_mm
        error = f"{significant(before)} to {significant(after)}" if d.in_model else significant(before)
        text = f"what the model is missing; {self.title[0].lower()}{self.title[1:]}; error at poses not seen {error} mm"
        if w is None:
            return text
        said = ", ".join(w.codes) or VERDICTS[w.verdict]
        sure = "; most probable still" if self.named and not w.codes else ""
        return f"{text}; without the readings in doubt: {said}{sure}"


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
    asked = [("All readings", "diagnosis", given, DiagnoseRequest(seed=seed))]
    if given.model.load_path == "parallelogram":
        serial = inputs.with_load_path(given, "serial")
        at = f" at {', '.join(f'{v:g}' for v in loads)} N" if loads else ""
        asked.insert(
            0,
            (
                f"The serial chain{at}",
                "diagnosis_serial",
                serial,
                DiagnoseRequest(loads=loads, next_poses=0, seed=seed),
            ),
        )
    out = []
    for title, stem, arm, request in asked:
        say(f"diagnosis: {title[0].lower()}{title[1:]}")
        found = step.diagnose(arm, table, request, holdout=kept, say=say)
        without = without_doubted(found, table)
        out.append(Look(title, stem, found, *written(found, f"{stem}/", folder), without))
    for look in headlines(out):
        say(f"{look.value}: {look.label}")
    return tuple(out)


def written(d: Diagnosed, before: str, folder: OutputFolder) -> tuple[Story, Mapping[str, Any]]:
    """All files of a diagnosis but its page; ``before``: what their names begin with."""
    story = Story(d, made_arm(d), tables_of(d), before)
    content = {**result_of(d).as_json, **story.write(folder)}
    folder.write_json(f"{before}diagnosis.json", content)
    return story, content


def headlines(looks: Sequence[Look]) -> tuple[Look, ...]:
    """The looks that a first screen tells: those that named something, and the last one, on all readings."""
    return tuple(look for look in looks if look.named or look is looks[-1])


def payload(found: tuple[Look, ...]) -> list[dict[str, Any]]:
    """What each diagnosis found, in short; all of it stands in the diagnosis.json of its folder."""
    return [
        {
            "of": look.title,
            "files": look.stem,
            "verdict": look.found.found.verdict,
            "effects": [f.code for f in look.found.found.effects],
            "provisional": [f.code for f in look.found.found.provisional],
            "gap": look.content["gap"],
            "headline": {"value": look.value, "label": look.label} if look in headlines(found) else None,
            "without_readings_in_doubt": look.without
            and {
                "verdict": look.without.verdict,
                "effects": list(look.without.codes),
                "likely": list(look.without.likely),
                "left_out": look.without.readings,
            },
            "next": look.content["next"],
            "cost_of_leaving_out": look.content.get("cost_of_leaving_out"),
        }
        for look in found
    ]
