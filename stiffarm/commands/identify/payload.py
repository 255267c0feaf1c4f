"""An identification of joint twists as JSON and CSV: keys with units, null where there is no number."""

from __future__ import annotations

from typing import Any

import numpy as np

from doe.joint_twists import Direction
from doe.joint_twists.checks import Coupling, Loop
from doe.joint_twists.identify import KINDS, NO_NOISE
from doe.joint_twists.laws import Law
from doe.joint_twists.model_file import held_constant, rms_mm
from doe.joint_twists.substitute import Errors, Window
from robots.files.csv_text import rows_text
from robots.quantities import rounded
from stiffarm.commands.identify.step import AtFlange, JointTwists

SCHEMA = "stiffarm-joint-twists/1"
AXES = ("x", "y", "z")
HELD_OUT = ("pose", "force_N", "measured_N_per_mm", "predicted_N_per_mm", "error_percent")
# Why a stiffness has no number, or an interval no end.
NO_NUMBER = {
    "not identified": "never loaded or never read",
    "not determined": "the best compliance is not positive",
}
NO_UPPER = "no upper limit: rigid is possible within 95 %"
NO_END = NO_NUMBER | {
    "not determined": "the best compliance is not positive: a lower limit at most",
    "not judged": NO_NOISE,
}


def identification(d: JointTwists) -> dict[str, Any]:
    """Everything about an identification; ``why_null`` beside every null says why there is no figure."""
    found, data = d.found, d.found.data
    content = {
        "schema": SCHEMA,
        "robot": found.robot,
        "synthetic": data.synthetic,
        "data": data.source,
        "data_sha256": data.sha256,
        "readings": data.n,
        "load_cycles": found.cycles.m,
        "set_ups": len(found.cycles.setups),
        "branches": found.branches,
        "cannot_judge": [{"what": x.what, "of": list(x.of), "reason": x.reason} for x in found.unjudged],
        "stiffnesses": [direction(x) for x in found.directions.values()],
        "noise": [_noise(d, j) for j in range(d.given.robot.dof)],
        "scatter_of_set_ups_percent": {
            kind: _explained(
                {"value": rounded(100.0 * s) if n else None, "freedoms": n}, value="too few set-ups at one angle"
            )
            for kind, s, n in zip(KINDS, found.scatter, found.scatter_dof, strict=True)
        },
        "left_over_rms_mm": rms_mm(found),
        "hysteresis": [_loop(x) for x in d.loops],
        "diagonal": [
            {
                "joint": t.joint,
                "suffices": t.suffices,
                "couplings": [_coupling(c) for c in sorted(t.couplings, key=lambda c: c.p_value)],
            }
            for t in d.diagonal
        ],
        "twist_ratio": None
        if d.bending is None
        else {
            "joint": d.bending.joint,
            "rx_over_rz": rounded(d.bending.ratio),
            "interval95": [rounded(d.bending.low), rounded(d.bending.high)],
        },
        "at_flange": None if d.flange is None else at_flange(d.flange),
        "why_not_at_flange": d.no_flange or None,
        "map": None if d.window is None else window(d.window),
        "held_out": None
        if d.held_out is None
        else [
            _explained(
                dict(zip(HELD_OUT, (row[0], *(rounded(v, 12) for v in row[1:])), strict=True)),
                **dict.fromkeys(HELD_OUT, "the model gives no finite stiffness there"),
            )
            for row in held_out_rows(d)
        ],
        "notes": [*data.notes, *found.notes, *held_constant(found)],
    }
    return _explained(
        content,
        twist_ratio="needs rx and rz of the second joint, both determined",
        at_flange=d.no_flange,
        map=d.no_window,
        held_out="no flange deflections were given (--holdout)",
    )


def _explained(content: dict[str, Any], **why: str) -> dict[str, Any]:
    """The content, with a reason by key for every null in it."""
    reasons = {key: reason for key, reason in why.items() if _has_null(content.get(key, 0))}
    return content | ({"why_null": reasons} if reasons else {})


def _has_null(value: Any) -> bool:
    return any(map(_has_null, value)) if isinstance(value, list) else value is None


def _noise(d: JointTwists, j: int) -> dict[str, Any]:
    """Noise of a joint's readings, where these tell it."""
    c = d.found.cycles
    um, urad = (rounded(1e6 * float(c.noise[j, k])) if c.noise_dof[j, k] > 0 else None for k in (0, 1))
    why = [
        "not read without a standard deviation of its own (sigma_mm, sigma_twist_mrad)" if known else NO_NOISE
        for known in c.noise_known[j]
    ]
    content = {
        "joint": d.given.robot.joint_names[j],
        "um": um,
        "urad": urad,
        "freedoms": c.noise_dof[j].tolist(),
    }
    return _explained(content, um=why[0], urad=why[1])


def _loop(x: Loop) -> dict[str, Any]:
    unit = "um" if x.row.startswith("t") else "urad"
    content = {
        "joint": x.joint,
        "row": x.row,
        f"width_{unit}": rounded(1e6 * x.width),
        f"width_sd_{unit}": rounded(1e6 * x.spread),
        "share_of_range_percent": rounded(100.0 * x.share),
        "proven": x.proven,
        "load_cycles": x.cycles,
        "stiffness_from_loading_only_percent": rounded(100.0 * x.loading_only),
    }
    nothing = "nothing was read to move under the load"
    why = {f"width_sd_{unit}": NO_NOISE, "share_of_range_percent": nothing}
    return _explained(content, **why, stiffness_from_loading_only_percent=nothing)


def _coupling(c: Coupling) -> dict[str, Any]:
    content = {"rows": list(c.rows), "share": rounded(c.share), "p_value": rounded(c.p_value), "proven": c.proven}
    no_scale = "the diagonal entries or the noise are zero to the last digit: nothing to compare with"
    return _explained(content, share=no_scale, p_value=no_scale)


def at_flange(f: AtFlange) -> dict[str, Any]:
    """Gears alone against six stiffnesses, the model file's constants, and intervals of directional stiffness."""
    gears = {
        "same_stiffness": errors(f.same),
        "refitted_to_flange": errors(f.refitted),
        "effective_Nm_per_rad": [None if c == 0.0 else rounded(1.0 / c, 12) for c in f.effective.tolist()],
    }
    half = {a: rounded(100.0 * v) for a, v in zip(AXES, f.spread.tolist(), strict=True)}
    no_interval = "some stiffnesses have no interval, or no upper limit"
    return {
        "gears_only": _explained(gears, effective_Nm_per_rad="forces at the flange centre do not turn this joint"),
        "model_file_constants": errors(f.file),
        "half_interval_percent": _explained(half, **dict.fromkeys(AXES, no_interval)),
    }


def errors(e: Errors) -> dict[str, dict[str, Any]]:
    """Relative errors by flange axis, percent."""
    names = ("bias", "mean", "p95", "worst")
    rigid = "at some poses the model compared is rigid along this axis"
    return {
        a: _explained({n: rounded(100.0 * float(getattr(e, n)[k])) for n in names}, **dict.fromkeys(names, rigid))
        for k, a in enumerate(AXES)
    }


def direction(d: Direction) -> dict[str, Any]:
    """One stiffness: its law, and values with intervals at the angles measured."""
    k, low, high = d.stiffness(d.angle)
    key = f"stiffness_{'N_per_m' if d.is_shift else 'Nm_per_rad'}"
    content = {
        "joint": d.joint,
        "row": d.row,
        "status": d.status,
        "law": None if d.law is None else _law(d.law),
        "left_out_scores": _explained(
            {kind: rounded(score, 12) for kind, score in d.scores.items()},
            **dict.fromkeys(d.scores, "without one of the angles this law does not settle"),
        ),
        "angle_deg": np.degrees(d.angle).tolist(),
        key: [rounded(v) for v in k.tolist()],
        "interval95": [[rounded(a), rounded(b)] for a, b in zip(low.tolist(), high.tolist(), strict=True)],
    }
    no_number = NO_NUMBER.get(d.status, "the law leaves what a number can hold")
    return _explained(content, **{"law": no_number, key: no_number}, interval95=NO_END.get(d.status, NO_UPPER))


def _law(law: Law) -> dict[str, Any]:
    covariance = [[rounded(v, 17) for v in row] for row in law.covariance.tolist()]
    content = {"kind": law.kind, "ln_k_coefficients": law.coefficients.tolist(), "covariance": covariance}
    return _explained(content, covariance=NO_NOISE)


def window(w: Window) -> dict[str, Any]:
    """The map's frame and range."""
    reached = np.isfinite(w.mean)
    return {
        "flange": w.orientation,
        "elbow": w.elbow,
        "x_mm": [1e3 * float(w.x[0]), 1e3 * float(w.x[-1])],
        "z_mm": [1e3 * float(w.z[0]), 1e3 * float(w.z[-1])],
        "reached_percent": 100.0 * float(reached.mean()),
        "mean_stiffness_N_per_mm": [1e-3 * float(np.nanmin(w.mean)), 1e-3 * float(np.nanmax(w.mean))],
    }


def held_out_rows(d: JointTwists) -> list[tuple[str, float, float, float, float]]:
    """Label, force (N), measured and predicted stiffness (N/mm), error (percent)."""
    h = d.held_out
    if h is None:
        return []
    columns = (h.force_N, 1e-3 * h.measured, 1e-3 * h.predicted, 100.0 * h.error)
    return [(label, *map(float, row)) for label, *row in zip(h.labels, *columns, strict=True)]  # type: ignore[misc]


def stiffness_table(d: JointTwists) -> str:
    """CSV: one row a joint, direction and angle."""
    header = ["joint", "row", "status", "law", "angle_deg", "stiffness", "low95", "high95", "unit", "data"]
    rows: list[list[str]] = []
    label = "synthetic" if d.synthetic else d.found.data.source
    for x in d.found.directions.values():
        four = zip(np.degrees(x.angle), *x.stiffness(x.angle), strict=True)
        cells = [["" if not np.isfinite(v) else f"{v:.6g}" for v in values] for values in four]
        kind = x.law.kind if x.law else ""
        rows += [[x.joint, x.row, x.status, kind, *texts, x.unit, label] for texts in cells or [[""] * 4]]
    return rows_text([header, *rows])


def map_table(w: Window) -> str:
    """CSV: one row a point of the map."""
    header = ["x_mm", "z_mm", "kx_N_per_mm", "ky_N_per_mm", "kz_N_per_mm", "mean_N_per_mm"]
    values = np.dstack([w.stiffness, w.mean])
    rows = [
        [f"{1e3 * x:.3f}", f"{1e3 * z:.3f}", *("" if np.isnan(v) else f"{1e-3 * v:.6g}" for v in values[i, j])]
        for i, z in enumerate(w.z)
        for j, x in enumerate(w.x)
    ]
    return rows_text([header, *rows])
