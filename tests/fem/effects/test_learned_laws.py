"""Laws without a name: nothing at zero, straight between knots, and in a model file like any other effect."""

from __future__ import annotations

import numpy as np
import pytest

from fem import build_model
from fem.compiled.compliance import deflection
from fem.effects.base import PlacedEffect
from fem.effects.catalogue import effect_of
from fem.effects.learned import KNOTS, axes_of, hats, learned_laws, learned_place
from fem.effects.learned_parts import Reach, plain_reach
from fem.effects.observed import observed
from fem.effects.situation import History
from fem.statics.loads import LoadedPoses
from robots import load_description

N = 6


@pytest.fixture(scope="module")
def model():
    return build_model(load_description("kr60-3"), "rigid")


@pytest.fixture(scope="module")
def at(model) -> LoadedPoses:
    q = np.tile(model.robot.limits.mean(axis=1) + 0.2, (N, 1))
    wrench = np.zeros((N, 6))
    wrench[:, :3] = np.outer([100.0, 200.0, 300.0, 300.0, 200.0, 100.0], [0.4, 0.3, -1.0])
    return LoadedPoses(q, wrench, np.tile([0.05, 0.03, 0.2], (N, 1)))


@pytest.fixture(scope="module")
def history() -> History:
    return History(
        np.zeros(N, dtype=np.intp),
        np.arange(N),
        np.linspace(0.0, 1.0, N),
        is_known=True,
        session=np.repeat([0, 1], [N // 2, N - N // 2]),
        temperature=np.linspace(18.0, 27.0, N),
    )


def laws(model) -> dict:
    return {effect.code: effect for effect in learned_laws(model, plain_reach(model))}


def test_hats_add_up_to_a_straight_line_and_hold_beyond_the_last_knot() -> None:
    u = np.linspace(0.0, 1.0, 21)
    np.testing.assert_allclose(np.array(KNOTS) @ hats(u), u, atol=1e-15)
    np.testing.assert_array_equal(hats(np.array([1.7])), hats(np.array([1.0])))


def test_nothing_happens_at_zero_and_something_elsewhere(model, at, history) -> None:
    plain = deflection(model, at.q, at.wrench, at.point)
    for effect in laws(model).values():
        zero = np.array([p.grid[0] if p.role == "shape" else 0.0 for p in effect.parameters])
        np.testing.assert_allclose(observed(model, at, [PlacedEffect(effect, zero)], history), plain, atol=1e-15)
        some = np.array([p.grid[0] if p.role == "shape" else 0.3 for p in effect.parameters])
        assert np.abs(observed(model, at, [PlacedEffect(effect, some)], history) - plain).max() > 1e-9, effect.code


def test_numbers_in_a_line_are_another_spring(model, at, history) -> None:
    """``theta = c T sum v_k N_k(tau / T)`` with v_k proportional to the knots is a spring softer by that share."""
    effect = laws(model)["learned-torque:j2"]
    values = np.array([0.1 * k for k in (*KNOTS, *(-x for x in KNOTS))] + [effect.parameters[-1].grid[0]])
    softer = model.with_springs({"j2": 1.0 / 1.1 / float(model.joints[1].axial.compliance(at.q)[0])})
    expected = deflection(softer, at.q, at.wrench, at.point)
    np.testing.assert_allclose(observed(model, at, [PlacedEffect(effect, values)], history), expected, rtol=1e-9)


def test_on_the_way_down_the_other_numbers_come_on_top(model, at, history) -> None:
    effect = laws(model)["learned-history:j2"]
    values = np.zeros(len(effect.parameters))
    values[[k for k, p in enumerate(effect.parameters) if p.name.endswith("_down")]] = 0.2
    values[-1] = effect.parameters[-1].grid[0]
    change = observed(model, at, [PlacedEffect(effect, values)], history)
    change = np.abs(change - deflection(model, at.q, at.wrench, at.point)).max(axis=1)
    assert (change[:4] < 1e-15).all()
    assert (change[4:] > 1e-9).all()


def test_a_step_comes_at_its_moment(model, at, history) -> None:
    effect = laws(model)["learned-step:gauge"]
    values = np.array([0.1, 0.0, 0.0, 0.45, 1e-3])
    change = observed(model, at, [PlacedEffect(effect, values)], history) - deflection(model, at.q, at.wrench, at.point)
    np.testing.assert_allclose(change[:, 0], [0.0, 0.0, 0.0, 1e-4, 1e-4, 1e-4], atol=1e-15)


def test_a_model_file_may_hold_them(model) -> None:
    effect = effect_of("learned-angle:j3", model)
    placed = effect.placed({"wave1": 0.1, "wave2": 0.0, "wave3": 0.0, "wave4": 0.0, "low": -1.0, "high": 1.0})
    assert placed.by_name["low"] == -1.0
    assert (learned_place("learned-angle:j3"), axes_of("learned-angle:j3")) == ("j3", ("pose",))


def test_reach_sets_the_knots(model) -> None:
    reach = Reach(np.full(6, 500.0), np.tile([-1.0, 1.0], (6, 1)), 800.0, 400.0, 2e-3)
    effect = next(e for e in learned_laws(model, reach) if e.code == "learned-torque:j1")
    assert effect.parameters[-1].grid == (500.0,)
