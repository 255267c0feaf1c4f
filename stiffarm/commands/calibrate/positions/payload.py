"""A calibration from positions as JSON and CSV: keys with units, null where there is no number."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from doe.absolute.calibrate import Positions
from doe.absolute.fit import Fit
from doe.absolute.identified import Curve, Finding
from doe.absolute.prediction import Predicted
from fem.arm import Arm
from robots.arrays import Array
from robots.files.csv_text import rows_text
from robots.quantities import rounded

SCHEMA = "stiffarm-positions/1"


def positions(given: Arm, c: Positions) -> dict[str, Any]:
    """Everything about it."""
    found, data = c.found, c.found.data
    out: dict[str, Any] = {
        "schema": SCHEMA,
        "robot": given.description.name,
        "readings": len(data),
        "sessions": [
            {
                "name": name,
                "readings": int((data.session.number == s).sum()),
                "rotation": found.frames[s].R.tolist(),
                "position_mm": (1e3 * found.frames[s].t).tolist(),
            }
            for s, name in enumerate(data.session.names)
        ],
        "targets": list(data.target.names),
        "before": distances(c.distances()["before"]),
        "after": distances(c.distances()["after"]),
        "left_out": predicted(c.left_out.take(c.right)),
        "left_out_sessions": None if c.sessions_out is None else predicted(c.sessions_out.take(c.right)),
        "scatter_sd_mm": rounded(1e3 * found.variances.sigma),
        "scatter_tail": rounded(found.tail),
        "settled": found.settled,
        "parameters": [finding(one) for one in c.findings],
        "not_told_apart_by_any_readings": [{"name": t.name, "moved_by": list(t.others)} for t in c.twins],
        "left_open_by_these_readings": [{"names": list(o.names), "combinations": o.directions} for o in c.open],
        "curves": [curve(one) for one in c.curves],
        "wrong_readings": [
            {"line": g.line, "distance_mm": rounded(1e3 * g.distance), "cause": g.cause} for g in c.gross
        ],
        "remarks": list(c.remarks),
    }
    if c.holdout is not None:
        table, there, _ = c.holdout
        new = [name for name in table.session.names if name not in data.session.names]
        out["holdout"] = {**predicted(there), "readings": len(table), "frames_fitted_anew": new}
    return out


def distances(d: Array) -> dict[str, float | None]:
    """Mean, RMS, 95 % and largest of distances (n,) m."""
    return {
        "mean_mm": rounded(1e3 * float(d.mean())),
        "rms_mm": rounded(1e3 * float(np.sqrt(np.mean(d**2)))),
        "p95_mm": rounded(1e3 * float(np.quantile(d, 0.95))),
        "largest_mm": rounded(1e3 * float(d.max())),
    }


def predicted(p: Predicted) -> dict[str, Any]:
    """Distances of readings that were not used, and how many coordinates lie in their intervals."""
    return {**distances(p.distance), "in_interval95": {"inside": p.coverage.inside, "of": p.coverage.readings}}


def finding(f: Finding) -> dict[str, Any]:
    """A parameter; null where nothing is identified, an upper end null where there is none."""
    low, high = (rounded(x) for x in f.interval95)
    return {
        "name": f.name,
        "unit": f.unit,
        "value": None if f.value is None else rounded(f.value),
        "interval95": None if low is None and high is None else [low, high],
        "status": f.status,
    }


def curve(c: Curve) -> dict[str, Any]:
    """A joint's error curve: where it is identified, and its size there."""
    rms = float(np.sqrt(np.mean(c.error[c.known] ** 2))) if c.is_known else math.nan
    return {
        "joint": c.joint,
        "identified_deg": [list(r) for r in c.ranges_deg],
        "rms_mrad": rounded(1e3 * rms),
        "prior_sd_mrad": rounded(1e3 * c.height),
    }


def parameters_csv(c: Positions) -> str:
    """One row a parameter."""
    rows: list[tuple[str, ...]] = [("parameter", "value", "low95", "high95", "unit", "status")]
    for f in c.findings:
        cells = ("" if x is None or not math.isfinite(x) else f"{x:.9g}" for x in (f.value, *f.interval95))
        rows.append((f.name, *cells, f.unit, f.status))
    return rows_text(rows)


def curves_csv(c: Positions) -> str:
    """Every joint's curve by the degree; empty where it is not identified."""
    rows = [("joint", "angle_deg", "error_mrad", "half95_mrad")]
    for one in c.curves:
        for a, e, h, known in zip(np.degrees(one.angle), one.error, one.half95, one.known, strict=True):
            rows.append((one.joint, f"{a:.2f}", f"{1e3 * e:.5f}" if known else "", f"{1e3 * h:.5f}" if known else ""))
    return rows_text(rows)


def errors_csv(c: Positions) -> str:
    """One row a reading: how far off before, after, and where it was left out; mm."""
    rows: list[tuple[str, ...]] = [("line", "session", "target", "before_mm", "after_mm", "left_out_mm", "weight")]
    data = c.found.data
    for k, (before, after, out) in enumerate(zip(_mm(c.before), _mm(c.found), 1e3 * c.left_out.distance, strict=True)):
        names = data.session.names[data.session.number[k]], data.target.names[data.target.number[k]]
        weight = min(float(c.found.weight[k]), 1.0)
        rows.append((str(data.line[k]), *names, f"{before:.5f}", f"{after:.5f}", f"{out:.5f}", f"{weight:.4f}"))
    return rows_text(rows)


def _mm(f: Fit) -> Array:
    return np.asarray(1e3 * np.linalg.norm(f.residual, axis=1))
