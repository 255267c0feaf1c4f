"""Frames of requests and answers: mm and deg outside, (4, 4) m inside; the tool by point, tool axis and gamma."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from machining.service.fields import Fields
from machining.service.wire import number, numbers
from machining.task import ALONG
from robots.arrays import Array
from robots.frames import frame_mm_deg

FRAME_FORM = "[x, y, z, a, b, c] in mm and deg: turned by a, b, c about the fixed axes x, then y, then z"
# A frame may be given in one of these ways.
WAYS = ("frame_mm_deg", "matrix_mm", "point_mm")


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
    return standing(fields, point, axis, math.radians(gamma or 0.0), reference)


def standing(fields: Fields, point: Sequence[float], axis: Sequence[float], gamma: float, reference: Array) -> Array:
    """Tool frame (4, 4) m at a point (mm) with a tool axis and gamma (rad), as :meth:`machining.Task.tool_frames`."""
    a, b, c = axis
    x, y, z = _reference(axis, reference)
    if math.hypot(x, y, z) < ALONG:
        raise fields.fault(
            "tool_axis", list(axis), f"not along the reference direction {reference.tolist()}", "set another reference"
        )
    size = math.hypot(x, y, z)
    x, y, z = x / size, y / size, z / size
    u, v, w = b * z - c * y, c * x - a * z, a * y - b * x
    cos, sin = math.cos(gamma), math.sin(gamma)
    x, y, z = cos * x + sin * u, cos * y + sin * v, cos * z + sin * w
    # y = z x x with z = -axis.
    return np.array([
        [x, c * y - b * z, -a, point[0] * 1e-3],
        [y, a * z - c * x, -b, point[1] * 1e-3],
        [z, b * x - a * y, -c, point[2] * 1e-3],
        [0.0, 0.0, 0.0, 1.0],
    ])  # fmt: skip


def gamma_of(T: Array, reference: Array) -> float:
    """Angle about the tool axis (rad) of a tool frame; NaN where the reference is along the axis."""
    axis = (-T[:3, 2]).tolist()
    x, y, z = _reference(axis, reference)
    if math.hypot(x, y, z) < ALONG:
        return math.nan
    a, b, c = axis
    i, j, k = T[:3, 0].tolist()
    across = i * (b * z - c * y) + j * (c * x - a * z) + k * (a * y - b * x)
    return math.atan2(across, i * x + j * y + k * z)


def shown(T: Array, reference: Array) -> dict[str, Any]:
    """A tool frame for an answer: x, y, z, a, b, c; point, tool axis and gamma."""
    R = T[:3, :3]
    b = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0]))
    if abs(R[2, 0]) < 1.0 - 1e-12:
        a, c = math.atan2(R[2, 1], R[2, 2]), math.atan2(R[1, 0], R[0, 0])
    else:  # a and c turn about one axis: c is 0
        a, c = math.atan2(-R[1, 2], R[1, 1]), 0.0
    point = numbers(T[:3, 3] * 1e3)
    return {
        "frame_mm_deg": point + numbers(np.degrees([a, b, c])),
        "point_mm": point,
        "tool_axis": numbers(-T[:3, 2], 12),
        "gamma_deg": number(math.degrees(gamma_of(T, reference)), 9),
    }


def _reference(axis: Sequence[float], reference: Array) -> tuple[float, float, float]:
    """The reference direction laid onto the plane across the tool axis, not made long."""
    a, b, c = axis
    x, y, z = reference.tolist()
    along = a * x + b * y + c * z
    return x - along * a, y - along * b, z - along * c
