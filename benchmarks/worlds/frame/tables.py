"""A set's folder: the table, the model, the key."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arms import model_text
from .campaign import point_of
from .noise import read_axes
from .spec import ANGLE_DIGITS, Row, Spec

Array = NDArray[np.float64]
READ = ("dx_mm", "dy_mm", "dz_mm")


def table(spec: Spec, rows: list[Row], said: Array, first_step: int = 1, digits: int = 4) -> str:
    """The measurement table as CSV."""
    out = []
    for step, (r, d) in enumerate(zip(rows, said, strict=True), first_step):
        line: dict[str, Any] = {"pose": r.pose}
        line |= {c: f"{a:.{ANGLE_DIGITS}f}" for c, a in zip(spec.of.columns, r.angles, strict=True)}
        line |= {f"f{x}_N": f"{f + 0.0:.4f}" for x, f in zip("xyz", r.force, strict=True)}
        if spec.point:
            line |= {f"p{x}_mm": f"{1e3 * p + 0.0:.3f}" for x, p in zip("xyz", r.point, strict=True)}
        line["repeat"] = r.cycle + 1
        if spec.down:
            line["phase"] = r.phase
        own = {"step": step, "time_s": f"{r.time_s:.1f}", "session": f"S{r.session + 1}"}
        line |= {name: own[name] for name in spec.columns}
        line |= {READ[k]: f"{1e3 * d[k]:.{digits}f}" for k in read_axes(spec)}
        out.append(line)
    text = io.StringIO()
    writer = csv.DictWriter(text, out[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(out)
    return text.getvalue()


def write(folder: Path, spec: Spec, readings: str, unseen: str, key: dict[str, Any]) -> None:
    """All files of a set, in a new folder."""
    folder.mkdir(parents=True)
    springs = {joint: k for joint, k in zip(spec.of.joints, spec.stated, strict=True) if k}
    start = {"schema": "stiffarm-study-set/1", "model": "model.toml", "links": "rigid", "load_path": spec.path}
    files = {
        "model.toml": model_text(spec.of, springs),
        "set.json": json.dumps(start, indent=1),
        "readings.csv": readings,
        "unseen.csv": unseen,
        "key.json": json.dumps(key, indent=1),
    }
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")


def rows_from(spec: Spec, sheet: str, first_visit: int, session: int, start_s: float) -> list[Row]:
    """Rows of a sheet to be filled in: a set-up is a run of lines at one pose, a cycle one of its repeats."""
    lines = list(csv.DictReader(io.StringIO(sheet)))

    def number(line: dict[str, str], name: str, missing: float = 0.0) -> float:
        return float(line[name]) if line.get(name) else missing

    point = 1e3 * point_of(spec)
    rows: list[Row] = []
    visit, cycle, now, last = first_visit - 1, 0, start_s, None
    for line in lines:
        q = np.array([number(line, c) for c in spec.of.columns])
        force = np.array([number(line, f"f{x}_N") for x in "xyz"])
        here = (line.get("pose"), *q, *(force / (np.linalg.norm(force) or 1)).round(6))
        if here != last:
            visit, cycle, now, repeat = visit + 1, 0, now + 120.0, line.get("repeat")
            zero = now
        elif line.get("repeat") != repeat:
            cycle, now, repeat = cycle + 1, now + 25.0, line.get("repeat")
            zero = now
        last, now = here, now + 30.0
        p = np.array([number(line, f"p{x}_mm", point[k]) for k, x in enumerate("xyz")]) / 1e3
        moment = np.array([number(line, f"m{x}_Nm") for x in "xyz"])
        phase = line.get("phase") or "loading"
        rows.append(
            Row(visit, cycle, session, now - start_s, now, zero, phase, line.get("pose") or "", q, force, p, moment)
        )
    return rows
