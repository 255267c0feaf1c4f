"""Published coefficients of one alloy differ: the interval of a predicted error spans what each of the sets says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cutting_cases import CHIP, MILL, SOFT, STIFF, postures, wall_task

import fem
from machining import translational
from machining.cutting import ConstantForce, MillingForce, SurfaceError, down_milling, published, surface_error
from machining.cutting.coefficients import CuttingCoefficients

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
