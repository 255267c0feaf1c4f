"""The report's sections on what the model is missing: how the gap shrinks, where in space, and what it would cost."""

from __future__ import annotations

from stiffarm.commands.diagnose import report, words
from stiffarm.commands.diagnose.space import space_blocks
from stiffarm.commands.run.missing import Look
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Section, Text


def missing_section(look: Look, pictures: Pictures, *, last: bool) -> Section:
    """One diagnosis: the verdict, where, what explains it, how the gap shrinks, and after the last what to do next."""
    d = look.found
    mine = Pictures(pictures.folder, f"{look.stem}_")
    parts = [report.in_short(d)]
    if d.tells:
        parts += [report.where(d, mine), report.explained(d, mine)]
    if d.in_model:
        parts.append(report.laws(d, mine))
    parts.append(report.shrunk(d, mine))
    blocks: list[Block] = [block for part in parts for block in part.blocks]
    blocks += space_blocks(d, look.written.gaps, look.written.cost, mine)
    if last and d.tells:
        blocks += report.next_readings(d).blocks
        blocks += report.not_told(d).blocks
    blocks.append(Text(f"All figures of this diagnosis are in {look.stem}/diagnosis.json, its model in {look.stem}/."))
    # Parts of the diagnosis's own page begin alike: each sentence once.
    return Section(f"What is missing: {look.title[0].lower()}{look.title[1:]}", tuple(dict.fromkeys(blocks)))


def next_words(look: Look) -> str:
    """What to measure next, in one sentence."""
    d = look.found
    if d.proposal is None:
        return words.next_sentence(d)
    return (
        f"{len(d.proposal.labels)} set-ups that would settle what is open; the sheet to fill in is "
        f"{look.stem}/next_readings.csv."
    )
