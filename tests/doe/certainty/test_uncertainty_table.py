"""Model files with calibrated springs say how sure these are, or that they cannot."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from doe import Campaign, Measurements, bundled_campaign, bundled_data, read_measurements, select_loads
from doe.calibration.run import Calibration, run_campaign
from doe.calibration.written import NO_COVARIANCE, with_origin
from doe.certainty.identifiability import SMALL, _combination
from doe.certainty.propagation import parameter_uncertainty, propagate
from doe.estimation.campaign import campaign_of
from fem import build_model
from fem.free.parameters import parameter
from robots import ModelDescription, load_description, load_robot, save_description


@pytest.fixture(scope="module")
def nine() -> Measurements:
    """The nine readings of the XR701 at 650 N."""
    return select_loads(read_measurements(bundled_data("xr701"), load_robot("xr701")), (650.0,))


def _calibrated(given: ModelDescription, data: Measurements, campaign: Campaign) -> Calibration:
    return run_campaign(given, lambda d: build_model(d, "rigid"), data, campaign)


def _springs(*joints: str) -> Campaign:
    return campaign_of("xr701", tuple(f"{joint}.stiffness" for joint in joints))


def test_the_staged_scheme_has_none_and_says_so(nine: Measurements) -> None:
    scheme = bundled_campaign("xr701")
    assert scheme is not None
    written = with_origin(_calibrated(load_description("xr701"), nine, scheme), nine, (650.0,), ("a remark",))
    assert written.calibration is not None
    assert written.calibration.scheme == "staged"
    assert written.calibration.notes == ("a remark", NO_COVARIANCE)
    assert written.calibration.uncertainty is None
    assert parameter_uncertainty(written) is None


def test_springs_at_a_bound_stand_beside_the_covariance(nine: Measurements, tmp_path: Path) -> None:
    # The nine readings of the XR701 hold joint 5 rigid: the published data, as `stiffarm run` fits them.
    data = nine
    found = _calibrated(load_description("xr701"), data, _springs("j2", "j3", "j4", "j5"))
    save_description(with_origin(found, data, (650.0,)), tmp_path / "model.toml")
    written = load_description(str(tmp_path / "model.toml"))
    u = parameter_uncertainty(written)
    assert u is not None
    assert u.names == ("j2.stiffness", "j3.stiffness", "j4.stiffness")
    assert [(one.name, one.status) for one in u.undetermined] == [("j5.stiffness", "at bound")]
    estimates = found.stages[0].certainty.estimates
    j5 = estimates[3]
    assert u.undetermined[0].low == pytest.approx(j5.interval[0], rel=1e-9)
    answer = propagate(build_model(written, "rigid"), u, data.q)
    assert answer.matters == ("j5.stiffness",)
    assert answer.is_lower_bound.any()
    # White noise alone leaves readings less parameters, by Satterthwaite's formula: rounding.
    assert u.degrees_of_freedom == pytest.approx(5.0, rel=1e-9)
    # Joint 4 is told by one side only: its interval is open to rigid, its variance is not.
    assert u.status[2] == "one-sided"
    assert math.isinf(estimates[2].interval[1])


def test_as_many_springs_as_readings_leave_no_covariance(nine: Measurements) -> None:
    data = nine.select(np.arange(nine.n) < 2)
    found = _calibrated(load_description("xr701"), data, _springs("j2", "j3"))
    origin = with_origin(found, data, (650.0,)).calibration
    assert origin is not None
    assert origin.uncertainty is None
    assert "as many springs as readings" in origin.notes[-1]


# ------------------------------------------------------------
# Combinations of parameters that trade off: which term leads


def test_a_term_that_hardly_varies_leads_no_combination_however_large_its_weight() -> None:
    model = build_model(load_description("kr60-3"))
    springs = [parameter(model, f"{joint}.stiffness") for joint in ("j2", "j3", "j4")]
    # The first is known to a thousandth of what the others are: its part in the combination's spread is nothing.
    covariance = np.diag([1e-12, 1.0, 1.0])
    found = _combination(springs, np.array([5.0, 1.0, -0.5]), np.ones(3), covariance, SMALL)
    assert found.names == ("j3.stiffness", "j4.stiffness")
    assert found.value == 0.5
