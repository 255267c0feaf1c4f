"""Where things stand: frames of requests and answers, and what a session keeps between requests or one brings itself.

Outside mm and deg, inside (4, 4) m. The tool stands by a frame, or by point, tool axis and gamma.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from machining.cell import Cell
from machining.service.wire import Fields, number, numbers
from machining.task import ALONG, across, tool_frames
from robots.arrays import Array
from robots.frames import frame_mm_deg, rpy_of

# A frame may be given in one of these ways.
WAYS = ("frame_mm_deg", "matrix_mm", "point_mm")
FRAMES = ("part", "base")
KEYS = ("tool_mm_deg", "part_mm_deg", "travel_mm", "table_deg", "reference", "relative_to")


@dataclass(frozen=True, eq=False)
class State:
    """Where things stand, SI.

    ``cell`` with the tool and the part frame as they are set; ``travel`` (k,) m of its linear axes; ``table`` rad;
    ``reference`` (3,): gamma counts from it; ``relative_to``: frame of points, directions and forces in requests and
    answers; ``force`` (3,) N on the tool and ``direction`` (3,) for requests that bring none.
    """

    cell: Cell
    travel: Array
    table: float = 0.0
    reference: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    relative_to: str = "part"
    force: Array | None = None
    direction: Array | None = None

    @cached_property
    def T_base_part(self) -> Array:  # noqa: N802 - letters of the matrix
        """Part in the base frame (4, 4) m."""
        return np.asarray(self.cell.T_base_part(self.travel[None], [self.table])[0])

    @property
    def T_base_given(self) -> Array:  # noqa: N802
        """The frame that requests count in, in the base frame (4, 4) m."""
        return self.T_base_part if self.relative_to == "part" else np.eye(4)

    @property
    def T_tool(self) -> Array:  # noqa: N802
        """Tool on the flange (4, 4) m."""
        return self.cell.tool.T_flange_tool

    @property
    def payload(self) -> dict[str, Any]:
        """For an answer."""
        at_rest = replace(self, travel=np.zeros_like(self.travel), table=0.0)
        return {
            "tool_mm_deg": shown(self.T_tool, self.reference)["frame_mm_deg"],
            "part_mm_deg": shown(at_rest.T_base_part, self.reference)["frame_mm_deg"],
            "travel_mm": numbers(self.travel * 1e3),
            "table_deg": number(np.degrees(self.table), 9),
            "reference": numbers(self.reference),
            "relative_to": self.relative_to,
            "force_N": None if self.force is None else numbers(self.force),
            "direction": None if self.direction is None else numbers(self.direction),
        }


def state_of(fields: Fields, state: State) -> State:
    """The state with what a request brings of :data:`KEYS`.

    Raises
    ------
    InputError
        What cannot be read; travels and angles beyond their limits; another tool where the cell has the tool's surface.
    """
    fields.seen += KEYS
    if not any(map(fields.has, KEYS)):
        return state
    cell = _cell(fields, state.cell)
    reference = fields.direction("reference")
    changed = replace(
        state,
        cell=cell,
        travel=_travel(fields, state),
        table=_table(fields, state),
        reference=state.reference if reference is None else np.array(reference),
        relative_to=fields.choice("relative_to", FRAMES, state.relative_to),
    )
    return changed


def vectors_of(fields: Fields, key: str, kept: Array | None) -> Array | None:
    """``force_N`` or ``direction``, (3,) or (n, 3), of the request, else what is kept; directions as they are given."""
    given = fields.rows(key, 3)
    if given is None:
        return kept
    zero = np.flatnonzero(~np.atleast_2d(given).any(axis=1))
    if len(zero):
        where = key if given.ndim == 1 else f"{key}, row {zero[0]}"
        raise fields.fault(where, [0, 0, 0], "three numbers, not all zero")
    return given


def _cell(fields: Fields, cell: Cell) -> Cell:
    tool = frame_of(fields, "tool_mm_deg")
    if tool is not None:
        if cell.tool.holder or cell.tool.cutter:
            raise fields.fault("tool_mm_deg", "given", "the tool of the cell file, because its surface is there too")
        cell = replace(cell, tool=replace(cell.tool, T_flange_tool=tool))
    part = frame_of(fields, "part_mm_deg")
    if part is None:
        return cell
    # A zero point, as it is set at the control: surfaces stay where they are.
    return replace(cell, T_world_part0=cell.T_world_base0 @ part)


def _travel(fields: Fields, state: State) -> Array:
    axes = state.cell.linear_axes
    given: Sequence[float] | None = fields.vector("travel_mm", len(axes))
    if given is None:
        return state.travel
    travel = np.array(given, dtype=np.float64) * 1e-3
    for axis, value in zip(axes, travel, strict=True):
        if not axis.limits[0] - 1e-9 <= value <= axis.limits[1] + 1e-9:
            low, high = axis.limits * 1e3
            raise fields.fault(
                f"travel_mm of {axis.name}", float(value * 1e3), f"{low:g} to {high:g} mm", "keep the axis's limits"
            )
    return travel


def _table(fields: Fields, state: State) -> float:
    given = fields.number("table_deg")
    if given is None:
        return state.table
    table = state.cell.turntable
    if table is None:
        if given != 0.0:
            raise fields.fault("table_deg", given, "0: this cell has no turntable")
    elif table.limits is not None:
        low, high = np.degrees(table.limits)
        if not low - 1e-9 <= given <= high + 1e-9:
            raise fields.fault("table_deg", given, f"{low:g} to {high:g} deg")
    return float(np.radians(given))


def frame_of(fields: Fields, key: str) -> Array | None:
    """The frame (4, 4) m of a key with x, y, z, a, b, c; None where it is not given."""
    values = fields.vector(key, 6)
    return None if values is None else frame_mm_deg(values)


def has_target(fields: Fields) -> bool:
    """Whether a request says where the tool is."""
    return any(fields.has(way) for way in WAYS)


def target_of(fields: Fields, reference: Array) -> Array:
    """Where the tool frame (4, 4) m shall be: ``frame_mm_deg``, ``matrix_mm``, or point, tool axis and gamma.

    Raises
    ------
    InputError
        None or several of them; a tool axis along the reference direction that gamma counts from.
    """
    given = [way for way in WAYS if fields.has(way)]
    if len(given) != 1:
        both = " and ".join(given) or None
        raise fields.fault("where the tool shall be", both, f"one of {', '.join(WAYS)}", "give one of them")
    frame = frame_of(fields, "frame_mm_deg")
    matrix = fields.rows("matrix_mm", 4, 4)
    point, axis = fields.vector("point_mm", 3), fields.direction("tool_axis")
    gamma = fields.number("gamma_deg")
    if point is None and (axis is not None or gamma is not None):
        raise fields.fault("tool_axis, gamma_deg", given[0], "together with point_mm only")
    if frame is not None:
        return frame
    if matrix is not None:
        if matrix.shape != (4, 4):
            raise fields.fault("matrix_mm", f"shape {matrix.shape}", "four rows of four numbers, the last 0 0 0 1")
        matrix[:3, 3] *= 1e-3
        return matrix
    assert point is not None  # noqa: S101 - one of the three is given
    if axis is None:
        raise fields.needed("tool_axis", "the direction from the tool's tip into the holder")
    one = np.array([axis])
    if np.linalg.norm(across(one, reference)) < ALONG:
        raise fields.fault(
            "tool_axis", list(axis), f"not along the reference direction {reference.tolist()}", "set another reference"
        )
    return np.asarray(tool_frames(1e-3 * np.array([point]), one, reference, np.radians([[gamma or 0.0]]))[0, 0])


def gamma_of(T: Array, reference: Array) -> float:
    """Angle about the tool axis (rad) of a tool frame; NaN where the reference is along the axis."""
    axis, x = -T[:3, 2], T[:3, 0]
    x0 = across(axis[None], reference)[0]
    if np.linalg.norm(x0) < ALONG:
        return math.nan
    return math.atan2(x @ np.cross(axis, x0), x @ x0)


def shown(T: Array, reference: Array) -> dict[str, Any]:
    """A tool frame for an answer: x, y, z, a, b, c; point, tool axis and gamma."""
    point = numbers(T[:3, 3] * 1e3)
    return {
        "frame_mm_deg": point + numbers(np.degrees(rpy_of(T[:3, :3]))),
        "point_mm": point,
        "tool_axis": numbers(-T[:3, 2], 12),
        "gamma_deg": number(math.degrees(gamma_of(T, reference)), 9),
    }
