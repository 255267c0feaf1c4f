"""Model files with calibrated springs say how sure these are, or that they cannot."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from doe import (
    Measurements,
    bundled_data,
    constant_fit,
    read_measurements,
    select_loads,
    with_constant_springs,
    with_spring_laws,
)
from doe.certainty.propagation import parameter_uncertainty, propagate
from doe.model_file.uncertainty_table import NO_COVARIANCE
from fem import build_model
from robots import load_description, load_robot, save_description


@pytest.fixture(scope="module")
def nine() -> Measurements:
    """The nine readings of the XR701 at 650 N."""
    return select_loads(read_measurements(bundled_data("xr701"), load_robot("xr701")), (650.0,))


def test_numbers_calibrated_before_and_held_now_are_named(nine: Measurements) -> None:
    given = load_description("xr701")
    model = build_model(given, "rigid")
    fit, _ = constant_fit(model, nine, ("j2", "j3", "j4"), (1e5, 1e6), 1e-5)
    once = with_constant_springs(given, model, fit, nine, (650.0,))
    again, _ = constant_fit(build_model(once, "rigid"), nine, ("j4",), (1e5, 1e6), 1e-5)
    u = parameter_uncertainty(with_constant_springs(once, model, again, nine, (650.0,)))
    assert u is not None
    assert u.names == ("j4.stiffness",)
    assert u.note.endswith("of an earlier calibration and now held: j2.stiffness, j3.stiffness")


def test_the_staged_scheme_has_none_and_says_so(nine: Measurements) -> None:
    given = load_description("xr701")
    written = with_spring_laws(given, build_model(given, "rigid"), {}, nine, (650.0,), 0.05, ("a remark",))
    assert written.calibration is not None
    assert written.calibration.notes == ("a remark", NO_COVARIANCE)
    assert written.calibration.uncertainty is None
    assert parameter_uncertainty(written) is None


def test_springs_at_a_bound_stand_beside_the_covariance(nine: Measurements, tmp_path: Path) -> None:
    # The nine readings of the XR701 hold joint 5 rigid: the published data, as `stiffarm run` fits them.
    given, data = load_description("xr701"), nine
    model = build_model(given, "rigid")
    fit, _ = constant_fit(model, data, ("j2", "j3", "j4", "j5"), (1e5, 1e6), 1e-5)
    save_description(with_constant_springs(given, model, fit, data, (650.0,)), tmp_path / "model.toml")
    written = load_description(str(tmp_path / "model.toml"))
    u = parameter_uncertainty(written)
    assert u is not None
    assert u.names == ("j2.stiffness", "j3.stiffness", "j4.stiffness")
    assert [(one.name, one.status) for one in u.undetermined] == [("j5.stiffness", "at bound")]
    j5 = fit.springs[3]
    assert u.undetermined[0].low == pytest.approx(j5.interval[0], rel=1e-9)
    answer = propagate(build_model(written, "rigid"), u, data.q)
    assert answer.matters == ("j5.stiffness",)
    assert answer.is_lower_bound.any()
    assert (u.degrees_of_freedom == 5.0).all()
    # Joint 4 is told by one side only: its interval is open to rigid, its variance is not.
    assert u.status[2] == "one-sided"
    assert math.isinf(fit.springs[2].interval[1])


def test_as_many_springs_as_readings_leave_no_covariance(nine: Measurements) -> None:
    given, data = load_description("xr701"), nine.select(np.arange(nine.n) < 2)
    model = build_model(given, "rigid")
    fit, _ = constant_fit(model, data, ("j2", "j3"), (1e5, 1e6), 1e-5)
    origin = with_constant_springs(given, model, fit, data, (650.0,)).calibration
    assert origin is not None
    assert origin.uncertainty is None
    assert "as many springs as readings" in origin.notes[-1]
