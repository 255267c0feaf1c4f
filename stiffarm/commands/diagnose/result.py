"""A diagnosis as a result: its answer, every candidate, its facts for JSON, and the page when it is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from doe.diagnosis.checks import stated
from doe.diagnosis.diagnose import Found
from doe.diagnosis.findings.numbers import in_order, numbers_of
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Hypothesis, Ranking
from doe.diagnosis.where import least_rms_mm, noise_floor_mm
from doe.estimation.noise import origin
from doe.tables.columns import DISPLACEMENTS
from doe.tables.joined import files_of
from fem.arm import Arm
from fem.effects.learned import axes_of, learned_place
from robots.quantities import Quantity, length, percent, rounded, significant
from stiffarm.arm import as_face
from stiffarm.commands.calibrate import payload as calibration_payload
from stiffarm.commands.diagnose import words
from stiffarm.commands.diagnose.model import described, springs_of
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.pages.report import KeyFigure, data_words
from stiffarm.result import Number, Result, Table
from stiffarm.session.caution import uncalibrated
from stiffarm.session.words.noise import floor_name

QUESTION = "where do model and robot disagree, and why?"
LEFT_OUT, NESTED = "leave-one-pose-out", "nested folds"
# Of each look so many candidates are listed in JSON, and on a screen.
LISTED = 8
PROBABILITY = Quantity("probability")
BEFORE_CHECKS = Quantity("probability_before_checks", label="probability before its checks")
EVIDENCE, BIC, LEFT_OUT_RMS = (
    Quantity("log_evidence", label="log evidence"),
    Quantity("bic"),
    length("left_out_rms", "RMS of poses left out"),
)
UNSEEN = tuple(length(f"unseen_rms_{when}", f"error at poses not seen, {when}") for when in ("before", "after"))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Diagnosis(Result):
    """What a model is missing: ``arm`` has it. ``diagnosis["unseen_rms_after_mm"]`` is the error at poses not seen.

    The first table has every candidate with its probability after the checks, as the page states it.
    """

    @property
    def verdict(self) -> str:
        """The kind of answer: "named", "ambiguous", "learned", "unknown", "none" or "uninformative"."""
        return str(self.facts["verdict"])

    @property
    def reason(self) -> str:
        """Why, in words."""
        return str(self.facts["reason"])

    @property
    def effects(self) -> tuple[str, ...]:
        """Codes of what was found, those that are sure first."""
        kinds = ("effects", "learned", "provisional")
        return tuple(one["code"] for kind in kinds for one in self.facts.get(kind, ()))


def made_arm(d: Diagnosed) -> Arm:
    """The arm with the new model; as given where the readings tell nothing."""
    if not d.tells:
        return d.given
    return as_face(Arm.of(described(d), d.given.model.link_kind, None, d.given.own))


def result_of(d: Diagnosed) -> Diagnosis:
    """The result of a diagnosis; its page is made when it is asked for."""
    found, p, arm, tables = d.found, d.found.before.setting.data, made_arm(d), tables_of(d)

    @cache
    def story() -> Any:
        from stiffarm.commands.diagnose.page import Story

        return Story(d, arm, tables)

    return Diagnosis(
        name="diagnosis",
        title=d.given.description.title.split(" (")[0],
        question=QUESTION,
        answer=words.headline(d),
        how_sure=words.how_sure(d),
        what_next=words.advice(d).text,
        facts=facts(d),
        numbers={q: Number(1e-3 * value) for q, value in zip(UNSEEN, d.unseen_rms_mm, strict=True)},
        tables=tuple(tables),
        key=tuple(_key_figures(d)),
        sections=lambda: story().sections(),
        warnings=(*(doubt.words for doubt in d.doubts), *filter(None, (uncalibrated(arm) if d.tells else "",))),
        remarks=words.remarks(d),
        arm=arm,
        caution="",
        found=d,
        more=lambda folder: story().write(folder),
        made_of=f"{data_words(d.used)}; {len(p)} readings at {len(p.poses)} poses, {d.given.model.link_kind} links, "
        f"{d.given.model.load_path} load path, springs of {', '.join(found.before.setting.free)} fitted",
    )


def tables_of(d: Diagnosed) -> list[Table]:
    """Every candidate, what was found after its checks; the most probable ones; parameters of what was found."""
    found = d.found
    rows: dict[str, tuple[float, Hypothesis]] = {}
    for f, r in zip(in_order(found), found.rankings, strict=False):
        if d.tells and (own := next((h for h in r.hypotheses if h.code == f.code), None)) is not None:
            rows[f.code] = stated(f, found.checks), own
    for h in found.ranking.hypotheses if d.tells else ():
        rows.setdefault(h.code, (h.probability, h))
    rows = dict(sorted(rows.items(), key=lambda row: -row[1][0]))
    every = [h for _, h in rows.values()]
    now = np.array([p for p, _ in rows.values()])
    labels = {"code": list(rows), "kind": [_kind(h) for h in every]}
    values = {PROBABILITY: now, BEFORE_CHECKS: np.array([h.probability for h in every])}
    values |= {EVIDENCE: np.array([h.log_evidence for h in every]), BIC: np.array([h.bic for h in every])}
    values[LEFT_OUT_RMS] = 1e-3 * np.array([h.lopo_rms_mm for h in every])
    out = [Table("candidates", "All candidates", labels, values, folded=True)]
    if not d.tells:
        return out
    shown = {
        "code": list(rows)[:LISTED],
        "probability": [percent(p) for p in now[:LISTED]],
        "before its checks": [percent(h.probability) for h in every[:LISTED]],
    }
    few = {q: v[:LISTED] for q, v in values.items() if q in (EVIDENCE, LEFT_OUT_RMS)}
    out.append(Table("most_probable", "The most probable candidates", shown, few, is_extract=True))
    cells = [(n.code, *words.number_cells(n)) for n in numbers_of(found.after)]
    if cells:
        heads = ("effect", "parameter", "value", "95 % interval", "plausible", "what it is")
        columns = dict(zip(heads, zip(*cells, strict=True), strict=True))
        out.append(Table("parameters", "Parameters of what was found", columns, {}, is_extract=True))
    return out


def _kind(h: Hypothesis) -> str:
    """Tells effects from "none" (nothing missing) and "unknown"."""
    return h.code if h.code in (NONE, UNKNOWN) else "effect"


def _key_figures(d: Diagnosed) -> list[KeyFigure]:
    found, h = d.found, d.held_out
    codes = ", ".join(f.code for f in found.effects)
    verdict = "nothing proven" if words.hints(d) else words.VERDICTS[found.verdict]
    out = [KeyFigure(codes or verdict, "what is missing" if codes else "verdict")]
    far = [significant(v) for v in d.unseen_rms_mm]
    label = f"RMS at {words.unseen_poses(d)}" if h is None else f"RMS on {h.data.source}"
    both = KeyFigure(f"{far[0]} → {far[1]} mm", f"{label}, before and after")
    out.append(both if d.in_model else KeyFigure(f"{far[0]} mm", label))
    if d.tells:
        name = floor_name(found.after.setting.data)
        unknown = f"{name}; without repeats its noise is not known"
        label = "RMS that noise alone would give" if name == "noise alone" else unknown
        out.append(KeyFigure(f"{significant(noise_floor_mm(found))} mm", label))
    if found.effects or found.learned:
        out.append(KeyFigure(percent(found.stated), f"probability of {found.found[0].code} after its checks"))
    return out


def facts(d: Diagnosed) -> dict[str, Any]:
    """What JSON says beside the candidates; of readings that tell nothing no steps and springs."""
    found, advice = d.found, words.advice(d)
    return {
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
        "effects": [_effect(d, f) for f in found.effects],
        "learned": [
            _effect(d, f) | {"place": learned_place(f.code), "axes": list(axes_of(f.code))} for f in found.learned
        ],
        "unknown_axis": found.ranking.of(UNKNOWN).axis or None,
        "unknown_place": None if found.suspect is None else learned_place(found.suspect.code),
        "provisional": [_effect(d, f) for f in found.provisional],
        "rejected": (r := found.rejected)
        and {"effects": list(r.codes), "before_rms_mm": rounded(r.before_mm), "after_rms_mm": rounded(r.after_mm)},
        "stated_probability": rounded(found.stated),
        "checks": [
            {
                "code": c.code,
                "effect": c.effect or None,
                "passed": c.passed,
                "evidence": c.evidence,
                "factor": rounded(c.factor),
            }
            for c in found.checks
        ],
        "set95": list(d.credible),
        "twins": {code: list(others) for code, others in d.twins.items()},
        "still_open": {code: list(others) for code, others in d.still_open.items()},
        "not_testable": dict(sorted(d.not_testable.items())),
        "where": {
            kind: [
                {
                    kind: g.label,
                    "readings": g.readings,
                    "share": rounded(g.share, 4),
                    "share_sd": rounded(g.share_sd, 2),
                    "mean_square": rounded(g.mean_square, 4),
                    "mean_residual_mm": rounded(g.mean * 1e3, 4),
                }
                for g in groups
            ]
            for kind, groups in d.where.items()
        },
        "gap": _gap(d),
        "next": {
            "advice": advice.text,
            "chance": None if advice.chance is None else rounded(advice.chance, 3),
            "measure": advice.measure,
        },
        "next_readings": _next_readings(d),
        "next_expected": _expected(d),
        "steps": [
            {
                "decision": decision.kind,
                "reason": decision.reason,
                "hypothesis": None if decision.hypothesis is None else decision.hypothesis.code,
                "candidates": _ranked(r),
            }
            for r, decision in zip(found.rankings, found.decisions, strict=False)
            if d.tells
        ],
        "calibration": None if d.calibrated is None else calibration_payload.answer(d.calibrated),
        "springs": {s.parameter.place: calibration_payload.spring(s) for s in springs_of(d) if d.tells},
        "noise": _noise(d),
        "outliers": _outliers(d),
        "doubts": [calibration_payload.doubt(doubt) for doubt in d.doubts],
    }


def _ranked(r: Ranking) -> list[Mapping[str, Any]]:
    """The most probable candidates of a step of the search, as they were then."""
    return [
        {
            "code": h.code,
            "kind": _kind(h),
            "probability": rounded(h.probability),
            "log_evidence": rounded(h.log_evidence),
            "bic": rounded(h.bic),
            "left_out_rms_mm": rounded(h.lopo_rms_mm),
        }
        for h in r.hypotheses[:LISTED]
    ]


def _effect(d: Diagnosed, f: Found) -> dict[str, Any]:
    """An effect of the new model with its parameters; ``sd`` is null where one was chosen among values tried."""
    return {
        "code": f.code,
        "words": f.placed.effect.words,
        "probability": rounded(f.probability),
        "log_evidence_gain": rounded(f.log_gain),
        "parameters": {
            n.name: {
                "value": rounded(n.value),
                "sd": None if n.sd is None else rounded(n.sd),
                "unit": n.unit,
                "interval95": None if n.low is None or n.high is None else [rounded(n.low), rounded(n.high)],
                "plausible": [rounded(v) for v in n.plausible],
            }
            for n in numbers_of(d.found.after)
            if n.code == f.code
        },
    }


def _gap(d: Diagnosed) -> dict[str, Any]:
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


def _next_readings(d: Diagnosed) -> list[dict[str, Any]]:
    """What to measure next, a set-up each; empty where nothing is left to be settled."""
    if (n := d.proposal) is None:
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


def _expected(d: Diagnosed) -> dict[str, Any] | None:
    """What the next readings are expected to tell: probabilities and chances by the rivals that are left."""
    n = d.proposal
    if n is None:
        return {"why_none": d.nothing_next} if d.nothing_next else None

    def chances(of: Any) -> dict[str, Any]:
        pairs = {"probability_after": of.belief}
        pairs |= {"chance_right": of.right, "chance_wrong": of.wrong, "chance_open": of.open}
        return {key: rounded(value, 3) for key, value in pairs.items()}

    return {
        "probability_now": rounded(n.before.belief, 3),
        **chances(n.expected),
        "by_rivals_alone": chances(n.after),
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


def _outliers(d: Diagnosed) -> list[dict[str, Any]]:
    """Readings that hardly count; ``line``: of its file."""
    p, files = d.found.before.setting.data, files_of(d.used)
    return [
        {
            **({} if files is None else {"file": files[row]}),
            "line": d.used.row_numbers[row],
            "pose": p.poses[p.pose[k]],
            "component": DISPLACEMENTS[p.component[k]],
            "load_N": rounded(float(d.used.loads_N[row])),
            "weight": rounded(float(d.found.weight[k]), 3),
        }
        for k in d.odd
        for row in (int(p.row[k]),)
    ]


def _noise(d: Diagnosed) -> dict[str, Any]:
    """Scatter that the best explanation leaves: of readings, and between set-ups; without repeats its residual."""
    n = d.found.after.refit.noise
    return {
        "reading_mm": rounded(n.white[0] * 1e3),
        "reading_share": rounded(n.share),
        "set_up_mm": rounded(n.pose[0] * 1e3),
        "set_up_share": rounded(n.pose_share),
        **calibration_payload.noise_structure(n),
        "source": origin(d.found.after.setting.data),
    }
