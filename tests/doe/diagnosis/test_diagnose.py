"""The diagnosis on readings whose effect follows the catalogue's own law: it must find it, and find nothing in none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up import few, read, setting

from doe.diagnosis.diagnose import Diagnosis, diagnose
from doe.diagnosis.hypotheses import NONE, Options
from doe.diagnosis.ranking import rank

BACKLASH = {"gap": 8e-4, "crossing": 20.0, "preload": 0.0}
FRICTION = {"share": 0.9, "friction": 120.0}


def diagnosed(effects: dict[str, dict[str, float]], **changes: object) -> Diagnosis:
    """Among one effect of each family, its own one of theirs."""
    return diagnose(few(setting(read(effects, **changes)), *effects))


@pytest.mark.slow
def test_nothing_is_found_where_nothing_is_missing() -> None:
    d = diagnosed({})
    assert d.verdict == "none"
    assert d.effects == ()
    assert d.before.fit_rms_mm == d.after.fit_rms_mm
    assert d.rankings[0].best.code == NONE


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "values", "name"),
    [
        ("friction:j2", FRICTION, "friction"),
        pytest.param("payload", {"force": 40.0}, "force", marks=pytest.mark.slow),
        pytest.param("backlash:j3", BACKLASH, "gap", marks=pytest.mark.slow),
        pytest.param("joint-zero-offset:j2", {"angle": np.radians(2.0)}, "angle", marks=pytest.mark.slow),
    ],
)
def test_an_effect_is_named_and_its_number_found(code: str, values: dict[str, float], name: str) -> None:
    d = diagnosed({code: values}, poses=12, repeats=1, seed=1)
    assert d.verdict == "named"
    assert [f.code for f in d.effects] == [code]
    found = d.effects[0]
    # Four standard deviations: one in 16 000 right ones would fail.
    assert abs(found.placed.by_name[name] - values[name]) < 4.0 * found.sd[name]
    assert d.after.left_out_rms_mm < d.before.left_out_rms_mm


@pytest.mark.slow
def test_two_effects_are_found_one_after_the_other() -> None:
    d = diagnosed({"friction:j2": FRICTION, "load-misalignment": {"tilt_x": 0.0, "tilt_y": np.radians(4.0)}}, poses=27)
    assert {f.code for f in d.effects} == {"friction:j2", "load-misalignment"}


@pytest.mark.slow
def test_friction_cannot_be_judged_without_a_history() -> None:
    data = read({"friction:j2": FRICTION}, poses=10, repeats=1)
    up = data.select(np.array([phase == "loading" for phase in data.phase]))
    up = replace(up, phase=(None,) * up.n, step=np.full(up.n, np.nan), time=np.full(up.n, np.nan))
    d = diagnose(few(setting(up), "friction:j2"))
    assert "loading" in d.not_testable()["friction:j2"]
    assert "step" in d.not_testable()["drift"]
    assert all(h.code.partition(":")[0] != "friction" for h in d.rankings[0].hypotheses)


@pytest.mark.slow
def test_what_no_reading_sees_is_not_testable() -> None:
    s = few(setting(read({}, poses=9, repeats=1)), "friction:j6")
    reasons = diagnose(s).not_testable()
    # Vertical loads have no lever about the first axis, nor about the last one at a point on it.
    assert {"hardening:j1", "friction:j6", "gauge-scale"} <= set(reasons)


def test_probabilities_sum_to_one_and_none_keeps_its_share() -> None:
    s = few(setting(read({}, poses=10, repeats=1)))
    r = rank(s, np.ones(len(s.data)))
    assert sum(h.probability for h in r.hypotheses) == pytest.approx(1.0, abs=1e-9)  # round-off
    assert r.of(NONE).probability > 0.3


@pytest.mark.slow
def test_without_a_term_for_set_ups_scatter_between_them_looks_like_an_effect() -> None:
    s = few(setting(read({}, setup=0.03, share=0.01, poses=20, seed=3)))
    weight = np.ones(len(s.data))
    with_term, without = (rank(s, weight, Options(pose_term=term)).of(NONE) for term in (True, False))
    assert without.probability < 1e-3
    assert with_term.log_evidence > without.log_evidence + 10.0


@pytest.mark.slow
def test_the_same_readings_give_the_same_diagnosis() -> None:
    first, again = (diagnosed({"payload": {"force": 40.0}}, poses=8, repeats=1) for _ in range(2))
    assert [h.probability for h in first.rankings[0].hypotheses] == [
        h.probability for h in again.rankings[0].hypotheses
    ]


@pytest.mark.slow
def test_readings_that_unload_make_friction_testable_for_the_others_too() -> None:
    data = read({}, poses=10, repeats=1)
    first = np.array([int(label[1:]) < 6 for label in data.pose])
    bare = tuple(None if early else phase for early, phase in zip(first, data.phase, strict=True))
    mixed = replace(data, phase=bare, step=np.full(data.n, np.nan))
    up = mixed.select(~first | np.array([phase == "loading" for phase in data.phase]))
    assert "friction:j2" not in {
        c for c, why in diagnose(few(setting(up), "friction:j2")).not_testable().items() if "phase" in why
    }


@pytest.mark.slow
def test_what_a_gauge_set_up_anew_is_off_by_is_no_effect() -> None:
    data = read({}, poses=14, repeats=2)
    day = np.array([int(label[1:]) >= 7 for label in data.pose])
    moved = data.displacement.copy()
    moved[day, 2] += 4e-5
    told = replace(data, displacement=moved, session=tuple("second" if late else "first" for late in day))
    assert diagnose(few(setting(told))).verdict == "none"
    # Without the column the same readings ask for something.
    assert diagnose(few(setting(replace(told, session=())))).verdict != "none"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "values"),
    [
        pytest.param("creep:j3", {"share": 0.25, "time": 300.0}, marks=pytest.mark.slow),
        pytest.param("slip:j2", {"angle": 3e-4, "torque": 150.0}, marks=pytest.mark.slow),
        pytest.param("slip:base", {"angle": 3e-4, "moment": 150.0}, marks=pytest.mark.slow),
        pytest.param("warming:j2", {"share": 0.2, "settling": 0.3}, marks=pytest.mark.slow),
        ("loose-base", {"gap": 3e-4, "closing": 80.0}),
    ],
)
def test_what_lags_slips_warms_or_rocks_is_named(code: str, values: dict[str, float]) -> None:
    found = diagnosed({code: values}, share=0.01, setup=0.003)
    assert found.verdict == "named"
    assert [e.code for e in found.effects] == [code]
    first = next(iter(values))
    assert found.effects[0].placed.by_name[first] == pytest.approx(values[first], rel=0.25)
