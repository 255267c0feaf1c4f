"""What is missing by positions, as JSON: keys with units, null where there is no number."""

from __future__ import annotations

from typing import Any

from doe.absolute.identified import findings
from doe.absolute.missing.diagnose import FoundEffect, Look, Missing
from doe.absolute.missing.evidence import NONE, UNKNOWN
from fem.arm import Arm
from robots.quantities import rounded
from stiffarm.commands.calibrate.positions import parameters_table, predicted

SCHEMA = "stiffarm-positions-diagnosis/1"
# Lines of each look that are written.
LINES = 12


def missing(given: Arm, m: Missing) -> dict[str, Any]:
    """Everything about it."""
    before, after = m.left_out_rms()
    out: dict[str, Any] = {
        "schema": SCHEMA,
        "robot": given.description.name,
        "readings": len(m.after.data),
        "verdict": m.verdict,
        "reason": m.reason,
        "effects": [effect(m, one, sure=True) for one in m.effects],
        "provisional": [effect(m, one, sure=False) for one in m.provisional],
        "left_out_rms_before_mm": rounded(1e3 * before),
        "left_out_rms_after_mm": rounded(1e3 * after),
        "scatter_sd_before_mm": rounded(1e3 * m.before.variances.sigma),
        "scatter_sd_after_mm": rounded(1e3 * m.after.variances.sigma),
        "looks": [look(one) for one in m.looks],
        "not_told_apart_by_any_readings": [{"name": t.name, "moved_by": list(t.others)} for t in m.twins],
        "wrong_readings": [
            {"line": g.line, "distance_mm": rounded(1e3 * g.distance), "cause": g.cause} for g in m.gross
        ],
        "springs_can_be_told": m.weighs,
        "calibrate_free": free(m),
    }
    if m.holdout is not None:
        _, first, last = m.holdout
        out["holdout"] = {"before": predicted(first), "after": predicted(last)}
    return out


def free(m: Missing) -> str | None:
    """What `calibrate --free` takes to have these effects in the model; None where nothing was found."""
    named = dict.fromkeys(one.free for one in m.found)
    return ",".join(("geometry", *named)) if named else None


def effect(m: Missing, one: FoundEffect, *, sure: bool) -> dict[str, Any]:
    """An effect that was taken up, with its parameters."""
    names = {x.name for x in one.unknowns}
    told = [f for f in findings(m.after) if f.name in names]
    return {
        "code": one.candidate.code,
        "words": one.candidate.words,
        "sure": sure,
        "probability": rounded(one.probability),
        "log_evidence_gain": rounded(one.gain),
        "acts_rms_mm": rounded(1e3 * one.acts),
        "rivals": list(one.rivals),
        "parameters": parameters_table(told).rows(),
    }


def look(one: Look) -> dict[str, Any]:
    """A look: the most probable hypotheses, and what no reading shows."""
    lines = [
        {
            "code": x.code,
            "probability": rounded(x.probability),
            "log_evidence_gain": rounded(x.gain),
            "acts_rms_mm": None if x.code in (NONE, UNKNOWN) else rounded(1e3 * x.acts),
        }
        for x in one.lines[:LINES]
    ]
    return {
        "hypotheses": lines,
        "unknown_along": one.axis,
        "scatter_sd_mm": rounded(1e3 * one.scatter),
        "not_testable": list(one.hidden),
    }
