"""Arms of which a map's numbers are known: a planar one in closed form, a six-joint one with a single spring."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

import fem
import robots
from robots.arrays import Array
from robots.library.models import parse_description
from surrogate.maps.blocks import Engine
from surrogate.maps.candidates import Arm
from surrogate.maps.data import Layout
from surrogate.maps.layouts import space_layout
from surrogate.maps.poses import PoseRule, last_joint_is_free
from surrogate.maps.quantities import TABLE, Quantities, named

L1, L2, K1, K2 = 0.5, 0.4, 2e5, 1e5
DOWN = np.array([0.0, 0.0, -1.0])

_JOINT = """
[[joint]]
name = "{name}"
coordinate = "q{number}_deg"
limits = {{ value = [-180, 180], unit = "deg", source = "assumed" }}
stiffness = {{ value = {k}, unit = "N m/rad", source = "assumed" }}
frame = {{ xyz = {{ value = [{x}, 0, 0], unit = "m", source = "assumed" }}, axis = [0, 0, 1] }}
"""


@cache
def planar() -> fem.ArmModel:
    """Two rigid links in the xy plane with a spring in each joint."""
    text = (
        'schema = "stiffarm-model/1"\nname = "planar"\ntitle = "two links"\nsources = {}\n'
        + _JOINT.format(name="j1", number=1, k=K1, x=0.0)
        + _JOINT.format(name="j2", number=2, k=K2, x=L1)
        + f'[flange]\nxyz = {{ value = [{L2}, 0, 0], unit = "m", source = "assumed" }}\n'
    )
    return fem.build_model(parse_description(text, "planar"), links="rigid")


@cache
def kr60() -> fem.ArmModel:
    """Rigid links, the published joint stiffnesses."""
    return fem.build_model(robots.load_description("kr60-3"), links="rigid")


@cache
def one_spring(k: float) -> fem.ArmModel:
    """The KR 60 with nothing that gives way but joint 1."""
    model = kr60().with_rigid_joints()
    return model.with_springs({model.robot.joint_names[0]: k})


def engine(
    model: fem.ArmModel,
    grid: Layout,
    rule: PoseRule | None = None,
    *,
    wanted: tuple[str, ...] = ("stiffness",),
    direction: Array = DOWN,
    shares: bool = False,
    tool: Array | None = None,
) -> Engine:
    """An engine by the model's own tool, the best pose by stiffness."""
    T = model.robot.T_flange_tool if tool is None else tool
    quantities = Quantities(model, direction, named(TABLE, wanted), shares=shares, point=T[:3, 3])
    if rule is None:
        return Engine(grid, quantities)
    free = last_joint_is_free(model.robot, T, lambda q: quantities.poses(q).translational)
    return Engine(grid, quantities, rule, Arm(model.robot, T, quantities.merit(named(TABLE, ["stiffness"])[0]), free))


def slice_layout(plane: str, across_mm: ArrayLike, up_mm: ArrayLike, at_mm: float = 0.0) -> Layout:
    """A plane of the base frame: values of its first letter and of its second."""
    (third,) = set("xyz") - set(plane)
    return space_layout({plane[0]: across_mm, plane[1]: up_mm}, {third: at_mm})


def box_layout(x_mm: ArrayLike, y_mm: ArrayLike, z_mm: ArrayLike) -> Layout:
    """A box along the base's axes."""
    return space_layout({"x": x_mm, "y": y_mm, "z": z_mm})


def cylinder_layout(r_mm: ArrayLike, phi_deg: ArrayLike, z_mm: ArrayLike) -> Layout:
    """Part of a cylinder about the base's z axis."""
    return space_layout({"r": r_mm, "phi": phi_deg, "z": z_mm})
