"""The report's section on what the model is missing: the verdict and how far the gap shrank; all else folds away."""

from __future__ import annotations

from collections.abc import Sequence

from stiffarm.commands.diagnose import words
from stiffarm.commands.run.missing import Look
from stiffarm.pages.blocks import Pictures, placed
from stiffarm.pages.report import Block, Fold, Note, Picture, Section, Text


def missing_section(looks: Sequence[Look], pictures: Pictures) -> Section:
    """Each diagnosis: the verdict and the gap; of the last one, on all readings, the pictures too."""
    blocks: list[Block] = []
    for look in looks:
        blocks += _look(look, pictures, last=look is looks[-1])
    return Section("What the model is missing", tuple(blocks))


def _look(look: Look, pictures: Pictures, *, last: bool) -> list[Block]:
    d, story = look.found, look.story
    told = [story.shrunk()]
    if d.tells:
        told = [story.ladder(), story.where(), *told, story.explained()]
    if d.in_model:
        told.append(story.laws())
    blocks = [block for section in told for block in section.blocks]
    if d.in_model:
        blocks += story.costs()
    if last and d.tells:
        blocks += [*story.next_readings().blocks, *story.not_judged().blocks]
    parts = placed(blocks, Pictures(pictures.folder, f"{look.stem}_"))
    seen: list[Block] = [
        Note(f"{look.title}: {words.headline(d)}"),
        Text(words.how_sure(d)),
        Text(words.gap_sentence(d)),
    ]
    # The ladder, where there is one.
    shown = [block for block in parts if isinstance(block, Picture) and last][:1] if d.in_model else []
    # Each sentence once.
    rest = [block for block in dict.fromkeys(parts) if block not in (*seen, *shown)]
    of = f"{look.title[0].lower()}{look.title[1:]}"
    rest.append(Text(f"All figures are in {look.stem}/diagnosis.json, the model in {look.stem}/model.toml."))
    return [*seen, *shown, Fold(f"How sure, where, and what else it could be: {of}", tuple(rest))]


def next_words(look: Look) -> str:
    """What to measure next, with its chance."""
    return words.advice(look.found, f"{look.stem}/next_readings.csv").text
