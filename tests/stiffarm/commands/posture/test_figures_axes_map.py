"""Pictures of axes maps and of distributions hold what they should: legends, axes, breaks, hatches."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from machining import Objective
from machining.posture.axes_map import AxesMap, Zone
from machining.stiffness.distribution import Distribution, best_gamma, trade_off
from machining.stiffness.objective import shown
from robots import InputError
from robots.arrays import Array
from stiffarm.commands.maps.index.figures import (
    angle_ticks,
    draw_gamma_statistics,
    draw_index_maps,
    draw_trade_off,
    price_words,
)
from stiffarm.commands.maps.planes import layer_of
from stiffarm.commands.posture.figures.axes_map import TONES, CourseLine, _turns, draw_axes_map
from surrogate.maps.layouts import plane_or_box


def an_axes_map(low: float = -180.0, high: float = 170.0, n: int = 12) -> AxesMap:
    """Zones in blocks; the near-singular one has values in half of its cells."""
    gamma = np.radians(np.arange(low, high + 1.0, 10.0))
    m = len(gamma)
    value = 1e5 * (2.0 + np.sin(gamma)[None] + 0.1 * np.arange(n)[:, None])
    zone = np.zeros((n, m), dtype=np.int8)
    for k, code in enumerate((Zone.UNREACHABLE, Zone.LIMITS, Zone.COLLISION, Zone.SINGULAR)):
        zone[2 * k : 2 * k + 2, 3:8] = code
    bare = (zone != Zone.OPEN) & ((zone != Zone.SINGULAR) | (np.arange(m) > 5))
    value[bare] = np.nan
    branch = np.where(bare, -1, 0)
    return AxesMap(Objective(), 0.05 * np.arange(n) ** 1.2, gamma, zone, value, branch, ("only",), True)


def a_course(gamma_deg: Array, **look: Any) -> CourseLine:
    return CourseLine(np.radians(gamma_deg), np.full(len(gamma_deg), 2e5), "#000000", **look)


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def pixels(figure: Figure) -> NDArray[np.uint8]:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3]


def test_an_axes_map_has_its_axes_and_names_its_zones_and_courses() -> None:
    made = an_axes_map()
    courses = {
        "recommended": a_course(np.linspace(100.0, 150.0, 12)),
        "fixed": a_course(np.full(12, 40.0), dash="--"),
    }
    figure = draw_axes_map(made, courses, title="a path")
    top, bottom = figure.axes[:2]
    assert top.get_xlim() == (0.0, pytest.approx(1e3 * made.length[-1]))
    assert top.get_ylim() == (pytest.approx(-180.0), pytest.approx(180.0))
    assert (top.get_ylabel(), bottom.get_xlabel(), bottom.get_ylabel()) == (
        "gamma (deg)",
        "path length (mm)",
        "k_fs (N/mm)",
    )
    zones = [zone.words for zone in (Zone.UNREACHABLE, Zone.LIMITS, Zone.COLLISION, Zone.SINGULAR)]
    assert legend(figure) == ["recommended", "fixed", *zones]
    # The lower panel shows the courses in N/mm.
    assert [line.get_label() for line in bottom.lines] == ["recommended", "fixed"]
    np.testing.assert_allclose(bottom.lines[0].get_ydata(), 200.0)
    pixels(figure)


def test_zones_that_are_not_there_are_not_in_the_legend() -> None:
    made = an_axes_map()
    made = replace(made, zone=np.where(made.zone == Zone.COLLISION, np.int8(Zone.LIMITS), made.zone))
    assert Zone.COLLISION.words not in legend(draw_axes_map(made, title="a path"))
    everywhere = replace(made, zone=np.zeros_like(made.zone), value=np.full_like(made.value, 3e5))
    assert draw_axes_map(everywhere, title="a path").legends == []
    nowhere = replace(made, zone=np.full_like(made.zone, Zone.UNREACHABLE), value=np.full_like(made.value, np.nan))
    figure = draw_axes_map(nowhere, title="a path")
    assert legend(figure) == [Zone.UNREACHABLE.words]
    pixels(figure)


def test_each_zone_is_drawn_in_its_tone_where_it_is() -> None:
    made = an_axes_map()
    figure = draw_axes_map(made, title="a path")
    image = pixels(figure)
    ax = figure.axes[0]
    for k, zone in enumerate((Zone.UNREACHABLE, Zone.LIMITS, Zone.COLLISION)):
        # A whole cell: its face is there among the strokes of its hatch.
        corners = ax.transData.transform(
            [[1e3 * made.length[2 * k] + 1.0, -125.0], [1e3 * made.length[2 * k + 1], -115.0]]
        )
        (x0, y0), (x1, y1) = corners.round().astype(int)
        cell = image[image.shape[0] - y1 : image.shape[0] - y0, x0:x1].reshape(-1, 3)
        face = tuple(int(TONES[zone].face[i : i + 2], 16) for i in (1, 3, 5))
        assert (np.abs(cell.astype(int) - face).max(axis=1) <= 1).mean() > 0.1, zone


def test_a_range_of_gamma_is_shown_as_it_is() -> None:
    assert draw_axes_map(an_axes_map(-40.0, 90.0), title="a path").axes[0].get_ylim() == (
        pytest.approx(-40.0),
        pytest.approx(90.0),
    )
    # From 0 to 350 in 10 deg: a full turn that begins at 0.
    assert draw_axes_map(an_axes_map(0.0, 350.0), title="a path").axes[0].get_ylim() == (
        pytest.approx(0.0),
        pytest.approx(360.0),
    )


def test_a_course_that_wraps_leaves_at_one_end_and_comes_back_at_the_other() -> None:
    shown_twice = _turns(np.array([160.0, 170.0, -160.0, 175.0]), -180.0, 180.0)
    np.testing.assert_allclose(shown_twice, [[-200, -190, -160, -185], [160, 170, 200, 175]])


@pytest.mark.parametrize("gamma", [[-180.0, -180.0], [180.0, 180.0], [10.0, 185.0 - 360.0]])
def test_a_course_at_the_ends_is_drawn_at_both(gamma: list[float]) -> None:
    drawn = np.array(_turns(np.array(gamma), -180.0, 180.0))
    # From 10 to -175 the short way is up, through 180.
    expected = [[-350.0, -175.0], [10.0, 185.0]] if gamma[0] == 10.0 else [[-180.0, -180.0], [180.0, 180.0]]
    np.testing.assert_allclose(drawn, expected)


def test_on_a_part_of_a_turn_nothing_wraps() -> None:
    np.testing.assert_allclose(_turns(np.array([-100.0, 100.0]), -120.0, 120.0), [[-100.0, 100.0]])


def a_distribution(n: int, gamma_deg: Array, quantity: str = "k_fs") -> Distribution:
    u = np.linspace(0.0, 1.0, n)[:, None]
    value = 1e5 * (2.0 + u + np.cos(np.radians(gamma_deg) - 3.0 * u))
    value[(u > 0.8) & (gamma_deg > 0.0)] = np.nan
    return Distribution(Objective(quantity, np.ones(3)), np.radians(gamma_deg), value)


@pytest.mark.slow
def test_maps_name_their_gamma_and_their_plane(tmp_path: Path) -> None:
    plane = layer_of(plane_or_box(np.linspace(0.0, 1000.0, 6), 200.0, np.linspace(500.0, 1000.0, 4)), 0)
    found = a_distribution(24, np.array([-90.0, 0.0, 90.0]))
    inside = np.zeros(24, dtype=bool)
    inside[:6] = True
    figure = draw_index_maps(plane, found, [0, 2], title="k_fs of an arm", inside=inside)
    panels = figure.axes[:4]
    assert [ax.get_title() for ax in panels] == [
        "gamma = −90 deg",
        "gamma = 90 deg",
        "best of each point, to 3 %",
        "its gamma",
    ]
    assert figure.get_suptitle() == "k_fs of an arm, y = 200 mm"
    assert panels[0].get_ylabel() == "z (mm)"
    assert panels[2].get_xlabel() == "x (mm)"
    assert panels[0].get_xlim() == (pytest.approx(-100.0), pytest.approx(1100.0))
    assert legend(figure) == ["no posture within reach and limits", "workpiece"]
    pixels(figure)


def test_the_layer_of_a_box_is_named_and_drawn() -> None:
    grid = plane_or_box(np.linspace(0.0, 1000.0, 3), np.linspace(0.0, 1000.0, 2), np.linspace(0.0, 1000.0, 5))
    # The layers, along z, are the slowest axis.
    found = Distribution(Objective(), np.zeros(1), np.repeat(np.arange(1.0, 6.0), 6)[:, None] * 1e3)
    for layer, z, k in ((2, 500, 3.0), (4, 1000, 5.0)):
        figure = draw_index_maps(layer_of(grid, layer), found, [0], title="k_fs")
        assert figure.get_suptitle() == f"k_fs, z = {z} mm"
        (mesh,) = figure.axes[0].collections
        np.testing.assert_allclose(np.ravel(mesh.get_array()), k)


def test_maps_of_other_points_or_of_nothing_are_refused() -> None:
    plane = layer_of(plane_or_box([0.0, 1000.0], [0.0, 1000.0], 0.0), 0)
    found = a_distribution(4, np.array([0.0, 90.0]))
    with pytest.raises(InputError, match="one a point"):
        draw_index_maps(plane, a_distribution(3, np.array([0.0])), [0], title="k_fs")
    with pytest.raises(InputError, match="at most"):
        draw_index_maps(plane, found, [0] * 11, title="k_fs")
    nothing = Distribution(Objective(), np.zeros(1), np.full((4, 1), np.nan))
    with pytest.raises(InputError, match="no value at any point"):
        draw_index_maps(plane, nothing, [0], title="k_fs")


def test_the_curves_show_both_sets_of_points_and_the_choice() -> None:
    found = a_distribution(24, np.arange(-180.0, 180.0, 30.0))
    figure = draw_gamma_statistics(found, title="k_fs", choice=best_gamma(found))
    mean = figure.axes[0]
    np.testing.assert_allclose(mean.lines[0].get_ydata(), 1e-3 * found.statistics().mean)
    np.testing.assert_allclose(mean.lines[1].get_ydata(), 1e-3 * found.statistics("common").mean)
    assert [ax.get_title() for ax in figure.axes] == [
        "mean",
        "standard deviation",
        "peak to valley",
        "share of the points reached",
    ]
    assert legend(figure)[:2] == ["points that this gamma reaches", "points that all reach"]
    assert legend(figure)[2].startswith("best for the mean: ")


@pytest.mark.slow
def test_the_price_of_the_choice_stands_in_the_legend() -> None:
    value = np.array([[225.0, 300.0], [225.0, 300.0], [225.0, np.nan], [225.0, np.nan]]) * 1e3
    found = Distribution(Objective(), np.radians([0.0, 90.0]), value)
    choice = best_gamma(found)
    traded = trade_off(found)
    words = price_words(traded, choice, shown("k_fs"))
    assert "225 N/mm, reaches 4 of 4" in words
    assert "300 N/mm (+33 %) but misses 2 points" in words
    drawn = (
        draw_gamma_statistics(found, title="k", choice=choice),
        draw_trade_off(traded, choice, shown("k_fs"), title="k"),
    )
    for figure in drawn:
        assert any(words in text for text in legend(figure))
        figure.canvas.draw()
    front = drawn[1].axes[0].lines[1]
    assert front.get_xdata().tolist() == [4, 2]
    np.testing.assert_allclose(front.get_ydata(), [225.0, 300.0])


@pytest.mark.parametrize(
    ("quantity", "factor", "label", "column"),
    [
        ("k_fs", 1e-3, "k_fs (N/mm)", "k_fs_N_per_mm"),
        ("isotropy", 1.0, "isotropy", "isotropy"),
        ("normal displacement", 1e6, "normal displacement (um)", "normal_displacement_um"),
    ],
)
def test_units_of_quantities(quantity: str, factor: float, label: str, column: str) -> None:
    unit = shown(quantity)
    assert (unit.factor, unit.axis, unit.column) == (factor, label, column)


def test_a_quantity_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match="quantity"):
        shown("kfs")


def test_ticks_of_angles_are_parts_of_a_turn() -> None:
    assert angle_ticks(np.array([-180.0, 180.0])).tolist() == [-180, -135, -90, -45, 0, 45, 90, 135, 180]
    assert angle_ticks(np.array([-7.0, 8.0])).tolist() == [-6, -4, -2, 0, 2, 4, 6, 8]
