"""report.html of a comparison: what differs, by how much, whether beyond the noise; maps with their difference."""

from __future__ import annotations

from collections.abc import Sequence

from stiffarm.commands.compare import words
from stiffarm.commands.compare.figures import QUANTITIES, map_figure, numbers_figure
from stiffarm.commands.compare.map_page import page_of_both
from stiffarm.commands.compare.step import Compared
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Answer, Block, Bullets, KeyFigure, Picture, Section, Table, Text, write_page
from stiffarm.session.outputs import OutputFolder

QUESTION = "what differs, and is it more than noise?"


def write_report(some: Sequence[Compared], folder: OutputFolder) -> None:
    """Draw all figures, write report.html, and of maps the page of both."""
    first = some[0].a
    sections, picture = list[Section](), None
    for number, c in enumerate(some, start=1):
        pictures = Pictures(folder, "" if len(some) == 1 else f"{number}_")
        blocks, shown = _maps(c, pictures, folder, number, len(some)) if c.maps is not None else _numbers(c, pictures)
        picture = picture or shown
        sections.append(Section(f"{c.b.name} against {first.name}", tuple(blocks)))
    key = _key_figures(some)
    sections.append(_how(some[0]))
    lede = words.headline(some[0]) if len(some) == 1 else " ".join(f"{c.b.name}: {words.headline(c)}" for c in some)
    sure = (
        "Beyond the noise: significant at 5 % by Student's t, corrected for the number of comparisons (Holm)."
        if (some[0].maps is None)
        else "Beyond the noise: more than 1.96 standard deviations of both maps' combined uncertainty."
    )
    title = f"Two {first.kind}s" if len(some) == 1 else f"{len(some) + 1} {first.kind}s"
    made = f"first: {first.name}; compared: {', '.join(c.b.name for c in some)}"
    write_page(folder, title, lede, key, sections, QUESTION, made, Answer(sure, "", picture))


def _key_figures(some: Sequence[Compared]) -> list[KeyFigure]:
    c = some[0]
    if c.maps is not None:
        row = words.map_row(c.maps.quantities[0])
        return [
            KeyFigure(row[4], f"change of {row[0]} in the median"),
            KeyFigure(row[5], "over nine tenths of the points"),
        ]
    return [
        KeyFigure(
            f"{len(c.beyond)} of {words.counted(c).partition(' ')[0]}",
            f"{words.counted(c).partition(' ')[2]} differ by more than noise",
        )
    ]


def _numbers(c: Compared, pictures: Pictures) -> tuple[list[Block], Picture | None]:
    blocks: list[Block] = []
    notes = words.remarks(c)
    if notes:
        blocks.append(Bullets(tuple(notes)))
    blocks.append(Table(f"{words.noun(c).capitalize()}s", words.HEADS, tuple(words.row(p) for p in c.pairs), (0, 3, 5)))
    if c.settings:
        rows = tuple(words.setting_row(s) for s in c.settings)
        blocks.append(Table("How they were made, and what they say", words.SETTING_HEADS, rows, (0, 1, 2)))
    figure = numbers_figure(c)
    if figure is None:
        return blocks, None
    return blocks, pictures.add(figure, "numbers", "Both values divided by the first, with their 95 % intervals.")


def _maps(
    c: Compared, pictures: Pictures, folder: OutputFolder, number: int, count: int
) -> tuple[list[Block], Picture | None]:
    assert c.maps is not None  # noqa: S101 - asked before
    blocks: list[Block] = []
    notes = words.remarks(c)
    if c.a.page is not None and c.b.page is not None:
        name = "maps.html" if count == 1 else f"maps_{number}.html"
        page = page_of_both(c.a.page, c.b.page, c.b.name)
        if page is None:
            notes.append(
                "The maps' own pages are of an older version: make the maps again with --html for a page of both."
            )
        else:
            folder.write_text(name, page)
            blocks.append(
                Text(
                    f"{name} shows both maps side by side, on one scale and under one camera, and what they "
                    "differ by as a quantity."
                )
            )
    else:
        notes.append("For a page of both maps to turn and pick in, make them with --html.")
    if notes:
        blocks.append(Bullets(tuple(notes)))
    rows = tuple(words.map_row(q) for q in c.maps.quantities)
    blocks.append(Table("Quantities", words.MAP_HEADS, rows, (0, 1)))
    drawn = [
        pictures.add(
            map_figure(c.maps, q),
            q.name,
            f"{q.label[0].upper()}{q.label[1:]}: both maps on one scale, and what they differ by.",
        )
        for q in c.maps.quantities[:QUANTITIES]
    ]
    return [*blocks, *drawn[1:]], drawn[0]


def _how(c: Compared) -> Section:
    if c.maps is not None:
        lines: tuple[str, ...] = (
            "Each point that both maps reach is compared; stiffnesses as a fraction of the first map's.",
            "Maps with different robots, loads, normals, points or units are refused.",
        )
    else:
        lines = (
            "Each is compared in the variable whose error is normally distributed (for a stiffness, the compliance). "
            "'Perhaps': below 5 % alone, but among so many comparisons one such is expected by chance.",
            "A parameter that one of them does not identify counts as different only where the 95 % intervals do not "
            "overlap.",
            "The test of all parameters together uses the covariances kept in calibrated model files.",
        )
    return Section("How it was done", (Bullets(lines),), folded=True)
