"""Folders of measurement sets: made many at a time, and later visits to the same hidden arm."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from . import arm as arms
from .arm import Arm, Vector
from .campaign import draw_unseen
from .catalogue import CATALOGUE, OUTSIDE
from .clock import moments
from .effect import Row
from .hidden import Hidden, Wish, draw, hidden_of, key, middle
from .noise import KINDS, blur

WORLD = "equilibrium"
FORCES, POINT, READ = ("fx_N", "fy_N", "fz_N"), ("px_mm", "py_mm", "pz_mm"), ("dx_mm", "dy_mm", "dz_mm")
# In pairs they would be seen by nobody (a scale is all springs at once).
UNPAIRED = {"gauge-scale"}
T = TypeVar("T")


def make(out: Path, seed: int, single: int = 100, none: int = 50, outside: int = 50, pairs: int = 33) -> list[Path]:
    """Write so many sets of each kind; the same seed writes the same bytes."""
    counts = {"single": single, "none": none, "outside": outside, "pair": pairs}
    folders = []
    for place, (kind, count) in enumerate(counts.items()):
        rng = np.random.default_rng([seed, place])
        for number, wish in enumerate(wishes(rng, kind, count), start=1):
            folder = out / f"{kind}-{number:03d}"
            write(draw(wish, int(rng.integers(2**31))), folder)
            folders.append(folder)
    return folders


def wishes(rng: np.random.Generator, kind: str, count: int) -> list[Wish]:
    """Balance what the study compares: each value of each tag equally often, in an order of its own."""
    streams = iter(rng.spawn(8))

    def deck(values: Sequence[T]) -> list[T]:
        stream, cards = next(streams), list[T]()
        while len(cards) < count:
            cards += [values[i] for i in stream.permutation(len(values))]
        return cards[:count]

    robots, poses, xyz = deck(arms.ARMS), deck((9, 27, 81)), deck((False, True))
    back, noise, scatter, outliers = deck((True, True, False)), deck(KINDS), deck((0.0, 0.015)), deck((False, True))
    if kind == "pair":
        stream, names = next(streams), [name for name in CATALOGUE if name not in UNPAIRED]
        drawn = [stream.choice(len(names), 2, replace=False) for _ in range(count)]
        families = [tuple(names[i] for i in pair) for pair in drawn]
    elif kind == "none":
        families = [()] * count
    else:
        families = [(name,) for name in deck(tuple(CATALOGUE if kind == "single" else OUTSIDE))]
    cards = zip(families, robots, poses, xyz, back, noise, scatter, outliers, strict=True)
    return [Wish(kind, *card) for card in cards]


def write(hidden: Hidden, folder: Path) -> None:
    """Write one set."""
    rng = np.random.default_rng([hidden.seed, 1])
    truth = hidden.truth()
    said, wrong = blur(hidden.noise, hidden.rows, truth.readings(hidden.rows), rng)
    unseen = [replace(row, moment=middle(hidden.clock)) for row in draw_unseen(rng, hidden.arm, hidden.rows)]
    unread = truth.readings(unseen, held_out=True)
    told = key(hidden, WORLD)
    told["tags"]["outliers"] = len({i // 3 for i in wrong})
    told["nuisance"]["spoilt_cells"] = sorted([i // 3, READ[i % 3]] for i in wrong if i % 3 in hidden.axes)
    springs = dict(zip(hidden.arm.names, arms.SPRINGS[hidden.arm.name], strict=True))
    model = arms.model_text(hidden.arm, {name: springs[name] for name in hidden.free()}, hidden.load_path)
    folder.mkdir(parents=True, exist_ok=True)
    _save(folder / "set.json", {"schema": "stiffarm-study-set/1", "model": "model.toml", "links": "rigid"})
    _save(folder / "key.json", told)
    (folder / "model.toml").write_text(model, encoding="utf-8")
    (folder / "readings.csv").write_text(_table(hidden, hidden.rows, said, rng, 0), encoding="utf-8")
    (folder / "unseen.csv").write_text(_table(hidden, unseen, unread, None, 0), encoding="utf-8")


def fill(set_folder: Path, sheet_csv: str, visit: int) -> str:
    """Fill in a sheet of further set-ups: the same truth some days later, with noise and set-ups of their own."""
    told = json.loads((set_folder / "key.json").read_text(encoding="utf-8"))
    told["nuisance"].pop("spoilt_cells")
    hidden = hidden_of(told)
    rng = np.random.default_rng([hidden.seed, 2, visit])
    lines = list(csv.DictReader(io.StringIO(sheet_csv), delimiter=";" if ";" in sheet_csv.split("\n")[0] else ","))
    if not lines:
        raise ValueError("the sheet has no rows; pass one with a row for each reading to take")
    rows = _rows_of(hidden.arm, lines, np.array(told["levels_N"]))
    _, stamps = moments(hidden.clock, [row.pose for row in rows], [row.repeat for row in rows], rng, visit)
    rows = [replace(row, moment=moment) for row, moment in zip(rows, stamps, strict=True)]
    said, _ = blur(hidden.noise, rows, hidden.truth().readings(rows), rng)
    times = list(csv.DictReader(io.StringIO(_table(hidden, rows, said, rng, visit))))
    asked = [name for name in READ if name in lines[0]] or [READ[i] for i in hidden.axes]
    more = [name for name in ("time_s", "temperature_C", "session") if name in times[0] and name not in lines[0]]
    text = io.StringIO()
    writer = csv.DictWriter(text, [*lines[0], *(n for n in asked if n not in lines[0]), *more], lineterminator="\n")
    writer.writeheader()
    for line, time, reading in zip(lines, times, said, strict=True):
        cells = {READ[i]: f"{1e3 * reading[i]:.3f}" for i in range(3) if READ[i] in asked}
        stamps_of = {name: time[name] for name in ("time_s", "temperature_C", "session") if name in time}
        writer.writerow({**line, **cells, **stamps_of})
    return text.getvalue()


def _rows_of(arm: Arm, lines: Sequence[dict[str, str]], levels: Vector) -> list[Row]:
    """Rows of a sheet; a missing angle, force or point is 0, as the table's description says."""

    def numbers(line: dict[str, str], names: Sequence[str]) -> Vector:
        return np.array([float(line.get(name) or 0) for name in names])

    for line in lines:
        if any(numbers(line, ("mx_Nm", "my_Nm", "mz_Nm"))):
            raise ValueError("the sheet asks for moments; this world only pulls")
    coordinates = [joint.coordinate for joint in arm.joints]
    found = []
    for i, line in enumerate(lines):
        angles = np.radians(numbers(line, coordinates))
        name = line.get("pose") or "/".join(line.get(c) or "0" for c in coordinates)
        repeat = line.get("repeat") or "1"
        found.append((name, repeat, line.get("phase") or "loading", angles, numbers(line, FORCES), i))
    repeats = list(dict.fromkeys(repeat for _, repeat, *_ in found))
    return [
        Row(
            name,
            repeats.index(repeat) + 1,
            phase,
            angles,
            force,
            numbers(lines[i], POINT) / 1e3,
            int(np.argmin(np.abs(levels - np.linalg.norm(force)))),
        )
        for name, repeat, phase, angles, force, i in found
    ]


def _table(hidden: Hidden, rows: Sequence[Row], said: Vector, rng: np.random.Generator | None, visit: int) -> str:
    """Write a measurement table; without a random generator no times stand in it."""
    arm, axes, clock = hidden.arm, hidden.axes, hidden.clock
    point = bool(np.any(hidden.point))
    days = clock.days > 1 or visit > 0
    head = ["pose", "repeat", *(joint.coordinate for joint in arm.joints), *FORCES, *(POINT if point else ())]
    timed = rng is not None
    if timed:
        head += ["phase", "step", "time_s", *["temperature_C"] * (clock.thermometer != "none"), *["session"] * days]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*head, *(READ[i] for i in axes)])
    for step, (row, reading) in enumerate(zip(rows, said, strict=True), start=1):
        cells = [
            row.pose,
            row.repeat,
            *(f"{a:.2f}" for a in np.degrees(row.angles)),
            *(f"{f + 0:.3f}" for f in row.force),
        ]
        cells += [f"{1e3 * p:.1f}" for p in row.point] if point else []
        if rng is not None:
            cells += [row.phase, step, f"{row.moment.time_s:.0f}"]
            if clock.thermometer != "none":
                cells.append(f"{clock.temperature(row.moment) + 0.05 * rng.normal():.1f}")
            cells += [f"day{row.moment.session + 1}"] * days
        digits = 3 if timed else 6
        writer.writerow([*cells, *(f"{1e3 * reading[i]:.{digits}f}" for i in axes)])
    return text.getvalue()


def _save(path: Path, data: dict[str, object]) -> None:
    path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
