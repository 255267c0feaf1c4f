"""A sheet of further set-ups, measured on the same arm with the same thing hidden, on another visit."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from .noise import measured, read_axes
from .sets import WORLD, campaign, said_in
from .spec import from_text
from .tables import READ, rows_from
from .truth import Off, readings

DAY = 86400.0


def fill(set_folder: Path, sheet: str, visit: int) -> str:
    """The sheet as measured on visit 1, 2 ...: a day later each, by another session's gauge and new noise."""
    spec = from_text(said_in(Path(set_folder))[WORLD])
    last = campaign(spec)[-1]
    rows = rows_from(spec, sheet, 10000 * visit, last.session + visit, last.time_s + visit * DAY)
    said = 1e3 * measured(spec, rows, readings(spec, rows, off=Off()), visit)
    lines = list(csv.DictReader(io.StringIO(sheet)))
    names = list(lines[0])
    names += [READ[k] for k in read_axes(spec) if READ[k] not in names]
    names += [name for name in ("time_s", "session") if name in spec.columns and name not in names]
    for line, r, d in zip(lines, rows, said, strict=True):
        line |= {name: f"{d[k]:.4f}" for k, name in enumerate(READ) if name in names}
        own = {"time_s": f"{r.time_s:.1f}", "session": f"S{r.session + 1}"}
        line |= {name: own[name] for name in own if name in names}
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return text.getvalue()
