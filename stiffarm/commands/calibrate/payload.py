"""A calibration as JSON and CSV: keys with units, null where there is no number."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from doe.calibration.run import Count as ParameterCount
from doe.certainty.doubts import Doubt
from doe.certainty.lack_of_fit import outliers
from doe.certainty.predictive import Coverage
from doe.certainty.uncertainty import ParameterEstimate
from doe.estimation.noise import Noise, origin
from doe.estimation.problem import Problem
from doe.published.parametric import PoseFit
from doe.tables.columns import DISPLACEMENTS
from doe.tables.joined import files_of
from doe.tables.loaded import rms_mm
from robots.files.csv_text import rows_text
from robots.quantities import rounded
from stiffarm.commands.calibrate import laws as calibration_laws
from stiffarm.commands.calibrate import words
from stiffarm.commands.calibrate.prediction import Holdout
from stiffarm.commands.calibrate.step import Calibrated, StageFindings

QUANTILES = (0.025, 0.5, 0.975)
# A value this close to an end of its range (relative) stands there.
_AT_END = 1e-3


def calibration(c: Calibrated) -> dict[str, Any]:
    """Everything about a calibration."""
    found = c.found
    out: dict[str, Any] = {
        "scheme": c.scheme,
        "title": c.request.campaign.title,
        "robot": c.description.name,
        "load_path": found.model.load_path,
        "links": found.model.link_kind,
        "loads_N": list(c.data.levels_N),
        "readings": len(found.overall),
        "parameters": parameters(c.found.count),
        "rms_mm": rounded(found.rms_mm),
        "left_one_pose_out_rms_mm": rounded(c.left_out_rms_mm),
        "left_out_in_interval95": coverage(c.coverage),
        "left_out_not_predicted": c.skipped,
        "doubts": [doubt(d) for d in c.doubts],
        "remarks": list(c.remarks),
        "poses": poses(c),
        "stages": [stage(s, c.request.campaign.noise.gauge_mm) for s in c.stages],
    }
    if found.stages:
        last = found.stages[-1]
        out["residual_sd_mm"] = rounded(last.estimate.noise.white[0] * 1e3)
        out["degrees_of_freedom"] = len(last.estimate.problem) - int(last.estimate.seen.sum())
        out["springs"] = springs(c)
        out |= {spring_key(joint): one["k_Nm_per_rad"] for joint, one in springs(c).items()}
    if found.studies:
        out["studies"] = {s.stage.name: [pose_fit(fit) for fit in s.fits] for s in found.studies}
        out["laws"] = {joint: law.model_dump(mode="json") for s in found.studies for joint, law in s.laws.items()}
    if c.holdout is not None:
        out["holdout"] = holdout(c.holdout)
    return out


def doubt(d: Doubt) -> dict[str, Any]:
    """One thing that readings say against a calibration: its test, and how many times the expected it is."""
    return {"code": d.code, "words": d.words, "p_value": rounded(d.p_value), "factor": rounded(d.factor, 3)}


def spring_key(joint: str) -> str:
    """``k2_Nm_per_rad`` for joint ``j2``, ``k_waist_Nm_per_rad`` for other names."""
    short = joint.removeprefix("j")
    return f"k{short if short.isdigit() else '_' + joint}_Nm_per_rad"


def springs(c: Calibrated) -> dict[str, Any]:
    """Constant springs with their intervals by joint."""
    return {e.parameter.place: spring(e) for e in c.springs}


def spring(e: ParameterEstimate) -> dict[str, Any]:
    """A constant spring with its interval; no plain number where it stands at a bound or is not determined."""
    out = {
        "k_Nm_per_rad": rounded(e.value) if words.known(e) else None,
        "interval95_Nm_per_rad": [rounded(v) for v in e.interval],
        "status": e.status,
    }
    bound = words.bound_of(e)
    return out | ({} if bound is None else {"bound": bound, "bound_Nm_per_rad": rounded(e.value)})


def coverage(c: Coverage) -> dict[str, Any]:
    """How many readings lie in the 95 % intervals of their predictions; those without an interval do not count."""
    return {"inside": c.inside, "readings": c.readings, "share": rounded(c.share, 4)}


def parameters(n: ParameterCount) -> dict[str, int]:
    """How many parameters were free; of them those at a bound, and those that the readings identify."""
    return {"free": n.free, "at_bound": n.at_bound, "identified": n.identified}


def pose_fit(fit: PoseFit) -> dict[str, Any]:
    """The springs of a level study at one pose."""
    return {
        "pose": fit.pose,
        **{spring_key(joint): rounded(k) for joint, k in zip(fit.joints, fit.stiffness, strict=True)},
        "error_mm": rounded(fit.error_mm),
        "matched_within_gauge": fit.matched,
        "runs": fit.runs,
        "rounds": fit.rounds,
        "equivalent_range_Nm_per_rad": {
            joint: [rounded(a), rounded(b)] for joint, (a, b) in zip(fit.joints, fit.equivalent, strict=True)
        },
        "remarks": list(fit.remarks),
    }


def answer(c: Calibrated) -> dict[str, Any]:
    """What every command says of a calibration: parameters with their intervals, and its errors."""
    return {
        "loads_N": list(c.data.levels_N),
        "readings": len(c.found.overall),
        "parameters": parameters(c.found.count),
        "rms_mm": rounded(c.found.rms_mm),
        "left_one_pose_out_rms_mm": rounded(c.left_out_rms_mm),
        "left_out_in_interval95": coverage(c.coverage),
        "springs": springs(c),
        "numbers": [estimate(e) for s in c.found.stages for e in s.certainty.estimates],
    }


def stage(s: StageFindings, gauge_mm: float) -> dict[str, Any]:
    """One stage: its numbers, noise, tests, outliers and predictions."""
    r, e = s.result, s.result.estimate
    test, (judged, why) = r.lack_of_fit, words.verdict(r, gauge_mm)
    known = ~np.isnan(s.left_out)
    out: dict[str, Any] = {
        "name": r.stage.name,
        "readings": len(e.problem),
        "poses": list(e.problem.poses),
        "rms_mm": rounded(rms_mm(e.residual, e.problem.component)),
        "resumed": r.resumed,
        "settled": e.settled,
        "numbers": [estimate(one) for one in r.certainty.estimates],
        "noise": noise(e.noise, e.problem),
        "noise_in_words": words.setups_text(r, s.independent),
        "told": words.told_and_untold(r.certainty.estimates),
        "trade_offs": [
            {
                "names": list(t.parameters),
                "weights": [rounded(float(w)) for w in t.weights],
                "value": rounded(t.best.value),
                "sd": rounded(t.best.sd),
                "unit": t.best.unit,
                "words": t.words,
            }
            for t in r.trade_offs
        ],
        "unseen": list(r.unseen),
        "singular_values": [rounded(float(v)) for v in r.certainty.singular],
        "condition": rounded(r.certainty.condition),
        "lack_of_fit": {
            "pure_error_mm": rounded(test.pure_error_m * 1e3),
            "pure_degrees_of_freedom": test.pure_dof,
            "F": rounded(test.ratio),
            "degrees_of_freedom": test.fit_dof,
            "p_value": rounded(test.p_value),
        },
        "chi_square": {
            "value": rounded(test.chi_square),
            "degrees_of_freedom": test.chi_dof,
            "p_value": rounded(test.chi_p_value),
        },
        "verdict": judged,
        "verdict_in_words": why,
        "outliers": outlier_rows(s),
        "left_one_pose_out_rms_mm": rounded(rms_mm(s.left_out[known], e.problem.component[known])),
        "left_out_not_predicted": s.skipped,
    }
    if r.laws:
        out["laws"] = [calibration_laws.payload(curve) for curve in calibration_laws.curves(r)]
    if r.study is not None:
        out["study"] = {
            "runs": r.study.runs,
            "rounds": r.study.rounds,
            "first_rms": rounded(r.study.first_rms),
            "rms": rounded(r.study.rms),
            "at_bound": list(r.study.at_bound),
        }
    if s.drawn is not None:
        out["bootstrap"] = bootstrap(s)
    return out


def estimate(e: ParameterEstimate) -> dict[str, Any]:
    """A parameter; its value is null where it stands at a bound or is not identified."""
    p, bound = e.parameter, words.bound_of(e)
    out = {
        "name": p.name,
        "value": rounded(e.value) if words.known(e) else None,
        "unit": p.unit,
        "interval95": [rounded(v) for v in e.interval],
        "status": e.status,
        "variable": {"compliance": "1/value", "log": "ln value", "linear": "value"}[p.scale],
        "sd_of_variable": rounded(e.sd),
        "degrees_of_freedom": rounded(e.degrees_of_freedom),
        "range": [rounded(p.lower), rounded(p.upper)],
        "before": rounded(p.value),
        "prior": None if p.prior is None else {"mean": rounded(p.prior[0]), "sd": rounded(p.prior[1])},
    }
    return out | ({} if bound is None else {"bound": bound})


def noise(found: Noise, p: Problem) -> dict[str, Any]:
    """Standard deviations found; null for what was not read; ``source``: "given", told by "repeats", or "residual"."""
    read = [(p.component < 3).any(), (p.component >= 3).any()]
    sizes = {
        "reading_mm": (found.white[0] * 1e3, read[0]),
        "reading_mrad": (found.white[1] * 1e3, read[1]),
        "reading_share": (found.share, True),
        "set_up_mm": (found.pose[0] * 1e3, read[0]),
        "set_up_mrad": (found.pose[1] * 1e3, read[1]),
        "set_up_share": (found.pose_share, True),
    }
    found_sizes = {name: rounded(float(v)) if there else None for name, (v, there) in sizes.items()}
    return found_sizes | noise_structure(found) | {"source": origin(p)}


def noise_structure(found: Noise) -> dict[str, Any]:
    """What readings' own scatter depends on beside white noise, with sizes; no ``tail`` unless heavier than normal."""
    return {
        "structure": found.structure,
        "reading_vector_share": rounded(found.vector),
        "reading_mm_per_kN": rounded(found.load[0] * 1e6),
        "reading_mrad_per_kN": rounded(found.load[1] * 1e6),
        "reading_axes_mm_mrad": [rounded(1e3 * math.hypot(found.white[k // 3], v)) for k, v in enumerate(found.axes)]
        if any(found.axes)
        else None,
        "tail_degrees_of_freedom": rounded(found.tail) if found.tail else None,
    }


def outlier_rows(s: StageFindings) -> list[dict[str, Any]]:
    """Readings that stand out, farthest first."""
    e, files = s.result.estimate, files_of(s.read)
    p = e.problem
    return [
        {
            **({} if files is None else {"file": files[p.row[k]]}),
            "line": s.read.row_numbers[p.row[k]],
            "pose": p.poses[p.pose[k]],
            "component": DISPLACEMENTS[p.component[k]],
            "load_N": rounded(float(s.loads_N[k])),
            "measured": rounded(float(p.value[k]) * 1e3),
            "predicted": rounded(float(e.prediction[k]) * 1e3),
            "own_standard_deviations": rounded(float(e.own[k]), 3),
            "weight": rounded(float(e.weight[k]), 3),
        }
        for k in outliers(e)
    ]


def bootstrap(s: StageFindings) -> dict[str, Any]:
    """Quantiles over poses drawn with replacement; null where they stand at an end of the range."""
    assert s.drawn is not None  # noqa: S101 - only called with draws
    told = ~np.isnan(s.drawn).any(axis=1)
    out: dict[str, Any] = {"draws": len(s.drawn), "draws_that_tell": int(told.sum()), "quantiles": list(QUANTILES)}
    for k, e in enumerate(s.result.certainty.estimates):
        p, values = e.parameter, s.drawn[told, k]
        if not values.size or e.status == "not identified":
            out[p.name] = None
            continue
        span = p.upper - p.lower if p.scale == "linear" else 0.0
        low, high = (p.lower + _AT_END * (span or p.lower), p.upper - _AT_END * (span or p.upper))
        at_end = (values <= low) | (values >= high)
        # Nearest draw, not between two: half way to a rigid joint is no stiffness.
        quantiles = np.quantile(values, QUANTILES, method="nearest")
        out[p.name] = {
            "values": [rounded(float(v)) if low < v < high else None for v in quantiles],
            "share_at_bound": rounded(float(at_end.mean()), 3),
        }
    return out


def holdout(h: Holdout) -> dict[str, Any]:
    """Predictions of readings kept out of the calibration."""
    p = h.system
    rows = {}
    for k, label in enumerate(p.poses):
        mine = (p.pose == k) & ~np.isnan(h.error)
        shift = mine & (p.component < 3)
        rows[label] = {
            "rms_mm": rounded(rms_mm(h.error[mine], p.component[mine])),
            "noise_mm": rounded(float(np.sqrt(np.mean(h.expected[shift] ** 2))) * 1e3) if shift.any() else None,
        }
    return {
        "data": h.data.source,
        "data_sha256": h.data.sha256,
        "readings": len(p),
        "rms_mm": rounded(h.rms_mm),
        "in_interval95": coverage(h.coverage),
        "poses": rows,
        "not_predicted": h.blind,
    }


def poses(c: Calibrated) -> list[dict[str, Any]]:
    """Every component read, as simulated, and by a calibration that has not seen its pose."""
    p, files = c.found.overall, files_of(c.data)
    return [
        {
            **({} if files is None else {"file": files[p.row[i]]}),
            "line": int(c.data.row_numbers[p.row[i]]),
            "pose": p.poses[p.pose[i]],
            "component": DISPLACEMENTS[p.component[i]],
            "measured": rounded(float(p.value[i]) * 1e3),
            "simulated": rounded(float(c.predicted_mm[i])),
            # Simulated minus measured, as in the staged scheme.
            "left_out_error": rounded(-float(c.left_out[i]) * 1e3),
            "left_out_half_width95": rounded(float(c.left_out_half95[i]) * 1e3),
        }
        for i in range(len(p))
    ]


def parameters_csv(c: Calibrated) -> str:
    """Every parameter of every stage, a row each; empty cells where there is no number."""
    names = ("stage", "name", "value", "unit", "low95", "high95", "status", "bound")
    rows: list[list[object]] = [[*names]]
    for s in c.stages:
        for e in s.result.certainty.estimates:
            one = estimate(e)
            cells = [one["value"], one["unit"], *one["interval95"], one["status"], one.get("bound")]
            rows.append([s.result.stage.name, one["name"], *cells])
    return rows_text(rows)
