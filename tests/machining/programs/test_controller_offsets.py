"""Corrections in a controller's terms: by hand for KUKA's signs and flange, and for a FANUC whose third angle counts
from the horizontal."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from machining.programs.controller_offsets import controller_offsets, orientations
from robots import ModelDescription, load_description
from robots.frames import frame_mm_deg
from robots.robot import Robot, robot_from
from robots.schema.joint_errors import Positions

WHERE = Positions(data="made up", data_sha256="", before_rms_mm=1.0, rms_mm=0.1, left_out_rms_mm=0.1)


def with_zeros(name: str, zeros_deg: list[float]) -> Robot:
    data = load_description(name).model_dump(by_alias=True)
    data["positions"] = WHERE.model_dump()
    for joint, zero in zip(data["joint"], zeros_deg, strict=True):
        joint["zero_error"] = {"value": zero, "unit": "deg", "source": "assumed"}
    return robot_from(ModelDescription.model_validate(data))


def test_kukas_signs_and_flange() -> None:
    robot = with_zeros("kr60-3", [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    told = np.array([True, True, True, True, False, True])
    session = frame_mm_deg([1000.0, 0.0, 500.0, 0.0, 0.0, 90.0])
    (one,) = controller_offsets(robot, {"s": session}, {"ball": np.array([0.01, 0.02, 0.03])}, told)
    assert set(one.formats) == {"krl", "sinumerik"}
    # A1, A4 and A6 turn the other way; A3 is q3 + 90, which shifts what is shown and no zero.
    assert_allclose(one.zeros_deg, [-0.1, 0.2, 0.3, -0.4, np.nan, -0.6], atol=1e-12)
    # KUKA's flange is turned by half a turn about z.
    assert_allclose(one.tools["ball"], [-0.01, -0.02, 0.03], atol=1e-15)
    assert one.knows_robot_frame
    assert_allclose(one.T_tracker_robot["s"], session, atol=1e-15)
    written = orientations(one.T_tracker_robot["s"][:3, :3])
    assert written["kuka"]["a_deg"] == pytest.approx(90.0)
    assert written["abb"]["qz"] == pytest.approx(np.sqrt(0.5))


def test_coupled_axes_take_each_others_zeros() -> None:
    robot = with_zeros("r2000ic-270f", [0.0, 0.1, 0.3, 0.0, 0.0, 0.0])
    assert robot.controller is not None
    told = np.array([False, True, True, True, True, True])
    found = controller_offsets(robot, {}, {}, told)
    assert found
    for one in found:
        expected = np.linalg.solve(robot.controller.matrix, [0.0, 0.1, 0.3, 0.0, 0.0, 0.0])
        assert_allclose(one.zeros_deg[1:], expected[1:], atol=1e-12)
        assert np.isnan(one.zeros_deg[0])
    # An axis that takes a zero that is not known is not known either.
    coupled = controller_offsets(robot, {}, {}, np.array([True, False, True, True, True, True]))[0]
    assert np.isnan(coupled.zeros_deg).sum() == 2


def test_the_models_own_coordinates_where_no_convention_is_known() -> None:
    robot = with_zeros("xr701", [0.0, -0.2, 0.0, 0.0, 0.0, 0.0])
    (one,) = controller_offsets(robot, {}, {}, np.full(6, True))
    assert one.formats == ()
    assert one.axes == robot.coordinates
    assert_allclose(one.zeros_deg, [0.0, -0.2, 0.0, 0.0, 0.0, 0.0], atol=1e-12)
    assert not one.knows_robot_frame
