"""Fills in a sheet of further set-ups on the same arm, some days later: fresh noise and scatter, the clock going on."""

from __future__ import annotations

import csv
import io
import json
import zlib
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path

import numpy as np

from benchmarks.worlds.shopfloor import cases, files, noise
from benchmarks.worlds.shopfloor.arms import Floats
from benchmarks.worlds.shopfloor.campaign import DAY, Cycle, Habits, Timeline, run
from benchmarks.worlds.shopfloor.cases import Case
from benchmarks.worlds.shopfloor.truth import displacement

Row = dict[str, str]
NOT_HERE = ("mx_Nm", "my_Nm", "mz_Nm", "px_mm", "py_mm", "pz_mm")


def case_of(folder: Path) -> Case:
    """The set's truth again, from its key."""
    key = json.loads((folder / "key.json").read_text(encoding="utf-8"))
    d = key["draw"]
    return cases.draw(key["seed"], d["kind"], d["index"], d["attempt"])


def _number(row: Mapping[str, str], name: str) -> float:
    text = (row.get(name) or "").strip()
    return float(text) if text else 0.0


def _rows(sheet: str) -> tuple[list[str], list[Row]]:
    first = sheet.splitlines()[0] if sheet.strip() else ""
    reader = csv.DictReader(io.StringIO(sheet), delimiter=";" if first.count(";") > first.count(",") else ",")
    rows = list(reader)
    if not rows:
        raise ValueError("the sheet has no rows")
    for row in rows:
        bad = [name for name in NOT_HERE if _number(row, name)]
        if bad:
            raise ValueError(f"this hall hangs weights on the tool point only; the sheet has {', '.join(bad)}")
    return list(reader.fieldnames or ()), rows


def _force(row: Row) -> Floats:
    return np.array([_number(row, name) for name in files.FORCES])


def _falls(row: Row) -> bool:
    return row.get("phase", "").strip().lower() == "unloading"


def _goes_on(before: Row, row: Row) -> bool:
    """Whether the weights of a row can be reached from those of the row before without starting again."""
    if before.get("repeat") != row.get("repeat"):
        return False
    f, g = _force(before), _force(row)
    along = float(f @ g) > 0.999 * float(np.linalg.norm(f) * np.linalg.norm(g))
    more = float(np.linalg.norm(g)) - float(np.linalg.norm(f))
    if _falls(row):
        return along and (more < 0.0 or (more == 0.0 and not _falls(before)))
    return along and more > 0.0 and not _falls(before)


def _cycle(rows: Sequence[Row], top: float) -> Cycle:
    """One cycle; where it starts by unloading, the weights of the first campaign's top are put on unread before."""
    force = np.array([_force(row) for row in rows])
    phase = np.array([-1 if _falls(row) else 1 for row in rows], dtype=np.int64)
    read = (True,) * len(rows)
    if phase[0] < 0:
        size = float(np.linalg.norm(force[0]))
        above = force[0] / max(size, 1e-9) * max(top, 1.25 * size)
        force, phase, read = np.vstack([above, force]), np.insert(phase, 0, 1), (False, *read)
    repeat = rows[0].get("repeat", "").strip()
    return Cycle(force, phase, read, int(repeat) if repeat.isdigit() else 1)


def _cycles(rows: Sequence[Row], top: float) -> list[Cycle]:
    groups: list[list[Row]] = []
    for row in rows:
        if groups and _goes_on(groups[-1][-1], row):
            groups[-1].append(row)
        else:
            groups.append([row])
    return [_cycle(group, top) for group in groups]


def _in_order(rows: Sequence[Row]) -> list[int]:
    """Numbers of the rows in the order of their steps, or as they stand."""
    if any(not (row.get("step") or "").strip() for row in rows):
        return list(range(len(rows)))
    return sorted(range(len(rows)), key=lambda i: _number(rows[i], "step"))


def _campaign(case: Case, rows: Sequence[Row], angles: Sequence[tuple[float, ...]], visit: int) -> Timeline:
    """Works through the sheet ``visit`` days after the first campaign."""
    setups: list[tuple[int, Sequence[Cycle]]] = []
    poses = list(dict.fromkeys(angles))
    for q, group in groupby(range(len(rows)), key=lambda i: angles[i]):
        setups.append((poses.index(q), _cycles([rows[i] for i in group], max(case.sizes))))
    start = (np.ceil(case.truth.span / DAY) + visit) * DAY
    rng = np.random.default_rng([case.seed, cases.KINDS.index(case.kind), case.index, case.attempt, 3, visit])
    session, count = int(case.line.session.max()) + 1 + 10 * visit, int(case.line.count.max()) + 1 + 1000 * (visit - 1)
    return run(setups, Habits(), rng, float(start), session, max(count, 0))


def fill(set_folder: Path, sheet_csv: str, visit: int) -> str:
    """The sheet with displacements, and with step, time, temperature and session as in the set's readings.

    Parameters
    ----------
    set_folder
        A set's folder; only its key.json is read.
    sheet_csv
        Text of the sheet: a measurement table whose displacement cells are empty.
    visit
        1 for the first return to the arm, 2 for the next: other noise, later days. The same visit gives the same text.
    """
    case = case_of(set_folder)
    columns, unsorted = _rows(sheet_csv)
    rows = [unsorted[i] for i in _in_order(unsorted)]
    angles = [tuple(_number(row, name) for name in files.coordinates(case)) for row in rows]
    poses = np.array(list(dict.fromkeys(angles)))
    line = _campaign(case, rows, angles, visit)
    i = line.reads
    clean = displacement(case.truth, np.radians(poses), line)
    rng = np.random.default_rng([case.seed, case.index, visit, zlib.crc32(sheet_csv.encode())])
    d, _ = noise.measured(
        case.noise, clean, line.force[i], line.pose[i], line.session[i] - line.session.min(), rng, case.axes
    )
    read = [name for name in files.read_axes(case) if name in columns] or list(files.read_axes(case))
    steps = {} if "step" in columns else {"step": ""}
    for number, (row, move, clock) in enumerate(zip(rows, d, files.clocks(case, line), strict=True), start=1):
        row |= {name: f"{1e3 * move[files.MOVES.index(name)] + 0.0:.{files.digits(case)}f}" for name in read}
        row |= clock | {name: str(number) for name in steps}
    return files.to_csv(rows, [*columns, *read, *steps, *(files.clocks(case, line)[0])])
