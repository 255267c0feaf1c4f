"""Best angle, best path, best base over the line: each against the search that it stands for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from posture_cases import spindle
from service_cases import POINT, ask, on_rail, plain, refused, turned_part, with_bodies

import fem
from machining import Drive, GammaRange, Objective, Task, ToolPath, best_postures, tool_path
from machining.cell import clearance
from machining.cutting import ConstantForce
from machining.placement import Goal, Problem, find_fixed, space_of
from machining.posture.long_path import optimise_long_path
from machining.posture.stretches import course_at
from machining.service import Session
from robots import forward_kinematics

X = np.array([1.0, 0.0, 0.0])
# A block where the arm would like to have its wrist, with the tool at the part's origin.
BLOCK = """
[[fixture]]
name = "block"
shape = {{ kind = "box", size_mm = [60, 60, 60] }}
position_mm = [{x:.1f}, {y:.1f}, {z:.1f}]
"""


@pytest.fixture(scope="module")
def session(kr60: fem.ArmModel) -> Session:
    return plain(kr60)


def arc(n: int) -> ToolPath:
    u = np.linspace(0.0, 1.0, n)
    points = np.stack([0.1 * u, 0.03 * np.sin(3.0 * u), 0.02 * u**2], axis=1)
    axes = np.stack([0.2 * u, 0.1 - 0.2 * u, np.ones(n)], axis=1)
    return tool_path(points, axes, feed=0.02)


def block(path: ToolPath) -> dict[str, Any]:
    feed = (path.feed * 60e3).tolist()
    points, axes = (path.points * 1e3).tolist(), path.axes.tolist()
    return {"points_mm": points, "tool_axis": axes, "feed_mm_per_min": feed}


@pytest.mark.parametrize("quantity", ["k_fs", "nspi", "displacement"])
def test_best_angle_is_that_of_best_postures(session: Session, kr60: fem.ArmModel, quantity: str) -> None:
    force, normal = np.array([50.0, 20.0, -100.0]), np.array([0.0, 0.3, 1.0])
    R = turned_part()[:3, :3]
    path = tool_path([[0.0, 0.0, 0.0]], normal, axes=np.array([POINT["tool_axis"]]))
    wanted = best_postures(kr60, Task(path, spindle(), turned_part(), X), Objective(quantity, R @ force))
    answer = ask(session, "best_angle", quantity=quantity, force_N=force.tolist(), direction=normal.tolist(), **POINT)
    key, factor = ("displacement_mm", 1e3) if quantity == "displacement" else (f"{quantity}_N_per_mm", 1e-3)
    # Equal up to the tie of flip and no flip: the value is the same, and the posture has it.
    assert answer[key] == pytest.approx(wanted.value[0] * factor, rel=1e-9)
    ends = np.degrees(wanted.gamma[0]) - answer["gamma_deg"]
    assert abs(ends - 360.0 * round(ends / 360.0)) < 1e-3
    there = ask(session, "fk", q_deg=answer["q_deg"])
    assert_allclose(there["point_mm"], 0.0, atol=1e-6)
    assert there["gamma_deg"] == pytest.approx(answer["gamma_deg"], abs=1e-6)


def test_best_angle_near_the_last_posture(session: Session) -> None:
    free = ask(session, "best_angle", **POINT)
    start = ask(session, "ik", gamma_deg=free["gamma_deg"] - 40.0, near_deg=free["q_deg"], **POINT)["q_deg"]
    near = ask(session, "best_angle", near_deg=start, jump_deg=8, **POINT)
    assert np.abs(np.subtract(near["q_deg"], start)).max() <= 8.0 + 1e-9
    stays = ask(session, "stiffness", q_deg=start, indices="k_fs", direction=POINT["tool_axis"])["k_fs_N_per_mm"]
    assert stays < near["k_fs_N_per_mm"] < free["k_fs_N_per_mm"]
    turned = [*free["q_deg"][:5], free["q_deg"][5] + (360.0 if free["q_deg"][5] < 0.0 else -360.0)]
    if abs(turned[5]) < 345.0:
        assert_allclose(ask(session, "best_angle", near_deg=turned, **POINT)["q_deg"], turned, atol=1e-3)
    assert (
        "singular or farther"
        in refused(session, "best_angle", near_deg=[0, -90, 0, 0, 0, 0], jump_deg=1, **POINT)["value"]
    )
    assert "near_deg" in refused(session, "best_angle", jump_deg=1, **POINT)["allowed"]


def test_best_angle_of_a_range_and_of_its_grid(session: Session) -> None:
    keys = {"gamma_from_deg": -60, "gamma_to_deg": -20, "gamma_step_deg": 10}
    coarse = ask(session, "best_angle", refine=False, **keys, **POINT)
    fine = ask(session, "best_angle", **keys, **POINT)
    assert coarse["gamma_deg"] in (-60.0, -50.0, -40.0, -30.0, -20.0)
    assert -60.0 <= fine["gamma_deg"] <= -20.0
    assert fine["k_fs_N_per_mm"] >= coarse["k_fs_N_per_mm"]
    assert "out of reach" in refused(session, "best_angle", point_mm=[9000, 0, 0], tool_axis=[0, 0, 1])["value"]


def test_best_angle_keeps_clear(kr60: fem.ArmModel) -> None:
    """Something in the place of the wrist at the best angle: another angle is taken."""
    point = {"point_mm": [0, 0, 0], "tool_axis": [0, 0, 1]}
    free = ask(with_bodies(kr60), "best_angle", **point)
    hand = forward_kinematics(kr60.robot, np.radians([free["q_deg"]])).p[0, 5] * 1e3
    blocked = with_bodies(kr60, BLOCK.format(x=hand[0], y=hand[1], z=hand[2]))
    assert ask(blocked, "clearance", q_deg=free["q_deg"])["collides"]
    answer = ask(blocked, "best_angle", **point)
    assert blocked.scene is not None
    room = clearance(blocked.scene, np.radians([answer["q_deg"]]), np.zeros((1, 1)), within=0.05).distance[0] * 1e3
    assert answer["clearance_mm"] == pytest.approx(room, abs=1e-6)
    assert room >= 10.0
    # As good, but for the resolution of gamma: the cell is nearly symmetric.
    assert answer["k_fs_N_per_mm"] <= free["k_fs_N_per_mm"] * (1.0 + 1e-8)
    assert abs(answer["gamma_deg"] - free["gamma_deg"]) > 5.0
    seen = ask(blocked, "best_angle", collisions=False, **point)
    assert_allclose(seen["q_deg"], free["q_deg"], atol=1e-9)


def test_best_path_is_the_course_of_the_long_path(session: Session, kr60: fem.ArmModel) -> None:
    path = arc(12)
    task = Task(path, spindle(), turned_part(), X)
    drive = Drive(jump=np.radians(15.0), limit_least=np.radians(1.0), motion=0.1)
    gammas = GammaRange(np.radians(-170.0), np.radians(10.0), 19)
    wanted = optimise_long_path(kr60, task, Objective(aim="worst"), gammas, drive).course
    keys = {"gamma_from_deg": -170, "gamma_to_deg": 10, "gamma_step_deg": 10, "jump_deg": 15, "limit_margin_deg": 1}
    answer = ask(session, "best_path", aim="worst", motion=0.1, **keys, **block(path))
    assert_allclose(answer["q_deg"], np.degrees(wanted.q), atol=1e-6)
    assert_allclose(answer["gamma_deg"], np.degrees(wanted.gamma), atol=1e-6)
    assert answer["branch"] == [wanted.names[b] for b in wanted.branch]
    assert answer["worst_k_fs_N_per_mm"] == pytest.approx(wanted.worst * 1e-3, rel=1e-9)
    assert_allclose(answer["k_fs_N_per_mm"], wanted.value * 1e-3, rtol=1e-9)
    assert_allclose(answer["largest_step_deg"], np.degrees(wanted.smoothness.largest_step), atol=1e-6)
    assert not answer["collisions_looked_at"]


def test_best_path_at_one_gamma_and_with_rapid_moves(session: Session, kr60: fem.ArmModel) -> None:
    path = arc(6)
    task = Task(path, spindle(), turned_part(), X)
    fixed = ask(session, "best_path", gamma_deg=-60, **block(path))
    limits = Drive(limit_least=np.radians(0.5))
    assert_allclose(fixed["q_deg"], np.degrees(course_at(kr60, task, np.radians(-60.0), None, limits).q), atol=1e-6)
    jump = 0.5 * max(fixed["largest_step_deg"])
    rapid = {"rapid": [True] * 6}
    assert "point" in refused(session, "best_path", gamma_deg=-60, jump_deg=jump, **block(path))
    assert ask(session, "best_path", gamma_deg=-60, jump_deg=jump, **rapid, **block(path))["q_deg"]
    # Joints just fast enough for the path's feed, and just too slow.
    moves = np.abs(np.diff(fixed["q_deg"], axis=0)) / path.times[:, None]
    fast, slow = 1.001 * moves.max(), 0.999 * moves.max()
    kept = ask(session, "best_path", gamma_deg=-60, joint_speed_deg_per_s=fast, **block(path))
    assert kept["q_deg"] == fixed["q_deg"]
    beyond = refused(session, "best_path", gamma_deg=-60, joint_speed_deg_per_s=slow, **block(path))
    assert "cannot be driven" in beyond["what"]
    assert 0 <= beyond["point"] < 6


def test_best_path_of_one_point(session: Session) -> None:
    one = ask(session, "best_path", points_mm=[[0, 0, 0]], tool_axis=POINT["tool_axis"], motion=0)
    assert_allclose(one["k_fs_N_per_mm"][0], ask(session, "best_angle", **POINT)["k_fs_N_per_mm"], rtol=0.05)


@pytest.mark.parametrize("aim", ["mean", "worst"])
def test_best_base_is_the_placement(kr60: fem.ArmModel, aim: Any) -> None:
    session, path, force = on_rail(kr60), arc(5), np.array([50.0, 20.0, -100.0])
    state = session.start
    goal = Goal(aim, ConstantForce(force, "part"))
    drive = Drive(limit_least=np.radians(0.5))
    space = space_of(state.cell, {"rail": (-0.4, 0.5)})
    problem = Problem(kr60, space, path, goal, np.radians(-60.0), drive, reference=X)
    wanted = find_fixed(problem)
    keys: dict[str, Any] = {"force_N": force.tolist(), "gamma_deg": -60, "range_mm": {"rail": [-400, 500]}}
    answer = ask(session, "best_base", aim=aim, **keys, **block(path))
    assert answer["axes"] == ["rail"]
    assert answer["travel_mm"] == pytest.approx((wanted.x * 1e3).tolist(), abs=1e-6)
    assert_allclose(answer["q_deg"], np.degrees(wanted.course.q), atol=1e-6)
    # The stiffness that is said is that of the pose, at that travel; 0 is not better.
    key = f"{aim}_directional_N_per_mm"
    for travel, better in ((answer["travel_mm"], True), ([0.0], False)):
        course = ask(
            session,
            "best_path",
            travel_mm=travel,
            gamma_deg=-60,
            quantity="directional",
            direction=force.tolist(),
            **block(path),
        )
        if better:
            assert course[key] == pytest.approx(answer[key], rel=1e-6)
        assert course[key] <= answer[key] * (1.0 + 1e-6)


@pytest.mark.slow
def test_best_base_keeps_clear(kr60: fem.ArmModel) -> None:
    """Something in the place of the wrist at the best position: another is taken."""
    keys: dict[str, Any] = {"point_mm": [0, 0, 0], "tool_axis": [0, 0, 1], "force_N": [0, 0, -100]}
    free = ask(with_bodies(kr60), "best_base", collisions=False, **keys)
    wrist = forward_kinematics(kr60.robot, np.radians(free["q_deg"])).p[0, 5] * 1e3
    blocked = with_bodies(kr60, BLOCK.format(x=wrist[0], y=wrist[1] + free["travel_mm"][0], z=wrist[2]), 80.0)
    assert ask(blocked, "clearance", q_deg=free["q_deg"], travel_mm=free["travel_mm"])["collides"] == [True]
    answer = ask(blocked, "best_base", **keys)
    there = ask(blocked, "clearance", q_deg=answer["q_deg"], travel_mm=answer["travel_mm"], within_mm=200)
    assert there["clearance_mm"][0] >= 80.0 - 1e-6
    assert answer["collisions_looked_at"]


def test_best_base_of_a_point_without_rail(session: Session, kr60: fem.ArmModel) -> None:
    assert "nothing to place" in refused(session, "best_base", **POINT)["what"]
    rail = on_rail(kr60)
    answer = ask(rail, "best_base", gamma_deg=-60, **POINT)
    assert -1500.0 <= answer["travel_mm"][0] <= 1500.0
    assert "part" in refused(rail, "best_base", relative_to="base", **POINT)["allowed"]
    assert "rail" in refused(rail, "best_base", range_mm={"bridge": [0, 1]}, **POINT)["allowed"]
    tilted = {"points_mm": [[0, 0, 0], [10, 0, 0]], "tool_axis": [[0, 0, 1], [0, 1, 1]]}
    assert "force_N or direction" in refused(rail, "best_base", **tilted)["what"]


@pytest.mark.parametrize(
    ("keys", "what"),
    [
        ({"points_mm": [[0, 0, 0], [0, 0, 0]]}, "repeats"),
        ({"points_mm": [[0, 0, 0]], "tool_axis": [[0, 0, 1], [0, 0, 1]]}, "tool_axis"),
        ({"points_mm": [[0, 0, 0]], "tool_axis": [1, 0, 0]}, "reference"),
        ({"points_mm": [[0, 0, 0]], "feed_mm_per_min": -1}, "feed_mm_per_min"),
        ({"points_mm": [[0, 0, 0]], "rapid": [1]}, "rapid"),
        ({"points_mm": [[0, 0, 0]], "gamma_from_deg": 10, "gamma_to_deg": 0}, "gamma_from_deg"),
        ({"points_mm": [[0, 0, 0]], "collisions": True}, "collisions"),
        ({"points_mm": [[0, 0, 0]], "joint_speed_deg_per_s": [1, 2]}, "joint_speed_deg_per_s"),
        ({"points_mm": []}, "points_mm"),
        ({}, "points_mm is missing"),
    ],
)
def test_faults_of_blocks_are_named(session: Session, keys: dict[str, Any], what: str) -> None:
    error = refused(session, "best_path", **({"tool_axis": [0, 0, 1]} | keys))
    assert what in str(error)
