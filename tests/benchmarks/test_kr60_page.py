"""docs/validation/kr60_indices.md recomputed: the readings of Table 4 through inverse kinematics, and point P."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from kr60_figures import (
    A0,
    B2,
    B3,
    IN_LINE,
    PLANE_GAMMA_DEG,
    READINGS,
    TABLE_4,
    B,
    PlaneResult,
    Reading,
    S,
    arm,
    at_point,
    index,
    on_path,
    on_plane,
    path,
    postures,
)

import fem
from surrogate.maps.layouts import points_of

PAGE = Path(__file__).resolve().parents[2] / "docs" / "validation" / "kr60_indices.md"


@pytest.fixture(scope="module")
def model() -> fem.ArmModel:
    return arm()


def row(start: str) -> list[str]:
    """Cells of the first table row of the page that starts so."""
    line = next(x for x in PAGE.read_text(encoding="utf-8").splitlines() if x.startswith(f"| {start} |"))
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_the_page_shows_what_the_readings_give(model: fem.ArmModel) -> None:
    found = [index(model, r, path(TABLE_4[:, 0]), 0.0) for r in READINGS]
    for i, (x, k, error) in enumerate(TABLE_4):
        cells = row(f"{x:.0f}")
        assert float(cells[1]) == k
        assert float(cells[-2]) == error
        for cell, values in zip(cells[2:-2], found, strict=True):
            # Two decimals.
            assert (cell == "out of reach") if np.isnan(values[i]) else abs(float(cell) - values[i]) < 0.006


@pytest.mark.parametrize(("reading", "tolerance"), [(A0, 2e-4), (B, 3e-3)])
def test_table_4_is_met_and_by_the_rule_that_is_said(model: fem.ArmModel, reading: Reading, tolerance: float) -> None:
    """The figures of the fits themselves: two lengths for A0, five for B."""
    q, k = postures(model, reading, path(TABLE_4[:, 0]), np.zeros(len(TABLE_4)))
    np.testing.assert_allclose(k, TABLE_4[:, 1], rtol=tolerance)
    # A0 breaks the joint limits, B keeps them.
    assert model.robot.reachable(q).all() == (reading is B)
    assert model.robot.reachable(q).any() == (reading is B)


def test_point_p_has_its_extremes_where_the_page_says(model: fem.ArmModel) -> None:
    found = [at_point(model, r) for r in READINGS]
    best, foot = row("Fig. 4: largest k_fs at P at gamma")[2:], row("Fig. 4: the rise begins at gamma")[2:]
    assert [float(cell) for cell in best] == [curve.best_deg for curve in found]
    assert [float(cell) for cell in foot] == [curve.foot_deg for curve in found]
    # The paper's 8 and 59 deg; A0 was not fitted to them.
    assert (found[0].foot_deg, found[0].best_deg) == (7.0, 58.0)


def test_a_usual_spindle_never_gives_the_published_values(model: fem.ArmModel) -> None:
    points = path(TABLE_4[:, 0])
    highest = np.nanmax([index(model, S, points, g) for g in range(-180, 180, 10)])
    assert highest < 0.9 * TABLE_4[:, 1].min()


def test_a_spindle_in_line_makes_gamma_meaningless(model: fem.ArmModel) -> None:
    k = at_point(model, IN_LINE).k
    np.testing.assert_allclose(k, k[0], rtol=1e-10)


@pytest.mark.slow
def test_the_best_posture_is_never_below_a_fixed_gamma(model: fem.ArmModel) -> None:
    result = on_path(model, B)
    assert result.optimum.mean() > np.nanmax(result.means)
    assert (result.optimum >= result.k - 1e-9).all()


@pytest.fixture(scope="module")
def planes(model: fem.ArmModel) -> dict[str, PlaneResult]:
    return {r.name: on_plane(model, r) for r in READINGS}


@pytest.mark.slow
@pytest.mark.parametrize("reading", [B, B2, B3, S])
def test_the_distribution_is_the_rule_of_the_readings(
    model: fem.ArmModel, planes: dict[str, PlaneResult], reading: Reading
) -> None:
    """The same rule twice: the tool frame of `machining.Task`, and the readings' own flange frames."""
    plane = planes[reading.name]
    few = np.arange(0, plane.grid.n, 37)
    for j, g in enumerate(PLANE_GAMMA_DEG[::4]):
        k = index(model, reading, points_of(plane.grid)[few], g)
        found = 1e-3 * plane.found.value[few, 4 * j]
        np.testing.assert_array_equal(np.isnan(found), np.isnan(k))
        # Next to a singularity of the wrist the angles keep some ten digits.
        np.testing.assert_allclose(found, k, rtol=1e-6)


@pytest.mark.slow
def test_figs_10_and_11_are_what_the_page_says(planes: dict[str, PlaneResult]) -> None:
    def shown(start: str) -> list[str]:
        return row(start)[2:]

    def span(over: str, key: str) -> list[str]:
        figures = [p.statistics(over)[key] for p in planes.values()]  # type: ignore[arg-type]
        return [f"{v.min():.0f} to {v.max():.0f}" for v in figures]

    best = [
        " / ".join(f"{PLANE_GAMMA_DEG[p.statistics(over)['mean'].argmax()]:.0f}" for over in ("reached", "common"))  # type: ignore[arg-type]
        for p in planes.values()
    ]
    assert shown("Fig. 11: plane mean largest at gamma (where reached / where every gamma reaches)") == best
    assert shown("Fig. 11: mean, N/mm") == span("reached", "mean")
    assert shown("Fig. 11: standard deviation, N/mm") == span("reached", "std")
    assert shown("Fig. 11: peak to valley, N/mm") == span("reached", "pv")
    text = PAGE.read_text(encoding="utf-8")
    for over, key in (("reached", "std"), ("common", "std"), ("reached", "mean")):
        figures = [p.statistics(over)[key] for p in planes.values()]  # type: ignore[arg-type]
        assert ", ".join(f"{v.max() / v.min():.1f}" for v in figures) in text
    # What the page says in words: 60 deg for B2 and B3 over own points, for B alone over common ones.
    assert [n for n, b in zip(planes, best, strict=True) if b.startswith("60 /")] == ["B2", "B3"]
    assert [n for n, b in zip(planes, best, strict=True) if b.endswith("/ 60")] == ["B"]


@pytest.mark.slow
def test_the_standard_deviation_varies_more_than_the_mean(planes: dict[str, PlaneResult]) -> None:
    for plane in planes.values():
        s = plane.statistics()
        assert s["std"].max() / s["std"].min() > s["mean"].max() / s["mean"].min()


@pytest.mark.slow
def test_mean_and_peak_to_valley_go_together_but_not_with_a_spindle(planes: dict[str, PlaneResult]) -> None:
    opposite = (PLANE_GAMMA_DEG[:-1] >= 15.0) & (PLANE_GAMMA_DEG[1:] <= 45.0)
    together = {name: plane.together() for name, plane in planes.items()}
    assert all((t[~opposite].sum() >= 8) == (name != "S") for name, t in together.items())
    assert [name for name, t in together.items() if not t[opposite].any()] == ["B3"]
