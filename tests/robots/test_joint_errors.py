"""Errors of joints in a model file: what they do to angles, and what is no error of an arm."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest
import tomlkit
from numpy.testing import assert_allclose
from refusals import refuses

from robots import content_hash, load_description
from robots.joint_errors import designed, joint_errors
from robots.library.models import parse_description, to_toml
from robots.robot import as_designed, robot_from
from robots.urdf.writing import real_frame

RATIO = {"value": 2e-3, "unit": "1", "source": "assumed"}
CURVE = {
    "sin_mrad": (1.0, 0.0, 0.5),
    "cos_mrad": (0.0, -2.0, 0.0),
    "identified_deg": ((-90.0, 90.0),),
    "height_mrad": 1.0,
    "source": "assumed",
}


def text(error: dict[str, Any]) -> str:
    data = tomllib.loads(to_toml(load_description("kr60-3")))
    data["joint"][4]["error"] = error
    return tomlkit.dumps(data)


def test_ratio_coupling_and_curve() -> None:
    error = {"ratio": RATIO, "turns_with": ({"joint": "j4", "factor": RATIO | {"value": -0.01}},), "curve": CURVE}
    errors = joint_errors(parse_description(text(error), "kr60-3"))
    assert errors is not None
    q = np.array([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]])
    more = 2e-3 * 0.5 - 0.01 * 0.4 + 1e-3 * (np.sin(0.5) + 0.5 * np.sin(1.5) - 2.0 * np.cos(1.0))
    assert_allclose(errors.turned(q) - q, [[0, 0, 0, 0, more, 0]], atol=1e-15)
    assert errors.unread(np.array([[0, 0, 0, 0, 2.0, 0]])).tolist() == [[False, False, False, False, True, False]]


def test_a_frame_moves_in_its_own_axes_before_it_turns() -> None:
    mm, deg = {"unit": "mm", "source": "assumed"}, {"unit": "deg", "source": "assumed"}
    robot = robot_from(
        parse_description(text({"x": mm | {"value": 2.0}, "rx": deg | {"value": 90.0 / np.pi}}), "kr60-3")
    )
    off = np.linalg.inv(robot.T_pre[4]) @ real_frame(robot, 4)
    assert_allclose(off[:3, 3], [2e-3, 0.0, 0.0], atol=1e-15)
    cos, sin = np.cos(0.5), np.sin(0.5)
    assert_allclose(off[:3, :3], [[1, 0, 0], [0, cos, -sin], [0, sin, cos]], atol=1e-12)


def test_a_model_without_errors_keeps_its_hash_and_has_none() -> None:
    bare = load_description("kr60-3")
    assert robot_from(bare).errors is None
    assert content_hash(parse_description(text({"ratio": RATIO}), "kr60-3")) != content_hash(bare)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        ({"x": {"value": 2.0, "unit": "m", "source": "assumed"}}, "at most 0.5 m"),
        ({"rx": {"value": 40.0, "unit": "deg", "source": "assumed"}}, "at most 0.5 rad"),
        ({"ratio": RATIO | {"value": 1.002}}, "of a turn"),
        ({"turns_with": ({"joint": "j9", "factor": RATIO},)}, "j9"),
        ({"curve": CURVE | {"cos_mrad": (0.0,)}}, "as many"),
        ({"curve": CURVE | {"identified_deg": ((90.0, -90.0),)}}, "identified_deg"),
        ({"curve": CURVE | {"sin_mrad": (1.0, 0.0, 500.0)}}, "200"),
        ({"curve": CURVE | {"source": "nobody"}}, "nobody"),
        ({"rz": {"value": 1.0, "unit": "deg", "source": "assumed"}}, "unknown key"),
        ({"x": {"value": 1.0, "unit": "deg", "source": "assumed"}}, "deg"),
    ],
)
def test_what_is_no_error_of_an_arm_is_refused(error: dict[str, Any], words: str) -> None:
    refuses("F011", words, parse_description, text(error), "kr60-3")


@pytest.mark.parametrize(
    ("covariance", "words"),
    [
        ([[1e-6, 0.0]], "a row and a column"),
        ([[1e-6, 0.0], [0.0]], "a row and a column"),
        ([[1e-6, 1e-7], [0.0, 1e-6]], "symmetric"),
        ([[1e-6, 2e-6], [2e-6, 1e-6]], "negative variances"),
        ([[-1e-6, 0.0], [0.0, 1e-6]], "negative variances"),
    ],
)
def test_what_is_no_covariance_is_refused(covariance: list[list[float]], words: str) -> None:
    data = tomllib.loads(to_toml(load_description("kr60-3")))
    data["positions"] = {
        "data": "x",
        "data_sha256": "0",
        "before_rms_mm": 1.0,
        "rms_mm": 0.1,
        "left_out_rms_mm": 0.1,
        "parameters": ["j2.zero", "j3.zero"],
        "covariance": covariance,
    }
    refuses("F011", words, parse_description, tomlkit.dumps(data), "kr60-3")


def test_the_arm_as_designed_is_the_described_one_without_what_positions_told() -> None:
    data = tomllib.loads(to_toml(load_description("kr60-3")))
    data["positions"] = {"data": "x", "data_sha256": "0", "before_rms_mm": 1.0, "rms_mm": 0.1, "left_out_rms_mm": 0.1}
    data["joint"][1]["zero_error"] = {"value": 0.5, "unit": "deg", "source": "assumed"}
    data["joint"][1]["error"] = {"ratio": RATIO}
    description = parse_description(tomlkit.dumps(data), "kr60-3")
    plain = designed(description)
    assert plain == load_description("kr60-3")
    assert designed(plain) is plain
    assert_allclose(as_designed(robot_from(description)).offset, robot_from(plain).offset, atol=1e-15)
