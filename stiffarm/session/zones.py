"""From what a user types to where the arm must not be: a floor, boxes, its own base."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from doe.planning.zones import Zone
from meshes.sections import section_dimensions
from robots import InputError, ModelDescription
from stiffarm.session.parsing import parse_numbers

# What wrist and base keep from each other beyond their casings, m.
MARGIN = 0.05
# Height of the floor where none is given.
FLOOR = "0"


def parse_zone(description: ModelDescription, floor: str, boxes: Sequence[str], clearance: float | None) -> Zone:
    """Where the arm must not be: below ``floor`` (mm or ``none``), inside boxes ``x0,y0,z0:x1,y1,z1`` (mm).

    ``clearance`` (mm) of wrist and tool from base and upper arm; None: what the casings and a margin need.
    """
    if clearance is not None and not 0.0 <= clearance < 1e4:
        raise InputError(
            "--clearance-mm", code="A004", value=clearance, allowed="0 (no test) to 10000", remedy="give mm"
        )
    own = usual_clearance(description) if clearance is None else 1e-3 * clearance
    height = () if floor.strip().lower() == "none" else parse_numbers(floor)
    if height is None or len(height) > 1:
        raise InputError(
            "--floor-mm", code="A004", value=floor, allowed="a height in mm, or none", remedy="as in --floor-mm 0"
        )
    return Zone(height[0] * 1e-3 if height else None, tuple(_box(text) for text in boxes), own)


def zone_of(
    description: ModelDescription,
    floor_mm: float | None,
    boxes_mm: Sequence[Sequence[float]],
    clearance_mm: float | None,
) -> Zone:
    """Where the arm must not be: below a floor, inside boxes by two corners each, its wrist too near its own base.

    None: no floor; a clearance that the casings and a margin need.
    """
    own = usual_clearance(description) if clearance_mm is None else 1e-3 * clearance_mm
    corners = [np.sort(1e-3 * np.reshape(box, (2, 3)), axis=0).tolist() for box in boxes_mm]
    floor = None if floor_mm is None else 1e-3 * floor_mm
    return Zone(floor, tuple((tuple(low), tuple(high)) for low, high in corners), own)


def usual_clearance(description: ModelDescription) -> float:
    """Distance (m) of the wrist's line from that of base and upper arm: half of both casings and a margin."""
    bodies = ["base", *[joint.name for joint in description.joint]]

    def half(wanted: set[str]) -> float:
        links = [link for link in description.link if link.body in wanted]
        return max((0.5 * float(section_dimensions(link.section)[:-1].max()) for link in links), default=0.05)

    return half(set(bodies[:3])) + half({bodies[-1]}) + MARGIN


def _box(text: str) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    corners = [parse_numbers(corner) or () for corner in text.split(":")]
    if [len(corner) for corner in corners] != [3, 3]:
        raise InputError(
            "--keep-out",
            code="A004",
            value=text,
            allowed="two corners x0,y0,z0:x1,y1,z1 in mm",
            remedy="as in --keep-out 500,-800,0:1500,800,900",
        )
    low, high = np.sort(1e-3 * np.array(corners), axis=0)
    if not (low < high).all():
        raise InputError(
            "--keep-out", code="A004", value=text, allowed="a box with a volume", remedy="give opposite corners"
        )
    (x0, y0, z0), (x1, y1, z1) = low.tolist(), high.tolist()
    return (x0, y0, z0), (x1, y1, z1)
