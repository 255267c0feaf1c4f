"""report.html of `simulate`: one pose under one load, or every reading of a table beside what was measured."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fem.arm import Arm
from stiffarm.commands.simulate.figures import readings_figure
from stiffarm.pages.bars import ranked_figure
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.figure_parts import naturally
from stiffarm.pages.numbers import known_to, ranged, significant
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
    write_page,
)
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import DISPLACEMENT_NAMES
from stiffarm.session.stated import interval_ends

QUESTION = "how far does the tool move?"
QUESTION_TABLE = "does the model move as was measured?"
# Readings of a table that stand on the page unfolded.
WORST = 8


def write_pose_report(
    given: Arm, result: Mapping[str, Any], q: Any, wrench: Any, folder: OutputFolder, model: str
) -> None:
    """The page of one pose: stiffness along the force, how the tool moves, and what gives most.

    ``model``: the model as it was asked for, for commands.
    """
    pictures = Pictures(folder)
    d, k = result["displacement"], result["stiffness_N_per_mm"]
    length = float(np.linalg.norm([d[n] for n in DISPLACEMENT_NAMES[:3]]))
    parts = {name: float(np.linalg.norm([part[n] for n in DISPLACEMENT_NAMES[:3]])) for name, part in _parts(result)}
    most = max(parts, key=parts.__getitem__, default="nothing")
    key = [KeyFigure(f"{significant(length)} mm", f"motion of the tool; {most} contributes most")]
    if k is not None:
        low, high = interval_ends(result["interval95_N_per_mm"])
        known = not np.isnan(low)
        value = known_to(k, low, high) if known else significant(k)
        interval = f"95\u00a0%: {ranged(low, high, 'N/mm')}" if known else "no interval: not calibrated"
        key.insert(0, KeyFigure(f"{value} N/mm", "stiffness along the force", interval))
    blocks: list[Block] = [_parts_table(result)]
    if "field" in result:
        caption = "The deformed arm; field.vtu holds displacements, energies and stresses for ParaView."
        blocks.insert(0, Picture(folder.path("field.png"), caption, "deformed arm"))
    lengths_um = {name: 1e3 * value for name, value in parts.items()}
    figure = ranked_figure("How far each part moves the tool", lengths_um, "length of the motion (um)")
    picture = pictures.add(figure, "parts", "The parts' motions add up as vectors.") if parts else None
    pose = ", ".join(f"{n.removesuffix('_deg')} {v:g}" for n, v in result["pose_deg"].items() if v) or "all joints at 0"
    load = ", ".join(f"{n.rpartition('_')[0]} {v:g} {n.rpartition('_')[2]}" for n, v in result["load"].items() if v)
    lede = (
        f"At {pose} deg under {load or 'no load'} the tool moves by {significant(length)} mm; {most} contributes most."
    )
    answer = Answer(_sure(given, result), _todo(given, model), picture)
    sections = [Section("What deflects", tuple(blocks)), _model(result)]
    write_page(folder, _title(given), lede, key, sections, QUESTION, "", answer)


def write_table_report(given: Arm, result: Mapping[str, Any], made_of: str, folder: OutputFolder, model: str) -> None:
    """The page of a table: RMS difference, the readings that are farthest off, all of them folded.

    ``model``: the model as it was asked for, for commands.
    """
    pictures, rows = Pictures(folder), result["readings"]
    errors = [_error(row) for row in rows]
    read = [_size(row, "measured") for row in rows]
    unit = "mm" if result["rms_mm"] is not None else "mrad"
    rms = result[f"rms_{unit}"]
    worst = int(np.nanargmax(np.abs(errors)))
    share = result["rms_over_measured"][unit]
    shown = f"{significant(rms)} {unit}"
    key = [
        KeyFigure(shown, "RMS of simulated minus measured"),
        KeyFigure("–" if share is None else f"{100.0 * share:.2g}\u00a0%", "of what was read (RMS)"),
        KeyFigure(f"{significant(abs(errors[worst]))} {unit}", f"largest, in pose {rows[worst]['pose']}"),
    ]
    poses, loads = [row["pose"] for row in rows], np.array([float(row["load_N"]) for row in rows])
    caption = "Each dot is a reading; on the line the model moves as was measured."
    made = np.array([_size(row, "simulated") for row in rows])
    picture = pictures.add(readings_figure(np.array(read), made, unit), "readings", caption)
    order = sorted(range(len(rows)), key=lambda k: -abs(errors[k]))[:WORST]
    heads, cells = _rows(rows)
    names = naturally(poses)
    by_pose = sorted(range(len(rows)), key=lambda k: (names.index(poses[k]), loads[k]))
    lede = (
        f"{len(rows)} readings at {len(names)} poses: simulated and measured differ by {shown} RMS, "
        f"{'' if share is None else f'{100.0 * share:.2g} % of what was read'}."
    )
    sections = [
        Section("The readings farthest off", (Table("", heads, tuple(cells[k] for k in order), text_columns=(0, 1)),)),
        Section(
            "Every reading", (Table("", heads, tuple(cells[k] for k in by_pose), text_columns=(0, 1)),), folded=True
        ),
        _model(result),
    ]
    answer = Answer(_sure(given, result), _todo(given, model, from_table=True), picture)
    write_page(folder, _title(given), lede, key, sections, QUESTION_TABLE, made_of, answer)


def _title(given: Arm) -> str:
    return given.description.title.split(" (")[0]


def _parts(result: Mapping[str, Any]) -> list[tuple[str, Mapping[str, float]]]:
    return list(result["by_part"].items())


def _parts_table(result: Mapping[str, Any]) -> Table:
    rows = [(name, *(_motion(part[n]) for n in DISPLACEMENT_NAMES)) for name, part in _parts(result)]
    rows.append(("total", *(_motion(result["displacement"][n]) for n in DISPLACEMENT_NAMES)))
    heads = ("part", *map(_head, DISPLACEMENT_NAMES))
    return Table("Motion of the tool by part", heads, tuple(rows), best=len(rows) - 1)


def _motion(value: float) -> str:
    return f"{value:+.4f}" if abs(value) >= 5e-5 else "0"


def _head(name: str) -> str:
    """``dz measured (mm)`` of ``dz_mm_measured``, ``load (N)`` of ``load_N``."""
    for unit in ("mm", "mrad", "N"):
        what, found, rest = name.partition(f"_{unit}")
        if found:
            return f"{what}{rest.replace('_', ' ')} ({unit})"
    return name.replace("_", " ")


def _sure(given: Arm, result: Mapping[str, Any]) -> str:
    if result["rigid_joints"]:
        return "Joints are held rigid, as asked: only the links deflect."
    if result["joints_without_spring"]:
        names = ", ".join(result["joints_without_spring"])
        return (
            f"No spring is given for {names}: they are held rigid, so the real arm is softer than computed wherever a "
            "load turns them."
        )
    if given.description.calibration is None:
        return "The springs are those of the model file, which does not say how well they are known."
    return "The interval covers the uncertainty of the calibrated parameters, but not what the model leaves out."


def _todo(given: Arm, model: str, *, from_table: bool = False) -> str:
    name = shlex.quote(model)
    if given.description.calibration is None:
        return f"Calibrate the model with readings: `stiffarm calibrate {name} DATA --out calibrated`."
    if from_table:
        return (
            "If they differ by more than the scatter of the readings, find out what the model is missing: "
            f"`stiffarm diagnose {name} DATA`."
        )
    return f"Map the stiffness over the workspace: `stiffarm map joints {name} --html --out map`."


def _rows(rows: Sequence[Mapping[str, Any]]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    named = list(dict.fromkeys(key for row in rows for key in row))
    return (*map(_head, named), "difference (+: model too soft)"), [
        (*("–" if row.get(n) is None else _cell(row[n]) for n in named), f"{_error(row):+.3f}") for row in rows
    ]


def _cell(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _size(row: Mapping[str, Any], what: str) -> float:
    found = [row[key] for key in row if key.endswith(f"_mm_{what}")] or [row[k] for k in row if k.endswith(what)]
    return float(np.linalg.norm([v for v in found if v is not None]))


def _error(row: Mapping[str, Any]) -> float:
    """Simulated minus measured along the measured reading: positive where the model is too soft."""
    names = [key.removesuffix("_measured") for key in row if key.endswith("_mm_measured")]
    names = names or [key.removesuffix("_measured") for key in row if key.endswith("_measured")]
    read = np.array([row[f"{n}_measured"] for n in names], dtype=np.float64)
    made = np.array([row[f"{n}_simulated"] for n in names], dtype=np.float64)
    size = float(np.linalg.norm(read))
    return float((made - read) @ read / size) if size else float(np.linalg.norm(made))


def _model(result: Mapping[str, Any]) -> Section:
    facts = [f"links: {result['links']}", f"load path: {result['load_path']}"]
    if result.get("effects"):
        facts.append(f"with effects: {', '.join(result['effects'])}")
    notes = tuple(result.get("notes", ()))
    more: tuple[Block, ...] = (Fold("Remarks on the table", (Bullets(notes),)),) if notes else ()
    blocks = (Bullets(tuple(facts)), Text("All figures are in simulation.json."), *more)
    return Section("The model and the files", blocks, folded=True)
