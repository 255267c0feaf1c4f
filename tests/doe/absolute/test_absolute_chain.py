"""Positions of an arm with errors: by independent code, and their derivatives by differences."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_positions import Plan, Truth, campaign, position
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from doe.absolute.chain import Nominal, Sample, evaluate, samples
from doe.absolute.readings import AbsoluteReadings, Labels, Payload
from doe.absolute.structure import twins
from doe.absolute.turns import left_rate, nearest_rotation, rotation, turned
from doe.absolute.unknowns import Layout, unknowns
from fem import ArmModel, build_model
from robots import load_description

ALL = (
    "geometry",
    "ratios",
    "coupling",
    "periodic4",
    "springs",
    "tilts",
    "base",
    "rail",
    "payload",
    "j2.tx",
    "growth",
    "drift",
    "bump10.x",
    "bump10.ry",
)
SIZE = {
    "frame": 1e-3,
    "zero": 1e-2,
    "ratio": 1e-3,
    "coupling": 1e-3,
    "periodic": 1e-3,
    "spring": 1e-6,
    "payload": 1.0,
    "rail": 1e-2,
    "target": 0.1,
    "growth": 1e-4,
    "drift": 1e-3,
    "reversal": 1e-3,
    "mass": 0.1,
}
LOADS = (Payload(0.0, np.zeros(3)), Payload(40.0, np.array([0.05, 0.02, 0.1])))


def made(model: ArmModel, seed: int = 0) -> tuple[AbsoluteReadings, Layout, np.ndarray, Nominal]:
    """Readings on a rail with two payloads and two targets, all unknowns with values, and what levers refer to."""
    plan = Plan(6, targets=2, payloads=LOADS, rail=2.0)
    rng = np.random.default_rng(seed)
    data = campaign(model, Truth({"rail.x": 1.0}), plan, rng)
    data = replace(
        data,
        time=rng.uniform(0.0, 3600.0, len(data)),
        temperature=rng.uniform(15.0, 30.0, len(data)),
        approach=rng.choice([-1.0, 0.0, 1.0], (len(data), 6)),
    )
    layout = Layout(unknowns(model.robot, data, ALL))
    u = np.array([one.start + SIZE[one.kind] * rng.normal() for one in layout.unknowns])
    u = np.where([one.kind == "spring" for one in layout.unknowns], np.abs(u), u)
    span = float(data.rail.min()), float(data.rail.max())
    return data, layout, u, Nominal(rng.uniform(-0.1, 0.1, (2, 3)), span, (0.0, 3600.0), 20.0)


def value(model: ArmModel, layout: Layout, s: Sample, u: np.ndarray) -> np.ndarray:
    return evaluate(model, layout, s, u, slopes=False)[0]


@pytest.mark.parametrize("name", ["kr60-3", "xr701"])
def test_derivatives_are_those_of_differences(name: str) -> None:
    model = build_model(load_description(name), "rigid")
    data, layout, u, nominal = made(model)
    s = samples(model, data, layout, nominal)[0]
    J = evaluate(model, layout, s, u)[1]
    # Every third one, of each arm others: all kinds, rows and orders among them.
    for k in range(name == "xr701", len(layout), 3):
        one = layout.unknowns[k]
        step = 1e-3 * SIZE[one.kind]
        ahead, back = u + step * (np.arange(len(u)) == k), u - step * (np.arange(len(u)) == k)
        slope = (value(model, layout, s, ahead) - value(model, layout, s, back)) / (2.0 * step)
        # Rounding of positions of some metres over the step; curvature over it.
        assert_allclose(J[k], slope, atol=1e-14 / step + 1e-6 * np.abs(J[k]).max(), err_msg=one.name)


def test_positions_are_those_of_a_product_of_matrices(kr60: ArmModel) -> None:
    data, layout, u, nominal = made(kr60)
    # Springs, growth and drift are judged by what follows, and by their derivatives.
    apart = np.array([one.kind in ("spring", "growth", "drift", "reversal") for one in layout.unknowns])
    u = np.where(apart, 0.0, u)
    P = value(kr60, layout, samples(kr60, data, layout, nominal)[0], u)
    truth = Truth({one.name: float(v) for one, v in zip(layout.unknowns, u, strict=True)})
    for k in range(len(data)):
        expected = position(kr60, truth, data.q[k], "ab"[data.target.number[k]], LOADS[0], data.rail[k], nominal.rail)
        assert_allclose(P[:, k], expected, atol=1e-12)


def test_sag_of_half_a_degree_is_right_to_two_micrometres(kr60: ArmModel, truth: Truth) -> None:
    data, layout, u, nominal = made(kr60)
    values = truth.numbers | {"rail.x": 1.0, "j2.stiffness": 3e-6, "j3.stiffness": 4e-6, "j5.stiffness": 2e-5}
    u = np.array([values.get(one.name, 0.0 if one.kind != "payload" else one.start) for one in layout.unknowns])
    P = value(kr60, layout, samples(kr60, data, layout, nominal, u)[0], u)
    for k in range(len(data)):
        load = data.payloads[data.payload[k]]
        there = position(kr60, Truth(values), data.q[k], "ab"[data.target.number[k]], load, data.rail[k], nominal.rail)
        stiff = Truth({name: v for name, v in values.items() if "stiffness" not in name})
        rigid = position(kr60, stiff, data.q[k], "ab"[data.target.number[k]], load, data.rail[k], nominal.rail)
        assert np.linalg.norm(P[:, k] - there) < 2e-6 + 1e-3 * np.linalg.norm(there - rigid)


def test_masses_that_are_heavier_by_a_share_weigh_as_if_the_model_said_so(kr60: ArmModel) -> None:
    data, _, _, nominal = made(kr60)
    layout = Layout(unknowns(kr60.robot, data, ("masses", "j2.stiffness", "j3.ry", "base")))
    share = {"j2.mass": 0.2, "j3.mass": -0.1}
    soft = {"j2.stiffness": 1e-6, "j3.ry": 5e-7, "base.rx": 2e-7}
    there, plain = (np.array([values.get(one.name, 0.0) for one in layout.unknowns]) for values in (share | soft, soft))
    masses = tuple(replace(m, kg=m.kg * (1.0 + {2: 0.2, 3: -0.1}.get(m.body, 0.0))) for m in kr60.masses)
    heavier = replace(kr60, masses=masses)
    one = value(kr60, layout, samples(kr60, data, layout, nominal)[0], there)
    other = value(heavier, layout, samples(heavier, data, layout, nominal)[0], plain)
    assert_allclose(one, other, atol=1e-14)
    assert np.abs(one - value(kr60, layout, samples(kr60, data, layout, nominal)[0], plain)).max() > 1e-5


def test_a_payload_of_the_table_and_the_same_one_free_agree(kr60: ArmModel) -> None:
    data, layout, u, nominal = made(kr60)
    held = Layout(tuple(one for one in layout.unknowns if one.kind != "payload"))
    keep = np.array([one.kind != "payload" for one in layout.unknowns])
    start = np.array([one.start for one in layout.unknowns])
    u = np.where(keep, u, start)
    one, other = (value(kr60, x, samples(kr60, data, x, nominal)[0], v) for x, v in ((layout, u), (held, u[keep])))
    assert_allclose(one, other, atol=1e-15)
    light = replace(data, payload=np.zeros(len(data), dtype=np.int64))
    assert np.abs(value(kr60, held, samples(kr60, light, held, nominal)[0], u[keep]) - other).max() > 1e-5


def test_an_arm_that_warms_up_grows_and_one_that_is_bumped_has_moved(kr60: ArmModel) -> None:
    data, _, _, nominal = made(kr60)
    layout = Layout(unknowns(kr60.robot, data, ("growth", "drift", "bump8.x")))
    plain = np.zeros(len(layout))
    values = {"arm.growth": 1e-5, "drift.y": 2e-4, "drift.rz": 1e-4, "bump8.x": 5e-4}
    u = np.array([values.get(one.name, 0.0) for one in layout.unknowns])
    sample = samples(kr60, data, layout, nominal)[0]
    before, after = (value(kr60, layout, sample, x) for x in (plain, u))
    since = data.time / 3600.0
    grown = before * (1.0 + 1e-5 * (data.temperature - 20.0))
    turned_by = 1e-4 * since * np.stack([-grown[1], grown[0], 0.0 * since])
    moved = np.stack([5e-4 * (since >= 0.25), 2e-4 * since, 0.0 * since])
    assert_allclose(after, grown + turned_by + moved, atol=1e-15)


def test_a_joint_that_loses_motion_lags_by_half_of_it_either_way(kr60: ArmModel) -> None:
    data, _, _, nominal = made(kr60)
    layout = Layout(unknowns(kr60.robot, data, ("j2.reversal", "zeros")))
    names = [one.name for one in layout.unknowns]
    there = samples(kr60, data, layout, nominal)[0]
    lost = np.where([name == "j2.reversal" for name in names], 4e-4, 0.0)
    P = value(kr60, layout, there, lost)
    for way in (-1.0, 0.0, 1.0):
        mine = data.approach[:, 1] == way
        lagging = np.where([name == "j2.zero" for name in names], -2e-4 * way, 0.0)
        assert_allclose(P[:, mine], value(kr60, layout, there, lagging)[:, mine], atol=1e-15)


def test_rotation_vectors() -> None:
    rng = np.random.default_rng(1)
    for size in (1e-7, 1e-3, 1.0, 3.0):
        w = size * rng.normal(size=3) / 2.0
        R = rotation(w)
        assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
        assert_allclose(Rotation.from_matrix(R).as_rotvec(), w, rtol=1e-7, atol=1e-15)
        assert_allclose(nearest_rotation(R * 1.1), R, atol=1e-14)
        (w, v, d), step = (x[:, None] for x in (w, rng.normal(size=3), rng.normal(size=3))), 1e-6
        slope = (turned(w + step * d, v) - turned(w - step * d, v)) / (2.0 * step)
        assert_allclose(np.cross(left_rate(w, d), R @ v, axis=0), slope, atol=1e-8)


# ------------------------------------------------------------
# What no readings can tell: known cases of parallel axes, a target on the last axis, joints that carry no weight

UR5 = Path(__file__).parents[3] / "docs" / "examples" / "ur5" / "ur5.toml"


@pytest.fixture(scope="module")
def ur5() -> ArmModel:
    return build_model(load_description(UR5), "rigid")


def names(model: ArmModel, free: tuple[str, ...], target: tuple[float, float, float]) -> dict[str, tuple[str, ...]]:
    n = np.zeros(4, dtype=np.int64)
    data = AbsoluteReadings(
        "",
        "",
        np.zeros((4, 6)),
        np.zeros((4, 3)),
        Labels(("s",), n),
        Labels(("t",), n),
        n,
        (Payload(0.0, np.zeros(3)),),
        np.zeros(4),
        np.full(4, np.nan),
        n,
    )
    layout = Layout(unknowns(model.robot, data, free))
    return {t.name: t.others for t in twins(model, data, layout, Nominal(np.array([target]), (0.0, 0.0)))}


def test_positions_tell_eighteen_numbers_of_the_geometry_of_six_joints(ur5: ArmModel, kr60: ArmModel) -> None:
    # 4 x 6 + 6 of a chain seen whole (Everett), less 6 of the tracker, 3 of the target, 3 of its orientation.
    for model in (ur5, kr60):
        assert 36 - len(names(model, ("geometry",), (0.1, 0.05, 0.2))) == 18


def test_parallel_axes_share_what_lies_along_them(ur5: ArmModel) -> None:
    found = names(ur5, ("geometry",), (0.1, 0.05, 0.2))
    assert found["j3.frame.z"] == ("j2.frame.z",)
    assert found["j4.frame.z"] == ("j2.frame.z",)
    assert set(found["j3.frame.y"]) == {"j2.zero", "j3.zero"}


def test_a_target_on_the_last_axis_does_not_see_it_turn(ur5: ArmModel) -> None:
    assert names(ur5, ("j6.ratio", "j6.sin1"), (0.0, 0.0, 0.1)) == {"j6.ratio": (), "j6.sin1": ()}
    assert not names(ur5, ("j6.ratio", "j6.sin1"), (0.1, 0.0, 0.1))


def test_joints_about_the_vertical_carry_no_weight_and_tilt_like_joint_2(ur5: ArmModel) -> None:
    found = names(ur5, ("springs", "tilts", "base"), (0.1, 0.05, 0.2))
    assert found["j1.stiffness"] == ()
    # The axis of joint 2 is across joint 1, turns with it and meets it.
    assert found["j1.ry"] == ("j2.stiffness",)
