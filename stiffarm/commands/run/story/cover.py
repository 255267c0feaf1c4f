"""The pages around a run's report: index.html, which leads to every output, and the card, one sheet of A4."""

from __future__ import annotations

from collections.abc import Sequence

from stiffarm.commands.calibrate.words import estimate_text
from stiffarm.commands.run.findings import Findings
from stiffarm.pages.files import LAST, listed
from stiffarm.pages.parts import rendered
from stiffarm.pages.report import Answer, KeyFigure, Section, Table, footer, render
from stiffarm.session.outputs import OutputFolder

CARD = "card.html"
# More do not fit on the sheet.
MOST_SPRINGS = 12
# Groups of the index: a title, and what names begin or end with.
_GROUPS = (
    ("Models and surrogate", (".toml", "surrogate.json", "surrogates/")),
    ("For other programs", (".json", ".vtu", ".vtp", ".csv")),
)


def write_index(
    f: Findings, lede: str, key: Sequence[KeyFigure], answer: Answer, made_of: str, folder: OutputFolder
) -> None:
    """Write index.html once all other results are there."""

    def write() -> None:
        names = [*folder.names(), LAST]
        sections = [
            Section(title, (Table("", ("file", "what it is"), tuple(files), text_columns=(0, 1)),), folded=k > 1)
            for k, (title, files) in enumerate(_grouped(names))
            if files
        ]
        question = "everything that this run wrote"
        first = Answer(todo=answer.todo, picture=answer.picture, warnings=answer.warnings)
        folder.write_text("index.html", render(f.title, lede, key, sections, footer(made_of), question, first, names))

    folder.at_end("index.html", write)


def _grouped(names: Sequence[str]) -> list[tuple[str, list[tuple[str, str]]]]:
    rest = listed(names)
    pages = [one for one in rest if one[0].endswith(".html")]
    rest = [one for one in rest if one not in pages]
    groups = [("Pages to open", pages)]
    for title, ends in _GROUPS:
        mine = [(name, what) for name, what in rest if name.endswith(ends) or name.startswith(ends)]
        rest = [one for one in rest if one not in mine]
        groups.append((title, mine))
    drawn = [(n, n.rpartition("/")[2].removesuffix(".png").replace("_", " ")) for n in names if "figures/" in n]
    return [*groups, ("Pictures", [*rest, *drawn])]


def write_card(
    f: Findings, lede: str, key: Sequence[KeyFigure], answer: Answer, made_of: str, folder: OutputFolder
) -> None:
    """Write the card: one sheet of A4 that says what was found, how sure, and what to do."""
    best = f.best.calibrated
    springs = (
        [] if best is None or best.found.studies else [(e.parameter.place, estimate_text(e)) for e in best.springs]
    )

    def write() -> None:
        text = rendered(
            "card.html.j2",
            files=frozenset([*folder.names(), LAST]),
            title=f.title,
            lede=lede,
            key=key,
            answer=answer,
            springs=springs[:MOST_SPRINGS],
            best=f.best.name,
            readings=f"{f.used.n} of {f.data.n} readings at {len(f.data.pose_groups())} poses",
            footer=footer(made_of),
        )
        folder.write_text(CARD, text)

    folder.at_end(CARD, write)
