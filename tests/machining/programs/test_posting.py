"""From tool path to program: every point kept, joint motion straight enough, external axes in the right place."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from posture_cases import ALONG_Y, dome, part, spindle
from refusals import refuses

import fem
from machining.cell import Cell, LinearAxis, Tool, Turntable
from machining.posture.drive import Drive
from machining.posture.points import GammaRange
from machining.programs.posting import PostSettings, post
from machining.programs.program import JointProgram, frame_distance, tool_in_part
from machining.programs.refining import pieces_for, subdivided
from machining.task import Task, ToolPath
from machining.toolpaths.motions import Event, Motions
from machining.toolpaths.motions import Tool as Cutter
from robots.arrays import Array


def motions_of(path: ToolPath, **more: Any) -> Motions:
    n = path.n
    plain: dict[str, Any] = {
        "points": path.points,
        "axes": path.axes,
        "rapid": np.zeros(n, dtype=np.bool_),
        "feed": np.full(n, 0.05),
        "line": np.arange(10, 10 + n),
        "tool": np.zeros(n, dtype=np.int64),
        "spindle": np.zeros(n),
        "dwell": np.zeros(n),
        "operation": np.zeros(n, dtype=np.int64),
    }
    return Motions(**(plain | more))


def asked(**more: Any) -> PostSettings:
    return PostSettings(**({"reference": ALONG_Y} | more))


def cell_of(**more: Any) -> Cell:
    return Cell(T_world_part0=part(), tool=Tool(spindle()), **more)


def between(program: JointProgram, share: float) -> Array:
    """Distance of the tip from the straight line when every axis has gone this share of each move."""
    q = program.q[:-1] + share * np.diff(program.q, axis=0)
    travel = program.travel[:-1] + share * np.diff(program.travel, axis=0)
    tip = tool_in_part(program.robot, program.cell, q, travel, program.table[1:], program.T_flange_tool)[:, :3, 3]
    points = program.motions.points
    return np.asarray(np.linalg.norm(tip - (points[:-1] + share * np.diff(points, axis=0)), axis=1))


@pytest.mark.parametrize("gamma", [0.3, GammaRange(count=24)])
def test_every_point_is_kept_and_joint_motion_is_straight(kr60: fem.ArmModel, gamma: float | GammaRange) -> None:
    motions = motions_of(dome(30))
    posted = post(kr60, cell_of(), motions, asked(gamma=gamma, tolerance=2e-5))
    program = posted.program
    given_points = ~program.inserted
    np.testing.assert_array_equal(program.motions.points[given_points], motions.points)
    np.testing.assert_array_equal(program.motions.line[given_points], motions.line)
    assert program.inserted.sum() > 30
    away, turned = frame_distance(program.reached(), program.T_part_tool)
    # Round-off of two metres through six rotations.
    assert away.max() < 1e-12
    assert turned.max() < 1e-12
    for share in (0.25, 0.5, 0.75):
        # A chord departs most half-way; a little more elsewhere is what higher orders add.
        assert between(program, share).max() < 1.05 * 2e-5
    assert posted.bend.max() <= 2e-5
    np.testing.assert_allclose(posted.bend[1:], between(program, 0.5), atol=1e-15)


def test_a_finer_tolerance_needs_points_by_its_square_root(kr60: fem.ArmModel) -> None:
    motions = motions_of(dome(10))
    coarse, fine = (post(kr60, cell_of(), motions, asked(tolerance=tolerance)).program.n for tolerance in (1e-4, 1e-6))
    # Half-way error goes with the square of the length: ten times the points; counts are rounded up.
    assert 7.0 < (fine - 10) / (coarse - 10) < 13.0


def test_tool_frames_are_those_of_the_task(kr60: fem.ArmModel) -> None:
    path = dome(12)
    program = post(kr60, cell_of(), motions_of(path), asked(gamma=0.4, tolerance=1e-2)).program
    assert program.n == 12
    task = Task(path, spindle(), np.eye(4), ALONG_Y)
    np.testing.assert_allclose(program.T_part_tool, task.tool_frames([0.4])[:, 0], atol=1e-14)
    np.testing.assert_array_equal(program.gamma, 0.4)


def test_a_rail_carries_the_robot_and_the_part_sees_the_same_path(kr60: fem.ArmModel) -> None:
    rail = LinearAxis("rail", np.array([1.0, 0.0, 0.0]), np.array([-2.0, 2.0]))
    cell = cell_of(linear_axes=(rail,))
    motions = motions_of(dome(20))
    moving = np.linspace(-0.2, 0.15, 20)[:, None]
    still, moved = (
        post(kr60, cell, motions, asked(gamma=0.2, travel=travel, tolerance=1e-4)).program
        for travel in (np.array([0.1]), moving)
    )
    np.testing.assert_array_equal(still.travel, 0.1)
    np.testing.assert_allclose(moved.travel[~moved.inserted], moving)
    for program in (still, moved):
        away, turned = frame_distance(program.reached(), program.T_part_tool)
        assert away.max() < 1e-12
        assert turned.max() < 1e-12
        assert between(program, 0.5).max() <= 1e-4
    assert np.abs(still.q[~still.inserted] - moved.q[~moved.inserted]).max() > 0.05
    # The carriage moves with the tip here: the arm itself then moves less.
    refuses("Q007", "external axes at move 0", post, kr60, cell, motions, asked(travel=np.array([3.0])))
    refuses("Q007", "travels of the linear axes", post, kr60, cell, motions, asked(travel=np.zeros((5, 1))))


def test_joint_speeds_count_the_time_on_the_part(kr60: fem.ArmModel) -> None:
    """A rail that goes with the tip leaves the arm at rest: a feed that the arm alone could not follow."""
    rail = LinearAxis("rail", np.array([1.0, 0.0, 0.0]), np.array([-2.0, 2.0]))
    cell = cell_of(linear_axes=(rail,))
    line = np.stack([np.linspace(-0.2, 0.2, 41), np.zeros(41), np.zeros(41)], axis=1)
    path = ToolPath(line, np.tile([0.0, 0.0, 1.0], (41, 1)), np.tile([0.0, 0.0, 1.0], (41, 1)), np.full(41, 2.0))
    slow = Drive(speed=np.radians(20.0))
    going_with = asked(gamma=-2.0, reference=np.eye(3)[0], travel=line[:, :1], drive=slow, tolerance=1e-3)
    program = post(kr60, cell, motions_of(path, feed=path.feed), going_with).program
    assert np.ptp(program.q, axis=0).max() < 1e-9
    refuses(
        "G003",
        "cannot be driven",
        post,
        kr60,
        cell,
        motions_of(path, feed=path.feed),
        replace(going_with, travel=np.zeros(1)),
    )


def test_a_turned_table_turns_the_part(kr60: fem.ArmModel) -> None:
    table = Turntable(part()[:3, 3], np.array([0.0, 0.0, 1.0]))
    program = post(kr60, cell_of(turntable=table), motions_of(dome(8, 0.2)), asked(table=0.5)).program
    away, turned = frame_distance(program.reached(), program.T_part_tool)
    assert away.max() < 1e-12
    assert turned.max() < 1e-12
    assert (program.table == 0.5).all()


def test_a_tool_that_rests_keeps_its_posture(kr60: fem.ArmModel) -> None:
    path = dome(6, 0.05)
    again = np.array([0, 1, 2, 2, 3, 4, 5])
    motions = motions_of(path)
    motions = replace(
        motions,
        **{
            name: getattr(motions, name)[again]
            for name in ("points", "axes", "rapid", "feed", "line", "tool", "spindle", "operation")
        },
        dwell=np.array([0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0]),
    )
    program = post(kr60, cell_of(), motions, asked()).program
    at = int(np.flatnonzero(program.motions.dwell)[0])
    assert program.motions.dwell.sum() == 1.5
    np.testing.assert_array_equal(program.q[at], program.q[at - 1])


def test_rapid_moves_as_joints_like_are_left_whole(kr60: fem.ArmModel) -> None:
    near = dome(8, 0.1)
    rapid = np.zeros(16, dtype=np.bool_)
    rapid[8] = True
    motions = motions_of(
        ToolPath(
            np.vstack([near.points, near.points + np.array([-0.1, -0.5, 0.1])]),
            np.vstack([near.normals] * 2),
            np.vstack([near.axes] * 2),
            np.full(16, np.nan),
        ),
        rapid=rapid,
        feed=np.where(rapid, np.nan, 0.05),
    )
    whole = post(kr60, cell_of(), motions, asked(rapid="joint")).program
    straight = post(kr60, cell_of(), motions, asked(rapid="linear")).program
    # Four times the tolerance of rapid moves was not asked for: only milling moves are split.
    assert not whole.inserted[whole.motions.rapid].any()
    assert straight.inserted[straight.motions.rapid].sum() > 10
    assert between(straight, 0.5).max() <= 1e-5


def test_events_stay_before_their_move(kr60: fem.ArmModel) -> None:
    motions = motions_of(
        dome(6), events=(Event(1, 0, "COOLNT", "ON"), Event(14, 4, "STOP", ""), Event(99, 6, "END", ""))
    )
    program = post(kr60, cell_of(), motions, asked()).program
    first, middle, last = program.motions.events
    assert first.move == 0
    assert last.move == program.n
    # The first piece of move 4 comes right after the point of move 3.
    np.testing.assert_array_equal(program.motions.points[middle.move - 1], motions.points[3])


def test_several_tools_and_empty_paths_are_refused(kr60: fem.ArmModel) -> None:
    motions = motions_of(dome(6), tools=(Cutter(1, "T1"), Cutter(2, "T2")), tool=np.array([0, 0, 0, 1, 1, 1]))
    refuses("K003", "uses 2 tools: got 'T1, T2'", post, kr60, cell_of(), motions, asked())
    refuses("Q007", "tolerance", PostSettings, tolerance=0.0)


def test_a_point_out_of_reach_is_named_by_its_source_line(kr60: fem.ArmModel) -> None:
    path = dome(12, 0.2)
    points = path.points.copy()
    points[7] = 5.0, 0.0, 0.0
    far = motions_of(ToolPath(points, path.normals, path.axes, path.feed))
    for gamma in (0.0, GammaRange(count=12)):
        refuses(
            "G001", r"line 1[67]: .*cannot be reached", post, kr60, cell_of(), far, asked(gamma=gamma, tolerance=1e-3)
        )


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(1, 7), min_size=1, max_size=6), st.integers(0, 2**32 - 1))
def test_pieces_lie_on_line_and_great_circle(pieces: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = len(pieces) + 1
    axes = rng.normal(size=(n, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    motions = motions_of(ToolPath(rng.normal(size=(n, 3)), axes, axes, np.full(n, 0.1)))
    out, inserted, move, _ = subdivided(motions, np.array([1, *pieces]))
    assert out.n == 1 + sum(pieces)
    np.testing.assert_array_equal(out.points[~inserted], motions.points)
    np.testing.assert_array_equal(move, np.repeat(np.arange(n), [1, *pieces]))
    way = np.linalg.norm(np.diff(out.points, axis=0), axis=1)
    turn = np.arccos(np.clip(np.einsum("ni,ni->n", out.axes[1:], out.axes[:-1]), -1.0, 1.0))
    for i in range(1, n):
        of = np.flatnonzero(move == i) - 1
        whole = np.linalg.norm(motions.points[i] - motions.points[i - 1])
        np.testing.assert_allclose(way[of], whole / pieces[i - 1], rtol=1e-9)
        angle = np.arccos(np.clip(motions.axes[i] @ motions.axes[i - 1], -1.0, 1.0))
        # The inverse cosine has half the digits near zero.
        np.testing.assert_allclose(turn[of], angle / pieces[i - 1], rtol=1e-6, atol=3e-8)


def test_half_a_turn_in_one_move_is_refused() -> None:
    axes = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    motions = motions_of(ToolPath(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]), axes, axes, np.full(2, 0.1)))
    refuses("Q007", "line 11: the tool axis turns by half a turn", subdivided, motions, np.array([1, 2]))
    assert pieces_for(motions, 1e-5, 1.0)[0] == 1


def test_distances_of_frames_keep_their_digits() -> None:
    A = np.eye(4)[None]
    B = A.copy()
    small = 1e-9
    B[0, :2, :2] = [[np.cos(small), -np.sin(small)], [np.sin(small), np.cos(small)]]
    B[0, :3, 3] = 3e-9, 0.0, 4e-9
    away, turned = frame_distance(A, B)
    assert away[0] == pytest.approx(5e-9, rel=1e-12)
    assert turned[0] == pytest.approx(small, rel=1e-6)
