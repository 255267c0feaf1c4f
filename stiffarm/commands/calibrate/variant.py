"""A calibrated variant as JSON-ready dictionaries (keys with units, null where there is no number) and as a table."""

from __future__ import annotations

from typing import Any

import numpy as np

from doe import SpringEstimate
from stiffarm.session.console import say, show_table
from stiffarm.session.json_text import number
from stiffarm.session.spring_words import bound_of
from stiffarm.session.steps import Variant


def spring_key(joint: str) -> str:
    """``k2_Nm_per_rad`` for joint ``j2``, ``k_waist_Nm_per_rad`` for other names."""
    short = joint.removeprefix("j")
    return f"k{short if short.isdigit() else '_' + joint}_Nm_per_rad"


def estimate(spring: SpringEstimate) -> dict[str, Any]:
    """A constant spring with its interval; no plain number where it stands at a bound or is not determined."""
    known = spring.status in ("determined", "one-sided")
    out = {
        "k_Nm_per_rad": number(spring.stiffness) if known else None,
        "interval95_Nm_per_rad": [number(v) for v in spring.interval],
        "status": spring.status,
    }
    bound = bound_of(spring)
    return out | ({} if bound is None else {"bound": bound, "bound_Nm_per_rad": number(spring.stiffness)})


def payload(result: Variant) -> dict[str, Any]:
    """A calibrated variant."""
    out: dict[str, Any] = {
        "scheme": result.scheme,
        "robot": result.description.name,
        "load_path": result.model.load_path,
        "links": result.model.link_kind,
        "readings": len(result.system),
        "parameters": result.parameters,
        "rms_mm": number(result.rms_mm),
        "left_one_pose_out_rms_mm": number(result.left_out.rms_mm),
        "left_out_not_predicted": result.left_out.skipped,
        "remarks": list(result.remarks),
        "poses": poses(result),
    }
    if result.constant is not None:
        out["residual_sd_mm"] = number(result.constant.sigma_m * 1e3)
        out["degrees_of_freedom"] = result.constant.degrees_of_freedom
        out["springs"] = {s.joint: estimate(s) for s in result.constant.springs}
        out |= {spring_key(s.joint): estimate(s)["k_Nm_per_rad"] for s in result.constant.springs}
    if result.staged is not None:
        out["stages"] = {name: [_pose_fit(fit) for fit in fits] for name, fits in result.staged.fits.items()}
        out["laws"] = {joint: law.model_dump(mode="json") for joint, law in result.staged.laws.items()}
    return out


def poses(result: Variant) -> list[dict[str, Any]]:
    """Every reading as measured, as simulated, and its error where its pose is left out."""
    names = ("dx_mm", "dy_mm", "dz_mm", "rx_mrad", "ry_mrad", "rz_mrad")
    return [
        {
            "pose": result.system.pose[i],
            "component": names[result.system.component[i]],
            "measured": number(result.system.value[i] * 1e3),
            "simulated": number(result.predicted_mm[i]),
            "left_out_error": number(result.left_out.error_m[i] * 1e3),
        }
        for i in range(len(result.system))
    ]


def _pose_fit(fit: Any) -> dict[str, Any]:
    return {
        "pose": fit.pose,
        **{spring_key(joint): number(k) for joint, k in zip(fit.joints, fit.stiffness, strict=True)},
        "error_mm": number(fit.error_mm),
        "matched_within_gauge": fit.matched,
        "runs": fit.runs,
        "rounds": fit.rounds,
        "equivalent_range_Nm_per_rad": {
            joint: [number(a), number(b)] for joint, (a, b) in zip(fit.joints, fit.equivalent, strict=True)
        },
        "remarks": list(fit.remarks),
    }


def show(result: Variant) -> None:
    """A calibrated variant: springs or stages, remarks and how good it is."""
    if result.constant is not None:
        show_table(
            f"Constant springs, {result.model.load_path} load path",
            ["joint", "k (N m/rad)", "95 % interval", "status"],
            [
                [
                    s.joint,
                    f"{s.stiffness:.3g}" if s.status in ("determined", "one-sided") else "-",
                    _interval(s.interval),
                    s.status,
                ]
                for s in result.constant.springs
            ],
        )
    if result.staged is not None:
        show_table(
            f"Staged scheme, {result.model.load_path} load path",
            ["stage", "pose", "springs (N m/rad)", "error (mm)", "runs"],
            [
                [
                    stage,
                    fit.pose,
                    ", ".join(f"{j} {k:.3g}" for j, k in zip(fit.joints, fit.stiffness, strict=True)),
                    f"{fit.error_mm:+.3f}",
                    str(fit.runs),
                ]
                for stage, fits in result.staged.fits.items()
                for fit in fits
            ],
        )
    for remark in result.remarks:
        say(f"note: {remark}")
    say(
        f"RMS {result.rms_mm:.3f} mm on {len(result.system)} readings with {result.parameters} parameters; "
        f"poses left out one at a time are predicted to {result.left_out.rms_mm:.3f} mm RMS"
    )


def _interval(interval: tuple[float, float]) -> str:
    low, high = interval
    if np.isnan(low):
        return "-"
    return f">= {low:.3g}" if np.isinf(high) else f"{low:.3g} to {high:.3g}"
