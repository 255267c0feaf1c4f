"""What people read of a conversion: what was made of each column, how many readings, what comes next."""

from __future__ import annotations

import math

from doe.instruments.convert import meaning_words
from doe.instruments.times import FORMS
from doe.instruments.values import Column
from stiffarm.commands.readings.step import Written
from stiffarm.session.console import say, say_notes, show_table


def show(made: Written, model: str | None) -> None:
    """The summary on the terminal."""
    converted = made.converted
    for name, how in converted.files.items():
        say(f"{name}: {'; '.join(how)}")
    rows = [
        [c.name, meaning_words(c.meaning), c.why, f"{c.empty}" if c.empty else "", _range(c)] for c in converted.columns
    ]
    show_table("columns", ["column", "taken as", "why", "empty", "range in the table"], rows)
    say_notes(converted.notes)
    say(f"{len(converted.rows)} readings: a table of {converted.kind} with {len(converted.header)} columns")
    if made.table is None:
        say("nothing was written; use --out table.csv to write the table")
        return
    if made.previous is not None:
        say(f"the old table was moved to {made.previous}")
    also = f", and {made.mapping} for the next file of this layout (--mapping)" if made.mapping else ""
    say(f"written: {made.table}{also}")
    say(f"next: stiffarm calibrate {model or 'MODEL'} {made.table} --out calibrated")


def _range(column: Column) -> str:
    if not math.isfinite(column.lowest) or column.meaning.unit in FORMS:
        return ""
    low, high = f"{column.lowest:.6g}", f"{column.highest:.6g}"
    return low if low == high else f"{low} to {high}"
