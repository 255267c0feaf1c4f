"""How sure the calibrated numbers of a model file are: their covariance, and what the readings left open."""

from __future__ import annotations

import math
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from robots.errors import twice
from robots.schema.quantities import Strict

NumberVariable = Literal["1/value", "ln value", "value"]
NumberStatus = Literal["determined", "one-sided", "not identified"]

# Shares of the product of standard deviations: round-off of a matrix that was inverted and written in full.
ROUND_OFF = 1e-9
# More degrees of freedom than this are written as this: Student's t is the normal distribution to 1e-6.
MOST_DEGREES_OF_FREEDOM = 1e6


class UndeterminedNumber(Strict):
    """A number without a variance: at an end of its range, or one that no reading moved with.

    ``low``, ``high``: what the readings do say, 95 %, in ``unit``; a side that is not given is open.
    """

    name: str
    status: Literal["at bound", "not identified"]
    unit: str
    low: float | None = None
    high: float | None = None
    note: str


class CalibrationUncertainty(Strict):
    """Covariance of the numbers that a calibration found.

    ``parameters``: names as in ``calibrate --free`` (``j2.stiffness``, ``j3.law[0]``, ``forearm.modulus``).
    ``variable``: what the covariance is of, number by number: one over the value, its natural logarithm, or the value
    itself, of the value in the SI ``unit`` (coefficients of laws are those of ln k already: their variable is
    "value"). ``estimate``: the variables at the file's own numbers. ``covariance``: of the variables, symmetric and
    positive semi-definite. ``degrees_of_freedom``: of Student's t; 1e6 stands for a normal distribution. ``status``:
    "one-sided" (the 95 % interval reaches an end of the range, for a stiffness: rigid is possible), "not identified"
    (only combinations with others are, or any value of the range fits). ``undetermined_directions``: combinations of
    the variables, length one, that no reading determines; the covariance knows nothing of them. ``undetermined``:
    numbers that have no variance.
    """

    parameters: tuple[str, ...]
    unit: tuple[str, ...]
    variable: tuple[NumberVariable, ...]
    estimate: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    degrees_of_freedom: tuple[float, ...]
    status: tuple[NumberStatus, ...]
    undetermined_directions: tuple[tuple[float, ...], ...] = ()
    undetermined: tuple[UndeterminedNumber, ...] = ()
    note: str = Field(min_length=1)

    def interval95(self, k: int) -> tuple[float, float, float]:
        """Value of a parameter and the ends of its 95 % interval, in ``unit``; an open upper end is infinite."""
        from scipy.special import stdtrit

        half = float(stdtrit(self.degrees_of_freedom[k], 0.975)) * math.sqrt(self.covariance[k][k])
        middle, *ends = (_value(self.estimate[k] + off, self.variable[k]) for off in (0.0, -half, half))
        return middle, min(ends), max(ends)

    @model_validator(mode="after")
    def _one_entry_each(self) -> Self:
        p = len(self.parameters)
        for key in ("unit", "variable", "estimate", "covariance", "degrees_of_freedom", "status"):
            if len(getattr(self, key)) != p:
                raise ValueError(f"{key} has {len(getattr(self, key))} entries for {p} parameters")
        for key in ("covariance", "undetermined_directions"):
            if any(len(row) != p for row in getattr(self, key)):
                raise ValueError(f"every row of {key} needs {p} numbers, one for each parameter")
        names = (*self.parameters, *(u.name for u in self.undetermined))
        if more := twice(names):
            raise ValueError(f"named twice: {', '.join(more)}")
        if not names:
            raise ValueError("names no number: leave the table out")
        if any(not nu > 0.0 for nu in self.degrees_of_freedom):
            raise ValueError("degrees_of_freedom must be above zero")
        if any(not any(row) for row in self.undetermined_directions):
            raise ValueError("a row of undetermined_directions is all zeros")
        return self

    @model_validator(mode="after")
    def _a_covariance(self) -> Self:
        if not self.parameters or len(self.covariance) != len(self.parameters):
            return self
        V = np.array(self.covariance)
        variance = np.diag(V)
        if (variance < 0.0).any():
            raise ValueError(f"covariance: variance of {self.parameters[int(np.argmin(variance))]} is negative")
        sd = np.sqrt(variance)
        size = np.outer(sd, sd)
        if (np.abs(V - V.T) > ROUND_OFF * size).any():
            raise ValueError("covariance is not symmetric")
        if (V[size == 0.0] != 0.0).any():
            raise ValueError("covariance: a number without variance has a covariance with another")
        scaled = V / np.where(size > 0.0, size, 1.0)
        least = float(np.linalg.eigvalsh(0.5 * (scaled + scaled.T))[0])
        if least < -ROUND_OFF * len(V):
            raise ValueError(
                f"covariance is not positive semi-definite: smallest eigenvalue of the correlations {least:.3g}"
            )
        return self


def _value(x: float, variable: NumberVariable) -> float:
    if variable == "1/value":
        return 1.0 / x if x > 0.0 else math.inf
    return math.exp(x) if variable == "ln value" else x
