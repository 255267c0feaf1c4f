"""Where the estimator comes to rest: 1e-6 of a standard deviation from the end, whatever rounding does on the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from doe import bundled_data, read_measurements, select_loads
from doe.certainty.uncertainty import certainty
from doe.estimation import estimate as estimator
from doe.estimation.campaign import campaign_of
from doe.estimation.estimate import Estimate, estimate
from doe.estimation.problem import Problem, problem
from fem import ArmModel, build_model
from robots import load_description
from tests.doe.plain_problems import linear

GAUGE = (1e-5, 1e-5)  # m, rad


def _moved(a: Estimate, b: Estimate) -> float:
    """How far two ends are apart, in standard deviations, in the worst direction there is."""
    return float(np.linalg.norm(a.whitened @ (a.u - b.u)))


def _campaign(seed: int) -> Problem:
    """Twelve set-ups of five readings: white noise, set-ups that scatter, outliers."""
    rng = np.random.default_rng(seed)
    pose = np.repeat(np.arange(12), 5)
    A = np.repeat(rng.uniform(0.2, 3.0, (12, 3)), 5, axis=0) * rng.uniform(0.3, 1.0, (60, 1))
    f = A @ np.array([1.0, 0.5, 0.8])
    value = f * (1.0 + 0.03 * rng.normal(size=12)[pose]) + 0.02 * rng.normal(size=60)
    value[rng.integers(60, size=2)] += 0.3
    return linear(A, value, pose)


@pytest.mark.parametrize("seed", range(12))
def test_the_end_is_nearer_than_1e_6_standard_deviations(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    p = _campaign(seed)
    found = estimate(p, (1e-3, 1e-3))
    assert found.settled
    monkeypatch.setattr(estimator, "SETTLED", 1e-10)
    assert _moved(found, estimate(p, (1e-3, 1e-3))) < 1e-6


@pytest.fixture(scope="module")
def serial() -> ArmModel:
    return build_model(load_description("xr701"), "beam", "serial")


@pytest.mark.slow
@pytest.mark.parametrize(
    "names",
    [
        ("j2.stiffness", "j3.stiffness", "j4.stiffness", "j5.stiffness"),
        # No reading moves with joint 6: its column is rounding, and that was once taken for a direction of its own.
        pytest.param(("j2.stiffness", "j3.zero", "j6.stiffness", "tool.tz"), marks=pytest.mark.slow),
        ("j1.stiffness", "j2.zero", "j3.stiffness", "j6.stiffness"),
        pytest.param(
            ("j2.stiffness", "j2.zero", "j3.ry", "j3.stiffness", "j3.zero", "j6.stiffness"), marks=pytest.mark.slow
        ),
    ],
)
def test_a_joint_a_whole_turn_farther_is_the_same_pose(serial: ArmModel, names: tuple[str, ...]) -> None:
    """Springs moved by up to 28 % before: rounding chose where the noise went."""
    data = select_loads(read_measurements(bundled_data("xr701"), serial.robot), (375.0, 650.0))
    turned = data.q.copy()
    turned[:, 3] += np.where(turned[:, 3] < 0.0, 2.0 * np.pi, 0.0)
    parameters, _ = campaign_of("xr701", names).free(serial)
    one, other = (estimate(problem(serial, replace(data, q=q), parameters), GAUGE) for q in (data.q, turned))
    assert _moved(one, other) < 1e-6
    if len(names) > 4:
        return  # intervals of so many take half a minute; the others hold them
    for a, b in zip(certainty(one).estimates, certainty(other).estimates, strict=True):
        assert a.status == b.status
        if a.status in ("determined", "one-sided"):
            # Ends of intervals are found to 1e-3 of their quantile, each on the same way.
            np.testing.assert_allclose([b.value, *b.interval], [a.value, *a.interval], rtol=1e-6)


@pytest.mark.slow
def test_a_parameter_that_no_reading_moves_with_changes_nothing(serial: ArmModel) -> None:
    data = select_loads(read_measurements(bundled_data("xr701"), serial.robot), (375.0, 650.0))
    known = ("j2.stiffness", "j3.zero", "tool.tz")
    found = []
    for names in (known, (*known, "j6.stiffness")):
        parameters, _ = campaign_of("xr701", names).free(serial)
        found.append(estimate(problem(serial, data, parameters), GAUGE))
    np.testing.assert_allclose(found[1].u[:3], found[0].u, rtol=1e-9)
    np.testing.assert_allclose(found[1].noise.white, found[0].noise.white, rtol=1e-6)
