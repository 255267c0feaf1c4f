"""Each check after the name: it fires, it stays silent, it does not apply; and what all of them leave of a name."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from made_up import FRICTION, found_friction, kr60

from doe.diagnosis import checks as checking
from doe.diagnosis import diagnose as diagnosing
from doe.diagnosis.checks import FACTORS, RARE, SUREST, Check, Code, checks, leftovers, stated
from doe.diagnosis.diagnose import Diagnosis, Found
from doe.diagnosis.evidence import Base, LeftOut, Whitened
from doe.diagnosis.hypotheses import NONE, UNKNOWN
from doe.estimation.blocks import Covariance
from fem.effects.base import PlacedEffect
from fem.effects.catalogue import effect_of


@pytest.fixture(scope="module")
def d() -> Diagnosis:
    return found_friction()


def the(made: Iterable[Check], code: Code, effect: str = "friction:j2") -> Check:
    return next(c for c in made if (c.code, c.effect) == (code, effect))


def a_found(code: str, values: dict[str, float], sd: dict[str, float], probability: float = 0.95) -> Found:
    description, model = kr60()
    return Found(effect_of(code, model, description).placed(values), sd, probability, 20.0)


def with_found(d: Diagnosis, *found: Found) -> Diagnosis:
    return replace(d, effects=found)


def silent(c: Check) -> bool:
    return c.passed is True and c.factor == 1.0


def fires(c: Check) -> bool:
    return c.passed is False and c.factor == FACTORS[c.code]


def does_not_apply(c: Check, because: str) -> bool:
    return c.passed is None and c.factor == 1.0 and because in c.evidence


def test_a_right_name_passes_all_that_applies(d: Diagnosis) -> None:
    assert {c.code for c in d.checks} == set(FACTORS)
    assert all(silent(c) for c in d.checks)
    assert all(c.evidence and "\n" not in c.evidence for c in d.checks)
    assert d.stated == pytest.approx(min(d.effects[0].probability, SUREST), abs=1e-12)  # round-off
    assert d.checks == checks(d, np.random.default_rng(0))  # seed 0 is the default


def test_nothing_found_has_no_checks_and_nothing_stated(d: Diagnosis) -> None:
    none = with_found(d)
    assert checks(none) == ()
    assert math.isnan(none.stated)


# plausible-parameters


@pytest.mark.parametrize(
    ("share", "sd", "friction", "ok"),
    [
        (0.9, 0.05, 120.0, True),
        (1.6, 0.02, 120.0, False),  # plausible up to 1.2, with slack to 1.5
        (1.6, 0.1, 120.0, True),  # give or take its uncertainty
        (0.28, 0.01, 120.0, False),  # plausible from 0.4, with slack from 0.32
        (0.9, 0.05, 5e4, False),  # a shape is judged alike
        (0.9, 0.05, 0.5, False),
    ],
)
def test_numbers_beyond_what_is_plausible_fire(
    d: Diagnosis, share: float, sd: float, friction: float, ok: bool
) -> None:
    found = a_found("friction:j2", {"share": share, "friction": friction}, {"share": sd, "friction": 0.02 * friction})
    check = the(checks(with_found(d, found)), "plausible-parameters")
    assert silent(check) if ok else fires(check)
    if not ok:
        assert "N m is plausible" in check.evidence or "0.4 to 1.2 is plausible" in check.evidence


def test_of_several_amplitudes_one_may_be_small_but_not_all(d: Diagnosis) -> None:
    sd = {"stiffness_x": 1e-9, "stiffness_y": 1e-9}
    for y, ok in ((2e6, True), (1e9, False)):
        found = a_found("joint-tilt:j2", {"stiffness_x": 1e9, "stiffness_y": y, "turning": 0.0}, sd)
        assert checking._plausible(found).passed is ok
    # A stiffness is told with its interval, in its own unit.
    assert "N m/rad" in checking._plausible(found).evidence


def test_an_effect_without_numbers_cannot_be_implausible() -> None:
    assert does_not_apply(checking._plausible(a_found("angle-sign:j3", {}, {})), "no parameter")


# predicts-left-out and stable


def judged_by(
    monkeypatch: pytest.MonkeyPatch, d: Diagnosis, gain: list[float], ratio: float = 0.5
) -> tuple[Check, Check]:
    """The two checks where poses left out gain so much and errors shrink so far."""
    error = np.ones(len(d.start.data))
    states = {
        id(d.after.setting): LeftOut(ratio * error, np.array(gain) - 3.0),
        None: LeftOut(error, np.full(len(gain), -3.0)),
    }
    monkeypatch.setattr(checking, "_best_left_out", lambda _, s: states.get(id(s), states[None]))
    made = checks(d)
    return the(made, "predicts-left-out"), the(made, "stable")


@pytest.mark.parametrize(
    ("gain", "ratio", "predicts", "stable"),
    [
        ([1.0] * 14, 0.5, True, True),
        ([-1.0] * 14, 0.5, False, False),
        ([1.0] * 14, 1.1, False, True),  # denser but farther off
        ([30.0] + [-1.0] * 13, 0.5, False, False),  # one pose alone
        ([30.0] + [0.05] * 13, 0.5, True, False),  # what is left does not speak for it
    ],
)
def test_what_does_not_predict_poses_left_out_fires(
    monkeypatch: pytest.MonkeyPatch, d: Diagnosis, gain: list[float], ratio: float, *, predicts: bool, stable: bool
) -> None:
    first, second = judged_by(monkeypatch, d, gain, ratio)
    assert (first.passed, second.passed) == (predicts, stable)
    assert (first.factor, second.factor) == (
        1.0 if predicts else FACTORS["predicts-left-out"],
        1.0 if stable else FACTORS["stable"],
    )
    assert f"{ratio:.2f} times" in first.evidence
    assert ("all of it by pose P0" in first.evidence) == (gain[0] > 20.0 and not predicts)


def test_the_best_tenth_of_the_poses_is_left_out_of_what_must_be_stable(
    monkeypatch: pytest.MonkeyPatch, d: Diagnosis
) -> None:
    _, second = judged_by(monkeypatch, d, [9.0, 8.0, 7.0, 6.0] + [0.02] * 36)
    assert fires(second)
    assert "without the 4 poses" in second.evidence


def test_gains_are_those_of_the_states(d: Diagnosis) -> None:
    before, after = (checking._best_left_out(d, s) for s in (d.without("friction:j2"), d.after.setting))
    good = d.counts
    # The noise may be the other one of the two, and springs are straight: nearly the same.
    for found, error in ((before, d.before.left_out), (after, d.after.left_out)):
        assert np.std(found.error[good]) == pytest.approx(np.std(error[good]), rel=0.1)
    assert np.sum(after.log_density) > np.sum(before.log_density) + 100.0


def test_densities_of_poses_left_out_are_of_the_readings(d: Diagnosis) -> None:
    """The determinants by pose are those of the whole covariance, pose by pose, set-ups' scatter included."""
    s = d.after.setting
    noise = replace(d.after.refit.noise, pose_share=0.01)
    V = noise.covariance(s.data, s.prediction, d.weight)
    whole = np.linalg.inv(V.solve(np.eye(len(s.data))))
    for g, found in enumerate(V.log_dets(s.data.pose)):
        mine = np.flatnonzero(s.data.pose == g)
        assert found == pytest.approx(
            np.linalg.slogdet(whole[np.ix_(mine, mine)])[1], abs=1e-6
        )  # round-off of inverses


def test_a_made_up_effect_predicts_nothing(d: Diagnosis) -> None:
    """Softening of a joint that is straight, in the model by hand."""
    description, model = kr60()
    extra = effect_of("softening:j3", model, description).placed({"share": 0.3, "torque": 500.0, "power": 1.0})
    s = d.after.setting
    after = diagnosing.state_of(s.moved(s.springs, (*s.accepted, extra)), d.after.refit.noise, d.weight)
    found = Found(after.setting.accepted[-1], after.refit.spread(1), 0.95, 6.0)
    made = checks(replace(d, effects=(*d.effects, found), after=after))
    assert the(made, "stable", "softening:j3").passed is False
    assert silent(the(made, "stable"))


def test_too_few_poses_cannot_be_left_out(monkeypatch: pytest.MonkeyPatch, d: Diagnosis) -> None:
    monkeypatch.setattr(checking, "FEWEST", 15)
    made = checks(d)
    for code in ("predicts-left-out", "stable"):
        assert does_not_apply(the(made, code), "14 poses are too few")


# nothing-left


def looked(d: Diagnosis, none: float, unknown: float) -> Diagnosis:
    """The diagnosis with other probabilities in its last look."""
    last = d.rankings[-1]
    given = {NONE: none, UNKNOWN: unknown}
    rest = sum(h.probability for h in last.hypotheses if h.code not in given)
    lines = [
        replace(h, probability=given.get(h.code, (1.0 - none - unknown) * h.probability / rest))
        for h in last.hypotheses
    ]
    lines.sort(key=lambda h: -h.probability)
    return replace(d, rankings=(*d.rankings[:-1], replace(last, hypotheses=tuple(lines))))


def test_what_the_last_look_leaves_to_the_unknown_multiplies_the_odds(d: Diagnosis) -> None:
    made = checks(looked(d, 0.31, 0.69))
    check = the(made, "nothing-left", "")
    assert check.passed is False
    assert check.factor == pytest.approx(0.31 / 0.69, rel=1e-9)  # round-off
    assert "69 % to something unknown" in check.evidence
    assert the(checks(looked(d, 1e-9, 0.9)), "nothing-left", "").factor == FACTORS["nothing-left"]
    further = the(checks(looked(d, 0.1, 0.1)), "nothing-left", "")
    assert "80 % to further effects" in further.evidence
    assert "first" in further.evidence


def test_a_last_look_that_is_sure_of_nothing_else_is_silent(d: Diagnosis) -> None:
    assert silent(the(checks(looked(d, 0.6, 0.3)), "nothing-left", ""))


def test_without_a_look_after_the_last_name_nothing_can_be_left(d: Diagnosis) -> None:
    assert does_not_apply(the(checks(replace(d, rankings=d.rankings[:1])), "nothing-left", ""), "last look did not")


# no-twin


@pytest.mark.parametrize(
    ("others", "passed"), [(("creep:j2", "slip:j2", "payload", "drift"), False), ((), True), (None, None)]
)
def test_twins_with_plausible_numbers_fire(
    monkeypatch: pytest.MonkeyPatch, d: Diagnosis, others: tuple[str, ...] | None, passed: bool | None
) -> None:
    monkeypatch.setattr(Diagnosis, "plausible_twins", lambda *_: others)
    check = the(checks(d), "no-twin")
    assert check.passed is passed
    assert check.factor == (FACTORS["no-twin"] if passed is False else 1.0)
    if others:
        assert "creep:j2, slip:j2, payload and 1 more" in check.evidence
    if passed is None:
        assert does_not_apply(check, "so small")


# one-of-a-kind


def test_several_joints_with_one_fault_fire(d: Diagnosis) -> None:
    both = [a_found(f"friction:j{k}", FRICTION, {"share": 0.05, "friction": 3.0}) for k in (2, 3)]
    two = with_found(d, *both)
    check = checking._one_of_a_kind(two, both[0])
    assert fires(check)
    assert "friction:j3" in check.evidence
    other = a_found("hardening:j3", {"share": 0.5, "knee": 300.0, "power": 1.0}, {"share": 0.1, "knee": 10.0})
    assert silent(checking._one_of_a_kind(with_found(d, both[0], other), both[0]))


def test_what_is_of_no_joint_has_none_of_its_kind(d: Diagnosis) -> None:
    payload = a_found("payload", {"force": 40.0}, {"force": 2.0})
    assert does_not_apply(checking._one_of_a_kind(with_found(d, payload), payload), "not act at a joint")


# like-noise


def moved(d: Diagnosis, change: np.ndarray) -> Diagnosis:
    """The diagnosis with other readings (m,), its model as it was."""
    s = d.after.setting
    p = replace(s.data, value=s.data.value + change)
    refit = replace(d.after.refit, setting=replace(s, data=p))
    return replace(d, after=replace(d.after, refit=refit))


def noise_of(d: Diagnosis) -> np.ndarray:
    s = d.after.setting
    return np.asarray(d.after.refit.noise.spread(s.data, s.prediction))


def test_what_is_smooth_over_the_poses_is_no_noise(d: Diagnosis) -> None:
    p = d.after.setting.data
    q = p.free.at.q[p.row]
    x = (q - q.mean(axis=0)) / np.ptp(q, axis=0)
    check = the(checks(moved(d, 1.5 * noise_of(d) * np.sign(x[:, 1] * x[:, 2]))), "like-noise", "")
    assert fires(check)
    assert "smooth over the poses" in check.evidence


def test_what_follows_the_clock_is_no_noise(d: Diagnosis) -> None:
    s = d.after.setting
    t = s.history.clock[s.data.row]
    check = the(checks(moved(d, 4.0 * noise_of(d) * np.cos(np.pi * t))), "like-noise", "")
    assert fires(check)
    assert "below 1 % as much of it over time" in check.evidence
    unknown = replace(s.history, clock=np.full_like(s.history.clock, np.nan))
    timeless = replace(d, after=replace(d.after, refit=replace(d.after.refit, setting=replace(s, history=unknown))))
    assert "clock" not in the(checks(timeless), "like-noise", "").evidence


def test_too_large_a_rest_is_no_noise(d: Diagnosis) -> None:
    rough = np.random.default_rng(4).normal(size=len(d.start.data))
    check = the(checks(moved(d, 1.0 * noise_of(d) * rough)), "like-noise", "")
    assert fires(check)
    assert "below 1 % leave a sum of squares as large" in check.evidence


def test_a_fit_that_follows_every_reading_leaves_nothing_to_judge(
    monkeypatch: pytest.MonkeyPatch, d: Diagnosis
) -> None:
    monkeypatch.setattr(checking, "FREE", 1e3)
    assert does_not_apply(the(checks(d), "like-noise", ""), "left free")


def test_runs_leave_as_much_as_theory_says() -> None:
    """A base of many numbers with priors that matter: the mean sum of squares of what a refit leaves."""
    rng = np.random.default_rng(1)
    m, b = 60, 40
    base = Base(rng.normal(size=(m, b)), rng.normal(size=m), np.full(b, 30.0), np.full(b, -np.inf))
    w = Whitened(base, Covariance(None, np.ones(m), None))  # type: ignore[arg-type] - no blocks are asked for
    left = leftovers(w, np.random.default_rng(0), 4000)
    np.testing.assert_allclose(left[:, 0], base.residual - base.columns @ w.u, atol=1e-12)  # round-off
    # With R = I - W S^-1 W^T: E|R y|^2 = |R W u|^2 + tr(R W S^-1 W^T R) + tr(R R).
    H = w.W @ w.inverse @ w.W.T
    R = np.eye(m) - H
    numbers = float(np.trace(R @ H @ R))
    mean = float(np.sum((R @ w.W @ w.u) ** 2) + numbers + np.trace(R @ R))
    assert numbers > 2.0  # what the numbers' own scatter adds can be seen
    # 4000 runs of a sum with a variance of about 2 m: four standard deviations of its mean.
    assert np.mean(np.sum(left[:, 1:] ** 2, axis=0)) == pytest.approx(mean, abs=4.0 * math.sqrt(2.0 * m / 4000))


@pytest.mark.slow
def test_noise_itself_is_seldom_called_no_noise(d: Diagnosis) -> None:
    """Readings drawn of the model with its noise: the check fails about as seldom as its bound says."""
    s, refit = d.after.setting, d.after.refit
    V = refit.noise.covariance(s.data, s.prediction, d.weight)
    root = np.linalg.cholesky(np.linalg.inv(V.solve(np.eye(len(s.data)))))
    draws = 40
    rng = np.random.default_rng(5)
    fails = sum(
        checking._like_noise(moved(d, s.prediction + root @ rng.normal(size=len(root)) - s.data.value), rng).passed
        is False
        for _ in range(draws)
    )
    # Three measures, each below RARE: 2.4 of 40 are expected at most, and 8 come once in 300 times.
    assert fails <= 8
    assert 3 * RARE * draws < 3.0


# What is stated


def test_factors_multiply_the_odds_of_their_own_name_only(d: Diagnosis) -> None:
    second = a_found("creep:j3", {"share": 0.2, "time": 300.0}, {"share": 0.01, "time": 10.0}, 0.9)
    made = (
        Check("stable", "friction:j2", passed=False, evidence="", factor=0.5),
        Check("stable", "creep:j3", passed=False, evidence="", factor=0.01),
        Check("nothing-left", "", passed=False, evidence="", factor=0.4),
        Check("no-twin", "friction:j2", passed=None, evidence="", factor=1.0),
    )
    odds = 0.9 / 0.1 * 0.5 * 0.4
    first = replace(d.effects[0], probability=0.9)
    assert stated(first, made) == pytest.approx(odds / (1.0 + odds), rel=1e-12)  # round-off
    odds = 0.9 / 0.1 * 0.01 * 0.4
    assert stated(second, made) == pytest.approx(odds / (1.0 + odds), rel=1e-12)  # round-off


def test_no_name_is_surer_than_is_believed(d: Diagnosis) -> None:
    assert stated(replace(d.effects[0], probability=1.0), ()) == pytest.approx(SUREST, rel=1e-12)  # round-off


@pytest.mark.parametrize(("code", "sure"), [("no-twin", False), ("predicts-left-out", False), ("stable", True)])
def test_a_second_name_that_fails_its_checks_is_provisional(
    monkeypatch: pytest.MonkeyPatch, d: Diagnosis, code: checking.Code, sure: bool
) -> None:
    second = a_found("creep:j3", {"share": 0.2, "time": 300.0}, {"share": 0.01, "time": 10.0}, 0.9)
    made = (
        Check(code, "friction:j2", passed=False, evidence="of the first", factor=0.9),
        Check(code, "creep:j3", passed=False, evidence="of the second", factor=0.9),
    )
    monkeypatch.setattr(checking, "checks", lambda one: made)
    both = with_found(d, d.effects[0], second)
    turned = diagnosing._doubted(both)
    if sure:
        assert turned is both
        return
    assert turned.verdict == "ambiguous"
    assert [f.code for f in turned.effects] == ["friction:j2"]
    assert [f.code for f in turned.provisional] == ["creep:j3"]
    assert "of the second" in turned.reason
    # A single name is not judged by its twins.
    one = replace(d)
    assert diagnosing._doubted(one) is one


def test_checks_are_worked_out_only_when_asked_for(monkeypatch: pytest.MonkeyPatch, d: Diagnosis) -> None:
    calls: list[Diagnosis] = []
    monkeypatch.setattr(checking, "checks", lambda one: (calls.append(one), ())[1])
    fresh = replace(d)
    assert not calls
    assert fresh.checks == ()
    assert math.isfinite(fresh.stated)
    assert len(calls) == 1


def test_placed_numbers_are_those_of_the_model(d: Diagnosis) -> None:
    assert isinstance(d.effects[0].placed, PlacedEffect)
    share = d.effects[0].placed.by_name["share"]
    assert f"share {share:.3g}" in the(d.checks, "plausible-parameters").evidence


@pytest.mark.parametrize(("factor", "stands"), [(0.5, True), (0.4, False)])
def test_a_name_needs_what_its_checks_leave_of_it(
    d: Diagnosis, monkeypatch: pytest.MonkeyPatch, factor: float, stands: bool
) -> None:
    """Odds of 0.92 to 0.08, halved, are still above 85 %; with two fifths of them they are not."""
    against = Check("nothing-left", "", passed=False, evidence="much is left", factor=factor)
    monkeypatch.setattr(checking, "checks", lambda d: (against,))
    sure = with_found(d, replace(d.effects[0], probability=1.0))
    turned = diagnosing._doubted(sure)
    assert (turned.verdict, len(turned.effects)) == (("named", 1) if stands else ("ambiguous", 0))
    assert [f.code for f in turned.found] == ["friction:j2"]
    assert stands or "much is left" in turned.reason
