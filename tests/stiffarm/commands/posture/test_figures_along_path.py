"""The figure of surface errors: what it draws, in which units, where its legend stands, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from machining.cutting import Comparison, SurfaceError
from machining.cutting.spread import Uncertain
from robots.arrays import Array
from stiffarm.commands.posture.figures.along_path import milling_error_figure
from stiffarm.pages.style import save_png

S = np.linspace(0.0, 0.15, 31)


def error(level_um: float, s: Array = S) -> SurfaceError:
    """A made-up error about a level, with a standard deviation of a tenth of it."""
    n = len(s)
    normal = level_um * 1e-6 * (1.0 + 0.2 * np.sin(40.0 * s))
    none, one = np.zeros((n, 3)), np.ones(1)
    about = Uncertain(one, 0.01 * np.eye(1), one, np.zeros((1, 1)), ("all", "F"), ("made up",))
    sd = 0.1 * np.abs(normal)
    return SurfaceError(
        s,
        np.full(n, 1.0 / n),
        none,
        none,
        none,
        normal,
        normal,
        sd,
        sd,
        0.0 * sd,
        normal[:, None, None],
        0.0 * sd,
        about,
        None,
    )


def comparison(before: SurfaceError, after: SurfaceError) -> Comparison:
    gap = before.normal - after.normal
    return Comparison(gap, 0.1 * np.abs(gap), {}, ("made up",))


def two() -> Figure:
    errors = {"before": error(70.0), "after": error(-30.0)}
    return milling_error_figure(errors, comparison(*errors.values()))


def test_curves_and_bands_are_in_the_units_of_the_axes() -> None:
    figure = two()
    top, bottom = figure.axes
    drawn = {line.get_color(): line for line in top.lines if line.get_linewidth() > 2.0}
    assert len(drawn) == 2
    for line, level in zip(drawn.values(), (70.0, -30.0), strict=True):
        np.testing.assert_allclose(line.get_xdata(), S * 1e3)
        np.testing.assert_allclose(line.get_ydata(), error(level).normal * 1e6)
    edges = [line.get_ydata() for line in top.lines if line.get_linewidth() < 1.0]
    np.testing.assert_allclose(edges[1], error(70.0).band[1] * 1e6)
    assert "µm" in top.get_ylabel()
    assert "mm" in bottom.get_xlabel()
    assert "before minus after" in bottom.get_title(loc="left")


def test_curves_are_told_apart_without_colour() -> None:
    styles = [line.get_linestyle() for line in two().axes[0].lines if line.get_linewidth() > 2.0]
    assert len(set(styles)) == 2


def test_zero_is_in_the_picture() -> None:
    for ax in (*two().axes, *milling_error_figure({"one": error(500.0)}).axes):
        low, high = ax.get_ylim()
        assert low <= 0.0 <= high


def test_the_legend_stands_off_the_data_and_nothing_is_cut_off(tmp_path: Path) -> None:
    figure = two()
    save_png(figure, tmp_path / "error.png")
    top = figure.axes[0]
    legend = top.get_legend()
    assert legend is not None
    assert not legend.get_window_extent().overlaps(top.get_window_extent().shrunk(1.0, 0.99))
    drawn, page = figure.get_tightbbox(), figure.get_size_inches()
    assert min(drawn.x0, drawn.y0) >= 0.0
    assert drawn.x1 <= page[0]
    assert drawn.y1 <= page[1]


def test_a_path_of_few_points_shows_them() -> None:
    few = milling_error_figure({"one": error(50.0, S[:5])})
    assert any(line.get_marker() == "o" for line in few.axes[0].lines)
