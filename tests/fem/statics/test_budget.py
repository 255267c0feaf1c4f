"""The compliance budget: shares of the strain energy against displacements and against the shells' own energies."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses

from fem import ArmModel, arm_fields, build_model, compliance_budget, deflection, deflection_by_part
from fem.statics.budget import whole_joints
from robots import ModelDescription, Robot, load_description
from robots.arrays import Array

W = np.array([300.0, -200.0, -650.0, 40.0, -30.0, 50.0])
DOWN = np.array([0.0, 0.0, -650.0, 0.0, 0.0, 0.0])
# Sums of the same few products in another order.
ROUND_OFF = 1e-12


@pytest.fixture(scope="module")
def coarse() -> Iterator[ArmModel]:
    """The xr701 with shells of 12 elements around: its mechanics does not depend on how fine they are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("meshes.casings.AROUND", 12)
        patch.setattr("meshes.casings.AROUND_WITH_OPENINGS", 12)
        yield build_model(load_description("xr701"), "shell")


@pytest.mark.parametrize("name", ["xr701", "kr60-3", "tx200"])
def test_shares_add_up_and_are_those_of_the_displacement_along_the_load(
    name: str,
    reachable: Callable[[Robot, int, np.random.Generator], Array],
    soften: Callable[..., ArmModel],
    rng: np.random.Generator,
) -> None:
    model = soften(build_model(load_description(name)), rng, other=True)
    q = reachable(model.robot, 50, rng)
    for wrench in (DOWN, W, rng.normal(size=(50, 6))):
        budget = compliance_budget(model, q, wrench)
        loads = np.broadcast_to(wrench, (50, 6))
        work = np.einsum("ni,ni->n", loads, deflection(model, q, wrench))
        assert budget.energy == pytest.approx(0.5 * work, rel=ROUND_OFF)
        assert budget.share.shape == (50, len(budget.parts)) == (50, len(budget.kinds))
        assert budget.share.sum(axis=1) == pytest.approx(np.ones(50), rel=ROUND_OFF)
        assert (budget.share >= 0.0).all()
        parts = whole_joints(model, deflection_by_part(model, q, wrench))
        assert budget.parts == tuple(parts)
        np.testing.assert_allclose(sum(parts.values()), deflection(model, q, wrench), rtol=0.0, atol=1e-14)  # m, rad
        for column, part in enumerate(budget.parts):
            along = np.einsum("ni,ni->n", loads, parts[part])
            assert budget.share[:, column] == pytest.approx(along / work, abs=ROUND_OFF)
            # Before the clipping too: nothing releases energy.
            assert (along > -ROUND_OFF * work).all()


def test_shares_do_not_depend_on_the_size_of_the_load(rng: np.random.Generator) -> None:
    model = build_model(load_description("kr60-3"))
    q = rng.uniform(-0.5, 0.5, (5, 6))
    one, other = compliance_budget(model, q, DOWN), compliance_budget(model, q, 1e-3 * DOWN)
    assert other.share == pytest.approx(one.share, abs=ROUND_OFF)
    assert other.energy == pytest.approx(1e-6 * one.energy, rel=ROUND_OFF)


@pytest.mark.parametrize("path", ["parallelogram", "serial"])
def test_shells_store_what_the_budget_says(
    path: str, coarse: ArmModel, soften: Callable[..., ArmModel], rng: np.random.Generator
) -> None:
    model = coarse if path == "parallelogram" else replace(coarse, load_path="serial", bar=None)
    model = soften(model, rng)
    q = np.radians([20.0, 5.0, 77.5, 30.0, -40.0, 10.0])
    budget = compliance_budget(model, q[None], W)
    energy = arm_fields(model, q, W).energy_by_part
    assert set(energy) == set(budget.parts)
    total = float(budget.energy[0])
    for part, value in zip(budget.parts, budget.part_energy[0], strict=True):
        # Quadratic forms of the elements' matrices against condensed ones: measured 3e-11 of the total.
        assert energy[part] == pytest.approx(value, rel=1e-8, abs=1e-8 * total), part


def test_a_cantilever_by_hand(boom: Callable[..., ModelDescription]) -> None:
    """Bending of a tube on a spring: F^2 l^3 / 6EI + shear against (F l)^2 / 2k."""
    length, k, force = 1.5, 2e5, 700.0
    model = build_model(boom(length=length, stiffness=k))
    budget = compliance_budget(model, np.zeros((1, 1)), np.array([0.0, 0.0, -force, 0.0, 0.0, 0.0]))
    spring = dict(zip(budget.parts, budget.part_energy[0], strict=True))["j1"]
    assert spring == pytest.approx((force * length) ** 2 / (2.0 * k), rel=ROUND_OFF)
    inertia = np.pi / 64.0 * (0.1**4 - 0.08**4)
    bending = force**2 * length**3 / (6.0 * 200e9 * inertia)
    # A slender tube (15 diameters): shear adds 0.6 %.
    assert budget.part_energy[0].sum() - spring == pytest.approx(bending, rel=0.01)


def test_kinds_of_parts(soften: Callable[..., ArmModel], rng: np.random.Generator) -> None:
    model = soften(build_model(load_description("xr701")), rng, other=True)
    budget = compliance_budget(model, np.radians([[0.0, 5.0, 77.5, 0.0, 0.0, 0.0]]), DOWN)
    kinds = dict(zip(budget.parts, budget.kinds, strict=True))
    assert kinds["forearm"] == "link"
    assert kinds["j3"] == kinds["j3 other directions"] == "joint"
    assert kinds["bar"] == kinds["crank"] == "parallelogram"
    assert kinds["base"] == kinds["tool"] == "other"
    together = sum(budget.of_kind(kind) for kind in ("link", "joint", "parallelogram", "other"))
    assert together == pytest.approx(np.ones(1), rel=ROUND_OFF)


def test_a_joint_whose_bearing_is_coupled_with_its_axis_is_one_part(
    reachable: Callable[[Robot, int, np.random.Generator], Array],
    soften: Callable[..., ArmModel],
    rng: np.random.Generator,
) -> None:
    model = soften(build_model(load_description("kr60-3")), rng, other=True)
    assert all(joint.is_coupled for joint in model.joints)
    q = reachable(model.robot, 50, rng)
    parts = deflection_by_part(model, q, W)
    # Taken alone, some bearing would release energy: that is why.
    alone = [parts[f"{joint.name} other directions"] @ W for joint in model.joints]
    assert np.min(alone) < 0.0
    budget = compliance_budget(model, q, W)
    assert not [name for name in budget.parts if name.endswith("other directions")]
    assert (budget.share >= 0.0).all()


def test_what_cannot_be_is_refused(rng: np.random.Generator) -> None:
    model = build_model(load_description("kr60-3"))
    q = np.radians([[0.0, -70.0, 60.0, 0.0, 60.0, 0.0]])
    refuses("M005", "nothing deflects", compliance_budget, model, q, np.zeros(6))
    rigid = build_model(load_description("kr60-3"), "rigid").with_rigid_joints()
    refuses("M005", "nothing deflects", compliance_budget, rigid, q, DOWN)
    forearm = next(link for link in model.links if link.name == "forearm")
    wrong = replace(forearm, element=replace(forearm.element, flexibility=-forearm.element.flexibility))
    links = tuple(wrong if link is forearm else link for link in model.links)
    refuses("M005", "part forearm at pose 0: strain energy", compliance_budget, replace(model, links=links), q, DOWN)

    class Runaway:
        def compliance(self, q: Array) -> Array:
            return np.full(len(q), np.inf)

    refuses("M005", "not finite", compliance_budget, model.with_springs({"j2": Runaway()}), q, DOWN)
