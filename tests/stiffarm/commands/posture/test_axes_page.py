"""The interactive axes map: zones named by cause, errors of every cell, a course that the arm follows in a browser."""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import needs_browser
from devtools import tab
from numpy.typing import NDArray

import fem
from machining.cell import Body, Cell, Fixture, Tool, arm_of, cylinder
from machining.cutting import ConstantForce, Cut, surface_error
from machining.posture.axes_map import Zone
from machining.posture.drive import Drive
from machining.posture.points import GammaRange
from machining.posture.posing import PostureRequest, pose_along
from machining.setup import Setup
from machining.stiffness.objective import Objective
from machining.task import Task, ToolPath, tool_path
from robots import forward_kinematics, load_description
from stiffarm.commands.posture.axes_page import AxesStudy, axes_data, axes_page, axes_study, cells_of, kept

ALONG_Y = np.array([0.0, 1.0, 0.0])
# Tip 200 mm to the side of the flange and 80 mm ahead, axis across the flange's.
SPINDLE = np.array([[0.0, 0.0, 1.0, 0.2], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.08], [0.0, 0.0, 0.0, 1.0]])
PART = np.array([[1.0, 0.0, 0.0, 1.2], [0.0, 1.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.6], [0.0, 0.0, 0.0, 1.0]])
FORCE = np.array([40.0, 80.0, -120.0])
HOSTILE = "<script>alert('x')</script> </title>"


def dome(n: int, length: float) -> ToolPath:
    """A curved path with normals that tilt along it."""
    u = np.linspace(0.0, 1.0, n)
    wave = 2.0 * np.pi * u
    points = np.stack([length * (u - 0.5), 0.15 * np.sin(wave), 0.08 * np.cos(wave)], axis=1)
    return tool_path(points, np.stack([0.35 * np.sin(wave), 0.25 * np.cos(0.5 * wave), np.ones(n)], axis=1))


@pytest.fixture(scope="module")
def study() -> AxesStudy:
    """A short curved path of the KR60 beside a post."""
    description = load_description("kr60-3")
    model = fem.build_model(description, links="rigid")
    T = np.eye(4)
    T[:3, 3] = 1.45, -0.18, 0.0
    post = Fixture(Body("post", (cylinder(0.03, 0.9).moved(T),)))
    setup = Setup(Cell(T_world_part0=PART, tool=Tool(SPINDLE), fixtures=(post,)), arm_of("kr60-3"))
    task = setup.task(dome(13, 0.5), ALONG_Y)
    cut = Cut(ConstantForce(FORCE, "base"), None)
    request = PostureRequest(task, Objective(), GammaRange(count=36), setup.drive(Drive()), cut=cut)
    made = axes_study(pose_along(model, request), setup)
    assert made is not None
    return made


def unpacked(text: str, kind: str) -> NDArray[Any]:
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def test_barred_cells_have_a_cause_with_a_name(study: AxesStudy) -> None:
    cells = cells_of(study)
    zone = cells.map.zone
    np.testing.assert_array_equal(cells.cause > 0, zone != Zone.OPEN)
    causes = np.array(cells.causes)[cells.cause]
    assert set(causes[zone == Zone.UNREACHABLE]) <= {"out of reach"}
    limits = set(causes[zone == Zone.LIMITS])
    assert limits
    assert all(re.fullmatch(r"limit of q[1-6]", cause) for cause in limits)
    # The joint that is named is beyond its limit.
    i, j = (axis[0] for axis in np.nonzero(zone == Zone.LIMITS))
    number = int(causes[i, j][-1]) - 1
    assert cells.map.q is not None
    angle, (low, high) = cells.map.q[i, j, number], study.model.robot.limits[number]
    assert angle < low or angle > high


def test_cells_reach_their_points(study: AxesStudy) -> None:
    made = cells_of(study).map
    assert made.q is not None
    open_ = np.nonzero(made.zone == Zone.OPEN)
    found = forward_kinematics(study.model.robot, made.q[open_])
    T_tool = study.task.T_flange_tool
    tip = found.p_flange + found.R_flange @ T_tool[:3, 3]
    np.testing.assert_allclose(tip, study.task.targets[open_[0]], atol=1e-7)


def test_the_error_of_a_cell_is_that_of_a_course_there(study: AxesStudy) -> None:
    cells = cells_of(study)
    assert cells.error is not None
    # A column of the map that is open all along.
    columns = np.flatnonzero((cells.map.zone == Zone.OPEN).all(axis=0))
    assert len(columns)
    for j in columns[[0, -1]]:
        q = cells.map.q[:, j]  # type: ignore[index]
        expected = surface_error(study.model, study.task, q, ConstantForce(FORCE, "base")).normal
        np.testing.assert_allclose(cells.error[:, j], expected, rtol=1e-6, atol=1e-9)


def test_the_page_needs_nothing_else(study: AxesStudy) -> None:
    page = axes_page(study, HOSTILE)
    assert "<script>alert" not in page
    assert "<title>&lt;script&gt;" in page
    assert not re.search(r"""(src|href)\s*=|url\(|import\s|fetch\(|XMLHttpRequest""", page)
    assert "default-src 'none'" in page
    assert len(page) < 1.5e6


def test_data_and_labels(study: AxesStudy) -> None:
    data = axes_data(study)
    n, m = data["n"], data["m"]
    assert data["closed"] is True
    assert unpacked(data["q"], "<f4").shape == (n * m * 6,)
    np.testing.assert_allclose(unpacked(data["course"]["error"], "<f4"), 1e6 * study.error, rtol=1e-6)  # type: ignore[operator]
    names = {cause["words"] for cause in data["causes"]}
    assert {one["words"] for one in data["labels"]} <= names
    pairs = [cause for cause in data["causes"] if cause["words"].endswith("too near")]
    assert all(len(cause["bodies"]) == 2 for cause in pairs)
    rows = kept(1000, np.array([333]))
    assert {0, 333, 999} <= set(rows.tolist())
    assert len(rows) <= 161


@pytest.mark.slow
@needs_browser
def test_the_arm_follows_the_course_in_the_browser(study: AxesStudy, tmp_path: Path) -> None:
    file = tmp_path / "axes.html"
    file.write_text(axes_page(study, "arm <b>"), encoding="utf-8")
    made = cells_of(study).map
    assert made.q is not None
    with tab() as page:
        page.show(file)
        api = "window.axesMap"
        worst = int(np.abs(study.error).argmax())  # type: ignore[arg-type]
        assert page.run(f"{api}.state.at") == worst
        at_start = page.run(f"{api}.frames({worst})")
        check_frames(study, at_start, worst, study.q[worst])
        # An angle of the map that is open: the arm stands in that cell's pose, and says what it is worth.
        j = int(np.flatnonzero(made.zone[4] == Zone.OPEN)[3])
        page.run(f"{api}.go(4), {api}.turnTo({np.degrees(study.angles[j])}), 0")
        check_frames(study, page.run(f"{api}.frames(4)"), 4, made.q[4, j])
        assert "barred" not in page.run("document.getElementById('said').textContent")
        # One that is barred: the reason is written.
        bad = np.argwhere(made.zone != Zone.OPEN)
        i, k = bad[len(bad) // 2]
        page.run(f"{api}.go({i}), {api}.turnTo({np.degrees(study.angles[k])}), 0")
        said = page.run("document.getElementById('said').textContent")
        assert "barred" in said
        assert page.run(f"{api}.barred({i})") in said
        assert page.run(f"{api}.summary()[4]") >= 1
        page.run(f"{api}.reset(), 0")
        assert page.run(f"{api}.summary()[4]") == 0
        drag_and_keys(page, api)
        assert page.own_faults() == []


def check_frames(study: AxesStudy, frames: list[list[float]], i: int, q: NDArray[np.float64]) -> None:
    """Frames of the page are those of the pose."""
    R, p = (x[0] for x in study.scenes[0].frames(q[None], study.e[i][None], np.array([study.table])))
    got = np.array(frames).reshape(-1, 4, 4).swapaxes(1, 2)
    np.testing.assert_allclose(got[:, :3, :3], R, atol=2e-6)
    np.testing.assert_allclose(got[:, :3, 3], p, atol=2e-6)


def drag_and_keys(page: Any, api: str) -> None:
    """With the mouse and with the keyboard, to the same effect."""
    box = page.run("(r => [r.left, r.top])(document.getElementById('map').getBoundingClientRect())")
    i = 6
    x, y = page.run(f"[{api}.across({api}.length[{i}]), {api}.up({api}.gamma[{i}])]")
    before = page.run(f"[...{api}.gamma]")
    for kind, dy in (("mousePressed", 0), ("mouseMoved", -6), ("mouseMoved", -30), ("mouseReleased", -30)):
        page.ask(
            "Input.dispatchMouseEvent",
            type=kind,
            x=box[0] + x,
            y=box[1] + y + dy,
            button="left",
            buttons=1,
            clickCount=1,
        )
    after = page.run(f"[...{api}.gamma]")
    moved = np.abs((np.array(after) - before + 180.0) % 360.0 - 180.0)
    assert page.run(f"{api}.state.at") == i
    assert moved.argmax() == i
    assert moved[i] > 5.0
    # Far along the path the course stays.
    assert moved[0] < 0.05 * moved[i]
    page.run("document.getElementById('map').focus(), 0")
    for key, place, turn in (("ArrowRight", 1, 0.0), ("ArrowUp", 1, 1.0), ("Home", 0, 0.0)):
        here = page.run(f"{api}.state.at")
        was = page.run(f"{api}.gamma[{here}]")
        page.ask("Input.dispatchKeyEvent", type="keyDown", key=key)
        page.ask("Input.dispatchKeyEvent", type="keyUp", key=key)
        if key == "ArrowRight":
            assert page.run(f"{api}.state.at") == here + place
        elif key == "ArrowUp":
            assert page.run(f"{api}.gamma[{here}]") == pytest.approx(was + turn, abs=1e-6)
        else:
            assert page.run(f"{api}.state.at") == 0


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize(("width", "scheme"), [(1400, "light"), (390, "dark")])
def test_everyone_can_use_it(study: AxesStudy, tmp_path: Path, width: int, scheme: Any) -> None:
    file = tmp_path / "axes.html"
    file.write_text(axes_page(study, "arm"), encoding="utf-8")
    with tab() as page:
        page.show(file, width, 900, scheme)
        assert page.run("document.documentElement.scrollWidth") == width
        assert page.grave() == []
        assert page.own_faults() == []


def test_one_gamma_has_no_map() -> None:
    description = load_description("kr60-3")
    model = fem.build_model(description, links="rigid")
    task = Task(dome(4, 0.2), SPINDLE, PART, ALONG_Y)
    request = PostureRequest(task, Objective(), GammaRange(0.4, 0.6, 2), Drive(jump=2.0))
    posed = pose_along(model, request)
    assert axes_study(posed, Setup(Cell())) is None
