"""An identification of joint twists as JSON and CSV: keys with units, null where there is no number."""

from __future__ import annotations

import csv
import io
from typing import Any

import numpy as np

from doe.joint_twists import Direction
from doe.joint_twists.model_file import held_constant, rms_mm
from doe.joint_twists.substitute import Errors
from doe.joint_twists.workspace import Window
from stiffarm.joint_twist_run import AtFlange, JointTwists
from stiffarm.payloads import number

SCHEMA = "stiffarm-joint-twists/1"
AXES = ("x", "y", "z")


def identification(d: JointTwists) -> dict[str, Any]:
    """Everything about an identification."""
    found, data = d.found, d.found.data
    return {
        "schema": SCHEMA,
        "robot": found.robot,
        "synthetic": data.synthetic,
        "data": data.source,
        "data_sha256": data.sha256,
        "readings": data.n,
        "load_cycles": found.cycles.m,
        "set_ups": len(found.cycles.setups),
        "branches": found.branches,
        "stiffnesses": [direction(x, k // 6, data.q.shape[1]) for k, x in enumerate(found.directions.values())],
        "noise": [
            {"joint": name, "um": number(1e6 * a), "urad": number(1e6 * b), "freedoms": dof.tolist()}
            for name, (a, b), dof in zip(
                d.given.robot.joint_names, found.cycles.noise, found.cycles.noise_dof, strict=True
            )
        ],
        "scatter_of_set_ups_percent": {
            kind: {"value": 100.0 * s, "freedoms": n}
            for kind, s, n in zip(("translations", "rotations"), found.scatter, found.scatter_dof, strict=True)
        },
        "left_over_rms_mm": rms_mm(found),
        "hysteresis": [
            {
                "joint": x.joint, "row": x.row, f"width_{_small(x.row)}": number(1e6 * x.width),
                f"width_sd_{_small(x.row)}": number(1e6 * x.spread), "share_of_range_percent": number(100.0 * x.share),
                "proven": x.proven, "load_cycles": x.cycles,
                "stiffness_from_loading_only_percent": number(100.0 * x.loading_only),
            }
            for x in d.loops
        ],
        "diagonal": [
            {
                "joint": t.joint, "suffices": t.suffices,
                "couplings": [
                    {"rows": list(c.rows), "share": number(c.share), "p_value": number(c.p_value), "proven": c.proven}
                    for c in sorted(t.couplings, key=lambda c: c.p_value)
                ],
            }
            for t in d.diagonal
        ],
        "twist_ratio": None if d.bending is None else {
            "joint": d.bending.joint, "rx_over_rz": number(d.bending.ratio),
            "interval95": [number(d.bending.low), number(d.bending.high)],
        },
        "at_flange": None if d.flange is None else at_flange(d.flange),
        "why_not_at_flange": d.no_flange or None,
        "map": None if d.window is None else window(d.window),
        "held_out": None if d.held_out is None else [
            dict(zip(("pose", "force_N", "measured_N_per_mm", "predicted_N_per_mm", "error_percent"), row, strict=True))
            for row in held_out_rows(d)
        ],
        "notes": [*data.notes, *found.notes, *held_constant(found)],
    }  # fmt: skip


def _small(row: str) -> str:
    return "um" if row.startswith("t") else "urad"


def at_flange(f: AtFlange) -> dict[str, Any]:
    """Gears alone against six stiffnesses, the model file's constants, and intervals of directional stiffness."""
    return {
        "gears_only": {
            "same_stiffness": errors(f.same),
            "refitted_to_flange": errors(f.refitted),
            "effective_Nm_per_rad": [None if c == 0.0 else 1.0 / c for c in f.effective.tolist()],
        },
        "model_file_constants": errors(f.file),
        "half_interval_percent": {a: number(100.0 * v) for a, v in zip(AXES, f.spread.tolist(), strict=True)},
    }


def errors(e: Errors) -> dict[str, dict[str, Any]]:
    """Relative errors by flange axis, percent."""
    return {
        a: {name: number(100.0 * float(getattr(e, name)[k])) for name in ("bias", "mean", "p95", "worst")}
        for k, a in enumerate(AXES)
    }


def direction(d: Direction, column: int, dof: int) -> dict[str, Any]:
    """One stiffness: its law, and values with intervals at the angles measured."""
    q = np.zeros((len(d.angle), dof))
    q[:, column] = d.angle
    k, low, high = d.stiffness(q)
    unit = "N_per_m" if d.row.startswith("t") else "Nm_per_rad"
    return {
        "joint": d.joint, "row": d.row, "status": d.status,
        "law": None if d.law is None else {
            "kind": d.law.kind, "ln_k_coefficients": d.law.spring.coefficients.tolist(),
            "covariance": d.law.covariance.tolist(),
        },
        "left_out_scores": dict(d.scores),
        "angle_deg": np.degrees(d.angle).tolist(),
        f"stiffness_{unit}": [number(v) for v in k.tolist()],
        "interval95": [[number(a), number(b)] for a, b in zip(low.tolist(), high.tolist(), strict=True)],
    }  # fmt: skip


def window(w: Window) -> dict[str, Any]:
    """The map's frame and range."""
    reached = np.isfinite(w.mean)
    return {
        "flange": w.orientation, "elbow": w.elbow,
        "x_mm": [1e3 * float(w.x[0]), 1e3 * float(w.x[-1])], "z_mm": [1e3 * float(w.z[0]), 1e3 * float(w.z[-1])],
        "reached_percent": 100.0 * float(reached.mean()),
        "mean_stiffness_N_per_mm": [1e-3 * float(np.nanmin(w.mean)), 1e-3 * float(np.nanmax(w.mean))],
    }  # fmt: skip


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
    for k, x in enumerate(d.found.directions.values()):
        q = np.zeros((max(len(x.angle), 1), d.given.robot.dof))
        q[: len(x.angle), k // 6] = x.angle
        kind = x.law.kind if x.law else ""
        if not len(x.angle):
            rows.append([x.joint, x.row, x.status, kind, "", "", "", "", x.unit, label])
            continue
        for angle, *values in zip(np.degrees(x.angle), *x.stiffness(q), strict=True):
            cells = ["" if not np.isfinite(v) else f"{v:.6g}" for v in values]
            rows.append([x.joint, x.row, x.status, kind, f"{angle:.6g}", *cells, x.unit, label])
    return _csv(header, rows)


def map_table(w: Window) -> str:
    """CSV: one row a point of the map."""
    header = ["x_mm", "z_mm", "kx_N_per_mm", "ky_N_per_mm", "kz_N_per_mm", "mean_N_per_mm"]
    rows = []
    for i, z in enumerate(w.z):
        for j, x in enumerate(w.x):
            values = [*w.stiffness[i, j], w.mean[i, j]]
            rows.append(
                [f"{1e3 * x:.3f}", f"{1e3 * z:.3f}", *("" if np.isnan(v) else f"{1e-3 * v:.6g}" for v in values)]
            )
    return _csv(header, rows)


def _csv(header: list[str], rows: list[list[str]]) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return stream.getvalue()
