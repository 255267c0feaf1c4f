"""Constant springs from all readings: known springs found, honest intervals, the optimum by other means."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import t as student

from doe import ConstantFit, Equations, Measurements, SpringEstimate, constant_fit, equations, fit_constant
from fem import ArmModel
from robots import InputError, Robot

Arm = Callable[..., ArmModel]
Readings = Callable[..., Measurements]
Poses = Callable[[Robot, int, np.random.Generator], np.ndarray]
JOINTS = ("j2", "j3", "j4", "j5")
ALL = ("j1", "j2", "j3", "j4", "j5", "j6")
BOUNDS = (1e5, 1e6)
GAUGE_M = 1e-5
# Same order as the published ones of the KR60-3.
# A point on the axis of joint 6 does not move with that joint.
OFF_AXIS = (0.25, 0.1, 0.2)
SPRINGS = dict(zip(ALL, (2.2e6, 9e5, 1.1e6, 6.4e4, 2.5e4, 2.0e4), strict=True))


def fit(system: Equations, joints: tuple[str, ...] = JOINTS, bounds: tuple[float, float] = BOUNDS) -> ConstantFit:
    return fit_constant(system, joints, ALL, np.zeros(6), bounds)


def spring(found: ConstantFit, joint: str) -> SpringEstimate:
    return next(s for s in found.springs if s.joint == joint)


def made_of(influence: np.ndarray, value: np.ndarray) -> Equations:
    """Equations with hand-made influences of the joints j1, j2, ... (m, p) and no rest."""
    m, p = influence.shape
    full = np.zeros((m, 6))
    full[:, :p] = influence
    return Equations(
        influence=full, rest=np.zeros(m), value=value, sigma=np.full(m, GAUGE_M), row=np.arange(m),
        component=np.full(m, 2), q=np.zeros((m, 6)), pose=tuple(f"P{i}" for i in range(m)),
    )  # fmt: skip


def xyz_system(
    model: ArmModel,
    readings: Readings,
    random_poses: Poses,
    rng: np.random.Generator,
    n: int = 12,
    springs: dict[str, float] = SPRINGS,
) -> Equations:
    q = random_poses(model.robot, n, rng)
    wrench = rng.uniform(-1.0, 1.0, size=(n, 6)) * [800, 800, 800, 200, 200, 200]
    return equations(model, readings(model, springs, q, wrench, "xyz", point=OFF_AXIS), GAUGE_M)


# --- the measured poses at 650 N ---------------------------------------------------------------------------


def test_rigid_links_with_the_parallelogram_give_the_known_springs(arm: Arm, measured: Measurements) -> None:
    found, _ = constant_fit(arm(links="rigid"), measured, JOINTS, BOUNDS, GAUGE_M)
    # Known by an independent calculation, to the digits given: 0.050 mm; 1.4e6, 0.76e6, 1.4e6 N m/rad.
    assert found.rms_mm == pytest.approx(0.050, abs=5e-4)
    assert spring(found, "j2").stiffness == pytest.approx(1.4e6, abs=0.05e6)
    assert spring(found, "j3").stiffness == pytest.approx(0.76e6, abs=0.005e6)
    assert spring(found, "j4").stiffness == pytest.approx(1.4e6, abs=0.05e6)
    assert spring(found, "j5").status == "at bound"
    assert spring(found, "j5").stiffness == pytest.approx(1e9, rel=1e-9)  # the widest bound itself
    assert found.degrees_of_freedom == 5


@pytest.mark.parametrize(("links", "rms_mm"), [("rigid", 0.0964), ("beam", 0.0980)])
def test_without_the_parallelogram_joint_2_becomes_absurd(
    arm: Arm, measured: Measurements, links: str, rms_mm: float
) -> None:
    found, _ = constant_fit(arm(links=links, load_path="serial"), measured, JOINTS, BOUNDS, GAUGE_M)
    assert found.rms_mm == pytest.approx(rms_mm, abs=5e-5)  # known to the digits given
    assert spring(found, "j2").stiffness > 1e7
    assert spring(found, "j2").status == "one-sided"
    assert np.isinf(spring(found, "j2").interval[1])


def test_bounds_that_were_hit_are_remarked_and_no_others(arm: Arm, measured: Measurements) -> None:
    found, _ = constant_fit(arm(load_path="serial"), measured, JOINTS, BOUNDS, GAUGE_M)
    # j3 (0.77e6) and j4 (0.17e6) lie inside the bounds: nothing was hit there.
    assert found.remarks == (
        "j2: bound 1e+06 N m/rad hit, widened to 1e+08",
        "j5: bound 1e+06 N m/rad hit, widened to 1e+09 and is hit there too",
    )


# --- known springs ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("robot", ["xr701", "kr60-3", "tx200"])
def test_known_springs_are_found_to_round_off(
    arm: Arm, readings: Readings, random_poses: Poses, rng: np.random.Generator, robot: str
) -> None:
    found = fit(xyz_system(arm(robot), readings, random_poses, rng), ALL)
    for s in found.springs:
        # Round-off 1e-16, times deflections over a spring's own share (1e3), times the condition number.
        assert s.stiffness == pytest.approx(SPRINGS[s.joint], rel=1e-10)
        assert s.status == "determined"
    assert found.rms_mm < 1e-10
    assert found.condition < 100.0


def test_known_springs_are_found_with_widened_bounds_said(
    arm: Arm, readings: Readings, random_poses: Poses, rng: np.random.Generator
) -> None:
    found = fit(xyz_system(arm("kr60-3"), readings, random_poses, rng), ALL)
    assert found.remarks == (
        "j1: bound 1e+06 N m/rad hit, widened to 1e+07",
        "j3: bound 1e+06 N m/rad hit, widened to 1e+07",
        "j4: bound 1e+05 N m/rad hit, widened to 1e+04",
        "j5: bound 1e+05 N m/rad hit, widened to 1e+04",
        "j6: bound 1e+05 N m/rad hit, widened to 1e+04",
    )


def test_the_bounds_do_not_change_the_answer(arm: Arm, measured: Measurements) -> None:
    # The problem is convex: wherever the bounds start, the optimum over the widest range is the same.
    answers = [
        [s.stiffness for s in constant_fit(arm(), measured, JOINTS, b, GAUGE_M)[0].springs]
        for b in (BOUNDS, (1e3, 1e9), (2e6, 3e6))
    ]
    # The same solve on the same numbers.
    np.testing.assert_allclose(answers[1:], [answers[0]] * 2, rtol=1e-12)


def test_other_joints_keep_their_springs_pose_by_pose(
    arm: Arm, readings: Readings, random_poses: Poses, rng: np.random.Generator
) -> None:
    # The springs that are not fitted may depend on the pose.
    system = xyz_system(arm("kr60-3"), readings, random_poses, rng)
    factor = rng.uniform(0.5, 2.0, size=len(system))
    c = np.tile([1.0 / SPRINGS[j] for j in ALL], (len(system), 1))
    c[:, 4] *= factor
    changed = replace(system, value=system.predict(c))
    fixed = c.copy()
    fixed[:, [1, 2]] = np.nan  # those that are fitted must not be looked at
    found = fit_constant(changed, ("j2", "j3"), ALL, np.nan_to_num(fixed, nan=1.0), BOUNDS)
    for joint in ("j2", "j3"):
        # As above: round-off times shares and condition.
        assert spring(found, joint).stiffness == pytest.approx(SPRINGS[joint], rel=1e-10)


# --- the optimum by other means ------------------------------------------------------------------------------


@pytest.mark.parametrize("load_path", ["parallelogram", "serial"])
def test_no_general_optimiser_does_better(arm: Arm, measured: Measurements, load_path: str) -> None:
    found, system = constant_fit(arm(load_path=load_path), measured, JOINTS, BOUNDS, GAUGE_M)
    A, b = system.influence[:, 1:5] / GAUGE_M, (system.value - system.rest) / GAUGE_M
    square = float(np.sum((found.residual_m / GAUGE_M) ** 2))

    def error(logarithm: np.ndarray) -> np.ndarray:
        return np.asarray(A @ np.exp(-logarithm) - b)

    def minimum(start: float) -> float:
        box = (np.log(1e3), np.log(1e9))
        found = least_squares(error, np.full(4, np.log(start)), bounds=box, xtol=1e-12, ftol=1e-12, gtol=1e-12)
        return 2.0 * float(found.cost)

    best = min(minimum(start) for start in (2e5, 1e6, 1e7))
    # Ours is the least, and the other one gets there as far as its tolerances let it along the bound.
    assert square <= best * (1 + 1e-12)
    assert square == pytest.approx(best, rel=1e-3)


def test_no_point_of_a_grid_does_better(arm: Arm, measured: Measurements) -> None:
    found, system = constant_fit(arm(), measured, ("j2", "j3"), BOUNDS, GAUGE_M)
    k2, k3 = np.meshgrid(np.geomspace(1e5, 1e9, 401), np.geomspace(1e5, 1e9, 401), indexing="ij")
    e = (
        (system.rest - system.value)[:, None, None]
        + system.influence[:, 1, None, None] / k2
        + system.influence[:, 2, None, None] / k3
    )
    squares = np.sum(e**2, axis=0)
    square = float(np.sum(found.residual_m**2))
    assert square <= squares.min()
    at = np.unravel_index(np.argmin(squares), squares.shape)
    # A grid step is 2.3 %; the valley is flat, so allow three of them.
    assert spring(found, "j2").stiffness == pytest.approx(k2[at], rel=0.07)
    assert spring(found, "j3").stiffness == pytest.approx(k3[at], rel=0.07)


# --- intervals -----------------------------------------------------------------------------------------------


def test_inside_the_bounds_intervals_are_the_classical_ones(
    arm: Arm, readings: Readings, random_poses: Poses, rng: np.random.Generator
) -> None:
    system = xyz_system(arm("kr60-3"), readings, random_poses, rng)
    noisy = replace(system, value=system.value + rng.normal(0.0, GAUGE_M, len(system)))
    found = fit(noisy, ALL)
    c, square, rank, _ = np.linalg.lstsq(noisy.influence, noisy.value - noisy.rest, rcond=None)
    spare = len(noisy) - rank
    sd = np.sqrt(np.diag(np.linalg.inv(noisy.influence.T @ noisy.influence)) * square / spare)
    half = sd.ravel() * student.ppf(0.975, spare)
    assert (half < c).all()
    # The textbook formula in unscaled numbers: the inverse loses the square of a condition number of 100.
    np.testing.assert_allclose([s.interval[0] for s in found.springs], 1.0 / (c + half), rtol=1e-9)
    np.testing.assert_allclose([s.interval[1] for s in found.springs], 1.0 / (c - half), rtol=1e-9)
    assert found.sigma_m == pytest.approx(float(np.sqrt(square[0] / spare)), rel=1e-9)


@pytest.mark.parametrize("load_path", ["parallelogram", "serial"])
def test_interval_ends_stand_where_the_profile_has_risen(arm: Arm, measured: Measurements, load_path: str) -> None:
    # The real data have a spring at its bound, so the textbook formula does not hold. Each end must be where
    # the best fit of all *other* springs within their range is worse by exactly the allowed amount.
    found, system = constant_fit(arm(load_path=load_path), measured, JOINTS, BOUNDS, GAUGE_M)
    A, b = system.influence[:, 1:5], system.value - system.rest
    best = float(np.sum(found.residual_m**2))
    limit = best * (1.0 + student.ppf(0.975, found.degrees_of_freedom) ** 2 / found.degrees_of_freedom)
    ends = 0
    for i, s in enumerate(found.springs):
        for k in s.interval:
            if np.isfinite(k):
                # Rise by at most 1e-4 of it: the limit is solved for to 1e-6 of the interval.
                assert profile(A, b, i, 1.0 / k) == pytest.approx(limit, rel=1e-4)
                ends += 1
            else:
                assert profile(A, b, i, 1e-9) <= limit * (1 + 1e-9)
    assert ends >= 4


def profile(A: np.ndarray, b: np.ndarray, index: int, value: float) -> float:
    """Least sum of squares with one compliance held, by trying every set of springs that stand at 1e9."""
    others = [i for i in range(A.shape[1]) if i != index]
    best = np.inf
    for size in range(len(others) + 1):
        for free in itertools.combinations(others, size):
            c = np.full(A.shape[1], 1e-9)
            c[index] = value
            rest = b - A @ np.where(np.isin(np.arange(len(c)), free), 0.0, c)
            c[list(free)] = np.linalg.lstsq(A[:, free], rest, rcond=None)[0]
            if (c >= 1e-9 * (1 - 1e-9)).all():
                best = min(best, float(np.sum((A @ c - b) ** 2)))
    return best


def test_a_neighbour_at_its_bound_does_not_make_an_interval_too_narrow(arm: Arm, measured: Measurements) -> None:
    # Holding j5 rigid as if that were known would leave its share out of the others' uncertainty.
    found, system = constant_fit(arm(), measured, JOINTS, BOUNDS, GAUGE_M)
    without = fit_constant(system, ("j2", "j3", "j4"), ALL, np.zeros(6), BOUNDS)
    low, high = spring(found, "j3").interval
    narrow_low, narrow_high = spring(without, "j3").interval
    assert low < narrow_low * 1.001
    assert high > narrow_high * 1.005


def coverage(system: Equations, true: dict[str, float], repeats: int, rng: np.random.Generator) -> dict[str, int]:
    hits = dict.fromkeys(true, 0)
    for noise in rng.normal(0.0, GAUGE_M, (repeats, len(system))):
        for s in fit(replace(system, value=system.value + noise), tuple(true)).springs:
            # A rigid joint is 1e9 in the fit; an upper end there is infinite.
            hits[s.joint] += s.interval[0] <= true[s.joint] <= s.interval[1]
    return hits


def test_95_percent_intervals_cover_95_percent(
    arm: Arm, readings: Readings, random_poses: Poses, rng: np.random.Generator
) -> None:
    system = xyz_system(arm("kr60-3"), readings, random_poses, rng, n=4)
    hits = coverage(system, SPRINGS, 300, rng)
    # 300 repeats at 95 %: 285 with a binomial standard deviation of 3.8. Four of them to both sides, so that
    # one of six springs fails by chance in 3000 seeds; the seed is fixed.
    for joint, count in hits.items():
        assert 270 <= count < 300, (joint, count)


def test_intervals_cover_with_springs_near_and_at_their_bounds(
    arm: Arm, measured: Measurements, readings: Readings, rng: np.random.Generator
) -> None:
    # Nine vertical readings with the gauge's noise: j4 is hardly seen, j5 is as good as rigid.
    true = {"j2": 1.5e6, "j3": 8e5, "j4": 3e6, "j5": 5e7}
    data = readings(arm(), true, measured.q, measured.wrench, "z", measured.pose)
    hits = coverage(equations(arm(), data, GAUGE_M), true, 300, rng)
    # At bounds profile intervals are on the safe side: at least 95 % less four standard deviations.
    assert min(hits.values()) >= 270, hits


def test_a_rigid_joint_gets_a_lower_limit_in_proportion_to_the_noise(
    arm: Arm, measured: Measurements, readings: Readings, rng: np.random.Generator
) -> None:
    true = {"j2": 1.5e6, "j3": 8e5, "j4": 5e5, "j5": 1e9}
    noise = np.zeros((9, 6))
    noise[:, 2] = rng.normal(0.0, GAUGE_M, 9)
    floors = []
    for size in (1.0, 0.1):
        data = readings(arm(), true, measured.q, measured.wrench, "z", measured.pose, noise * size)
        j5 = spring(constant_fit(arm(), data, JOINTS, BOUNDS, GAUGE_M)[0], "j5")
        assert j5.status in ("at bound", "one-sided")
        assert np.isinf(j5.interval[1])
        floors.append(j5.interval[0])
    # Ten times quieter readings exclude ten times stiffer joints, both limits being counted from rigid; that
    # rigid is 1e9 here and the quieter floor about 4e7 makes it a few per cent less.
    assert floors[1] / floors[0] == pytest.approx(10.0, rel=0.05)
    # 0.01 mm of noise over levers of 0.3 m and 650 N: 60 N m^2 / 1e-5 m = 6e6 N m/rad, give or take.
    assert 1e6 < floors[0] < 6e7


def test_a_quieter_reading_counts_for_more() -> None:
    system = made_of(np.full((3, 1), -650.0), np.array([-1e-3, -2e-3, -2e-3]))
    weighted = replace(system, sigma=np.array([1e-7, 1e-5, 1e-5]))
    plain, towards = fit(system, ("j1",)), fit(weighted, ("j1",))
    assert plain.springs[0].stiffness == pytest.approx(650.0 / (5e-3 / 3), rel=1e-12)  # the mean
    # Weights of 1e4 : 1 : 1 leave 2e-4 of the difference, which is as large as the value.
    assert towards.springs[0].stiffness == pytest.approx(650.0 / 1e-3, rel=3e-4)


# --- what the data cannot tell -----------------------------------------------------------------------------


def test_a_spring_that_no_reading_moves_is_said_and_is_no_number(arm: Arm, measured: Measurements) -> None:
    found, _ = constant_fit(arm(), measured, ("j1", *JOINTS), BOUNDS, GAUGE_M)
    plain, _ = constant_fit(arm(), measured, JOINTS, BOUNDS, GAUGE_M)
    j1 = spring(found, "j1")
    assert j1.status == "not identified"
    assert np.isnan([j1.stiffness, *j1.interval]).all()
    assert "j1: no reading moves with this spring; it is left out" in found.remarks
    # It is no parameter either: the others come out as without it.
    assert found.degrees_of_freedom == plain.degrees_of_freedom
    assert found.springs[1:] == plain.springs


def test_only_unseen_springs_give_no_numbers_at_all(arm: Arm, measured: Measurements) -> None:
    found, system = constant_fit(arm(), measured, ("j1",), BOUNDS, GAUGE_M)
    assert found.springs[0].status == "not identified"
    # Rigid joints are what is left: the residual is theirs. Scaled by the gauge and back: round-off.
    np.testing.assert_allclose(found.residual_m, system.rest - system.value, atol=1e-15)


def test_positions_read_on_the_axis_of_joint_6_do_not_tell_of_it(
    arm: Arm, readings: Readings, random_poses: Poses, rng: np.random.Generator
) -> None:
    model = arm("tx200")
    wrench = rng.uniform(-500.0, 500.0, size=(12, 6))
    data = readings(model, SPRINGS, random_poses(model.robot, 12, rng), wrench, "xyz")
    found = fit(equations(model, data, GAUGE_M), ALL)
    assert [s.joint for s in found.springs if s.status == "not identified"] == ["j6"]
    assert np.isnan(spring(found, "j6").stiffness)


def test_two_springs_that_act_alike_are_not_told_apart_and_the_third_is(rng: np.random.Generator) -> None:
    a, b = rng.normal(size=(2, 8)) * 1000.0
    influence = np.column_stack([a, 2.0 * a, b])
    system = made_of(influence, influence @ [1e-6, 2e-6, 4e-6] + rng.normal(0.0, GAUGE_M, 8))
    found = fit(system, ("j1", "j2", "j3"))
    assert [s.status for s in found.springs] == ["not identified", "not identified", "determined"]
    assert np.isnan([s.interval for s in found.springs[:2]]).all()
    assert "j1, j2: cannot be told apart, only combinations of them are determined" in found.remarks
    assert found.condition > 1e6
    # The combination is determined all the same, and what it leaves for the third one is exact.
    alone = fit(made_of(np.column_stack([a, b]), system.value), ("j1", "j2"))
    sum_of_both = found.compliance[0] + 2.0 * found.compliance[1]
    # Round-off; the null direction does not reach into the sum.
    assert sum_of_both == pytest.approx(alone.compliance[0], rel=1e-10)
    assert found.springs[2].stiffness == pytest.approx(alone.springs[1].stiffness, rel=1e-10)


def test_a_wrist_in_line_is_not_told_apart(arm: Arm, readings: Readings, rng: np.random.Generator) -> None:
    # At q5 = 0 the axes of joints 4 and 6 coincide, in every pose.
    model = arm("kr60-3")
    q = rng.uniform(model.robot.limits[:, 0], model.robot.limits[:, 1], size=(10, 6))
    q[:, 4] = 0.0
    wrench = rng.uniform(-500.0, 500.0, size=(10, 6))
    system = equations(model, readings(model, SPRINGS, q, wrench, point=OFF_AXIS), GAUGE_M)
    found = fit(system, ALL)
    assert {s.joint for s in found.springs if s.status == "not identified"} == {"j4", "j6"}
    for joint in ("j1", "j2", "j3", "j5"):
        assert spring(found, joint).stiffness == pytest.approx(SPRINGS[joint], rel=1e-9)  # as with known springs
    total = found.compliance[3] + found.compliance[5]
    assert total == pytest.approx(1.0 / SPRINGS["j4"] + 1.0 / SPRINGS["j6"], rel=1e-9)


def test_a_spring_lost_in_the_noise_is_said(rng: np.random.Generator) -> None:
    # A lever of 0.1 mm beside one of 1 m: not even the softest spring would show.
    influence = np.column_stack([np.full(8, 650.0), rng.normal(size=8) * 650.0 * 1e-8])
    system = made_of(influence, influence @ [2e-6, 2e-6] + rng.normal(0.0, GAUGE_M, 8))
    found = fit(system, ("j1", "j2"))
    assert found.springs[1].status == "not identified"
    assert np.isnan(found.springs[1].interval).all()
    assert "j2: any stiffness fits, its share is lost in the noise" in found.remarks
    assert found.springs[0].status == "determined"


def test_a_joint_softer_than_the_widest_range_is_at_bound() -> None:
    system = made_of(np.full((9, 1), 650.0), np.full(9, 2.0))
    found = fit(system, ("j1",))
    assert found.springs[0].stiffness == pytest.approx(1e3, rel=1e-12)  # the bound itself
    assert found.springs[0].status == "at bound"
    assert found.springs[0].interval[0] == 0.0
    assert found.remarks == ("j1: bound 1e+05 N m/rad hit, widened to 1e+03 and is hit there too",)


def test_as_many_springs_as_readings_have_no_error_bars_and_it_is_said() -> None:
    system = made_of(np.array([[650.0, 0.0], [650.0, 900.0]]), np.array([1e-3, 3e-3]))
    found = fit(system, ("j1", "j2"))
    assert found.degrees_of_freedom == 0
    assert np.isnan(found.sigma_m)
    assert np.isnan([s.interval for s in found.springs]).all()
    assert "as many springs as readings: no residual is left, so no error bars can be given" in found.remarks
    # Two equations, two unknowns: round-off.
    assert [s.stiffness for s in found.springs] == pytest.approx([6.5e5, 4.5e5], rel=1e-12)


@pytest.mark.parametrize(
    ("joints", "bounds", "take", "message"),
    [
        (JOINTS, BOUNDS, 3, "3 reading.* cannot determine 4 springs .*measure more poses or fit fewer"),
        (JOINTS, BOUNDS, 0, "no reading to calibrate on"),
        (("j2", "j9"), BOUNDS, 9, "joint to calibrate: got 'j9'; allowed: j1, j2"),
        (("j2", "j2"), BOUNDS, 9, "each joint once"),
        ((), BOUNDS, 9, "joints to calibrate: got 'none'"),
        (JOINTS, (1e6, 1e5), 9, r"bounds of the springs: got '1e\+06 to 100000"),
        (JOINTS, (0.0, 1e5), 9, "0 < lower < upper"),
        (JOINTS, (1e5, np.inf), 9, "finite"),
    ],
)
def test_bad_input_is_named(
    arm: Arm, measured: Measurements, joints: tuple[str, ...], bounds: tuple[float, float], take: int, message: str
) -> None:
    data = measured.select(np.isin(np.arange(9), [0, 1, 8] if take == 3 else range(take)))
    with pytest.raises(InputError, match=message):
        constant_fit(arm(), data, joints, bounds, GAUGE_M)
