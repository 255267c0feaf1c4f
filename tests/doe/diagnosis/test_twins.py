"""Effects that readings cannot tell apart are named together, and neither is named for sure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up import campaign, exactly, few, found_friction, kr60, read, setting

from doe.diagnosis.diagnose import Diagnosis, diagnose
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, signature
from doe.diagnosis.space import cost_of_leaving_out, gaps
from doe.diagnosis.twins import APART, Likeness
from doe.estimation.noise import Noise
from doe.tables.measurements import Measurements
from fem.effects.catalogue import effect_of
from fem.effects.observed import observed
from fem.statics.loads import LoadedPoses
from robots import forward_kinematics, tool_position


def readings(code: str, values: dict[str, float]) -> Measurements:
    """X, Y and Z under forces in all directions, with an effect."""
    description, model = kr60()
    data = campaign(poses=12, repeats=1, components=(0, 1, 2))
    rng = np.random.default_rng(3)
    way = rng.normal(size=(12, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    number = np.array([int(label[1:]) for label in data.pose])
    size = np.linalg.norm(data.wrench[:, :3], axis=1, keepdims=True)
    data = replace(data, wrench=np.hstack([size * way[number], np.zeros((data.n, 3))]))
    exact = exactly(model, data, (effect_of(code, model, description).placed(values),))
    noisy = exact * (1.0 + 0.01 * rng.normal(size=exact.shape)) + 2e-6 * rng.normal(size=exact.shape)
    return replace(data, displacement=np.where(np.isnan(data.displacement), np.nan, noisy))


@pytest.fixture(scope="module")
def turned() -> Diagnosis:
    return diagnose(few(setting(readings("turned-frame", {"rx": 0.0, "ry": 0.0, "rz": np.radians(3.0)}))))


def test_exact_twins_make_the_verdict_ambiguous(turned: Diagnosis) -> None:
    assert turned.verdict == "ambiguous"
    assert {turned.provisional[0].code, *turned.same} == {"turned-frame", "joint-zero-offset:j1"}
    angle = turned.provisional[0].placed.by_name
    assert abs(angle.get("rz", angle.get("angle", 0.0))) == pytest.approx(np.radians(3.0), abs=np.radians(0.3))


def test_each_is_the_others_twin(turned: Diagnosis) -> None:
    twins = turned.twins(["turned-frame", "joint-zero-offset:j1"])
    assert "joint-zero-offset:j1" in twins["turned-frame"]
    assert "turned-frame" in twins["joint-zero-offset:j1"]


@pytest.mark.slow
def test_a_flipped_sign_is_found_like_another_load_path() -> None:
    d = diagnose(few(setting(readings("angle-sign:j3", {})), "angle-sign:j3"))
    assert d.rankings[0].hypotheses[0].code == "angle-sign:j3"
    assert d.after.fit_rms_mm < 0.2 * d.before.fit_rms_mm


# ------------------------------------------------------------
# Twins have the signs that they can have; where it is asked, plausible sizes too


@pytest.fixture(scope="module")
def s() -> Setting:
    _, model = kr60()
    data = campaign(poses=12, repeats=1)
    return setting(replace(data, displacement=np.where(np.isnan(data.displacement), np.nan, exactly(model, data, ()))))


@pytest.fixture(scope="module")
def like(s: Setting) -> Likeness:
    return Likeness(s, Noise((2e-6, 2e-6)), np.ones(len(s.data)))


def sign(s: Setting, code: str, values: dict[str, float]) -> Signature:
    description, model = kr60()
    placed = effect_of(code, model, description).placed(values)
    return signature(s, placed.effect, placed.values)


@pytest.mark.parametrize(
    ("times", "same"), [(1.0, True), (1.2, True), (5.0, False), (0.05, False), (-1.0, True), (-5.0, False)]
)
def test_a_twin_of_implausible_size_is_none_where_size_counts(
    s: Setting, like: Likeness, times: float, *, same: bool
) -> None:
    c = sign(s, "payload", {"force": 20.0})
    change = times * c.columns[:, 0] * c.effect.parameters[0].upper
    assert like.left(change, [c]) < 1e-6 * like.strength(change) + 1e-6  # any size does
    assert (like.left(change, [c], plausible=True) < APART) is same


def test_what_can_be_neither_less_than_nothing_imitates_no_minus(s: Setting, like: Likeness) -> None:
    c = sign(s, "backlash:j2", {"gap": 8e-4, "crossing": 20.0, "preload": 0.0})
    change = c.columns[:, 0] * 8e-4
    for plausible in (False, True):
        assert like.left(change, [c], plausible=plausible) < 1e-6 * like.strength(change) + 1e-6
        assert like.left(-change, [c], plausible=plausible) > APART


def test_of_an_effect_of_both_kinds_the_one_without_a_sign_keeps_to_it(s: Setting, like: Likeness) -> None:
    """An own effect may have an amplitude that cannot be negative beside one that can."""
    gap = sign(s, "backlash:j2", {"gap": 8e-4, "crossing": 20.0, "preload": 0.0})
    force = sign(s, "payload", {"force": 20.0})
    both = replace(
        gap,
        effect=replace(gap.effect, parameters=(*gap.effect.parameters, *force.effect.parameters)),
        rows=np.hstack([gap.columns, force.columns]),
        alike=None,
        positive=np.array([True, False]),
    )
    plus, minus = gap.columns[:, 0] * 8e-4, force.columns[:, 0] * -20.0
    assert like.left(plus + minus, [both]) < 1e-6 * like.strength(plus + minus) + 1e-6
    assert like.left(plus + minus, [both], plausible=True) < 1e-6 * like.strength(plus + minus) + 1e-6
    assert like.left(minus - plus, [both]) > APART
    # Were it free to be negative it would do.
    assert like.left(minus - plus, [replace(both, positive=np.zeros(2, dtype=bool))]) < APART


def test_of_several_amplitudes_one_may_be_nothing(s: Setting, like: Likeness) -> None:
    c = sign(s, "load-misalignment", {"tilt_x": 0.0, "tilt_y": 0.0})
    change = c.columns[:, 1] * 0.05
    assert like.left(change, [c], plausible=True) < 1e-6 * like.strength(change) + 1e-6


def test_twins_of_plausible_size_are_some_of_all_twins() -> None:
    d = found_friction()
    every, plausible = d.twins(["friction:j2"])["friction:j2"], d.plausible_twins("friction:j2")
    assert plausible is not None
    assert set(plausible) <= set(every)
    weak = replace(d, after=replace(d.after, refit=replace(d.after.refit, noise=Noise((1.0, 1.0)))))
    assert weak.plausible_twins("friction:j2") is None


# ------------------------------------------------------------
# A diagnosis in space: gaps at the tool points, and what leaving an effect out costs where nothing was measured


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return diagnose(few(setting(read({"payload": {"force": 40.0}}, poses=10, repeats=1, seed=1))))


def test_gaps_stand_at_the_tool_and_leave_unread_components_open(found: Diagnosis) -> None:
    g, robot = gaps(found), kr60()[1].robot
    np.testing.assert_allclose(g.point, tool_position(robot, forward_kinematics(robot, g.q)), atol=1e-12)  # round-off
    assert np.isnan(g.before[:, :2]).all()
    assert len(g.pose) == len(found.before.residual)
    np.testing.assert_array_equal(g.before[:, 2], found.before.residual)
    np.testing.assert_array_equal(g.after[:, 2], found.after.residual)
    np.testing.assert_allclose(g.measured[:, 2], found.before.setting.data.value, rtol=0)


def test_an_effect_of_the_measurement_costs_only_by_the_springs_it_bent(found: Diagnosis) -> None:
    model, rng = kr60()[1], np.random.default_rng(3)
    q = rng.uniform(-0.5, 0.5, (5, 6))
    at = LoadedPoses(
        q, np.tile([0.0, 0.0, -450.0, 0.0, 0.0, 0.0], (5, 1)), np.tile(model.robot.T_flange_tool[:3, 3], (5, 1))
    )
    cost = cost_of_leaving_out(found, at)
    springs = observed(found.after.setting.arm, at, ()) - observed(found.before.setting.arm, at, ())
    np.testing.assert_array_equal(cost, springs[:, :3])
    assert np.abs(cost).max() > 1e-6


def test_which_effects_go_on_acting() -> None:
    description, model = kr60()
    lasting = {
        "joint-zero-offset:j2": True,
        "backlash:j2": True,
        "base-tilt": True,
        "payload": False,
        "drift": False,
        "gauge-zero": False,
        "load-misalignment": False,
    }
    assert {code: effect_of(code, model, description).of_the_arm for code in lasting} == lasting
