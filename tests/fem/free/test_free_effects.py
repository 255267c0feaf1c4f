"""Effects in a model with numbers set free: predictions, derivatives, and the fast path beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses

from fem import ArmModel, build_model
from fem.effects import History, PlacedEffect, catalogue, observed
from fem.free.model import FreeModel, LoadedPoses
from fem.free.parameters import FourierBasis, FreeLaw, Parameter, law_parameters, parameter
from robots import load_description

DESCRIPTION = load_description("xr701")
VALUES = {
    "friction:j2": {"share": 0.9, "friction": 60.0},
    "backlash:j3": {"gap": 4e-4, "crossing": 140.0, "preload": 0.0},
    "angle-dependent-stiffness:j3": {"cos1": 0.2, "sin1": 0.1, "cos2": 0.0, "sin2": 0.0},
    "payload": {"force": 30.0},
    "gauge-zero": {"x": 0.0, "y": 0.0, "z": 3e-5},
    "base-tilt": {"stiffness_x": 2e7, "stiffness_y": 3e7},
}
LINEAR = (
    "j2.stiffness",
    "j3.stiffness",
    "j4.rx",
    "base.tz",
    "j2.ty-rx",
    "tool.tx",
    "upper-arm.modulus",
    "bar.stiffness",
)
BENT = (
    "j2.zero",
    "load.x",
    "friction:j2.share",
    "friction:j2.friction",
    "backlash:j3.gap",
    "backlash:j3.crossing",
    "payload.force",
    "base-tilt.stiffness_y",
    "gauge-zero.z",
    "angle-dependent-stiffness:j3.cos1",
)
# Central differences with other steps: third-order errors of both, and round-off of 1e-16 over the steps.
DIFFERENCES = 1e-5


@pytest.fixture(scope="module")
def arm() -> ArmModel:
    return build_model(DESCRIPTION).with_springs({"j1": 3e6, "j2": 1.4e6, "j3": 0.8e6, "j4": 1e6, "j5": 1e6, "j6": 1e6})


@pytest.fixture(scope="module")
def effects(arm: ArmModel) -> tuple[PlacedEffect, ...]:
    known = catalogue(arm, DESCRIPTION)
    return tuple(known[code].placed(values) for code, values in VALUES.items())


@pytest.fixture(scope="module")
def at(arm: ArmModel) -> LoadedPoses:
    rng = np.random.default_rng(4)
    q = rng.uniform(*arm.robot.limits.T, (200, 6))
    q = np.repeat(q[arm.robot.reachable(q)][:5], 4, axis=0)
    wrench = np.zeros((20, 6))
    wrench[:, 2] = np.tile([-200.0, -650.0, -650.0, -200.0], 5)
    wrench[:, 1] = 0.1 * wrench[:, 2]
    return LoadedPoses(q, wrench, np.tile(arm.robot.T_flange_tool[:3, 3], (20, 1)))


HISTORY = History(np.repeat(np.arange(5), 4), np.tile(np.arange(4), 5), np.linspace(0, 1, 20), is_known=True)


def free(arm: ArmModel, at: LoadedPoses, names: tuple[str, ...], effects: tuple[PlacedEffect, ...]) -> FreeModel:
    given = tuple(parameter(arm, name, effects) for name in names)
    return FreeModel(arm, given, at, effects=effects, history=HISTORY)


def test_at_the_models_own_numbers_it_is_what_is_observed(
    arm: ArmModel, at: LoadedPoses, effects: tuple[PlacedEffect, ...]
) -> None:
    model = free(arm, at, ("j2.stiffness", "friction:j2.friction", "upper-arm.modulus", "payload.force"), effects)
    expected = observed(arm, at, effects, HISTORY)
    np.testing.assert_allclose(model.evaluate(model.start)[0], expected, rtol=1e-10, atol=1e-16)


def test_other_numbers_are_those_of_the_model_with_them(
    arm: ArmModel, at: LoadedPoses, effects: tuple[PlacedEffect, ...]
) -> None:
    names = ("j2.stiffness", "j3.stiffness", "friction:j2.friction", "base-tilt.stiffness_y")
    model = free(arm, at, names, effects)
    u = np.array([p.inner(v) for p, v in zip(model.parameters, (1e6, 2e6, 90.0, 5e7), strict=True)])
    known = catalogue(arm, DESCRIPTION)
    changed = {
        **VALUES,
        "friction:j2": {"share": 0.9, "friction": 90.0},
        "base-tilt": {"stiffness_x": 2e7, "stiffness_y": 5e7},
    }
    others = [known[code].placed(values) for code, values in changed.items()]
    expected = observed(arm.with_springs({"j2": 1e6, "j3": 2e6}), at, others, HISTORY)
    np.testing.assert_allclose(model.displacement(u), expected, rtol=1e-10, atol=1e-16)
    np.testing.assert_array_equal(model.displacements(np.array([u, model.start]))[0], model.displacement(u))


@pytest.mark.parametrize("name", LINEAR)
def test_readings_stay_linear_in_stiffnesses(
    name: str, arm: ArmModel, at: LoadedPoses, effects: tuple[PlacedEffect, ...]
) -> None:
    model = free(arm, at, (name,), effects)
    assert model.is_linear
    start, J = model.start, model.evaluate(model.start)[1]
    low, high = model.parameters[0].inner_bounds
    for there in (low + 0.003 * (high - low), low + 0.2 * (high - low)):
        predicted = model.displacement(start) + J[:, :, 0] * (there - start[0])
        found = model.displacement(np.array([there]))
        # Round-off of the largest prediction.
        np.testing.assert_allclose(predicted, found, rtol=0.0, atol=1e-10 * np.abs(found).max())


@pytest.mark.parametrize("name", BENT)
def test_derivatives_by_what_bends(
    name: str, arm: ArmModel, at: LoadedPoses, effects: tuple[PlacedEffect, ...]
) -> None:
    model = free(arm, at, (name, "j2.stiffness"), effects)
    u, J = model.start, model.evaluate(model.start)[1][:, :, 0]
    p = model.parameters[0]
    h = {"log": 1e-3, "compliance": 3e-3 * abs(u[0])}.get(p.scale, 3e-3 * abs(u[0]) if p.kind.of_effect else 3e-5)
    step = np.array([h, 0.0])
    up, down = model.displacement(u + step), model.displacement(u - step)
    assert np.abs(J).max() > 0.0
    np.testing.assert_allclose((up - down) / (2 * h), J, rtol=0.0, atol=DIFFERENCES * np.abs(J).max())


def test_a_law_over_angles_under_friction(arm: ArmModel, at: LoadedPoses, effects: tuple[PlacedEffect, ...]) -> None:
    basis = FourierBasis(1, 1)
    given = tuple(law_parameters(arm, "j2", basis))
    model = FreeModel(arm, given, at, (FreeLaw("j2", basis, 0),), effects=effects, history=HISTORY)
    value, J = model.evaluate(model.start)
    np.testing.assert_allclose(value, observed(arm, at, effects, HISTORY), rtol=1e-9, atol=1e-15)
    # The level is the logarithm of the whole stiffness: its slope is minus what joint 2 gives, friction included.
    stiff = observed(arm.with_springs({"j2": np.inf}), at, effects, HISTORY)
    np.testing.assert_allclose(J[:, :, 0], stiff - value, rtol=0.0, atol=1e-7 * np.abs(J).max())


def test_a_spring_with_friction_gives_less_than_one_without(arm: ArmModel, at: LoadedPoses) -> None:
    known = catalogue(arm, DESCRIPTION)
    friction = (known["friction:j2"].placed({"share": 1.0, "friction": 1e6}),)
    J = free(arm, at, ("j2.stiffness",), friction).evaluate(np.array([1e-6]))[1]
    # Friction that is never overcome holds all: the spring does not matter.
    plain = FreeModel(arm, (parameter(arm, "j2.stiffness"),), at).evaluate(np.array([1e-6]))[1]
    assert np.abs(J).max() < 1e-12 * np.abs(plain).max()


def test_part_of_the_poses_keep_their_cycles(arm: ArmModel, at: LoadedPoses, effects: tuple[PlacedEffect, ...]) -> None:
    model = free(arm, at, ("j2.stiffness",), effects)
    rows = np.array([3, 9, 11])
    some, kept = model.take(rows)
    assert len(some.at) == 8
    np.testing.assert_array_equal(some.displacement(model.start)[kept], model.displacement(model.start)[rows])


def test_without_effects_nothing_is_differenced(
    arm: ArmModel, at: LoadedPoses, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FreeModel, "_differences", lambda *_: pytest.fail("differences without effects"))
    model = FreeModel(arm, (parameter(arm, "j2.stiffness"),), at)
    assert model.evaluate(model.start)[1].any()


def test_a_users_law_is_not_taken_for_linear(arm: ArmModel, at: LoadedPoses, effects: tuple[PlacedEffect, ...]) -> None:
    own = tuple(replace(e, effect=replace(e.effect, own=True)) for e in effects)
    assert not free(arm, at, ("j2.stiffness",), own).is_linear
    exact, small = (free(arm, at, ("j2.stiffness",), e).evaluate(np.array([1e-6]))[1] for e in (effects, own))
    np.testing.assert_allclose(small, exact, rtol=0.0, atol=1e-8 * np.abs(exact).max())


def test_ranges_and_names(arm: ArmModel, effects: tuple[PlacedEffect, ...]) -> None:
    def p(name: str) -> Parameter:
        return parameter(arm, name, effects)

    assert (p("backlash:j3.gap").unit, p("backlash:j3.gap").lower) == ("rad", 0.0)
    assert p("gauge-zero.z").lower == pytest.approx(-6e-4)
    assert p("friction:j2.friction").scale == "log"
    assert p("base-tilt.stiffness_x").value == pytest.approx(2e7)
    refuses("M001", r"friction:j2.\{share\|friction\|carried\}", p, "friction:j4.friction")
    refuses(
        "M001",
        "allowed: effects here: none",
        FreeModel,
        arm,
        (p("backlash:j3.gap"),),
        LoadedPoses(np.zeros((1, 6)), np.zeros((1, 6)), np.zeros((1, 3))),
    )
