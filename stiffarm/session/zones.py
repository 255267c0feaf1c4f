"""From what a user types to where the arm must not be: a floor, boxes, its own base."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from doe.planning.zones import Zone
from meshes.sections import section_dimensions
from robots import ModelDescription

# What wrist and base keep from each other beyond their casings, m.
MARGIN = 0.05


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
