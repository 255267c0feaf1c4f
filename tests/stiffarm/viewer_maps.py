"""Small maps of real robots for the tests of the map's page, made with the mechanics themselves."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

from fem import ArmModel, build_model, compliance_budget, directional_stiffness
from robots import ModelDescription, forward_kinematics, inverse_kinematics, load_description, tool_position
from robots.arrays import Array, Bools
from surrogate.maps.data import Axis, Field, Layout, MapData

DOWN = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])


@cache
def arm(name: str) -> tuple[ModelDescription, ArmModel]:
    description = load_description(name)
    return description, build_model(description)


def map_of(name: str, layout: Layout, points: Array, q: Array, reached: Bools) -> MapData:
    """Stiffness, compliance, an index without a unit and the part that deflects most, at poses q (n, 6) rad."""
    _, model = arm(name)
    n, rows = len(q), np.flatnonzero(reached)
    budget = compliance_budget(model, q[rows], DOWN)
    stiffness, share, worst = np.full(n, np.nan), np.full((n, len(budget.parts)), np.nan), np.full(n, -1.0)
    stiffness[rows] = directional_stiffness(model, q[rows]) * 1e-3
    share[rows] = budget.share
    worst[rows] = budget.share.argmax(axis=1)
    index = np.linspace(0.1, 0.9, n)
    index[~reached] = np.nan
    fields = {
        "stiffness_N_per_mm": Field(stiffness, "N/mm", "stiffness along the load"),
        "compliance_um_per_N": Field(1e3 / stiffness, "um/N", "compliance along the load"),
        "isotropy": Field(index, "", "isotropy of the translational compliance"),
        "softest_part": Field(worst, "", "part that deflects most", budget.parts),
    }
    metadata = {"robot": name, "load": "downward force (-Z)", "made by": "tests"}
    return MapData(layout, points, q, reached, model.robot.coordinates, fields, budget.parts, share, metadata)


def joint_map(name: str, swept_deg: Mapping[str, Array], fixed_deg: Mapping[str, float]) -> MapData:
    """A sweep of joint coordinates, the first one slowest."""
    _, model = arm(name)
    robot = model.robot
    axes = tuple(Axis(c, "deg", np.asarray(v, dtype=np.float64)) for c, v in swept_deg.items())
    grids = np.meshgrid(*(a.values for a in axes), indexing="ij")
    q = np.zeros((grids[0].size, robot.dof))
    for coordinate, value in fixed_deg.items():
        q[:, robot.coordinate_index(coordinate)] = np.radians(value)
    for axis, grid in zip(axes, grids, strict=True):
        q[:, robot.coordinate_index(axis.name)] = np.radians(grid.ravel())
    reached = robot.reachable(q)
    points = tool_position(robot, forward_kinematics(robot, q))
    q[~reached] = np.nan
    return map_of(name, Layout("joints", axes), points, q, reached)


def grid_map(name: str, axes_mm: Mapping[str, Array], fixed_mm: Mapping[str, float]) -> MapData:
    """A slice or a box with the tool pointing down (axes z, y, x, slowest first)."""
    _, model = arm(name)
    axes = tuple(Axis(a, "mm", np.asarray(v, dtype=np.float64)) for a, v in axes_mm.items())
    grids = np.meshgrid(*(a.values for a in axes), indexing="ij")
    points = np.zeros((grids[0].size, 3))
    for coordinate, value in fixed_mm.items():
        points[:, "xyz".index(coordinate)] = 1e-3 * value
    for axis, grid in zip(axes, grids, strict=True):
        points[:, "xyz".index(axis.name)] = 1e-3 * grid.ravel()
    targets = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (len(points), 1, 1))
    targets[:, :3, 3] = points
    found = inverse_kinematics(model.robot, targets)
    first = found.valid.argmax(axis=1)
    reached = found.valid.any(axis=1)
    q = found.q[np.arange(len(points)), first]
    q[~reached] = np.nan
    return map_of(name, Layout("slice" if len(axes) == 2 else "box", axes), points, q, reached)


def xr701_sweep(count: int = 9) -> MapData:
    """q4 in four layers, q2, q3 and q5 over their limits."""
    return joint_map(
        "xr701",
        {
            "q4_deg": np.array([-90.0, -30.0, 30.0, 90.0]),
            "q2_deg": np.linspace(-35.0, 45.0, count),
            "q3real_deg": np.linspace(40.0, 115.0, count),
            "q5_deg": np.linspace(-80.0, 80.0, count),
        },
        {},
    )


def kr60_slice(step: float = 50.0) -> MapData:
    """The plane y = 0."""
    z, x = np.arange(-400.0, 1900.0 + 1e-9, step), np.arange(200.0, 2100.0 + 1e-9, step)
    return grid_map("kr60-3", {"z": z, "x": x}, {"y": 0.0})


def kr60_box(step: float = 150.0) -> MapData:
    """A box in front of the robot."""
    z, y, x = np.arange(0, 1501, step), np.arange(-1200, 1201, step), np.arange(300, 1951, step)
    return grid_map("kr60-3", {"z": z, "y": y, "x": x}, {})
