"""A finished map: points in a structured layout, the pose at each, and named quantities with units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import prod
from typing import Literal

import numpy as np

from robots.arrays import Array, Bools, Indices
from robots.errors import InputError

LayoutKind = Literal["joints", "slice", "box", "cylinder"]
_FULL_TURN_DEG = 360.0
# Of a step: how far the gap over the end of a full turn may differ from the other steps (rounded decimals).
_TURN_TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class Axis:
    """One direction of a layout: ``name`` ('x', 'r', 'phi', 'q2_deg'), ``unit`` ('mm' or 'deg'), values (n,) in it."""

    name: str
    unit: str
    values: Array

    @property
    def full_turn(self) -> bool:
        """Whether these are angles about the base's axis that end one step before where they began."""
        if self.name != "phi" or self.unit != "deg" or len(self.values) <= 2:
            return False
        steps = np.abs(np.diff(self.values))
        gap = _FULL_TURN_DEG - abs(self.values[-1] - self.values[0])
        return bool(abs(gap - steps.mean()) < _TURN_TOLERANCE * steps.mean())


@dataclass(frozen=True, eq=False)
class Layout:
    """Where a map's points are, as a product of axes, **slowest first**: points are numbered in C order.

    ``box``: axes z, y, x (so x runs fastest, as in VTK's image data), uniform steps; ``slice``: two of these, in that
    order; ``cylinder``: axes z, phi, r about the base's z axis; ``joints``: coordinates that sweep, the layers first.
    ``layers``: how many leading axes are layers, between which there are no cells (at least all but the last three).
    ``held``: of a slice the third coordinate in mm ('y': 0.0). ``frame`` (4, 4) m: where x, y and z stand in the base
    frame; None: they are the base's own. Joint coordinates that no axis names stand at 0.
    """

    kind: LayoutKind
    axes: tuple[Axis, ...]
    layers: int = 0
    held: Mapping[str, float] = field(default_factory=dict)
    frame: Array | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each axis, slowest first."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def n(self) -> int:
        """Number of points."""
        return prod(self.shape)

    def indices(self, rows: slice) -> tuple[Indices, ...]:
        """Index along each axis of the points ``rows`` (without forming those of all points)."""
        return np.unravel_index(np.arange(*rows.indices(self.n)), self.shape)


@dataclass(frozen=True, eq=False)
class Field:
    """One quantity at all points: ``values`` (n,) in ``unit``, NaN where there is none.

    ``label``: words for a colour bar, without the unit. ``categories``: names of what whole numbers 0, 1, ... stand
    for (which part deflects most); -1 where there is none, and then ``unit`` is ''.
    """

    values: Array
    unit: str
    label: str
    categories: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class MapData:
    """A map. Arrays may be memory maps of files, so that ten million points need no memory.

    Parameters
    ----------
    layout : n points
    points : (n, 3) m, base frame: the tool point (Cartesian layouts: the grid's point, reached or not)
    q : (n, dof) rad, the pose at each point; NaN where the robot does not reach it
    reached : (n,) whether there is a pose
    coordinates : (dof,) names of the joint coordinates, as in 'q2_deg'
    fields : name with unit ('stiffness_N_per_mm') -> values; in the order they are to be offered
    parts, shares : names (p,) and share (n, p) of each part in the compliance along the load, 0 to 1; may be empty
    metadata : what the map is of, words by name
    """

    layout: Layout
    points: Array
    q: Array
    reached: Bools
    coordinates: tuple[str, ...]
    fields: Mapping[str, Field]
    parts: tuple[str, ...] = ()
    shares: Array | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = self.layout.n
        sizes = {"points": self.points.shape, "q": self.q.shape, "reached": self.reached.shape}
        wanted = {"points": (n, 3), "q": (n, len(self.coordinates)), "reached": (n,)}
        sizes |= {name: f.values.shape for name, f in self.fields.items()}
        wanted |= dict.fromkeys(self.fields, (n,))
        if self.shares is not None:
            sizes["shares"], wanted["shares"] = self.shares.shape, (n, len(self.parts))
        wrong = [name for name in wanted if sizes[name] != wanted[name]]
        if wrong:
            raise InputError(
                f"map: {wrong[0]}", code="S011", value=f"shape {sizes[wrong[0]]}", allowed=str(wanted[wrong[0]])
            )

    def regular(self, rows: slice | Indices = slice(None)) -> Bools:
        """Which of some points are not known to stand near a singular pose, as the field 'near_singular' has it.

        The stiffest of all poses are singular ones, where a load passes through the joints' axes: whatever names the
        stiffest point leaves them out.
        """
        near = self.fields.get("near_singular")
        reached = np.asarray(self.reached[rows])
        return np.ones(len(reached), dtype=np.bool_) if near is None else np.asarray(near.values[rows] != 1.0)

    def require_reached(self, remedy: str) -> None:
        """Raise InputError where there is no pose at any point."""
        if not np.any(self.reached):
            raise InputError("map", code="S012", value=f"no pose at any of {self.layout.n} points", remedy=remedy)
