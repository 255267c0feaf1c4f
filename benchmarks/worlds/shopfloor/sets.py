"""Writes sets: one folder each, from a seed and counts."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.worlds.shopfloor import cases, design, files, noise
from benchmarks.worlds.shopfloor.campaign import Habits, run
from benchmarks.worlds.shopfloor.cases import Case
from benchmarks.worlds.shopfloor.law import Hidden
from benchmarks.worlds.shopfloor.truth import displacement

NAME = "shopfloor"
UNSEEN = 40
UNSEEN_STATE = (
    "each set-up loaded once from rest, without exercise; slow things (warmth, clock) in their middle state, bearings "
    "settled; the gauge without noise, drift, touch or stiction, its constant zero and scale as in the readings; "
    "links, zeros and weights as built"
)


def measured(case: Case) -> tuple[str, list[int]]:
    """readings.csv and the steps that were spoilt."""
    line, rows = case.line, case.line.reads
    clean = displacement(case.truth, np.radians(case.q_deg), line)
    rng = np.random.default_rng([case.seed, cases.KINDS.index(case.kind), case.index, case.attempt, 1])
    d, spoilt = noise.measured(case.noise, clean, line.force[rows], line.pose[rows], line.session[rows], rng, case.axes)
    table = files.rows_of(case, case.q_deg, line, d, files.digits(case), 1)
    seen = [row | clock for row, clock in zip(table, files.clocks(case, line), strict=True)]
    return files.to_csv(seen), [s + 1 for s in spoilt]


def unseen(case: Case) -> str:
    """unseen.csv: other poses in the same angles under the same loads, without noise."""
    rng = np.random.default_rng([case.seed, cases.KINDS.index(case.kind), case.index, case.attempt, 2])
    q_deg = design.random_poses(rng, case.truth.drawing, case.box, UNSEEN)
    cycles = design.cycles_of(case.sizes, [np.array(w) for w in case.ways], case.down, case.hold, 1)
    line = run([(p, cycles) for p in range(UNSEEN)], Habits(), rng)
    d = displacement(case.truth, np.radians(q_deg), line, fresh=True)
    return files.to_csv(files.rows_of(case, q_deg, line, d, 6, 1001))


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
    both = 0.0 if not loud else loud[0] if len(loud) == 1 else cases.loudness(case)
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
        "tags": {"kind": case.kind, **case.tags, **noise.tags(case.noise, len(spoilt))},
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
    return cases.loudness(whole, [], nuisance=True)


def write(folder: Path, seed: int, kind: str, index: int) -> Path:
    """One set's folder."""
    case, loud = cases.drawn(seed, kind, index)
    folder.mkdir(parents=True)
    model = "model.urdf" if case.by_urdf else "model.toml"
    readings, spoilt = measured(case)
    seen = {"schema": "stiffarm-study-set/1", "model": model, "links": str(case.tags["links"])}
    texts = {
        "set.json": _json(seen),
        model: files.model_text(case),
        "readings.csv": readings,
        "unseen.csv": unseen(case),
        "key.json": _json(key_of(case, loud, spoilt)),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8", newline="")
    return folder


def _json(value: object) -> str:
    return json.dumps(value, indent=1) + "\n"


def names(single: int, none: int, outside: int, pairs: int) -> Iterator[tuple[str, int]]:
    for kind, count in (("none", none), ("single", single), ("outside", outside), ("pair", pairs)):
        yield from ((kind, i) for i in range(count))


def make(out: Path, seed: int, single: int = 100, none: int = 50, outside: int = 50, pairs: int = 33) -> list[Path]:
    """Write sets into ``out``; the same seed gives the same bytes, and more sets leave the first ones as they were."""
    return [write(out / f"{kind}-{i:03d}", seed, kind, i) for kind, i in names(single, none, outside, pairs)]
