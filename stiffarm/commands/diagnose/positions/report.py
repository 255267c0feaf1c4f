"""report.html of a diagnosis from positions: what is missing, how sure, what it does, what else was asked."""

from __future__ import annotations

from matplotlib.figure import Figure

from doe.absolute.identified import findings
from doe.absolute.missing.diagnose import Missing
from fem.arm import Arm
from robots.quantities import percent
from stiffarm.commands.calibrate.positions import parameters_table
from stiffarm.commands.diagnose.positions import words
from stiffarm.commands.diagnose.positions.payload import free
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.figure_parts import drawing
from stiffarm.pages.report import Answer, Block, Bullets, KeyFigure, Section, Text, write_page
from stiffarm.pages.style import OKABE_ITO
from stiffarm.session.outputs import OutputFolder

QUESTION = "what is the model missing, judged by positions?"


def write_report(given: Arm, m: Missing, folder: OutputFolder) -> None:
    """Draw the figure and write report.html."""
    pictures = Pictures(folder)
    before, after = (1e3 * x for x in m.left_out_rms())
    key = [
        KeyFigure(f"{before:.3f} mm", "RMS of left-out poses, with geometry fitted"),
        KeyFigure(f"{after:.3f} mm", "the same, with the effects found"),
        KeyFigure(str(len(m.effects)), "effects named" if len(m.effects) != 1 else "effect named"),
    ]
    sections = [
        _found(m, pictures),
        Section("Other candidates", (words.candidates_table(m), *_asked(m)), folded=True),
    ]
    sections.append(Section("Remarks", (Bullets(tuple(f"{r}." for r in words.remarks(m))),)))
    names = free(m)
    todo = (
        "Nothing: the calibrated geometry explains these readings."
        if names is None
        else f"Calibrate with these effects: `stiffarm calibrate MODEL FILE --free {names}`."
    )
    title, data = given.description.title.split(" (")[0], m.after.data
    write_page(
        folder,
        title,
        f"{words.answer(m)}.",
        key,
        sections,
        QUESTION,
        f"{data.source}, {len(data)} positions",
        Answer(words.errors(m), todo),
    )


def _found(m: Missing, pictures: Pictures) -> Section:
    if not m.found:
        text = (
            f"{m.reason[:1].upper()}{m.reason[1:]}. A coordinate scatters by {1e3 * m.before.variances.sigma:.3g} mm."
        )
        return Section("What is missing", (Text(text),))
    caption = "Bars: how far each effect moves the readings, in addition to geometry and the other effects found."
    blocks: list[Block] = [pictures.add(acts_figure(m), "effects", caption), words.found_table(m)]
    names = {x.name for one in m.found for x in one.unknowns}
    told = tuple(
        f for f in findings(m.after) if f.name in names and not f.name.split(".")[-1].startswith(("sin", "cos"))
    )
    if told:
        blocks.append(parameters_table(told).block())
    return Section("What is missing", tuple(blocks))


def _asked(m: Missing) -> tuple[Block, ...]:
    lines = tuple(
        f"Look {k}: {', '.join(f'{x.code} {percent(x.probability)}' for x in one.lines[:3])}; "
        f"a coordinate scatters by {1e3 * one.scatter:.3g} mm."
        for k, one in enumerate(m.looks, start=1)
    )
    return (Text("Search, step by step; each look includes the effects found before it:"), Bullets(lines))


def acts_figure(m: Missing) -> Figure:
    """How far each effect moves the readings, beside their scatter."""
    found = sorted(m.found, key=lambda one: one.acts)
    size = (10.0, 1.4 + 0.42 * len(found))
    with drawing("How far each effect moves the readings", size, 1, 1) as (figure, axes):
        ax = axes[0]
        for k, one in enumerate(found):
            sure = one in m.effects
            colour = OKABE_ITO["blue"] if sure else "white"
            ax.barh(k, 1e3 * one.acts, color=colour, edgecolor=OKABE_ITO["blue"], hatch="" if sure else "///")
        left = m.after.variances.sigma
        ax.axvline(1e3 * left, color="0.3", linestyle="--", label="scatter that is left")
        ax.set_yticks(range(len(found)), [one.candidate.code for one in found])
        ax.set_xlabel("RMS (mm); hatched: not sure")
        # Room for the legend beside the longest bar.
        ax.set_xlim(0.0, 1.35e3 * max(left, *(one.acts for one in found)))
        ax.legend(loc="lower right")
    return figure
