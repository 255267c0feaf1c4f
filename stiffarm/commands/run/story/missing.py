"""The report's section on what the model is missing: the verdict and how far the gap shrank; all else folds away."""

from __future__ import annotations

from collections.abc import Sequence

from stiffarm.commands.diagnose import report, words
from stiffarm.commands.diagnose.space import space_blocks
from stiffarm.commands.run.missing import Look
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Fold, Note, Picture, Section, Text


def missing_section(looks: Sequence[Look], pictures: Pictures) -> Section:
    """Each diagnosis: the verdict and the gap; of the last one, on all readings, the pictures too."""
    blocks: list[Block] = []
    for look in looks:
        blocks += _look(look, pictures, last=look is looks[-1])
    return Section("What the model is missing", tuple(blocks))


def _look(look: Look, pictures: Pictures, *, last: bool) -> list[Block]:
    d = look.found
    mine = Pictures(pictures.folder, f"{look.stem}_")
    shrunk = report.shrunk(d, mine).blocks
    seen: list[Block] = [Note(f"{look.title}: {words.headline(d)}"), Text(words.gap_sentence(d))]
    space = space_blocks(d, look.written.gaps, look.written.cost, mine, f"{look.stem}/")
    shown = [block for block in (*shrunk, *space) if isinstance(block, Picture) and last][:1] if d.in_model else []
    parts = [report.in_short(d)]
    if d.tells:
        parts += [report.where(d, mine), report.explained(d, mine)]
    if d.in_model:
        parts.append(report.laws(d, mine))
    rest: list[Block] = [block for part in parts for block in part.blocks]
    rest += [*shrunk, *space]
    if last and d.tells:
        rest += [*report.next_readings(d).blocks, *report.not_told(d).blocks]
    # Parts of the diagnosis's own page begin alike: each sentence once.
    told = [*seen, *shown, Note(words.headline(d))]
    rest = [block for block in dict.fromkeys(rest) if block not in told]
    of = f"{look.title[0].lower()}{look.title[1:]}"
    rest.append(Text(f"All figures are in {look.stem}/diagnosis.json, the model in {look.stem}/model.toml."))
    return [*seen, *shown, Fold(f"How sure, where, and what else it could be: {of}", tuple(rest))]


def next_words(look: Look) -> str:
    """What to measure next, in one sentence."""
    d = look.found
    if d.proposal is None:
        return words.next_sentence(d)
    return (
        f"Measure {len(d.proposal.labels)} set-ups that would settle what is open: fill in "
        f"{look.stem}/next_readings.csv and run again with it."
    )
