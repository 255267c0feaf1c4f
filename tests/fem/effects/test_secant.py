"""Effects as compliances at a stated load: by hand, against the laws themselves, and how sure they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from effect_arms import LENGTH, SPRINGS, STIFFNESS, of, plausible
from refusals import refuses

from fem import ArmModel, build_model, compliance, compliance_budget, compliance_factor, deflection
from fem.arm import Arm
from fem.effects import catalogue, observed
from fem.effects.learned import learned_laws
from fem.effects.learned_parts import plain_reach
from fem.effects.secant import SecantPart, StatedLoad, with_secants, worth
from robots import ModelDescription, load_description
from robots.arrays import Array

# Some hundred products of numbers of order one.
ROUND_OFF = 1e-9
DOWN, ASLANT = np.array([0.0, 0.0, -1.0]), np.array([0.6, 0.7, -0.4]) / np.sqrt(1.01)
# Effects whose compliance is no sum of squares: they stiffen, or couple.
INDEFINITE = {"wrist-coupling", "cable-package", "partial-load-path"}


def poses(model: ArmModel, n: int = 30) -> Array:
    low, high = model.robot.limits.T
    q = np.random.default_rng(3).uniform(low, high, (40 * n, model.robot.dof))
    return q[model.robot.reachable(q)][:n]


def springy(name: str) -> ArmModel:
    return build_model(load_description(name)).with_springs(SPRINGS)


def test_backlash_of_one_joint_by_hand(boom: Callable[..., ModelDescription]) -> None:
    """``c + b tanh(tau / t) / (2 tau)`` at the torque of the stated load, whatever load is then put on."""
    one_joint = build_model(boom(length=LENGTH, stiffness=STIFFNESS), "rigid")
    gap, crossing, load = 0.8e-3, 40.0, 69.0
    placed = of(one_joint, "backlash:j1", gap=gap, crossing=crossing)
    arm = with_secants(one_joint, [placed], StatedLoad(load * DOWN))
    for degrees in (0.0, 50.0):
        lever = LENGTH * np.cos(np.radians(degrees))
        tau = load * lever
        by_hand = (1.0 / STIFFNESS + 0.5 * gap * np.tanh(tau / crossing) / tau) * lever**2
        q = np.radians([[degrees]])
        assert compliance(arm, q)[0, 2, 2] == pytest.approx(by_hand, rel=1e-12)
        assert deflection(arm, q, np.array([0, 0, -1000.0, 0, 0, 0]))[0, 2] == pytest.approx(-1000.0 * by_hand)


@pytest.mark.parametrize("name", ["xr701", "kr60-3"])
@pytest.mark.parametrize("along", [DOWN, ASLANT])
def test_under_the_stated_load_the_arm_moves_as_its_laws_say(name: str, along: Array) -> None:
    """Every effect of the catalogue, and learned ones: displacement, compliance and its factor along the load."""
    model, load = springy(name), StatedLoad(400.0 * along)
    q, seen = poses(model), set()
    at = load.at(model, q)
    laws = {
        e.code: e
        for e in (*catalogue(model, load_description(name)).values(), *learned_laws(model, plain_reach(model)))
    }
    for effect in laws.values():
        if effect.stage != "arm" or effect.needs_clock:
            continue
        placed = plausible(effect, 0.2 if effect.code.startswith("learned") else 1.0)
        arm = with_secants(model, [placed], load)
        assert arm.secants is not None
        seen.add(effect.family)
        wanted = observed(model, at, [placed])
        found = deflection(arm, q, at.wrench)
        assert found[:, :3] @ along == pytest.approx(wanted[:, :3] @ along, rel=ROUND_OFF), effect.code
        C = compliance(arm, q)
        assert np.einsum("nij,nj->ni", C, at.wrench) == pytest.approx(found, rel=1e-7, abs=1e-12)
        if effect.code in INDEFINITE or effect.code.startswith(("learned-coupling", "learned-load")):
            continue
        assert compliance_factor(arm, q).compliance() == pytest.approx(C, rel=1e-7, abs=1e-15), effect.code
    assert {"backlash", "friction", "hardening", "slip", "loose-base", "cable-package"} <= seen


def test_effects_add_up_and_another_load_has_another_compliance() -> None:
    model = springy("kr60-3")
    placed = [of(model, "backlash:j3", gap=0.6e-3, crossing=60.0), of(model, "hardening:j2", share=0.5, knee=300.0)]
    placed.append(of(model, "loose-base", gap=0.3e-3, closing=200.0))
    q = poses(model)
    stiffness = []
    for newtons in (30.0, 100.0, 500.0):
        load = StatedLoad(newtons * DOWN)
        at = load.at(model, q)
        arm = with_secants(model, placed, load)
        wanted = observed(model, at, placed)[:, 2]
        assert deflection(arm, q, at.wrench)[:, 2] == pytest.approx(wanted, rel=ROUND_OFF)
        stiffness.append(np.median(-newtons / wanted))
        assert [e.effect.code for e in arm.secants.bent] == ["backlash:j3", "hardening:j2", "loose-base"]
        assert isinstance(arm.secants.further[0], SecantPart)
        shares = compliance_budget(arm, q, at.wrench).share
        assert shares.sum(axis=1) == pytest.approx(1.0)
    assert stiffness[0] < 0.8 * stiffness[2]


def test_what_is_linear_is_no_matter_of_the_load() -> None:
    model = springy("xr701")
    ripple = plausible(catalogue(model)["gear-ripple:j2"])
    q = poses(model)
    one, other = (with_secants(model, [ripple], StatedLoad(n * DOWN)) for n in (10.0, 1000.0))
    assert one.secants.bent == ()
    assert compliance(one, q) == pytest.approx(compliance(other, q), rel=ROUND_OFF)


def test_a_joint_that_the_load_does_not_turn_has_the_secant_of_the_largest_torque() -> None:
    """Across the stated load an open gap would say nothing of use; along it nothing changes."""
    model = springy("kr60-3")
    placed, load = of(model, "backlash:j1", gap=0.6e-3, crossing=60.0), StatedLoad(400.0 * DOWN)
    arm, q = with_secants(model, [placed], load), poses(model)
    assert deflection(arm, q, load.at(model, q).wrench) == pytest.approx(deflection(model, q, load.at(model, q).wrench))
    own = arm.joints[0].axial.compliance(q) - model.joints[0].axial.compliance(q)
    # The torque is at most the force times the reach, so the gap adds at least half of itself over that.
    assert (own > 0.3e-3 * np.tanh(1.0) / (400.0 * 4.0)).all()
    assert (own < 0.3e-3 / 60.0).all()


def test_what_goes_by_the_clock_is_left_out_and_weighed() -> None:
    model = springy("xr701")
    warming = of(model, "warming:j2", share=0.3, settling=0.1)
    gauge = of(model, "gauge-scale", share=0.1)
    arm = with_secants(model, [warming, gauge], StatedLoad(400.0 * DOWN))
    assert [e.effect.code for e in arm.secants.left_out] == ["warming:j2"]
    assert arm.secants.carried == ()
    assert np.median(worth(arm, poses(model))) < 0.0
    assert with_secants(model, [gauge], StatedLoad(400.0 * DOWN)) is model


def test_a_joint_that_sticks_is_as_good_as_rigid_and_still_a_part() -> None:
    model, q = springy("kr60-3"), poses(springy("kr60-3"))
    stuck = of(model, "friction:j3", share=1.0, friction=1e6)
    arm = with_secants(model, [stuck], StatedLoad(400.0 * DOWN))
    rigid = model.with_springs({"j3": np.inf})
    assert compliance(arm, q) == pytest.approx(compliance(rigid, q), rel=1e-6, abs=1e-15)
    assert (arm.joints[2].axial.compliance(q) > 0.0).all()
    assert compliance_factor(arm, q).compliance() == pytest.approx(compliance(arm, q), rel=1e-7, abs=1e-15)
    parts = {compliance_budget(arm, q[k : k + 1], np.array([0, 0, -1.0, 0, 0, 0])).parts for k in range(3)}
    assert parts == {compliance_budget(model, q, np.array([0, 0, -1.0, 0, 0, 0])).parts}


def test_an_indefinite_compliance_has_no_factor() -> None:
    model = springy("kr60-3")
    placed = plausible(catalogue(model)["cable-package"])
    arm = with_secants(model, [placed], StatedLoad(400.0 * DOWN))
    refuses("M004", "", compliance_factor, arm, poses(model))


def test_the_arm_keeps_its_load_when_it_is_changed(backlash_arm: Arm) -> None:
    stated = backlash_arm.at_load(StatedLoad(400.0 * DOWN))
    q = poses(stated.model, 3)
    for changed in (stated.with_links("rigid"), stated.as_designed, stated.at_load(StatedLoad(400.0 * DOWN))):
        assert changed.model.secants is not None
        plain = replace(backlash_arm.with_links(changed.model.link_kind), effects=backlash_arm.effects)
        wrench = stated.model.secants.load.at(stated.model, q).wrench
        wanted = observed(plain.model, stated.model.secants.load.at(stated.model, q), plain.effects)
        assert deflection(changed.model, q, wrench)[:, 2] == pytest.approx(wanted[:, 2], rel=ROUND_OFF)


@pytest.fixture(scope="module")
def backlash_arm() -> Arm:
    model = springy("kr60-3")
    arm = Arm.of(load_description("kr60-3"))
    return replace(arm, effects=(of(model, "backlash:j3", gap=0.6e-3, crossing=60.0),))
