"""Stiffness maps over joints or over points in space."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from robots import InputError, require_one_of, require_positive
from robots.arrays import Array
from robots.constants import DOWN
from stiffarm.face.arms import Arm, Picture
from stiffarm.face.calls import called
from stiffarm.face.shown import Shown, frame
from stiffarm.session.caution import cautioned, caveats
from stiffarm.session.stated import stated_words
from surrogate.maps.data import MapData

if TYPE_CHECKING:
    import pandas as pd

Pose = Literal["stiffest", "softest", "best-gamma", "fixed"]
# First value, last value and step in mm, or one value.
Range = tuple[float, float, float] | float
STIFFNESS = "stiffness_N_per_mm"


@dataclass(frozen=True, repr=False)
class Map(Shown):
    """A map: a pose at each point, and quantities with units. ``m["stiffness_N_per_mm"]`` is one of them.

    Made by :func:`stiffarm.map_joints`, :func:`stiffarm.map_slice`, :func:`stiffarm.map_box` and
    :func:`stiffarm.map_cylinder`; ``data`` has everything.
    """

    arm: Arm
    data: MapData

    def title(self) -> str:
        """Robot, kind of map, and how many of its points have a pose."""
        d = self.data
        reached = int(np.count_nonzero(d.reached))
        of = f"Map of {self.arm.name} over {d.layout.kind}: {reached} of {d.layout.n} points have a pose"
        return ". ".join(filter(None, (of, stated_words(self.arm.model))))

    def to_frame(self) -> pd.DataFrame:
        """One row a quantity: its unit, least value, median and largest value."""
        known = {n: v for n, f in self.data.fields.items() if not f.categories and len(v := _finite(f.values))}
        return frame(
            {
                "quantity": list(known),
                "unit": [self.data.fields[name].unit for name in known],
                "least": [v.min() for v in known.values()],
                "median": [np.median(v) for v in known.values()],
                "largest": [v.max() for v in known.values()],
            }
        )

    def points(self) -> pd.DataFrame:
        """One row a point: its place in mm, the pose in degrees, the quantities."""
        d = self.data
        columns: dict[str, object] = {f"{axis}_mm": 1e3 * d.points[:, k] for k, axis in enumerate("xyz")}
        columns |= {name: np.degrees(d.q[:, k]) for k, name in enumerate(d.coordinates)}
        return frame(columns | {name: f.values for name, f in d.fields.items()})

    def __getitem__(self, name: str) -> Array:
        """A quantity (n,) by its name, NaN where there is no pose."""
        require_one_of("quantity", name, self.data.fields, code="B003")
        return np.asarray(self.data.fields[name].values)

    def save(self, file: str | Path) -> Path:
        """Write the map: .vti (slice, box), .vtu, .vtp, .nc or .csv; returns the path."""
        from robots.files.written import written_whole
        from stiffarm.commands.maps.files import WRITERS, write_table

        path = Path(file)
        kinds = {f".{name}": write for name, write in WRITERS.items()} | {".csv": write_table}
        if path.suffix.lower() not in kinds:
            raise InputError("map file", code="B004", value=str(path), allowed=f"a name ending in {', '.join(kinds)}")
        with called(), written_whole(path) as draft:
            kinds[path.suffix.lower()](self.data, draft)
        return path

    def plot(self, file: str | Path | None = None, *, quantity: str = STIFFNESS) -> Picture:
        """Draw one quantity with the robot in it; ``file``: a PNG to write."""
        from stiffarm.commands.maps.figures.whole import one_figure

        with cautioned(caveats(self.arm)):
            return Picture.of(one_figure(self.data, quantity, self.arm)).kept(file)


def map_joints(
    arm: Arm,
    *,
    points: int = 21,
    direction: Sequence[float] = DOWN,
    at_load_N: float | None = None,
) -> Map:
    """Map the arm over its joint angles: three coordinates swept over their limits, a fourth in layers.

    Parameters
    ----------
    arm : the arm
    points : values of each swept coordinate
    direction : of the load, base axes
    at_load_N : load at which an arm with effects is mapped; default: :func:`robots.arm_class.stated_load`

    Raises
    ------
    InputError
        A direction of length zero, or too many points.

    Examples
    --------
    >>> import stiffarm as sa
    >>> sa.map_joints(sa.load("xr701"), points=3).data.layout.kind
    'joints'
    """
    return _mapped(arm, "joints", direction, {"--points": str(points)}, at_load_N=at_load_N)


def map_slice(
    arm: Arm,
    *,
    plane: Literal["xz", "yz", "xy"] = "xz",
    at_mm: float | None = None,
    step_mm: float | None = None,
    pose: Pose = "stiffest",
    direction: Sequence[float] = DOWN,
    at_load_N: float | None = None,
    seed: int = 0,
) -> Map:
    """Map the arm over tool points in a plane of the base frame.

    Parameters
    ----------
    arm : the arm
    plane : "xz", "yz" or "xy"
    at_mm : where the plane is along its normal; default: 0, of xy half the height that the tool reaches
    step_mm : between points; default: some hundred points along the longer side
    pose : which of the poses that reach a point: "stiffest", "softest", "best-gamma" or "fixed" tool axis
    direction : of the load, base axes
    at_load_N : as of :func:`map_joints`
    seed : of the search for extreme poses

    Raises
    ------
    InputError
        No point can be reached, or a robot whose orientations cannot be searched.

    Examples
    --------
    >>> import stiffarm as sa
    >>> m = sa.map_slice(sa.load("kr60-3", links="rigid"), step_mm=500, pose="best-gamma")
    >>> m.data.layout.kind
    'slice'
    """
    stepped = {} if step_mm is None else _stepped(arm, plane, step_mm)
    return _mapped(
        arm, "slice", direction, {"--plane": plane, "--at": at_mm, "--pose": pose, **stepped}, seed, at_load_N
    )


def map_box(
    arm: Arm,
    *,
    x_mm: Range | None = None,
    y_mm: Range | None = None,
    z_mm: Range | None = None,
    pose: Pose = "stiffest",
    direction: Sequence[float] = DOWN,
    at_load_N: float | None = None,
    seed: int = 0,
) -> Map:
    """Map the arm over tool points in a box along the base's axes.

    Parameters
    ----------
    arm : the arm
    x_mm, y_mm, z_mm : first value, last value and step, or one value; default: all that the tool reaches
    pose, direction, at_load_N, seed : as of :func:`map_slice`

    Raises
    ------
    InputError
        No point can be reached, or a range that is not a whole number of steps.

    Examples
    --------
    >>> import stiffarm as sa
    >>> m = sa.map_box(sa.load("kr60-3", links="rigid"), x_mm=(800, 1200, 400), y_mm=0, z_mm=800, pose="best-gamma")
    >>> m.data.layout.n
    2
    """
    return _mapped(arm, "box", direction, {"--x": x_mm, "--y": y_mm, "--z": z_mm, "--pose": pose}, seed, at_load_N)


def map_cylinder(
    arm: Arm,
    *,
    r_mm: Range | None = None,
    phi_deg: Range | None = None,
    z_mm: Range | None = None,
    pose: Pose = "stiffest",
    direction: Sequence[float] = DOWN,
    at_load_N: float | None = None,
    seed: int = 0,
) -> Map:
    """Map the arm over tool points in a cylinder about the base's z axis.

    Parameters
    ----------
    arm : the arm
    r_mm, phi_deg, z_mm : first value, last value and step, or one value; default: all that the tool reaches
    pose, direction, at_load_N, seed : as of :func:`map_slice`

    Raises
    ------
    InputError
        No point can be reached, or a range that is not a whole number of steps.

    Examples
    --------
    >>> import stiffarm as sa
    >>> arm = sa.load("kr60-3", links="rigid")
    >>> sa.map_cylinder(arm, r_mm=1000, phi_deg=(0, 90, 90), z_mm=800, pose="best-gamma").data.layout.n
    2
    """
    return _mapped(
        arm, "cylinder", direction, {"--r": r_mm, "--phi": phi_deg, "--z": z_mm, "--pose": pose}, seed, at_load_N
    )


def _mapped(
    arm: Arm,
    kind: str,
    direction: Sequence[float],
    options: Mapping[str, Range | str | None],
    seed: int = 0,
    at_load_N: float | None = None,
) -> Map:
    from stiffarm.commands.maps.options import read_map_options
    from stiffarm.commands.maps.request import engine_of, stated
    from stiffarm.commands.maps.step import metadata
    from surrogate.maps.assembled import computed_map

    typed = {option: _as_typed(value) for option, value in options.items()}
    typed["--direction"] = ",".join(map(_as_typed_number, direction))
    typed["--at-load"] = None if at_load_N is None else _as_typed_number(at_load_N)
    with called():
        asked = read_map_options(arm, kind, typed, seed)
        arm = stated(arm, asked.request)
        engine = engine_of(asked.request, arm.description, arm.model)
        data = computed_map(engine, metadata(arm, asked))
        data.require_reached("move or widen the grid, or let the orientation be free: pose='stiffest'")
    return Map(arm, data)


def _as_typed(value: Range | str | None) -> str | None:
    """An argument as one would type it, with all its digits."""
    if value is None or isinstance(value, str):
        return value
    return _as_typed_number(value) if isinstance(value, int | float) else ":".join(map(_as_typed_number, value))


def _as_typed_number(value: float) -> str:
    return repr(float(value))


def _stepped(arm: Arm, plane: str, step_mm: float) -> dict[str, Range]:
    """Ranges of a plane's two axes with a step, over all that the tool reaches."""
    from surrogate.maps.layouts import range_for, reach_of

    require_positive("step_mm", step_mm, code="B003")
    reach = reach_of(arm.robot, arm.robot.T_flange_tool[:3, 3])
    ends = {axis: 1e3 * np.array([reach.lower[k], reach.upper[k]]) for k, axis in enumerate("xyz")}
    values = {axis: range_for(float(ends[axis][0]), float(ends[axis][1]), step_mm) for axis in plane}
    return {f"--{axis}": (v[0], v[-1], step_mm) for axis, v in values.items()}


def _finite(values: Array) -> Array:
    return np.asarray(values)[np.isfinite(values)]
