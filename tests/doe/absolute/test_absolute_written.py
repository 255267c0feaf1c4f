"""What a calibration writes back: the model that its predictions were judged by, and a URDF that others read the same.

The oracle is pinocchio; positions to compare with are the chain's, which other tests hold against products of matrices.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_positions import Plan, Truth, campaign
from numpy.testing import assert_allclose
from oracles import load

from doe.absolute.calibrate import Positions, calibrate_positions
from doe.absolute.chain import evaluate, flange_targets, samples
from doe.absolute.known import known
from doe.absolute.readings import AbsoluteReadings, Payload
from doe.absolute.real_arm import RealArm
from doe.absolute.unknowns import Layout, targets
from doe.absolute.written import Written, residuals, with_springs_as_before, written
from fem import ArmModel, build_model
from robots import ModelDescription, forward_kinematics, load_description
from robots.arrays import Array
from robots.frames import frame_mm_deg
from robots.joint_errors import JointErrors, where_unread
from robots.library.models import parse_description, to_toml
from robots.robot import as_designed, robot_from
from robots.schema.quantities import RotationalStiffness
from robots.urdf.reading import read_urdf
from robots.urdf.writing import urdf_text

FREE = ("geometry", "ratios", "coupling", "periodic2", "springs")


def without_springs(name: str) -> ModelDescription:
    """A description whose joints are rigid, as the model of the campaigns is."""
    bare = load_description(name)
    rigid = {"stiffness": None, "bearing": None, "tilt_stiffness": None, "translational_stiffness": None}
    return bare.model_copy(update={"joint": tuple(joint.model_copy(update=rigid) for joint in bare.joint)})


@pytest.fixture(scope="module")
def found(kr60: ArmModel, two_targets: AbsoluteReadings) -> Positions:
    return calibrate_positions(kr60, two_targets, FREE, parts=2)


@pytest.fixture(scope="module")
def made(found: Positions) -> Written:
    return written(found, without_springs("kr60-3"))


def positions(model: ArmModel, w: Written, data: AbsoluteReadings, *, rigid: bool = False) -> Array:
    """Positions (n, 3) m of targets in the arm's axes by what a model file says alone."""
    there = {one: v for one, v in known(model, ()).items() if not (rigid and one.kind == "spring")}
    places, at = tuple(targets(data)), flange_targets(w.fit.layout, w.fit.u)
    layout, u = Layout((*there, *places)), np.array([*there.values(), *at.reshape(-1)])
    (s,) = samples(model, data, layout, w.fit.start.nominal, u)
    return evaluate(model, layout, s, u, slopes=False)[0].T


def test_the_file_predicts_what_the_calibration_predicts(made: Written, two_targets: AbsoluteReadings) -> None:
    read_back = parse_description(to_toml(made.description), "model.toml")
    assert read_back == made.description
    P = positions(build_model(read_back, "rigid"), made, two_targets)
    session = two_targets.session.number
    inside = np.array(
        [made.fit.frames[s].inside(p[None])[:, 0] for s, p in zip(session, two_targets.position, strict=True)]
    )
    # Torques are worked out twice, at the angles shown and at those that sag by the first; in the file the first ones
    # are at angles with their zero errors: a thousandth of a sag of a thousandth of a metre moves by a thousandth.
    assert_allclose(inside - P, made.fit.residual, atol=2e-8)
    # Ten times that is what a spring's sag of 1 % would be.
    assert np.abs(made.fit.residual).max() > 1e-5


def test_every_figure_says_where_it_is_from(made: Written, two_targets: AbsoluteReadings) -> None:
    d = made.description
    assert two_targets.sha256 in d.sources["positions"]
    error = d.joint[2].error
    assert error is not None
    assert error.x is not None
    assert error.x.source == "positions"
    assert "95 % interval" in (error.x.note or "")
    assert error.curve is not None
    assert len(error.curve.sin_mrad) == 2
    assert d.positions is not None
    assert d.positions.data_sha256 == two_targets.sha256
    assert d.positions.rms_mm < d.positions.before_rms_mm


def test_springs_without_a_value_are_not_written_and_the_rest_makes_up_for_them(
    found: Positions, made: Written
) -> None:
    silent = {f.name for f in found.findings if f.name.endswith(".stiffness") and f.value is None}
    assert set(made.silent) == silent
    stiff = {j.name: j.stiffness for j in made.description.joint}
    for name, value in stiff.items():
        told = next((f for f in found.findings if f.name == f"{name}.stiffness"), None)
        if told is None or told.value is None:
            assert value is None
        else:
            assert isinstance(value, RotationalStiffness)
            assert value.source == "positions"
            # Silent springs are held where they were, and the others move with that, within their doubt.
            assert told.interval95[0] < value.si < told.interval95[1]
    assert made.description.calibration is not None
    assert made.description.calibration.links == "rigid"


def test_all_else_follows_where_a_spring_is_held(found: Positions) -> None:
    held = with_springs_as_before(found.found, ("j2.stiffness",))
    assert_allclose(residuals(held), held.residual, atol=1e-15)
    crude = found.found.u.copy()
    place = [one.name for one in found.found.layout.unknowns].index("j2.stiffness")
    crude[place] = held.u[place] = 0.0
    plain = residuals(replace(found.found, u=crude))

    def rms(r: Array) -> float:
        return float(np.sqrt(np.mean(r**2)))

    assert rms(held.residual) < 0.9 * rms(plain)


@pytest.mark.oracle
@pytest.mark.parametrize("name", ["kr60-3", "xr701"])
def test_pinocchio_reads_the_calibrated_geometry_from_the_urdf(name: str) -> None:
    pin = load("pinocchio")
    model = build_model(load_description(name), "rigid").with_rigid_joints()
    rng = np.random.default_rng(4)
    joints = model.robot.joint_names
    numbers = {
        f"{j}.{e}": float(2e-3 * rng.normal())
        for j in joints[1:-1]
        for e in ("frame.x", "frame.rx", "frame.ry", "zero", "ratio", "sin1")
    }
    numbers |= {f"target.{t}.{a}": float(rng.uniform(-0.2, 0.2)) for t in "ab" for a in "xyz"}
    data = campaign(model, Truth(numbers), Plan(60, targets=2, noise=1e-5), rng)
    c = calibrate_positions(model, data, ("geometry", "ratios", "periodic1"), parts=2)
    w = written(c, without_springs(name))
    robot = robot_from(parse_description(to_toml(w.description), "model.toml"))
    assert robot.errors is not None
    at = flange_targets(w.fit.layout, w.fit.u)
    read = pin.buildModelFromXML(urdf_text(robot, {f"target_{t}": p for t, p in zip("ab", at, strict=True)}))
    own = read.createData()
    # Ratios and curves have no place in a URDF: joints are put where they really turn to.
    turned = robot.errors.turned(data.q)
    expected = positions(replace(model, robot=robot), w, data, rigid=True)
    for k in range(len(data)):
        pin.framesForwardKinematics(read, own, turned[k])
        place = own.oMf[read.getFrameId(f"target_{'ab'[data.target.number[k]]}")].translation
        # Rounding of positions of some metres; angles and lengths are written with 17 digits.
        assert np.linalg.norm(place - expected[k]) < 1e-9
    # The test can fail: without the errors of the frames pinocchio is far off.
    plain = pin.buildModelFromXML(urdf_text(as_designed(robot), {"target_a": at[0]}))
    own = plain.createData()
    pin.framesForwardKinematics(plain, own, turned[0])
    first = np.flatnonzero(data.target.number == 0)[0]
    pin.framesForwardKinematics(plain, own, turned[first])
    assert np.linalg.norm(own.oMf[plain.getFrameId("target_a")].translation - expected[first]) > 1e-4


def test_the_urdf_is_read_back_as_the_arm_that_it_is(made: Written, tmp_path: Path) -> None:
    robot = robot_from(made.description)
    file = tmp_path / "calibrated.urdf"
    file.write_text(urdf_text(robot, {"target_a": np.array([0.0, 0.0, 0.1])}), encoding="utf-8")
    again = read_urdf(file).description
    assert [j.name for j in again.joint] == list(robot.joint_names)
    assert_allclose(np.stack([j.limits.si_array for j in again.joint]), robot.limits, atol=1e-12)


def test_a_second_calibration_keeps_what_the_first_one_found(made: Written, two_targets: AbsoluteReadings) -> None:
    model = build_model(made.description, "rigid")
    again = calibrate_positions(model, two_targets, ("j2.ratio",), parts=2)
    # Held errors and springs are those of the file, so that the arm starts where the first calibration ended.
    assert again.before.rms_m == pytest.approx(made.rms_m, rel=0.02)
    second = written(again, made.description).description
    assert second.joint[2].error == made.description.joint[2].error
    assert second.joint[1].error != made.description.joint[1].error
    assert set(second.sources) >= {"positions"}


def test_angles_where_a_curve_is_not_identified_are_counted(made: Written) -> None:
    robot = robot_from(made.description)
    assert robot.errors is not None
    errors = replace(robot.errors, read=(((0.0, 1.0),), None, None, None, None, ()))
    q = np.zeros((4, 6))
    q[:, 0] = [0.5, 0.5 + 2.0 * np.pi, 1.5, -0.1]
    assert where_unread(errors, robot.joint_names, q) == {"j1": 2, "j6": 4}


def test_as_designed_has_neither_errors_nor_zero_errors(made: Written) -> None:
    plain = as_designed(robot_from(made.description))
    assert plain.errors is None
    assert_allclose(plain.offset, robot_from(load_description("kr60-3")).offset, atol=1e-15)


# ------------------------------------------------------------
# Where a calibrated arm's tool is, how sure that is, and by what its weight turns it

TOOL = frame_mm_deg([50.0, 20.0, 180.0, 10.0, 40.0, -20.0])
NAMES = ("j2.frame.x", "j3.zero", "j4.frame.rx", "j5.ratio", "j2.stiffness")
SD = np.array([3e-4, 2e-4, 4e-4, 1e-4, 2e-8])


def poses(model: ArmModel, n: int = 8) -> Array:
    rng = np.random.default_rng(2)
    low, high = np.clip(model.robot.limits, -2.0, 2.0).T
    return rng.uniform(low, high, (n, model.robot.dof))


def with_errors(model: ArmModel, **more: object) -> ArmModel:
    rng = np.random.default_rng(1)
    errors = JointErrors(
        5e-4 * rng.normal(size=(6, 5)),
        np.zeros(6),
        np.diag(3e-4 * rng.normal(size=6)),
        np.zeros((6, 0)),
        np.zeros((6, 0)),
        (None,) * 6,
    )
    return replace(model, robot=replace(model.robot, errors=replace(errors, **more)))


def test_without_errors_and_weight_it_is_the_arm_as_designed() -> None:
    model = build_model(load_description("kr60-3"), "rigid")
    q = poses(model)
    R, p = RealArm(model).rigid.frames(q, TOOL)
    expected = forward_kinematics(model.robot, q).T_flange @ TOOL
    assert_allclose(p, expected[:, :3, 3], atol=1e-12)
    assert_allclose(R, expected[:, :3, :3], atol=1e-12)
    assert_allclose(RealArm(model).rigid.angles(q), q, atol=1e-15)


@pytest.mark.parametrize("name", ["kr60-3", "xr701"])
def test_axes_stay_axes_where_weight_bends_the_arm(name: str) -> None:
    description = load_description(name)
    model = with_errors(build_model(description, "rigid"))
    model = replace(model, base=np.diag([0, 0, 0, 1e-7, 2e-7, 0.0]))
    load = Payload(50.0, np.array([0.0, 0.0, 0.2]))
    R, p = RealArm(model, load).frames(poses(model), TOOL)
    # One step to the nearest rotation leaves the square of half the square of a turn of milliradians.
    assert_allclose(R @ np.swapaxes(R, 1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-9)
    _, bare = RealArm(model).frames(poses(model), TOOL)
    assert np.linalg.norm(p - bare, axis=1).max() > 1e-5


def test_arms_whose_joints_turn_alone_need_one_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    model = with_errors(build_model(load_description("kr60-3"), "rigid"))
    arm = RealArm(model, Payload(50.0, np.array([0.0, 0.0, 0.2])))
    short = arm.frames(poses(model), TOOL)
    monkeypatch.setattr(RealArm, "_only_turns", property(lambda _: False))
    long = arm.frames(poses(model), TOOL)
    for one, other in zip(short, long, strict=True):
        assert_allclose(one, other, atol=1e-12)


def moved(model: ArmModel, change: Array) -> ArmModel:
    """The arm with its parameters, as in ``NAMES``, changed."""
    errors = model.robot.errors
    assert errors is not None
    frames, turn = errors.frames.copy(), errors.turn.copy()
    frames[1, 0] += change[0]
    frames[3, 3] += change[2]
    turn[4, 4] += change[3]
    offset = model.robot.offset + model.robot.sign * np.array([0, 0, change[1], 0, 0, 0])
    (j2,) = (j for j in model.joints if j.name == "j2")
    c = float(j2.axial.compliance(np.zeros((1, 6)))[0])
    robot = replace(model.robot, errors=replace(errors, frames=frames, turn=turn), offset=offset)
    return replace(model, robot=robot).with_springs({"j2": 1.0 / (c + change[4])})


def test_doubt_is_what_the_covariance_moves_the_tool_by() -> None:
    rng = np.random.default_rng(5)
    A = rng.normal(size=(5, 5))
    V = A @ A.T / 5.0 * np.outer(SD, SD)
    model = with_errors(build_model(load_description("kr60-3"), "rigid"), parameters=NAMES, covariance=V)
    q, load = poses(model, 4), Payload(20.0, np.zeros(3))
    place, turn = RealArm(model, load).doubt(q, TOOL)
    away, turned = np.zeros(4), np.zeros(4)
    # Any root of the covariance will do: each column is a direction that the parameters are open in.
    for column in np.linalg.cholesky(V).T:
        (R, p), (S, o) = (RealArm(moved(model, sign * column), load).frames(q, TOOL) for sign in (1.0, -1.0))
        away += 0.25 * np.sum((p - o) ** 2, axis=1)
        turned += 0.125 * np.sum((R - S) ** 2, axis=(1, 2))
    # Derivatives leave out that torques move a little with angles: a thousandth.
    assert_allclose(np.sqrt(away), place, rtol=2e-3)
    assert_allclose(np.sqrt(turned), turn, rtol=2e-3)


def test_no_covariance_is_no_doubt_said() -> None:
    model = with_errors(build_model(load_description("kr60-3"), "rigid"))
    place, turn = RealArm(model).doubt(poses(model), TOOL)
    assert not place.any()
    assert not turn.any()
