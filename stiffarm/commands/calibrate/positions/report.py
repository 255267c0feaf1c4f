"""report.html of a calibration from positions: how accurate, why, how sure, what is wrong in the readings."""

from __future__ import annotations

import numpy as np

from doe.absolute.calibrate import Positions
from doe.absolute.regions import Regions
from doe.absolute.written import Written
from fem.arm import Arm
from machining.programs.controller_offsets import ControllerOffsets
from stiffarm.commands.calibrate.positions import corrections, region_pages
from stiffarm.commands.calibrate.positions.figures import accuracy_figure, curves_figure
from stiffarm.commands.calibrate.positions.tables import accuracy_table, accuracy_words, parameters_table
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Answer, Block, Bullets, KeyFigure, Section, Table, Text, write_page
from stiffarm.session.outputs import OutputFolder

QUESTION = "where is the tool really, and why?"


def write_report(
    given: Arm,
    c: Positions,
    back: tuple[Written, tuple[ControllerOffsets, ...]],
    by_region: Regions,
    folder: OutputFolder,
) -> None:
    """Draw all figures and write report.html; ``back``: the calibrated model and what controllers take of it."""
    pictures = Pictures(folder)
    key = [
        KeyFigure(f"{_rms_mm(c, 'before'):.3f} mm", "RMS with the arm as described"),
        KeyFigure(f"{_rms_mm(c, 'left out'):.3f} mm", "RMS of poses that the calibration has not seen"),
        KeyFigure(f"{len(c.gross)}", "wrong readings found" if len(c.gross) != 1 else "wrong reading found"),
    ]
    told = [
        _accuracy(c, pictures),
        region_pages.section(by_region, pictures),
        *_curves(c, pictures),
        _parameters(c),
        *_wrong(c),
    ]
    sections = [*told, corrections.section(c, *back), _open(c), _readings(c)]
    known = [one for one in c.findings if one.status == "determined"]
    sure = (
        f"{len(known)} of {len(c.findings)} parameters are identified. Of the coordinates of left-out readings, "
        f"{100.0 * c.left_out.take(c.right).coverage.share:.0f} % lie in their 95 % intervals."
    )
    todo = (
        "Measure where the robot will work: outside the measured angles the joints' errors are not identified."
        if c.curves
        else "Also free `periodic`: joint errors over their angles are often the largest part."
    )
    title = given.description.title.split(" (")[0]
    words = f"{c.found.data.source}, {len(c.found.data)} positions"
    write_page(folder, title, f"{accuracy_words(c)}.", key, sections, QUESTION, words, Answer(sure, todo))


def _rms_mm(c: Positions, which: str) -> float:
    return 1e3 * float(np.sqrt(np.mean(c.distances()[which] ** 2)))


def _accuracy(c: Positions, pictures: Pictures) -> Section:
    caption = "Left out: each reading predicted by a calibration that has not seen its pose."
    picture = pictures.add(accuracy_figure(c), "accuracy", caption)
    return Section("How accurate, before and after", (picture, accuracy_table(c)))


def _curves(c: Positions, pictures: Pictures) -> list[Section]:
    known = tuple(one for one in c.curves if one.is_known)
    if not known:
        return []
    caption = "Line: actual minus displayed joint angle; band: 95 %. Shown only where readings identify it."
    picture = pictures.add(curves_figure(known), "joint_errors", caption)
    text = (
        "Actual minus displayed angle of each joint, as a smooth function of its angle that repeats every turn. "
        "Constant parts belong to the zero. Smoothness and height of the curves are estimated from the readings. "
        "Outside the measured angles a curve is not identified, and predictions there include its height as an "
        "uncertainty."
    )
    return [Section("Errors of the joints over their angles", (Text(text), picture))]


def _parameters(c: Positions) -> Section:
    twins = Bullets(tuple(f"{one.words}." for one in c.twins))
    text = "No readings can separate the following; each is held at the model's value."
    blocks: tuple[Block, ...] = (parameters_table(c.findings),)
    return Section("Parameters", (*blocks, Text(text), twins) if c.twins else blocks)


def _wrong(c: Positions) -> list[Section]:
    if not c.gross:
        return []
    rows = tuple((str(g.line), f"{1e3 * g.distance:.3g}", g.cause) for g in c.gross[:50])
    table = Table("Wrong readings", ("line", "off by (mm)", "likely cause"), rows, text_columns=(0, 2))
    text = "These readings have almost no weight in the result."
    return [Section("Readings that are wrong", (Text(text), table))]


def _open(c: Positions) -> Section:
    wrong = {one.words for one in c.gross}
    return Section("What is open", (Bullets(tuple(f"{r}." for r in c.remarks if r not in wrong)),))


def _readings(c: Positions) -> Section:
    data = c.found.data
    rows = tuple((name, str(int((data.session.number == s).sum()))) for s, name in enumerate(data.session.names))
    tail = "" if c.found.tail == float("inf") else f", with tails of Student's t of {c.found.tail:g} degrees of freedom"
    text = (
        f"{len(data)} positions of {len(data.target.names)} target(s) in {len(rows)} session(s). A coordinate scatters "
        f"by {1e3 * c.found.variances.sigma:.3g} mm{tail}."
    )
    table = Table("Sessions, each with a frame of its own", ("session", "readings"), rows, text_columns=(0,))
    return Section("The readings", (Text(text), table), folded=True)
