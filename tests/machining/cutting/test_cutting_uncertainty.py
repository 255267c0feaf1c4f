"""Uncertainty of surface errors and of their difference: exact covariance against models drawn at random."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cutting_cases import CHIP, MILL, SOFT, STIFF, postures, wall_force, wall_task
from refusals import refuses

import fem
import robots
from machining import translational
from machining.cutting import (
    ConstantForce,
    MillingForce,
    SurfaceError,
    ToolBending,
    assumed_uncertainty,
    compare,
    down_milling,
    part_shares,
    published,
    surface_error,
)
from machining.cutting.coefficients import CuttingCoefficients
from machining.cutting.spread import covariance
from machining.task import Task
from robots.arrays import Array

F = np.array([40.0, 60.0, -20.0])
# A standard deviation from n draws is known to 1/sqrt(2 n): 1.1 % here; four times that is allowed.
DRAWS, WITHIN = 4000, 0.045


def pair(model: fem.ArmModel, task: Task, force: object, **options: object) -> tuple[SurfaceError, SurfaceError]:
    out = [surface_error(model, task, postures(model, task, g), force, **options) for g in (SOFT, STIFF)]  # type: ignore[arg-type]
    return out[0], out[1]


def drawn_errors(model: fem.ArmModel, task: Task, rng: np.random.Generator, sd: float) -> tuple[Array, Array]:
    """Errors (DRAWS, n) of both postures, from models whose springs are drawn, and forces drawn with them."""
    q = [postures(model, task, g) for g in (SOFT, STIFF)]
    spring = [j.name for j in model.joints]
    c = np.array([float(j.axial.compliance(q[0][:1])[0]) for j in model.joints])
    # Deflection is linear in compliances: one model for each spring alone.
    alone = [
        model.with_springs({n: 1.0 / c[i] if n == name else np.inf for i, n in enumerate(spring)}) for name in spring
    ]
    factor = 1.0 + sd * rng.standard_normal((DRAWS, len(c)))
    force = F * (1.0 + 0.1 * rng.standard_normal((DRAWS, 3)))
    by_spring = [np.stack([translational(m, p, task.tip)[:, 1] for m in alone]) for p in q]  # (j, n, 3), row y
    errors = [np.einsum("cj,jna,ca->cn", factor, C, force) for C in by_spring]
    return errors[0], errors[1]


def test_shares_of_the_parts_add_up_to_the_compliance(kr60: fem.ArmModel) -> None:
    task = wall_task()
    q = postures(kr60, task, SOFT)
    for model in (kr60, fem.build_model(robots.load_description("kr60-3"))):
        u = assumed_uncertainty(model)
        D = u.influence(model, q, task.tip).D
        np.testing.assert_allclose(D.sum(axis=1), translational(model, q, task.tip), rtol=1e-11, atol=1e-18)
        assert "15 % of each part, independent, assumed" in u.note
    assert set(u.names) > {"j1", "j6"}
    assert len(u.names) > 6  # the links too


def test_shares_of_a_parallelogram_too(poses) -> None:  # type: ignore[no-untyped-def]
    model = fem.build_model(robots.load_description("xr701"))
    q = poses(model.robot, 6, np.random.default_rng(1))
    D = assumed_uncertainty(model).influence(model, q, np.array([0.1, 0.0, 0.3])).D
    np.testing.assert_allclose(
        D.sum(axis=1), translational(model, q, np.array([0.1, 0.0, 0.3])), rtol=1e-10, atol=1e-18
    )


def test_the_standard_deviation_is_that_of_drawn_models(kr60: fem.ArmModel, rng: np.random.Generator) -> None:
    task = wall_task()
    before, after = pair(kr60, task, ConstantForce(F))
    drawn = drawn_errors(kr60, task, rng, 0.15)
    for exact, sample in zip((before, after), drawn, strict=True):
        np.testing.assert_allclose(exact.sd, sample.std(axis=0), rtol=WITHIN)
        np.testing.assert_allclose(exact.normal, sample.mean(axis=0), rtol=0, atol=4.0 * exact.sd.max() / DRAWS**0.5)
        inside = np.mean((sample > exact.band[0]) & (sample < exact.band[1]), axis=0)
        # 95 % to the scatter of 4000 draws, and a little for the product, which is not quite normal.
        np.testing.assert_allclose(inside, 0.95, atol=0.02)


def test_the_difference_is_known_better_than_its_parts(kr60: fem.ArmModel, rng: np.random.Generator) -> None:
    task = wall_task()
    before, after = pair(kr60, task, ConstantForce(F))
    c = compare(before, after, rng)
    drawn = drawn_errors(kr60, task, rng, 0.15)
    np.testing.assert_allclose(c.sd, (drawn[0] - drawn[1]).std(axis=0), rtol=WITHIN)
    # Same springs, same force: less than if the two were independent.
    assert (c.sd < 0.9 * np.hypot(before.sd, after.sd)).all()
    ratio = np.sqrt((drawn[0] ** 2) @ before.weight) / np.sqrt((drawn[1] ** 2) @ after.weight)
    change = c.changes["rms"]
    low, high = np.quantile(ratio, [0.025, 0.975])
    # Ends of intervals by two samples of 4000: some 5 % of the half-width.
    assert change.factor.low == pytest.approx(low, abs=0.08 * (high - low))
    assert change.factor.high == pytest.approx(high, abs=0.08 * (high - low))
    assert change.verdict == "smaller"
    assert "falls from" in change.sentence
    assert "assumed" in c.sentence


def test_covariance_of_points_and_linear_statistic(kr60: fem.ArmModel, rng: np.random.Generator) -> None:
    task = wall_task()
    e, _ = pair(kr60, task, wall_force())
    V = e.covariance()
    np.testing.assert_allclose(np.sqrt(np.diag(V)), e.sd, rtol=1e-9)
    sample = e.sample(e.uncertain.draws(DRAWS, rng))
    np.testing.assert_allclose(np.sqrt(e.weight @ V @ e.weight), (sample @ e.weight).std(), rtol=WITHIN)
    mean = e.estimated(rng)["mean"]
    assert mean.high - mean.low == pytest.approx(2 * 1.96 * np.sqrt(e.weight @ V @ e.weight), rel=0.08)


def test_parts_of_the_uncertainty(kr60: fem.ArmModel) -> None:
    """Springs and force add as squares, but for the product of the two, which is of fourth order."""
    task = wall_task()
    e, _ = pair(kr60, task, wall_force())
    assert (e.sd**2 >= e.sd_stiffness**2 + e.sd_force**2).all()
    np.testing.assert_allclose(e.sd**2, e.sd_stiffness**2 + e.sd_force**2, rtol=0.02)
    sure, _ = pair(kr60, task, wall_force(relative_sd=0.0), stiffness=assumed_uncertainty(kr60, 0.0))
    np.testing.assert_array_equal(sure.sd, 0.0)


def test_one_factor_common_to_all_cancels_in_the_ratio(kr60: fem.ArmModel, rng: np.random.Generator) -> None:
    """A force known in direction but not in size: the ratio is exact, and so is the verdict."""
    task = wall_task()
    force = ConstantForce(F, covariance=np.outer(0.3 * F, 0.3 * F))
    c = compare(*pair(kr60, task, force, stiffness=assumed_uncertainty(kr60, 0.0)), rng)
    rms = c.changes["rms"]
    # By rounding a covariance of rank one has others of some 1e-16 of it: directions are off by the root of that.
    assert rms.factor.low == pytest.approx(rms.factor.value, rel=1e-7)
    assert rms.factor.high == pytest.approx(rms.factor.value, rel=1e-7)
    assert rms.before.high > 1.5 * rms.before.value


def test_no_change_cannot_be_told(kr60: fem.ArmModel, rng: np.random.Generator) -> None:
    task = wall_task()
    e, _ = pair(kr60, task, wall_force())
    same = compare(e, e, rng).changes["rms"]
    assert (same.factor.low, same.factor.value, same.factor.high) == (1.0, 1.0, 1.0)
    assert same.verdict == "cannot tell"
    assert "cannot be told" in same.sentence
    back = compare(*pair(kr60, task, wall_force())[::-1], rng).changes["rms"]
    assert back.verdict == "larger"
    assert "grows" in back.sentence
    assert "nan" not in back.sentence


def test_a_rigid_arm_has_no_error(kr60: fem.ArmModel, rng: np.random.Generator) -> None:
    task = wall_task()
    q = postures(kr60, task, SOFT)
    none = part_shares((), np.zeros(0), "nothing deflects")
    e = surface_error(kr60.with_rigid_joints(), task, q, ConstantForce(F), stiffness=none)
    change = compare(e, e, rng).changes["rms"]
    assert change.verdict == "no error"
    assert change.sentence == "No RMS surface error: nothing deflects under this force."


def test_unlike_things_are_not_compared(kr60: fem.ArmModel, rng: np.random.Generator) -> None:
    task = wall_task()
    e, a = pair(kr60, task, wall_force())
    up = replace(wall_force(), engagement=replace(wall_force().engagement, entry=0.0, exit=0.6, wall="left"))
    other = [
        pair(kr60, task, wall_force(relative_sd=0.2))[1],
        pair(kr60, task, wall_force(), stiffness=assumed_uncertainty(kr60, 0.1))[1],
        pair(kr60, task, up)[1],
        pair(kr60, task, wall_force(), tool=ToolBending(0.04, 0.008, 6e11))[1],
    ]
    for one in other:
        refuses("K008", "model, force or their uncertainties differ", compare, e, one, rng)
    refuses("K008", "paths differ", compare, e, pair(kr60, wall_task(6), wall_force())[1], rng)
    assert compare(e, a, rng).changes["worst"].verdict == "smaller"


def test_the_tool_s_uncertainty_is_common(kr60: fem.ArmModel) -> None:
    task = wall_task()
    force = ConstantForce(F, relative_sd=0.0)
    options = {"stiffness": assumed_uncertainty(kr60, 0.0), "tool": ToolBending(0.04, 0.008, 6e11, 0.2)}
    e, a = pair(kr60, task, force, **options)
    expected = 0.2 * options["tool"].compliance * F[1]  # type: ignore[attr-defined]
    np.testing.assert_allclose(e.sd, expected, rtol=1e-9)
    form = e.form - a.form
    # It is the same in both postures, so nothing of it is left in the difference.
    np.testing.assert_allclose(covariance(e.uncertain, form, form), 0.0, atol=(1e-6 * expected) ** 2)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"relative_sd": 0.6}, "0 to 0.33"),
        ({"relative_sd": -0.1}, "0 to 0.33"),
        ({"relative_sd": np.nan}, "0 to 0.33"),
        ({"by_part": {"j9": 0.1}}, "j9"),
    ],
)
def test_bad_shares_are_named(kr60: fem.ArmModel, options: dict[str, object], words: str) -> None:
    refuses("M013", words, assumed_uncertainty, kr60, **options)


def test_shares_by_part_are_said(kr60: fem.ArmModel) -> None:
    u = assumed_uncertainty(kr60, 0.1, {"j2": 0.05})
    assert u.sd.tolist() == [0.1, 0.05, 0.1, 0.1, 0.1, 0.1]
    assert u.note.endswith("10 % of each part, independent, as stated; but j2 5 %")


def test_what_gets_worse_is_told_beside_what_gets_better(kr60: fem.ArmModel, rng: np.random.Generator) -> None:
    found = compare(*pair(kr60, wall_task(), wall_force()), rng)
    one = found.changes["rms"]
    changes = {
        "rms": one,
        "peak_to_valley": replace(one, statistic="peak_to_valley", verdict="larger"),
        "worst": replace(one, statistic="worst", verdict="cannot tell"),
    }
    assert one.verdict == "smaller"
    mixed = replace(found, changes=changes)
    assert len(mixed.against) == 1
    assert mixed.against[0] in mixed.sentence
    assert mixed.against[0].startswith("But the peak-to-valley surface error")


# ------------------------------------------------------------
# Published coefficients of one alloy differ: the interval of a predicted error spans what each of the sets says

SETS = ("al7075-t6", "al7075")


def cut(model: fem.ArmModel, gamma: float, coefficients: CuttingCoefficients, depth: float = 0.004) -> SurfaceError:
    """Errors of the wall of a cut 4 mm wide."""
    task = wall_task(3)
    force = MillingForce(MILL, down_milling(MILL, depth, 0.004), coefficients, feed_per_tooth=CHIP)
    return surface_error(model, task, postures(model, task, gamma), force)


@pytest.mark.parametrize("gamma", [SOFT, STIFF])
def test_the_interval_spans_both_sets_of_the_alloy(kr60: fem.ArmModel, gamma: float) -> None:
    errors = {name: cut(kr60, gamma, published(name)) for name in SETS}
    for name, other in (SETS, SETS[::-1]):
        one, far = errors[name], errors[other].normal
        low, high = one.band
        assert ((low <= far) & (far <= high)).all()
        assert any("not measured" in note and "1 more published" in note for note in one.uncertain.notes)
        # Of one's own figures, or with the other set left out, the interval is the narrower one.
        own = cut(kr60, gamma, replace(published(name), others=None))
        assert (own.sd < one.sd).all()


def test_sets_that_are_415_um_apart_at_one_pose_are_spanned(kr60: fem.ArmModel) -> None:
    """Errors are linear in the depth of the cut: the one at which the two sets are so far apart at the path's end."""
    apart = np.abs(np.subtract(*(cut(kr60, STIFF, published(name)).normal[-1] for name in SETS)))
    depth = 0.004 * 415e-6 / float(apart)
    assert depth < 0.025
    first, other = (cut(kr60, STIFF, published(name), depth) for name in SETS)
    assert abs(first.normal[-1] - other.normal[-1]) == pytest.approx(415e-6, rel=0.02)
    assert first.band[0][-1] < other.normal[-1] < first.band[1][-1]
    own = cut(kr60, STIFF, replace(published(SETS[0]), others=None), depth)
    assert own.band[1][-1] < other.normal[-1], "one source alone is surer than two sources allow"


def test_a_measured_force_is_as_uncertain_as_it_was_measured(kr60: fem.ArmModel) -> None:
    """With an arm that is known exactly the error's deviation is that of the force through the arm's compliance."""
    task = wall_task(3)
    q = postures(kr60, task, SOFT)
    F, sd = np.array([120.0, 60.0, -20.0]), 4.0
    measured = surface_error(kr60, task, q, ConstantForce(F, "base", covariance=sd**2 * np.eye(3)))
    row = translational(kr60, q, task.tip)[:, 1]
    exact = surface_error(kr60, task, q, ConstantForce(F, "base", covariance=np.zeros((3, 3))))
    np.testing.assert_allclose(measured.normal, exact.normal, rtol=1e-12)
    # Springs and force are independent: variances add, but for their product of 15 % times 3 %.
    both = np.hypot(exact.sd, sd * np.linalg.norm(row, axis=1))
    np.testing.assert_allclose(measured.sd, both, rtol=0.02)
