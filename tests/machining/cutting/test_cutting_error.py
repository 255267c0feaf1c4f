"""Surface error: compliance times force, signs, invariance, statistics, the tool's bending, the balance with depth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from cutting_cases import CHIP, MILL, SOFT, STIFF, postures, wall_force, wall_task
from posture_cases import dome_task
from refusals import refuses
from rigid_frames import rigid_frame
from scipy.optimize import brentq

import fem
from machining import translational
from machining.cutting import (
    Balance,
    ConstantForce,
    MillingForce,
    ToolBending,
    published,
    slotting,
    statistics_of,
    surface_error,
)
from machining.posture.points import best_postures
from machining.stiffness.objective import Objective
from robots.arrays import Array

F = np.array([40.0, 60.0, -20.0])


def test_deflection_is_compliance_times_force(kr60: fem.ArmModel) -> None:
    task = wall_task()
    q = postures(kr60, task, SOFT)
    e = surface_error(kr60, task, q, ConstantForce(F))
    C = translational(kr60, q, task.tip)
    np.testing.assert_allclose(e.deflection, C @ F, rtol=1e-12)
    np.testing.assert_allclose(e.normal, (C @ F)[:, 1], rtol=1e-12)
    np.testing.assert_allclose(e.total**2, e.normal**2 + e.tangential**2, rtol=1e-12)
    # The form that carries the uncertainty gives the error itself at the nominal numbers.
    form = np.einsum("njk,j,k->n", e.form, e.uncertain.compliance, e.uncertain.force)
    np.testing.assert_allclose(form + e.offset, e.normal, rtol=1e-10)


def test_signs(kr60: fem.ArmModel) -> None:
    """A force out of the part moves the tool out, which leaves material; down milling pushes off its wall."""
    task = wall_task()
    q = postures(kr60, task, STIFF)
    assert (surface_error(kr60, task, q, ConstantForce(np.array([0.0, 50.0, 0.0]))).normal > 0.0).all()
    assert (surface_error(kr60, task, q, ConstantForce(np.array([0.0, -50.0, 0.0]))).normal < 0.0).all()
    assert (surface_error(kr60, task, q, wall_force()).normal > 0.0).all()
    assert (surface_error(kr60, task, q, wall_force(instant="generating")).normal > 0.0).all()


@pytest.mark.parametrize("axes", ["part", "process"])
def test_turning_the_world_changes_nothing(
    kr60: fem.ArmModel, turned_base: Callable[..., fem.ArmModel], rotation: Array, axes: str
) -> None:
    task = dome_task(9, 0.5)
    q = best_postures(kr60, task, Objective("k_fs"), starts=0).q
    T = rigid_frame(R=rotation)
    turned = replace(task, T_base_part=T @ task.T_base_part)
    force = ConstantForce(F, axes)  # type: ignore[arg-type]
    one = surface_error(kr60, task, q, force)
    two = surface_error(turned_base(kr60, rotation), turned, q, force)
    np.testing.assert_allclose(two.normal, one.normal, rtol=1e-9)
    np.testing.assert_allclose(two.sd, one.sd, rtol=1e-9)
    np.testing.assert_allclose(two.deflection, one.deflection @ rotation.T, rtol=1e-8, atol=1e-14)


def test_half_the_springs_twice_the_error(kr60: fem.ArmModel) -> None:
    task = wall_task()
    q = postures(kr60, task, SOFT)
    half = kr60.with_springs({j.name: 0.5 / float(j.axial.compliance(q[:1])[0]) for j in kr60.joints})
    one, two = (surface_error(m, task, q, wall_force()) for m in (kr60, half))
    np.testing.assert_allclose(two.normal, 2.0 * one.normal, rtol=1e-12)


def test_statistics_by_hand() -> None:
    found = statistics_of(np.array([1.0, -3.0, 2.0]), np.array([0.25, 0.5, 0.25]))
    assert {k: float(v) for k, v in found.items()} == pytest.approx(
        {"mean": -0.75, "rms": np.sqrt(0.25 + 4.5 + 1.0), "worst": 3.0, "peak_to_valley": 5.0}, rel=1e-14
    )


def test_statistics_do_not_hang_on_where_the_points_lie(kr60: fem.ArmModel) -> None:
    task = wall_task(41)
    path = task.path
    few = np.r_[0:20:1, 20:41:5]
    thinned = replace(
        task, path=replace(path, **{k: getattr(path, k)[few] for k in ("points", "normals", "axes", "feed")})
    )
    dense, sparse = (surface_error(kr60, t, postures(kr60, t, SOFT), wall_force()) for t in (task, thinned))
    # The trapezoidal rule over gaps of 75 mm on a curve that bends little is off by 1e-4; unweighted it would be 2e-2.
    assert sparse.statistics()["rms"] == pytest.approx(dense.statistics()["rms"], rel=3e-4)
    assert np.sqrt(np.mean(sparse.normal**2)) != pytest.approx(dense.statistics()["rms"], rel=1e-2)


def test_the_tool_bends_as_a_cantilever(kr60: fem.ArmModel) -> None:
    task = wall_task()
    q = postures(kr60, task, STIFF)
    tool = ToolBending(0.040, 0.008, 600e9)
    inertia = np.pi * 0.008**4 / 64.0
    assert tool.compliance == pytest.approx(0.040**3 / (3.0 * 600e9 * inertia), rel=1e-14)
    rigid, bending = (surface_error(kr60, task, q, ConstantForce(F), tool=t) for t in (None, tool))
    extra = bending.deflection - rigid.deflection
    np.testing.assert_allclose(extra, np.tile(tool.compliance * F * [1.0, 1.0, 0.0], (7, 1)), atol=1e-15)


def test_postures_of_another_path_are_refused(kr60: fem.ArmModel) -> None:
    task = wall_task()
    q = postures(kr60, task, SOFT)
    refuses("K008", r"path point 0 \(7 of 7 postures\).*mm", surface_error, kr60, task, q + 0.01, ConstantForce(F))
    refuses("K008", "7, one a path point", surface_error, kr60, task, q[:-1], ConstantForce(F))
    refuses("B001", "", surface_error, kr60, task, np.where(np.arange(6) == 2, np.nan, q), ConstantForce(F))


def test_another_wall_is_refused(kr60: fem.ArmModel) -> None:
    task = wall_task()
    other = replace(task, path=replace(task.path, normals=-task.path.normals))
    q = postures(kr60, task, SOFT)
    refuses("K007", r"180 deg off the wall's", surface_error, kr60, other, q, wall_force(instant="generating"))
    refuses("K007", r"180 deg off the wall's", surface_error, kr60, other, q, wall_force(), balance=Balance())


def test_the_balance_solves_its_equation_at_each_point(kr60: fem.ArmModel) -> None:
    task, force = wall_task(5), wall_force()
    q = postures(kr60, task, SOFT)
    found = surface_error(kr60, task, q, force, balance=Balance(1e-12))
    first = surface_error(kr60, task, q, force)
    C = translational(kr60, q, task.tip)

    def residual(e: float, i: int) -> float:
        at = force.at_depth(task, np.full(5, 0.001 - e)).force[i]
        return float((C[i] @ at)[1] - e)

    roots = [brentq(residual, 0.0, 0.0009, args=(i,), xtol=1e-14) for i in range(5)]
    np.testing.assert_allclose(found.normal, roots, rtol=0, atol=1e-11)
    assert found.balance is not None
    assert 1 < found.balance.rounds < 50
    # Pushed off its wall the mill cuts less deep, and is pushed less.
    assert (found.normal < first.normal).all()
    np.testing.assert_allclose(found.balance.depth, 0.001 - found.normal, atol=1e-11)


def test_the_gain_is_what_a_small_change_leaves(kr60: fem.ArmModel) -> None:
    task = wall_task(4)
    q = postures(kr60, task, SOFT)
    e = surface_error(kr60, task, q, wall_force(), balance=Balance(1e-13))
    # All springs one in a thousand softer: error by the balance anew, and by the form.
    soft = kr60.with_springs({j.name: 1.0 / (1.001 * float(j.axial.compliance(q[:1])[0])) for j in kr60.joints})
    anew = surface_error(soft, task, q, wall_force(), balance=Balance(1e-13)).normal
    compliance = e.uncertain.compliance * np.where(np.arange(7) > 0, 1.001, 1.0)
    by_form = e.offset + np.einsum("njk,j,k->n", e.form, compliance, e.uncertain.force)
    # Second order of 1e-3.
    np.testing.assert_allclose(by_form - e.normal, anew - e.normal, rtol=3e-3)


def test_a_balance_that_does_not_settle_is_said(kr60: fem.ArmModel) -> None:
    task = wall_task(3)
    q = postures(kr60, task, SOFT)
    refuses(
        "K006",
        r"still moving by .* after 2 rounds",
        surface_error,
        kr60,
        task,
        q,
        wall_force(),
        balance=Balance(1e-12, 2),
    )
    refuses("K006", "too heavy", surface_error, kr60, task, q, wall_force(axial=0.03), balance=Balance())
    slot = MillingForce(MILL, slotting(MILL, 0.002, "right"), published("al7075"), feed_per_tooth=CHIP)
    refuses("K006", "peripheral milling", surface_error, kr60, task, q, slot, balance=Balance())
    refuses("K006", "a milling force", surface_error, kr60, task, q, ConstantForce(F), balance=Balance())


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ToolBending(0.0, 0.01, 6e11), "stickout"),
        (lambda: ToolBending(0.04, -0.01, 6e11), "diameter"),
        (lambda: ToolBending(0.04, 0.01, np.nan), "modulus"),
        (lambda: ToolBending(0.04, 0.01, 6e11, 0.9), "standard deviation"),
        (lambda: Balance(0.0), "tolerance"),
        (lambda: Balance(rounds=0), "rounds"),
    ],
)
def test_bad_settings_are_named(make, words: str) -> None:  # type: ignore[no-untyped-def]
    refuses("K005 K006", words, make)
