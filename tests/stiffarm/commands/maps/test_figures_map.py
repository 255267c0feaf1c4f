"""Figures of maps from synthetic fields whose contours, extremes and surfaces are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.colors import LogNorm
from matplotlib.image import imread

from fem.arm import Arm
from robots import InputError, forward_kinematics, load_description, load_robot, tool_position
from robots.arrays import Array
from stiffarm.commands.maps.figures.effects import swept_effects
from stiffarm.commands.maps.figures.robot import inside, robot_outlines
from stiffarm.commands.maps.figures.slices import contour_levels, extremes, posed, seams, slice_figure, unlike
from stiffarm.commands.maps.figures.space import cut_plane, iso_levels, iso_surfaces
from stiffarm.commands.maps.figures.whole import drawings, one_figure
from stiffarm.commands.maps.looks import COLOURS, kind_of, look_of
from stiffarm.commands.maps.planes import planes_of
from stiffarm.pages.robot_drawing import draw_robot
from stiffarm.pages.style import save_png
from surrogate.maps.data import Axis, Field, Layout, LayoutKind, MapData

ROBOT, DESCRIPTION = load_robot("kr60-3"), load_description("kr60-3")
ARM = Arm.of(DESCRIPTION, "rigid")
POSE = np.radians([0.0, -70.0, 60.0, 0.0, 60.0, 0.0])
PARTS = ("j2", "j3", "forearm")


def axis(name: str, low: float, high: float, n: int, unit: str = "mm") -> Axis:
    return Axis(name, unit, np.linspace(low, high, n))


def points_of(layout: Layout, fixed: dict[str, float]) -> Array:
    grids = np.meshgrid(*[a.values for a in layout.axes], indexing="ij")
    given = {a.name: g.ravel() for a, g in zip(layout.axes, grids, strict=True)}
    if layout.kind == "cylinder":
        phi = np.radians(given["phi"])
        given |= {"x": given["r"] * np.cos(phi), "y": given["r"] * np.sin(phi)}
    return np.stack([given.get(n, np.full(layout.n, fixed.get(n, 0.0))) for n in "xyz"], axis=1) * 1e-3


def make(kind: LayoutKind, axes: tuple[Axis, ...], **fixed: float) -> MapData:
    """A map whose stiffness falls with the distance from (1, 0, 0.8) m, within 0.9 m of it."""
    third = [name for name in "xyz" if name not in {one.name for one in axes}] if kind == "slice" else []
    layout = Layout(kind, axes, held={name: fixed.get(name, 0.0) for name in third})
    points = points_of(layout, fixed)
    distance = np.linalg.norm(points - [1.0, 0.0, 0.8], axis=1)
    reached = distance <= 0.9
    stiffness = np.where(reached, 3000.0 * np.exp(-2.0 * distance), np.nan)
    softest = np.where(reached, (points[:, 2] > 0.8).astype(float), -1.0)
    fields = {
        "stiffness_N_per_mm": Field(stiffness, "N/mm", "stiffness along the load"),
        "softest_part": Field(softest, "", "part that deflects most", PARTS),
        "uncertainty_percent": Field(np.where(reached, distance, np.nan), "percent", "standard uncertainty"),
    }
    q = np.where(reached[:, None], POSE, np.nan)
    return MapData(layout, points, q, reached, ROBOT.coordinates, fields, metadata={"load": "a load $ straight down"})


def a_slice() -> MapData:
    return make("slice", (axis("z", 0.0, 2000.0, 21), axis("x", 0.0, 2000.0, 26)), y=0.0)


def a_box() -> MapData:
    return make("box", (axis("z", 0.0, 1600.0, 17), axis("y", -800.0, 800.0, 17), axis("x", 200.0, 1800.0, 17)))


def swept() -> MapData:
    axes = (axis("q4_deg", -60, 60, 3, "deg"), axis("q2_deg", -100, -50, 5, "deg"), axis("q3_deg", 40, 90, 4, "deg"))
    layout = Layout("joints", axes)
    q = np.tile(POSE, (layout.n, 1))
    for a, grid in zip(axes, np.meshgrid(*[a.values for a in axes], indexing="ij"), strict=True):
        q[:, ROBOT.coordinate_index(a.name)] = np.radians(grid.ravel())
    points = tool_position(ROBOT, forward_kinematics(ROBOT, q))
    values = np.arange(layout.n, dtype=np.float64) + 300.0
    reached = np.arange(layout.n) != 7
    return MapData(
        layout,
        points,
        np.where(reached[:, None], q, np.nan),
        reached,
        ROBOT.coordinates,
        {"stiffness_N_per_mm": Field(np.where(reached, values, np.nan), "N/mm", "stiffness along the load")},
    )


@pytest.mark.parametrize("data", [a_slice(), a_box()], ids=["slice", "box"])
def test_points_lie_at_the_centres_of_their_cells(data: MapData) -> None:
    planes = planes_of(data)
    assert planes
    for plane in planes:
        flat = 1e3 * plane.flat(data.points[plane.rows])
        np.testing.assert_allclose(flat[..., 0], plane.centres[0], atol=1e-9)  # round-off of m and mm
        np.testing.assert_allclose(flat[..., 1], plane.centres[1], atol=1e-9)
        middle = 0.25 * sum(plane.corners[0][i : i + len(flat), j : j + flat.shape[1]] for i in (0, 1) for j in (0, 1))
        np.testing.assert_allclose(middle, plane.centres[0], atol=1e-9)
        # Right, up and towards the eye are right-handed, and the number in words is the plane's.
        normal = np.cross(plane.right, plane.up)
        assert "xyz"[int(np.abs(normal).argmax())] == plane.where[0]


def test_planes_of_slices_and_cylinders() -> None:
    (plane,) = planes_of(make("slice", (axis("y", -500, 500, 5), axis("x", 500, 1500, 6)), z=800.0))
    assert plane.where == "z = 800 mm"
    assert plane.labels == ("x (mm)", "y (mm)")
    turn = axis("phi", -90, 90, 7, "deg")
    around = make("cylinder", (axis("z", 0, 1600, 9), turn, axis("r", 0, 1800, 10)))
    planes = planes_of(around)
    assert 1 < len(planes) <= 4
    for plane in planes:
        np.testing.assert_allclose(1e3 * plane.flat(around.points[plane.rows])[..., 0], plane.centres[0], atol=1e-9)
        assert plane.labels == ("r (mm)", "z (mm)")
    full = axis("phi", -180, 150, 12, "deg")
    (flat,) = planes_of(make("cylinder", (axis("z", 800, 800, 1), full, axis("r", 100, 1800, 10))))
    assert flat.closed
    np.testing.assert_allclose(flat.corners[0][0], flat.corners[0][-1], atol=1e-9)  # all the way round
    assert planes_of(swept()) == []


def test_equal_planes_are_drawn_once() -> None:
    turn, r = axis("phi", -90, 90, 7, "deg"), axis("r", 0, 1800, 10)
    data = make("cylinder", (axis("z", 0, 1600, 9), turn, r))
    look = look_of("stiffness_N_per_mm", data.fields["stiffness_N_per_mm"])
    assert len(unlike(data, look, planes_of(data))) == len(planes_of(data))
    radius = np.hypot(data.points[:, 0], data.points[:, 1])
    field = Field(1e3 + radius, "N/mm", "stiffness")
    same = MapData(data.layout, data.points, data.q, np.ones(data.layout.n, bool), data.coordinates, {"k": field})
    (one,) = unlike(same, look_of("k", field), planes_of(same))
    assert "the same by symmetry" in one.where


def test_a_slice_shows_the_values_and_leaves_unreached_cells_blank() -> None:
    data = a_slice()
    look = look_of("stiffness_N_per_mm", data.fields["stiffness_N_per_mm"])
    planes = planes_of(data)
    figure = slice_figure(data, look, planes, DESCRIPTION, ROBOT, "title", "facts $x_{")
    (mesh,) = [c for c in figure.axes[0].collections if isinstance(c, QuadMesh)]
    drawn = np.ma.filled(mesh.get_array(), np.nan).reshape(data.layout.shape)
    np.testing.assert_array_equal(drawn, data.fields["stiffness_N_per_mm"].values.reshape(data.layout.shape))
    assert mesh.get_rasterized()
    stiffest, softest = extremes(data, look, planes[0])
    values = data.fields["stiffness_N_per_mm"].values
    assert (values[stiffest], values[softest]) == (np.nanmax(values), np.nanmin(values))
    assert posed(data, look, planes[0]) == stiffest
    marks = [line.get_xydata()[0] for line in figure.axes[0].lines if line.get_marker() in "*v"]
    np.testing.assert_allclose(marks[0], 1e3 * data.points[stiffest][[0, 2]])
    words = " ".join(text.get_text() for legend in figure.legends for text in legend.get_texts())
    assert "stiffest: " in words
    assert " N/mm at (" in words
    assert "robot, at the stiffest point" in words


def test_a_map_without_poses_has_no_robot_and_an_empty_one_is_refused() -> None:
    data = a_slice()
    bare = MapData(data.layout, data.points, np.full_like(data.q, np.nan), data.reached, data.coordinates, data.fields)
    look = look_of("stiffness_N_per_mm", data.fields["stiffness_N_per_mm"])
    assert posed(bare, look, planes_of(bare)[0]) is None
    figure = slice_figure(bare, look, planes_of(bare), DESCRIPTION, ROBOT, "title", "")
    assert "robot" not in " ".join(t.get_text() for t in figure.legends[0].get_texts())
    none = MapData(data.layout, data.points, data.q, np.zeros_like(data.reached), data.coordinates, data.fields)
    with pytest.raises(InputError, match="no point reached"):
        slice_figure(none, look, planes_of(none), DESCRIPTION, ROBOT, "title", "")


def test_contour_lines_stop_at_jumps() -> None:
    look = look_of("k", Field(np.geomspace(100.0, 1000.0, 100), "N/mm", "stiffness"))
    ramp = np.tile(np.geomspace(100.0, 1000.0, 40), (30, 1))
    assert not seams(look, ramp).any()
    # A coarse grid of the same: every step is a tenth of the scale, none of them a jump.
    assert not seams(look, ramp[:, ::4]).any()
    torn = ramp.copy()
    torn[:, 20:] = torn[:, 20:][:, ::-1]
    found = seams(look, torn)
    assert found[:, [19, 20]].all()
    assert not found[:, :19].any()
    assert not found[:, 21:].any()
    levels = contour_levels(look, ramp, 6)
    assert ((levels > 100.0) & (levels < 1000.0)).all()
    assert 3 <= len(levels) <= 9
    assert not seams(look, np.full((4, 4), np.nan)).any()


def test_outlines_are_the_robots_shadow() -> None:
    right, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    polygons = robot_outlines(DESCRIPTION, ROBOT, POSE, right, up)
    bounds = np.stack([body.mesh.bounds for body in draw_robot(DESCRIPTION, ROBOT, POSE)])
    every = np.vstack(polygons)
    np.testing.assert_allclose(every.min(axis=0), bounds[:, 0, [0, 2]].min(axis=0), atol=1e-9)  # round-off
    np.testing.assert_allclose(every.max(axis=0), bounds[:, 1, [0, 2]].max(axis=0), atol=1e-9)
    flange = 1e3 * forward_kinematics(ROBOT, POSE[None]).p_flange[0, [0, 2]]
    assert any(inside(flange[None], polygon)[0] for polygon in polygons)
    # All bodies are convex, as their shadows are taken to be.
    assert all(body.mesh.is_convex for body in draw_robot(DESCRIPTION, ROBOT, POSE))
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    np.testing.assert_array_equal(inside(np.array([[1.0, 1.0], [2.0, 1.0], [3.0, 1.0]]), square), [True, False, False])


def test_kinds_of_quantities() -> None:
    def field(unit: str, *categories: str) -> Field:
        return Field(np.zeros(1), unit, "isotropy, worst over best stiffness", categories)

    assert kind_of("stiffness_N_per_mm", field("N/mm")) == "stiff"
    assert kind_of("compliance_um_per_N", field("um/N")) == "soft"
    assert kind_of("isotropy", field("")) == "other"
    assert kind_of("uncertainty_percent", field("percent")) == "error"
    assert kind_of("stiffness_error_N_per_mm", field("N/mm")) == "error"
    assert kind_of("softest_part", field("", "a")) == "category"


def test_looks_of_scales_and_categories() -> None:
    wide = look_of("k", Field(np.append(np.geomspace(100.0, 2000.0, 300), np.nan), "N/mm", "stiffness"))
    assert isinstance(wide.norm, LogNorm)
    assert wide.axis_label == "stiffness (N/mm), log scale"
    assert [wide.text(v) for v in (12344.0, 0.012344, -3.0)] == ["12340 N/mm", "0.01234 N/mm", "−3 N/mm"]
    flat = look_of("k", Field(np.full(9, 5.0), "N/mm", "stiffness"))
    assert flat.ticks[0] < 5.0 < flat.ticks[-1]
    assert look_of("e", Field(np.linspace(1.0, 2.0, 50), "percent", "error")).axis_label == "error (%)"
    with pytest.raises(InputError, match="no value"):
        look_of("k", Field(np.full(3, np.nan), "N/mm", "stiffness"))
    names = tuple(f"part {i}" for i in range(12))
    numbers = np.repeat(np.arange(12.0), np.arange(12, 0, -1))
    look = look_of("softest", Field(np.append(numbers, -1.0), "", "softest", names))
    assert [n for n, *_ in look.names] == [0, 1, 2, 3, 4, 5, 6]  # the most frequent
    assert look.rest == (7, 8, 9, 10, 11)
    assert len({tuple(row) for row in look.rgb(np.arange(12.0))}) == 8
    with pytest.raises(InputError, match="no value"):
        look_of("softest", Field(np.full(3, -1.0), "", "softest", names))


@pytest.mark.parametrize("kind", ["stiff", "error", "other"])
def test_colours_keep_their_order_for_every_eye(kind: str) -> None:
    rgb = COLOURS[kind](np.linspace(0.0, 1.0, 33))[:, :3]
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    # Machado, Oliveira and Fernandes 2009, severity 1: protanopia, deuteranopia, tritanopia.
    eyes = [
        np.eye(3),
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    ]
    for eye in eyes:
        luminance = np.clip(linear @ np.array(eye).T, 0.0, 1.0) @ [0.2126, 0.7152, 0.0722]
        lightness = 116.0 * np.cbrt(np.maximum(luminance, 0.01)) - 16.0
        steps = np.diff(lightness) * (-1.0 if kind == "error" else 1.0)
        assert (steps > 0.2).all()  # CIE L*, 32 steps of 1.5 to 2.5 on average
        assert abs(lightness[-1] - lightness[0]) > 50.0


def test_iso_surfaces_lie_at_their_level() -> None:
    data = a_box()
    look = look_of("stiffness_N_per_mm", data.fields["stiffness_N_per_mm"])
    radius = 500.0
    ((vertices, triangles),) = iso_surfaces(data, look, np.array([3000.0 * np.exp(-2e-3 * radius)]), None)
    away = np.linalg.norm(vertices - [1000.0, 0.0, 800.0], axis=1)
    # The field is bent between grid points 100 mm apart: h^2 / 8 (2 per m + 1 / r) = 5 mm.
    np.testing.assert_allclose(away, radius, atol=6.0)
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert area == pytest.approx(4.0 * np.pi * radius**2, rel=0.03)  # a polyhedron inside, levels as above
    ((half, _),) = iso_surfaces(data, look, np.array([3000.0 * np.exp(-2e-3 * radius)]), 0.0)
    assert half[:, 1].min() == pytest.approx(0.0, abs=1e-6)
    assert half[:, 1].max() > 0.98 * radius
    # Beyond the reach there is none.
    ((none, no_triangles),) = iso_surfaces(data, look, np.array([1.0]), None)
    assert len(none) == len(no_triangles) == 0


def test_no_surface_stands_where_the_quantity_jumps() -> None:
    data = a_box()
    x = data.points[:, 0]
    torn = Field(np.where(x < 1.0, 100.0, 1000.0) * (1.0 + 0.05 * data.points[:, 2]), "N/mm", "stiffness")
    ramp = Field(300.0 * (1.0 + x), "N/mm", "stiffness")
    whole = MapData(
        data.layout, data.points, data.q, np.ones(data.layout.n, bool), data.coordinates, {"torn": torn, "ramp": ramp}
    )
    ((points, _),) = iso_surfaces(whole, look_of("torn", torn), np.array([400.0]), None)
    assert len(points) == 0
    ((points, _),) = iso_surfaces(whole, look_of("ramp", ramp), np.array([600.0]), None)
    np.testing.assert_allclose(points[:, 0], 1000.0, atol=1e-3)  # VTK keeps points in single precision


def test_a_full_turn_is_closed() -> None:
    data = make("cylinder", (axis("z", 0, 400, 3), axis("phi", 0, 345, 24, "deg"), axis("r", 200, 800, 7)))
    field = Field(np.hypot(data.points[:, 0], data.points[:, 1]), "N/mm", "stiffness")
    around = MapData(data.layout, data.points, data.q, np.ones(data.layout.n, bool), data.coordinates, {"k": field})
    ((vertices, triangles),) = iso_surfaces(around, look_of("k", field), np.array([0.55]), None)
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    # A prism of 24 sides.
    assert area == pytest.approx(24 * 2.0 * 550.0 * np.sin(np.pi / 24) * 400.0, rel=1e-4)


def test_levels_and_cuts() -> None:
    look = look_of("k", Field(np.geomspace(100.0, 1000.0, 1000), "N/mm", "stiffness"))
    levels = iso_levels(look, np.geomspace(100.0, 1000.0, 1000))
    np.testing.assert_array_equal(levels, [180.0, 400.0, 790.0])
    assert len(iso_levels(look, np.full(5, 7.0))) == 0
    y = np.linspace(-1.0, 1.0, 9)
    assert cut_plane(np.stack([y, y, y], axis=1)) == 0.0
    assert cut_plane(np.stack([y, y + 5.0, y], axis=1)) == pytest.approx(5000.0)


def test_main_effects_are_percentiles_of_the_reached_poses() -> None:
    data = swept()
    effects = swept_effects(data, "stiffness_N_per_mm")
    assert list(effects) == ["q4_deg", "q2_deg", "q3_deg"]
    values = data.fields["stiffness_N_per_mm"].values.reshape(data.layout.shape)
    for k, name in enumerate(effects):
        rows = np.moveaxis(values, k, 0).reshape(data.layout.shape[k], -1)
        np.testing.assert_allclose(effects[name].median, np.nanmedian(rows, axis=1))
        np.testing.assert_allclose(effects[name].high, np.nanpercentile(rows, 95.0, axis=1))
    assert effects["q2_deg"].poses.tolist() == [12, 11, 12, 12, 12]
    with pytest.raises(InputError, match="joints"):
        swept_effects(a_slice(), "stiffness_N_per_mm")


@pytest.mark.slow
def test_files_of_boxes_and_sweeps_without_opengl(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STIFFARM_NO_GL", "1")
    for kind, data in (("box", a_box()), ("joints", swept())):
        found = {drawing.name: drawing for drawing in drawings(data, ARM)}
        stem = "map_stiffness_N_per_mm" if kind == "box" else "stiffness_map"
        stiffness = {name.removeprefix(stem) for name in found if name.startswith(stem)}
        assert stiffness == ({"", "_surfaces"} if kind == "box" else {"_oblique", "_side", "_effects"})
        for name, drawing in found.items():
            save_png(drawing.draw(), tmp_path / f"{name}.png")
            image = imread(tmp_path / f"{name}.png")[..., :3]
            assert (image.min(axis=2) < 0.95).mean() > 0.02
            for edge in (image[:2], image[-2:], image[:, :2], image[:, -2:]):
                assert (edge == 1.0).all(), name  # nothing is cut off


def test_bad_requests() -> None:
    data = a_slice()
    with pytest.raises(InputError, match="stiffness_N_per_mm"):
        one_figure(data, "speed", ARM)
    empty = MapData(data.layout, data.points, data.q, np.zeros_like(data.reached), data.coordinates, data.fields)
    with pytest.raises(InputError, match="no pose at any"):
        drawings(empty, ARM)
