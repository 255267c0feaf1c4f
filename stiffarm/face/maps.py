"""Stiffness maps over joints or over points in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from robots import InputError, require_one_of, require_positive
from robots.arrays import Array
from robots.constants import DOWN
from stiffarm.face.arms import Arm
from stiffarm.face.calls import called
from stiffarm.face.shown import Shown, frame
from stiffarm.pages.picture import Picture
from stiffarm.session.caution import cautioned, caveats
from stiffarm.session.stated import stated_words
from stiffarm.session.task_options import Range
from surrogate.maps.data import MapData, figures

if TYPE_CHECKING:
    import pandas as pd

Pose = Literal["stiffest", "softest", "best-gamma", "fixed"]
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
        known = {name: of for name, f in self.data.fields.items() if not f.categories and (of := figures(f.values))}
        return frame(
            {
                "quantity": list(known),
                "unit": [self.data.fields[name].unit for name in known],
                "least": [of.least for of in known.values()],
                "median": [of.median for of in known.values()],
                "largest": [of.greatest for of in known.values()],
            }
        )

    def points(self) -> pd.DataFrame:
        """One row a point: its place in mm, the pose in degrees, the quantities."""
        return frame({name: f.values for name, f in (self.data.places() | dict(self.data.fields)).items()})

    def __getitem__(self, name: str) -> Array:
        """A quantity (n,) by its name, NaN where there is no pose."""
        require_one_of("quantity", name, self.data.fields, code="B003")
        return np.asarray(self.data.fields[name].values)

    def save(self, file: str | Path) -> Path:
        """Write the map: .vti (slice, box), .vtu, .vtp or .csv; returns the path."""
        from robots.files.written import written_whole
        from stiffarm.commands.maps.files import FORMATS, write_table
        from surrogate.maps.mesh import write_map

        path, endings = Path(file), [f".{name}" for name in (*FORMATS, "csv")]
        if path.suffix not in endings:
            raise InputError("map file", code="B004", value=str(path), allowed=f"a name ending in {', '.join(endings)}")
        with called():
            if path.suffix != ".csv":
                write_map(self.data, path)
                return path
            with written_whole(path) as draft:
                write_table(self.data, draft)
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
    return _mapped(arm, kind="joints", points=points, direction=direction, at_load_N=at_load_N)


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
    require_positive("step_mm", step_mm, code="B003")
    return _mapped(
        arm,
        kind="slice",
        plane=plane,
        at_mm=at_mm,
        step_mm=step_mm,
        pose=pose,
        direction=direction,
        at_load_N=at_load_N,
        seed=seed,
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
    return _mapped(
        arm,
        kind="box",
        x_mm=x_mm,
        y_mm=y_mm,
        z_mm=z_mm,
        pose=pose,
        direction=direction,
        at_load_N=at_load_N,
        seed=seed,
    )


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
        arm,
        kind="cylinder",
        r_mm=r_mm,
        phi_deg=phi_deg,
        z_mm=z_mm,
        pose=pose,
        direction=direction,
        at_load_N=at_load_N,
        seed=seed,
    )


def _mapped(arm: Arm, **asked: Any) -> Map:
    from stiffarm.commands.maps.request import MapRequest

    with called():
        request = MapRequest(**asked)
        arm = request.stated(arm)
        engine = request.engine(arm)
        data = engine.computed(request.metadata(arm, engine))
        data.require_reached("move or widen the grid, or let the orientation be free: pose='stiffest'")
    return Map(arm, data)
