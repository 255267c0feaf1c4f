"""What the tests of the indices share: small arms, random poses, a turned base."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from rigid_frames import rigid_frame

import fem
import robots
from robots.arrays import Array
from robots.library.models import parse_description

PLANAR = """
schema = "stiffarm-model/1"
name = "planar"
title = "two links in the xy plane"
sources = {{}}
[[joint]]
name = "j1"
coordinate = "q1_deg"
limits = {{ value = [-180, 180], unit = "deg", source = "assumed" }}
stiffness = {{ value = {k1}, unit = "N m/rad", source = "assumed" }}
frame = {{ xyz = {{ value = [0, 0, 0], unit = "m", source = "assumed" }}, axis = [0, 0, 1] }}
[[joint]]
name = "j2"
coordinate = "q2_deg"
limits = {{ value = [-180, 180], unit = "deg", source = "assumed" }}
stiffness = {{ value = {k2}, unit = "N m/rad", source = "assumed" }}
frame = {{ xyz = {{ value = [{l1}, 0, 0], unit = "m", source = "assumed" }}, axis = [0, 0, {axis}] }}
sign = {axis}
[flange]
xyz = {{ value = [{l2}, 0, 0], unit = "m", source = "assumed" }}
"""


@pytest.fixture(scope="session")
def planar() -> Callable[..., fem.ArmModel]:
    """Rigid links of length l1 and l2 with springs k1 and k2; ``axis = -1`` turns joint 2's axis and its sign."""

    def build(l1: float, l2: float, k1: float, k2: float, axis: int = 1) -> fem.ArmModel:
        text = PLANAR.format(l1=l1, l2=l2, k1=k1, k2=k2, axis=axis)
        return fem.build_model(parse_description(text, "planar"), links="rigid")

    return build


@pytest.fixture(scope="session")
def kr60() -> fem.ArmModel:
    """The paper's arm: rigid links, its joint stiffnesses."""
    return fem.build_model(robots.load_description("kr60-3"), links="rigid")


@pytest.fixture(scope="session")
def poses() -> Callable[..., Array]:
    """Draw n random reachable poses, rad."""

    def draw(robot: robots.Robot, n: int, rng: np.random.Generator) -> Array:
        q = rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (4 * n + 20, robot.dof))
        q = q[robot.reachable(q)][:n]
        assert len(q) == n
        return q

    return draw


@pytest.fixture(scope="session")
def turned_base() -> Callable[..., fem.ArmModel]:
    """Return the same arm standing on a base whose axes are turned by R."""

    def turn(model: fem.ArmModel, R: Array) -> fem.ArmModel:
        T = rigid_frame(R=R)
        T_pre = model.robot.T_pre.copy()
        T_pre[0] = T @ T_pre[0]
        return replace(model, robot=replace(model.robot, T_pre=T_pre))

    return turn


@pytest.fixture
def rotation(rng: np.random.Generator) -> Array:
    """Some rotation."""
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.asarray(Q * np.linalg.det(Q))
