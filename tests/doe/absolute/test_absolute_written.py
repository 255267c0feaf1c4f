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
from doe.absolute.readings import AbsoluteReadings
from doe.absolute.unknowns import Layout, targets
from doe.absolute.written import Written, residuals, with_springs_as_before, written
from fem import ArmModel, build_model
from robots import ModelDescription, load_description
from robots.arrays import Array
from robots.joint_errors import where_unread
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
