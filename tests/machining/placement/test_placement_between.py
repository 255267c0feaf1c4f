"""The moves between the cuts join the search for a place: one is taken from which the whole program can be driven."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from placement_cases import cell_of, problem_of, rail

import fem
from machining.placement import How, Problem, survey
from machining.placement.between import undriven, with_links
from machining.placement.study import place_along
from machining.posture.points import GammaRange
from machining.programs.posting import PostSettings, post
from machining.toolpaths import read_given_path
from machining.toolpaths.conversion import GivenPath
from robots import Reason, inverse_kinematics
from robots.arrays import Array

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
