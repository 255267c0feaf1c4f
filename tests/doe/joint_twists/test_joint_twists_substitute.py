"""What six stiffnesses a joint make of the flange: against the mechanics, the usual model, cross terms, map, file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from joint_twist_campaigns import EXACT, readings, truth, tx200
from numpy.testing import assert_allclose
from refusals import refuses

from doe.certainty.propagation import parameter_uncertainty, propagate
from doe.joint_twists import identify
from doe.joint_twists.checks import bending_ratio, diagonal_tests, loops
from doe.joint_twists.identify import Identified
from doe.joint_twists.model_file import constant_compliances, held_constant, with_six_springs
from doe.joint_twists.substitute import (
    ABOUT_GEAR,
    compliances_of,
    gear_refitted,
    predict,
    reachable_poses,
    stiffness_window,
    stiffness_with,
    usual_models,
)
from doe.joint_twists.synthetic import TWIST_RATIO_J2, Campaign
from fem import ConstantSpring, build_model, compliance, directional_stiffness
from robots import forward_kinematics, jacobian, load_description, save_description
from robots.library.models import parse_description, to_toml


@pytest.fixture(scope="module")
def exact() -> Identified:
    return identify(tx200(), readings(truth(friction=1.0)))


@pytest.fixture(scope="module")
def some() -> np.ndarray:
    return reachable_poses(tx200(), 40, np.random.default_rng(4))


def test_directional_stiffness_is_that_of_the_mechanics(some: np.ndarray) -> None:
    """An arm with the same springs in `fem`, pose by pose, for laws do not fit into one arm."""
    k = stiffness_with(tx200(), truth().compliances(some[:4]), some[:4])
    for i, q in enumerate(some[:4, None]):
        c = truth().compliances(q)[0]
        parts = tuple(
            replace(j, axial=ConstantSpring(1.0 / c[n, 5]), bearing=np.diag([*c[n, :5], 0.0]))
            for n, j in enumerate(tx200().joints)
        )
        arm = replace(tx200(), joints=parts)
        R = forward_kinematics(arm.robot, q).R_flange[0]
        # Both are exact sums of the same terms: round-off.
        assert_allclose([directional_stiffness(arm, q, R[:, a])[0] for a in range(3)], k[i], rtol=1e-12)


def test_gears_alone_are_equation_3_of_the_paper(some: np.ndarray) -> None:
    """K_t = J^-T K_theta J^-1: along a direction e the flange moves by e . J K_theta^-1 J^T e."""
    c = truth().compliances(some)[:, :, 5]
    J = jacobian(tx200().robot, some, np.zeros(3))
    e = forward_kinematics(tx200().robot, some).R_flange[:, :, 1]
    t = np.einsum("ni,nij->nj", e, J[:, :3])
    gears = truth().compliances(some) * ABOUT_GEAR
    k = stiffness_with(tx200(), gears, some, np.array([[0.0, 2.0, 0.0]]))[:, 0]
    assert_allclose(k, 1.0 / (c * t**2).sum(axis=1), rtol=1e-9)


def test_a_refit_of_an_arm_with_gears_alone_finds_them(some: np.ndarray) -> None:
    gears = np.tile(truth().compliances(np.zeros((1, 6))) * ABOUT_GEAR, (len(some), 1, 1))
    effective = gear_refitted(tx200(), gears, some)
    # Forces at the flange's centre never turn the last gear.
    assert effective[5] == 0.0
    assert_allclose(effective[:5], truth().compliances(np.zeros((1, 6)))[0, :5, 5], rtol=1e-9)


def test_gears_alone_are_always_too_stiff_and_a_refit_is_less_wrong() -> None:
    same, refitted, effective = usual_models(tx200(), truth().compliances, poses=300, rng=np.random.default_rng(0))
    assert_allclose(same.bias, same.mean)
    assert (refitted.mean < same.mean).all()
    # What deflects elsewhere ends up in the gears.
    gears = truth().compliances(np.zeros((1, 6)))[0, :, 5]
    assert (effective[[0, 3, 4]] > gears[[0, 3, 4]]).all()


@pytest.mark.slow
def test_intervals_of_predictions_follow_from_those_of_compliances(some: np.ndarray) -> None:
    """First order against the whole distribution: laws drawn from their covariance."""
    found = identify(tx200(), readings(truth(), Campaign(), 1), law="fourier-1")
    p = predict(tx200(), found, some)
    rng = np.random.default_rng(0)
    c, sd = found.compliances(some)
    drawn = [stiffness_with(tx200(), c + sd * rng.standard_normal(c.shape[1:]), some) for _ in range(400)]
    spread = np.std(drawn, axis=0)
    quantile = next(iter(found.directions.values())).quantile
    # 400 draws: 3.5 % standard error of a standard deviation, the largest of 120; and the second order.
    assert_allclose((p.high - p.low) / (2.0 * quantile), spread, rtol=0.2)
    assert (p.open_share == 0.0).all()


def test_open_stiffnesses_that_a_pose_would_need_are_named(some: np.ndarray) -> None:
    data = readings(truth())
    found = identify(tx200(), data.select(data.joint != 1), law="constant")
    assert (predict(tx200(), found, some).open_share[:, 0] > 0.01).all()


def test_the_finding_at_joint_2(exact: Identified) -> None:
    ratio = bending_ratio(exact.directions, "j2")
    assert ratio is not None
    # Both stiffnesses vary over the angle by 12 %, each by itself: their means by less.
    assert ratio.ratio == pytest.approx(TWIST_RATIO_J2, rel=0.05)
    assert bending_ratio(exact.directions, "j1", "rx").ratio < 0.25  # type: ignore[union-attr]


def test_loops_are_about_the_gears_only(exact: Identified) -> None:
    found = loops(exact)
    for loop in found:
        # In per cent of the range: friction of 1 to 25 N m of some 50 to 700.
        assert (0.02 < loop.share < 0.25) if loop.row == "rz" else abs(loop.share) < 1e-6
        assert (loop.loading_only > 0.01) if loop.row == "rz" else abs(loop.loading_only) < 1e-6


def test_a_cross_term_is_found_where_it_is_and_nowhere_else() -> None:
    c = truth().compliances(np.zeros((1, 6)))[0, 1]
    entry = 0.3 * float(np.sqrt(c[3] * c[5]))
    found = identify(tx200(), readings(truth(couplings={(1, 3, 5): entry}), Campaign(), 7), law="fourier-1")
    tests = {t.joint: t for t in diagonal_tests(found)}
    proven = [c for t in tests.values() for c in t.couplings if c.proven]
    assert ("j2", ("rx", "rz")) in [(c.joint, c.rows) for c in proven]
    one = next(c for c in proven if c.rows == ("rx", "rz"))
    assert one.entry == pytest.approx(entry, abs=4.0 * one.spread)
    assert not tests["j2"].suffices
    # Where a load that is correlated stands for it, other entries of the same joint may be proven; no other joint's.
    assert {c.joint for c in proven} == {"j2"}


def test_a_diagonal_arm_is_left_in_peace() -> None:
    found = identify(tx200(), readings(truth(friction=1.0), Campaign(), 8), law="fourier-1")
    tests = diagonal_tests(found)
    assert sum(len(t.couplings) for t in tests) > 80
    # Holm: one campaign in twenty shows one by chance; this seed does not.
    assert all(t.suffices for t in tests)


@pytest.mark.parametrize("orientation", ["forward", "down"])
def test_the_map_keeps_flange_and_place(exact: Identified, orientation: str) -> None:
    w = stiffness_window(tx200(), compliances_of(exact), orientation=orientation, points=(4, 3))  # type: ignore[arg-type]
    reached = np.isfinite(w.mean)
    assert reached.sum() > 10
    frames = forward_kinematics(tx200().robot, w.q[reached])
    x, z = np.meshgrid(w.x, w.z)
    assert_allclose(frames.p_flange, np.stack([x, 0.0 * x, z], axis=2)[reached], atol=1e-9)
    ways = {"forward": [1.0, 0.0, 0.0], "down": [0.0, 0.0, -1.0]}
    assert_allclose(frames.R_flange[:, :, 2], np.tile(ways[orientation], (len(frames.p_flange), 1)), atol=1e-9)
    expected = stiffness_with(tx200(), exact.compliances(w.q[reached])[0], w.q[reached])
    assert_allclose(w.mean[reached], expected.mean(axis=1))
    assert (w.x[0], w.z[0]) == (1.344, 0.550)


def test_a_window_out_of_reach_is_refused(exact: Identified) -> None:
    refuses("J005", "nothing in it is reached", stiffness_window, tx200(), compliances_of(exact), origin_m=(5.0, 0.0))
    refuses("J005", "orientation of the flange", stiffness_window, tx200(), compliances_of(exact), orientation="up")


@pytest.mark.slow
def test_the_model_file_gives_what_it_says(exact: Identified, some: np.ndarray, tmp_path: Path) -> None:
    description = with_six_springs(load_description("tx200"), exact)
    save_description(description, tmp_path / "model.toml")
    arm = build_model(load_description(tmp_path / "model.toml"), "rigid")
    R = forward_kinematics(arm.robot, some).R_flange
    C = compliance(arm, some)[:, :3, :3]
    k = 1.0 / np.einsum("nia,nij,nja->na", R, C, R)
    expected = stiffness_with(tx200(), constant_compliances(exact, some), some)
    # The same sums, in another order.
    assert_allclose(k, expected, rtol=1e-9)
    laws = stiffness_with(tx200(), exact.compliances(some)[0], some)
    if held_constant(exact):
        # Constants across the axes: 8 % at worst in docs/validation/tx200_stiffness.md.
        assert 0.001 < np.abs(k / laws - 1.0).max() < 0.15
    else:
        assert_allclose(k, laws, rtol=1e-9)
    assert description.calibration is not None
    assert description.calibration.links == "rigid"
    assert "synthetic" in description.calibration.scheme
    assert "synthetic" in description.sources["identified"]


def test_what_is_not_identified_stays_as_it_was(tmp_path: Path) -> None:
    data = readings(truth(), replace(EXACT, off_axis_m=0.0))
    description = with_six_springs(load_description("tx200"), identify(tx200(), data, law="fourier-1"))
    last = description.joint[5]
    assert last.stiffness is None
    assert last.bearing is not None or getattr(last, "bearing_laws", None) is not None
    assert description.calibration is not None
    assert any("j5.ry, j6.rz" in note for note in description.calibration.notes)


@pytest.mark.slow
def test_the_model_file_s_covariance_is_that_of_the_identification(some: np.ndarray) -> None:
    """Through names, file and propagation against the intervals that the identification gives of the flange itself."""
    found = identify(tx200(), readings(truth(), Campaign(), 1), law="fourier-1")
    description = with_six_springs(load_description("tx200"), found)
    u = parameter_uncertainty(parse_description(to_toml(description), "model.toml"))
    assert u is not None
    # Six joints, six directions, three coefficients of ln k each.
    assert len(u.names) == 108
    assert u.undetermined == ()
    model = build_model(u.description, "rigid")
    R = forward_kinematics(model.robot, some).R_flange
    p = predict(tx200(), found, some)
    for axis in range(3):
        # 1/(m - q s) - 1/(m + q s) over 2 m is q s/m, to the second order in s/m, which is below 1 %; of what is
        # propagated, 1.96 are q s/m.
        own = propagate(model, u, some, R[:, :, axis], np.zeros(3)).relative_sd
        assert_allclose(own, (p.high - p.low)[:, axis] / (2.0 * 1.96 * p.value[:, axis]), rtol=2e-3)


def test_directions_without_a_number_or_an_interval_are_left_open() -> None:
    data = readings(truth(), Campaign(), 1)
    found = identify(tx200(), data.select(data.joint != 1), law="table")
    table = with_six_springs(load_description("tx200"), found).calibration.uncertainty  # type: ignore[union-attr]
    assert table is not None
    assert {one.name for one in table.undetermined} == {
        "j2.stiffness",
        *(f"j2.{r}" for r in ("tx", "ty", "tz", "rx", "ry")),
    }
    # A table across the axis is held as its mean compliance: one number with the variance of that mean.
    d = found.directions["j3", "rx"]
    drawn = np.random.default_rng(0).multivariate_normal(d.law.coefficients, d.law.covariance, 4000)  # type: ignore[union-attr]
    mean = np.exp(-drawn @ d.law.functions(d.angle).T).mean(axis=1)  # type: ignore[union-attr]
    k = table.parameters.index("j3.rx")
    # 4000 draws: 1.1 %, three times that, and the second order.
    assert np.sqrt(table.covariance[k][k]) == pytest.approx(mean.std(), rel=0.05)
