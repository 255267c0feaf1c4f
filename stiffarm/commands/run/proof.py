"""The rehearsal that ends a run: whether its own set-ups would have shown an effect that is hidden on purpose."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from doe import Measurements, write_measurements
from fem.arm import Arm
from rehearsal import World
from rehearsal.scoring import DETECTABLE
from robots import InputError
from stiffarm.commands.rehearse import results, step
from stiffarm.commands.rehearse.command import ANY, RehearseRequest
from stiffarm.commands.rehearse.step import Rehearsed
from stiffarm.commands.run.findings import Findings
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Fold, Note, Section, Text
from stiffarm.result import Result
from stiffarm.session.outputs import OutputFolder

FOLDER = "rehearsal"
# Draws until one is visible at these set-ups.
TRIES = 40


def rehearse(
    f: Findings, table: Measurements, folder: OutputFolder, say: Callable[[str], None]
) -> Rehearsed | InputError:
    """Hide a secret effect in made-up readings of the calibrated arm at the run's own set-ups, and diagnose them.

    What hinders is returned: an arm or a table that a rehearsal cannot be made of hinders nothing else of a run.
    """
    best = f.constant
    kind = best.model.link_kind
    arm = Arm.of(best.description, "beam" if kind in ("shell", "solid") else kind, best.model.load_path)
    # One table of all that was read: its own readings only tell the noise.
    sheet = folder.path(f"{FOLDER}/sheet.csv")
    write_measurements(table, sheet, f.given.robot)
    asked = RehearseRequest(sheet=sheet, hide=ANY, seed=f.seed)
    try:
        world = step.prepared(arm)
        set_ups = step.set_ups_of(arm, world, asked)
        hidden = _visible(step.made(arm, world, set_ups, asked, draw) for draw in range(TRIES))
        found = step.rehearse(arm, hidden, set_ups, folder.path(f"{FOLDER}/readings.csv"), seed=f.seed, say=say)
    except InputError as hindrance:
        return hindrance
    folder.write_json(f"{FOLDER}/rehearse.json", _result(found, f.seed).as_json)
    folder.write_json(f"{FOLDER}/truth.json", step.truth(found.world))
    return found


def _visible(worlds: Iterator[World]) -> World:
    """The first world whose effect its readings could show, in its own judgement; else the last one."""
    for world in worlds:
        if world.excess() >= DETECTABLE:
            break
    return world


def payload(found: Rehearsed | InputError | None) -> dict[str, Any] | None:
    """What came of it, as of one draw; None where there was none."""
    if not isinstance(found, Rehearsed):
        return None
    content = _result(found).as_json
    return {**content["draws"][0], "parameters": content.get("parameters", [])}


def _result(found: Rehearsed, seed: int = 0) -> Result:
    return results.result([(found, b"")], secret=True, seed=seed)


def proof_section(found: Rehearsed | InputError, pictures: Pictures) -> Section:
    """The hidden and the found."""
    title = "Would these set-ups show what is missing? A rehearsal"
    if isinstance(found, InputError):
        return Section(title, (Note(f"No rehearsal of this arm with these set-ups: {found.prose}."),))
    mine, whole = Pictures(pictures.folder, f"{FOLDER}_"), _result(found)
    more: list[Block] = [
        Text(
            "One effect was drawn at random from those that these set-ups can show and hidden in simulated readings of "
            "this arm, at the poses and loads of this table and with its noise. A separate implementation of the "
            "mechanics made these readings, and the diagnosis ran on them without knowing the effect."
        ),
        Text(results.visible(found)),
        *(table.block() for table in whole.tables if not table.folded),
        Text(results.gap(found)),
        *(mine.add(one.draw(), one.name, one.caption) for one in whole.drawings),
        Text("`stiffarm rehearse MODEL SHEET --hide any --draws 40` does this forty times and counts the successes."),
    ]
    return Section(title, (Note(results.headline(found)), Fold("How it was done, and how close it came", tuple(more))))
