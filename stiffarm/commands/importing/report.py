"""report.html of `import`: what was made of the files, what is soft, poor or rigid in it, and what to do next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from robots import ModelDescription
from robots.quantities import significant
from stiffarm.pages.bars import ranked_figure
from stiffarm.pages.blocks import Pictures
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
VERDICTS = {"trusted": "trusted", "warned": "with a warning", "refused": "no: plain section"}


def write_report(
    description: ModelDescription, content: Mapping[str, Any], links: Sequence[Mapping[str, Any]], folder: OutputFolder
) -> None:
    """Write the page; ``links``: what import.json says of each link that became a shell."""
    pictures = Pictures(folder)
    warned = [(one["link"], line) for one in links for line in one["warnings"]]
    rigid = dict(content.get("rigid", {}))
    worst = max((one["departure_mm"][0] or 0.0 for one in links if one["departure_mm"]), default=0.0)
    soft = {one["link"]: one["tip_compliance_um_per_kN"]["shell"] for one in links}
    solids = content.get("solids", [])
    kinds = (("a shell", "shells", len(links)), ("a solid", "solids", len(solids)))
    named = [f"1 link became {one}" if n == 1 else f"{n} links became {many}" for one, many, n in kinds if n]
    lede = " and ".join(named) + (f", {len(rigid)} stay rigid" if rigid else "")
    one = "1 warning" if len(warned) == 1 else f"{len(warned)} warnings"
    lede += f"; {one} to check." if warned else "; no warnings."
    key = [
        KeyFigure(str(len(links) or len(solids)), "links as shells" if links else "links as solids"),
        KeyFigure(str(len(warned)), "warnings"),
        KeyFigure(f"{significant(worst, 2)} mm", "deviation of shell from surface, 95\u00a0% below, worst link"),
    ]
    if soft:
        first = max(soft, key=soft.__getitem__)
        key.append(KeyFigure(f"{significant(soft[first])} um/kN", f"softest link at its tip: {first}"))
    caption = "Largest displacement of a link's tip under a unit force, with its root held."
    drawn = None
    if soft:
        bars = ranked_figure("Compliance of the links", soft, "compliance of the tip (um/kN)", 12)
        drawn = pictures.add(bars, "tip_compliance", caption)
    springs = any(joint.stiffness is not None for joint in description.joint)
    text = "No joint of this model has a spring yet: only its links deflect, so the model is far too stiff."
    caution = () if springs else (text,)
    sure = _how_sure(links)
    plan = "`stiffarm plan model.toml --poses 6` chooses which readings to take."
    todo = f"{'Check the warnings, then calibrate' if warned else 'Calibrate'} with readings: "
    todo += f"`stiffarm calibrate model.toml DATA`. {plan}"
    blocks: list[Block] = [
        Picture(folder.path("import.png"), "The links and the rings at which they are held.", "imported links"),
    ]
    if links:
        words = (
            "Shell / beam: tip compliance of the shell divided by that of a beam of its sections. Where it is far from "
            "1, check rings and wall."
        )
        blocks += [_table(links), Text(words)]
    sections = [
        Section("Warnings", tuple(Note(f"{name}: {line.removeprefix('WARNING: ')}") for name, line in warned)),
        Section("The links", (*blocks, *_solids(solids))),
        Section("Where the wall thicknesses come from", _walls(links) if links else ()),
        Section(
            "What stays rigid", (Bullets(tuple(f"{name}: {why}" for name, why in rigid.items())),) if rigid else ()
        ),
        Section("Repairs and changes", tuple(_changes([*links, *solids])), folded=True),
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
            VERDICTS[one["verdict"]],
            or_dash((one["departure_mm"] or [None])[0]),
            significant(one["tip_compliance_um_per_kN"]["shell"]),
            or_dash(one["tip_compliance_shell_over_beam"]),
        )
        for one in links
    )
    heads = (
        "link",
        "triangles",
        "least angle (deg)",
        "mesh",
        "as a shell",
        "off by (mm)",
        "tip (um/kN)",
        "shell over beam",
    )
    return Table("The links", heads, rows, text_columns=(0, 3, 4))


def _solids(solids: Sequence[Mapping[str, Any]]) -> tuple[Block, ...]:
    if not solids:
        return ()
    rows = tuple(
        (
            one["link"],
            one["file"],
            str(one["tetrahedra"]),
            significant(one["mass_kg"]),
            ", ".join(f"{name} {ring['radius_mm']:.0f}" for name, ring in one["rings"].items()),
        )
        for one in solids
    )
    heads = ("link", "file", "tetrahedra", "mass by volume (kg)", "seats (mm)")
    said = "With `--links solid` these links are solids and the others shells."
    return (Table("Solids", heads, rows, text_columns=(0, 1, 4)), Text(said))


def _how_sure(links: Sequence[Mapping[str, Any]]) -> str:
    """To what factor the links' compliance is known."""
    if not links:
        return "The compliance of a solid is as accurate as its modulus and its seats: a few per cent."
    by_mass = sum(one["wall_basis"] == "mass" for one in links)
    given = sum(one["wall_basis"] == "given" for one in links)
    if given == len(links):
        known = "The compliance of the links is as accurate as the wall thicknesses that you gave."
    elif by_mass + given == len(links):
        known = "With wall thicknesses from masses, the compliance of a link is known to within a factor of about 1.5."
    else:
        known = "Without its mass, the compliance of a link is known to within a factor of about 3; with it, about 1.5."
    return f"{known} CAD files of the links (STEP) would reduce this to a few per cent."


def _walls(links: Sequence[Mapping[str, Any]]) -> tuple[Block, ...]:
    """Walls, what they rest on, and what a mass that is 25 % off does."""
    rows = []
    for one in links:
        less = one.get("walls_mm_at_25_percent_less_and_more_mass")
        change = "–"
        if less is not None and min(less) > 0.0:
            softer, stiffer = ((one["wall_mm"] / wall) ** one["wall_exponent"] for wall in less)
            change = f"{100.0 * (softer - 1.0):+.0f} / {100.0 * (stiffer - 1.0):+.0f}"
        rows.append((one["link"], significant(one["wall_mm"], 2), one["wall_words"], change))
    heads = ("link", "wall (mm)", "from", "change of tilt with 25 % less / more mass (%)")
    text = (
        "Bosses around joints across a link have 2.5 times these walls, on convex hulls these walls, unless `--boss` "
        "says otherwise. Of a link's mass 60 % counts as casing (80 % for a bare tube turning about its own length), "
        "the rest as drives, gears and cables."
    )
    return (Table("Walls", heads, tuple(rows), text_columns=(0, 2)), Text(text))


def _changes(links: Sequence[Mapping[str, Any]]) -> list[Block]:
    return [Fold(one["link"], (Bullets(tuple(one["changes"])),)) for one in links if one["changes"]]
