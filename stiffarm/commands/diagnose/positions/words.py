"""What is missing by positions, in sentences and tables, for the screen and the page."""

from __future__ import annotations

from doe.absolute.missing.diagnose import FoundEffect, Missing
from doe.absolute.missing.evidence import NONE, UNKNOWN
from robots.quantities import percent
from stiffarm.commands.diagnose.positions.payload import free
from stiffarm.pages.report import Table
from stiffarm.session.console import say, say_notes

SHOWN = 8


def show(m: Missing) -> None:
    """The answer, what was found, what else was asked."""
    if m.found:
        found_table(m).show()
    candidates_table(m).show()
    say_notes(remarks(m))
    say(f"{answer(m)}.")
    say(errors(m))


def answer(m: Missing) -> str:
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


def errors(m: Missing) -> str:
    """How the errors at poses left out fell."""
    before, after = (1e3 * x for x in m.left_out_rms())
    text = f"Left-out poses are predicted to {before:.3f} mm RMS with geometry, frames and targets fitted"
    text += f", to {after:.3f} mm with the effects found" if m.found else ""
    if m.holdout is not None:
        first, last = (1e3 * x.rms_m for x in m.holdout[1:])
        text += f"; held out: {first:.3f} mm" + (f" and {last:.3f} mm" if m.found else "")
    return f"{text}."


def remarks(m: Missing) -> list[str]:
    """What the reader must know."""
    out = [one.words for one in m.gross]
    if not m.weighs:
        out.append("neither the model nor the table has masses, so springs cannot be judged")
    out += [f"{one.candidate.code} may be {' or '.join(one.rivals)} instead" for one in m.provisional if one.rivals]
    hidden = m.looks[0].hidden
    if hidden:
        out.append(f"these readings cannot show: {', '.join(hidden)}")
    names = free(m)
    if names is not None:
        out.append(f"to include these effects in the model: stiffarm calibrate MODEL FILE --free {names}")
    return out


def found_table(m: Missing) -> Table:
    """What was taken up."""
    rows = tuple(_row(one, sure=one in m.effects) for one in m.found)
    heads = ("effect", "what", "sure", "probability", "moves readings by, RMS (mm)")
    return Table("What is missing", heads, rows, text_columns=(0, 1, 2))


def _row(one: FoundEffect, *, sure: bool) -> tuple[str, ...]:
    words = "yes" if sure else "no"
    return (one.candidate.code, one.candidate.words, words, percent(one.probability), f"{1e3 * one.acts:.3f}")


def candidates_table(m: Missing) -> Table:
    """The last look: what else was asked, with all that was found in the model."""
    rows = tuple(
        (x.code, percent(x.probability), f"{x.gain:.1f}", "" if x.code in (NONE, UNKNOWN) else f"{1e3 * x.acts:.4f}")
        for x in m.looks[-1].lines[:SHOWN]
    )
    heads = ("hypothesis", "probability", "log evidence over none", "would move readings by, RMS (mm)")
    title = "What else could be missing, with the effects found in the model" if m.found else "What could be missing"
    return Table(title, heads, rows, text_columns=(0,))
