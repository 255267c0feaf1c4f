"""The paper's findings on synthetic samples, for which the verdict is known, and on a real arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from map_findings import (
    LEVELS,
    Finding,
    LayerSample,
    PoseSample,
    Samples,
    distance_finding,
    findings,
    influence,
    influences,
    layer_finding,
    local_ranges,
    model_findings,
    neighbour_finding,
    sample_model,
)
from map_findings_page import findings_figure
from matplotlib.image import imread

from fem import build_model
from robots import load_description, load_robot
from robots.arrays import Array
from stiffarm.pages.style import save_png


def poses(stiffness: object, n: int = 6000, seed: int = 3) -> PoseSample:
    """Points in a half disc of 2 m, a stiffness of (radius, height), the stretch from a shoulder at (0.3, 0.8) m."""
    rng = np.random.default_rng(seed)
    r, z = 2.0 * np.sqrt(rng.uniform(0.0, 1.0, n)), rng.uniform(0.0, 2.0, n)
    points = np.stack([r, np.zeros(n), z], axis=1)
    k = np.asarray(stiffness(r, z, rng))  # type: ignore[operator]
    return PoseSample(points, k, np.hypot(r - 0.3, z - 0.8))


def layers(own: object, other: object, m: int = 800) -> Samples:
    """Stiffness exp(other(b) + own(a, b)) with a the layer coordinate and b another, both even over -1 to 1."""
    rng = np.random.default_rng(1)
    levels = -1.0 + (np.arange(LEVELS) + 0.5) * 2.0 / LEVELS
    a, b = rng.uniform(-1.0, 1.0, (2, m))

    def k(a: Array, b: Array) -> Array:
        return np.asarray(1e6 * np.exp(other(b) + own(a, b)))  # type: ignore[operator]

    sample = PoseSample(np.zeros((m, 3)), k(a, b), np.zeros(m))
    by_a = LayerSample("q4_deg", levels, k(levels[None], b[:, None]))
    by_b = LayerSample("q2_deg", levels, k(a[:, None], levels[None]))
    return Samples(sample, (by_a, by_b), "q4_deg")


def test_a_stiffness_that_falls_with_distance_holds() -> None:
    found = distance_finding(poses(lambda r, z, _: 1e6 / (0.1 + (r - 0.3) ** 2 + (z - 0.8) ** 2)))
    assert found.verdict == "holds"
    assert found.figures["rank_correlation_stretch"] == pytest.approx(-1.0, abs=1e-9)  # a monotone function of it
    assert found.figures["outer_over_inner_third_stretch"] < 0.5
    assert "falls clearly" in found.sentence


def test_a_stiffness_that_rises_with_distance_does_not_hold() -> None:
    found = distance_finding(poses(lambda r, z, _: 1e6 * (0.1 + (r - 0.3) ** 2 + (z - 0.8) ** 2)))
    assert found.verdict == "does not hold"
    assert "rises" in found.sentence


def test_one_of_two_distances_holds_in_part() -> None:
    # Falls with the radius alone: an arm whose height does not matter.
    sample = poses(lambda r, z, _: 1e6 / (0.2 + r))
    found = distance_finding(replace(sample, stretch=np.random.default_rng(0).uniform(1.0, 2.0, len(sample.points))))
    assert found.verdict == "holds in part"
    assert found.figures["rank_correlation_radius"] == pytest.approx(-1.0, abs=1e-9)


@pytest.mark.parametrize("check", [distance_finding, neighbour_finding])
def test_a_uniform_stiffness_tells_nothing(check: object) -> None:
    found: Finding = check(poses(lambda r, z, _: np.full(len(r), 1e6)))  # type: ignore[operator]
    assert found.verdict == "cannot be told"
    assert "hardly varies" in found.sentence
    assert found.figures == {}


def test_distances_that_never_change_tell_nothing() -> None:
    sample = poses(lambda r, z, _: 1e6 * (1.0 + z))
    found = distance_finding(replace(sample, stretch=np.ones(len(sample.points))))
    assert found.verdict == "cannot be told"
    assert "keeps its distance" in found.sentence


def test_noise_puts_soft_beside_stiff() -> None:
    found = neighbour_finding(poses(lambda r, z, rng: 1e6 * np.exp(rng.uniform(-1.0, 1.0, len(r)))))
    assert found.verdict == "holds"
    # Around each place are as many kinds of poses as anywhere; some 60 poses a place spread the percentiles a little.
    assert found.figures["share_of_log_range"] == pytest.approx(1.0, abs=0.06)
    assert found.figures["places_with_both_tenths"] > 0.95


def test_a_gentle_slope_keeps_soft_and_stiff_apart() -> None:
    found = neighbour_finding(poses(lambda r, z, _: 1e6 * np.exp(-r)))
    assert found.verdict == "does not hold"
    # 5 % to 95 % of ln k: 2 (sqrt(0.95) - sqrt(0.05)) = 1.50 over all; within 0.15 m at most 0.3.
    assert found.figures["whole_ratio"] == pytest.approx(np.exp(1.502), rel=0.05)  # four standard errors
    assert found.figures["share_of_log_range"] < 0.2
    assert found.figures["places_with_both_tenths"] == 0.0


def test_a_seam_through_the_middle_holds_in_part() -> None:
    # Stiff below z = 1 m, soft above, in the middle only: near the seam both are within 150 mm.
    def k(r: Array, z: Array, _: object) -> Array:
        return np.asarray(np.where(z < 1.0, 3e6, 1e6) * np.exp(-0.5 * r))

    found = neighbour_finding(poses(k))
    assert found.verdict == "holds in part"
    # A strip of 0.3 m in 2 m of height holds both sides; at its rim percentiles drop the few of the other side.
    assert 0.08 < found.figures["places_with_half_the_range"] < 0.16


def test_too_few_poses_tell_nothing() -> None:
    found = neighbour_finding(poses(lambda r, z, _: 1e6 * np.exp(-r), n=200))
    assert found.verdict == "cannot be told"
    assert "enough poses" in found.sentence


def test_local_ranges_are_those_of_the_poses_around() -> None:
    points = np.concatenate([np.zeros((30, 3)), np.full((30, 3), 5.0)])
    stiffness = np.concatenate([np.linspace(1.0, 3.0, 30), np.full(30, 7.0)])
    found = local_ranges(PoseSample(points, stiffness, np.zeros(60)), np.arange(60), 0.1)
    low, high = np.percentile(stiffness[:30], [5.0, 95.0])
    np.testing.assert_allclose(found.ratio[:30], high / low, rtol=1e-12)  # round-off
    np.testing.assert_allclose(found.ratio[30:], 1.0, rtol=1e-12)


def test_a_coordinate_that_does_nothing_holds() -> None:
    found = layer_finding(layers(lambda a, b: 0.0 * a * b, lambda b: b))
    assert found.verdict == "holds"
    assert found.figures["total_effect"] == pytest.approx(0.0, abs=1e-12)  # round-off
    assert found.figures["rank_among_coordinates"] == 2.0


def test_a_coordinate_that_cancels_on_average_holds_in_part() -> None:
    # a b: no effect on average, as q4 of opposite signs; together with b it is a fifth of the variance.
    found = layer_finding(layers(lambda a, b: a * b, lambda b: 2.0 * b / np.sqrt(3.0)))
    assert found.verdict == "holds in part"
    # Var(a b) = 1/9 against (4/3) / 3 = 4/9 of b: total 1/5. 800 settings and nine levels: a few percent.
    assert found.figures["total_effect"] == pytest.approx(0.2, rel=0.08)
    assert found.figures["main_effect"] < 0.003
    # ln k moves by 2 |b| 8/9 (the outer levels): in the median setting, |b| = 1/2, by 8/9.
    assert found.figures["relative_change_median"] == pytest.approx(np.exp(8.0 / 9.0) - 1.0, rel=0.08)


def test_a_coordinate_that_rules_does_not_hold() -> None:
    found = layer_finding(layers(lambda a, b: 2.0 * a + 0.0 * b, lambda b: b))
    assert found.verdict == "does not hold"
    assert found.figures["rank_among_coordinates"] == 1.0
    # Additive: total and main effect are one, 4/5 of the variance.
    assert found.figures["total_effect"] == pytest.approx(0.8, rel=0.05)  # 800 settings
    assert found.figures["main_effect"] == pytest.approx(0.8, rel=0.05)


def test_settings_where_it_cannot_move_are_left_out() -> None:
    whole = layers(lambda a, b: a * b, lambda b: b).layers[0]
    cut = whole.stiffness.copy()
    cut[::2, 3:] = np.nan
    cut[1::4, 1:] = np.nan
    found = influence(replace(whole, stiffness=cut), 1.0)
    assert np.isfinite([found.total, found.change_median]).all()
    # Its mean effect would be that of the others, which decide what values it can take.
    assert np.isnan(found.main)
    assert influence(replace(whole, stiffness=np.full_like(cut, np.nan)), 1.0).total == 0.0


def test_an_arm_without_a_layer_coordinate_is_not_asked() -> None:
    samples = replace(layers(lambda a, b: a * b, lambda b: b), layer=None)
    found = layer_finding(samples)
    assert found.verdict == "cannot be told"
    assert "no joint" in found.sentence


@pytest.fixture(scope="module")
def kuka() -> Samples:
    return sample_model(build_model(load_description("kr60-3"), links="beam"), n=4000)


def test_findings_of_the_kuka(kuka: Samples) -> None:
    distance, neighbours, layer = findings(kuka)
    # The load's lever about joint 2 is the horizontal distance: stiffness must fall with it.
    assert distance.figures["rank_correlation_radius"] < -0.6
    assert distance.figures["outer_over_inner_third_radius"] < 0.5
    assert layer.claim == "q4 almost without influence"
    # On average next to nothing; at fixed other angles it moves the tool about the forearm, and so its lever.
    assert layer.figures["main_effect"] < 0.01
    assert layer.figures["relative_change_median"] > 0.1
    assert layer.verdict == "holds in part"
    assert neighbours.figures["local_ratio_middle"] < neighbours.figures["whole_ratio"]
    assert set(influences(kuka)) == {"q4_deg", "q2_deg", "q3_deg", "q5_deg"}


def test_joint_1_does_not_matter_to_what_is_sampled(kuka: Samples) -> None:
    robot = load_robot("kr60-3")
    # The sample keeps joint 1 still, so that the points lie in the half plane of the arm but for q4.
    assert np.abs(kuka.poses.points[:, 1]).max() < 0.5
    assert kuka.poses.stretch.max() < 3.0
    assert kuka.poses.radius.max() < 1.1 * kuka.poses.stretch.max() + 1.0
    assert robot.dof == 6


def test_a_coupling_leaves_gaps_and_no_mean_effect() -> None:
    description = load_description("xr701")
    samples = sample_model(build_model(description, links="beam"), n=400)
    layer = next(one for one in samples.layers if one.coordinate == "q3real_deg")
    known = np.isfinite(layer.stiffness)
    # The parallelogram lets the forearm have part of its range at most settings of joint 2.
    assert 0.2 < known.all(axis=1).mean() < 0.9
    found = influences(samples)
    assert np.isnan(found["q3real_deg"].main)
    assert found["q4_deg"].main < found["q4_deg"].total
    assert found["q3real_deg"].total <= 1.0


@pytest.mark.slow
def test_the_figure_is_whole(kuka: Samples, tmp_path: object) -> None:
    path = tmp_path / "findings.png"  # type: ignore[operator]
    save_png(findings_figure(kuka, "KUKA"), path)
    image = imread(path)[..., :3]
    assert (image[:2] == 1.0).all()
    assert (image[-2:] == 1.0).all()
    assert (image[:, -2:] == 1.0).all()  # nothing is cut off


def test_a_rigid_model_cannot_be_told() -> None:
    description = load_description("xr701")
    model = build_model(description, links="rigid")
    samples, found = model_findings(model, n=300)
    assert samples is None
    assert {one.verdict for one in found} == {"cannot be told"}
    assert "rigid" in found[0].sentence
