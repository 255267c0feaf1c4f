"""Estimates made up for tests of words and pictures."""

from __future__ import annotations

from doe.certainty.uncertainty import ParameterEstimate, Status
from fem.free.kinds import KINDS
from fem.free.parameters import TURN, Parameter

INF, NAN = float("inf"), float("nan")


def made_spring(joint: str, value: float, interval: tuple[float, float], status: Status) -> ParameterEstimate:
    """A joint's spring (N m/rad), free over the widest range."""
    name = f"{joint}.stiffness"
    free = Parameter(name, KINDS[0], joint, (5,), "N m/rad", INF, *TURN, "compliance")
    return ParameterEstimate(free, value, interval, NAN, status, 5.0)
