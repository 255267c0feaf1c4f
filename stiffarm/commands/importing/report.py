"""report.html of `import`: what was made of the files, what is soft, poor or rigid in it, and what to do next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from robots import ModelDescription
from stiffarm.pages.bars import ranked_figure
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.numbers import significant
from stiffarm.pages.report import (
    Answer,
    Block,
    Bullets,
    Fold,
    KeyFigure,
    Note,
    Picture,
    Section,
    Table,
    Text,
    write_page,
)
from stiffarm.session.outputs import OutputFolder

QUESTION = "what was made of the files?"


def write_report(
    description: ModelDescription, content: Mapping[str, Any], links: Sequence[Mapping[str, Any]], folder: OutputFolder
) -> None:
    """Write the page; ``links``: what import.json says of each link that became a shell."""
    pictures = Pictures(folder)
    warned = [(one["link"], line) for one in links for line in one["warnings"]]
    rigid = dict(content.get("rigid", {}))
    worst = max((one["departure_mm"][0] or 0.0 for one in links if one["departure_mm"]), default=0.0)
    soft = {one["link"]: one["tip_compliance_um_per_kN"]["shell"] for one in links}
    named = "1 link became a shell" if len(links) == 1 else f"{len(links)} links became shells"
    lede = f"{named}" + (f", {len(rigid)} stay rigid" if rigid else "")
    one = "1 warning" if len(warned) == 1 else f"{len(warned)} warnings"
    lede += f"; {one} to look at." if warned else "; nothing to warn of."
    key = [
        KeyFigure(str(len(links)), "links as shells"),
        KeyFigure(str(len(warned)), "warnings"),
        KeyFigure(f"{significant(worst, 2)} mm", "the shell is off the original by at most this for 95\u00a0% of it"),
    ]
    if soft:
        first = max(soft, key=soft.__getitem__)
        key.append(KeyFigure(f"{significant(soft[first])} um/kN", f"softest link at its tip: {first}"))
    caption = "Largest motion of a link's tip for a unit force, its root held."
    drawn = None
    if soft:
        bars = ranked_figure("How soft the links are", soft, "compliance of the tip (um/kN)", 12)
        drawn = pictures.add(bars, "tip_compliance", caption)
    springs = any(joint.stiffness is not None for joint in description.joint)
    text = "No joint of this model has a spring yet: only its links give way, so it is far too stiff."
    caution = () if springs else (text,)
    sure = "Walls, materials and rings are assumed where the files do not say; each assumption is marked in model.toml."
    plan = "`stiffarm plan model.toml --poses 6` says which readings to take."
    todo = f"{'Look at the warnings, then calibrate' if warned else 'Calibrate'} with readings: "
    todo += f"`stiffarm calibrate model.toml DATA`. {plan}"
    blocks: list[Block] = [
        Picture(folder.path("import.png"), "The links as shells, with their rings.", "imported links"),
        _table(links),
        Text("A shell is compared with its beam at the tip: where the ratio is far from 1, look at rings and wall."),
    ]
    sections = [
        Section("Warnings", tuple(Note(f"{name}: {line.removeprefix('WARNING: ')}") for name, line in warned)),
        Section("The links", tuple(blocks)),
        Section(
            "What stays rigid", (Bullets(tuple(f"{name}: {why}" for name, why in rigid.items())),) if rigid else ()
        ),
        Section("What was changed on the way", tuple(_changes(links)), folded=True),
    ]
    notes = [line for line in content.get("notes", ()) if ": WARNING: " not in line]
    if notes:
        sections.append(Section("Remarks", (Bullets(tuple(notes)),), folded=True))
    title = description.title.split(" (")[0]
    write_page(folder, title, lede, key, sections, QUESTION, "", Answer(sure, todo, drawn, caution))


def _table(links: Sequence[Mapping[str, Any]]) -> Table:
    def or_dash(value: float | None) -> str:
        return "–" if value is None else significant(value, 2)

    rows = tuple(
        (
            one["link"],
            str(one["triangles"]),
            f"{one['minimum_angle_deg']:.0f}",
            one["quality"],
            or_dash((one["departure_mm"] or [None])[0]),
            significant(one["tip_compliance_um_per_kN"]["shell"]),
            or_dash(one["tip_compliance_shell_over_beam"]),
        )
        for one in links
    )
    heads = ("link", "triangles", "least angle (deg)", "quality", "off by (mm)", "tip (um/kN)", "shell over beam")
    return Table("The links", heads, rows, text_columns=(0, 3))


def _changes(links: Sequence[Mapping[str, Any]]) -> list[Block]:
    return [Fold(one["link"], (Bullets(tuple(one["changes"])),)) for one in links if one["changes"]]
