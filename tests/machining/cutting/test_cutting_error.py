"""Surface error: compliance times force, signs, invariance, statistics, the tool's bending, the balance with depth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from cutting_cases import CHIP, MILL, SOFT, STIFF, postures, wall_force, wall_task
from posture_cases import dome_task, part, spindle
from refusals import refuses
from rigid_frames import rigid_frame
from scipy.optimize import brentq

import fem
from fem.springs import LawSpring
from machining import translational
from machining.cutting import (
    Balance,
    ConstantForce,
    MillingForce,
    ToolBending,
    calibrated_uncertainty,
    process_axes,
    published,
    slotting,
    statistics_of,
    surface_error,
)
from machining.cutting.process_axes import weights
from machining.cutting.surface_error import cutting_deflection
from machining.posture.points import best_postures
from machining.stiffness.objective import Objective
from machining.task import Task, tool_path
from robots import ModelDescription, load_description
from robots.arrays import Array
from robots.library.models import parse_description, to_toml
from robots.schema.description import Calibration, LogFourierLaw
from robots.schema.springs import BearingLaws
from robots.schema.uncertainty import CalibrationUncertainty

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


# ------------------------------------------------------------
# Feed, cross-feed and tool axis along a path, and constant forces given in them


def task_of(points: object, axes: object = (0.0, 0.0, 1.0)) -> Task:
    return Task(tool_path(points, axes, axes), spindle(), part(), np.array([0.3, 0.2, 0.1]))  # type: ignore[arg-type]


def test_a_straight_path_has_the_axes_of_the_book() -> None:
    axes = process_axes(wall_task())
    np.testing.assert_allclose(axes.feed, np.tile([1.0, 0.0, 0.0], (7, 1)), atol=1e-15)
    np.testing.assert_allclose(axes.cross, np.tile([0.0, 1.0, 0.0], (7, 1)), atol=1e-15)
    assert not axes.corner.any()


def test_axes_are_right_handed_and_turn_with_the_part(rotation: Array) -> None:
    task = dome_task(15)
    axes = process_axes(task).columns
    np.testing.assert_allclose(np.swapaxes(axes, 1, 2) @ axes, np.tile(np.eye(3), (15, 1, 1)), atol=1e-13)
    np.testing.assert_allclose(np.linalg.det(axes), 1.0, rtol=1e-13)
    T = rigid_frame(R=rotation)
    turned = process_axes(replace(task, T_base_part=T @ task.T_base_part))
    np.testing.assert_allclose(turned.columns, rotation @ axes, atol=1e-12)


def test_at_a_corner_the_feed_is_that_of_the_move_that_ends_there() -> None:
    axes = process_axes(task_of([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0.1, 0.2, 0.0]]))
    np.testing.assert_allclose(axes.feed, [[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]], atol=1e-15)
    assert axes.corner.tolist() == [False, True, False, False]


def test_on_a_circle_the_feed_is_tangent_but_for_the_ends() -> None:
    step, n = 0.05, 20
    angle = step * np.arange(n)
    axes = process_axes(task_of(np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)))
    tangent = np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)
    np.testing.assert_allclose(axes.feed[1:-1], tangent[1:-1], atol=1e-13)
    # A chord leaves its end by half the step.
    turned = np.arccos(np.einsum("ni,ni->n", axes.feed, tangent)[[0, -1]])
    np.testing.assert_allclose(turned, 0.5 * step, rtol=1e-6)


def test_a_sloping_move_feeds_across_the_tool() -> None:
    axes = process_axes(task_of([[0, 0, 0], [0.1, 0, -0.1]]))
    np.testing.assert_allclose(axes.feed, [[1, 0, 0], [1, 0, 0]], atol=1e-15)


def test_a_path_of_one_point_has_no_feed_but_takes_a_force_in_other_axes() -> None:
    task = task_of([[0.0, 0.0, 0.0]])
    refuses("K007", "path of 2 points or more", process_axes, task)
    for axes in ("base", "part"):
        assert ConstantForce(np.array([1.0, 2.0, 3.0]), axes).along(task).force.shape == (1, 3)  # type: ignore[arg-type]


def test_a_plunge_is_named() -> None:
    refuses("K007", "path point 2", process_axes, task_of([[0, 0, 0], [0.1, 0, 0], [0.1, 0, -0.1], [0.1, 0.0, -0.2]]))


def test_a_constant_force_is_expressed_in_its_axes(rotation: Array) -> None:
    task = dome_task(9)
    T = rigid_frame(R=rotation)
    task = replace(task, T_base_part=task.T_base_part @ T)
    F = np.array([10.0, -20.0, 5.0])
    np.testing.assert_allclose(ConstantForce(F).along(task).force, np.tile(F, (9, 1)), atol=1e-14)
    np.testing.assert_allclose(ConstantForce(F, "part").along(task).force, np.tile(rotation @ F, (9, 1)), atol=1e-12)
    axes, along = process_axes(task), ConstantForce(F, "process").along(task)
    expected = 10.0 * axes.feed - 20.0 * axes.cross + 5.0 * axes.tool
    np.testing.assert_allclose(along.force, expected, atol=1e-12)
    assert along.names == ("F_feed", "F_cross", "F_axis")


def test_weights_are_the_trapezoidal_rule() -> None:
    path = tool_path([[0, 0, 0], [0.1, 0, 0], [0.4, 0, 0]], [0, 0, 1])
    np.testing.assert_allclose(path.arc_length, [0.0, 0.1, 0.4])
    np.testing.assert_allclose(weights(path), [0.125, 0.5, 0.375])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"components": np.zeros(3)}, "not all zero"),
        ({"components": np.array([1.0, np.nan, 0.0])}, "finite"),
        ({"components": np.ones(2)}, "3 finite"),
        ({"components": np.ones(3), "axes": "tool"}, "base, part, process"),
        ({"components": np.ones(3), "relative_sd": np.inf}, "standard deviation"),
        ({"components": np.ones(3), "covariance": np.array([[1, 2, 0], [2, 1, 0], [0, 0, 1.0]])}, "negative variance"),
        ({"components": np.ones(3), "covariance": np.eye(2)}, "shape"),
    ],
)
def test_bad_forces_are_named(options: dict[str, object], words: str) -> None:
    refuses("K005", words, ConstantForce, **options)


# ------------------------------------------------------------
# Springs over angles with a covariance: the surface error's spread against arms built with drawn laws

# A standard deviation from n draws is known to 1/sqrt(2 n): 1.1 % here; four times that is allowed, and the second
# order of ln k with a standard deviation of 0.08, below 1 %.
DRAWS, WITHIN = 4000, 0.055
NAMES = ("j2.law[0]", "j2.law[1]", "j2.law[2]", "j3.rx.law[0]", "j3.rx.law[1]", "j3.rx.law[2]")
LAWS = ((13.7, 0.2, -0.1), (14.2, -0.3, 0.1))


def described() -> tuple[ModelDescription, np.ndarray]:
    """KR60-3 with a law about joint 2 and one across joint 3, and the covariance of their coefficients."""
    given = load_description("kr60-3")
    axial, across = (
        LogFourierLaw(kind="log-fourier", input=name, coefficients=c, source="assumed")
        for name, c in zip(("q2_deg", "q3_deg"), LAWS, strict=True)
    )
    joints = tuple(
        j.model_copy(update={"stiffness": axial if j.name == "j2" else None})
        if j.name != "j3"
        else j.model_copy(update={"bearing_laws": BearingLaws(rx=across), "stiffness": None})
        for j in given.joint
    )
    rng = np.random.default_rng(0)
    root = 0.04 * rng.normal(size=(6, 6))
    V = root @ root.T / 2.0
    table = CalibrationUncertainty(
        parameters=NAMES,
        unit=("ln(N m/rad)",) * 6,
        variable=("value",) * 6,
        estimate=(*LAWS[0], *LAWS[1]),
        covariance=tuple(map(tuple, V.tolist())),
        degrees_of_freedom=(1e6,) * 6,
        status=("determined",) * 6,
        note="made up",
    )
    origin = Calibration(
        scheme="made up",
        load_path=given.load_path,
        links="rigid",
        data="made up",
        data_sha256="0" * 64,
        rms_mm=0.01,
        loads_N=(),
        uncertainty=table,
    )
    made = given.model_copy(update={"joint": joints, "calibration": origin})
    return parse_description(to_toml(made), "model.toml"), V


def test_laws_about_and_across_the_axes_are_carried_to_the_error(rng: np.random.Generator) -> None:
    description, V = described()
    model = fem.build_model(description, "rigid")
    arm = calibrated_uncertainty(model, description)
    assert arm is not None
    task = wall_task(4)
    q = postures(model, task, SOFT)
    error = surface_error(model, task, q, ConstantForce(F, relative_sd=0.0), stiffness=arm)
    drawn = rng.multivariate_normal([*LAWS[0], *LAWS[1]], V, DRAWS)
    # Deflection is a sum over springs: each law's share of the joint, scaled by its drawn compliance.
    parts, own = [], []
    for number, (name, coefficients) in enumerate(zip(("j2", "j3"), LAWS, strict=True)):
        bare = model.with_rigid_joints()
        one = next(j for j in model.joints if j.name == name)
        alone = replace(bare, joints=tuple(one if j.name == name else j for j in bare.joints))
        spring = one.axial if name == "j2" else one.laws[0][1]
        assert isinstance(spring, LawSpring)
        ratio = np.exp(-(drawn[:, 3 * number : 3 * number + 3] - coefficients) @ spring.basis(q).T)
        own.append(fem.deflection(alone, q, np.r_[F, 0, 0, 0], task.tip)[:, 1])
        parts.append(ratio * own[-1])
    np.testing.assert_allclose(error.normal, own[0] + own[1], rtol=1e-9)
    np.testing.assert_allclose(error.sd, (parts[0] + parts[1]).std(axis=0), rtol=WITHIN)
    assert not error.is_rough


@pytest.mark.parametrize("relative", [1.0, 4.0])
def test_the_spread_is_that_of_the_covariance(relative: float) -> None:
    description, _ = described()
    origin = description.calibration
    assert origin is not None
    assert origin.uncertainty is not None
    V = relative * np.array(origin.uncertainty.covariance)
    table = origin.uncertainty.model_copy(update={"covariance": tuple(map(tuple, V.tolist()))})
    wider = description.model_copy(update={"calibration": origin.model_copy(update={"uncertainty": table})})
    model = fem.build_model(description, "rigid")
    sd = []
    for one in (description, wider):
        arm = calibrated_uncertainty(model, one)
        assert arm is not None
        task = wall_task(3)
        q = postures(model, task, SOFT)
        sd.append(surface_error(model, task, q, ConstantForce(F, relative_sd=0.0), stiffness=arm).sd)
    np.testing.assert_allclose(sd[1], np.sqrt(relative) * sd[0], rtol=1e-9)


def test_points_in_memory_at_once_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    description, _ = described()
    model = fem.build_model(description, "rigid")
    arm = calibrated_uncertainty(model, description)
    task = wall_task(7)
    q = postures(model, task, SOFT)
    tool = ToolBending(0.04, 0.008, 6e11)
    whole = surface_error(model, task, q, ConstantForce(F), stiffness=arm, tool=tool)
    # The package has a function of the module's name.
    monkeypatch.setattr(import_module("machining.cutting.surface_error"), "AT_ONCE", 3)
    in_parts = surface_error(model, task, q, ConstantForce(F), stiffness=arm, tool=tool)
    # Sums in another order: round-off.
    np.testing.assert_allclose(in_parts.form, whole.form, rtol=1e-9, atol=1e-12 * np.abs(whole.form).max())
    np.testing.assert_allclose(in_parts.sd, whole.sd, rtol=1e-9)
    moved = cutting_deflection(model, task, q, whole.force, tool)
    np.testing.assert_array_equal(moved, whole.deflection)
