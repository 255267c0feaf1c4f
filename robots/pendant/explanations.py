"""What is read at the controller, and what may explain how it differs from the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from robots.arrays import Array
from robots.pendant.slips import Fitted, Frame, Slip


@dataclass(frozen=True, eq=False)
class PendantReadings:
    """Tool positions read at the controller.

    ``q`` (n, dof) rad: coordinates of the model, as the table's angles make them; ``position`` (n, 3) m and
    ``rotation`` (n, 3, 3) or None: the tool frame in the controller's robot frame; ``labels`` (n,).
    ``other_rotations``: by the name of a convention, what the same numbers are in that one.
    """

    q: Array
    position: Array
    rotation: Array | None
    labels: tuple[str, ...]
    other_rotations: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Explanation:
    """Slips, and frames that are elsewhere, which explain the positions; ``base_known``: in the controller's frame."""

    chosen: tuple[Slip, ...]
    frames: tuple[Frame, ...]
    fit: Fitted
    base_known: bool

    @property
    def things(self) -> int:
        """How many things are wrong."""
        return len(self.chosen) + len(self.frames)

    @property
    def codes(self) -> tuple[str, ...]:
        """Codes of slips and frames."""
        return (*(slip.code for slip in self.chosen), *self.frames)
