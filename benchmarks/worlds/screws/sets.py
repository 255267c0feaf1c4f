"""Sets as folders: what the diagnosis may see, and the truth beside it."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from .campaign import Campaign
from .design import SORTS, anywhere
from .mechanics import Effect, readings
from .tables import model_text, rows_of, shown, text_of, thermometer
from .truth import Truth, excess_of, truth

UNSEEN = 40
UNSEEN_STATE = (
    "rested: cold, first loading from no load, clock at zero, nothing touched; as built (nuisance included), "
    "no scatter of set-ups, no noise; a gauge's constant zero and scale are in, its drift, stickiness and steps are not"
)


def make(out: Path, seed: int, single: int = 100, none: int = 50, outside: int = 50, pairs: int = 33) -> list[Path]:
    """Write so many sets of each sort into ``out``; the folders, in order."""
    folders: list[Path] = []
    for sort, count in zip(SORTS, (single, none, outside, pairs), strict=True):
        for index in range(count):
            folder = out / f"{sort}-{index + 1:03d}"
            write(folder, truth(seed, sort, index))
            folders.append(folder)
    return folders


def write(folder: Path, t: Truth) -> None:
    """Write one set."""
    folder.mkdir(parents=True, exist_ok=True)
    clean = readings(t.built, t.effects, t.campaign)
    seen, wrong = shown(t, clean, t.campaign, t.rng(1))
    warm = thermometer(t, t.campaign, t.rng(2))
    c = unseen(t)
    still = readings(t.built, t.effects, c, gauge=False)
    links = "beam" if t.beam else "rigid"
    texts = {
        "set.json": text({"schema": "stiffarm-study-set/1", "model": "model.toml", "links": links}),
        "model.toml": model_text(t),
        "readings.csv": text_of(rows_of(t, t.campaign, seen, warm, labels=True)),
        "unseen.csv": text_of(rows_of(t, c, still, None, labels=False)),
        "key.json": text(key(t, wrong)),
    }
    for name, content in texts.items():
        (folder / name).write_text(content, encoding="utf-8", newline="\n")


def text(content: object) -> str:
    """JSON text."""
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


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
