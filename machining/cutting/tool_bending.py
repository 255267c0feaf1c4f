"""The tool's own bending as a cantilever, added to the arm's compliance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots import InputError
from robots.arrays import Array


@dataclass(frozen=True)
class ToolBending:
    """A round bar clamped in the holder, loaded at its tip: ``L^3 / (3 E I)`` across the tool axis, rigid along it.

    ``stickout`` L m, ``diameter`` m of the bar that bends alike (flutes take away stiffness: some 0.8 of the cutting
    diameter is a usual guess, to be stated by the caller), ``modulus`` Pa (carbide some 600e9, steel 210e9).
    ``relative_sd``: standard deviation of this compliance, share of it.

    Raises
    ------
    InputError
        A length or modulus that is not positive, or an uncertainty outside 0 to 0.5.
    """

    stickout: float
    diameter: float
    modulus: float
    relative_sd: float = 0.0

    def __post_init__(self) -> None:
        for what, value, unit in (
            ("stickout of the tool", self.stickout, "m"),
            ("diameter of the bending tool", self.diameter, "m"),
            ("modulus of the tool", self.modulus, "Pa"),
        ):
            if not 0.0 < value < np.inf:
                raise InputError(what, value=value, allowed=f"a finite number, more than 0 {unit}")
        if not 0.0 <= self.relative_sd <= 0.5:
            raise InputError("relative standard deviation of the tool", value=self.relative_sd, allowed="0 to 0.5")

    @property
    def compliance(self) -> float:
        """Compliance across the tool axis, m/N."""
        return float(64.0 * self.stickout**3 / (3.0 * np.pi * self.modulus * self.diameter**4))

    def matrices(self, axes: Array) -> Array:
        """Compliance (n, 3, 3) m/N for tool axes (n, 3), unit vectors."""
        return np.asarray(self.compliance * (np.eye(3) - axes[:, :, None] * axes[:, None, :]))
