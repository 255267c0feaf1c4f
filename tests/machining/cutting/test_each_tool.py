"""Forces and bending of several tools along one path are those of each tool where it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from refusals import refuses

from machining.cell import read_cell
from machining.cutting import ConstantForce, ToolBending
from machining.cutting.each_tool import BendingOfEach, ForceOfEach
from machining.task import Task, tool_path
from machining.tool_cuts import cut_of_tools
from machining.toolpaths import read_toolpath
from machining.toolpaths.conversion import read_given_path

EXAMPLE = Path(__file__).parents[3] / "docs" / "examples" / "kr60_bracket"
TOOL = np.array([0, 0, 0, 1, 1, 2, 0, 0])


@pytest.fixture
def task() -> Task:
    """A level path with corners."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 1, 0], [2, 2, 0], [3, 2, 0], [3, 3, 0], [4, 3, 0]]) * 0.01
    axes = np.tile([0.0, 0.0, 1.0], (8, 1))
    return Task(tool_path(points, axes, axes, 0.02), np.eye(4), np.eye(4))


def each(free: np.ndarray | None = None) -> ForceOfEach:
    first = ConstantForce(np.array([10.0, 0.0, 0.0]), "process", relative_sd=0.1)
    second = ConstantForce(np.array([0.0, 20.0, 5.0]), "base", relative_sd=0.2)
    return ForceOfEach((first, second, None), ("mill", "ball", "drill"), TOOL, free)


def test_each_point_has_the_force_of_its_tool(task: Task) -> None:
    found, own = each().along(task), each()
    second = own.forces[1]
    assert second is not None
    np.testing.assert_allclose(found.force[3:5], second.along(task.at(slice(3, 5))).force)
    np.testing.assert_array_equal(found.force[5], 0.0)
    # Feed along the path: the first tool's second run begins anew, nothing joins it to the first.
    np.testing.assert_allclose(found.force[1], [10.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.force[7], [10.0, 0.0, 0.0], atol=1e-12)
    assert found.names[0] == "mill: F_feed"
    assert found.names[3] == "ball: F_x"
    assert found.covariance.shape == (6, 6)
    np.testing.assert_array_equal(found.covariance[:3, 3:], 0.0)
    np.testing.assert_allclose(np.diag(found.covariance), [1.0, 0, 0, 0, 16.0, 1.0])


def test_the_bending_is_that_of_the_tool_that_is_there(task: Task) -> None:
    thick, thin = ToolBending(0.05, 0.02, 600e9, 0.1), ToolBending(0.05, 0.01, 600e9, 0.3)
    both = BendingOfEach((thick, thin, None), TOOL)
    C = both.matrices(task.path.axes)
    np.testing.assert_allclose(C[0], thick.matrices(task.path.axes[:1])[0])
    np.testing.assert_allclose(C[4], thin.matrices(task.path.axes[4:5])[0])
    np.testing.assert_array_equal(C[5], 0.0)
    assert (both.compliance, both.relative_sd) == (thin.compliance, 0.3)


def test_other_points_than_those_of_the_tools_are_refused(task: Task) -> None:
    refuses("K004", "tools along a path: got '8 points'; allowed: 3", each().along, task.at(slice(0, 3)))
    refuses("K004", "none for any tool", ForceOfEach((None, None, None), ("a", "b", "c"), TOOL).along, task)


def test_the_cell_names_the_milling_files_of_its_tools() -> None:
    cell, motions = read_cell(EXAMPLE / "cell.toml"), read_toolpath(EXAMPLE / "bracket.cls")
    cut = cut_of_tools(cell, motions)
    assert cut is not None
    assert isinstance(cut.force, ForceOfEach)
    assert [force is None for force in cut.force.forces] == [False, False, True]
    given = read_given_path(EXAMPLE / "bracket.cls")
    placed = given.acting(cut.force)
    task = Task(given.path, np.eye(4), np.eye(4))
    force = placed.along(task).force
    assert np.isfinite(force).all()
    size = np.linalg.norm(force, axis=1)
    flat, ball = (given.motions.tool[given.moves] == i for i in (0, 1))  # type: ignore[union-attr]
    # A slot of 4 mm against a cut of 0.5 mm by 2 mm at a fifth of the feed per tooth.
    assert size[flat].min() > 10 * size[ball].max()


def test_a_milling_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    text = (EXAMPLE / "cell.toml").read_text(encoding="utf-8").replace("mill_20.toml", "gone.toml")
    (tmp_path / "cell.toml").write_text(text, encoding="utf-8")
    refuses("K003", r"milling file of tool 1 not found: got 'gone.toml'", read_cell, tmp_path / "cell.toml")
