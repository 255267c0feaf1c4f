"""Compensation on a calibrated arm: moved targets, simulated by other code, bring the tool onto the programmed path."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import tomlkit
from made_up_positions import Truth, chain, position, sag, true_angles
from posture_cases import dome
from refusals import refuses
from test_posting import asked, cell_of, motions_of

import fem
from doe.absolute.readings import Payload
from doe.absolute.real_arm import RealArm
from machining.cutting import ConstantForce, Cut, ToolBending
from machining.programs.calibrated_arm import Corrected, correct
from machining.programs.posting import Posted, post
from machining.programs.program import frame_distance
from robots import load_description
from robots.arrays import Array
from robots.joint_errors import JointErrors
from robots.library.models import parse_description, to_toml
from robots.robot import as_designed

LOAD = Payload(30.0, np.array([0.02, 0.01, 0.15]))
FORCE = np.array([60.0, -80.0, 120.0])
# Softer springs sag by millimetres, where one step (the model) and a fixed point (the other code) part by micrometres.
STIFFER = 4.0


def figure(value: float, unit: str) -> dict[str, Any]:
    return {"value": value, "unit": unit, "source": "assumed"}


@cache
def truth_and_model() -> tuple[Truth, fem.ArmModel]:
    """A KR60-3 with errors of all kinds, as the other code and as a model file have it."""
    rng = np.random.default_rng(3)
    data = tomllib.loads(to_toml(load_description("kr60-3")))
    numbers: dict[str, float] = {}
    for j, joint in enumerate(data["joint"]):
        name, other = joint["name"], "j4" if joint["name"] != "j4" else "j5"
        x, rx, zero, ratio, per, s1, c2 = 4e-4 * rng.normal(size=7)
        numbers |= {
            f"{name}.frame.x": x,
            f"{name}.frame.rx": rx,
            f"{name}.zero": zero,
            f"{name}.ratio": ratio,
            f"{name}.per.{other}": per,
            f"{name}.sin1": s1,
            f"{name}.cos2": c2,
        }
        joint["zero_error"] = figure(zero, "rad")
        joint["error"] = {
            "x": figure(x, "m"),
            "rx": figure(rx, "rad"),
            "ratio": figure(ratio, "1"),
            "turns_with": [{"joint": other, "factor": figure(per, "1")}],
            "curve": {
                "sin_mrad": [1e3 * s1, *[0.0] * 47],
                "cos_mrad": [0.0, 1e3 * c2, *[0.0] * 46],
                "height_mrad": 1.0,
                "source": "assumed",
                "identified_deg": [[-180.0, 180.0]] if j else [[0.0, 0.0]],
            },
        }
        joint["stiffness"]["value"] *= STIFFER
        numbers[f"{name}.stiffness"] = 1.0 / (joint["stiffness"]["value"] * 1e-3)  # the file has N mm/rad
    data["positions"] = {
        "data": "made up",
        "data_sha256": "0",
        "before_rms_mm": 2.0,
        "rms_mm": 0.1,
        "left_out_rms_mm": 0.1,
    }
    assert all(joint["stiffness"]["unit"] == "N mm/rad" for joint in data["joint"])
    return Truth(numbers), fem.build_model(parse_description(tomlkit.dumps(data), "off"), "rigid")


def designed(model: fem.ArmModel) -> fem.ArmModel:
    return replace(model, robot=as_designed(model.robot))


@pytest.fixture(scope="module")
def nominal() -> Posted:
    return post(designed(truth_and_model()[1]), cell_of(), motions_of(dome(15, 0.3)), asked(gamma=0.3, tolerance=1e-4))


@pytest.fixture(scope="module")
def found(nominal: Posted) -> Corrected:
    _, model = truth_and_model()
    return correct(designed(model), RealArm(model, LOAD), nominal, cut=Cut(ConstantForce(FORCE)))


def simulated(program_q: Array, T_flange_tool: Array, force: Array) -> tuple[Array, Array]:
    """Tool points (n, 3) m and axes (n, 3, 3) in the base's frame, a pose at a time by code of the tests."""
    truth, model = truth_and_model()
    # The other code adds zeros itself.
    bare = replace(model, robot=as_designed(model.robot))
    tip = truth.numbers | {f"target.tip.{a}": float(v) for a, v in zip("xyz", T_flange_tool[:3, 3], strict=True)}
    points, axes = np.empty((len(program_q), 3)), np.empty((len(program_q), 3, 3))
    for k, q in enumerate(program_q):
        points[k] = position(bare, Truth(tip), q, "tip", LOAD, 0.0, (0.0, 0.0))
        angles = true_angles(bare, truth, q)
        angles = angles + sag(bare, truth, chain(bare, truth, angles), LOAD)
        axes[k] = (chain(bare, truth, angles)[-1] @ bare.robot.T_last_flange @ T_flange_tool)[:3, :3]
        w = np.concatenate([force[k], np.zeros(3)])[None]
        points[k] += fem.deflection(bare, angles[None], w, T_flange_tool[:3, 3])[0, :3]
    return points, axes


def wanted(posted: Posted) -> Array:
    p = posted.program
    return np.asarray(p.cell.T_base_part(p.travel, p.table) @ p.T_part_tool)


def test_moved_targets_bring_the_tool_within_a_micrometre(nominal: Posted, found: Corrected) -> None:
    T, aim = nominal.program.cell.tool.T_flange_tool, wanted(nominal)
    rows = np.r_[0 : nominal.program.n : 7, nominal.program.n - 1]
    # The first point is led to by no move that mills.
    force = np.where(rows[:, None] > 0, FORCE, 0.0)
    before, _ = simulated(nominal.program.q[rows], T, force)
    after, axes = simulated(found.posted.program.q[rows], T, force)
    off = np.linalg.norm(before - aim[rows, :3, 3], axis=1)
    assert off.min() > 5e-4
    assert np.linalg.norm(after - aim[rows, :3, 3], axis=1).max() < 1e-6
    # Axes: sag by one step against a fixed point, a thousandth of a sag of a milliradian.
    assert np.abs(axes - aim[rows, :3, :3]).max() < 2e-6
    # What is said to be off is what the other code sees.
    np.testing.assert_allclose(found.moved[rows], off, atol=1e-6)


def test_joint_and_cartesian_targets_say_the_same_to_the_designed_arm(nominal: Posted, found: Corrected) -> None:
    p = found.posted.program
    away, turned = frame_distance(p.reached(), p.T_part_tool)
    assert max(away.max(), turned.max()) < 1e-12
    np.testing.assert_allclose(p.motions.points, p.T_part_tool[:, :3, 3], atol=1e-15)
    np.testing.assert_array_equal(p.motions.rapid, nominal.program.motions.rapid)
    assert p.robot.errors is None


def test_each_part_alone_is_taken_off(nominal: Posted, found: Corrected) -> None:
    _, model = truth_and_model()
    light = correct(designed(model), RealArm(model), nominal)
    assert np.abs(light.force).max() == 0.0
    assert light.error is None
    np.testing.assert_allclose(light.geometry, found.geometry, atol=1e-15)
    # 30 kg more sag farther.
    assert (np.linalg.norm(found.weight, axis=1) > 1.05 * np.linalg.norm(light.weight, axis=1)).all()
    none = JointErrors(np.zeros((6, 5)), np.zeros(6), np.zeros((6, 6)), np.zeros((6, 0)), np.zeros((6, 0)), (None,) * 6)
    straight = replace(designed(model), robot=replace(as_designed(model.robot), errors=none))
    stiff = RealArm(straight).rigid
    still = correct(designed(model), stiff, nominal)
    np.testing.assert_allclose(still.posted.program.q, nominal.program.q, atol=1e-9)


def test_the_cutting_tools_own_bending_counts(nominal: Posted, found: Corrected) -> None:
    _, model = truth_and_model()
    bending = ToolBending(0.05, 0.008, 600e9)
    more = correct(designed(model), RealArm(model, LOAD), nominal, cut=Cut(ConstantForce(FORCE), bending))
    assert np.linalg.norm(more.force[1:], axis=1).min() > np.linalg.norm(found.force[1:], axis=1).min()
    assert more.left.max() < 1e-8


def test_between_points_the_path_is_kept_to_what_is_said(nominal: Posted, found: Corrected) -> None:
    T = nominal.program.cell.tool.T_flange_tool
    aim, q = wanted(nominal), found.posted.program.q
    rows = np.arange(2, nominal.program.n, 9)
    middle, _ = simulated(0.5 * (q[rows] + q[rows - 1]), T, np.tile(FORCE, (len(rows), 1)))
    away = np.linalg.norm(middle - 0.5 * (aim[rows, :3, 3] + aim[rows - 1, :3, 3]), axis=1)
    assert away.max() <= found.between["joint"] + 2e-6
    # The path was refined for 100 um of joint motion.
    assert found.between["joint"] < 1.2e-4
    assert found.between["cartesian"] < 2e-5


def test_targets_where_a_curve_is_not_identified_are_counted(nominal: Posted, found: Corrected) -> None:
    assert found.unread == {"j1": nominal.program.n}
    _, model = truth_and_model()
    errors = model.robot.errors
    assert errors is not None
    few = replace(errors, sin=errors.sin[:, :4], cos=errors.cos[:, :4])
    cut_off = replace(model, robot=replace(model.robot, errors=few))
    refuses("Q008", "not read", correct, designed(model), RealArm(cut_off, LOAD), nominal)


def doubted(place: float, turn: float) -> fem.ArmModel:
    """The arm with this much open: the first joint's zero (rad) and the last one's frame (rad)."""
    _, model = truth_and_model()
    assert model.robot.errors is not None
    V = np.diag([place**2, turn**2])
    sure = replace(model.robot.errors, parameters=("j1.zero", "j6.frame.rx"), covariance=V)
    return replace(model, robot=replace(model.robot, errors=sure))


def test_axes_that_readings_do_not_tell_stay_as_they_were(nominal: Posted, found: Corrected) -> None:
    _, model = truth_and_model()
    assert found.turns
    assert np.isnan(found.place_sd)
    open_ = correct(designed(model), RealArm(doubted(1e-6, 5e-3), LOAD), nominal)
    assert not open_.turns
    # The last joint turns in its frame: all of its doubt is the tool's.
    assert open_.turn_sd == pytest.approx(5e-3, rel=1e-2)
    T, aim = nominal.program.cell.tool.T_flange_tool, wanted(nominal)
    before, after = (RealArm(model, LOAD).frames(one.program.q, T) for one in (nominal, open_.posted))
    assert np.linalg.norm(after[1] - aim[:, :3, 3], axis=1).max() < 1e-8
    assert np.abs(after[0] - before[0]).max() < 1e-8
    sure = correct(designed(model), RealArm(doubted(1e-6, 1e-5), LOAD), nominal)
    assert sure.turns


def test_a_correction_that_is_less_sure_than_it_is_large_is_refused(nominal: Posted) -> None:
    _, model = truth_and_model()
    refuses("Q008", "known to", correct, designed(model), RealArm(doubted(5e-3, 1e-5), LOAD), nominal)


def test_a_correction_beyond_the_cap_is_refused(nominal: Posted) -> None:
    _, model = truth_and_model()
    refuses("Q008", "--cap-um", correct, designed(model), RealArm(model), nominal, cap=1e-4)


def test_a_moved_target_beyond_a_limit_is_refused_with_its_line(nominal: Posted, found: Corrected) -> None:
    _, model = truth_and_model()
    tight = as_designed(model.robot).limits.copy()
    most = found.posted.program.q[:, 1].max()
    tight[1, 1] = most - 1e-5
    limited = replace(nominal, program=replace(nominal.program, robot=replace(nominal.program.robot, limits=tight)))
    refuses(
        "Q008",
        r"line \d+: moved target",
        correct,
        designed(model),
        RealArm(model, LOAD),
        limited,
        cut=Cut(ConstantForce(FORCE)),
    )


def test_a_singular_posture_is_refused(nominal: Posted) -> None:
    _, model = truth_and_model()
    q = nominal.program.q.copy()
    q[3, 4] = 1e-7
    singular = replace(nominal, program=replace(nominal.program, q=q))
    refuses("Q008", "singularity", correct, designed(model), RealArm(model), singular, cap=10.0)
