"""Where a map's points are: joint sweeps, slices, boxes and cylinders, worked out for blocks of rows only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from robots import InputError, Robot, forward_kinematics, require_one_of, tool_position
from robots.arrays import Array, finite
from surrogate.maps.data import Axis, Layout

# Points of a map at most: their numbers must fit an index, and a disk.
MOST_POINTS = 2_000_000_000
# Points along the longest axis by default: some seconds for a slice, a minute or two for a box.
ALONG_SLICE, ALONG_BOX = 40, 25
# Degrees from one angle of a cylinder to the next by default.
TURN_deg = 15.0
# Values of the coordinate that leaves a sweep's plane by default.
LAYERS_deg = (-180.0, -135.0, -90.0, -45.0, 0.0, 45.0, 90.0, 135.0)
# Share by which steps of one axis may differ: rounding of decimals.
UNEVEN = 1e-6
PLANES: Mapping[str, tuple[str, str, str]] = {"xz": ("z", "x", "y"), "yz": ("z", "y", "x"), "xy": ("y", "x", "z")}


@dataclass(frozen=True)
class Reach:
    """What the tool point gets to: ``lower``, ``upper`` (3,) m, and ``radius`` m from axis 1's base, all as sampled."""

    lower: Array
    upper: Array
    radius: float

    @property
    def words(self) -> str:
        """For messages, in mm."""
        ends = zip("xyz", 1e3 * self.lower, 1e3 * self.upper, strict=True)
        return ", ".join(f"{name} {low:.0f} to {high:.0f} mm" for name, low, high in ends)


def default_sweep(robot: Robot) -> tuple[tuple[str, ...], str | None]:
    """The three coordinates that sweep the workspace's cross-section and the one that leaves its plane.

    For six joints: 2, 3 and 5, with 4 out of the plane; for other arms the first three after joint 1.
    """
    names = robot.coordinates
    if robot.dof == 6:
        return (names[1], names[2], names[4]), names[3]
    return names[1:4], None


def sweep_layout(robot: Robot, points: int, layers_deg: Sequence[float] | None = None) -> Layout:
    """The layout of :func:`default_sweep`; ``layers_deg``: values of the coordinate that leaves the plane.

    Errors as :func:`joint_layout`.
    """
    swept, layer = default_sweep(robot)
    if layer is None:
        return joint_layout(robot, swept, points)
    low, high = np.degrees(robot.limits[robot.coordinate_index(layer)])
    values = [v for v in LAYERS_deg if low <= v <= high] if layers_deg is None else layers_deg
    return joint_layout(robot, swept, points, {layer: values})


def joint_layout(
    robot: Robot, swept: Sequence[str], points: int, layers_deg: Mapping[str, Sequence[float]] | None = None
) -> Layout:
    """Sweep coordinates over their limits, ``points`` values each; one more coordinate may have values as layers.

    Poses that the robot cannot take are points of the layout all the same: they are told when they are evaluated.

    Raises
    ------
    InputError
        Fewer than two points, no coordinate or more than three, an unknown one, or one named twice.
    """
    if points < 2 or not 1 <= len(swept) <= 3:
        raise InputError(
            "map sweep",
            code="S011",
            value=f"{len(swept)} coordinates with {points} points",
            allowed="1 to 3 coordinates with 2 points or more",
        )
    layers = {name: list(values) for name, values in (layers_deg or {}).items() if len(values)}
    names = [*layers, *swept]
    if len(set(names)) < len(names) or len(layers) > 1:
        raise InputError(
            "coordinates of a map sweep", code="S011", value=", ".join(names), allowed="each once, one with layers"
        )
    axes = [Axis(name, "deg", _finite(name, values)) for name, values in layers.items()]
    for name in swept:
        low, high = np.degrees(robot.limits[robot.coordinate_index(name)])
        axes.append(Axis(name, "deg", np.linspace(low, high, points)))
    for name in layers:
        robot.coordinate_index(name)
    return _checked(Layout("joints", tuple(axes), len(layers)))


def slice_layout(
    plane: str, across_mm: ArrayLike, up_mm: ArrayLike, at_mm: float = 0.0, frame: Array | None = None
) -> Layout:
    """A plane of the base frame, or of another ``frame`` (4, 4) m: 'xz' and 'yz' stand, 'xy' lies at z = ``at_mm``.

    ``across_mm``: values of the plane's first letter, which runs fastest; ``up_mm``: of its second. Evenly spaced.

    Raises
    ------
    InputError
        No such plane, or values that do not ascend in even steps.
    """
    require_one_of("plane of a slice", plane, PLANES, code="S011")
    slow, fast, third = PLANES[plane]
    axes = (Axis(slow, "mm", _even(slow, up_mm)), Axis(fast, "mm", _even(fast, across_mm)))
    return _checked(Layout("slice", axes, held={third: float(_finite(third, [at_mm])[0])}, frame=frame))


def box_layout(x_mm: ArrayLike, y_mm: ArrayLike, z_mm: ArrayLike, frame: Array | None = None) -> Layout:
    """A box along the axes of the base, or of another ``frame``; x runs fastest. Errors as :func:`slice_layout`."""
    axes = tuple(Axis(name, "mm", _even(name, values)) for name, values in zip("zyx", (z_mm, y_mm, x_mm), strict=True))
    return _checked(Layout("box", axes, frame=frame))


def plane_or_box(x_mm: ArrayLike, y_mm: ArrayLike, z_mm: ArrayLike, frame: Array | None = None) -> Layout:
    """A box, or the plane that it is where one of x, y, z has a single value. Errors as :func:`slice_layout`.

    Raises
    ------
    InputError
        More than one axis with a single value.
    """
    values = {name: _even(name, v) for name, v in zip("xyz", (x_mm, y_mm, z_mm), strict=True)}
    single = [name for name, v in values.items() if len(v) == 1]
    if len(single) > 1:
        raise InputError(
            "grid",
            code="S011",
            value=" x ".join(str(len(v)) for v in values.values()),
            allowed="two or more values on at least two of x, y, z",
            remedy="give a range with a step, as in -600:600:25",
        )
    if not single:
        return box_layout(values["x"], values["y"], values["z"], frame)
    plane, (up, across, third) = next(item for item in PLANES.items() if item[1][2] == single[0])
    return slice_layout(plane, values[across], values[up], float(values[third][0]), frame)


def cylinder_layout(r_mm: ArrayLike, phi_deg: ArrayLike, z_mm: ArrayLike) -> Layout:
    """Part of a cylinder about the base's z axis; phi counts from x. r runs fastest.

    Raises
    ------
    InputError
        Values that do not ascend in even steps, a negative radius, more than a turn.
    """
    r, phi, z = _even("r", r_mm), _even("phi", phi_deg), _even("z", z_mm)
    if r[0] < 0.0:
        raise InputError("radius of a cylinder", code="S011", value=float(r[0]), allowed="0 mm or more")
    if phi[-1] - phi[0] > 360.0 * (1.0 + UNEVEN):
        raise InputError(
            "angles phi of a cylinder", code="S011", value=f"{phi[0]:g} to {phi[-1]:g} deg", allowed="at most one turn"
        )
    return _checked(Layout("cylinder", (Axis("z", "mm", z), Axis("phi", "deg", phi), Axis("r", "mm", r))))


def points_of(layout: Layout, rows: slice = slice(None)) -> Array:
    """Tool points (m, 3) m, base frame, of some rows of a Cartesian layout."""
    own = own_points(layout, rows)
    return own if layout.frame is None else np.asarray(own @ layout.frame[:3, :3].T + layout.frame[:3, 3])


def own_points(layout: Layout, rows: slice = slice(None)) -> Array:
    """Tool points (m, 3) m in the frame of a Cartesian layout."""
    numbers = layout.indices(rows)
    value = {axis.name: axis.values[i] for axis, i in zip(layout.axes, numbers, strict=True)}
    value |= {name: np.full(len(numbers[0]), held) for name, held in layout.held.items()}
    if "r" in value:
        phi = np.radians(value["phi"])
        value |= {"x": value["r"] * np.cos(phi), "y": value["r"] * np.sin(phi)}
    return 1e-3 * np.column_stack([value["x"], value["y"], value["z"]])


def poses_of(layout: Layout, robot: Robot, rows: slice = slice(None)) -> Array:
    """Poses (m, dof) rad of some rows of a joint layout, beyond limits or not."""
    numbers = layout.indices(rows)
    q = np.zeros((len(numbers[0]), robot.dof))
    for axis, i in zip(layout.axes, numbers, strict=True):
        q[:, robot.coordinate_index(axis.name)] = np.radians(axis.values[i])
    return q


def reach_of(robot: Robot, point: Array | None = None, *, samples: int = 20_000) -> Reach:
    """How far the tool point gets, from random poses; some of their joints stand at an end or the middle.

    ``point`` (3,) m in the flange frame instead of the robot's tool point. The true reach is a little more.

    Raises
    ------
    InputError
        No pose that keeps the couplings was drawn.
    """
    generator = np.random.default_rng(0)
    low, high = robot.limits.T
    q = generator.uniform(low, high, (samples, robot.dof))
    kind = generator.integers(0, 8, q.shape)
    q = np.select([kind == 0, kind == 1, kind == 2], [low, high, np.clip(0.0, low, high)], q)
    q = q[robot.reachable(q)]
    if not len(q):
        raise InputError(
            f"reach of {robot.name}", code="S012", value="no pose keeps the limits", remedy="check its couplings"
        )
    tips = tool_position(robot, forward_kinematics(robot, q), point)
    return Reach(tips.min(axis=0), tips.max(axis=0), float(np.hypot(tips[:, 0], tips[:, 1]).max()))


def step_for(length_mm: float, count: int) -> float:
    """A round step in mm that gives ``count`` points or somewhat more along a length."""
    wanted = max(length_mm, 1e-6) / count
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(s * power for s in (1.0, 2.0, 2.5, 5.0) if s * power <= wanted * (1.0 + 1e-9)))


def range_for(low_mm: float, high_mm: float, step_mm: float) -> Array:
    """Values (n,) mm in whole steps that hold a range."""
    first, last = np.floor(low_mm / step_mm), np.ceil(high_mm / step_mm)
    return step_mm * np.arange(first, max(last, first + 1) + 1)


def _finite(name: str, values: ArrayLike) -> Array:
    return finite(f"values of {name}", np.atleast_1d(values), ("n",))


def _even(name: str, values: ArrayLike) -> Array:
    v = _finite(name, values)
    gap = np.diff(v)
    if len(v) > 1 and (not (gap > 0.0).all() or np.ptp(gap) > UNEVEN * gap.mean() * len(gap)):
        raise InputError(
            f"values of {name}", code="S011", allowed="ascending, evenly spaced", remedy="give them as FROM:TO:STEP"
        )
    return v


def _checked(layout: Layout) -> Layout:
    if layout.n > MOST_POINTS:
        raise InputError("points of the map", code="S011", value=layout.n, allowed=f"up to {MOST_POINTS}")
    return layout
