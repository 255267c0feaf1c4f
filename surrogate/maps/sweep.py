"""The 3-D stiffness map: joint-space sweep, end-effector points with their stiffness."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from robots import InputError, Robot, forward_kinematics, tool_position
from robots.arrays import Array
from robots.progress import Progress
from surrogate.maps.vtk_files import StiffnessMap, grid_cells

POSES_A_BLOCK = 16384


def default_sweep(robot: Robot) -> tuple[tuple[str, ...], str | None]:
    """The three coordinates that sweep the workspace's cross-section and the one that leaves its plane.

    For six joints: 2, 3 and 5, with 4 out of the plane; for other arms the first three after joint 1.
    """
    names = robot.coordinates
    if robot.dof == 6:
        return (names[1], names[2], names[4]), names[3]
    return names[1:4], None


def sweep_map(
    robot: Robot,
    stiffness: Callable[[Array], Array],
    swept: Sequence[str],
    points: int,
    layers_deg: Mapping[str, Sequence[float]],
    *,
    scalars: Mapping[str, Callable[[Array], Array]] | None = None,
    metadata: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> StiffnessMap:
    """Sweep up to three coordinates over their limits; the poses the robot cannot take are left out.

    Parameters
    ----------
    stiffness : poses (n, dof) rad -> (n,) N/m
    swept : coordinates that sweep, ``points`` values each over the joint limits
    layers_deg : one more coordinate -> its values in deg, one layer of cells each; empty for none
    scalars : further arrays, name with unit -> function of the poses

    Raises
    ------
    InputError
        Fewer than two points, more than three swept coordinates, or no reachable pose.
    """
    if points < 2 or not 2 <= len(swept) <= 3:
        raise InputError(
            "map sweep",
            value=f"{len(swept)} coordinates with {points} points",
            allowed="2 or 3 with 2 points or more",
        )
    columns = [robot.coordinate_index(name) for name in swept]
    grids = [np.linspace(robot.limits[c, 0], robot.limits[c, 1], points) for c in columns]
    mesh = np.stack([g.ravel() for g in np.meshgrid(*grids, indexing="ij")], axis=1)
    layer_name, values = next(iter(layers_deg.items()), (None, (0.0,)))
    poses, cells, count = [], [], 0
    for value in values:
        q = np.zeros((len(mesh), robot.dof))
        q[:, columns] = mesh
        if layer_name is not None:
            q[:, robot.coordinate_index(layer_name)] = np.radians(value)
        keep = robot.reachable(q)
        poses.append(q[keep])
        cells.append(grid_cells([points] * len(swept), keep) + count)
        count += int(keep.sum())
    q = np.vstack(poses)
    if len(q) == 0:
        raise InputError(f"map of {robot.name}: no pose of the sweep can be taken", remedy="use other layer values")
    position, value_arrays = _evaluate(robot, q, {"stiffness": stiffness, **(scalars or {})}, progress)
    return StiffnessMap(
        positions=position,
        stiffness=value_arrays.pop("stiffness"),
        joints={name: np.degrees(q[:, i]) for i, name in enumerate(robot.coordinates)},
        scalars=value_arrays,
        metadata=dict(metadata or {}),
        cells=np.vstack(cells),
    )


def _evaluate(
    robot: Robot,
    q: Array,
    functions: Mapping[str, Callable[[Array], Array]],
    progress: Progress | None,
) -> tuple[Array, dict[str, Array]]:
    position = np.empty((len(q), 3))
    out = {name: np.empty(len(q)) for name in functions}
    for start in range(0, len(q), POSES_A_BLOCK):
        part = slice(start, start + POSES_A_BLOCK)
        position[part] = tool_position(robot, forward_kinematics(robot, q[part]))
        for name, function in functions.items():
            out[name][part] = function(q[part])
        if progress is not None:
            progress(min(start + POSES_A_BLOCK, len(q)), len(q))
    return position, out
