"""One base position: closed form, brute force, reach, collisions, compliance of the axes."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from placement_cases import cell_of, line, problem_of, rail
from posture_cases import dome, part
from refusals import refuses
from rigid_frames import rigid_frame

import fem
from machining.cell import Body, Fixture, Turntable, arm_of, box, scene_of
from machining.placement import How, Placement, Problem, find_fixed, follow, holding, on_axes, place
from machining.placement.following import Found
from machining.placement.freedom import best_merits
from machining.placement.holding import held
from machining.placement.search import Looker
from machining.placement.sweeping import shortfalls, sweep_sites, wrist_lack
from machining.posture.drive import limit_distance
from machining.posture.points import GammaRange, sweep_gamma
from machining.stiffness.cartesian import translational
from machining.stiffness.indices import directional_stiffness
from machining.task import tool_path
from robots import InputError, forward_kinematics
from robots.arrays import Array

# Where gamma does not matter, or any will do.
ANY = GammaRange(count=18)


@pytest.fixture(scope="module")
def waist(kr60: fem.ArmModel) -> fem.ArmModel:
    """Only joint 1 gives way, 2e6 N m/rad: stiffness along y is k / x^2, x the distance in front of axis 1."""
    stiff = kr60.with_rigid_joints()
    joints = tuple(kr60.joints[i] if i == 0 else joint for i, joint in enumerate(stiff.joints))
    return replace(stiff, joints=joints).with_springs({kr60.robot.joint_names[0]: 2e6})


def distance_of(x: Array, path: Array) -> Array:
    """Distance (p, n) m in front of the base at rail positions x of the points of a path in the part frame."""
    return np.asarray(1.2 + path[:, 0] - x[:, None])


def test_a_soft_waist_stands_as_near_as_it_can(waist: fem.ArmModel) -> None:
    """A force along y turns joint 1 only: k_i = k1 / x_i^2, exactly, so the stiffest position is the nearest one."""
    cell, path = cell_of(rail(limits=(-0.6, 0.0))), line()
    found = place(problem_of(waist, cell, path, gamma=ANY))
    expected = 2e6 / distance_of(np.zeros(1), path.points)[0] ** 2
    np.testing.assert_allclose(found.after.e, 0.0, atol=1e-12)
    # Round-off of the inverse and forward kinematics.
    np.testing.assert_allclose(found.after.stiffness, expected, rtol=1e-10)
    assert found.after.mean == pytest.approx(expected.mean(), rel=1e-10)
    assert found.after.worst == pytest.approx(expected.min(), rel=1e-10)


def test_k_sf_of_a_soft_waist_in_closed_form(waist: fem.ArmModel) -> None:
    cell, path = cell_of(rail(limits=(-0.6, -0.1))), line()
    found = place(problem_of(waist, cell, path, "ksf", ANY))
    k = 2e3 / distance_of(np.full(1, -0.1), path.points)[0] ** 2
    criterion = found.after.criterion
    expected = criterion.alpha * (k**2).sum() + criterion.beta * k.mean() ** 4
    assert found.after.k_sf == pytest.approx(expected, rel=1e-9)
    # Comparable weights: both terms are near 1 at the best position (the criterion is rounded to two digits).
    assert 0.7 < float(found.after.terms.squares) < 1.5
    assert 0.7 < float(found.after.terms.mean) < 1.5


def test_a_force_aslant_wants_the_base_beside_it(waist: fem.ArmModel) -> None:
    """A rail across. F = (fx, fy) turns joint 1 by x fy - y fx: k = k1 |F|^2 / (x fy - y fx)^2.

    The best position is the one where the force goes by axis 1 nearest.
    """
    cell, force = cell_of(rail("cross", (0.0, 1.0, 0.0), limits=(-0.3, 0.1))), (-60.0, 80.0, 0.0)
    path = tool_path(np.array([[0.0, 0.0, 0.0], [0.0, 0.02, 0.0]]), [0.0, 0.0, 1.0])
    found = place(problem_of(waist, cell, path, "mean", ANY, force))

    def stiffness(e: Array) -> Array:
        y = 0.2 + path.points[:, 1] - e
        return np.asarray(2e6 * 1e4 / (1.2 * 80.0 + 60.0 * y) ** 2)

    fine = np.linspace(-0.3, 0.1, 4001)[:, None]
    expected = stiffness(fine).mean(axis=1)
    assert found.after.mean == pytest.approx(expected.max(), rel=1e-6)
    np.testing.assert_allclose(found.after.e[0], fine[expected.argmax()], atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("aim", ["ksf", "mean", "worst", "error"])
def test_brute_force_finds_nothing_better(kr60: fem.ArmModel, aim: str) -> None:
    problem = problem_of(kr60, cell_of(rail()), dome(20, 0.4), aim, GammaRange(-2.9, -1.4, 8), (80.0, 40.0, -60.0))
    found = find_fixed(problem)
    looker = Looker(found.problem)
    x = problem.space.grid(101)
    looks = looker.at(x, np.arange(20))
    best = max(looks, key=lambda look: look.rank)
    assert best.rank[0]
    # The search ends at 1 mm; the grid has 20 mm.
    assert found.merit >= best.merit - 0.005 * abs(best.merit)
    assert found.evaluations < 120


@pytest.mark.slow
def test_what_is_said_is_what_the_posture_gives(kr60: fem.ArmModel) -> None:
    """By forward kinematics and compliance, away from everything that searched."""
    force = np.array([80.0, 40.0, -60.0])
    problem = problem_of(kr60, cell_of(rail()), dome(20, 0.4), "ksf", ANY, tuple(force))
    after = place(problem).after
    frames = forward_kinematics(kr60.robot, after.course.q)
    tip = frames.p_flange + frames.R_flange @ problem.cell.tool.T_flange_tool[:3, 3]
    wanted = problem.path.points + part()[:3, 3] - np.array([1.0, 0.0, 0.0]) * after.e
    np.testing.assert_allclose(tip, wanted, atol=1e-9)
    C = translational(kr60, after.course.q, problem.cell.tool.T_flange_tool[:3, 3])
    np.testing.assert_allclose(after.stiffness, directional_stiffness(C, force), rtol=1e-12)
    assert (limit_distance(kr60.robot, after.course.q) >= -1e-9).all()
    normal = np.einsum("ni,nij,j->n", problem.path.normals, C, force)
    np.testing.assert_allclose(after.error.normal, normal, rtol=1e-10, atol=1e-15)


def test_many_positions_in_one_sweep_are_each_by_itself(kr60: fem.ArmModel) -> None:
    """Also where one position's path ends where the next one's starts."""
    cell = cell_of(rail(), rail("lift", (0.0, 0.0, 1.0), limits=(-0.2, 0.2)))
    path = line(5, 0.2)
    problem = problem_of(kr60, cell, path, "mean", GammaRange(-2.9, -1.4, 4), (30.0, 20.0, -50.0))
    # Positions 0.2 m apart: the last point of one is the first of the next.
    e = np.array([[0.0, 0.0], [0.2, 0.0], [0.4, 0.0], [0.1, 0.1], [-0.9, 0.0]])
    together = sweep_sites(problem, e, np.zeros(5), np.arange(5), problem.angles)
    for i in range(5):
        task, objective = problem.looked_at(e[i], 0.0, np.arange(5))
        alone = sweep_gamma(kr60, task, objective, problem.angles)
        np.testing.assert_array_equal(together.valid[i], np.moveaxis(alone.valid, 0, 2))
        np.testing.assert_allclose(together.value[i], np.moveaxis(alone.value, 0, 2), rtol=1e-9)
    assert np.isfinite(best_merits(problem, together)[0]).any()


def test_positions_keep_their_own_angles_when_some_are_taken_out(kr60: fem.ArmModel) -> None:
    """What a position lacks is worked out at the angles gamma that it was swept at, not at another's."""
    problem = problem_of(kr60, cell_of(rail()), line(3, 0.2), "mean", GammaRange(-2.9, -1.4, 4), (30.0, 20.0, -50.0))
    e = np.array([[-2.0], [0.0], [1.5]])
    gamma = np.array([[0.0, 0.5], [1.0, 1.5], [-1.0, -2.0]])
    sites = sweep_sites(problem, e, np.zeros(3), np.arange(3), gamma)
    some = np.array([2, 0])
    assert (np.ptp(wrist_lack(problem, sites), axis=1) > 0.0).any()
    np.testing.assert_array_equal(wrist_lack(problem, sites.at_positions(some)), wrist_lack(problem, sites)[some])
    points = np.array([1])
    np.testing.assert_array_equal(wrist_lack(problem, sites.at_points(points)), wrist_lack(problem, sites)[..., points])


def test_a_compliant_rail_adds_by_the_rigid_lever(kr60: fem.ArmModel) -> None:
    """Turning about y at the base: the tip moves by height times angle along x."""
    c = np.array([2e-8, 0.0, 0.0, 0.0, 3e-8, 0.0])
    cell = cell_of(rail(compliance=c))
    q = np.array([[0.2, -0.8, 1.2, 0.3, 0.7, -0.4]])
    tip = cell.tool.T_flange_tool[:3, 3]
    frames = forward_kinematics(kr60.robot, q)
    x, _, z = frames.p_flange[0] + frames.R_flange[0] @ tip
    more = (translational(on_axes(kr60, cell), q, tip) - translational(kr60, q, tip))[0]
    np.testing.assert_allclose(more[0, 0], 2e-8 + 3e-8 * z**2, rtol=1e-9)
    np.testing.assert_allclose(more[2, 2], 3e-8 * x**2, rtol=1e-9)
    np.testing.assert_allclose(more[0, 2], -3e-8 * x * z, rtol=1e-9)
    assert on_axes(kr60, cell_of(rail())) is kr60


def test_a_compliant_rail_in_turned_axes(kr60: fem.ArmModel) -> None:
    """World axes of the rail are not those of a base that is turned by 90 deg about z: x becomes -y."""
    T = rigid_frame(R=[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    cell = cell_of(rail(compliance=np.array([1e-7, 0, 0, 0, 0, 0])), T_world_base0=T)
    q = np.array([[0.2, -0.8, 1.2, 0.3, 0.7, -0.4]])
    more = translational(on_axes(kr60, cell), q) - translational(kr60, q)
    np.testing.assert_allclose(more[0], np.diag([0.0, 1e-7, 0.0]), atol=1e-20)


@pytest.mark.slow
def test_a_post_in_the_way_moves_the_base(kr60: fem.ArmModel) -> None:
    """The best free position collides with a post put there; the next choice keeps clear of it."""
    path, gamma = line(6, 0.3), ANY
    free = place(problem_of(kr60, cell_of(rail()), path, "mean", gamma))
    at = free.after.e[0, 0]
    middle = forward_kinematics(kr60.robot, free.after.course.q).p[4, 3]
    post = box([0.1, 0.1, 3.0])
    T = rigid_frame((middle[0] + at, middle[1], -1.0))
    cell = cell_of(rail(), fixtures=(Fixture(Body("post", (post.moved(T),))),))
    scene = scene_of(cell, arm_of("kr60-3"))
    problem = problem_of(kr60, cell, path, "mean", gamma, scene=scene, clearance=0.02)
    with pytest.raises(InputError, match="obstacle"):
        follow(problem, free.after.e[0], 0.0, float(free.after.course.gamma[0]))
    found = place(problem)
    from machining.cell import clearance

    gap = clearance(scene, found.after.course.q, found.after.e[:1]).distance
    assert gap.min() >= 0.02
    assert found.after.mean < free.after.mean


def test_out_of_reach_everywhere_says_by_how_much(kr60: fem.ArmModel) -> None:
    """The wrist centre lacks what the rail lacks: pushing the part 100 mm farther adds 100 mm, far out along x."""
    lacking = []
    for more in (0.0, 0.1):
        cell = cell_of(rail(limits=(-0.2, 0.2)), part=part(6.0 + more, 0.0, 0.9))
        caught = refuses(
            "G001",
            "no base position reaches the whole path",
            place,
            problem_of(kr60, cell, line(6, 0.1), gamma=GammaRange(count=12)),
        )
        assert "rail 200 mm" in str(caught)
        words = str(caught)
        lacking.append(float(words.split(" mm out of reach")[0].split()[-1]))
    # Three digits are printed; the arm looks nearly along x.
    assert lacking[1] - lacking[0] == pytest.approx(100.0, abs=12.0)
    assert lacking[0] > 3000.0


def test_the_lack_is_the_distance_to_the_reach(kr60: fem.ArmModel) -> None:
    """A part pulled back by what is lacking is reached, by 1 mm less it is not (joint limits wide open)."""
    limits = np.tile([-20.0, 20.0], (6, 1))
    arm = replace(kr60, robot=replace(kr60.robot, limits=limits))
    path = tool_path(np.array([[0.0, 0.0, 0.0], [0.0, 1e-3, 0.0]]), [0.0, 0.0, 1.0])

    def lack(x: float) -> float:
        problem = problem_of(arm, cell_of(rail(), part=part(x, 0.0, 0.6)), path, gamma=0.0)
        sites = sweep_sites(problem, np.zeros((1, 1)), np.zeros(1), np.arange(2), problem.angles)
        return shortfalls(problem, sites)[0].lack

    far = next(x for x in np.arange(1.5, 3.0, 0.01) if lack(float(x)) > 0.0)
    low, high = far - 0.01, far
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if lack(middle) > 0.0 else (middle, high)
    # The lack grows from zero at the edge of reach; slope at most 1 along a line.
    beyond = lack(low + 0.05) - np.pi
    assert 0.02 < beyond <= 0.05 + 1e-6


def test_bad_input(kr60: fem.ArmModel) -> None:
    cell, path = cell_of(rail()), line()
    refuses("G005", r"nothing to place.*To fix it: describe the rail", problem_of, kr60, cell_of(), path)
    refuses(
        "G005",
        r"linear axis of cell cell: got 'slide'; allowed: rail",
        problem_of,
        kr60,
        cell,
        path,
        ranges={"slide": (0.0, 1.0)},
    )
    refuses("G005", "range of axis rail", problem_of, kr60, cell, path, ranges={"rail": (0.5, 0.2)})
    refuses("G005", "within its limits", problem_of, kr60, cell, path, ranges={"rail": (-5.0, 0.2)})
    refuses("G005", "nothing to place", problem_of, kr60, cell, path, ranges={"rail": (0.2, 0.2)})
    refuses("G005", "turntable of cell", problem_of, kr60, cell, path, table=(-1.0, 1.0))
    refuses("G004", "aim of the placement", problem_of, kr60, cell, path, "best")
    refuses("G004", "course of gamma", place, problem_of(kr60, cell, path), How(course=True))
    for how in ({"mode": "sliding"}, {"steps": 1}, {"cost": -1.0}):
        refuses("G004", "", How, **how)


def test_a_held_axis_stays(kr60: fem.ArmModel) -> None:
    cell = cell_of(rail(), rail("lift", (0.0, 0.0, 1.0), limits=(-0.2, 0.2)))
    problem = problem_of(kr60, cell, line(), ranges={"lift": (0.1, 0.1), "rail": (-0.3, 0.3)}, gamma=ANY)
    assert problem.space.names == ("rail",)
    found = place(problem)
    np.testing.assert_array_equal(found.after.e[:, 1], 0.1)
    assert (np.abs(found.after.e[:, 0]) <= 0.3).all()


@pytest.mark.slow
def test_the_turntable_is_searched_too(waist: fem.ArmModel) -> None:
    """A point beside the table's axis comes nearest to the arm when it is turned towards it."""
    table = Turntable(part()[:3, 3], np.array([0.0, 0.0, 1.0]), np.array([-np.pi, np.pi]))
    cell = cell_of(rail(limits=(-0.1, 0.1)), part=part(1.5, 0.0, 0.6), turntable=table)
    cell = replace(cell, turntable=replace(table, point=np.array([1.5, 0.0, 0.6])))
    path = tool_path(np.array([[0.3, 0.0, 0.0], [0.3, 0.01, 0.0]]), [0.0, 0.0, 1.0])
    problem = problem_of(waist, cell, path, "worst", GammaRange(count=12), table=(np.pi / 2, np.pi))
    found = place(problem)
    # Turned by 180 deg the point is 1.2 m from the carriage at 0, and the carriage goes 0.1 m nearer.
    assert np.degrees(found.after.table) == pytest.approx(180.0, abs=1.0)
    np.testing.assert_allclose(found.after.e[:, 0], 0.1, atol=2e-3)
    assert found.after.worst == pytest.approx(2e6 / 1.1**2, rel=5e-3)


# ------------------------------------------------------------
# Axes that are not needed while cutting move near and hold still, where that costs little

N = 12
# The rail is worth much, the lift little, where they go along with the path.
WANTED = np.stack([np.linspace(-0.5, 0.5, N), np.linspace(-0.2, 0.2, N)], axis=1)
WORTH = np.array([2000.0, 20.0])


@pytest.fixture
def problem(kr60: fem.ArmModel) -> Problem:
    cell = cell_of(rail(), rail("lift", (0.0, 0.0, 1.0), limits=(-0.5, 0.5)))
    return problem_of(kr60, cell, line(N), "mean", free=np.arange(N - 1) == 5)


def course_at(e: Array) -> Any:
    return SimpleNamespace(value=1000.0 - ((e - WANTED) ** 2) @ WORTH, gamma=np.zeros(N))


@pytest.fixture
def moving(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> Found:
    monkeypatch.setattr(holding, "follow", lambda _, e, *__: course_at(e))
    course = course_at(WANTED)
    return Found(problem, WANTED.copy(), course.gamma, course, 1000.0, 1)


def test_the_axis_that_brings_little_holds_still_in_each_cut(problem: Problem, moving: Found) -> None:
    found, names = held(problem, moving, 0.01)
    assert names == ("lift",)
    np.testing.assert_array_equal(found.x[:, 0], WANTED[:, 0])
    # The middle of each cut's way: half way between the ends of six points.
    expected = np.repeat([WANTED[:6, 1].mean(), WANTED[6:, 1].mean()], 6)
    np.testing.assert_allclose(found.x[:, 1], expected, atol=1e-15)
    assert 990.0 <= found.merit < 1000.0
    assert found.merit == pytest.approx(course_at(found.x).value.mean())


def test_all_axes_together_cost_no_more_than_the_share(problem: Problem, moving: Found) -> None:
    assert held(problem, moving, 0.0)[1] == ()
    both, names = held(problem, moving, 0.2)
    assert names == ("lift", "rail")
    assert both.merit >= 800.0
    assert np.ptp(both.x[:6], axis=0).max() == 0.0


def test_a_place_that_cannot_be_driven_is_not_taken(
    problem: Problem, moving: Found, monkeypatch: pytest.MonkeyPatch
) -> None:
    def follow(_: Any, e: Array, *__: Any) -> Any:
        # Nothing in the middle of a cut's way.
        if any(abs(e[0, j] - WANTED[:6, j].mean()) < 1e-9 for j in range(2)):
            raise InputError("in the way", code="X004")
        return course_at(e)

    monkeypatch.setattr(holding, "follow", follow)
    found, names = held(problem, moving, 0.01)
    assert names == ("lift",)
    low, high = WANTED[0, 1], WANTED[5, 1]
    assert found.x[0, 1] in (pytest.approx(low + 0.25 * (high - low)), pytest.approx(low + 0.75 * (high - low)))
    monkeypatch.setattr(holding, "follow", lambda *_: (_ for _ in ()).throw(InputError("nothing", code="X004")))
    assert held(problem, moving, 0.5) == (moving, ())


def test_an_axis_at_rest_is_left_alone(problem: Problem, moving: Found) -> None:
    x = WANTED.copy()
    x[:, 1] = 0.1
    assert "lift" not in held(problem, Found(problem, x, moving.gamma, moving.course, 900.0, 1), 1.0)[1]


# ------------------------------------------------------------
# A placement carried over to all moves of its source: axes travel on rapid moves, not while the tool plunges


def placement(moves: list[int], count: int, travel: list[float]) -> Placement:
    n = len(moves)
    return Placement(
        "kr60-3",
        "cell",
        ("rail",),
        np.array(travel)[:, None],
        0.0,
        np.zeros(n),
        ("q1_deg",),
        np.zeros((n, 1)),
        np.array(moves),
        count,
    )


def test_axes_travel_on_the_rapid_moves_between_two_cuts() -> None:
    """A cut to move 2, retract at feed, two rapid moves, a plunge to move 6 where the next cut begins."""
    found = placement([1, 2, 6, 7], 9, [0.0, 0.1, 0.5, 0.6])
    rapid = np.array([1, 0, 0, 0, 1, 1, 0, 0, 1]) > 0
    np.testing.assert_allclose(found.at_moves(rapid)[:, 0], [0, 0, 0.1, 0.1, 0.3, 0.5, 0.5, 0.6, 0.6])
    # Without a rapid move, or without knowing, all share.
    for unknown in (None, np.zeros(9, dtype=np.bool_)):
        np.testing.assert_allclose(found.at_moves(unknown)[:, 0], [0, 0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.6])
    assert found.joints_at_moves(rapid).shape == (9, 1)
    np.testing.assert_array_equal(found.gamma_at_moves(rapid), np.zeros(9))


def test_a_cell_without_linear_axes_has_no_travels() -> None:
    found = placement([0, 1], 2, [0.0, 0.0])
    none = Placement(
        found.robot, found.cell, (), np.zeros((2, 0)), 0.0, found.gamma, found.joints, found.q, found.moves, 2
    )
    assert none.at_moves(np.ones(2, dtype=np.bool_)).shape == (2, 0)
