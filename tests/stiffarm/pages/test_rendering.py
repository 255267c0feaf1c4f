import base64

import numpy as np
import pytest
from matplotlib.colors import LogNorm
from matplotlib.image import imread

from robots import InputError, forward_kinematics, load_description, load_robot, tool_position
from stiffarm.commands.maps.figures.space import cloud_figure
from stiffarm.commands.maps.looks import look_of
from stiffarm.pages import rendering
from stiffarm.pages.rendering import gl_available
from stiffarm.pages.report import Picture
from stiffarm.pages.robot_drawing import draw_robot
from stiffarm.pages.style import STIFFNESS_COLOURS, colour_scale, new_figure, save_png
from surrogate.maps.data import Axis, Field, Layout, MapData
from surrogate.maps.quantities import STIFFNESS_ARRAY

POSES_DEG = {
    "xr701": (20, 5, 95, 0, -20, 0),
    "kr60-3": (0, -70, 60, 0, 60, 0),
    "tx200": (0, 20, 80, 0, 30, 0),
}


def drawn(name):
    robot = load_robot(name)
    pose = np.radians(POSES_DEG[name])
    return robot, forward_kinematics(robot, pose[None]), draw_robot(load_description(name), robot, pose)


def cloud(points, q, stiffness):
    """A map of such points, as of a joint sweep."""
    layout = Layout("joints", (Axis("q2_deg", "deg", np.arange(len(points), dtype=float)),))
    field = Field(stiffness, "N/mm", "stiffness along the load")
    names = load_robot("xr701").coordinates
    return MapData(layout, points, q, np.ones(len(points), dtype=bool), names, {STIFFNESS_ARRAY: field})


@pytest.fixture(scope="module")
def scene():
    """A coarse fake map of the xr701: stiffness falls with reach."""
    robot, _, _ = drawn("xr701")
    axes = np.radians([[0, 0], [-35, 45], [40, 115], [-90, 90], [-80, 80], [0, 0]])
    grids = [np.linspace(*a, 6 if np.ptp(a) else 1) for a in axes]
    q = np.stack([g.ravel() for g in np.meshgrid(*grids, indexing="ij")], axis=1)
    q = q[robot.reachable(q)]
    points = tool_position(robot, forward_kinematics(robot, q))
    return cloud(points, q, 1e3 / (0.2 + points[:, 0] ** 2))


def draw(data, path, view="oblique", works=False):
    robot, _, _ = drawn("xr701")
    look = look_of(STIFFNESS_ARRAY, data.fields[STIFFNESS_ARRAY])
    save_png(cloud_figure(data, look, load_description("xr701"), robot, "A map", "made up", works, view), path)
    return path


@pytest.mark.parametrize("name", list(POSES_DEG))
def test_joints_flange_and_base_lie_in_the_drawn_robot(name):
    robot, frames, bodies = drawn(name)
    by_name = {body.name: body for body in bodies}
    for joint, origin in zip(robot.joint_names, frames.p[0, 1:], strict=True):
        low, high = by_name[joint].mesh.bounds
        assert (low <= 1e3 * origin).all()
        assert (1e3 * origin <= high).all()
    low, high = by_name["mounting plate"].mesh.bounds
    # The plate ends 2 mm past the flange's face.
    assert (low - 2.1 <= 1e3 * frames.p_flange[0]).all()
    assert (1e3 * frames.p_flange[0] <= high + 2.1).all()
    assert min(body.mesh.bounds[0, 2] for body in bodies) == pytest.approx(0.0, abs=1e-9)  # round-off


@pytest.mark.parametrize("name", list(POSES_DEG))
def test_bodies_are_closed_and_every_link_is_drawn(name):
    _, _, bodies = drawn(name)
    assert all(body.mesh.is_watertight and body.mesh.volume > 0 for body in bodies)
    links = {link.name for link in load_description(name).link}
    assert links == {body.name.rstrip(" 12") for body in bodies if body.role in ("base", "link")}


def test_bar_and_crank_make_a_parallelogram():
    robot, frames, bodies = drawn("xr701")
    by_name = {body.name: body.mesh for body in bodies}
    pin = frames.R[0, 3] @ robot.parallelogram.pin
    lever_pin, crank_pin = 1e3 * (frames.p[0, 3] + pin), 1e3 * (frames.p[0, 2] + pin)
    # The meshes are symmetric about the pins; round-off only.
    np.testing.assert_allclose(by_name["lever pin"].bounds.mean(axis=0), lever_pin, atol=1e-6)
    np.testing.assert_allclose(by_name["crank pin"].bounds.mean(axis=0), crank_pin, atol=1e-6)
    np.testing.assert_allclose(by_name["bar"].center_mass, 0.5 * (lever_pin + crank_pin), atol=1e-6)
    # Bar and upper arm are opposite sides, equally long; the bar's round is a polygon of 32 sides.
    length = 1e3 * np.linalg.norm(frames.p[0, 3] - frames.p[0, 2])
    radius = 1e3 * load_description("xr701").parallelogram.bar.diameter.si / 2.0
    area = 32 / 2 * np.sin(2 * np.pi / 32) * radius**2
    assert by_name["bar"].volume == pytest.approx(length * area, rel=1e-9)  # round-off


def test_a_pose_of_wrong_shape_is_refused():
    with pytest.raises(InputError, match=r"\(6,\)"):
        draw_robot(load_description("xr701"), load_robot("xr701"), np.zeros(5))


@pytest.fixture(scope="module", autouse=True)
def _fine_pictures():
    """As users get them: with few pixels outlines are a larger share of a picture."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rendering, "FINENESS", 2.0)
        yield


@pytest.fixture(scope="module")
def fallback(scene, tmp_path_factory):
    """Both views without OpenGL, drawn once."""
    folder = tmp_path_factory.mktemp("fallback")
    return {view: draw(scene, folder / f"{view}.png", view) for view in ("oblique", "side")}


@pytest.mark.slow
@pytest.mark.parametrize("view", ["oblique", "side"])
def test_fallback_picture_shows_robot_and_points(view, fallback):
    check_picture(fallback[view])


@pytest.mark.slow
def test_pyvista_and_fallback_agree(scene, fallback, tmp_path):
    works, message = gl_available()
    if not works:
        pytest.skip(message)
    check_picture(draw(scene, tmp_path / "gl.png", works=True))
    a, b = imread(tmp_path / "gl.png")[..., :3], imread(fallback["oblique"])[..., :3]
    # Same camera, same lights: outlines differ by a pixel here and there, nothing else. A picture
    # shifted by 1 % of its width differs by more than 0.1 in over 4 % of the pixels.
    assert (np.abs(a - b).max(axis=2) > 0.1).mean() < 0.01
    assert (np.abs(np.roll(a, 16, axis=1) - b).max(axis=2) > 0.1).mean() > 0.04


def check_picture(path):
    image = imread(path)[..., :3]
    assert image.shape[:2] == (1200, 1600)
    border = np.concatenate([image[:6].reshape(-1, 3), image[-6:].reshape(-1, 3)])
    assert (border == 1.0).all()  # white, and no text is cut off at the edge
    assert (image[:, :6] == 1.0).all()
    assert (image[:, -6:] == 1.0).all()
    plot = image[150:1100, 60:1330]
    saturation = plot.max(axis=2) - plot.min(axis=2)
    # Points are coloured, the robot is grey of middle lightness, the rest white.
    assert (saturation > 0.3).mean() > 0.02
    grey = (saturation < 0.06) & (plot.mean(axis=2) > 0.25) & (plot.mean(axis=2) < 0.84)
    assert grey.mean() > 0.02
    assert (plot.min(axis=2) > 0.99).mean() > 0.3


@pytest.mark.slow
def test_a_map_on_the_near_side_only_is_still_shown(scene, tmp_path):
    near = scene.points[:, 1] < -1e-3
    only = cloud(scene.points[near], scene.q[near], np.asarray(scene.fields[STIFFNESS_ARRAY].values)[near])
    check_picture(draw(only, tmp_path / "near.png", "side"))


def test_no_gl_variable_answers_without_a_trial(monkeypatch):
    monkeypatch.setattr(rendering, "_probe_gl", lambda: pytest.fail("the trial was run"))
    monkeypatch.setenv("STIFFARM_NO_GL", "1")
    works, message = gl_available()
    assert not works
    assert "STIFFARM_NO_GL" in message


def test_a_crash_of_the_trial_names_the_package(monkeypatch):
    monkeypatch.delenv("STIFFARM_NO_GL", raising=False)
    monkeypatch.setattr(rendering, "_PROBE", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    rendering._probe_gl.cache_clear()
    try:
        works, message = gl_available()
    finally:
        rendering._probe_gl.cache_clear()
    assert not works
    assert "libosmesa6" in message
    assert "-11" in message


@pytest.mark.slow
def test_bad_requests_are_refused(scene, tmp_path, monkeypatch):
    monkeypatch.setenv("STIFFARM_NO_GL", "1")
    with pytest.raises(InputError, match="oblique, side"):
        draw(scene, tmp_path / "x.png", view="top")
    with pytest.raises(InputError, match="existing folder"):
        draw(scene, tmp_path / "nowhere" / "x.png")
    with pytest.raises(InputError, match="renderer"):
        rendering.chosen("pyvista")


def test_colour_range_is_robust_and_rounded_outward():
    values = np.concatenate([np.linspace(310.0, 690.0, 990), [5000.0] * 10])
    ticks = colour_scale(values, None)[1]
    low, high = np.percentile(values, [2, 98])
    assert ticks[0] <= low < ticks[1]
    assert ticks[-2] < high <= ticks[-1] < 720.0  # the 1 % at 5000 does not stretch it
    np.testing.assert_array_equal(colour_scale(values, (200.0, 800.0))[1][[0, -1]], [200.0, 800.0])
    constant = colour_scale(np.full(5, 400.0), None)[1]
    assert constant[0] < 400.0 < constant[-1]


def test_colours_rise_in_lightness_for_every_eye_and_are_warm_when_stiff():
    rgb = STIFFNESS_COLOURS(np.linspace(0, 1, 64))[:, :3]
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    luminance = np.array([0.2126, 0.7152, 0.0722])
    # Machado, Oliveira and Fernandes 2009, severity 1: what a deuteranope and a protanope see.
    deuteranopia = np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    )
    protanopia = np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    )
    for eye in (np.eye(3), deuteranopia, protanopia):
        assert (np.diff(linear @ eye.T @ luminance) > 0.0).all()
    assert rgb[0, 2] > rgb[0, 0]  # soft: more blue than red
    assert rgb[-1, 0] > rgb[-1, 2]  # stiff: more red than blue


def test_figures_are_written_whole_and_embed(tmp_path):
    figure, axes = new_figure("wide", rows=1, cols=2)
    assert len(axes) == 2
    axes[0].plot([0, 1], [0, 1])
    save_png(figure, tmp_path / "a.png")
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]
    assert imread(tmp_path / "a.png").shape[:2] == (660, 1500)
    assert base64.b64decode(Picture(tmp_path / "a.png", "", "").data) == (tmp_path / "a.png").read_bytes()
    with pytest.raises(InputError, match="single, wide"):
        new_figure("huge")


def test_skewed_maps_get_a_logarithmic_scale_with_the_given_ends() -> None:
    norm, ticks = colour_scale(np.geomspace(290.0, 7400.0, 500), None)
    assert isinstance(norm, LogNorm)
    assert (np.diff(ticks) > 0.0).all()
    assert ticks[0] <= np.percentile(np.geomspace(290.0, 7400.0, 500), 2.0)
    assert colour_scale(np.array([1.0, 2.0]), (100.0, 900.0))[1][[0, -1]].tolist() == [100.0, 900.0]
    assert not isinstance(colour_scale(np.linspace(300.0, 900.0, 50), None)[0], LogNorm)
