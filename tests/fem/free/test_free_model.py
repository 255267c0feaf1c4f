"""A model with numbers set free: derivatives against differences, and against models built with other numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses

from fem import ArmModel, build_model, deflection
from fem.free.kinds import KINDS
from fem.free.model import FreeModel, LoadedPoses
from fem.free.parameters import (
    FourierBasis,
    FreeLaw,
    Parameter,
    TableBasis,
    law_parameters,
    named_numbers,
    parameter,
    polynomial_basis,
)
from fem.springs import LawSpring
from robots import ModelDescription, forward_kinematics, load_description

# Second-order differences with steps of 1e-4 of the value; the smallest columns lose digits to the largest.
DIFFERENCES = 2e-6
STEPS = {"coupling": 1e-9, "zero": 1e-5, "load": 1e-4, "tilt": 1e-5, "point": 1e-4, "law": 1e-5}


def _loaded(model: ArmModel, n: int = 15) -> LoadedPoses:
    rng = np.random.default_rng(1)
    low, high = model.robot.limits.T
    q, w = rng.uniform(low, high, (n, model.robot.dof)), rng.normal(size=(n, 6)) * 200.0
    return LoadedPoses(q, w, np.tile(model.robot.T_flange_tool[:3, 3], (n, 1)))


@pytest.fixture(scope="module")
def soft() -> ArmModel:
    return build_model(load_description("xr701")).with_springs({f"j{k}": 1e6 for k in range(1, 7)})


NAMES = (
    "j2.stiffness",
    "j4.rx",
    "j3.ty",
    "j2.rx-rz",
    "base.ry",
    "base.tz",
    "tool.tx",
    "upper-arm.modulus",
    "bar.stiffness",
    "j2.zero",
    "j5.zero",
    "load.x",
    "load.tilt_x",
    "point.z",
)


def _differences(free: FreeModel, u: np.ndarray, k: int, h: float) -> np.ndarray:
    up, down = u.copy(), u.copy()
    up[k] += h
    down[k] -= h
    return (free.evaluate(up)[0] - free.evaluate(down)[0]) / (2.0 * h)


def test_bearing_laws_are_free_by_name_and_change_the_model_they_stand_in(soft: ArmModel) -> None:
    """Coefficients of a law across the axis: displacements of the arm built with them, derivatives of differences."""
    basis = FourierBasis(1, 1)
    law = LawSpring(basis, np.array([14.5, 0.2, -0.1]))
    joints = tuple(replace(j, laws=((3, law), (0, law))) if j.name == "j2" else j for j in soft.joints)
    arm = replace(soft, joints=joints)
    named = named_numbers(arm, ("j2.rx.law[1]", "j2.tx.law[0]", "j3.stiffness"))
    free = FreeModel(arm, named.parameters, _loaded(arm), named.laws)
    np.testing.assert_array_equal(named.u[named.columns[:2]], [0.2, 14.5])
    np.testing.assert_allclose(free.displacement(named.u), deflection(arm, *_parts(free.at)), rtol=1e-12)
    u = named.u.copy()
    u[named.columns[0]] += 0.3
    moved = LawSpring(basis, np.array([14.5, 0.5, -0.1]))
    other = replace(arm, joints=tuple(replace(j, laws=((3, moved), (0, law))) if j.name == "j2" else j for j in joints))
    np.testing.assert_allclose(free.displacement(u), deflection(other, *_parts(free.at)), rtol=1e-9, atol=1e-15)
    _, J = free.evaluate(u)
    for k in range(len(u)):
        expected = _differences(free, u, k, 1e-2 * abs(u[k]) if named.parameters[k].kind.name == "stiffness" else 1e-5)
        assert np.abs(J[:, :, k] - expected).max() <= DIFFERENCES * np.abs(expected).max(), named.parameters[k].name
    refuses("M001", "joints with a law: j2", named_numbers, arm, ("j3.rx.law[0]",))


def _parts(at: LoadedPoses) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return at.q, at.wrench, at.point


@pytest.mark.slow
def test_derivatives_are_those_of_the_displacement(soft: ArmModel) -> None:
    given = [parameter(soft, name) for name in NAMES]
    basis = FourierBasis(2, 2)
    laws = law_parameters(soft, "j3", basis)
    free = FreeModel(soft, (*given, *laws), _loaded(soft, 4), (FreeLaw("j3", basis, len(given)),))
    # Away from the model's own values, so that products of changes count.
    u = free.start + np.array(
        [1e-7 if p.kind.name == "stiffness" else 0.01 * STEPS.get(p.kind.name, 0.0) for p in free.parameters]
    )
    _, J = free.evaluate(u)
    for k, p in enumerate(free.parameters):
        h = STEPS.get(p.kind.name, 1e-2 * abs(u[k]))
        expected = _differences(free, u, k, h)
        assert np.abs(J[:, :, k] - expected).max() <= DIFFERENCES * np.abs(expected).max(), p.name


def test_at_the_models_own_values_nothing_changes(soft: ArmModel) -> None:
    at = _loaded(soft)
    names = [name for name in NAMES if not name.startswith(("base", "tool", "j4.rx", "j3.ty"))]
    free = FreeModel(soft, tuple(parameter(soft, name) for name in names), at)
    expected = deflection(soft, at.q, at.wrench)
    np.testing.assert_allclose(free.evaluate(free.start)[0], expected, atol=1e-12 * np.abs(expected).max())


def test_a_spring_set_free_is_the_model_with_that_spring(soft: ArmModel) -> None:
    at = _loaded(soft)
    free = FreeModel(soft, (parameter(soft, "j2.stiffness"), parameter(soft, "j4.rz")), at)
    found = free.evaluate(np.array([1 / 3e5, 1 / 7e6]))[0]
    expected = deflection(soft.with_springs({"j2": 3e5, "j4": 7e6}), at.q, at.wrench)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


def test_geometry_is_that_of_the_moved_arm(soft: ArmModel) -> None:
    at = _loaded(soft)
    free = FreeModel(soft, tuple(parameter(soft, n) for n in ("j2.zero", "point.z", "load.tilt_y")), at)
    found = free.evaluate(np.array([0.02, 0.05, 0.0]))[0]
    q, point = at.q.copy(), at.point.copy()
    q[:, 1] += 0.02
    point[:, 2] += 0.05
    np.testing.assert_allclose(found, deflection(soft, q, at.wrench, point), rtol=1e-12)


def test_a_load_beside_the_read_point_adds_its_moment(soft: ArmModel) -> None:
    at = _loaded(soft)
    force = at.wrench * [1, 1, 1, 0, 0, 0]
    free = FreeModel(soft, (parameter(soft, "load.z"),), replace(at, wrench=force))
    found = free.evaluate(np.array([0.1]))[0]
    # Reciprocity: the displacement at A by a force at B is that at B by a force at A.
    work = np.sum(force[:, :3] * found[:, :3], axis=1)
    here = deflection(soft, at.q, force, at.point)
    lever = forward_kinematics(soft.robot, at.q).R_flange @ np.array([0.0, 0.0, 0.1])
    of_b = here[:, :3] + np.cross(here[:, 3:], lever)
    np.testing.assert_allclose(work, np.sum(force[:, :3] * of_b, axis=1), rtol=1e-9)
    assert not np.allclose(here, found)


def test_a_flat_law_is_a_constant_spring(soft: ArmModel) -> None:
    at = _loaded(soft)
    bases = [FourierBasis(1, 2), TableBasis(1, np.radians([-35.0, 0.0, 45.0])), polynomial_basis(soft, ("q2_deg",), 6)]
    expected = deflection(soft.with_springs({"j2": 5e5}), at.q, at.wrench)
    for basis in bases:
        laws = law_parameters(soft, "j2", basis)
        free = FreeModel(soft, tuple(laws), at, (FreeLaw("j2", basis, 0),))
        flat = np.array([np.log(5e5) if p.prior is None else 0.0 for p in laws])
        np.testing.assert_allclose(free.evaluate(flat)[0], expected, atol=1e-12 * np.abs(expected).max())


def test_modulus_scales_its_link(soft: ArmModel, boom: Callable[..., ModelDescription]) -> None:
    model = build_model(boom())
    at = _loaded(model, 4)
    E = parameter(model, "tube.modulus")
    free = FreeModel(model, (E,), at)
    np.testing.assert_allclose(
        free.evaluate(np.array([2.0 / E.value]))[0], 2.0 * deflection(model, at.q, at.wrench), rtol=1e-12
    )


@pytest.mark.parametrize(
    "name", ["j9.stiffness", "j2.rw", "elbow.rz", "j2.rx-rx", "pedestal.mass", "", "bar.rz", "load.q"]
)
def test_unknown_names_are_refused_with_those_known(soft: ArmModel, name: str) -> None:
    refuses("M001", "zero", parameter, soft, name)


def test_a_number_cannot_be_free_twice(soft: ArmModel) -> None:
    at = _loaded(soft, 2)
    both = (parameter(soft, "j2.stiffness"), parameter(soft, "j2.rz"))
    refuses("M001", "twice", FreeModel, soft, both, at)
    law = FreeLaw("j2", FourierBasis(1, 1), 1)
    refuses("M001", "law", FreeModel, soft, (both[0], *law_parameters(soft, "j2", law.basis)), at, (law,))


def test_ranges_are_checked() -> None:
    p = Parameter("x", KINDS[0], "j1", (5,), "N m/rad", 1e6, 1e3, 1e9, "compliance")
    assert p.between(1e5, 1e6).inner_bounds == (1e-6, 1e-5)
    for low, high in ((0.0, 1.0), (2.0, 1.0), (1.0, np.inf), (np.nan, 1.0)):
        refuses("M002", "range", p.between, low, high)
    assert p.outer(p.inner(2e5)) == pytest.approx(2e5, rel=1e-15)
