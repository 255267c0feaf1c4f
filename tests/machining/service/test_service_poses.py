"""Single poses over the line: each command against the functions that it stands for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from posture_cases import spindle
from rigid_frames import rigid_frame
from service_cases import POINT, POSE, ask, on_rail, plain, refused, turned_part, with_bodies

import fem
from machining import INDICES, Task, evaluate, tool_path, translational
from machining.cell import clearance
from machining.placement import on_axes
from machining.service import Session
from robots import forward_kinematics, inverse_kinematics
from robots.arrays import Array

# Angles and lengths in answers are rounded to 1e-9 deg and mm.
ROUNDED = 1e-8


@pytest.fixture(scope="module")
def session(kr60: fem.ArmModel) -> Session:
    return plain(kr60)


def base_tool(session: Session, q_deg: list[float]) -> Array:
    frames = forward_kinematics(session.robot, np.radians([q_deg]))
    T = rigid_frame(frames.p_flange[0], frames.R_flange[0])
    return T @ spindle()


def as_matrix(T: Array) -> list[list[float]]:
    out = T.copy()
    out[:3, 3] *= 1e3
    return out.tolist()  # type: ignore[no-any-return]


def test_fk_is_the_tool_in_the_part(session: Session) -> None:
    answer = ask(session, "fk", q_deg=POSE)
    T = np.linalg.inv(turned_part()) @ base_tool(session, POSE)
    assert_allclose(answer["matrix_mm"], as_matrix(T), atol=ROUNDED)
    assert_allclose(answer["point_mm"], T[:3, 3] * 1e3, atol=ROUNDED)
    assert_allclose(answer["tool_axis"], -T[:3, 2], atol=ROUNDED)
    assert answer["inside_limits"]
    base = ask(session, "fk", q_deg=POSE, relative_to="base")
    assert_allclose(base["matrix_mm"], as_matrix(base_tool(session, POSE)), atol=ROUNDED)


def test_fk_beyond_limits_says_so(session: Session) -> None:
    both = ask(session, "fk", q_deg=[POSE, [0, 90, 0, 0, 0, 0]])["poses"]
    assert [p["inside_limits"] for p in both] == [True, False]
    assert "q2_deg" in both[1]["violations"][0]


@pytest.mark.parametrize("axis", [[0.1, 0.2, 1.0], [-0.5, 0.7, -0.3]])
@pytest.mark.parametrize("gamma", [-170.0, -100.0, -33.0])
def test_point_axis_and_gamma_are_those_of_a_task(session: Session, axis: list[float], gamma: float) -> None:
    # Seen from another reference direction the same postures have another gamma.
    other = np.array([0.3, 1.0, 0.2])
    turned = Task(tool_path([[0.05, -0.02, 0.1]], axis), spindle(), turned_part(), other).tool_frames([0.7])[0, 0]
    task = Task(tool_path([[0.05, -0.02, 0.1]], axis), spindle(), turned_part(), np.array([1.0, 0.0, 0.0]))
    away = np.linalg.inv(task.tool_frames([0.0])[0, 0]) @ turned
    keys: dict[str, Any] = {"point_mm": [50, -20, 100], "tool_axis": axis, "which": "all"}
    through = ask(session, "ik", gamma_deg=np.degrees(0.7), reference=other.tolist(), **keys)["solutions"]
    # z of the tool is minus the tool axis.
    same = np.degrees(-np.arctan2(away[1, 0], away[0, 0]))
    for a, b in zip(through, ask(session, "ik", gamma_deg=same, **keys)["solutions"], strict=True):
        assert_allclose(a["q_deg"], b["q_deg"], atol=1e-6)
    T = task.tool_frames([np.radians(gamma)])[0, 0]
    shown = ask(session, "ik", matrix_mm=as_matrix(T), relative_to="base", which="all")
    given = ask(session, "ik", point_mm=[50, -20, 100], tool_axis=axis, gamma_deg=gamma, which="all")
    assert shown["solutions"]
    assert [s["branch"] for s in shown["solutions"]] == [s["branch"] for s in given["solutions"]]
    for a, b in zip(shown["solutions"], given["solutions"], strict=True):
        assert_allclose(a["q_deg"], b["q_deg"], atol=1e-6)  # next to a singularity rounding grows


def test_fk_of_ik_is_the_target_however_it_is_given(session: Session) -> None:
    target = POINT | {"gamma_deg": -60}
    q = ask(session, "ik", **target)["q_deg"]
    there = ask(session, "fk", q_deg=q)
    axis = np.array(POINT["tool_axis"]) / np.linalg.norm(POINT["tool_axis"])
    assert_allclose(there["tool_axis"], axis, atol=ROUNDED)
    assert_allclose(there["point_mm"], 0.0, atol=1e-6)
    assert there["gamma_deg"] == pytest.approx(-60.0, abs=ROUNDED)
    for key in ("frame_mm_deg", "matrix_mm"):
        assert_allclose(ask(session, "ik", **{key: there[key]})["q_deg"], q, atol=1e-6)


def test_frame_at_the_gimbal(session: Session) -> None:
    """At b = 90 deg a and c are one turn; the frame shown is still the frame."""
    for b in (90.0, -90.0):
        first = ask(session, "set", tool_mm_deg=[1, 2, 3, 20, b, 50])["tool_mm_deg"]
        q = ask(session, "fk", q_deg=POSE)["matrix_mm"]
        ask(session, "set", tool_mm_deg=first)
        assert_allclose(ask(session, "fk", q_deg=POSE)["matrix_mm"], q, atol=1e-6)
    ask(session, "set", reset=True)


def test_ik_all_is_every_branch(session: Session) -> None:
    T = base_tool(session, POSE)
    found = inverse_kinematics(session.robot, T[None], T_flange_tool=spindle())
    answer = ask(session, "ik", matrix_mm=as_matrix(T), relative_to="base", which="all")
    columns = np.flatnonzero(found.valid[0] & ~found.twin[0])
    assert len(columns) >= 2
    assert [s["branch"] for s in answer["solutions"]] == [found.names[c] for c in columns]
    assert_allclose([s["q_deg"] for s in answer["solutions"]], np.degrees(found.q[0, columns]), atol=1e-6)
    assert len(answer["solutions"]) + len(answer["missing"]) == 8


def test_near_picks_branch_and_turn(session: Session, kr60: fem.ArmModel) -> None:
    """Joint 6 has two turns: the one nearest to the last posture is returned, and its branch."""
    T = base_tool(session, POSE)
    target: dict[str, Any] = {"matrix_mm": as_matrix(T), "relative_to": "base"}
    found = inverse_kinematics(kr60.robot, T[None], T_flange_tool=spindle())
    flipped = {s["branch"]: s["q_deg"] for s in ask(session, "ik", which="all", **target)["solutions"]}
    for near in ([*POSE[:5], POSE[5] - 350.0], POSE, *flipped.values()):
        wanted, column = found.nearest(np.radians(near))
        answer = ask(session, "ik", near_deg=near, **target)
        assert answer["branch"] == found.names[int(column[0])]
        assert_allclose(answer["q_deg"], np.degrees(wanted[0]), atol=1e-6)
    assert answer["q_deg"] != POSE
    turned = ask(session, "ik", near_deg=[*POSE[:5], POSE[5] - 350.0], **target)
    assert turned["q_deg"][5] == pytest.approx(POSE[5] - 360.0, abs=1e-6)


def test_stiffest_branch(session: Session, kr60: fem.ArmModel) -> None:
    target = {"matrix_mm": as_matrix(base_tool(session, POSE)), "relative_to": "base"}
    branches = ask(session, "ik", which="all", **target)["solutions"]
    keys: dict[str, Any] = {"direction": [1, 2, 3], "force_N": [10, -20, 30]}
    for quantity, key, best in (("nspi", "nspi_N_per_mm", max), ("displacement", "displacement_mm", min)):
        answer = ask(session, "ik", which="stiffest", quantity=quantity, **keys, **target)
        values = []
        for branch in branches:
            C = translational(kr60, np.radians([branch["q_deg"]]), spindle()[:3, 3])
            by_hand = np.linalg.norm(C[0] @ keys["force_N"]) * 1e3
            index = evaluate("nspi", C, np.array(keys["direction"]), np.array(keys["force_N"]))[0] * 1e-3
            values.append(float(index if quantity == "nspi" else by_hand))
        assert answer[key] == pytest.approx(best(values), rel=1e-9)
        chosen = next(i for i, branch in enumerate(branches) if branch["branch"] == answer["branch"])
        assert values[chosen] == pytest.approx(best(values), rel=1e-9)
    # Flipped or not, springs about the axes of a spherical wrist are as stiff: then the nearest is taken.
    for branch in branches:
        if values[branches.index(branch)] == pytest.approx(best(values), rel=1e-9):
            near = ask(session, "ik", which="stiffest", quantity=quantity, near_deg=branch["q_deg"], **keys, **target)
            assert near["branch"] == branch["branch"]


def test_indices_of_a_pose_and_of_poses(session: Session, kr60: fem.ArmModel) -> None:
    R = turned_part()[:3, :3]
    n, F = np.array([0.2, -0.5, 1.0]), np.array([100.0, 20.0, -300.0])
    many = [POSE, [0, -60, 20, 30, 40, 50]]
    C = translational(kr60, np.radians(many), spindle()[:3, 3])
    answer = ask(session, "stiffness", q_deg=many, direction=n.tolist(), force_N=F.tolist(), indices="all")
    one = ask(session, "stiffness", q_deg=POSE, direction=n.tolist(), force_N=F.tolist(), indices=list(INDICES))
    for name, index in INDICES.items():
        key, factor = (f"{name}_N_per_mm", 1e-3) if index.degree else (name, 1.0)
        wanted = evaluate(name, C, R @ n, R @ F) * factor
        assert_allclose(answer[key], wanted, rtol=1e-12)
        assert one[key] == pytest.approx(wanted[0], rel=1e-12)
    alone = ask(session, "stiffness", q_deg=POSE, direction=n.tolist(), indices="k_fs")
    assert alone["k_fs_N_per_mm"] == pytest.approx(one["k_fs_N_per_mm"], rel=1e-12)


def test_without_a_direction_the_tool_axis_is_meant(session: Session) -> None:
    target = POINT | {"gamma_deg": -60}
    q = ask(session, "ik", **target)["q_deg"]
    wanted = ask(session, "stiffness", q_deg=q, direction=POINT["tool_axis"])["directional_N_per_mm"]
    assert ask(session, "stiffness", q_deg=q)["directional_N_per_mm"] == pytest.approx(wanted, rel=1e-9)
    assert ask(session, "stiffness", **target)["directional_N_per_mm"] == pytest.approx(wanted, rel=1e-6)


def test_deflection_in_the_frame_asked_for(session: Session, kr60: fem.ArmModel) -> None:
    R = turned_part()[:3, :3]
    F, M = np.array([100.0, 20.0, -300.0]), np.array([5.0, -6.0, 7.0])
    d = fem.deflection(kr60, np.radians([POSE]), np.concatenate([R @ F, R @ M]), spindle()[:3, 3])[0]
    answer = ask(session, "deflection", q_deg=POSE, force_N=F.tolist(), moment_Nm=M.tolist(), direction=[0, 0, 2])
    assert_allclose(answer["displacement_mm"], R.T @ d[:3] * 1e3, rtol=1e-9)
    assert_allclose(answer["rotation_deg"], np.degrees(R.T @ d[3:]), rtol=1e-9)
    assert answer["size_mm"] == pytest.approx(np.linalg.norm(d[:3]) * 1e3, rel=1e-12)
    assert answer["along_direction_mm"] == pytest.approx((R.T @ d[:3])[2] * 1e3, rel=1e-9)
    both = ask(session, "deflection", q_deg=[POSE, POSE], force_N=[F.tolist(), [0, 0, 1]])
    assert_allclose(
        both["displacement_mm"][1], ask(session, "deflection", q_deg=POSE, force_N=[0, 0, 1])["displacement_mm"]
    )


def test_travel_moves_the_base_and_the_rail_gives_way(kr60: fem.ArmModel) -> None:
    session = on_rail(kr60)
    target = POINT | {"gamma_deg": -60}
    moved = ask(session, "ik", travel_mm=[250], **target)["q_deg"]
    there = ask(session, "fk", q_deg=moved, relative_to="base")
    at_rest = ask(session, "fk", q_deg=ask(session, "ik", **target)["q_deg"], relative_to="base")
    assert_allclose(np.subtract(at_rest["point_mm"], there["point_mm"]), [0, 250, 0], atol=1e-6)
    given = on_axes(kr60, session.start.cell)
    d = fem.deflection(given, np.radians([moved]), np.array([0, 0, 100.0, 0, 0, 0]), spindle()[:3, 3])[0]
    answer = ask(session, "deflection", q_deg=moved, force_N=[0, 0, 100], relative_to="base", travel_mm=[250])
    assert_allclose(answer["displacement_mm"], d[:3] * 1e3, rtol=1e-9)
    stiff = fem.deflection(kr60, np.radians([moved]), np.array([0, 0, 100.0, 0, 0, 0]), spindle()[:3, 3])[0]
    assert np.linalg.norm(d[:3]) > 1.01 * np.linalg.norm(stiff[:3])
    assert "-1500 to 1500" in refused(session, "ik", travel_mm=[1500.1], **target)["allowed"]


def test_clearance_of_poses(kr60: fem.ArmModel) -> None:
    session = with_bodies(kr60)
    q = ask(session, "ik", point_mm=[0, 0, 0], tool_axis=[0, 0, 1], gamma_deg=-45)["q_deg"]
    assert session.scene is not None
    for travel in (0.0, 120.0):
        found = clearance(session.scene, np.radians([q]), np.array([[travel * 1e-3]]), within=0.3)
        answer = ask(session, "clearance", q_deg=q, within_mm=300, travel_mm=[travel])
        assert answer["clearance_mm"] == pytest.approx(found.distance[0] * 1e3, abs=ROUNDED)
        assert answer["nearest"] == list(found.nearest(0) or ())
        assert not answer["collides"]
    # Farther than what matters is what matters.
    assert ask(session, "clearance", q_deg=q, within_mm=7)["clearance_mm"] == pytest.approx(7.0)
    inside = ask(session, "ik", point_mm=[0, 0, -200], tool_axis=[0, 0, 1], gamma_deg=-45)["q_deg"]
    hit = ask(session, "clearance", q_deg=inside)
    assert hit["collides"]
    assert hit["clearance_mm"] < 0.0


def test_what_cannot_be_reached_says_why(session: Session) -> None:
    far = refused(session, "ik", point_mm=[9000, 0, 0], tool_axis=[0, 0, 1])
    assert "farther from axis 2" in far["value"]
    every = ask(session, "ik", point_mm=[9000, 0, 0], tool_axis=[0, 0, 1], which="all")
    assert every["solutions"] == []
    assert len(every["missing"]) == 8
    beyond = refused(session, "stiffness", q_deg=[POSE, [0, 90, 0, 0, 0, 0]])
    assert beyond["point"] == 1
    assert "q2_deg = 90" in beyond["value"]
    assert "force_N for nspi" in refused(session, "stiffness", q_deg=POSE, indices=["nspi"])["what"]


def test_an_infinite_stiffness_is_null(session: Session) -> None:
    """A force across the normal that moves nothing along it."""
    C = translational(session.model, np.radians([POSE]), spindle()[:3, 3])[0]
    n = np.array([1.0, 0.0, 0.0])
    F = np.linalg.solve(C, np.array([0.0, 0.0, 1.0]))
    answer = ask(
        session,
        "stiffness",
        q_deg=POSE,
        direction=n.tolist(),
        force_N=(F / 1e6).tolist(),
        indices="nspi",
        relative_to="base",
    )
    assert answer["nspi_N_per_mm"] is None or answer["nspi_N_per_mm"] > 1e8
