"""What is missing by positions of targets: the answer, what was found, what else was asked, the page."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.figure import Figure

from doe.absolute.identified import Finding, findings
from doe.absolute.missing.diagnose import FoundEffect, Line, Missing, diagnose_positions
from doe.absolute.missing.evidence import NONE, UNKNOWN
from doe.absolute.prediction import Predicted
from fem.arm import Arm
from robots import InputError
from robots.quantities import UNKNOWN as NO_VALUE
from robots.quantities import interval_json, known_to, length, percent, ranged, rounded
from stiffarm.commands.diagnose.result import EVIDENCE, PROBABILITY, UNSEEN, Diagnosis
from stiffarm.pages.figure_parts import drawing
from stiffarm.pages.report import Block, Bullets, KeyFigure, Section, Text
from stiffarm.pages.style import OKABE_ITO
from stiffarm.request import Readings, positions_asked
from stiffarm.result import Drawing, Number, Table
from stiffarm.session.console import say

if TYPE_CHECKING:
    from stiffarm.commands.diagnose.command import DiagnoseRequest

QUESTION = "what is the model missing, judged by positions?"
# Lines of each step that JSON has.
LISTED = 12
ACTS = length("acts_rms", "moves readings by, RMS")
CAPTION = "Bars: how far each effect moves the readings, in addition to geometry and the other effects found."


def result_of(given: Arm, asked: DiagnoseRequest) -> Diagnosis:
    """Diagnose by tables of positions.

    Raises
    ------
    InputError
        An option that has no meaning here, or a table or readings that cannot be used.
    """
    if names := [*asked.given("free", "loads", "keep_out", "clearance_mm"), *(["--effect"] if given.own else [])]:
        what = f"{', '.join(names)}: no option for tables of positions"
        raise InputError(what, code="A002", remedy="leave it out")
    table = positions_asked(given, cast("Sequence[Readings]", asked.data))
    kept = None if asked.holdout is None else positions_asked(given, (asked.holdout,))
    m = diagnose_positions(given.model, table, holdout=kept, seed=asked.seed, progress=say)
    before, after = m.left_out_rms()
    free = _free(m)
    todo = "Nothing: the calibrated geometry explains these readings."
    if free is not None:
        todo = f"Calibrate with these effects: `stiffarm calibrate MODEL FILE --free {free}`."
    named = "effects named" if len(m.effects) != 1 else "effect named"
    notes = (*table.notes, *(() if kept is None else kept.notes))
    return Diagnosis(
        name="diagnosis",
        title=given.description.title.split(" (")[0],
        question=QUESTION,
        answer=f"{_answer(m)}.",
        how_sure=_errors(m),
        what_next=todo,
        facts=_facts(given, m, free),
        numbers={UNSEEN[0]: Number(before), UNSEEN[1]: Number(after)},
        tables=tuple(_tables(m)),
        drawings=(Drawing("effects", CAPTION, "how far each effect moves the readings", partial(acts_figure, m)),)
        if m.found
        else (),
        key=(
            KeyFigure(UNSEEN[0].text(before, unit=True), "RMS of left-out poses, with geometry fitted"),
            KeyFigure(UNSEEN[1].text(after, unit=True), "the same, with the effects found"),
            KeyFigure(str(len(m.effects)), named),
        ),
        sections=(Section("Search, step by step", _steps(m), folded=True),),
        remarks=(*_remarks(m), *notes),
        arm=given,
        caution="",
        found=m,
        made_of=f"{m.after.data.source}, {len(m.after.data)} positions",
    )


def _free(m: Missing) -> str | None:
    """What `calibrate --free` takes to have these effects in the model; None where nothing was found."""
    names = dict.fromkeys(one.free for one in m.found)
    return ",".join(("geometry", *names)) if names else None


def _facts(given: Arm, m: Missing, free: str | None) -> dict[str, Any]:
    scatter = length("scatter_sd")
    out: dict[str, Any] = {
        "robot": given.description.name,
        "readings": len(m.after.data),
        "verdict": m.verdict,
        "reason": m.reason,
        "effects": [_effect(m, one, sure=True) for one in m.effects],
        "provisional": [_effect(m, one, sure=False) for one in m.provisional],
        "scatter_sd_before_mm": scatter.stored_value(m.before.variances.sigma),
        "scatter_sd_after_mm": scatter.stored_value(m.after.variances.sigma),
        "steps": [
            {
                "candidates": [_line(x) for x in one.lines[:LISTED]],
                "unknown_along": one.axis,
                "scatter_sd_mm": scatter.stored_value(one.scatter),
                "not_testable": list(one.hidden),
            }
            for one in m.looks
        ],
        "inseparable": [{"name": t.name, "moved_by": list(t.others)} for t in m.twins],
        "wrong_readings": [
            {"line": g.line, "distance_mm": rounded(1e3 * g.distance), "cause": g.cause} for g in m.gross
        ],
        "springs_can_be_judged": m.weighs,
        "calibrate_free": free,
    }
    if m.holdout is not None:
        out["holdout"] = {key: _predicted(p) for key, p in zip(("before", "after"), m.holdout[1:], strict=True)}
    return out


def _effect(m: Missing, one: FoundEffect, *, sure: bool) -> dict[str, Any]:
    """An effect that was taken up, with its parameters; an upper end is null where there is none."""
    names = {x.name for x in one.unknowns}
    return {
        "code": one.candidate.code,
        "words": one.candidate.words,
        "sure": sure,
        "probability": rounded(one.probability),
        "log_evidence_gain": rounded(one.gain),
        ACTS.column: ACTS.stored_value(one.acts),
        "rivals": list(one.rivals),
        "parameters": [
            {
                "name": f.name,
                "unit": f.unit,
                "value": None if f.value is None else rounded(f.value),
                "interval95": interval_json(*f.interval95),
                "status": f.status,
            }
            for f in findings(m.after)
            if f.name in names
        ],
    }


def _line(x: Line) -> dict[str, Any]:
    acts = None if x.code in (NONE, UNKNOWN) else ACTS.stored_value(x.acts)
    probability, gain = rounded(x.probability), rounded(x.gain)
    return {"code": x.code, "probability": probability, "log_evidence_gain": gain, ACTS.column: acts}


def _predicted(p: Predicted) -> dict[str, Any]:
    """Distances of readings that were not used, and how many coordinates lie in their intervals."""
    d = p.distance
    sizes = {"mean": d.mean(), "rms": p.rms_m, "p95": np.quantile(d, 0.95), "largest": d.max()}
    inside = {"inside": p.coverage.inside, "of": p.coverage.readings}
    return {**{length(key).column: length(key).stored_value(v) for key, v in sizes.items()}, "in_interval95": inside}


def _answer(m: Missing) -> str:
    """The verdict in a sentence."""
    names = ", ".join(one.candidate.words for one in m.effects)
    maybe = ", ".join(one.candidate.words for one in m.provisional)
    if m.verdict == "none":
        return f"Nothing is missing except geometry errors: {m.reason}"
    if m.verdict == "unknown":
        return f"Something is missing that the catalogue does not know: {m.reason}"
    if m.verdict == "named":
        return f"Missing: {names}"
    if names and maybe:
        return f"Missing: {names}; not sure: {maybe} ({m.reason})"
    return f"Not sure: {names or maybe} ({m.reason})"


def _errors(m: Missing) -> str:
    """How the errors at poses left out fell."""
    before, after = (UNSEEN[0].text(x, unit=True) for x in m.left_out_rms())
    text = f"Left-out poses are predicted to {before} RMS with geometry, frames and targets fitted"
    text += f", to {after} with the effects found" if m.found else ""
    if m.holdout is not None:
        first, last = (UNSEEN[0].text(x.rms_m, unit=True) for x in m.holdout[1:])
        text += f"; held out: {first}" + (f" and {last}" if m.found else "")
    return f"{text}."


def _remarks(m: Missing) -> list[str]:
    """What the reader must know."""
    out = [one.words for one in m.gross]
    if not m.weighs:
        out.append("neither the model nor the table has masses, so springs cannot be judged")
    out += [f"{one.candidate.code} may be {' or '.join(one.rivals)} instead" for one in m.provisional if one.rivals]
    if hidden := m.looks[0].hidden:
        out.append(f"these readings cannot show: {', '.join(hidden)}")
    return out


def _tables(m: Missing) -> list[Table]:
    """What was found with its parameters, and what else was asked, with all that was found in the model."""
    found, lines = m.found, m.looks[-1].lines
    sure = [one in m.effects for one in found]
    labels: dict[str, Sequence[str | bool]] = {
        "effect": [x.candidate.code for x in found],
        "what": [x.candidate.words for x in found],
        "sure": sure,
    }
    values = {PROBABILITY: [one.probability for one in found], ACTS: [one.acts for one in found]}
    out = [Table("found", "What is missing", labels, {q: np.array(v) for q, v in values.items()}, is_extract=True)]
    names = {x.name for one in found for x in one.unknowns}
    rows = [
        (f.name, NO_VALUE if f.value is None else known_to(f.value, *f.interval95), _interval(f), f.unit, f.status)
        for f in findings(m.after)
        if f.name in names and not f.name.split(".")[-1].startswith(("sin", "cos"))
    ]
    if rows:
        heads = ("parameter", "value", "95 % interval", "unit", "status")
        columns = dict(zip(heads, zip(*rows, strict=True), strict=True))
        out.append(Table("parameters", "Parameters, without error curves", columns, {}, is_extract=True))
    acts = [np.nan if x.code in (NONE, UNKNOWN) else x.acts for x in lines]
    asked = {PROBABILITY: [x.probability for x in lines], EVIDENCE: [x.gain for x in lines], ACTS: acts}
    title = "What else could be missing, with the effects found in the model" if found else "What could be missing"
    codes = {"code": [x.code for x in lines]}
    return [*out, Table("candidates", title, codes, {q: np.array(v) for q, v in asked.items()}, folded=True)]


def _interval(f: Finding) -> str:
    return "not identified" if np.isnan(f.interval95[0]) else ranged(*f.interval95)


def _steps(m: Missing) -> tuple[Block, ...]:
    """What each step of the search asked and found."""
    scatter = length("scatter")
    lines = tuple(
        f"Step {k}: {', '.join(f'{x.code} {percent(x.probability)}' for x in one.lines[:3])}; "
        f"a coordinate scatters by {scatter.text(one.scatter, unit=True)}."
        for k, one in enumerate(m.looks, start=1)
    )
    return Text("Each step includes the effects found before it."), Bullets(lines)


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
