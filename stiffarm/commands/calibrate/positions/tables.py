"""Tables of a calibration from positions, for its page and the screen."""

from __future__ import annotations

import math

import numpy as np

from doe.absolute.calibrate import Positions
from doe.absolute.identified import Finding
from doe.absolute.regions import Regions
from robots.arrays import Array
from stiffarm.pages.report import Table
from stiffarm.session.console import say, say_notes

# Wrong readings that the screen names.
SHOWN = 12


def show(c: Positions, by_region: Regions) -> None:
    """Accuracy, parameters, and what the reader must know."""
    accuracy_table(c).show()
    parameters_table(c.findings).show()
    say_notes(c.remarks[:SHOWN])
    if len(c.remarks) > SHOWN:
        say(f"note: {len(c.remarks) - SHOWN} further remarks: --json or --out has them all")
    say(f"by region: {by_region.words}")
    say(accuracy_words(c))


def accuracy_words(c: Positions) -> str:
    """The answer in a sentence."""
    inside = c.left_out.take(c.right).coverage
    before, after, out = (1e3 * float(np.sqrt(np.mean(d**2))) for d in c.distances().values())
    text = (
        f"{before:.3f} mm RMS with the arm as described, {after:.3f} mm calibrated; "
        f"poses left out are predicted to {out:.3f} mm RMS, {100.0 * inside.share:.0f} % of "
        "their coordinates within the 95 % intervals"
    )
    if c.sessions_out is not None:
        text += f"; sessions left out, their frames fitted: {1e3 * c.sessions_out.take(c.right).rms_m:.3f} mm RMS"
    if c.holdout is not None:
        text += f"; held out: {c.holdout[1].rms_m * 1e3:.3f} mm RMS"
    if c.gross:
        count = "one wrong reading" if len(c.gross) == 1 else f"{len(c.gross)} wrong readings"
        text += f"; {count} found and left out"
    return text


def accuracy_table(c: Positions) -> Table:
    """Distances between read and predicted positions."""
    d = c.distances()
    rows = [
        _row("arm as described, frames and targets fitted", d["before"]),
        _row("calibrated", d["after"]),
        _row("calibrated, poses left out", d["left out"]),
    ]
    if c.sessions_out is not None:
        rows.append(_row("calibrated, sessions left out, their frames fitted", c.sessions_out.distance[c.right]))
    if c.holdout is not None:
        table, there, _ = c.holdout
        new = [name for name in table.session.names if name not in c.found.data.session.names]
        rows.append(_row("held out, their frames fitted" if new else "held out", there.distance))
    heads = ("", "readings", "mean (mm)", "RMS (mm)", "95 % below (mm)", "largest (mm)")
    return Table("Distance between measured and predicted targets", heads, tuple(rows), text_columns=(0,))


def _row(words: str, d: Array) -> tuple[str, ...]:
    figures = (d.mean(), np.sqrt(np.mean(d**2)), np.quantile(d, 0.95), d.max())
    return (words, str(len(d)), *(f"{1e3 * float(x):.3f}" for x in figures))


def parameters_table(found: tuple[Finding, ...]) -> Table:
    """What was found, and how sure."""
    rows = tuple((f.name, value_text(f), interval_text(f), f.unit, f.status) for f in found)
    heads = ("parameter", "value", "95 % interval", "unit", "status")
    return Table(f"{len(rows)} parameters, without error curves and frames", heads, rows, text_columns=(0, 1, 2, 3, 4))


def value_text(f: Finding) -> str:
    """A value with as many digits as its interval allows."""
    if f.value is None:
        return "-"
    return f"{f.value:.{_digits(f)}f}" if abs(f.value) < 1e4 else f"{f.value:.3g}"


def interval_text(f: Finding) -> str:
    """An interval, or the limit that is known."""
    low, high = f.interval95
    if math.isnan(low):
        return "not identified"
    if math.isinf(high):
        return f"above {low:.3g}"
    if max(abs(low), abs(high)) >= 1e4:
        return f"{low:.3g} to {high:.3g}"
    return f"{low:.{_digits(f)}f} to {high:.{_digits(f)}f}"


def _digits(f: Finding) -> int:
    """Decimals that show two digits of the interval's half width."""
    half = 0.5 * (f.interval95[1] - f.interval95[0])
    return 3 if not (math.isfinite(half) and half > 0.0) else min(max(1 - math.floor(math.log10(half)), 0), 6)
