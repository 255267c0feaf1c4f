"""Scopes of real arms: limits and couplings of the inputs, whole turns, and what the fixed coordinates would do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from arm_cases import planar_scope, sprung
from refusals import refuses

from fem import compliance, directional_stiffness
from fem.springs import FourierBasis, LawSpring, PolynomialBasis
from robots import load_robot
from surrogate import full_poses, scope_of, task_of
from surrogate.arm_scope import reduced_box, with_whole_turns
from surrogate.scope import Couplings

XR = ("q2_deg", "q3real_deg", "q4_deg", "q5_deg")


def scope(robot, inputs, **more):
    return scope_of(robot, "0" * 64, inputs, **more)


def test_limits_directions_and_fixed_coordinates_of_the_robot():
    robot = load_robot("xr701")
    made = scope(robot, XR, direction=(0.0, 3.0, -4.0), fixed_deg={"q6_deg": 30.0})
    assert made.load_direction == (0.0, 0.6, -0.8)
    assert made.fixed_deg == {"q1_deg": 0.0, "q6_deg": 30.0}
    np.testing.assert_array_equal(np.stack([made.lower, made.upper], axis=1), robot.limits[1:5])
    assert made.periodic == (False,) * 4
    narrow = scope(robot, XR, limits_deg={"q4_deg": (-20.0, 500.0)})
    assert np.degrees([narrow.lower[2], narrow.upper[2]]) == pytest.approx([-20.0, 200.0])


@pytest.mark.parametrize("inputs", [XR, ("q2_deg", "q5_deg"), ("q3real_deg",), ("q5_deg", "q3real_deg")])
def test_couplings_hold_where_the_robot_is_reachable(inputs, rng):
    robot = load_robot("xr701")
    made = scope(
        robot, inputs, fixed_deg={n: v for n, v in (("q2_deg", 20.0), ("q3real_deg", 70.0)) if n not in inputs}
    )
    Q = rng.uniform(made.lower, made.upper, (500, len(inputs)))
    kept = made.couplings.kept(Q).all(axis=1)
    np.testing.assert_array_equal(kept, robot.reachable(full_poses(robot, made, Q)))
    coupled = {"q2_deg", "q3real_deg"} & set(inputs)
    assert made.couplings.names == (("forearm_deg",) if coupled else ())
    # A real comparison: some poses are refused where both move.
    if len(coupled) == 2:
        assert 0 < np.count_nonzero(~kept) < 500


def test_full_poses_stand_in_the_robots_order():
    robot = load_robot("xr701")
    made = scope(robot, ("q5_deg", "q2_deg"), fixed_deg={"q3real_deg": 80.0, "q1_deg": -5.0})
    found = np.degrees(full_poses(robot, made, np.radians([[50.0, 20.0]])))
    np.testing.assert_allclose(found, [[-5.0, 20.0, 80.0, 0.0, 50.0, 0.0]], atol=1e-13)


@pytest.mark.parametrize(
    ("inputs", "more", "words"),
    [
        (("q9_deg",), {}, "q9_deg.*allowed: q1_deg"),
        (XR, {"fixed_deg": {"q9_deg": 0.0}}, "q9_deg"),
        (XR, {"fixed_deg": {"q6_deg": 1000.0}}, "fixed coordinate q6_deg: got 1000"),
        (XR, {"fixed_deg": {"q6_deg": np.nan}}, "fixed coordinate q6_deg"),
        (XR, {"direction": (0.0, 0.0, 0.0)}, "not all zero"),
        (XR, {"direction": (np.nan, 0.0, 0.0)}, "load direction"),
        (XR, {"limits_deg": {"q1_deg": (0.0, 1.0)}}, "limits of an input: got 'q1_deg'"),
        (XR, {"limits_deg": {"q4_deg": (300.0, 400.0)}}, "below its upper"),
        (("q2_deg", "q2_deg"), {"fixed_deg": {"q3real_deg": 80.0}}, "each one once"),
        (("q2_deg", "q4_deg"), {}, "fixed coordinate q3real_deg: got 0.0; allowed: 40 to 115 deg"),
    ],
)
def test_scopes_that_make_no_sense_are_refused(inputs, more, words):
    refuses("B001 B003 F007 S001 S003", words, scope, load_robot("xr701"), inputs, **more)


def law_in_q4(periodic):
    if periodic:
        return LawSpring(FourierBasis(3, 2), np.array([13.0, 0.3, 0.1, -0.2, 0.1]))
    return LawSpring(PolynomialBasis((3,), np.zeros(1), np.array([3.5]), np.array([[0], [1]])), np.array([13.0, 0.4]))


@pytest.mark.parametrize("robot", ["xr701", "kr60-3", "tx200"])
def test_whole_turns_of_a_joint_do_not_matter_with_constant_springs(robot, rng):
    model = sprung(robot)
    names = model.robot.coordinates[1:5]
    task = task_of(model, scope(model.robot, names), rng)
    wide = np.diff(model.robot.limits[1:5], axis=1)[:, 0] > 2.0 * np.pi
    assert task.scope.periodic == tuple(wide)
    assert wide[2]


def test_a_law_that_knows_turns_apart_keeps_its_angle_unmarked(rng):
    for periodic in (True, False):
        model = sprung("xr701", j5=law_in_q4(periodic))
        assert task_of(model, scope(model.robot, XR), rng).scope.periodic[2] is periodic


def test_a_law_across_the_load_counts_too(rng):
    """The factored basis learns the whole matrix, so the compliance along the load alone is not asked."""
    law = law_in_q4(periodic=False)
    model = sprung("kr60-3")
    first = replace(model.joints[0], axial=law)
    # A vertical load has no moment about the vertical first axis.
    model = replace(model, joints=(first, *model.joints[1:]))
    made = scope(model.robot, ("q2_deg", "q3_deg", "q4_deg", "q5_deg"))
    q = rng.uniform(-1.0, 1.0, (5, 6))
    turned = q + 2.0 * np.pi * np.eye(6)[3]
    np.testing.assert_allclose(directional_stiffness(model, turned), directional_stiffness(model, q), rtol=1e-9)
    assert np.abs(compliance(model, turned) - compliance(model, q)).max() > 1e-9
    assert task_of(model, made, rng).scope.periodic[2] is False


def test_runs_are_drawn_from_one_turn_and_judged_over_all_of_them(rng):
    model = sprung("xr701")
    task = task_of(model, scope(model.robot, XR), rng)
    lower, upper = reduced_box(task.scope)
    assert upper[2] - lower[2] == pytest.approx(2.0 * np.pi)
    for i in (0, 1, 3):
        assert (lower[i], upper[i]) == (task.scope.lower[i], task.scope.upper[i])
    assert np.ptp(task.design(500, "arcsine", rng)[:, 2]) <= 2.0 * np.pi
    assert np.ptp(task.over_domain(2000, rng)[:, 2]) > np.radians(390.0)
    assert np.degrees(np.abs(task.design(500, "boundary", rng)[:, 2]).max()) == pytest.approx(200.0)


def test_a_coupled_input_is_drawn_from_all_of_its_range():
    wide = planar_scope(2, Couplings(("sum",), np.array([[0.0, 1.0]]), np.array([-9.0]), np.array([9.0])))
    both = replace(wide, lower=np.array([-4.0, -4.0]), upper=np.array([4.0, 4.0]), periodic=(True, True))
    lower, upper = reduced_box(both)
    np.testing.assert_allclose(upper - lower, [2.0 * np.pi, 8.0])


def test_only_ranges_of_more_than_a_turn_are_asked(rng):
    asked = []
    narrow = replace(planar_scope(2), upper=planar_scope(2).lower + 2.0 * np.pi)

    def run(Q):
        asked.append(Q)
        return np.ones(len(Q))

    assert with_whole_turns(narrow, run, rng).periodic == (False, False)
    assert asked == []


def test_the_influence_of_fixed_coordinates_is_their_largest_effect(rng):
    model = sprung("kr60-3")
    inputs = ("q2_deg", "q3_deg")
    task = task_of(model, scope(model.robot, inputs), rng)
    found = task.fixed_influence
    assert set(found) == {"q1_deg", "q4_deg", "q5_deg", "q6_deg"}
    # About the vertical axis and about the flange's own with the tool point on it: nothing changes.
    assert (found["q1_deg"], found["q6_deg"]) == (0.0, 0.0)
    # Checked by brute force, on other poses: a maximum over 256 samples against one over 4000.
    q = full_poses(model.robot, task.scope, task.over_domain(4000, rng))
    for name in ("q4_deg", "q5_deg"):
        column = model.robot.coordinate_index(name)
        turned = q.copy()
        turned[:, column] = rng.uniform(*model.robot.limits[column], len(q))
        change = np.abs(directional_stiffness(model, q) / directional_stiffness(model, turned) - 1.0)
        # Not of the order of the extreme value alone: the 90 % quantile is exceeded, the maximum hardly.
        assert np.quantile(change, 0.9) < found[name] < 1.5 * change.max()
