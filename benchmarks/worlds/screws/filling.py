"""Fill in a sheet of further set-ups: the same truth, a later day, fresh noise."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np

from .campaign import Campaign
from .design import air, clock
from .mechanics import readings
from .screws import Array, Flags, Whole
from .tables import SHOWN, shown, thermometer
from .truth import Truth, truth

Row = dict[str, str]


def fill(set_folder: Path, sheet_csv: str, visit: int) -> str:
    """The sheet's text with displacements filled in, as read on a later visit (1, 2, ...) a day apart.

    Readings without displacement columns get the set's own. A row that says ``unloading`` before any larger load of
    its cycle is read after the set's largest load, which the table does not show. Visits do not
    know of one another: each follows on the set's own readings.
    """
    recipe = json.loads((set_folder / "key.json").read_text(encoding="utf-8"))["recipe"]
    t = truth(recipe["seed"], recipe["sort"], recipe["index"])
    reader = csv.DictReader(io.StringIO(sheet_csv), delimiter=";" if ";" in sheet_csv.split("\n")[0] else ",")
    rows = list(reader)
    later, real = conducted(t, rows, visit)
    whole = t.campaign.joined(later)
    clean = readings(t.built, t.effects, whole)[len(t.campaign) :]
    seen, _ = shown(t, clean, later, t.rng(1000 + visit, 1))
    warm = thermometer(t, whole, t.rng(1000 + visit, 2))
    columns = list(reader.fieldnames or [])
    asked = [name for name in columns if name in SHOWN] or [SHOWN[axis] for axis in t.axes]
    columns += [n for n in (*asked, *stamps(t, warm is not None)) if n not in columns]
    for k, i in enumerate(real.tolist()):
        row = rows[k]
        row |= {name: f"{1e3 * seen[i, SHOWN.index(name)]:.6g}" for name in asked}
        row["time_s"] = f"{later.time_s[i]:.1f}"
        row["step"] = (row.get("step") or "").strip() or str(len(t.campaign) + 100_000 * visit + k + 1)
        if warm is not None:
            row["temperature_C"] = f"{warm[len(t.campaign) + i]:.1f}"
        if "session" in columns:
            row["session"] = f"visit-{visit}"
    out = io.StringIO()
    writer = csv.DictWriter(out, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def stamps(t: Truth, warm: bool) -> list[str]:
    """Columns of order and clock that the set has."""
    return ["step", "time_s", *(["temperature_C"] if warm else []), *(["session"] if t.design.sessions > 1 else [])]


def number(row: Row, name: str, otherwise: float = 0.0) -> float:
    """A cell's figure."""
    cell = (row.get(name) or "").strip()
    return float(cell) if cell else otherwise


def groups(labels: list[object]) -> Whole:
    """Number of each row's stretch of equal labels."""
    out = np.zeros(len(labels), dtype=np.int64)
    for i in range(1, len(labels)):
        out[i] = out[i - 1] + (labels[i] != labels[i - 1])
    return out


def conducted(t: Truth, rows: list[Row], visit: int) -> tuple[Campaign, Whole]:
    """The sheet as a campaign, with preloads that it does not show, and which of its rows are the sheet's."""
    q = np.array([[number(r, n) for n in t.arm.coordinates] for r in rows])
    force = np.array([[number(r, n) for n in ("fx_N", "fy_N", "fz_N")] for r in rows])
    point = 1e-3 * np.array([[number(r, n) for n in ("px_mm", "py_mm", "pz_mm")] for r in rows])
    back = np.array([(r.get("phase") or "").strip() == "unloading" for r in rows])
    repeat = np.array([int(number(r, "repeat", 1.0)) for r in rows])
    labels: list[object] = [(r.get("pose") or "", tuple(q[i])) for i, r in enumerate(rows)]
    stay = groups(labels)
    ways: list[object] = [tuple(np.round(f / max(float(np.linalg.norm(f)), 1e-9), 3)) for f in force]
    cycle = cycles(stay, repeat, back, ways, force)
    order, shown_rows = with_preloads(cycle, back)
    setups = {label: k for k, label in enumerate(dict.fromkeys(labels))}
    start = float(t.campaign.time_s[-1]) + 86400.0 * visit
    session = np.zeros(len(order), dtype=np.int64) + int(t.campaign.session.max()) + visit
    time = start + clock(t.rng(1000 + visit, 3), stay[order], session)
    pulled = force[order]
    hidden = ~np.isin(np.arange(len(order)), shown_rows)
    top = float(np.linalg.norm(t.campaign.force, axis=1).max())
    for i in np.flatnonzero(hidden):
        pulled[i] *= top / max(float(np.linalg.norm(pulled[i])), 1e-9)
    campaign = Campaign(
        q_deg=q[order],
        force=pulled,
        point=point[order],
        setup=np.array([setups[labels[i]] for i in order.tolist()]),
        repeat=repeat[order],
        visit=(stay if t.design.carried else cycle)[order],
        cycle=cycle[order],
        stay=stay[order],
        unloading=back[order],
        time_s=time,
        session=session,
        air_celsius=air(t.rng(1000 + visit, 4), time),
    )
    return campaign, shown_rows


def cycles(stay: Whole, repeat: Whole, back: Flags, ways: list[object], force: Array) -> Whole:
    """Loading cycle of each row: a new one with each set-up, repeat, direction, or loading after unloading."""
    size = np.linalg.norm(force, axis=1)
    out = np.zeros(len(stay), dtype=np.int64)
    for i in range(1, len(stay)):
        new = stay[i] != stay[i - 1] or repeat[i] != repeat[i - 1] or ways[i] != ways[i - 1]
        new = new or (not back[i] and (bool(back[i - 1]) or size[i] <= size[i - 1]))
        out[i] = out[i - 1] + new
    return out


def with_preloads(cycle: Whole, back: Flags) -> tuple[Whole, Whole]:
    """Rows in order, unloading that begins a cycle twice (first as its preload); places of the sheet's rows."""
    order: list[int] = []
    places: list[int] = []
    for i in range(len(cycle)):
        if back[i] and (i == 0 or cycle[i] != cycle[i - 1]):
            order.append(i)
        places.append(len(order))
        order.append(i)
    return np.array(order, dtype=np.int64), np.array(places, dtype=np.int64)
