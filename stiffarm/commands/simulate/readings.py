"""Every reading of a table, simulated beside measured."""

from __future__ import annotations

from functools import partial

import numpy as np

from doe import Measurements
from doe.tables.loaded import history_of, simulate
from fem.arm import Arm
from fem.statics.small_displacements import FLAG
from robots.arrays import Array, Indices
from robots.quantities import QUANTITIES, Quantity, rounded
from stiffarm.commands.simulate.figures import readings_figure
from stiffarm.commands.simulate.pose import MOTIONS, about, how_sure, model_section, remarks, what_next
from stiffarm.pages.report import KeyFigure, data_words
from stiffarm.result import Drawing, Number, Result, Table
from stiffarm.session.caution import RIGID_AS_ASKED
from stiffarm.session.reading_checks import history_notes
from stiffarm.session.softness import flagged

# Readings of a table that stand on the page unfolded.
WORST = 8
LOAD = Quantity("load", "N")
SHARE = QUANTITIES["share"]
RMS = {"mm": Quantity("rms", "mm", 1e3, "RMS difference"), "mrad": Quantity("rms", "mrad", 1e3, "RMS difference")}
SPANS = {"mm": slice(0, 3), "mrad": slice(3, 6)}


def of_table(given: Arm, data: Measurements, rigid_joints: bool) -> Result:
    """Simulated against measured for every reading, effects and load history included."""
    model = given.model.with_rigid_joints() if rigid_joints else given.model
    history = history_of(data)
    d = simulate(model, data, () if rigid_joints else given.effects, history)
    marks = flagged(model.robot, d, "simulated readings")
    facts = about(given, model, rigid_joints)
    error = np.where(data.used, d - data.displacement, np.nan)
    read = np.where(data.used, data.displacement, np.nan)
    # Both of single components, so that nothing simulated is 100 % off.
    rms = {unit: (_rms(error[:, of]), _rms(read[:, of])) for unit, of in SPANS.items()}
    unit = "mm" if np.isfinite(rms["mm"][0]) else "mrad"
    of, shown = SPANS[unit], RMS[unit]
    difference = Quantity("difference", unit, 1e3, "difference (+: model too soft)")
    sizes = [np.sqrt(np.nansum(v[:, of] ** 2, axis=1)) for v in (read, np.where(data.used, d, np.nan))]
    off = np.nansum(error[:, of] * read[:, of], axis=1) / np.where(sizes[0] > 0.0, sizes[0], np.nan)
    off = np.where(np.isfinite(off), off, sizes[1])
    values: dict[Quantity, Array] = {LOAD: data.loads_N}
    for k in np.flatnonzero(data.used.any(axis=0)):
        for what, some in (("measured", read[:, k]), ("simulated", np.where(data.used[:, k], d[:, k], np.nan))):
            one = MOTIONS[k]
            values[Quantity(f"{one.key}_{what}", one.unit, one.factor, f"{one.key} {what}")] = some
    values[difference] = off
    labels: dict[str, list[str | bool]] = {"line": [str(line) for line in data.row_numbers], "pose": list(data.pose)}
    if any(marks):
        labels[FLAG] = [bool(mark) for mark in marks]
    worst = np.argsort(-np.abs(off), kind="stable")
    share = rms[unit][0] / rms[unit][1] if rms[unit][1] else np.nan
    part = "" if np.isnan(share) else f", {SHARE.text(share, unit=True)} of what was read"
    largest = KeyFigure(difference.text(abs(off[worst[0]]), unit=True), f"largest, in pose {data.pose[worst[0]]}")
    made = np.where(data.used, d, np.nan)
    return Result(
        name="simulation",
        title=given.description.title.split(" (")[0],
        question="does the model move as was measured?",
        answer=f"{data.n} readings at {len(set(data.pose))} poses: simulated and measured differ by "
        f"{shown.text(rms[unit][0], unit=True)} RMS{part}.",
        how_sure=how_sure(given, facts),
        what_next=what_next(given, from_table=True),
        facts=facts | {"rms_over_measured": {u: rounded(a / b) if b else None for u, (a, b) in rms.items()}},
        numbers={RMS[u]: Number(a) for u, (a, _) in rms.items()},
        tables=(
            _rows("readings", "Every reading", labels, values, np.arange(data.n), folded=data.n > WORST),
            *(
                (_rows("farthest_off", "The readings farthest off", labels, values, worst[:WORST], is_extract=True),)
                if data.n > WORST
                else ()
            ),
        ),
        drawings=(
            Drawing(
                "readings",
                "Each dot is a reading; on the line the model moves as was measured.",
                "simulated over measured",
                partial(readings_figure, 1e3 * sizes[0], 1e3 * sizes[1], unit),
            ),
        ),
        key=(
            KeyFigure(shown.text(rms[unit][0], unit=True), "RMS of simulated minus measured"),
            KeyFigure("–" if np.isnan(share) else SHARE.text(share, unit=True), "of what was read (RMS)"),
            largest,
        ),
        sections=(model_section(facts),),
        remarks=(*data.notes, *([] if rigid_joints else history_notes(given.effects, history)), *remarks(facts)),
        arm=given,
        caution=RIGID_AS_ASKED if rigid_joints else None,
        found=made,
        made_of=data_words(data),
    )


def _rows(
    name: str,
    caption: str,
    labels: dict[str, list[str | bool]],
    values: dict[Quantity, Array],
    rows: Indices,
    folded: bool = False,
    is_extract: bool = False,
) -> Table:
    return Table(
        name,
        caption,
        {key: [texts[k] for k in rows] for key, texts in labels.items()},
        {quantity: some[rows] for quantity, some in values.items()},
        folded=folded,
        is_extract=is_extract,
    )


def _rms(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else np.nan
