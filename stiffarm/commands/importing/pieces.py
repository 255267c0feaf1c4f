"""What is drawn of an imported link, shell or solid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from robots.arrays import Array, Integers


@dataclass(frozen=True)
class Piece:
    """Nodes (n, 3) m, outward triangles (m, 3), nodes of each interface, and the interfaces' points (i, 3) m."""

    name: str
    nodes: Array
    triangles: Integers
    interfaces: Mapping[str, Integers]
    points: Array
