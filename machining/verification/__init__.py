"""Verification of a program before the cell moves: what would go wrong, where, and what could not be proven."""

from machining.verification.courses import MovingAxes, moving_axes
from machining.verification.demands import Demands, Interpolation
from machining.verification.offences import KIND_WORDS, Kind, Offence, Severity
from machining.verification.verify import Verification, verify

__all__ = [
    "KIND_WORDS",
    "Demands",
    "Interpolation",
    "Kind",
    "MovingAxes",
    "Offence",
    "Severity",
    "Verification",
    "moving_axes",
    "verify",
]
