"""What holds for every effect: nothing at zero, in proportion to its amplitudes, and equal to numbers in the file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from effect_arms import SPRINGS, extra, of, plausible
from refusals import refuses

from fem import ArmModel, build_model, deflection
from fem.effects import Effect, History, PlacedEffect, catalogue, effect_of, observed
from fem.effects.observed import spring_influences
from fem.statics.loads import LoadedPoses
from robots import ModelDescription, load_description
from robots.kinematics import forward_kinematics

DESCRIPTION = load_description("xr701")
CODES = list(catalogue(build_model(DESCRIPTION), DESCRIPTION))
# Turning a load or an arm is linear in the angle but for its square; a spring's share may end at a tenth.
BENT = (
    "joint-zero-offset",
    "load-misalignment",
    "gravity-compensator",
    "link-flexibility",
    "turned-frame",
    "tool-point-offset",
    "partial-load-path",
    "cable-package",
)


@pytest.fixture(scope="module")
def arm() -> ArmModel:
    return build_model(DESCRIPTION).with_springs(SPRINGS)


@pytest.fixture(scope="module")
def known(arm: ArmModel) -> dict[str, Effect]:
    return catalogue(arm, DESCRIPTION)


@pytest.fixture(scope="module")
def at(arm: ArmModel) -> LoadedPoses:
    rng = np.random.default_rng(2)
    low, high = arm.robot.limits.T
    q = rng.uniform(low, high, (200, 6))
    q = np.repeat(q[arm.robot.reachable(q)][:6], 3, axis=0)
    wrench = np.zeros((18, 6))
    wrench[:, 2] = np.tile([-150.0, -650.0, -300.0], 6)
    wrench[9:, 1] = 120.0
    # Beside the last axis, so that every joint is loaded somewhere.
    return LoadedPoses(q, wrench, np.tile(arm.robot.T_flange_tool[:3, 3] + np.array([0.15, 0.1, 0.0]), (18, 1)))


HISTORY = History(np.repeat(np.arange(6), 3), np.tile(np.arange(3), 6), np.linspace(0.0, 1.0, 18), is_known=True)


def test_codes_of_the_issue() -> None:
    families = {code.partition(":")[0] for code in CODES}
    assert families == {
        "joint-compliance",
        "joint-tilt",
        "angle-dependent-stiffness",
        "hardening",
        "softening",
        "backlash",
        "friction",
        "payload",
        "gravity-compensator",
        "base-tilt",
        "base-vertical",
        "parallelogram-bar",
        "load-path",
        "link-flexibility",
        "tool-compliance",
        "load-point-offset",
        "load-misalignment",
        "joint-zero-offset",
        "gauge-zero",
        "gauge-scale",
        "drift",
        "gear-ripple",
        "wrist-coupling",
        "turned-frame",
        "tool-point-offset",
        "angle-sign",
        "angle-offset",
        "angle-coupling",
        "creep",
        "warming",
        "slip",
        "stick-slip",
        "loose-base",
        "cable-package",
        "partial-load-path",
    }
    assert len(CODES) == len(set(CODES))


@pytest.mark.parametrize(
    "code", [c for c in CODES if not c.startswith(("load-path", "angle-sign", "angle-offset", "angle-coupling"))]
)
def test_nothing_at_zero_and_in_proportion(code: str, arm: ArmModel, known: dict[str, Effect], at: LoadedPoses) -> None:
    effect = known[code]
    plain = deflection(arm, at.q, at.wrench, at.point)
    size = np.abs(plain[:, :3]).max()
    none, half, whole = (extra(arm, at, plausible(effect, s), HISTORY) for s in (0.0, 0.5, 1.0))
    assert np.abs(none).max() <= 1e-15
    assert np.abs(whole).max() > 1e-4 * size
    bent = 0.3 if code.startswith(BENT) else 1e-9
    assert np.abs(whole - 2.0 * half).max() <= bent * max(np.abs(whole).max(), 1e-12)


@pytest.mark.parametrize("code", CODES)
def test_repeats_read_as_the_first_time(code: str, arm: ArmModel, known: dict[str, Effect], at: LoadedPoses) -> None:
    rows = np.tile(np.arange(len(at)), 2)
    again = LoadedPoses(at.q[rows], at.wrench[rows], at.point[rows])
    assert len(again.distinct[0]) == len(at)
    then = replace(HISTORY.take(rows), cycle=HISTORY.cycle[rows] + 6 * (np.arange(len(rows)) >= len(at)))
    placed = [plausible(known[code])]
    once = observed(arm, at, placed, HISTORY)
    np.testing.assert_allclose(observed(arm, again, placed, then), once[rows], rtol=0.0, atol=1e-16)


@pytest.mark.parametrize("code", CODES)
def test_readings_go_straight_with_the_springs(
    code: str, arm: ArmModel, known: dict[str, Effect], at: LoadedPoses
) -> None:
    placed = [plausible(known[code])]
    joints = ("j2", "j5")
    exact = spring_influences(arm, at, placed, joints, HISTORY)
    assert exact is not None
    softer = {name: 1.0 / (1.0 / SPRINGS[name] + 1e-7) for name in joints}
    now = observed(arm, at, placed, HISTORY)
    for k, name in enumerate(joints):
        slope = (observed(arm.with_springs({name: softer[name]}), at, placed, HISTORY) - now) / 1e-7
        np.testing.assert_allclose(exact[:, :, k], slope, rtol=0.0, atol=1e-7 * np.abs(slope).max())


@pytest.mark.parametrize("code", [c for c in CODES if c.split(":")[0] in BENT])
def test_bent_laws_are_linear_for_small_amplitudes(
    code: str, arm: ArmModel, known: dict[str, Effect], at: LoadedPoses
) -> None:
    small, half = (extra(arm, at, plausible(known[code], s), HISTORY) for s in (1e-5, 0.5e-5))
    assert np.abs(small - 2.0 * half).max() <= 1e-4 * max(np.abs(small).max(), 1e-15)


@pytest.mark.parametrize(
    ("code", "values", "keys"),
    [
        ("base-tilt", {"stiffness_x": 3e6, "stiffness_y": 5e6}, {"base": {"rx": 3e6, "ry": 5e6}}),
        ("base-vertical", {"stiffness": 2e7}, {"base": {"tz": 2e7}}),
        (
            "tool-compliance",
            {"stiffness_x": 4e6, "stiffness_y": 5e6, "stiffness_z": 2e7},
            {"tool": {"tx": 4e6, "ty": 5e6, "tz": 2e7}},
        ),
        ("joint-tilt:j2", {"stiffness_x": 1e6, "stiffness_y": 2e6, "turning": 1.0}, {"j2": {"rx": 1e6, "ry": 2e6}}),
    ],
)
def test_model_effects_equal_the_number_in_the_file(
    code: str, values: dict[str, float], keys: dict[str, dict[str, float]], arm: ArmModel, at: LoadedPoses
) -> None:
    ((place, rows),) = keys.items()
    figures = {
        r: {"value": v, "unit": "N/m" if r.startswith("t") else "N m/rad", "source": "assumed"} for r, v in rows.items()
    }
    data = DESCRIPTION.model_dump(by_alias=True)
    if place == "base":
        data["base"] = figures
    elif place == "tool":
        zero = {"value": (0.0, 0.0, 0.0), "unit": "m", "source": "definition"}
        data["tool"] = {**(data["tool"] or {"xyz": zero}), "stiffness": figures}
    else:
        next(j for j in data["joint"] if j["name"] == place)["bearing"] = figures
    file = build_model(ModelDescription.model_validate(data)).with_springs(SPRINGS)
    expected = deflection(file, at.q, at.wrench, at.point)
    np.testing.assert_allclose(observed(arm, at, [of(arm, code, **values)]), expected, rtol=1e-11, atol=1e-18)


def test_a_joint_held_rigid_gives_way_as_if_the_file_had_its_spring(arm: ArmModel, at: LoadedPoses) -> None:
    stiff = arm.with_springs({"j3": np.inf})
    found = observed(stiff, at, [of(stiff, "joint-compliance:j3", stiffness=SPRINGS["j3"])])
    np.testing.assert_allclose(found, deflection(arm, at.q, at.wrench, at.point), rtol=1e-11, atol=1e-18)
    # Of one that has a spring it comes on top: compliances in series add.
    twice = observed(arm, at, [of(arm, "joint-compliance:j3", stiffness=SPRINGS["j3"])])
    soft = arm.with_springs({"j3": SPRINGS["j3"] / 2.0})
    np.testing.assert_allclose(twice, deflection(soft, at.q, at.wrench, at.point), rtol=1e-11, atol=1e-18)


def test_a_housing_tilts_as_a_bearing_that_did_not_turn(arm: ArmModel, at: LoadedPoses) -> None:
    fixed = of(arm, "joint-tilt:j4", stiffness_x=1e6, stiffness_y=3e6, turning=0.0)
    turned = of(arm, "joint-tilt:j4", stiffness_x=1e6, stiffness_y=3e6, turning=1.0)
    assert np.abs(extra(arm, at, fixed) - extra(arm, at, turned)).max() > 1e-6
    still = replace(at, q=at.q * np.array([1.0, 1.0, 1.0, 0.0, 1.0, 1.0]))
    np.testing.assert_allclose(extra(arm, still, fixed), extra(arm, still, turned), rtol=1e-11, atol=1e-17)
    # Alike in both directions, it does not matter which part they turn with.
    both = [of(arm, "joint-tilt:j4", stiffness_x=2e6, stiffness_y=2e6, turning=t) for t in (0.0, 1.0)]
    np.testing.assert_allclose(extra(arm, at, both[0]), extra(arm, at, both[1]), rtol=1e-10, atol=1e-17)


def test_load_path_equals_the_other_load_path(arm: ArmModel, at: LoadedPoses) -> None:
    other = build_model(DESCRIPTION, load_path="serial").with_springs(SPRINGS)
    there, back = of(arm, "load-path", DESCRIPTION), of(other, "load-path", DESCRIPTION)
    np.testing.assert_array_equal(observed(arm, at, [there]), deflection(other, at.q, at.wrench, at.point))
    np.testing.assert_array_equal(observed(other, at, [back]), deflection(arm, at.q, at.wrench, at.point))


def test_parallelogram_bar_and_its_stiffness_in_series(arm: ArmModel, at: LoadedPoses) -> None:
    assert arm.bar is not None
    added = 1.0 / 5e7
    soft = replace(arm, bar=replace(arm.bar, compliance=arm.bar.compliance + added))
    expected = deflection(soft, at.q, at.wrench, at.point)
    found = observed(arm, at, [of(arm, "parallelogram-bar", stiffness=5e7)])
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-18)


@pytest.mark.parametrize("name", ["forearm", "upper-arm"])
def test_link_flexibility_is_a_smaller_modulus(name: str, arm: ArmModel, at: LoadedPoses) -> None:
    data = DESCRIPTION.model_dump(by_alias=True)
    link = next(x for x in data["link"] if x["name"] == name)
    E = DESCRIPTION.materials[link["material"]].youngs_modulus.si
    link["youngs_modulus"] = {"value": E / 1.4, "unit": "Pa", "source": "assumed"}
    soft = build_model(ModelDescription.model_validate(data)).with_springs(SPRINGS)
    expected = deflection(soft, at.q, at.wrench, at.point)
    placed = of(arm, f"link-flexibility:{name}", DESCRIPTION, share=0.4)
    np.testing.assert_allclose(observed(arm, at, [placed]), expected, rtol=1e-9, atol=1e-15)
    changed = placed.effect.law(arm, None, placed.values)
    part = next(x for x in changed.links if x.name == name)
    whole = next(x for x in soft.links if x.name == name)
    np.testing.assert_allclose(part.element.stiffness, whole.element.stiffness, rtol=1e-6, atol=1e-3)
    assert part.mesh.youngs_modulus == pytest.approx(E / 1.4)


def test_a_link_held_rigid_gets_its_described_beam(arm: ArmModel, at: LoadedPoses) -> None:
    rigid = build_model(DESCRIPTION, links="rigid").with_springs(SPRINGS)
    names = [x.name for x in arm.links]
    beams = [of(rigid, f"link-flexibility:{name}", DESCRIPTION, share=1.0) for name in names]
    # Bar and crank stay rigid with rigid links.
    assert arm.bar is not None
    assert rigid.bar is not None
    expected = deflection(replace(arm, bar=rigid.bar), at.q, at.wrench, at.point)
    np.testing.assert_allclose(observed(rigid, at, beams), expected, rtol=1e-11, atol=1e-17)


def test_wrist_coupling_is_reciprocal(arm: ArmModel, at: LoadedPoses) -> None:
    placed = of(arm, "wrist-coupling", coupling=1e-6)
    n = len(at)
    C = np.zeros((n, 6, 6))
    for k in range(6):
        C[:, :, k] = extra(arm, LoadedPoses(at.q, np.tile(np.eye(6)[k], (n, 1)), at.point), placed)
    np.testing.assert_allclose(C, C.swapaxes(1, 2), rtol=0.0, atol=1e-12 * np.abs(C).max())
    assert np.abs(C).max() > 0.0


def test_wrist_coupling_by_hand(arm: ArmModel, at: LoadedPoses) -> None:
    frames = forward_kinematics(arm.robot, at.q)
    tool = frames.p_flange + np.einsum("nij,nj->ni", frames.R_flange, at.point)
    turn = {}
    for k in (4, 5):
        axis, lever = frames.axis[:, k - 1], tool - frames.p[:, k]
        turn[k] = np.hstack([np.cross(axis, lever), axis])
    tau = {k: np.sum(turn[k] * at.wrench, axis=1) for k in turn}
    expected = 1e-6 * (turn[5] * tau[4][:, None] + turn[4] * tau[5][:, None])
    np.testing.assert_allclose(extra(arm, at, of(arm, "wrist-coupling", coupling=1e-6)), expected, rtol=0, atol=1e-14)


def test_effects_of_an_arm_that_cannot_have_them() -> None:
    small = build_model(load_description("kr60-3"))
    known = catalogue(small, load_description("kr60-3"))
    assert "load-path" not in known
    assert "parallelogram-bar" not in known
    refuses("M011", "gear-ripple:j9", effect_of, "gear-ripple:j9", small)


def test_stages_act_in_their_order(arm: ArmModel, known: dict[str, Effect], at: LoadedPoses) -> None:
    """Load first, then the arm, then the gauge, in whatever order effects are named."""
    some = [plausible(known[c]) for c in ("gauge-scale", "gauge-zero", "hardening:j2", "payload", "base-tilt")]
    reordered = [some[0], some[1], some[4], some[3], some[2]]
    np.testing.assert_array_equal(observed(arm, at, some), observed(arm, at, reordered))
    scale = some[0].values[0]
    inner = observed(arm, at, some[2:])
    expected = inner * (1.0 + scale)
    expected[:, :3] += some[1].values
    np.testing.assert_allclose(observed(arm, at, some), expected, rtol=1e-12)


def test_numbers_that_do_not_fit(known: dict[str, Effect]) -> None:
    refuses("M011", r"unknown gop", known["backlash:j2"].placed, {"gop": 1.0})
    refuses("M011", r"missing crossing", known["backlash:j2"].placed, {"gap": 1e-3, "preload": 1.0})
    refuses("M011", r"above 0", known["base-vertical"].placed, {"stiffness": 0.0})
    assert PlacedEffect(known["base-vertical"], np.array([0.0])).by_name == {"stiffness": np.inf}
