"""Verification of a program before the cell moves: what would go wrong, where, and what could not be proven."""

from machining.verification.contacts import Contact, contact_of
from machining.verification.courses import MovingAxes, moving_axes
from machining.verification.demands import Demands, Interpolation
from machining.verification.offences import KIND_CODES, KIND_WORDS, Kind, Offence, Severity, worst_first
from machining.verification.verify import Verification, verify

__all__ = [
    "KIND_CODES",
    "KIND_WORDS",
    "Contact",
    "Demands",
    "Interpolation",
    "Kind",
    "MovingAxes",
    "Offence",
    "Severity",
    "Verification",
    "contact_of",
    "moving_axes",
    "verify",
    "worst_first",
]
