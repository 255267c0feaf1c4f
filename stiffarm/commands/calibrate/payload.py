"""A calibration as JSON beside its tables: keys with units, null where there is no number."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from doe.calibration.laws import LawCurve, curves
from doe.calibration.prediction import Holdout
from doe.certainty.doubts import Doubt
from doe.certainty.predictive import Coverage
from doe.certainty.uncertainty import ParameterEstimate
from doe.estimation.noise import Noise, origin
from doe.estimation.problem import Problem
from doe.tables.loaded import rms_mm
from robots.quantities import rounded, rounded_all
from stiffarm.commands.calibrate import tables, words
from stiffarm.commands.calibrate.step import Calibrated, StageFindings


def facts(c: Calibrated) -> dict[str, Any]:
    """What its tables and single numbers do not hold."""
    found = c.found
    out = {
        "scheme": c.scheme,
        "title": c.request.campaign.title,
        "robot": c.description.name,
        "load_path": found.model.load_path,
        "links": found.model.link_kind,
        "loads_N": list(c.data.levels_N),
        "readings": len(found.overall),
        "count": asdict(found.count),
        "left_out_in_interval95": coverage(c.coverage),
        "left_out_not_predicted": c.skipped,
        "doubts": [doubt(d) for d in c.doubts],
        "stages": [stage(s, c.request.campaign.noise.gauge_mm) for s in c.stages],
    }
    if found.stages:
        last = found.stages[-1].estimate
        out |= {"degrees_of_freedom": len(last.problem) - int(last.seen.sum()), "springs": springs(c)}
    if found.studies:
        out["laws"] = {joint: law.model_dump(mode="json") for s in found.studies for joint, law in s.laws.items()}
    if c.holdout is not None:
        out["holdout"] = holdout(c.holdout)
    return out


def calibration(c: Calibrated) -> dict[str, Any]:
    """All of it, tables and single numbers included."""
    numbers = {quantity.column: quantity.stored_value(one.value) for quantity, one in tables.numbers_of(c).items()}
    return facts(c) | numbers | {one.name: one.rows() for one in tables.tables_of(c)}


def doubt(d: Doubt) -> dict[str, Any]:
    """One thing that readings say against a calibration: its test, and how many times the expected it is."""
    return {"code": d.code, "words": d.words, "p_value": rounded(d.p_value), "factor": rounded(d.factor, 3)}


def springs(c: Calibrated) -> dict[str, Any]:
    """Constant springs with their intervals by joint."""
    return {e.parameter.place: spring(e) for e in c.springs}


def spring(e: ParameterEstimate) -> dict[str, Any]:
    """A constant spring with its interval; no plain number where it stands at a bound or is not determined."""
    out = {
        "k_Nm_per_rad": rounded(e.value) if words.known(e) else None,
        "interval95_Nm_per_rad": rounded_all(e.interval),
        "status": e.status,
    }
    bound = words.bound_of(e)
    return out | ({} if bound is None else {"bound": bound, "bound_Nm_per_rad": rounded(e.value)})


def coverage(c: Coverage) -> dict[str, Any]:
    """How many readings lie in the 95 % intervals of their predictions; those without an interval do not count."""
    return {"inside": c.inside, "readings": c.readings, "share": rounded(c.share, 4)}


def answer(c: Calibrated) -> dict[str, Any]:
    """What every command says of a calibration: parameters with their intervals, and its errors."""
    return {
        "loads_N": list(c.data.levels_N),
        "readings": len(c.found.overall),
        "count": asdict(c.found.count),
        "rms_mm": rounded(c.found.rms_mm),
        "left_one_pose_out_rms_mm": rounded(c.left_out_rms_mm),
        "left_out_in_interval95": coverage(c.coverage),
        "springs": springs(c),
        "parameters": tables.parameters(c).rows(),
    }


def stage(s: StageFindings, gauge_mm: float) -> dict[str, Any]:
    """One stage: its noise, tests and predictions."""
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
        "noise": noise(e.noise, e.problem),
        "noise_in_words": words.setups_text(r, s.independent),
        "identified": words.identified_text(r.certainty.estimates),
        "trade_offs": [
            {
                "names": list(t.parameters),
                "weights": rounded_all(t.weights),
                "value": rounded(t.best.value),
                "sd": rounded(t.best.sd),
                "unit": t.best.unit,
                "words": t.words,
            }
            for t in r.trade_offs
        ],
        "unseen": list(r.unseen),
        "singular_values": rounded_all(r.certainty.singular),
        "condition": rounded(r.certainty.condition),
        "lack_of_fit": {
            "pure_error_mm": tables.RMS.stored_value(test.pure_error_m),
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
        "left_one_pose_out_rms_mm": rounded(rms_mm(s.left_out[known], e.problem.component[known])),
        "left_out_not_predicted": s.skipped,
    }
    if r.laws:
        out["laws"] = [law(curve) for curve in curves(r)]
    if r.study is not None:
        study = {key: getattr(r.study, key) for key in ("runs", "rounds")}
        errors = {key: rounded(getattr(r.study, key)) for key in ("first_rms", "rms")}
        out["study"] = study | errors | {"at_bound": list(r.study.at_bound)}
    return out


def law(curve: LawCurve) -> dict[str, Any]:
    """A law: the spring at the angles read, null where it is not determined."""
    rows = zip(curve.read_deg[:, 0], curve.read.stiffness, curve.read.low, curve.read.high, strict=True)
    angle = f"{curve.inputs[0].removesuffix('_deg')}_deg"
    return {
        "joint": curve.joint,
        "law": curve.kind,
        "inputs": list(curve.inputs),
        "at_the_angles_read": [
            {angle: rounded(a), "k_Nm_per_rad": rounded(k), "interval95": rounded_all(ends)} for a, k, *ends in rows
        ],
    }


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
    axes = [1e3 * math.hypot(found.white[k // 3], v) for k, v in enumerate(found.axes)]
    return {
        "structure": found.structure,
        "reading_vector_share": rounded(found.vector),
        "reading_mm_per_kN": rounded(found.load[0] * 1e6),
        "reading_mrad_per_kN": rounded(found.load[1] * 1e6),
        "reading_axes_mm_mrad": rounded_all(axes) if any(found.axes) else None,
        "tail_degrees_of_freedom": rounded(found.tail) if found.tail else None,
    }


def holdout(h: Holdout) -> dict[str, Any]:
    """Predictions of readings kept out of the calibration."""
    return {
        "data": h.data.source,
        "data_sha256": h.data.sha256,
        "readings": len(h.system),
        "rms_mm": rounded(h.rms_mm),
        "in_interval95": coverage(h.coverage),
        "not_predicted": h.blind,
    }
