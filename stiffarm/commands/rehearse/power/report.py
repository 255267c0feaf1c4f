"""report.html of a power analysis: what would be found and named, what the springs would be known to, what to add."""

from __future__ import annotations

from doe.power.chances import POWER
from robots.quantities import percent
from stiffarm.commands.rehearse.power import words
from stiffarm.commands.rehearse.power.figures import DRAWN, additions_figure, chances_figure
from stiffarm.commands.rehearse.power.step import Power
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Answer, Block, Bullets, KeyFigure, Section, Table, Text, write_page
from stiffarm.session.outputs import OutputFolder

QUESTION = "would these readings show what is missing?"


def write_report(r: Power, folder: OutputFolder) -> None:
    """Draw all figures and write report.html."""
    pictures = Pictures(folder)
    given = r.given
    caption = "Chance that each effect of usual size is found, and named."
    if len(r.judged) > DRAWN:
        caption = f"{caption[:-1]}: the {DRAWN} of {len(r.judged)} that are most surely named; the tables have all."
    picture = pictures.add(chances_figure(r), "chances", caption)
    key = [
        KeyFigure(percent(r.mean[0]), "of effects of usual size would be found, in the mean"),
        KeyFigure(percent(r.mean[1]), "would be named"),
        KeyFigure(
            f"{sum(p.found.value >= POWER for p in r.judged)} of {len(r.prospects)}", "effects found with 80 % or more"
        ),
    ]
    made = (
        f"{r.set_ups.source}; {given.model.link_kind} links, {given.model.load_path} load path; noise {r.set_ups.words}"
    )
    assumed = words.assumed_springs(r)
    sure = (
        "Linear theory, before anyone measures. The intervals are those in which the shares of twenty campaigns should "
        "lie; in a study of 200 made-up sets 19 of 20 shares did."
    )
    sections = [_effects(r), _springs(r), _more(r, pictures), _how(r)]
    title = given.description.title.split(" (")[0]
    todo = words.best(r) or "Compare with another sheet: give it in place of this one."
    answer = Answer(sure, todo, picture, warnings=(assumed,) if assumed else ())
    write_page(folder, title, words.headline(r), key, sections, QUESTION, made, answer)


def _effects(r: Power) -> Section:
    notes = [text for text in (words.twins(r), words.blind(r)) if text]
    some: list[Block] = [Bullets(tuple(notes))] if notes else []
    likely, others = words.split_rows(r)
    texts = (0, 1, 2, 6)
    if likely:
        some.append(Table("More likely found than not", words.HEADS, tuple(likely), texts))
    some.append(Text("Found: the diagnosis says that something is missing. Named: it says what, and is right."))
    if others:
        some.append(Table(f"The other {len(others)} effects", words.HEADS, tuple(others), texts, folded=bool(likely)))
    return Section("Effects", tuple(some))


def _springs(r: Power) -> Section:
    rows = tuple(words.spring_row(s) for s in r.springs)
    text = Text("By these readings alone, with nothing missing, beside the errors that every arm and table has.")
    assumed = words.assumed_springs(r)
    notes = (text, Text(assumed)) if assumed else (text,)
    return Section("Springs", (Table("What they would be known to", words.SPRING_HEADS, rows), *notes))


def _more(r: Power, pictures: Pictures) -> Section:
    if not r.additions:
        return Section("One more", ())
    rows = tuple(words.more_row(a) for a in r.additions)
    caption = "Chances with one more, over those of this sheet."
    picture = pictures.add(additions_figure(r.additions), "one_more", caption)
    return Section("One more", (Table("What it adds", words.MORE_HEADS, rows, (0, 4)), picture))


def _how(r: Power) -> Section:
    made_up = [p.code.partition(":")[0] for p in r.judged if not p.by_rehearsal]
    other = (
        f" Of {', '.join(dict.fromkeys(made_up))} the rehearsals have no laws: the catalogue's own stand in."
        if (made_up)
        else ""
    )
    return Section(
        "How it was done",
        (
            Bullets(
                (
                    f"{r.draws} usual sizes of each effect, drawn as rehearsals draw them (laws that are not the "
                    f"catalogue's).{other}",
                    "What each changes of the readings, less what springs and the small errors of every arm can "
                    "follow, over the noise, is its chi-square; candidates explain it and are charged as the diagnosis "
                    "charges them. Chances follow from the noncentral chi-square distribution and the diagnosis's "
                    "thresholds.",
                    "An effect with a twin - one that moves these readings alike - is found and not named.",
                    "One more set-up is the pose farthest from all others within the angles read; one more load lies "
                    "between the two largest.",
                    "`--hide CODE` makes one rehearsal of an effect, with readings, a diagnosis and the truth.",
                )
            ),
        ),
        folded=True,
    )
