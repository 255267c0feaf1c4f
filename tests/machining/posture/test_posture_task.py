"""Task: frames of the tool for gamma, and the path's CSV with every bad row."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from posture_cases import dome, part, spindle
from refusals import refuses, refuses_each
from rigid_frames import rigid_frame

from machining.task import Task, tool_path
from machining.toolpaths.tables import read_path
from robots.arrays import Array

HEAD = "x_mm,y_mm,z_mm,nx,ny,nz"


def written(tmp_path: Path, *lines: str) -> Path:
    file = tmp_path / "path.csv"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


def test_tool_frames_put_the_tip_on_the_point_and_the_axis_into_the_holder(rotation: Array) -> None:
    T_base_part = rigid_frame((0.3, -0.2, 0.5), rotation)
    task = Task(dome(5), spindle(), T_base_part)
    T = task.tool_frames(np.radians([0.0, 30.0, 200.0]))
    assert T.shape == (5, 3, 4, 4)
    for k in range(3):
        np.testing.assert_allclose(T[:, k, :3, 3], task.path.points @ rotation.T + [0.3, -0.2, 0.5], atol=1e-15)
        np.testing.assert_allclose(T[:, k, :3, 2], -task.path.axes @ rotation.T, atol=1e-15)
    R = T[..., :3, :3].reshape(-1, 3, 3)
    np.testing.assert_allclose(np.swapaxes(R, 1, 2) @ R, np.broadcast_to(np.eye(3), R.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-14)


def test_gamma_is_right_handed_about_the_tool_axis_from_the_parts_x() -> None:
    task = Task(tool_path([[0.0, 0.0, 0.0]], [0.0, 0.0, 1.0]), np.eye(4), np.eye(4))
    T = task.tool_frames([0.0, np.pi / 2])[0]
    np.testing.assert_allclose(T[0, :3, 0], [1.0, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(T[1, :3, 0], [0.0, 1.0, 0.0], atol=1e-15)


def test_a_level_tool_along_x_takes_another_reference() -> None:
    task = Task(tool_path([[0.0, 0.0, 0.0]], [1.0, 0.0, 0.0]), np.eye(4), np.eye(4))
    np.testing.assert_array_equal(task.reference, [0.0, 1.0, 0.0])
    refuses(
        "P009",
        "reference direction of gamma at path point 0",
        Task,
        task.path,
        np.eye(4),
        np.eye(4),
        np.array([2.0, 0.0, 0.0]),
    )


def test_normals_are_made_unit_and_stand_in_for_axes() -> None:
    path = tool_path([[0.0, 0.0, 0.0], [0.03, 0.04, 0.0]], [0.0, 0.0, 5.0], feed=0.1)
    np.testing.assert_array_equal(path.axes, [[0.0, 0.0, 1.0]] * 2)
    np.testing.assert_allclose(path.times, [0.5], rtol=1e-15)


def test_repeated_points_are_all_named() -> None:
    refuses_each(
        "P009",
        r"point 1 repeats point 0[\s\S]*point 3 repeats point 2",
        tool_path,
        [[0, 0, 0], [0, 0, 0], [1, 0, 0], [1, 0, 0]],
        [0.0, 0.0, 1.0],
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"normals": [0.0, 0.0, 0.0]}, "surface normal of the path"),
        ({"axes": [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]}, "tool axis of the path, row 1"),
        ({"points": np.zeros((0, 3))}, "path points"),
        ({"points": [[0.0, np.nan, 0.0], [1.0, 0.0, 0.0]]}, "path points"),
        ({"feed": 0.0}, "feed"),
    ],
)
def test_bad_paths_are_refused(change: dict[str, object], message: str) -> None:
    good = {"points": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], "normals": [0.0, 0.0, 1.0]}
    refuses("B001 P009", message, tool_path, **{**good, **change})


def test_frames_that_are_not_rigid_are_refused() -> None:
    refuses("B001", "T_flange_tool", Task, dome(3), 2.0 * np.eye(4), part())
    refuses("B001", "T_base_part", Task, dome(3), spindle(), np.eye(3))


def test_csv_is_read_in_si(tmp_path: Path) -> None:
    head = f"{HEAD},tx,ty,tz,feed_mm_per_min"
    path = read_path(written(tmp_path, head, "1,2,3,0,0,2,0,1,1,", "", "11,2,3,0,0,1,0,0,1,6000"))
    np.testing.assert_allclose(path.points, [[1e-3, 2e-3, 3e-3], [11e-3, 2e-3, 3e-3]], rtol=1e-15)
    np.testing.assert_allclose(path.axes[0], [0.0, np.sqrt(0.5), np.sqrt(0.5)], rtol=1e-15)
    assert np.isnan(path.feed[0])
    np.testing.assert_allclose(path.times, [0.1], rtol=1e-12)


def test_every_bad_row_of_a_csv_is_reported(tmp_path: Path) -> None:
    file = written(
        tmp_path,
        f"{HEAD},feed_mm_per_min",
        "0,0,0,0,0,1,100",
        "0,0,0,0,0,1,100",  # row 3: repeated
        "1,0,zero,0,0,1,100",  # row 4: no number
        "2,0,0,0,0,0,100",  # row 5: normal of length zero
        "3,0,0,0,0,1,-5",  # row 6: feed
        "4,0,0,0,0,1",  # row 7: a cell is missing
        "5,0,inf,0,0,1,",  # row 8: not finite
        "6,0,0,0,0,1,",
    )
    caught = refuses_each("P008", "", read_path, file)
    text = [str(error) for error in caught.errors]
    assert sorted(int(t.split("row ")[1].split(",")[0].split(":")[0]) for t in text) == [3, 4, 5, 6, 7, 8]
    assert any("column z_mm" in t and "'zero'" in t for t in text)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["x_mm,y_mm,z_mm,nx,ny", "0,0,0,0,0"], "no column nz; allowed"),
        ([f"{HEAD},tx", "0,0,0,0,0,1,0"], "no column ty, tz; allowed"),
        ([f"{HEAD},speed", "0,0,0,0,0,1,0"], "column speed is not known: got 'speed'"),
        ([f"{HEAD},nx", "0,0,0,0,0,1,0"], "column nx stands there twice"),
        ([HEAD], "no points"),
    ],
)
def test_bad_headers_are_named(tmp_path: Path, lines: list[str], message: str) -> None:
    refuses("P002 P008", message, read_path, written(tmp_path, *lines))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    refuses("F001", "does not exist", read_path, tmp_path / "none.csv")


@pytest.mark.parametrize(("tilt_deg", "axis"), [(0.0, 0), (40.0, 0), (74.0, 0), (80.0, 1)])
def test_gamma_counts_from_x_unless_the_tool_comes_near_it(tilt_deg: float, axis: int) -> None:
    """More points that tilt less, or the other way, change nothing."""
    tilt = np.radians(np.linspace(0.0, tilt_deg, 5))
    axes = np.stack([np.sin(tilt), np.zeros(5), np.cos(tilt)], axis=1)
    axes = np.vstack([axes, [[0.0, 0.6, 0.8], [0.0, -0.6, 0.8]]])
    points = np.arange(7.0)[:, None] * np.array([0.1, 0.0, 0.0])
    for rows in (slice(None), slice(4, None), slice(4, 5)):
        task = Task(tool_path(points[rows], axes[rows]), spindle(), np.eye(4))
        np.testing.assert_array_equal(task.reference, np.eye(3)[axis])
