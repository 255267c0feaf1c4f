"""docs/kr60_indices.md against a recomputation: the readings of Table 4 through inverse kinematics, and point P."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from kr60_claims import at_point, on_path
from kr60_readings import A0, IN_LINE, READINGS, TABLE_4, B, Reading, S, arm, index, path, postures

import fem

PAGE = Path(__file__).resolve().parents[2] / "docs" / "kr60_indices.md"


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


def test_the_best_posture_is_never_below_a_fixed_gamma(model: fem.ArmModel) -> None:
    result = on_path(model, B)
    assert result.optimum.mean() > np.nanmax(result.means)
    assert (result.optimum >= result.k - 1e-9).all()
