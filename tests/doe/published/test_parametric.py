"""One parametric study: known springs found again, bounds said, valleys measured, failures told."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from refusals import refuses

from doe import Measurements, PoseFit, fit_pose
from doe.published.parametric import MAX_ROUNDS, _refined
from doe.tables.loaded import select_poses, spring_parts
from fem import ArmModel
from robots.arrays import Array

Arm = Callable[..., ArmModel]
GAUGE_M = 1e-5
BOUNDS = (1e5, 1e6)
# Hand-made influences, m per rad/(N m): 650 N on levers of 1 m and 1.5 m.
A1, A2 = -650.0, -650.0 * 1.5**2


# Influences (m, k) and what all else gives less what was read (m,).
System = tuple[Array, Array]


def one_reading(value: float, influence: tuple[float, ...] = (A1,), rest: float = -5e-4) -> System:
    return np.array([influence]), np.array([rest - value])


def fit(system: System, levels: int = 10, spacing: str = "log", start: float = 1e6) -> PoseFit:
    joints = tuple(f"j{i + 1}" for i in range(system[0].shape[1]))
    return fit_pose("7", *system, joints, levels, BOUNDS, GAUGE_M, start, spacing)


def reading_of(*springs: float) -> float:
    return -5e-4 + sum(a / k for a, k in zip((A1, A2), springs, strict=False))


@pytest.mark.parametrize("spacing", ["log", "linear"])
@pytest.mark.parametrize("levels", [4, 10])
@pytest.mark.parametrize("true", [1.05e5, 2e5, 6.3e5, 9e5])
def test_a_known_spring_is_found_within_the_gauge(true: float, levels: int, spacing: str) -> None:
    found = fit(one_reading(reading_of(true)), levels, spacing)
    assert found.matched
    assert abs(found.error_mm) <= GAUGE_M * 1e3
    # |a| |1/k - 1/k_true| <= gauge is all that one reading can say; the rest of the bound is round-off.
    assert abs(A1 * (1.0 / found.stiffness[0] - 1.0 / true)) <= GAUGE_M * (1 + 1e-9)
    # Inside the bounds there is nothing to remark, even where the first grid's best level was its last one.
    assert found.remarks == ()


def test_of_several_matching_levels_the_best_is_taken() -> None:
    # A reading that the spring hardly moves: many levels match it, and the softest of them is not the answer.
    weak = A1 * 1e-2
    found = fit(one_reading(-5e-4 + weak / 4e5, (weak,)))
    assert found.runs == 10
    grid = np.geomspace(*BOUNDS, 10)
    error = np.abs(weak * (1.0 / grid - 1.0 / 4e5))
    assert (error <= GAUGE_M).sum() >= 5
    assert found.stiffness[0] == grid[np.argmin(error)]


def test_the_range_of_equal_matches_is_the_gauges() -> None:
    true = 2e5
    found = fit(one_reading(reading_of(true)))
    c = 1.0 / true + np.array([1.0, -1.0]) * GAUGE_M / abs(A1)
    # A linear program in scaled units: solver tolerance 1e-7 of a micrometre or so.
    np.testing.assert_allclose(found.equivalent[0], 1.0 / c, rtol=1e-6)


@pytest.mark.parametrize(
    ("true", "remark"),
    [
        (3.2e4, "j1: lower bound 1e+05 N m/rad hit, widened to 1e+04"),
        (4e3, "j1: lower bound 1e+05 N m/rad hit, widened to 1e+03"),
        (2.5e6, "j1: upper bound 1e+06 N m/rad hit, widened to 1e+07"),
    ],
)
def test_a_bound_that_is_hit_is_said_and_widened(true: float, remark: str) -> None:
    found = fit(one_reading(reading_of(true)))
    assert found.matched
    assert abs(A1 * (1.0 / found.stiffness[0] - 1.0 / true)) <= GAUGE_M * (1 + 1e-9)
    assert found.remarks == (remark,)


def test_refinement_takes_the_neighbours_of_the_best_level() -> None:
    grid = np.geomspace(2e5, 3e5, 10)
    bound = (np.array([1e5]), np.array([1e7]))
    none = np.zeros((2, 1), dtype=np.bool_)
    step = grid[1] / grid[0]
    for best, expected in (
        (4, (grid[3], grid[5])),
        # At the end of a refined grid it goes one such level beyond, not back to the far bound ...
        (0, (grid[0] / step, grid[1])),
        (9, (grid[8], grid[9] * step)),
    ):
        low, high = _refined(grid[[best]], [grid], bound, none)
        np.testing.assert_allclose([low[0], high[0]], expected, rtol=1e-12)  # round-off
    # ... which only a bound that was just widened asks for.
    upper = np.array([[False], [True]])
    assert _refined(grid[[9]], [grid], bound, upper)[1] == [1e7]


def test_a_match_on_the_bound_itself_is_said() -> None:
    found = fit(one_reading(reading_of(1e5)))
    assert found.stiffness[0] == pytest.approx(1e5, rel=1e-12)  # it is a level: round-off of a power
    assert found.remarks == ("j1: lower bound 1e+05 N m/rad hit, stands there",)


def test_too_much_deflection_without_the_spring_is_told() -> None:
    # The rest alone gives 0.5 mm, read were 0.2 mm: no spring can help.
    found = fit(one_reading(-2e-4))
    assert not found.matched
    assert np.isnan(found.equivalent).all()
    assert found.rounds < MAX_ROUNDS
    # It stands where it reads as rigid: within half a gauge digit.
    assert abs(A1 / found.stiffness[0]) <= 0.5 * GAUGE_M * (1 + 1e-9)
    assert found.error_mm == pytest.approx(-0.3, abs=0.5 * GAUGE_M * 1e3 * (1 + 1e-9))
    assert "not matched: the rest of the model alone bends 0.305 mm more than was measured" in found.remarks[-1]


def test_too_little_deflection_with_the_softest_spring_is_told() -> None:
    # The softest spring that is tried, 1e3 N m/rad, gives 650 mm; read was a metre.
    found = fit(one_reading(-1.0))
    assert not found.matched
    assert found.stiffness[0] == pytest.approx(1e3, rel=1e-5)  # refinement ends at 1e-6 about the bound
    assert "not matched: 349.500 mm less deflection than measured at the softest springs" in found.remarks[-1]
    assert "lower bound 1e+05 N m/rad hit, widened to 1e+03 and stands there" in found.remarks[0]


def test_the_side_is_told_by_the_springs_own_direction() -> None:
    # A reading of zero, or one that the spring moves the other way, must not turn the message round.
    assert "less deflection" not in fit(one_reading(0.0)).remarks[-1]
    assert "more than was measured" in fit(one_reading(0.0)).remarks[-1]
    assert "less deflection" in fit(one_reading(-1.0, (A1,), rest=2e-4)).remarks[-1]


def test_a_spring_that_nothing_moves_is_not_blamed() -> None:
    found = fit(one_reading(-2e-4, (0.0,)))
    assert not found.matched
    assert "the reading does not move with the spring" in found.remarks[-1]


@pytest.mark.parametrize("spacing", ["log", "linear"])
def test_two_springs_match_as_near_to_the_start_as_possible(spacing: str) -> None:
    target = reading_of(4e5, 7e5)
    found = fit(one_reading(target, (A1, A2)), spacing=spacing)
    assert found.matched
    # By hand: along the valley a1/k1 + a2/k2 = d, the smallest ln(k1/s)^2 + ln(k2/s)^2.
    k2 = np.geomspace(3e5, 3e6, 2_000_001)
    c1 = (target + 5e-4 - A2 / k2) / A1
    ok = c1 > 0
    k1 = 1.0 / c1[ok]
    best = np.argmin(np.log(k1 / 1e6) ** 2 + np.log(k2[ok] / 1e6) ** 2)
    # The match may be off by the gauge, 0.01 mm of 3.7 mm: 0.3 %; doubled for the softer direction.
    np.testing.assert_allclose(found.stiffness, [k1[best], k2[ok][best]], rtol=6e-3)


def test_the_answer_for_two_springs_does_not_hang_on_the_levels() -> None:
    system = one_reading(reading_of(4e5, 7e5), (A1, A2))
    found = np.array([fit(system, levels, s).stiffness for levels in (4, 7, 10, 13) for s in ("log", "linear")])
    # As above: the gauge over the deflection, doubled.
    assert (np.ptp(found, axis=0) / found.mean(axis=0)).max() < 6e-3


def test_the_valley_of_two_springs_is_measured_by_hand_arithmetic() -> None:
    target = reading_of(4e5, 7e5)
    found = fit(one_reading(target, (A1, A2)))
    # One spring is softest where the other is rigid (1e9) and the match stands at the gauge's edge ...
    total = (abs(target) - 5e-4) + np.array([GAUGE_M, -GAUGE_M])
    softest = [abs(A1) / (total[0] - abs(A2) / 1e9), abs(A2) / (total[0] - abs(A1) / 1e9)]
    np.testing.assert_allclose(found.equivalent[:, 0], softest, rtol=1e-6)  # linear program, as above
    # ... and may be rigid itself, for the other one alone can carry the whole deflection.
    np.testing.assert_allclose(found.equivalent[:, 1], 1e9, rtol=1e-6)


def test_an_untested_spring_stays_at_the_start() -> None:
    # The second reading lever is 1000 times shorter: a factor 3 in that spring is 0.4 nm.
    found = fit(one_reading(reading_of(4e5), (A1, A2 * 1e-6)))
    assert found.matched
    # Moving it costs more distance than it could ever save on the other spring.
    assert found.stiffness[1] == pytest.approx(1e6, rel=1e-3)


@pytest.mark.parametrize(("springs", "runs"), [(2, 100), (1, 10)])
def test_a_round_takes_levels_to_the_power_of_springs_runs(springs: int, runs: int) -> None:
    found = fit(one_reading(reading_of(*(4e5, 7e5)[:springs]), (A1, A2)[:springs]))
    # 100, 10 and 10 runs are the paper's three steps.
    assert found.runs == runs * found.rounds
    assert found.rounds > 1
    # The first round alone would not do here.
    assert found.first_error_mm > GAUGE_M * 1e3


def test_several_readings_at_a_pose_are_matched_together() -> None:
    influence = np.array([[A1, A2], [A1 / 2, A2], [A1, A2 / 3]])
    value = -5e-4 + influence @ (1.0 / np.array([4e5, 7e5]))
    found = fit((influence, -5e-4 - value))
    assert found.matched
    assert found.error_mm >= 0.0
    # Three readings of two springs leave no valley: within what the gauge allows, some 0.02 mm of 1.6 mm.
    np.testing.assert_allclose(found.stiffness, [4e5, 7e5], rtol=0.03)
    assert (found.equivalent[:, 0] <= found.stiffness * (1 + 1e-9)).all()
    assert (found.equivalent[:, 1] >= found.stiffness * (1 - 1e-9)).all()


@pytest.mark.slow
def test_springs_of_a_slanting_valley_are_found_where_levels_along_the_axes_stick(rng: np.random.Generator) -> None:
    for _ in range(40):
        springs, readings = rng.integers(2, 4, size=2)
        influence = A1 * rng.uniform(0.0, 2.0, (readings, springs)) ** 2
        value = -5e-4 + influence @ 10.0 ** -rng.uniform(4.0, 7.0, springs)
        found = fit((influence, -5e-4 - value), levels=5)
        # The readings were made by such springs, so a match exists and must not be denied.
        assert found.matched
        left = influence @ (1.0 / found.stiffness) - 5e-4 - value
        assert np.sqrt(np.mean(left**2)) <= GAUGE_M * (1 + 1e-9)  # the gauge; round-off


def test_readings_that_contradict_each_other_are_told() -> None:
    found = fit((np.array([[A1], [A1]]), np.array([1e-3, 2e-3])))
    assert not found.matched
    # Least squares stands in the middle, 0.5 mm from each.
    assert found.error_mm == pytest.approx(0.5, rel=1e-9)  # flat about the optimum: refinement of 1e-6, squared
    assert A1 / found.stiffness[0] == pytest.approx(-1.5e-3, rel=1e-5)  # refinement of 1e-6
    assert "RMS 0.500 mm" in found.remarks[-1]


def test_the_measured_pose_4_is_within_reach_of_the_paper_scheme(arm: Arm, measured: Measurements) -> None:
    # On the real system: the fit's own error is the model's error at that pose.
    model = arm()
    one = select_poses(measured, ("4",), "test")
    influence, rest = (part[one.used] for part in spring_parts(model, one))
    value = one.displacement[one.used]
    fixed = np.array([0.0, 1e-6, 1e-6, 1e-6, 0.0, 0.0])
    found = fit_pose("4", influence[:, [4]], rest + influence @ fixed - value, ("j5",), 10, BOUNDS, GAUGE_M, 1e6)
    fixed[4] = 1.0 / found.stiffness[0]
    simulated = (rest + influence @ fixed)[0]
    # The same sum in another order: round-off on 1.5 mm.
    assert found.error_mm == pytest.approx((simulated - value[0]) * 1e3, abs=1e-12)


@pytest.mark.parametrize(
    ("levels", "bounds", "spacing", "message"),
    [
        (3, BOUNDS, "log", "levels of a parametric study: got 3; allowed: 4 or more"),
        (10, (1e6, 1e5), "log", "bounds of a parametric study"),
        (10, (0.0, 1e5), "log", "bounds of a parametric study"),
        (10, BOUNDS, "geometric", "spacing of the levels: got 'geometric'; allowed: log, linear"),
    ],
)
def test_bad_input_is_named(levels: int, bounds: tuple[float, float], spacing: str, message: str) -> None:
    refuses("M002", message, fit_pose, "7", *one_reading(-1e-3), ("j1",), levels, bounds, GAUGE_M, 1e6, spacing)
