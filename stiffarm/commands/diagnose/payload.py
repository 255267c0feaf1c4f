"""A diagnosis as JSON: keys with units, null where there is no number."""

from __future__ import annotations

from typing import Any

import numpy as np

from doe.diagnosis.checks import Check
from doe.diagnosis.diagnose import Found, Rejected, State
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Hypothesis, Ranking
from doe.diagnosis.where import Group, least_rms_mm, noise_floor_mm
from doe.estimation.noise import origin
from doe.tables.columns import DISPLACEMENTS
from doe.tables.joined import files_of
from fem.effects.learned import axes_of, learned_place
from robots.quantities import rounded
from stiffarm.commands.calibrate import payload as calibration_payload
from stiffarm.commands.diagnose.effect_numbers import Number, numbers_of
from stiffarm.commands.diagnose.model import springs_of
from stiffarm.commands.diagnose.next_words import advice
from stiffarm.commands.diagnose.step import Diagnosed

SCHEMA = "stiffarm-diagnosis/1"
LEFT_OUT, NESTED = "leave-one-pose-out", "nested folds"
# Of each look so many candidates are listed.
LISTED = 8


def diagnosis(d: Diagnosed) -> dict[str, Any]:
    """Everything about a diagnosis; of readings that tell nothing no candidates, looks and springs."""
    found = d.found
    return {
        "schema": SCHEMA,
        "robot": d.given.robot.name,
        "load_path": d.given.model.load_path,
        "links": d.given.model.link_kind,
        "data": d.used.source,
        "data_sha256": d.used.sha256,
        "loads_N": list(d.used.levels_N),
        "readings": len(found.before.setting.data),
        "poses": len(found.before.setting.data.poses),
        "free_joints": list(found.before.setting.free),
        "verdict": found.verdict,
        "reason": found.reason,
        "effects": [effect(d, f) for f in found.effects],
        "learned": [
            effect(d, f) | {"place": learned_place(f.code), "axes": list(axes_of(f.code))} for f in found.learned
        ],
        "unknown_axis": found.ranking.of(UNKNOWN).axis or None,
        "unknown_place": None if found.suspect is None else learned_place(found.suspect.code),
        "provisional": [effect(d, f) for f in found.provisional],
        "rejected": rejected(found.rejected),
        "stated_probability": rounded(found.stated),
        "checks": [check(c) for c in found.checks],
        "candidates": [candidate(h) for h in found.ranking.hypotheses if d.tells],
        "set95": list(d.credible),
        "twins": {code: list(others) for code, others in d.twins.items()},
        "still_open": {code: list(others) for code, others in d.still_open.items()},
        "not_testable": dict(sorted(d.not_testable.items())),
        "where": {kind: [group(g, kind) for g in groups] for kind, groups in d.where.items()},
        "gap": gap(d),
        "next": next_step(d),
        "next_readings": next_readings(d),
        "next_expected": expected(d),
        "looks": [look(d, k) for k in range(len(found.rankings)) if d.tells],
        "calibration": None if d.calibrated is None else calibration_payload.answer(d.calibrated),
        "springs": {s.parameter.place: calibration_payload.spring(s) for s in springs_of(d) if d.tells},
        "noise": noise(found.after),
        "odd_readings": [odd_reading(d, k) for k in d.odd],
        "doubts": [calibration_payload.doubt(doubt) for doubt in d.doubts],
        "remarks": list(d.remarks),
    }


def effect(d: Diagnosed, f: Found) -> dict[str, Any]:
    """An effect of the new model with its numbers."""
    mine = [n for n in numbers_of(d.found.after) if n.code == f.code]
    return {
        "code": f.code,
        "words": f.placed.effect.words,
        "probability": rounded(f.probability),
        "log_evidence_gain": rounded(f.log_gain),
        "parameters": {n.name: parameter(n) for n in mine},
    }


def rejected(r: Rejected | None) -> dict[str, Any] | None:
    """Effects that are not in the model because poses not seen get worse with them; mm."""
    if r is None:
        return None
    return {"effects": list(r.codes), "before_rms_mm": rounded(r.before_mm), "after_rms_mm": rounded(r.after_mm)}


def parameter(n: Number) -> dict[str, Any]:
    """A number of an effect; ``sd`` is null where it was chosen among values tried."""
    return {
        "value": rounded(n.value),
        "sd": None if n.sd is None else rounded(n.sd),
        "unit": n.unit,
        "interval95": None if n.low is None or n.high is None else [rounded(n.low), rounded(n.high)],
        "plausible": [rounded(v) for v in n.plausible],
    }


def check(c: Check) -> dict[str, Any]:
    """A check after the name; ``effect`` is null where it is of all that was found, ``passed`` where it applies not."""
    return {
        "code": c.code,
        "effect": c.effect or None,
        "passed": c.passed,
        "evidence": c.evidence,
        "factor": rounded(c.factor),
    }


def candidate(h: Hypothesis) -> dict[str, Any]:
    """One line of the ranking; ``kind`` tells effects from "none" (nothing missing) and "unknown"."""
    return {
        "code": h.code,
        "kind": h.code if h.code in (NONE, UNKNOWN) else "effect",
        "probability": rounded(h.probability),
        "log_evidence": rounded(h.log_evidence),
        "bic": rounded(h.bic),
        "lopo_rms_mm": rounded(h.lopo_rms_mm),
    }


def group(g: Group, kind: str) -> dict[str, Any]:
    """Readings of one pose, load, direction or phase; ``share`` is null where nothing is beyond the noise.

    ``share_sd``: its standard deviation by what springs and effects are uncertain by.
    """
    return {
        kind: g.label,
        "readings": g.readings,
        "share": rounded(g.share, 4),
        "share_sd": rounded(g.share_sd, 2),
        "mean_square": rounded(g.mean_square, 4),
        "mean_residual_mm": rounded(g.mean * 1e3, 4),
    }


def gap(d: Diagnosed) -> dict[str, Any]:
    """How far off the model is before and after, on its own readings and on others; mm.

    The noise floor is that of the best explanation: the model before takes what is missing for noise.
    """
    h, n = d.held_out, d.nested
    by = LEFT_OUT if n is None else NESTED
    out: dict[str, Any] = {"held_out_by": by if h is None else h.data.source}
    states = {"before": d.found.before, "after": d.found.after}
    for (name, state), far in zip(states.items(), d.unseen_rms_mm, strict=True):
        out[name] = {
            "fit_rms_mm": rounded(state.fit_rms_mm),
            "holdout_rms_mm": rounded(far),
            "noise_floor_mm": rounded(noise_floor_mm(d.found)),
            "left_one_pose_out_rms_mm": rounded(state.left_out_rms_mm),
        }
    out["before"]["least_rms_of_any_springs_mm"] = rounded(least_rms_mm(d.found))
    out["nested"] = n and {
        "folds": n.folds,
        "seed": d.request.seed,
        "before_rms_mm": rounded(n.rms_before_mm),
        "after_rms_mm": rounded(n.rms_after_mm),
        "effects": [list(codes) for codes in n.found],
    }
    if h is not None:
        out |= {"holdout_sha256": h.data.sha256, "holdout_readings": len(h.before), "holdout_remarks": list(h.remarks)}
    return out


def next_step(d: Diagnosed) -> dict[str, Any]:
    """What to do next; ``chance`` that the set-ups bring it, null without any; ``measure``: whether it is worth it."""
    a = advice(d)
    return {"advice": a.text, "chance": None if a.chance is None else rounded(a.chance, 3), "measure": a.measure}


def next_readings(d: Diagnosed) -> list[dict[str, Any]]:
    """What to measure next, a set-up each; empty where nothing is left to be settled."""
    n = d.proposal
    if n is None:
        return []
    return [
        {
            "pose": label,
            **{c: rounded(float(v), 9) for c, v in zip(d.given.robot.coordinates, np.degrees(q), strict=True)},
            "load_direction": [rounded(float(v)) for v in way],
            "loads_N": [rounded(float(v)) for v in n.protocol.forces],
            "unloading": n.protocol.unloading,
            "repeats": n.protocol.repeats,
            "read": list(n.protocol.columns),
        }
        for label, q, way in zip(n.labels, n.q, n.direction, strict=True)
    ]


def expected(d: Diagnosed) -> dict[str, Any] | None:
    """What the next readings are expected to tell: probabilities and chances by the rivals that are left."""
    n = d.proposal
    if n is None:
        return {"why_none": d.nothing_next} if d.nothing_next else None
    return {
        "probability_now": rounded(n.before.belief, 3),
        "probability_after": rounded(n.expected.belief, 3),
        "chance_right": rounded(n.expected.right, 3),
        "chance_wrong": rounded(n.expected.wrong, 3),
        "chance_open": rounded(n.expected.open, 3),
        "by_rivals_alone": {
            "probability_after": rounded(n.after.belief, 3),
            "chance_right": rounded(n.after.right, 3),
            "chance_wrong": rounded(n.after.wrong, 3),
            "chance_open": rounded(n.after.open, 3),
        },
        "rivals": [
            {
                "code": r.code,
                "probability": rounded(r.probability),
                "hidden_so_far": r.hidden,
                "log_evidence_against_none": rounded(r.against_none, 3),
                "chance_right": rounded(r.after.right, 3),
            }
            for r in n.rivals
        ],
        "words": list(n.words),
    }


def look(d: Diagnosed, k: int) -> dict[str, Any]:
    """One look at the readings: what was taken as given, what the ranking said, what was decided."""
    found: Ranking = d.found.rankings[k]
    decision = d.found.decisions[k]
    return {
        "decision": decision.kind,
        "reason": decision.reason,
        "hypothesis": None if decision.hypothesis is None else decision.hypothesis.code,
        "candidates": [candidate(h) for h in found.hypotheses[:LISTED]],
    }


def odd_reading(d: Diagnosed, k: int) -> dict[str, Any]:
    """A reading that hardly counts; ``line``: of its file."""
    p, files = d.found.before.setting.data, files_of(d.used)
    row = int(p.row[k])
    return {
        **({} if files is None else {"file": files[row]}),
        "line": d.used.row_numbers[row],
        "pose": p.poses[p.pose[k]],
        "component": DISPLACEMENTS[p.component[k]],
        "load_N": rounded(float(d.used.loads_N[row])),
        "weight": rounded(float(d.found.weight[k]), 3),
    }


def noise(state: State) -> dict[str, Any]:
    """Scatter that the best explanation leaves: of readings, and between set-ups; without repeats its residual."""
    n = state.refit.noise
    return {
        "reading_mm": rounded(n.white[0] * 1e3),
        "reading_share": rounded(n.share),
        "set_up_mm": rounded(n.pose[0] * 1e3),
        "set_up_share": rounded(n.pose_share),
        **calibration_payload.noise_structure(n),
        "source": origin(state.setting.data),
    }
