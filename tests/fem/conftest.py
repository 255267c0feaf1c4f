"""What the tests of the mechanics share: small robots, random poses and random springs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fem import ArmModel
from robots import ModelDescription, Robot
from robots.library import parse_description

Array = NDArray[np.float64]

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


@pytest.fixture(scope="session")
def soften() -> Callable[..., ArmModel]:
    """Give every joint a random spring; ``other`` lets it tilt and shift as well."""

    def apply(model: ArmModel, rng: np.random.Generator, *, other: bool = False) -> ArmModel:
        names = model.robot.joint_names
        model = model.with_springs(dict(zip(names, 10.0 ** rng.uniform(4.3, 6.6, len(names)), strict=True)))
        if not other:
            return model
        # Translations 1e8 to 1e10 N/m, tilts 1e5 to 1e7 N m/rad.
        exponents = np.array([[8.0, 10.0]] * 3 + [[5.0, 7.0]] * 2).T
        joints = tuple(replace(j, other=10.0 ** -rng.uniform(*exponents)) for j in model.joints)
        return replace(model, joints=joints)

    return apply
