"""Sets as folders: tables and models as text, and sheets of later visits filled in."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np

from ..shared import (
    FORCES,
    MOMENTS,
    POINT,
    READ,
    csv_text,
    description,
    key_in,
    model_text,
    number,
    numbers,
    sheet_rows,
    write_set,
)
from .arms import Floats, urdf
from .cases import KINDS, Case, displacement, draw, drawn, loudness, measured, tags
from .law import DAY, Cycle, Habits, Hidden, Timeline, air, cycles_of, random_poses, run

PHASES = {1: "loading", -1: "unloading"}
DRAWING_NOTE = "# Springs are nominal: what the maker's sheet says, not what was measured.\n"


def model_of(case: Case) -> str:
    """The arm's file with nominal springs; joints to be held rigid have none, and a hidden load path is serial."""
    arm = case.truth.drawing
    if case.by_urdf:
        return urdf(arm)
    springs = {arm.names[k]: arm.axes[k].spring for k in case.springs}
    path = "serial" if case.truth.hides("load-path") else ""
    return DRAWING_NOTE + model_text(description(arm.name), springs, path)


def coordinates(case: Case) -> tuple[str, ...]:
    """Columns of the angles; a URDF's joints are named by themselves."""
    arm = case.truth.drawing
    return tuple(f"{a.name}_deg" if case.by_urdf else a.coordinate for a in arm.axes)


def read_axes(case: Case) -> tuple[str, ...]:
    return tuple(READ[case.axes])


def temperature(case: Case, line: Timeline) -> Floats:
    """Of the hall's air, or of a joint's housing, which the drives warm by up to 14 degrees."""
    hall = air(line.time, case.truth.mood)
    return hall + 14.0 * line.warm if case.thermometer == "housing" else hall


def clocks(case: Case, line: Timeline) -> list[dict[str, str]]:
    """Time, temperature and session of each reading."""
    rows = line.reads
    many = int(line.session.max()) > 0
    warm = temperature(case, line)
    return [
        {
            "time_s": f"{line.time[i]:.0f}",
            **({} if case.thermometer == "none" else {"temperature_C": f"{warm[i]:.1f}"}),
            **({"session": f"day-{line.session[i] + 1}"} if many else {}),
        }
        for i in rows
    ]


def load_columns(case: Case) -> tuple[str, ...]:
    return FORCES if len(case.ways) > 1 else FORCES[2:]


def rows_of(case: Case, q_deg: Floats, line: Timeline, d: Floats, digits: int, first_pose: int) -> list[dict[str, str]]:
    """The table's rows in the order of reading; d (n_reads, 3) m."""
    names, loads = coordinates(case), load_columns(case)
    out = []
    for step, (i, move) in enumerate(zip(line.reads, d, strict=True), start=1):
        p = int(line.pose[i])
        row = {"pose": str(p + first_pose), "repeat": str(line.repeat[i])}
        if case.down:
            row["phase"] = PHASES[int(line.phase[i])]
        row["step"] = str(step)
        row |= {name: f"{angle:g}" for name, angle in zip(names, q_deg[p], strict=True)}
        force = dict(zip(FORCES, line.force[i], strict=True))
        row |= {name: f"{force[name] + 0.0:.10g}" for name in loads}
        row |= {name: f"{1e3 * move[READ.index(name)] + 0.0:.{digits}f}" for name in read_axes(case)}
        out.append(row)
    return out


def digits(case: Case) -> int:
    """Decimals of a millimetre that the gauge shows."""
    return 2 if case.noise.resolution > 5e-6 else 3


NAME = "shopfloor"
UNSEEN = 40
UNSEEN_STATE = (
    "each set-up loaded once from rest, without exercise; slow things (warmth, clock) in their middle state, bearings "
    "settled; the gauge without noise, drift, touch or stiction, its constant zero and scale as in the readings; "
    "links, zeros and weights as built"
)


def readings_of(case: Case) -> tuple[str, list[int]]:
    """readings.csv and the steps that were spoilt."""
    line, rows = case.line, case.line.reads
    clean = displacement(case.truth, np.radians(case.q_deg), line)
    rng = np.random.default_rng([case.seed, KINDS.index(case.kind), case.index, case.attempt, 1])
    d, spoilt = measured(case.noise, clean, line.force[rows], line.pose[rows], line.session[rows], rng, case.axes)
    table = rows_of(case, case.q_deg, line, d, digits(case), 1)
    seen = [row | clock for row, clock in zip(table, clocks(case, line), strict=True)]
    return csv_text(seen), [s + 1 for s in spoilt]


def unseen(case: Case) -> str:
    """unseen.csv: other poses in the same angles under the same loads, without noise."""
    rng = np.random.default_rng([case.seed, KINDS.index(case.kind), case.index, case.attempt, 2])
    q_deg = random_poses(rng, case.truth.drawing, case.box, UNSEEN)
    cycles = cycles_of(case.sizes, [np.array(w) for w in case.ways], case.down, case.hold, 1)
    line = run([(p, cycles) for p in range(UNSEEN)], Habits(), rng)
    d = displacement(case.truth, np.radians(q_deg), line, fresh=True)
    return csv_text(rows_of(case, q_deg, line, d, 6, 1001))


def _effect(h: Hidden, chi2: float) -> dict[str, object]:
    return {
        "code": h.code,
        "axis": list(h.law.axis),
        "place": h.place,
        "parameters": h.sizes,
        "excess_chi2": round(chi2, 3),
    }


def key_of(case: Case, loud: list[float], spoilt: list[int]) -> dict[str, object]:
    """The truth; ``draw`` with the seed is all that is needed to make it again."""
    t, n = case.truth, case.truth.nuisance
    both = 0.0 if not loud else loud[0] if len(loud) == 1 else loudness(case)
    return {
        "schema": "stiffarm-study-key/1",
        "world": NAME,
        "seed": case.seed,
        "draw": {"kind": case.kind, "index": case.index, "attempt": case.attempt},
        "effects": [_effect(h, x) for h, x in zip(t.hidden, loud, strict=True)],
        "excess_chi2": round(both, 3),
        "springs_Nm_per_rad": {
            name: None if c == 0.0 else 1.0 / c for name, c in zip(t.drawing.names, t.compliance.tolist(), strict=True)
        },
        "tags": {"kind": case.kind, **case.tags, **tags(case.noise, len(spoilt))},
        "noise": {
            "kind": case.noise.kind,
            "share": case.noise.share,
            "m_per_N": case.noise.per_newton,
            "axes_m": list(case.noise.axes),
            "session_m": case.noise.days,
            "setup_share": case.noise.scatter,
            "resolution_m": case.noise.resolution,
            "outlier_steps": spoilt,
        },
        "nuisance": {
            "zeros_rad": n.zeros.tolist(),
            "links_rad_per_Nm": n.links,
            "links_factor": list(t.links),
            "all_loads": n.all_loads,
            "each_load": n.each_load,
            "lengths_off_m": [
                np.subtract(b.xyz, a.xyz).round(7).tolist() for a, b in zip(t.drawing.axes, t.built.axes, strict=True)
            ],
            "excess_chi2": round(_nuisance(case), 3),
        },
        "unseen_state": UNSEEN_STATE,
    }


def _nuisance(case: Case) -> float:
    """How loud the nuisances are without anything hidden."""
    held = case.truth.hides("load-path") or case.truth.hides("joint-compliance")
    whole = replace(case, springs=tuple(range(case.truth.drawing.dof)))
    whole = replace(whole, truth=replace(case.truth, hidden=())) if held else case
    return loudness(whole, [], nuisance=True)


def write(folder: Path, seed: int, kind: str, index: int) -> Path:
    """One set's folder."""
    case, loud = drawn(seed, kind, index)
    model = "model.urdf" if case.by_urdf else "model.toml"
    readings, spoilt = readings_of(case)
    files = {
        model: model_of(case),
        "readings.csv": readings,
        "unseen.csv": unseen(case),
        "key.json": key_of(case, loud, spoilt),
    }
    return write_set(folder, files, model=model, links=str(case.tags["links"]))


def make(out: Path, seed: int, single: int = 100, none: int = 50, outside: int = 50, pairs: int = 33) -> list[Path]:
    """Write sets into ``out``; the same seed gives the same bytes, and more sets leave the first ones as they were."""
    counts = {"none": none, "single": single, "outside": outside, "pair": pairs}
    return [write(out / f"{kind}-{i:03d}", seed, kind, i) for kind, count in counts.items() for i in range(count)]


Row = dict[str, str]


def case_of(folder: Path) -> Case:
    """The set's truth again, from its key."""
    key = key_in(folder)
    d = key["draw"]
    return draw(key["seed"], d["kind"], d["index"], d["attempt"])


def _rows(sheet: str) -> tuple[list[str], list[Row]]:
    rows = sheet_rows(sheet)
    for row in rows:
        bad = [name for name in (*MOMENTS, *POINT) if number(row, name)]
        if bad:
            raise ValueError(f"this hall hangs weights on the tool point only; the sheet has {', '.join(bad)}")
    return list(rows[0]), rows


def _force(row: Row) -> Floats:
    return numbers(row, FORCES)


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
    return sorted(range(len(rows)), key=lambda i: number(rows[i], "step"))


def _campaign(case: Case, rows: Sequence[Row], angles: Sequence[tuple[float, ...]], visit: int) -> Timeline:
    """Works through the sheet ``visit`` days after the first campaign."""
    setups: list[tuple[int, Sequence[Cycle]]] = []
    poses = list(dict.fromkeys(angles))
    for q, group in groupby(range(len(rows)), key=lambda i: angles[i]):
        setups.append((poses.index(q), _cycles([rows[i] for i in group], max(case.sizes))))
    start = (np.ceil(case.truth.span / DAY) + visit) * DAY
    rng = np.random.default_rng([case.seed, KINDS.index(case.kind), case.index, case.attempt, 3, visit])
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
    angles = [tuple(number(row, name) for name in coordinates(case)) for row in rows]
    poses = np.array(list(dict.fromkeys(angles)))
    line = _campaign(case, rows, angles, visit)
    i = line.reads
    clean = displacement(case.truth, np.radians(poses), line)
    rng = np.random.default_rng([case.seed, case.index, visit, zlib.crc32(sheet_csv.encode())])
    d, _ = measured(
        case.noise, clean, line.force[i], line.pose[i], line.session[i] - line.session.min(), rng, case.axes
    )
    read = [name for name in read_axes(case) if name in columns] or list(read_axes(case))
    steps = {} if "step" in columns else {"step": ""}
    for step, (row, move, clock) in enumerate(zip(rows, d, clocks(case, line), strict=True), start=1):
        row |= {name: f"{1e3 * move[READ.index(name)] + 0.0:.{digits(case)}f}" for name in read}
        row |= clock | {name: str(step) for name in steps}
    return csv_text(rows, [*columns, *read, *steps, *(clocks(case, line)[0])])
