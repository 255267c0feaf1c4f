"""Springs against joint angles: through the points, even, positive, calm between them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from refusals import refuses

from doe import Campaign, Measurements, SpringPoints, fit_law
from doe.calibration.run import run_campaign
from doe.published.pose_studies import total_degree_exponents
from fem import ArmModel
from fem.springs import spring_from
from robots import Robot, load_description
from robots.schema.description import LogPolynomialLaw

Arm = Callable[..., ArmModel]


def points(inputs: tuple[str, ...], angles_deg: object, stiffness: object) -> SpringPoints:
    k = np.array(stiffness, dtype=float)
    angles = np.radians(np.array(angles_deg, dtype=float)).reshape(len(k), len(inputs))
    return SpringPoints("j4", inputs, angles, k, ("calibrated",) * len(k))


def stiffness_at(robot: Robot, law: LogPolynomialLaw, inputs: tuple[str, ...], angles: np.ndarray) -> np.ndarray:
    q = np.zeros((len(angles), robot.dof))
    q[:, [robot.coordinate_index(name) for name in inputs]] = angles
    return 1.0 / spring_from(robot, law).compliance(q)


def all_angles(robot: Robot, inputs: tuple[str, ...], count: int = 41) -> np.ndarray:
    limits = robot.limits[[robot.coordinate_index(name) for name in inputs]]
    axes = np.meshgrid(*[np.linspace(a, b, count) for a, b in limits])
    return np.stack([axis.ravel() for axis in axes], axis=1)


ONE = ("q2_deg",)
TWO = ("q4_deg", "q2_deg")


@pytest.mark.parametrize(
    ("inputs", "angles_deg", "stiffness"),
    [
        (ONE, [-35, 5, 45], [5e5, 8e5, 6e5]),
        (ONE, [-35, -30, 5, 6, 45], [1e4, 1e6, 3e5, 3.1e5, 2e6]),
        (TWO, [(-200, -35), (-200, 5), (-200, 45), (200, -35), (200, 5), (200, 45)], [4e5, 2e5, 1e6] * 2),
        (TWO, [(0, -35), (0, 5), (200, 5), (10, 5)], [1e3, 1e6, 1e4, 1e6]),
    ],
)
def test_the_law_passes_through_its_points(
    xr701: Robot, inputs: tuple[str, ...], angles_deg: object, stiffness: object
) -> None:
    given = points(inputs, angles_deg, stiffness)
    law = fit_law(xr701, given, 6, "test")
    found = stiffness_at(xr701, law, inputs, given.angles)
    # Points 1 deg apart leave singular values of 1e-4 or so in the fit: round-off times 1e4, rounded up.
    np.testing.assert_allclose(found, given.stiffness, rtol=1e-10)


def test_what_the_points_leave_open_is_decided_by_the_least_roughness(xr701: Robot) -> None:
    k = np.array([2e5, 8e5, 3e5])
    law = fit_law(xr701, points(ONE, [-35, 15, 30], k), 6, "test")
    # By Lagrange: least sum of ((1 + d)^2 c_d)^2 over d = 1..6 under V c = ln k, the constant c_0 being free.
    u = (np.radians([-35.0, 15.0, 30.0]) - law_centre(law)) / law_half(law)
    V = u[:, None] ** np.arange(7)
    roughness = np.diag([0.0, *(1.0 + np.arange(1, 7)) ** 4])
    system = np.block([[roughness, V.T], [V, np.zeros((3, 3))]])
    exact = np.linalg.solve(system, [*np.zeros(7), *np.log(k)])[:7]
    # The constant's weight is 1e-3 instead of zero, which enters squared: 1e-6, over weights of 16 and more.
    np.testing.assert_allclose(law.coefficients, exact, rtol=1e-5, atol=1e-6)


def test_mirrored_points_give_an_even_law(xr701: Robot) -> None:
    half = [(200, -35, 4e5), (200, 5, 2e5), (100, 45, 1.2e6), (30, 45, 9e5)]
    both = [*half, *[(-a, b, k) for a, b, k in half]]
    law = fit_law(xr701, points(TWO, [p[:2] for p in both], [p[2] for p in both]), 6, "test")
    u = all_angles(xr701, TWO)
    there, mirrored = stiffness_at(xr701, law, TWO, u), stiffness_at(xr701, law, TWO, u * [-1.0, 1.0])
    # Evenness comes out of the least squares, so it holds to its round-off.
    np.testing.assert_allclose(there, mirrored, rtol=1e-10)
    assert np.ptp(np.log(there)) > 0.5  # it is not even by being constant


@pytest.mark.parametrize("degree", [0, 1, 6])
@pytest.mark.parametrize("angles_deg", [[5], [-35, 5, 45]])
def test_one_point_or_equal_points_give_a_constant(xr701: Robot, degree: int, angles_deg: list[float]) -> None:
    law = fit_law(xr701, points(ONE, angles_deg, [7e5] * len(angles_deg)), degree, "test")
    # A logarithm and an exponential: round-off.
    np.testing.assert_allclose(stiffness_at(xr701, law, ONE, all_angles(xr701, ONE)), 7e5, rtol=1e-12)


def test_contradicting_points_give_their_geometric_mean(xr701: Robot) -> None:
    law = fit_law(xr701, points(ONE, [5, 5, -35], [1e5, 4e5, 3e5]), 6, "test")
    found = stiffness_at(xr701, law, ONE, np.radians([[5.0], [-35.0]]))
    # Least squares in ln k: mean of the logarithms at 5 deg, the point itself elsewhere; round-off.
    np.testing.assert_allclose(found, [2e5, 3e5], rtol=1e-10)


def test_too_low_a_degree_is_a_least_squares_fit(xr701: Robot) -> None:
    k = np.array([2e5, 8e5, 3e5])
    law = fit_law(xr701, points(ONE, [-35, 5, 45], k), 1, "test")
    u = (np.radians([-35.0, 5.0, 45.0]) - law_centre(law)) / law_half(law)
    line = np.polynomial.Polynomial.fit(u, np.log(k), 1)(u)
    found = stiffness_at(xr701, law, ONE, np.radians([[-35.0], [5.0], [45.0]]))
    # Two ways to solve the same small least squares: round-off.
    np.testing.assert_allclose(np.log(found), line, rtol=1e-12)


def law_centre(law: LogPolynomialLaw) -> float:
    return float(np.radians(law.centre_deg[0]))


def law_half(law: LogPolynomialLaw) -> float:
    return float(np.radians(law.half_range_deg[0]))


@pytest.mark.parametrize("load_path", ["parallelogram", "serial"])
def test_the_xr701_laws_do_not_overshoot(arm: Arm, measured: Measurements, scheme: Campaign, load_path: str) -> None:
    model = arm(load_path=load_path)
    found = run_campaign(load_description("xr701"), lambda _: model, measured, scheme)
    for law, given in [(s.laws[j], s.points[j]) for s in found.studies for j in s.laws]:
        k = stiffness_at(model.robot, law, given.inputs, all_angles(model.robot, given.inputs))
        assert np.isfinite(k).all()
        assert (k > 0.0).all()
        # The points span the joints' limits, so between them a calm law stays in their range. Measured over
        # both load paths: up to 5 % beyond it. The unweighted least-norm polynomial falls below j4's points
        # by a factor of 1e4; 1.25 tells the two apart and leaves room for another geometry.
        assert k.min() > given.stiffness.min() / 1.25
        assert k.max() < given.stiffness.max() * 1.25


def test_exponents_are_those_of_the_total_degree() -> None:
    assert total_degree_exponents(2, 2).tolist() == [[0, 0], [0, 1], [1, 0], [0, 2], [1, 1], [2, 0]]
    # Binomial(6 + 2, 2).
    assert len(total_degree_exponents(2, 6)) == 28


@pytest.mark.parametrize("bad", [0.0, -1e5, np.inf, np.nan])
def test_a_stiffness_that_is_none_is_refused(xr701: Robot, bad: float) -> None:
    refuses(
        "C001",
        r"regression of j4: stiffness.*positive, finite",
        fit_law,
        xr701,
        points(ONE, [-35, 5], [1e5, bad]),
        6,
        "test",
    )


def test_no_points_are_refused(xr701: Robot) -> None:
    refuses("C001", "regression of j4: no calibrated point", fit_law, xr701, points(ONE, [], []), 6, "test")
