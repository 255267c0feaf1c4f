"""The base in steps, and moving along the path: exact programmes, limits kept, files read back."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from placement_cases import cell_of, line, problem_of, rail
from posture_cases import dome, part
from refusals import refuses
from rigid_frames import rigid_frame

import fem
from machining.cell import Body, Fixture, arm_of, box, clearance, scene_of
from machining.cutting.each_tool import ForceOfEach
from machining.cutting.force import ByRuns
from machining.placement import (
    How,
    Placement,
    Problem,
    axis_rates,
    find_steps,
    place,
    placement_content,
    read_placement,
    survey,
)
from machining.placement.between import undriven, with_links
from machining.placement.following import between, check_rates, smoothed
from machining.placement.steps import Pieces, Table, best_by_slopes, best_pieces
from machining.placement.study import place_along
from machining.posture.drive import Drive, limit_distance
from machining.posture.points import GammaRange
from machining.programs.posting import PostSettings, post
from machining.setup import Tools
from machining.stiffness.criterion import Criterion
from machining.task import ToolPath, tool_path
from machining.toolpaths import read_given_path
from machining.toolpaths.conversion import GivenPath
from machining.toolpaths.motions import Motions
from robots import InputError, Reason, inverse_kinematics
from robots.arrays import Array

ANY = GammaRange(count=18)


def every_way(table: Table, most: int) -> dict[int, list[tuple[tuple[int, ...], ...]]]:
    """All drivable ways by number of pieces; a way is its states point by point, and where it starts anew."""
    s, m = table.gain.shape
    found: dict[int, list[tuple[tuple[int, ...], ...]]] = {j: [] for j in range(1, most + 1)}
    for states in product(range(s), repeat=m):
        if not np.isfinite(table.gain[list(states), range(m)]).all():
            continue
        changes = [i for i in range(1, m) if states[i] != states[i - 1]]
        stays = [i for i in range(1, m) if states[i] == states[i - 1]]
        if len(changes) + 1 > most or not all(table.cut[i - 1] for i in changes):
            continue
        # Standing anew in the same place is a piece too, where the state cannot go on.
        blocked = [i for i in stays if not table.go[states[i], i - 1]]
        if all(table.cut[i - 1] for i in blocked) and len(changes) + len(blocked) + 1 <= most:
            found[len(changes) + len(blocked) + 1].append((states,))
    return found


@pytest.mark.parametrize("worst", [False, True])
def test_the_programme_finds_what_trying_all_ways_finds(rng: np.random.Generator, worst: bool) -> None:
    for _ in range(20):
        gain = rng.uniform(1.0, 2.0, (3, 6))
        gain[rng.random((3, 6)) < 0.15] = -np.inf
        table = Table(gain, rng.random((3, 5)) > 0.2, rng.random(5) > 0.3)
        found = best_pieces(table, 3, worst=worst)
        ways = every_way(table, 3)
        for j in (1, 2, 3):
            values = [gain[list(states), range(6)] for (states,) in ways[j]]
            scores = [v.min() if worst else v.sum() for v in values]
            pieces = found[j - 1]
            fewer = [s for k in range(1, j) for (way,) in ways[k] for s in [_score(gain, way, worst)]]
            if pieces is None:
                assert not scores
                continue
            states = pieces.of_rows(6)
            assert len(pieces.state) == j
            got = _score(gain, tuple(states), worst)
            # A way with a needless cut into the same state is no better than one with fewer pieces.
            assert got == pytest.approx(max([*scores, *[f for f in fewer if f <= got + 1e-12]]), rel=1e-12)
            assert all(got >= s - 1e-12 for s in scores)
            assert all(table.cut[i - 1] for i in pieces.start[1:])


def _score(gain: Array, states: tuple[int, ...], worst: bool) -> float:
    v = gain[list(states), range(gain.shape[1])]
    return float(v.min() if worst else v.sum())


def test_slopes_find_the_best_k_sf(rng: np.random.Generator) -> None:
    """K_sf is no sum; against all ways of cutting."""
    for trial in range(15):
        k = rng.uniform(1e5, 2e6, (4, 5))
        _check_slopes(k, Criterion.comparable(float(k.max(axis=0).mean()) * (0.3 + 0.1 * trial), 5))


def _check_slopes(k: Array, criterion: Criterion) -> None:
    cut, go = np.array([True, False, True, True]), np.ones((4, 4), dtype=np.bool_)

    def value(states: Array | tuple[int, ...]) -> Array:
        return np.asarray(k[list(states), range(5)])

    def solve(slope: float) -> list[Pieces | None]:
        gain = (criterion.alpha * 5 * (k * 1e-3) ** 2 + slope * k * 1e-3) * 0.2
        return best_pieces(Table(gain, go, cut), 2)

    best = best_by_slopes(
        solve,
        lambda p: float(criterion.value(value(p.of_rows(5)))),
        lambda p: float(value(p.of_rows(5)).mean()),
        criterion.slope,
        2,
    )
    ways = every_way(Table(k, go, cut), 2)
    for j, pieces in enumerate(best, start=1):
        expected = max(float(criterion.value(value(states))) for (states,) in ways[j])
        assert pieces is not None
        assert float(criterion.value(value(pieces.of_rows(5)))) >= expected * (1.0 - 1e-12)


@pytest.mark.slow
def test_steps_are_better_the_more_there_are(kr60: fem.ArmModel) -> None:
    problem = problem_of(kr60, cell_of(rail()), dome(40, 0.7), "mean", ANY, (80.0, 40.0, -60.0))
    one = place(problem)
    steps = place(problem, How("steps", steps=3, anywhere=True, cost=0.0))
    assert steps.fixed is not None
    assert steps.fixed.mean == pytest.approx(one.after.mean, rel=1e-12)
    assert steps.after.mean > 1.1 * one.after.mean
    # Between two starts the base does not move.
    for a, b in zip(steps.first, [*steps.first[1:], 40], strict=True):
        assert np.ptp(steps.after.e[a:b], axis=0).max() == 0.0
        assert (np.abs(np.diff(steps.after.course.q[a:b], axis=0)) <= np.radians(20.0) * 1.001).all()
    dear = place(problem, How("steps", steps=3, anywhere=True, cost=5.0))
    assert len(dear.first) == 1
    assert any("one position is taken" in note for note in dear.notes)


@pytest.mark.slow
def test_the_base_moves_at_rapid_moves_only(kr60: fem.ArmModel) -> None:
    path = dome(40, 0.7)
    problem = problem_of(kr60, cell_of(rail()), path, "mean", ANY, (80.0, 40.0, -60.0))
    with pytest.raises(InputError, match=r"the path has no rapid move.*allow them anywhere"):
        find_steps(problem, 2)
    free = np.zeros(39, dtype=np.bool_)
    free[[12, 31]] = True
    marked = problem_of(kr60, cell_of(rail()), path, "mean", ANY, (80.0, 40.0, -60.0), free=free)
    placed = place(marked, How("steps", steps=3, cost=0.0))
    assert set(placed.first) <= {0, 13, 32}
    assert len(placed.first) > 1


@pytest.mark.slow
def test_a_path_of_two_equal_tools_is_placed_as_that_of_one(kr60: fem.ArmModel) -> None:
    path, cell, free = dome(16, 0.7), cell_of(rail()), np.zeros(15, dtype=np.bool_)
    free[7] = True
    one = problem_of(kr60, cell, path, "mean", ANY, (80.0, 40.0, -60.0), free=free)
    change = np.repeat([0, 1], 8)
    frames = np.broadcast_to(cell.tool.T_flange_tool, (16, 4, 4))
    forces = ForceOfEach((one.goal.force, one.goal.force), ("mill", "ball"), change)
    two = replace(one, tools=Tools(frames, (), change), goal=replace(one.goal, force=forces))
    how = How("steps", steps=2, cost=0.0)
    expected, found = place(one, how), place(two, how)
    assert found.first.tolist() == expected.first.tolist() == [0, 8]
    np.testing.assert_allclose(found.after.e, expected.after.e, rtol=1e-12)
    np.testing.assert_allclose(found.after.course.value, expected.after.course.value, rtol=1e-12)


@pytest.mark.slow
def test_steps_keep_clear_of_a_post(kr60: fem.ArmModel) -> None:
    """Every piece at its place; and never worse than the best position at rest, which is on the grid."""
    T = rigid_frame((0.55, -0.35, 0.0))
    post_ = Fixture(Body("post", (box([0.1, 0.1, 2.0]).moved(T),)))
    cell = cell_of(rail(limits=(-1.0, 2.0)), rail("cross", (0.0, 1.0, 0.0), limits=(-0.8, 0.8)), fixtures=(post_,))
    scene = scene_of(cell, arm_of("kr60-3"))
    problem = problem_of(kr60, cell, dome(16, 0.7), "mean", ANY, (80.0, 40.0, -60.0), scene=scene)
    placed = place(problem, How("steps", steps=2, anywhere=True, cost=0.0))
    assert len(placed.first) > 1
    assert placed.fixed is not None
    assert placed.after.mean > placed.fixed.mean
    assert clearance(scene, placed.after.course.q, placed.after.e).distance.min() >= 0.0
    # Each piece by itself is no worse than the position at rest on it, but for what refinement trades: nothing.
    for a, b in zip(placed.first, [*placed.first[1:], 16], strict=True):
        assert placed.after.stiffness[a:b].mean() >= 0.99 * placed.fixed.stiffness[a:b].mean()


@pytest.mark.slow
def test_a_long_part_needs_steps_or_motion(kr60: fem.ArmModel) -> None:
    """3 m of straight line: no position reaches it all; two or more do, and a base that goes with it does."""
    T = part(1.2, 0.0, 0.6)
    T[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    cell = cell_of(rail("rail", (0.0, 1.0, 0.0), limits=(-2.0, 2.0), speed=0.5, acceleration=1.0), part=T)
    problem = problem_of(kr60, cell, line(61, 3.6, feed=0.1), "ksf", ANY, (80.0, 40.0, -60.0))
    with pytest.raises(InputError, match="no base position reaches the whole path"):
        place(problem)
    steps = place(problem, How("steps", steps=3, anywhere=True))
    assert steps.fixed is None
    assert steps.why_no_fixed is not None
    assert len(steps.first) in (2, 3)
    moving = place(problem, How("moving"))
    assert np.ptp(moving.after.e[:, 0]) > 1.0
    _check_motion(kr60, problem, moving.after.e, moving.after.course.q)


def _check_motion(kr60: fem.ArmModel, problem: Any, e: Array, q: Array) -> None:
    """Limits, speeds and accelerations from the numbers themselves."""
    axis, times = problem.cell.linear_axes[0], problem.path.times
    assert (e[:, 0] >= axis.limits[0] - 1e-12).all()
    assert (e[:, 0] <= axis.limits[1] + 1e-12).all()
    speed = np.diff(e[:, 0]) / times
    assert np.abs(speed).max() <= axis.speed * 1.001
    assert np.abs(np.diff(speed) / (0.5 * (times[1:] + times[:-1]))).max() <= axis.acceleration * 1.001
    assert (limit_distance(kr60.robot, q) >= -1e-9).all()
    joint = np.abs(np.diff(q, axis=0)) / times[:, None]
    assert (joint <= problem.drive.speeds(kr60.robot) * 1.001).all()


@pytest.mark.slow
def test_moving_keeps_limits_speeds_and_clearance(kr60: fem.ArmModel) -> None:
    cell = cell_of(rail(speed=0.3, acceleration=0.6))
    speeds = np.radians([128.0, 102.0, 128.0, 260.0, 245.0, 322.0])
    scene = scene_of(cell, arm_of("kr60-3"))
    problem = problem_of(
        kr60,
        cell,
        dome(40, 0.5, feed=0.05),
        "ksf",
        ANY,
        (80.0, 40.0, -60.0),
        drive=Drive(speed=speeds),
        scene=scene,
        clearance=0.01,
    )
    placed = place(problem, How("moving"))
    assert placed.fixed is not None
    assert placed.after.k_sf > placed.fixed.k_sf
    assert np.ptp(placed.after.e) > 0.02
    _check_motion(kr60, problem, placed.after.e, placed.after.course.q)
    assert clearance(scene, placed.after.course.q, placed.after.e).distance.min() >= 0.01


@pytest.mark.slow
def test_a_slow_axis_stays_where_it_is_best(kr60: fem.ArmModel) -> None:
    """At 1 mm/s the rail cannot do much in ten seconds; the result is no worse than at rest, and keeps that."""
    cell = cell_of(rail(speed=1e-3, acceleration=1.0))
    problem = problem_of(kr60, cell, dome(30, 0.4, feed=0.05), "ksf", ANY, (80.0, 40.0, -60.0))
    placed = place(problem, How("moving"))
    assert placed.fixed is not None
    assert placed.after.k_sf >= placed.fixed.k_sf * (1.0 - 1e-9)
    _check_motion(kr60, problem, placed.after.e, placed.after.course.q)


def test_smoothing_keeps_lines_and_lowers_curvature(rng: np.random.Generator) -> None:
    straight = np.outer(np.arange(20.0), [1.0, -2.0]) + 3.0
    np.testing.assert_allclose(smoothed(straight, 1e3), straight, atol=1e-9)
    rough = rng.normal(size=(20, 1))
    roughness = [np.linalg.norm(np.diff(smoothed(rough, w), 2, axis=0)) for w in (0.0, 1.0, 100.0)]
    assert roughness[0] > roughness[1] > roughness[2]


def test_rates_and_faults_of_a_known_motion(kr60: fem.ArmModel) -> None:
    """Points 10 mm apart at 0.1 m/s are 0.1 s apart: 20 mm of rail each is 0.2 m/s."""
    problem = problem_of(kr60, cell_of(rail(speed=0.25, acceleration=3.0)), line(11, 0.1, feed=0.1))
    even = np.linspace(0.0, 0.2, 11)[:, None]
    speed, acceleration = axis_rates(problem, even)
    np.testing.assert_allclose(speed, 0.2, rtol=1e-9)
    np.testing.assert_allclose(acceleration, 0.0, atol=1e-9)
    check_rates(problem, even)
    refuses("G006", "speed of axis rail", check_rates, problem, 1.5 * even)
    jerky = np.cumsum(np.where(np.arange(11) % 2, 0.02, -0.02))[:, None]
    refuses("G006", "acceleration of axis rail", check_rates, problem, jerky)


def test_between_knots_nothing_overshoots(kr60: fem.ArmModel) -> None:
    problem = problem_of(kr60, cell_of(rail()), line(50, 0.4))
    rows = np.array([0, 10, 20, 30, 49])
    values = np.array([[0.0], [0.0], [1.0], [1.0], [0.5]])
    found = between(problem, rows, values)
    np.testing.assert_allclose(found[rows], values, atol=1e-12)
    assert found.min() >= 0.0
    assert found.max() <= 1.0


def test_an_axis_is_soon_up_to_speed_where_a_cut_begins(kr60: fem.ArmModel) -> None:
    """Points 0.5 s apart, the fifth segment between two cuts: from rest to 0.04 m/s in 0.1 s, not in 0.25 s."""
    path = tool_path(np.stack([0.025 * np.arange(10), np.zeros(10), np.zeros(10)], axis=1), [0.0, 0.0, 1.0], feed=0.05)
    free = np.zeros(9, dtype=np.bool_)
    free[4] = True
    problem = problem_of(kr60, cell_of(rail(speed=0.5)), path, free=free)
    travel = 0.02 * np.arange(10)[:, None]
    _, acceleration = axis_rates(problem, travel)
    np.testing.assert_allclose(acceleration[:, 0], [0, 0, 0, -0.4, 0.4, 0, 0, 0], atol=1e-9)


def test_rapid_moves_are_no_feed(kr60: fem.ArmModel) -> None:
    """Two parallel lines with a rapid move across: the feed at their ends is along the lines."""
    a = np.stack([np.linspace(0.0, 0.1, 5), np.zeros(5), np.zeros(5)], axis=1)
    path = tool_path(np.vstack([a, a + np.array([0.0, 0.01, 0.0])]), [0.0, 0.0, 1.0])
    free = np.zeros(9, dtype=np.bool_)
    free[4] = True
    problem = problem_of(kr60, cell_of(rail()), path, free=free)
    from machining.cutting import ConstantForce

    feed = ByRuns(ConstantForce(np.array([1.0, 0.0, 0.0]), "process"), free)
    np.testing.assert_allclose(feed.along(problem.home).force, np.tile([1.0, 0.0, 0.0], (10, 1)), atol=1e-12)


def motions_of(path: ToolPath) -> Motions:
    n = path.n
    whole = np.zeros(n, dtype=np.int64)
    return Motions(
        points=path.points,
        axes=path.axes,
        rapid=np.zeros(n, dtype=np.bool_),
        feed=np.full(n, 0.05),
        line=np.arange(n),
        tool=whole,
        spindle=np.zeros(n),
        dwell=np.zeros(n),
        operation=whole,
    )


@pytest.mark.slow
def test_a_placement_is_read_back_and_posted(kr60: fem.ArmModel, tmp_path: Path) -> None:
    path = dome(24, 0.4, feed=0.05)
    cell = cell_of(rail(speed=0.5))
    after = place(problem_of(kr60, cell, path, "ksf", -2.6, (80.0, 40.0, -60.0)), How("moving")).after
    written = Placement(
        "kr60-3",
        "cell",
        ("rail",),
        after.e,
        0.0,
        after.course.gamma,
        kr60.robot.coordinates,
        after.course.q,
        np.arange(24),
        24,
    )
    file = tmp_path / "placement.json"
    file.write_text(json.dumps(placement_content(written)), encoding="utf-8")
    read = read_placement(file)
    np.testing.assert_allclose(read.travel, after.e, atol=1e-9)
    np.testing.assert_allclose(read.q, after.course.q, atol=1e-9)
    np.testing.assert_allclose(read.gamma, after.course.gamma, atol=1e-9)
    settings = PostSettings(gamma=float(read.gamma[0]), travel=read.at_moves(), tolerance=1e-2, table=read.table)
    program = post(kr60, cell, motions_of(path), settings).program
    given = ~program.inserted
    np.testing.assert_allclose(program.travel[given], read.travel, atol=1e-9)
    # The posted arm stands as the placement says; which way its wrist is flipped is the posting's own choice.
    np.testing.assert_allclose(program.q[given][:, :3], read.q[:, :3], atol=1e-6)


def test_moves_off_the_path_share_the_way_of_the_axes() -> None:
    placement = Placement(
        "r",
        "c",
        ("rail",),
        np.array([[0.0], [0.0], [0.9], [0.9]]),
        0.0,
        np.zeros(4),
        ("q1_deg",),
        np.zeros((4, 1)),
        np.array([1, 2, 5, 6]),
        8,
    )
    np.testing.assert_allclose(placement.at_moves()[:, 0], [0.0, 0.0, 0.0, 0.3, 0.6, 0.9, 0.9, 0.9])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"schema": "other/1"}, "schema of placement"),
        ({"source_moves": 1}, "moves must rise"),
        ({"points": {"move": [0, 1]}}, "is missing"),
        ({"linear_axes": ["rail", "lift"]}, "e2_mm"),
    ],
)
def test_bad_files_are_refused(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    good = placement_content(
        Placement(
            "r", "c", ("rail",), np.zeros((2, 1)), 0.0, np.zeros(2), ("q1_deg",), np.zeros((2, 1)), np.arange(2), 2
        )
    )
    file = tmp_path / "placement.json"
    file.write_text(json.dumps(good | change), encoding="utf-8")
    refuses("F006", words, read_placement, file)
    file.write_text("{", encoding="utf-8")
    refuses("F005", "not valid JSON", read_placement, file)
    refuses("F001", "cannot be read", read_placement, tmp_path / "none.json")


# ------------------------------------------------------------
# The moves between the cuts join the search for a place: one is taken from which the whole program can be driven

GAMMA = GammaRange(count=36)
# Two cuts of 80 mm; between them the tool goes over a place far along the rail, with a plunge at feed behind it.
PROGRAM = """G21 G90 G17
T1 M6
S9000 M3
G0 X-40 Y0 Z20
G1 Z0 F600
X-13 F1500
X13
X40
G0 Z20
G0 {far}
G0 X-40 Y40 Z20
G1 Z0 F600
X-13 F1500
X13
X40
G0 Z20
M30
"""


def given(folder: Path, far: str) -> GivenPath:
    file = folder / "two.nc"
    file.write_text(PROGRAM.format(far=far), encoding="utf-8")
    return read_given_path(file)


def case(model: fem.ArmModel, folder: Path, far: str, limits: tuple[float, float]) -> tuple[Problem, GivenPath]:
    path = given(folder, far)
    return problem_of(model, cell_of(rail(limits=limits)), path.path, gamma=GAMMA, free=path.free), path


def free(problem: Problem, given: GivenPath, x: Array) -> bool:
    """Whether some angle, 1 deg apart, and one branch takes all moves of the program, asked with nothing of it."""
    every = given.whole().path
    e, table = problem.space.sites(x[None])
    T = problem.cell.T_base_part(e, table)[0]
    gamma = np.radians(np.arange(-180.0, 180.0))
    x_axis = np.stack([np.cos(gamma), np.sin(gamma), 0.0 * gamma], axis=1)
    z_axis = np.broadcast_to([0.0, 0.0, -1.0], x_axis.shape)
    frames = np.zeros((every.n, len(gamma), 4, 4))
    frames[..., :3, 0], frames[..., :3, 1], frames[..., :3, 2] = x_axis, np.cross(z_axis, x_axis), z_axis
    frames[..., :3, 3], frames[..., 3, 3] = every.points[:, None], 1.0
    found = inverse_kinematics(
        problem.model.robot, (T @ frames).reshape(-1, 4, 4), T_flange_tool=problem.cell.tool.T_flange_tool
    )
    reason = found.reason.reshape(every.n, len(gamma), -1)
    return bool((reason == Reason.FOUND).all(axis=0).any())


def test_places_that_cannot_reach_a_retract_are_ruled_out(kr60: fem.ArmModel, tmp_path: Path) -> None:
    problem, path = case(kr60, tmp_path, "X700 Y0 Z300", (-1.5, 1.5))
    linked = with_links(problem, path)
    cuts, whole = survey(problem, (31,)), survey(linked, (31,))
    ruled = [look for look in whole.grid if look.why == "between"]
    assert len(ruled) > 3
    stops = [look.stopped for look in ruled if look.stopped is not None]
    assert len(stops) == len(ruled)
    assert {stop.line for stop in stops} <= {4, 9, 10, 11, 16}
    assert {stop.why for stop in stops} <= {"reach", "limit"}
    for one, other in zip(cuts.grid, whole.grid, strict=True):
        if one.why:
            assert other.why == one.why
        else:
            near_edge = {free(problem, path, one.x + 0.02 * k) for k in (-1, 0, 1)}
            assert (not other.why) in near_edge


@pytest.mark.parametrize("mode", ["fixed", "steps"])
def test_the_place_recommended_is_one_that_post_can_write(kr60: fem.ArmModel, tmp_path: Path, mode: str) -> None:
    """Without the moves between, the best place for the cuts is one from which the program cannot be driven."""
    problem, path = case(kr60, tmp_path, "X900 Y0 Z300", (-1.5, 1.5))
    only_cuts = place_along(problem, _table(path), How()).placed.after
    assert undriven(with_links(problem, path), only_cuts.e, only_cuts.table, only_cuts.course) is not None
    step = place_along(problem, path, How(mode))  # type: ignore[arg-type]
    after = step.placed.after
    assert step.undriven is None
    assert undriven(with_links(problem, path), after.e, after.table, after.course, step.rapid) is None
    if mode == "fixed":
        # As it stands, with nothing of the placement but base and gamma.
        assert path.motions is not None
        settings = PostSettings(float(after.course.gamma[0]), travel=after.e[0], table=after.table)
        assert post(kr60, problem.cell, path.motions, settings).program.n >= path.count


def _table(given: GivenPath) -> GivenPath:
    """The same cuts without a program."""
    return GivenPath(given.path, given.free, given.moves, given.count)


@pytest.mark.slow
def test_where_no_place_can_drive_the_program_it_is_said(kr60: fem.ArmModel, tmp_path: Path) -> None:
    problem, path = case(kr60, tmp_path, "X9000 Y0 Z300", (-0.5, 0.5))
    step = place_along(problem, path, How())
    assert step.undriven is not None
    assert f"line {path.motions.line[np.argmax(path.motions.points[:, 0])]}" in step.undriven  # type: ignore[union-attr]
    best = place_along(problem, _table(path), How()).placed.after
    np.testing.assert_allclose(step.placed.after.e, best.e, atol=1e-12)


def test_a_program_whose_moves_all_can_be_driven_is_placed_as_its_cuts_are(kr60: fem.ArmModel, tmp_path: Path) -> None:
    problem, path = case(kr60, tmp_path, "X0 Y20 Z20", (-0.5, 0.5))
    step, cuts = (
        place_along(problem, path, How()),
        place_along(problem, _table(path), How()),
    )
    np.testing.assert_array_equal(step.placed.after.e, cuts.placed.after.e)
    np.testing.assert_array_equal(step.placed.after.course.q, cuts.placed.after.course.q)
