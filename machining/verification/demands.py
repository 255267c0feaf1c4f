"""What a program is held against."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from robots import require_at_least, require_one_of, require_positive

Interpolation = Literal["joint", "linear", "mixed"]


@dataclass(frozen=True)
class Demands:
    """How moves are understood, and what is allowed.

    Attributes
    ----------
    interpolation : "joint": between two points all axes move evenly and arrive together; "linear": the tool frame
        moves on a straight line and turns evenly, joints follow; "mixed": cutting moves linear, rapid ones joint
    safety : m that bodies keep; None: the cell's
    resolution : m of greatest motion of any point of the arm below which an interval is not divided further
    horizon : m beyond the safety distance in which distances are worked out; it changes the work, not the result
    tolerance : m that the tip may leave the programmed point or straight line of a cutting move
    axis_tolerance : rad that the tool's frame may turn away from it
    singular_least : least allowed :func:`machining.singular_distance` of moves whose path counts (cutting, or linear);
        arms without a spherical wrist have another scale there
    jump : rad; a larger step of a joint in one move is a jump unless the tool moves in keeping
    jump_ratio : a joint's step is in keeping with the tool below this many times (turn of the tool + way over the
        arm's length)
    smoothing : s over which the controller is taken to average the course of each axis
    """

    interpolation: Interpolation = "joint"
    safety: float | None = None
    resolution: float = 1e-3
    horizon: float = 0.1
    tolerance: float = 1e-4
    axis_tolerance: float = float(np.radians(0.5))
    singular_least: float = 0.02
    jump: float = float(np.radians(20.0))
    jump_ratio: float = 10.0
    smoothing: float = 0.05

    def __post_init__(self) -> None:
        require_one_of("interpolation", self.interpolation, ("joint", "linear", "mixed"), code="Q011")
        for name in ("resolution", "horizon", "tolerance", "axis_tolerance", "jump", "jump_ratio", "smoothing"):
            require_positive(f"verification, {name}", getattr(self, name), code="Q011")
        for name in ("safety", "singular_least"):
            require_at_least(f"verification, {name}", getattr(self, name), 0.0, code="Q011")
