"""Plunging and drilling: the force of the end teeth, or none; never a reason to stop."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from refusals import refuses

from machining import Task, tool_path
from machining.cutting import ConstantForce, MillingForce, read_milling
from machining.cutting.plunging import Thrust, with_thrust
from machining.programs.compensation import milling_force
from machining.toolpaths import read_given_path
from robots import InputError, InputErrors

MILLING = """schema = "stiffarm-milling/1"
[mill]
diameter_mm = 16
teeth = 3
[cut]
kind = "down"
axial_depth_mm = 5
radial_depth_mm = 4
spindle_rpm = 6000
[material]
published = "al7075-t6"
"""
PLUNGE = '[plunge]\nchip_N_per_mm2 = 900\nedge_N_per_mm = 20\nsource = "made up"\n'


def force(tmp_path: Path, more: str = PLUNGE) -> MillingForce:
    (tmp_path / "milling.toml").write_text(MILLING + more, encoding="utf-8")
    found = read_milling(tmp_path / "milling.toml").force
    assert isinstance(found, MillingForce)
    return found


def down_and_along() -> Task:
    """A plunge at 0.01 m/s, then a cut at 0.03 m/s."""
    points = np.array([[0.0, 0.0, 0.01], [0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.04, 0.0, 0.0]])
    feed = np.array([np.nan, 0.01, 0.03, 0.03])
    return Task(tool_path(points, [0.0, 0.0, 1.0], feed=feed), np.eye(4), np.eye(4))


def test_the_force_of_a_plunge_is_that_of_the_end_teeth(tmp_path: Path) -> None:
    """By hand: c = 10 mm/s / (100 /s x 3) = 1/30 mm; 3 teeth x 8 mm x (900 / 30 + 20) N/mm = 1200 N, up the tool."""
    task, cutting = down_and_along(), np.array([False, True, True, True])
    found = milling_force(force(tmp_path), task, cutting)
    np.testing.assert_allclose(found.force[1], [0.0, 0.0, 1200.0], rtol=1e-12)
    without = milling_force(force(tmp_path, ""), task, cutting)
    np.testing.assert_array_equal(without.force[1], 0.0)
    # The cut beside it is the same, and so is its uncertainty.
    np.testing.assert_allclose(found.force[2:], without.force[2:], rtol=1e-12)
    assert found.names[-2:] == ("K_pc", "K_pe")
    np.testing.assert_allclose(found.covariance[:6, :6], without.covariance)
    np.testing.assert_allclose(np.diag(found.covariance)[6:], [(90.0e6) ** 2, (2.0e3) ** 2])


def test_a_constant_force_does_not_act_where_nothing_is_milled() -> None:
    found = milling_force(ConstantForce([10.0, 0.0, 0.0], "process"), down_and_along(), np.array([0, 1, 1, 1]) > 0)
    np.testing.assert_allclose(found.force[:, 0], [0.0, 0.0, 10.0, 10.0])


def test_a_program_that_only_drills(tmp_path: Path) -> None:
    task, down = down_and_along(), np.array([False, True, False, False])
    found = milling_force(force(tmp_path), task, down)
    np.testing.assert_allclose(found.force[:, 2], [0.0, 1200.0, 0.0, 0.0])
    refuses("K004", "no move mills sideways", milling_force, force(tmp_path, ""), task, down)
    assert with_thrust(None, force(tmp_path, ""), task, down) is None


def test_a_path_of_holes_takes_the_force_of_the_end_teeth_or_says_what_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "hole.nc"
    path.write_text("G21 G90\nG0 X0 Y0 Z10\nG1 Z-5 F600\nG0 Z10\nM30\n", encoding="utf-8")
    given = read_given_path(path)
    task = Task(given.path, np.eye(4), np.eye(4))
    refuses("K007", r"\[plunge\]", given.acting, force(tmp_path, ""))
    acting = given.acting(force(tmp_path))
    assert isinstance(acting, Thrust)
    np.testing.assert_allclose(acting.along(task).force[1], [0.0, 0.0, 1200.0])
    np.testing.assert_allclose(given.acting(ConstantForce([0.0, 0.0, 5.0])).along(task).force[:, 2], 5.0)


def test_a_cut_with_plunges_in_a_file_has_a_force_everywhere(tmp_path: Path) -> None:
    path = tmp_path / "part.nc"
    path.write_text(
        "G21 G90\nG0 X0 Y0 Z10\nG1 Z0 F600\nG1 X20\nG1 Z10\nG0 X0 Y5\nG1 Z0\nG1 X20\nG1 Y9\nG0 Z10\nM30\n",
        encoding="utf-8",
    )
    given = read_given_path(path)
    task = Task(given.path, np.eye(4), np.eye(4))
    found = given.acting(ConstantForce([10.0, 0.0, 0.0], "process")).along(task).force
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 10.0)
    np.testing.assert_allclose(found[:, 0], [10.0, 10.0, 10.0, 10.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    "bad",
    [
        PLUNGE.replace("900", "0"),
        PLUNGE.replace("20", "-1"),
        PLUNGE.replace('source = "made up"\n', ""),
        PLUNGE + "thrust = 3\n",
        PLUNGE + "relative_sd = -1\n",
    ],
)
def test_tables_of_plunges_that_are_not_right(tmp_path: Path, bad: str) -> None:
    with pytest.raises((InputError, InputErrors), match="plunge"):
        force(tmp_path, bad)
