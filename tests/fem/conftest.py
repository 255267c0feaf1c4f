"""What the tests of the mechanics share: small robots, random poses and random springs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fem import ArmModel
from fem.model import JointPart
from fem.springs import FourierBasis, LawSpring
from robots import ModelDescription, Robot
from robots.arrays import Array
from robots.library.models import parse_description

BOOM = """
schema = "stiffarm-model/1"
name = "boom"
title = "a tube along x, {length} m, turning about y at its root"
sources = {{}}
[materials.steel]
youngs_modulus = {{ value = 200, unit = "GPa", source = "assumed" }}
poissons_ratio = {{ value = 0.25, unit = "1", source = "assumed" }}
density = {{ value = 7850, unit = "kg/m^3", source = "assumed" }}
[[joint]]
name = "j1"
coordinate = "q1_deg"
limits = {{ value = [-180, 180], unit = "deg", source = "assumed" }}
frame = {{ xyz = {{ value = [0, 0, 0.5], unit = "m", source = "assumed" }}, axis = [0, 1, 0] }}
{springs}
[flange]
xyz = {{ value = [{length}, 0, 0], unit = "m", source = "assumed" }}
[[link]]
name = "tube"
body = "j1"
material = "steel"
[link.section]
kind = "tube"
diameter = {{ value = 100, unit = "mm", source = "assumed" }}
wall = {{ value = 10, unit = "mm", source = "assumed" }}
"""


@pytest.fixture(scope="session")
def boom() -> Callable[..., ModelDescription]:
    """Description of a one-joint robot; keywords are springs of the joint in SI units."""
    units = {"stiffness": "N m/rad", "tilt_stiffness": "N m/rad", "translational_stiffness": "N/m"}

    def build(length: float = 1.5, **springs: float) -> ModelDescription:
        lines = [
            f'{name} = {{ value = {value}, unit = "{units[name]}", source = "assumed" }}'
            for name, value in springs.items()
        ]
        return parse_description(BOOM.format(length=length, springs="\n".join(lines)), "boom")

    return build


@pytest.fixture(scope="session")
def reachable() -> Callable[..., Array]:
    """Draw n random poses within a robot's limits and couplings, rad."""

    def draw(robot: Robot, n: int, rng: np.random.Generator) -> Array:
        q = rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (4 * n + 20, robot.dof))
        q = q[robot.reachable(q)][:n]
        assert len(q) == n
        return q

    return draw


def _compliance(rng: np.random.Generator, turn: float) -> Array:
    """A full compliance matrix (6, 6), positive definite: shifts up to 1e-8 m/N, turns up to ``turn`` rad/(N m)."""
    size = np.sqrt(np.array([1e-8] * 3 + [turn] * 3) * 10.0 ** -rng.uniform(0.0, 2.0, 6))
    mix = rng.normal(size=(6, 6))
    C = mix @ mix.T + 2.0 * np.eye(6)
    d = np.sqrt(np.diag(C))
    return np.asarray(size[:, None] * (C / np.outer(d, d)) * size)


def _bearing(model: ArmModel, joint: JointPart, rng: np.random.Generator) -> Array:
    """A bearing whose directions are coupled; with the axis too, but at a parallelogram's joints."""
    bearing = _compliance(rng, 1e-5)
    # The axial spring takes the last diagonal entry's place, so the couplings are scaled to it.
    bearing[5] *= np.sqrt(joint.axial.compliance(np.zeros((1, model.robot.dof)))[0] / bearing[5, 5])
    bearing[:, 5] = bearing[5]
    bearing[5, 5] = 0.0
    p = model.robot.parallelogram
    if p is not None and joint.joint in (p.driven, p.crank_about):
        bearing[5] = bearing[:, 5] = 0.0
    return bearing


@pytest.fixture(scope="session")
def soften() -> Callable[..., ArmModel]:
    """Give every joint a random spring; ``other`` lets it tilt and shift as well."""

    def apply(model: ArmModel, rng: np.random.Generator, *, other: bool = False) -> ArmModel:
        names = model.robot.joint_names
        model = model.with_springs(dict(zip(names, 10.0 ** rng.uniform(4.3, 6.6, len(names)), strict=True)))
        if not other:
            return model
        joints = tuple(replace(j, bearing=_bearing(model, j, rng)) for j in model.joints)
        return replace(model, joints=joints, base=_compliance(rng, 1e-7), tool=_compliance(rng, 1e-6))

    return apply


@pytest.fixture(scope="session")
def furnish() -> Callable[..., ArmModel]:
    """Give every joint a housing, a law about its axis and two across it; for a model that has bearings already."""

    def apply(model: ArmModel, rng: np.random.Generator) -> ArmModel:
        def law(level: float) -> LawSpring:
            basis = FourierBasis(int(rng.integers(model.robot.dof)), 1)
            return LawSpring(basis, np.array([level, *rng.uniform(-0.4, 0.4, 2)]))

        def laws() -> tuple[tuple[int, LawSpring], ...]:
            return tuple((row, law(18.0 if row < 3 else 14.0)) for row in rng.permutation(5)[:2].tolist())

        def joint(old: JointPart) -> JointPart:
            # What couples the bearing with the axis is scaled to the stiffest that the law gets, ln k = 14.4 at most.
            bearing, axial = old.bearing.copy(), old.axial.compliance(np.zeros((1, model.robot.dof)))[0]
            less = min(np.sqrt(np.exp(-14.4) / axial), 1.0)
            bearing[5], bearing[:, 5] = less * bearing[5], less * bearing[:, 5]
            return replace(old, axial=law(13.5), bearing=bearing, housing=_compliance(rng, 1e-6), laws=laws())

        return replace(model, joints=tuple(joint(j) for j in model.joints))

    return apply
