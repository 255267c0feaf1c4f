"""What is wrong between model and controller is found and named: each slip alone, two at once, and none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses
from rigid_frames import rigid_frame

from robots import Robot, forward_kinematics, load_robot
from robots.arrays import Array
from robots.pendant.check import PendantCheck, check_pendant
from robots.pendant.explanations import PendantReadings

ARM = load_robot("irb6700-200-260")
POSES = 8


def read(robot: Robot, n: int = POSES) -> PendantReadings:
    """What a controller of this robot shows, rounded as it rounds."""
    low, high = np.degrees(robot.limits).T
    q = np.radians(np.round(np.random.default_rng(3).uniform(0.5 * low, 0.5 * high, (n, robot.dof)), 1))
    at = forward_kinematics(robot, q)
    position = at.p_flange + at.R_flange @ robot.T_flange_tool[:3, 3]
    labels = tuple(str(i) for i in range(n))
    return PendantReadings(q, np.round(position, 5), at.R_flange @ robot.T_flange_tool[:3, :3], labels)


def codes(found: PendantCheck) -> list[tuple[str, ...]]:
    return [e.codes for e in found.explanations]


def test_a_model_that_is_right_needs_nothing() -> None:
    found = check_pendant(ARM, read(ARM))
    assert found.agrees
    assert found.distance.max() < 1e-4


def _sign(robot: Robot, k: int) -> Robot:
    sign = robot.sign.copy()
    sign[k] = -sign[k]
    return replace(robot, sign=sign)


def _zero(robot: Robot, k: int, degrees: float) -> Robot:
    offset = robot.offset.copy()
    offset[k] += np.radians(degrees)
    return replace(robot, offset=offset)


def _longer(robot: Robot, k: int, along: int, size: float) -> Robot:
    T = robot.T_pre.copy()
    T[k, along, 3] += size
    return replace(robot, T_pre=T)


@pytest.mark.parametrize(
    ("wrong", "code", "size"),
    [
        (_sign(ARM, 2), "sign:j3", None),
        (_zero(ARM, 1, 90.0), "offset:j2", -np.pi / 2.0),
        (_zero(ARM, 4, -7.3), "offset:j5", np.radians(7.3)),
        (_longer(ARM, 3, 2, 0.012), "length:j4.z", -0.012),
    ],
    ids=["sign", "quarter", "offset", "length"],
)
def test_a_slip_in_the_model_is_named_with_its_size(wrong: Robot, code: str, size: float | None) -> None:
    found = check_pendant(wrong, read(ARM))
    assert codes(found)[0] == (code,)
    assert not found.agrees
    if size is not None:
        assert found.explanations[0].fit.sizes[code] == pytest.approx(size, abs=2e-5)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda r: replace(r, q=np.radians(r.q)), ("radians",)),
        (lambda r: replace(r, position=r.position - [0.0, 0.0, 0.78]), ("base",)),
        (
            lambda r: replace(r, position=r.position @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])),
            ("offset:j1",),
        ),
    ],
    ids=["radians", "base", "turned"],
)
def test_a_slip_in_the_table_is_named(
    change: Callable[[PendantReadings], PendantReadings], code: tuple[str, ...]
) -> None:
    readings = replace(change(read(ARM)), rotation=None)
    assert codes(check_pendant(ARM, readings))[0] == code


def test_another_tool_is_named_with_its_place_and_turn() -> None:
    tool = rigid_frame([0.1, 0.0, 0.2], np.diag([1.0, -1.0, -1.0]))
    found = check_pendant(ARM, read(replace(ARM, T_flange_tool=tool)))
    assert codes(found) == [("tool",)]
    np.testing.assert_allclose(found.explanations[0].fit.shift["tool"], tool[:3, 3], atol=2e-5)
    assert found.orientation is not None
    assert found.orientation.tool_turn is not None
    np.testing.assert_allclose(found.orientation.tool_turn, tool[:3, :3], atol=1e-6)


def test_a_third_angle_from_the_horizontal_is_a_coupled_joint() -> None:
    fanuc = load_robot("r2000ic-270f")
    assert fanuc.controller is not None
    p = read(fanuc).q
    at = forward_kinematics(fanuc, fanuc.controller.model(p))
    shown = PendantReadings(p, np.round(at.p_flange, 5), None, tuple("12345678"))
    assert codes(check_pendant(replace(fanuc, controller=None), shown)) == [("coupled:j3:j2",)]
    # The model file knows it; positions count from the height of axis 2, as the file says too.
    in_world: Array = shown.position - [0.0, 0.0, 0.67]
    assert check_pendant(fanuc, replace(shown, q=fanuc.controller.model(p), position=in_world)).agrees
    # What is in the table are the model's coordinates after all.
    read_so = replace(shown, q=fanuc.controller.model(fanuc.controller.model(p)))
    right = forward_kinematics(fanuc, fanuc.controller.model(p)).p_flange
    found = check_pendant(fanuc, replace(read_so, position=right - [0.0, 0.0, 0.67]))
    assert codes(found)[0] == ("controller",)


@pytest.mark.slow
def test_two_slips_at_once_are_named_and_the_orientation_decides() -> None:
    found = check_pendant(_sign(_sign(ARM, 2), 4), read(ARM))
    assert codes(found) == [("sign:j3", "sign:j5")]


def test_what_no_slip_explains_is_said_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robots.pendant.check.MOST_SLIPS", 1)  # the search for three takes seconds
    readings = read(ARM)
    found = check_pendant(ARM, replace(readings, position=1.1 * readings.position))
    assert not found.explanations
    assert found.best.fit.worst > 0.01


def test_joints_that_stand_still_are_named() -> None:
    readings = read(ARM)
    q = readings.q.copy()
    q[:, 5] = 0.0
    assert check_pendant(ARM, replace(readings, q=q)).still == ("j6",)


@pytest.mark.parametrize("n", [2, POSES])
def test_too_little_to_compare_is_refused(n: int) -> None:
    readings = read(ARM, n)
    refuses(
        "R007",
        "pendant table: poses",
        check_pendant,
        ARM,
        readings if n == 2 else replace(readings, q=np.tile(readings.q[0], (n, 1))),
    )


def test_another_convention_is_named_where_the_columns_have_the_wrong_name() -> None:
    readings = read(ARM)
    assert readings.rotation is not None
    others = {"a": np.swapaxes(readings.rotation, 1, 2), "b": readings.rotation}
    found = check_pendant(ARM, replace(readings, rotation=others["a"] @ others["a"], other_rotations=others))
    assert found.orientation is not None
    assert (found.orientation.convention, found.orientation.disagreement) == ("b", 0)
    assert not found.agrees
    # Of the one that they are named after nothing is asked where that fits.
    assert check_pendant(ARM, replace(readings, other_rotations=others)).agrees


@pytest.mark.parametrize(("change", "code"), [("sign", "sign:j6"), ("gear", "coupled:j6:j5")])
def test_a_slip_that_positions_do_not_show_is_found_in_the_orientations(change: str, code: str) -> None:
    # The flange lies on the last axis: its position does not move with that.
    assert not ARM.T_flange_tool[:2, 3].any()
    readings = read(ARM)
    q = readings.q.copy()
    q[:, 5] = -q[:, 5] if change == "sign" else q[:, 5] - q[:, 4]
    found = check_pendant(ARM, replace(readings, q=q))
    assert found.distance.max() < found.tolerance
    assert codes(found) == [(code,)]
    assert found.orientation is not None
    assert found.orientation.disagreement == 0
    # Without orientations nobody can know.
    assert check_pendant(ARM, replace(readings, q=q, rotation=None)).agrees


def test_a_pose_that_was_typed_wrong_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robots.pendant.check.MOST_SLIPS", 1)  # the search for three takes seconds
    readings = read(ARM)
    position = readings.position.copy()
    position[3, 2] = -position[3, 2]
    found = check_pendant(ARM, replace(readings, position=position))
    assert found.misread == ("3",)
    assert not found.agrees
    # Three of eight are no slips of the pen.
    position[:3] = 1.1 * position[:3]
    assert check_pendant(ARM, replace(readings, position=position)).misread == ()


@pytest.mark.parametrize(("size", "unit"), [(1e-3, "metres"), (1.0 / 25.4, "inches")])
def test_positions_in_other_units_are_refused(size: float, unit: str) -> None:
    readings = read(ARM)
    refuses("R007", unit, check_pendant, ARM, replace(readings, position=size * readings.position))
    # A frame elsewhere is no unit.
    shifted = replace(readings, position=readings.position + np.array([3.0, 0.0, 0.0]))
    assert codes(check_pendant(ARM, shifted))[0] == ("base",)
