"""What to measure next: expected evidence in closed form, hidden effects made visible, limits, seeds, the sheet."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from made_up import read
from made_up import setting as made_up_setting
from refusals import refuses
from scipy.stats import norm, truncnorm

from doe import Measurements, read_measurements, write_measurements
from doe.diagnosis.diagnose import Diagnosis, diagnose
from doe.diagnosis.evidence import Base
from doe.diagnosis.proposals.discrimination import (
    Outcome,
    Predictions,
    choose,
    divergence,
    information,
    joint,
    outcomes,
    without_idle,
)
from doe.diagnosis.proposals.foresight import CAME, PROMISED, foresee, tempered, verdicts
from doe.diagnosis.proposals.next_readings import (
    NextReadings,
    at_random,
    doubted,
    possible_poses,
    propose,
    ways_to_measure,
    ways_to_read,
)
from doe.diagnosis.proposals.rivals import (
    Question,
    foreseen,
    noise_factors,
    open_twins,
    predictions,
    question_of,
    truncated,
    with_candidates,
)
from doe.diagnosis.ranking import rank
from doe.diagnosis.setting import Setting, setting_of
from doe.estimation.noise import Noise
from doe.planning.protocol import Protocol
from doe.planning.zones import Zone
from doe.tables.joined import join
from doe.tables.loaded import history_of
from fem import ArmModel, build_model, deflection
from fem.effects.catalogue import catalogue
from fem.statics.loads import LoadedPoses
from robots import InputError, load_description

CODES = ("joint-tilt:j3", "joint-tilt:j2", "backlash:j2", "gauge-zero", "joint-compliance:j6", "load-path")
DOWN = np.array([[0.0, 0.0, -1.0]])
SPRINGS = {"j2": 1.4e6, "j3": 0.76e6, "j4": 1.4e6, "j5": 3e6}
# The nine seed poses of the paper: q2, q3real, q4, q5 in deg.
PAPER = [(a, b, *w) for a, b in ((-35, 40), (5, 77.5), (45, 115)) for w in ((-200, 100), (0, -100), (0, 0))]


def rivals(mean: np.ndarray, weight: np.ndarray, spread: np.ndarray | None = None) -> Predictions:
    """Rivals with means (h, N, r) and one number each that moves the readings by ``spread`` (h, N, r)."""
    h = len(mean)
    factor = np.zeros_like(mean) if spread is None else spread
    return Predictions(tuple("abcdefgh"[:h]), weight, mean, tuple(F[:, :, None] for F in factor))


def test_two_rivals_with_one_reading_are_told_apart_where_they_differ_most(rng: np.random.Generator) -> None:
    mean = rng.normal(size=(2, 40, 1))
    p = rivals(mean, np.array([0.5, 0.5]))
    difference = np.abs(mean[0] - mean[1])[:, 0]
    found = choose(p, 1)
    assert found.chosen[0] == np.argmax(difference)
    # Known noise of unit variance: the expected log Bayes factor is half the squared difference.
    kl = divergence(*joint(p, found.chosen.tolist()))
    np.testing.assert_allclose(kl, difference.max() ** 2 / 2 * (1 - np.eye(2)), rtol=1e-12, atol=1e-12)


def test_what_a_parameter_can_follow_counts_as_noise() -> None:
    # The larger difference stands where the rivals' own parameter is uncertain by five times as much.
    mean = np.zeros((2, 2, 1))
    mean[0] = [[3.0], [2.0]]
    spread = np.broadcast_to(np.array([[10.0], [0.0]]), (2, 2, 1))
    assert choose(rivals(mean, np.array([0.5, 0.5]), spread), 1).chosen[0] == 1


def test_expected_evidence_is_the_mean_log_bayes_factor(rng: np.random.Generator) -> None:
    mean = rng.normal(size=(2, 1, 3))
    p = rivals(mean, np.array([0.5, 0.5]), rng.normal(size=(2, 1, 3)))
    m, S = joint(p, [0])
    expected = divergence(m, S)
    y = rng.multivariate_normal(m[0], S[0], size=200_000)
    log = [
        -0.5 * (np.einsum("nk,kl,nl->n", y - a, np.linalg.inv(C), y - a) + np.linalg.slogdet(C)[1])
        for a, C in zip(m, S, strict=True)
    ]
    factor = log[0] - log[1]
    # Four standard errors of the mean.
    assert expected[0, 1] == pytest.approx(factor.mean(), abs=4.0 * factor.std() / np.sqrt(len(y)))
    assert expected[0, 0] == pytest.approx(0.0, abs=1e-12)


def test_information_is_a_lower_bound_of_what_the_name_gains() -> None:
    weight = np.array([0.3, 0.7])
    for gap in (0.5, 2.0, 5.0):
        p = rivals(np.array([[[0.0]], [[gap]]]), weight)
        y = np.linspace(-12.0, 12.0 + gap, 20_001)
        density = np.stack([norm.pdf(y), norm.pdf(y, gap)])
        mixture = weight @ density
        exact = float(np.trapezoid(weight @ (density * np.log(np.maximum(density, 1e-300) / mixture)), y))
        bound = float(information(p, divergence(*joint(p, [0]))))
        # The bound is no worse than half of the truth here, and exact in both limits.
        assert 0.5 * exact < bound <= exact
    assert bound == pytest.approx(-weight @ np.log(weight), rel=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_exchange_finds_the_best_pair(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p = rivals(rng.normal(size=(4, 9, 2)), np.full(4, 0.25), rng.normal(size=(4, 9, 2)))
    value = {c: float(information(p, divergence(*joint(p, c)))) for c in combinations(range(9), 2)}
    found = choose(p, 2)
    assert found.information == pytest.approx(value[tuple(sorted(found.chosen.tolist()))], rel=1e-9)  # type: ignore[index]
    # Exchange stops at a local best: of 36 pairs it must be among the first few.
    assert sum(v > found.information * (1.0 + 1e-9) for v in value.values()) <= 1


def sure(belief: np.ndarray) -> np.ndarray:
    """The number of what holds four fifths of the probability, else -1."""
    return np.where(belief.max(axis=1) >= 0.8, belief.argmax(axis=1), -1)


def test_outcomes_agree_with_the_overlap_of_two_normals(rng: np.random.Generator) -> None:
    p = rivals(np.array([[[0.0]], [[2.0]]]), np.array([0.5, 0.5]))
    found = outcomes(p, [0], ("a", "b"), sure, rng, draws=40_000)
    # The log odds are 2 - 2 y; they exceed ln 4 on the near side of y = 1 - ln 2, of N(0, 1) and N(2, 1).
    few = 4.0 * 0.5 / np.sqrt(20_000)
    assert found["a"].right == pytest.approx(norm.cdf(1.0 - np.log(2.0)), abs=few)
    assert found["a"].wrong == pytest.approx(norm.sf(1.0 + np.log(2.0)), abs=few)
    assert found["a"].open == pytest.approx(1.0 - found["a"].right - found["a"].wrong)
    y = np.linspace(-8.0, 8.0, 4001)
    belief = np.trapezoid(norm.pdf(y) * norm.pdf(y) / (norm.pdf(y) + norm.pdf(y, 2.0)), y)
    assert found["a"].belief == pytest.approx(belief, abs=few)


def test_before_any_reading_an_outcome_is_what_stands(rng: np.random.Generator) -> None:
    p = rivals(np.array([[[0.0]], [[2.0]], [[2.0]]]), np.array([0.1, 0.45, 0.45]))
    found = outcomes(p, [], ("a", "f", "f"), sure, rng)
    assert found["b"].belief == pytest.approx(0.9)
    assert (found["b"].right, found["b"].wrong, found["b"].open) == (0.0, 0.0, 1.0)
    # Two of one name are as good as one another.
    named = outcomes(p, [], ("a", "f", "f"), lambda belief: np.full(len(belief), 1), rng)
    assert (named["c"].right, named["a"].wrong) == (1.0, 1.0)


def test_set_ups_that_tell_nothing_beside_the_others_are_left_out() -> None:
    mean = np.zeros((2, 4, 1))
    mean[1, :, 0] = [0.0, 6.0, 1e-3, 5.0]
    p = rivals(mean, np.array([0.5, 0.5]))
    open_ = choose(p, 3).entropy
    assert without_idle(p, [0, 1, 2], 0.01 * open_) == [1]
    assert without_idle(p, [0, 2], 0.01 * open_) == []
    assert set(without_idle(p, [3, 1], 1e-9)) == {1, 3}


def test_a_forecast_goes_by_what_such_ones_came_to() -> None:
    before = Outcome(0.5, 0.0, 0.0)
    sure = tempered(before, Outcome(1.0, 1.0, 0.0))
    assert before.belief < sure.belief < 1.0
    assert sure.right == pytest.approx((CAME + 0.5) / (PROMISED + 1.0))
    assert sure.right + sure.wrong + sure.open == pytest.approx(1.0)
    nothing = tempered(before, before)
    assert (nothing.belief, nothing.right, nothing.wrong, nothing.open) == (0.5, 0.0, 0.0, 1.0)
    # What rivals themselves expect to go wrong stays.
    assert tempered(before, Outcome(0.5, 0.0, 0.6)).wrong == pytest.approx(0.6)


def test_what_is_said_by_probabilities() -> None:
    codes = ["none", "unknown", "backlash:j2", "hardening:j2"]
    belief = np.array(
        [
            [0.9, 0.05, 0.03, 0.02],  # nothing missing
            [0.5, 0.1, 0.4, 0.0],  # not asked for, nor ruled out
            [0.01, 0.7, 0.2, 0.09],  # the unknown
            [0.01, 0.04, 0.9, 0.05],  # a name
            [0.01, 0.1, 0.5, 0.39],  # two names
        ]
    )
    assert verdicts(codes, belief).tolist() == [0, -1, -1, 2, -1]


def test_numbers_are_cut_off_at_their_limit() -> None:
    covariance = np.array([[4.0, 1.5], [1.5, 2.0]])
    mean, P = truncated(np.array([-1.0, 3.0]), covariance, np.array([0.0, -np.inf]))
    exact = truncnorm(0.5, np.inf, loc=-1.0, scale=2.0)
    assert mean[0] == pytest.approx(exact.mean(), rel=1e-9)
    assert P[0, 0] == pytest.approx(exact.var(), rel=1e-9)
    # The other one follows by regression.
    assert mean[1] == pytest.approx(3.0 + 1.5 / 4.0 * (exact.mean() + 1.0), rel=1e-9)
    assert P[1, 1] == pytest.approx(2.0 - 1.5**2 / 4.0 * (1.0 - exact.var() / 4.0), rel=1e-9)


def test_prediction_is_that_of_a_joint_normal(setting: Setting, rng: np.random.Generator) -> None:
    m, r, count, b = len(setting.data), 3, 4, 5
    columns = rng.normal(size=(m + r * count, b))
    prior = rng.uniform(0.5, 2.0, b)
    y = rng.normal(size=m)
    base = Base(columns, np.concatenate([y, np.full(r * count, -0.7)]), prior, np.full(b, -np.inf))
    V = setting.data.blocks.covariance(rng.uniform(1.0, 2.0, m), rng.normal(size=(m, 2)))
    dense = np.linalg.inv(V.solve(np.eye(m)))
    noise = np.linalg.cholesky(np.stack([np.eye(r) + 0.5 * k for k in range(count)]))
    mean, factor = foreseen(base, V, noise)
    K = columns @ np.diag(1.0 / prior) @ columns.T
    gain = K[m:, :m] @ np.linalg.inv(K[:m, :m] + dense)
    expected, spread = 0.7 + gain @ y, K[m:, m:] - gain @ K[:m, m:]
    for k in range(count):
        mine = slice(r * k, r * k + r)
        np.testing.assert_allclose(noise[k] @ mean[k], expected[mine], rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(noise[k] @ factor[k] @ (noise[k] @ factor[k]).T, spread[mine, mine], atol=1e-8)


def test_scatter_of_the_set_up_is_common_to_its_readings(setting: Setting) -> None:
    cycle = Protocol(np.array([100.0, 300.0]), DOWN, (0, 2), repeats=4)
    wrench = np.zeros((2, 6))
    wrench[:, 2] = -cycle.forces
    at = LoadedPoses(np.tile(setting.data.free.at.q[3], (2, 1)), wrench, setting.data.free.at.point[:2])
    both = with_candidates(setting, at, cycle)
    m = len(setting.data)
    noise = Noise(white=(2e-6, 1e-5), share=0.03, pose=(3e-6, 0.0), pose_share=0.02)
    L = noise_factors(both, m, noise, cycle)[0]
    f = both.prediction[m:]
    together = np.array([[1, 0, 1, 0], [0, 1, 0, 1]] * 2)
    expected = np.diag((2e-6) ** 2 + (0.03 * f) ** 2) / 4 + together * ((3e-6) ** 2 + 0.02**2 * np.outer(f, f))
    np.testing.assert_allclose(L @ L.T, expected, rtol=1e-10)
    # The readings so far stay as they were.
    np.testing.assert_allclose(both.prediction[:m], setting.prediction, rtol=1e-12)
    assert both.unloading[: len(setting.unloading)].tolist() == setting.unloading.tolist()


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers."""
    return np.random.default_rng(0)


@pytest.fixture(scope="module")
def first() -> Measurements:
    """The first table."""
    return _first()


def _first() -> Measurements:
    """Nine poses, three loads up and down, of a serial chain whose springs are as declared, with 3 % noise."""
    rng = np.random.default_rng(1)
    forces = np.array([150.0, 375.0, 650.0, 375.0, 150.0])
    n = len(PAPER) * len(forces)
    q = np.zeros((n, 6))
    q[:, 1:5] = np.repeat(np.radians(PAPER), len(forces), axis=0)
    wrench = np.zeros((n, 6))
    wrench[:, 2] = -np.tile(forces, len(PAPER))
    d = np.full((n, 6), np.nan)
    d[:, 2] = deflection(_arm(), q, wrench)[:, 2] * (1.0 + 0.03 * rng.normal(size=n))
    phase = ("loading",) * 3 + ("unloading",) * 2
    return Measurements(
        "first",
        "0",
        q,
        wrench,
        d,
        np.full((n, 3), np.nan),
        np.full(n, np.nan),
        tuple(f"P{k // len(forces)}" for k in range(n)),
        (1,) * n,
        phase * len(PAPER),
        np.arange(1.0, n + 1),
        tuple(range(2, n + 2)),
        {},
        (),
    )


def _arm() -> ArmModel:
    return build_model(load_description("xr701"), "rigid").with_springs(SPRINGS)


@pytest.fixture(scope="module")
def setting(first: Measurements) -> Setting:
    """What a diagnosis of them works on, with a catalogue of a few effects."""
    s = setting_of(load_description("xr701"), _arm(), first)
    return replace(s, known={code: s.known[code] for code in CODES})


@pytest.fixture(scope="module")
def diagnosis(setting: Setting) -> Diagnosis:
    """Nothing is missing, or cannot be seen."""
    found = diagnose(setting)
    assert found.verdict == "none"
    return found


@pytest.fixture(scope="module")
def proposed(setting: Setting, diagnosis: Diagnosis) -> NextReadings:
    """Three set-ups."""
    return propose(setting, diagnosis, candidates=60, rng=np.random.default_rng(0))


def test_a_hidden_effect_is_made_visible(proposed: NextReadings, diagnosis: Diagnosis) -> None:
    # The seed poses have q1 = 0 and wrists at 0 or 100 deg: the lever that tilts joint 3 is too short there.
    assert "joint-tilt:j3" in diagnosis.ranking.hidden
    tilt = next(r for r in proposed.rivals if r.code == "joint-tilt:j3")
    assert tilt.hidden
    assert tilt.against_none > np.log(20.0)
    assert tilt.after.belief > 0.5 > tilt.before.belief
    # No vertical load turns joint 6 by much, whatever the pose: it stays hidden, and the words do not promise it.
    last = next(r for r in proposed.rivals if r.code == "joint-compliance:j6")
    assert last.against_none < np.log(20.0)
    assert "joint-tilt:j3" in proposed.words[3]
    assert "joint-compliance:j6" not in proposed.words[3]
    assert proposed.after.belief > proposed.before.belief
    assert 0.0 < proposed.after.open < proposed.before.open
    # What candidates promise by themselves is more than what came of such promises.
    assert proposed.before.belief < proposed.expected.belief < proposed.after.belief
    assert proposed.after.open < proposed.expected.open
    assert 0.0 < proposed.information <= proposed.entropy


def test_every_kind_of_rival_predicts_what_its_own_fit_does(setting: Setting, diagnosis: Diagnosis) -> None:
    """Nothing missing, another load path, an amplitude with shapes, and the unknown, against fits of their own."""
    weight = dict.fromkeys(("none", "load-path", "gauge-zero", "unknown"), 0.25)
    r = diagnosis.ranking
    # Far from where the springs stand, so that it matters about which point the columns are taken.
    far = replace(setting, typical=3.0 * setting.typical)
    question = Question(far, r, weight, ("gauge-zero",), {c: c for c in weight})
    cycle = Protocol(np.array([375.0]), DOWN, repeats=3)
    q = np.radians([[0.0, 20.0, 90.0, 0.0, -30.0, 0.0], [60.0, -20.0, 60.0, 90.0, 60.0, 0.0]])
    wrench = np.tile([0.0, 0.0, -375.0, 0.0, 0.0, 0.0], (2, 1))
    both = with_candidates(far, LoadedPoses(q, wrench, setting.data.free.at.point[:2]), cycle)
    p = predictions(question, both, diagnosis.weight, cycle)
    L = noise_factors(both, len(setting.data), r.best.noise, cycle)[:, 0, 0]
    mean = {code: p.mean[k, :, 0] * L for k, code in enumerate(p.code)}
    sd = {code: np.linalg.norm(p.factor[k][:, 0], axis=1) * L for k, code in enumerate(p.code)}
    for code, path in (("none", "parallelogram"), ("load-path", "serial")):
        model = build_model(load_description("xr701"), "rigid", path).with_springs(SPRINGS)  # type: ignore[arg-type]
        fitted = setting_of(load_description("xr701"), model, _first())
        own = deflection(fitted.arm, q, wrench)[:, 2]
        # The fit weighs readings alike and knows no priors: they agree within the posterior's own width.
        assert (np.abs(mean[code] - own) < 2.5 * sd[code] + 0.01 * np.abs(own)).all(), code
    # A zero of the gauge is not settled yet, so it adds to the uncertainty; so does the unknown.
    assert (sd["gauge-zero"] > sd["none"]).all()
    assert (sd["unknown"] > sd["none"]).all()
    assert np.max(np.abs(mean["load-path"] - mean["none"]) / sd["none"]) > 5.0


def test_a_law_whose_shapes_are_all_alike_still_has_one(setting: Setting, diagnosis: Diagnosis) -> None:
    """More shapes than a tenth each: none stands out, the best one stands for the law."""
    ripple = catalogue(setting.model, setting.description)["gear-ripple:j2"]
    tooth = next(k for k, p in enumerate(ripple.parameters) if p.role == "shape")
    fine = replace(ripple.parameters[tooth], grid=tuple(np.linspace(100.0, 160.0, 40).tolist()))
    many = replace(ripple, parameters=(*ripple.parameters[:tooth], fine, *ripple.parameters[tooth + 1 :]))
    s = replace(setting, known={"gear-ripple:j2": many})
    weight = {"none": 0.5, "gear-ripple:j2": 0.5}
    question = Question(s, rank(s, diagnosis.weight), weight, (), {c: c for c in weight})
    cycle = Protocol(np.array([375.0]), DOWN, repeats=1)
    at = setting.data.free.at
    p = predictions(
        question, with_candidates(s, LoadedPoses(at.q[:1], at.wrench[:1], at.point[:1]), cycle), diagnosis.weight, cycle
    )
    assert p.code == ("none", "gear-ripple:j2")
    np.testing.assert_allclose(p.weight, 0.5)


@pytest.mark.slow
def test_what_comes_after_a_name_is_asked_where_nothing_rivals_it(setting: Setting) -> None:
    """A gauge zero of the largest usual size is named beyond doubt: the question is what else there may be."""
    off = replace(setting.data, value=setting.data.value + 5e-5)
    s = replace(setting, data=off)
    d = diagnose(s)
    assert [f.code for f in d.effects] == ["gauge-zero"]
    q = question_of(s, d)
    assert [e.effect.code for e in q.setting.accepted] == ["gauge-zero"]
    assert "gauge-zero" not in q.weight
    assert sum(q.weight.values()) == pytest.approx(1.0)
    n = propose(s, d, poses=1, candidates=30, rng=np.random.default_rng(0))
    assert "gauge-zero" not in [r.code for r in n.rivals]


def test_twins_of_one_family_are_asked_about_beside_something_else(setting: Setting, diagnosis: Diagnosis) -> None:
    """Twins hold all the probability and no reading parts them: what is left over joins in, the look stays."""
    none, unknown = diagnosis.ranking.of("none"), diagnosis.ranking.of("unknown")
    twins = [replace(none, code=f"joint-tilt:j{k}", probability=0.499) for k in (2, 3)]
    rest = [replace(none, probability=0.0015), replace(unknown, probability=0.0005)]
    r = replace(diagnosis.ranking, hypotheses=(*twins, *rest), hidden={})
    q = question_of(setting, replace(diagnosis, verdict="ambiguous", rankings=(r, diagnosis.ranking)))
    assert q.ranking is r
    assert list(q.weight) == ["joint-tilt:j2", "joint-tilt:j3", "none"]


@pytest.mark.slow
def test_rivals_of_a_name_that_are_not_ruled_out_are_asked_about(setting: Setting) -> None:
    """A gauge zero is named, and a twin of it is made a tenth as probable: which of the two is the question."""
    s = replace(setting, data=replace(setting.data, value=setting.data.value + 5e-5))
    d = diagnose(s)
    first = d.rankings[0]
    twin = {h.code: 0.1 if h.code == "backlash:j2" else h.probability for h in first.hypotheses}
    r = replace(first, hypotheses=tuple(replace(h, probability=twin[h.code]) for h in first.hypotheses))
    doubted = replace(d, rankings=(r, *d.rankings[1:]))
    assert open_twins(d, {"gauge-zero": ("backlash:j2",)}) == {}
    still = open_twins(doubted, {"gauge-zero": ("backlash:j2",)})
    assert still == {"gauge-zero": ("backlash:j2",)}
    assert open_twins(doubted, {}) == {}
    q = question_of(s, doubted, still)
    assert list(q.weight) == ["gauge-zero", "backlash:j2"]
    assert min(q.weight.values()) >= 1e-3 * 0.99
    assert [e.effect.code for e in q.setting.accepted] == []
    n = propose(s, doubted, still_open=still, poses=1, candidates=30, rng=np.random.default_rng(0))
    assert {r.code for r in n.rivals} == {"gauge-zero", "backlash:j2"}


@pytest.mark.slow
def test_where_no_set_up_tells_anything_none_is_proposed(setting: Setting, diagnosis: Diagnosis) -> None:
    """Two codes of one law predict the same readings whatever is measured."""
    zero = setting.known["gauge-zero"]
    again = replace(zero, code="gauge-null", family="gauge-null")
    s = replace(
        setting, data=replace(setting.data, value=setting.data.value + 5e-5), known={zero.code: zero, again.code: again}
    )
    d = diagnose(s)
    assert d.verdict == "ambiguous"
    with pytest.raises(InputError, match=r"gauge-.* from gauge-"):
        propose(s, d, poses=2, candidates=30, rng=np.random.default_rng(0))


def test_where_nothing_tells_rivals_apart_other_axes_and_loads_are_asked_for() -> None:
    usual = Protocol(np.array([100.0, 300.0]), DOWN)
    ways = [way for way, _ in ways_to_read(usual, loads=True, components=True)]
    assert [w.components for w in ways] == [(2,), (0, 1, 2), (0, 1, 2)]
    assert [w.forces.tolist() for w in ways] == [[100.0, 300.0], [100.0, 300.0], [50.0, 100.0, 200.0, 300.0]]
    assert [w for w, _ in ways_to_read(usual, loads=False, components=False)] == [usual]


def test_more_loads_and_other_directions_are_ways_to_measure(setting: Setting) -> None:
    ways = ways_to_measure(setting)
    most = setting.data.free.at.wrench[:, 2].min()
    assert next(iter(ways)) == ""
    assert ways[""] == {}
    assert [w.get("loads", [0.0])[-1] for w in ways.values() if "loads" in w] == [pytest.approx(-most)]
    np.testing.assert_array_equal(ways["loaded along X, Y and Z"]["directions"], np.diag([1.0, 1.0, -1.0]))


def test_set_ups_are_chosen_as_if_the_unknown_were_not_sure() -> None:
    p = replace(rivals(np.zeros((3, 2, 1)), np.array([0.99, 0.008, 0.002])), code=("unknown", "b", "c"))
    np.testing.assert_allclose(doubted(p).weight, [0.5, 0.4, 0.1])
    for some in (replace(p, code=("a", "b", "c")), replace(p, weight=np.array([0.4, 0.3, 0.3]))):
        assert doubted(some) is some


def test_something_unknown_is_no_name(setting: Setting, diagnosis: Diagnosis) -> None:
    """However sure it is that something unknown is missing, no name is promised."""
    r = diagnosis.ranking
    sure = {h.code: 0.998 if h.code == "unknown" else 0.001 for h in r.hypotheses}
    some = sorted((replace(h, probability=sure[h.code]) for h in r.hypotheses), key=lambda h: -h.probability)
    shaken = replace(diagnosis, verdict="unknown", rankings=(replace(r, hypotheses=tuple(some), hidden={}),))
    q = question_of(setting, shaken)
    q = replace(q, weight={code: 0.998 if code == "unknown" else 0.002 / (len(q.weight) - 1) for code in q.weight})
    protocol = Protocol(np.array([375.0]), DOWN)
    at = setting.data.free.at
    loaded = LoadedPoses(at.q[:1], at.wrench[:1], at.point[:1])
    p = predictions(q, with_candidates(setting, loaded, protocol), diagnosis.weight, protocol)
    n = foresee(q, p, [0], np.random.default_rng(0))
    assert n.before.belief < 0.01
    assert n.after.right < 0.01


def test_chosen_set_ups_tell_more_than_random_ones(setting: Setting, diagnosis: Diagnosis) -> None:
    few = propose(setting, diagnosis, poses=2, candidates=60, rng=np.random.default_rng(5))
    # With no more candidates than set-ups nothing is chosen.
    drawn = [
        propose(setting, diagnosis, poses=2, candidates=8, rng=np.random.default_rng(k)).information for k in range(3)
    ]
    assert few.information > np.mean(drawn)


def test_seed_reproduces_the_choice(setting: Setting, diagnosis: Diagnosis, proposed: NextReadings) -> None:
    again = propose(setting, diagnosis, candidates=60, rng=np.random.default_rng(0))
    np.testing.assert_array_equal(again.q, proposed.q)
    assert again.words == proposed.words
    other = propose(setting, diagnosis, poses=1, candidates=60, rng=np.random.default_rng(7))
    assert not np.array_equal(other.q[0], proposed.q[0])


def test_limits_are_kept(setting: Setting, diagnosis: Diagnosis, proposed: NextReadings) -> None:
    robot = setting.model.robot
    assert robot.reachable(proposed.q).all()
    assert Zone(floor=0.0).free(robot, proposed.q).all()
    assert Zone(floor=0.0).hangs_free(robot, proposed.q).all()
    np.testing.assert_array_equal(proposed.protocol.forces, [150.0, 375.0, 650.0])
    np.testing.assert_allclose(proposed.direction, [[0.0, 0.0, -1.0]] * 3)
    bad = {
        "loads": {"loads": [650.0, 5000.0]},
        "poses": {"poses": 0},
        "directions": {"directions": [(0.0, 0.0, 0.0)]},
        "components": {"components": [7]},
        "repeats": {"repeats": 0},
    }
    for word, change in bad.items():
        refuses("C005 C006", word, propose, setting, diagnosis, rng=np.random.default_rng(0), **change)


def test_poses_are_possible_and_new(setting: Setting) -> None:
    """Off the floor, the base and boxes, with room for the load, and none that was read already."""
    robot = setting.model.robot
    protocol = Protocol(np.array([150.0]), DOWN)
    zone = Zone(0.2, (((0.5, -3.0, 0.0), (3.0, 0.0, 3.0)),), 0.4)
    q = possible_poses(setting, 60, protocol, zone, None, np.random.default_rng(0))
    assert len(q) >= 15
    assert (robot.reachable(q) & zone.free(robot, q) & zone.hangs_free(robot, q)).all()
    read = np.unique(setting.data.free.at.q, axis=0)
    near = replace(setting.data.free.at, q=np.tile(q[:1] + np.radians(2.0), (len(setting.data.free.at.q), 1)))
    there = replace(setting, data=replace(setting.data, free=replace(setting.data.free, at=near)))
    again = possible_poses(there, 60, protocol, zone, None, np.random.default_rng(0))
    assert not (again == q[0]).all(axis=1).any()
    assert (np.abs(q[:, None] - read[None]).max(axis=2) >= np.radians(5.0) - 1e-12).all()
    refuses(
        "C005",
        r"tried|room for a load",
        possible_poses,
        setting,
        60,
        protocol,
        Zone(3.0),
        None,
        np.random.default_rng(0),
    )


def test_directions_are_those_of_the_readings(setting: Setting, diagnosis: Diagnosis) -> None:
    n = propose(setting, diagnosis, poses=1, candidates=30, rng=np.random.default_rng(0))
    np.testing.assert_allclose(n.protocol.directions, DOWN)
    assert n.protocol.hangs
    assert not replace(n.protocol, directions=np.array([[1.0, 0.0, 0.0]])).hangs


def test_random_set_ups_are_measured_like_the_proposed_ones(
    setting: Setting, diagnosis: Diagnosis, proposed: NextReadings
) -> None:
    n = at_random(proposed, setting, Zone(floor=0.0), np.random.default_rng(3))
    assert (len(n.q), n.protocol, n.labels) == (3, proposed.protocol, proposed.labels)
    assert not np.array_equal(n.q, proposed.q)
    assert Zone(floor=0.0).hangs_free(setting.model.robot, n.q).all()


def test_directions_and_loads_as_asked(setting: Setting, diagnosis: Diagnosis) -> None:
    n = propose(
        setting,
        diagnosis,
        poses=2,
        loads=[400.0, 200.0],
        directions=[(0, 0, -2), (1, 0, 0)],
        components=[2, 0],
        unloading=False,
        candidates=30,
        rng=np.random.default_rng(0),
    )
    assert n.protocol.components == (0, 2)
    np.testing.assert_array_equal(n.protocol.forces, [200.0, 400.0])
    assert not n.protocol.unloading
    assert all(tuple(row) in {(0.0, 0.0, -1.0), (1.0, 0.0, 0.0)} for row in n.direction.tolist())


def test_sheet_comes_back_with_its_history(proposed: NextReadings, first: Measurements, tmp_path: Path) -> None:
    robot = _arm().robot
    sheet = proposed.sheet
    assert sheet.n == 3 * 3 * 5
    # The readings name no point, so the sheet asks for none.
    assert np.isnan(sheet.point).all()
    path = tmp_path / "next.csv"
    write_measurements(sheet, path, robot, to_fill=proposed.protocol.columns)
    lines = path.read_text().splitlines()
    column = lines[0].split(",").index("dz_mm")
    cells = [line.split(",") for line in lines[1:]]
    for k, row in enumerate(cells):
        row[column] = f"{-1.0 - 0.01 * k}"
    path.write_text("\n".join([lines[0], *(",".join(row) for row in cells)]) + "\n")
    both = join([first, read_measurements(path, robot)])
    h = history_of(both)
    assert h.is_known
    # Nine cycles so far, nine new ones; the clock goes on over both tables.
    assert int(h.cycle.max()) + 1 == len(PAPER) + 9
    assert np.isfinite(h.clock).all()
    assert h.clock[first.n :].min() > h.clock[: first.n].max()
    np.testing.assert_allclose(both.q[first.n :: 15], proposed.q, atol=1e-9)


@pytest.mark.slow
def test_a_sheet_asks_for_the_point_that_the_readings_were_taken_at() -> None:
    data = read({"payload": {"force": 60.0}}, poses=6, repeats=1)
    s = made_up_setting(replace(data, point=np.tile([0.05, 0.0, 0.2], (data.n, 1))))
    s = replace(s, known={code: s.known[code] for code in ("payload", "gauge-zero")})
    sheet = propose(s, diagnose(s), poses=1, candidates=12, rng=np.random.default_rng(0)).sheet
    np.testing.assert_allclose(sheet.point, np.tile([0.05, 0.0, 0.2], (sheet.n, 1)), atol=1e-12)
