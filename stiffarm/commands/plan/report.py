"""report.html of `plan`: which set-ups to measure, what they will tell, and what to do with the sheet."""

from __future__ import annotations

from doe import Measurements
from doe.planning.plan import Foresight
from fem.arm import Arm
from robots.quantities import significant
from stiffarm.commands.plan import words
from stiffarm.commands.plan.step import Planned
from stiffarm.pages.bars import ranked_figure
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import (
    Answer,
    Block,
    Bullets,
    Fold,
    KeyFigure,
    Picture,
    Section,
    Table,
    Text,
    data_words,
    write_page,
)
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.words.directions import set_up_rows

QUESTION = "what to measure next?"
# Parameters that the first screen names.
NAMED = 3


def write_report(
    given: Arm, table: Measurements | None, planned: Planned, figure: str, folder: OutputFolder, calibrate: str
) -> None:
    """Write the page.

    ``figure``: the picture of the plan's intervals, which is in the folder already; ``calibrate``: the command line
    that reads the filled-in sheet.
    """
    made, protocol = planned.made, planned.made.protocol
    count, each = len(planned.labels), len(protocol.course) * protocol.repeats
    seen = [f for f in made.foresight if f.seen]
    better = [f for f in seen if f.promised_shrink >= 1.05]
    order = sorted(better, key=lambda f: -f.promised_shrink)
    loads = ", ".join(f"{v:g}" for v in protocol.forces.tolist())
    lede = (
        f"{count} set-ups under {loads} N, {protocol.repeats} times each: they make the intervals of {len(better)} of "
        f"{len(made.foresight)} parameters narrower."
    )
    key = [KeyFigure(f"{count} set-ups", f"{count * each} readings")]
    key += [KeyFigure(_times(f), f"narrower, the interval of {f.parameter.name}") for f in order[:NAMED]]
    pictures = Pictures(folder)
    drawn = None
    if order:
        shrink = {f.parameter.name: f.promised_shrink for f in order}
        caption = "Promised with the model's lack of fit; 2 is half as wide."
        bars = ranked_figure("How many times narrower", shrink, "interval before over interval after", 12)
        drawn = pictures.add(bars, "narrower", caption)
    todo = f"Print measurement_sheet.html, measure in its order, fill in measurement_sheet.csv, and run `{calibrate}`."
    sure = words.rests_on(planned.start, planned.forecast)
    answer = Answer(f"{sure[0].upper()}{sure[1:]}.", todo, drawn)
    heads = ("set-up", *(f"{c.removesuffix('_deg')} (deg)" for c in given.robot.coordinates), "load")
    rows = tuple(tuple(row) for row in set_up_rows(planned.labels, made.q, made.direction))
    caption = "Intervals before and after, over the value planned for; at the right what set-ups chosen at random give."
    told: list[Block] = [
        Picture(folder.path(figure), caption, "what the set-ups tell"),
        Fold("Parameter by parameter", (Bullets(tuple(planned.sentences)),)),
    ]
    notes: tuple[Block, ...] = (Bullets(planned.notes),) if planned.notes else ()
    sections = [
        Section("The set-ups, in the order of measuring", (Table("", heads, rows, (0, len(heads) - 1)), *notes)),
        Section("What they will tell", tuple(told)),
        Section(
            "How they were chosen",
            (
                Text(
                    f"{'A plain design' if planned.request.plain else f'{made.criterion}-optimal choice'} from "
                    f"{planned.candidates} poses that the arm can take. plan.json has all figures."
                ),
            ),
            folded=True,
        ),
    ]
    title = given.description.title.split(" (")[0]
    made_of = "no readings yet" if table is None else data_words(table)
    write_page(folder, title, lede, key, sections, QUESTION, made_of, answer)


def _times(f: Foresight) -> str:
    return f"{significant(f.promised_shrink, 2)} times"
