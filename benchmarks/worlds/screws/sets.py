"""Sets as folders: what the diagnosis may see, the truth beside it, and later visits."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from ..shared import (
    FORCES,
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
from .arm import Array, Flags, Whole
from .mechanics import Campaign, Effect, heated, readings, situation
from .truth import SORTS, Truth, air, anywhere, clock, excess_of, truth


def model_of(t: Truth) -> str:
    """The arm's description with nominal springs; a joint that the model holds rigid has no entry."""
    text = re.sub(r'^name = ".*"', f'name = "{t.arm.name}-as-known"', description(t.arm.name), count=1, flags=re.M)
    path = "serial" if t.model_path == 0.0 else "parallelogram"
    return model_text(text, {t.arm.joints[j]: t.nominal[j] for j in t.free}, path, "")


def thermometer(t: Truth, c: Campaign, rng: np.random.Generator) -> Array | None:
    """Temperature (n,) in C as the set's thermometer shows it, to a tenth."""
    if t.design.thermometer == "none":
        return None
    seen = c.air_celsius + rng.normal(scale=0.1, size=len(c))
    if t.design.thermometer == "housing":
        seen = seen + 12.0 * heated(c, np.ones(len(c)), 5400.0)
    return np.round(seen, 1)


def rows_of(t: Truth, c: Campaign, d: Array, warm: Array | None, labels: bool) -> Iterable[dict[str, str]]:
    """Rows of a table, in the order of the campaign; ``d`` (n, 3) in m; order and clock if ``labels``."""
    for i in range(len(c)):
        row = {name: f"{v:g}" for name, v in zip(t.arm.coordinates, c.q_deg[i], strict=True)}
        row |= {name: f"{v + 0.0:g}" for name, v in zip(FORCES, c.force[i], strict=True)}
        if c.point[i].any():
            row |= {n: f"{1e3 * v:g}" for n, v in zip(POINT, c.point[i], strict=True)}
        row |= {READ[axis]: f"{1e3 * d[i, axis]:.6g}" for axis in t.axes}
        row["pose"] = str(c.setup[i] + 1)
        if labels:
            row |= {"repeat": str(c.repeat[i]), "phase": "unloading" if c.unloading[i] else "loading"}
            row |= {"step": str(i + 1), "time_s": f"{c.time_s[i]:.1f}"}
            if warm is not None:
                row["temperature_C"] = f"{warm[i]:.1f}"
            if t.design.sessions > 1:
                row["session"] = f"day-{c.session[i] + 1}"
        yield row


def shown(t: Truth, clean: Array, c: Campaign, rng: np.random.Generator) -> tuple[Array, int]:
    """Readings (n, 3) in m with scatter of the set-ups, noise, outliers and rounding; how many outliers."""
    names, stay = np.unique(c.stay, return_inverse=True)
    moved = clean * (1.0 + t.design.scatter * rng.normal(size=len(names))[stay])[:, None]
    full = float(np.linalg.norm(t.campaign.force, axis=1).max())
    own = t.instrument.covariance(clean, situation(t.built, (), c).point, c.force, full)
    out = moved + t.instrument.noise(rng, own, c.session)
    if not t.design.outliers:
        return t.instrument.rounded(out), 0
    bad = np.flatnonzero(rng.random(len(c)) < 0.02)
    for i in bad.tolist():
        axis = int(rng.choice(t.axes))
        kind = int(rng.integers(4))
        sigma = float(np.sqrt(own[i, axis, axis]))
        wrong = [out[i, axis] + rng.choice([-1, 1]) * rng.uniform(5, 15) * sigma] * 2
        wrong += [out[i, axis] * float(rng.choice([10.0, 0.1])), -out[i, axis]]
        out[i, axis] = wrong[kind]
    return t.instrument.rounded(out), len(bad)


UNSEEN = 40
UNSEEN_STATE = (
    "rested: cold, first loading from no load, clock at zero, nothing touched; as built (nuisance included), "
    "no scatter of set-ups, no noise; a gauge's constant zero and scale are in, its drift, stickiness and steps are not"
)


def make(out: Path, seed: int, single: int = 100, none: int = 50, outside: int = 50, pairs: int = 33) -> list[Path]:
    """Write so many sets of each sort into ``out``; the folders, in order."""
    counts = dict(zip(SORTS, (single, none, outside, pairs), strict=True))
    return [write(out / f"{sort}-{i + 1:03d}", truth(seed, sort, i)) for sort, n in counts.items() for i in range(n)]


def write(folder: Path, t: Truth) -> Path:
    """Write one set."""
    clean = readings(t.built, t.effects, t.campaign)
    seen, wrong = shown(t, clean, t.campaign, t.rng(1))
    warm = thermometer(t, t.campaign, t.rng(2))
    c = unseen(t)
    still = readings(t.built, t.effects, c, gauge=False)
    files = {
        "model.toml": model_of(t),
        "readings.csv": csv_text(rows_of(t, t.campaign, seen, warm, labels=True)),
        "unseen.csv": csv_text(rows_of(t, c, still, None, labels=False)),
        "key.json": key(t, wrong),
    }
    return write_set(folder, files, links="beam" if t.beam else "rigid")


def unseen(t: Truth) -> Campaign:
    """Other set-ups, each its own: angles in the range of the set's, at one of its loads."""
    rng, c = t.rng(3), t.campaign
    low, high = c.q_deg.min(axis=0), c.q_deg.max(axis=0)
    narrow = replace(t.arm, box_deg=np.stack([low, high], axis=1))
    ones, own = np.arange(UNSEEN), rng.integers(len(c), size=UNSEEN)
    zero = np.zeros(UNSEEN, dtype=np.int64)
    return Campaign(
        q_deg=anywhere(narrow, rng, UNSEEN),
        force=c.force[own],
        point=c.point[own],
        setup=ones,
        repeat=zero + 1,
        visit=ones,
        cycle=ones,
        stay=ones,
        unloading=zero > 0,
        time_s=np.zeros(UNSEEN),
        session=zero,
        air_celsius=np.full(UNSEEN, c.air_celsius[0]),
        rested=True,
    )


def described(e: Effect, excess: float) -> dict[str, object]:
    """An effect in the key."""
    parameters = {k: float(f"{v:.6g}") for k, v in e.parameters.items()}
    head = {"code": e.code, "axis": list(e.axis), "place": e.place, "parameters": parameters}
    return {**head, "excess_chi2": round(excess, 3)}


def key(t: Truth, wrong: int) -> dict[str, object]:
    """The truth of a set, and how to rebuild it."""
    d, c, b = t.design, t.campaign, t.built
    springs = {n: (1.0 / k if k > 0 else None) for n, k in zip(t.arm.joints, t.clean.soft.tolist(), strict=True)}
    springs |= {t.arm.joints[e.softness[0]]: 1.0 / e.softness[1] for e in t.effects if e.softness is not None}
    visits = Counter(c.cycle.tolist())
    tags = {
        **{k: v for k, v in asdict(d).items() if k != "outliers"},
        "outliers": wrong,
        "order": d.order,
        "rows": len(c),
        "loads_N": sorted({round(float(f), 1) for f in np.linalg.norm(c.force, axis=1)}),
        "readings_a_cycle": max(visits.values()),
        "history": "carried on at a set-up" if d.carried else "fresh at each cycle",
        "load_path": "parallelogram" if t.model_path else "serial",
    }
    nuisance = {
        "excess_chi2": round(excess_of(t, (), nuisance=True), 3),
        "joint_zeros_deg": np.round(np.rad2deg(b.zeros), 4).tolist(),
        "joint_centres_mm": np.round(1e3 * (b.arm.centres - t.arm.centres), 3).tolist(),
        "load_scale": b.load_scale,
        "load_errors": {str(k): v for k, v in b.load_errors.items()},
        "link_shares": b.link_share,
        "instrument": asdict(t.instrument),
    }
    return {
        "schema": "stiffarm-study-key/1",
        "world": "screws",
        "seed": t.seed,
        "recipe": {"seed": t.seed, "sort": t.sort, "index": t.index},
        "effects": [described(e, x) for e, x in zip(t.effects, t.excess, strict=True)],
        "excess_chi2": round(t.both, 3),
        "springs_Nm_per_rad": {k: None if v is None else float(f"{v:.8g}") for k, v in springs.items()},
        "tags": tags,
        "nuisance": nuisance,
        "unseen_state": UNSEEN_STATE,
    }


Row = dict[str, str]


def fill(set_folder: Path, sheet_csv: str, visit: int) -> str:
    """The sheet's text with displacements filled in, as read on a later visit (1, 2, ...) a day apart.

    Readings without displacement columns get the set's own. A row that says ``unloading`` before any larger load of
    its cycle is read after the set's largest load, which the table does not show. Visits do not
    know of one another: each follows on the set's own readings.
    """
    recipe = key_in(set_folder)["recipe"]
    t = truth(recipe["seed"], recipe["sort"], recipe["index"])
    rows = sheet_rows(sheet_csv)
    later, real = conducted(t, rows, visit)
    whole = t.campaign.joined(later)
    clean = readings(t.built, t.effects, whole)[len(t.campaign) :]
    seen, _ = shown(t, clean, later, t.rng(1000 + visit, 1))
    warm = thermometer(t, whole, t.rng(1000 + visit, 2))
    columns = list(rows[0])
    asked = [name for name in columns if name in READ] or [READ[axis] for axis in t.axes]
    columns += [n for n in (*asked, *stamps(t, warm is not None)) if n not in columns]
    for k, i in enumerate(real.tolist()):
        row = rows[k]
        row |= {name: f"{1e3 * seen[i, READ.index(name)]:.6g}" for name in asked}
        row["time_s"] = f"{later.time_s[i]:.1f}"
        row["step"] = (row.get("step") or "").strip() or str(len(t.campaign) + 100_000 * visit + k + 1)
        if warm is not None:
            row["temperature_C"] = f"{warm[len(t.campaign) + i]:.1f}"
        if "session" in columns:
            row["session"] = f"visit-{visit}"
    return csv_text(rows, columns)


def stamps(t: Truth, warm: bool) -> list[str]:
    """Columns of order and clock that the set has."""
    return ["step", "time_s", *(["temperature_C"] if warm else []), *(["session"] if t.design.sessions > 1 else [])]


def groups(labels: list[object]) -> Whole:
    """Number of each row's stretch of equal labels."""
    out = np.zeros(len(labels), dtype=np.int64)
    for i in range(1, len(labels)):
        out[i] = out[i - 1] + (labels[i] != labels[i - 1])
    return out


def conducted(t: Truth, rows: list[Row], visit: int) -> tuple[Campaign, Whole]:
    """The sheet as a campaign, with preloads that it does not show, and which of its rows are the sheet's."""
    q = np.array([numbers(r, t.arm.coordinates) for r in rows])
    force = np.array([numbers(r, FORCES) for r in rows])
    point = 1e-3 * np.array([numbers(r, POINT) for r in rows])
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
