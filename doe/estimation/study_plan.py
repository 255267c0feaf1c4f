"""Parts of a calibration file beside free parameters: sensitivities, a factorial, where springs are expected."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, PositiveFloat, model_validator

from robots.schema.quantities import Strict


class SpringRange(Strict):
    """Where joint springs are expected, and where those that no stage has reached yet stand, N m/rad.

    A range, not a bound: it is widened where the readings ask for it, and that is said.
    """

    low_Nm_per_rad: PositiveFloat = 1e5  # noqa: N815
    high_Nm_per_rad: PositiveFloat = 1e6  # noqa: N815
    start_Nm_per_rad: PositiveFloat = 1e6  # noqa: N815

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.low_Nm_per_rad < self.high_Nm_per_rad:
            raise ValueError("low_Nm_per_rad must be below high_Nm_per_rad")
        return self

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper end."""
        return self.low_Nm_per_rad, self.high_Nm_per_rad


class RegressionChoice(Strict):
    """ln k through the springs found pose by pose, as a polynomial of total degree ``degree`` in joint coordinates.

    ``symmetric_in``: a coordinate whose sign makes no difference; each point then counts mirrored too.
    """

    kind: Literal["regression"]
    joint: str
    inputs: tuple[str, ...] = Field(min_length=1, max_length=3)
    degree: int = Field(default=6, ge=0, le=10)
    symmetric_in: str | None = None

    @model_validator(mode="after")
    def _symmetry_is_an_input(self) -> Self:
        if self.symmetric_in is not None and self.symmetric_in not in self.inputs:
            raise ValueError(f"symmetric_in {self.symmetric_in!r} is not one of the inputs")
        return self


class SensitivityPlan(Strict):
    """Which springs are varied on which poses."""

    joints: tuple[str, ...] = Field(min_length=1)
    poses: tuple[str, ...] = Field(min_length=1)


class GlobalPlan(Strict):
    """Constant springs fitted to all readings at once."""

    joints: tuple[str, ...] = Field(min_length=1)


class Condition(Strict):
    """A factorial level at which other levels apply."""

    coordinate: str
    equals_deg: float


class Adjustment(Strict):
    """Levels of one factor that replace the usual ones under a condition."""

    when: Condition
    coordinate: str
    levels_deg: tuple[float, ...] = Field(min_length=1)


class Factorial(Strict):
    """A full factorial with conditional levels; the first input varies slowest."""

    inputs: tuple[str, ...]
    levels_deg: tuple[tuple[float, ...], ...]
    adjust: tuple[Adjustment, ...] = ()

    @model_validator(mode="after")
    def _levels_for_each_input(self) -> Self:
        if len(self.levels_deg) != len(self.inputs) or any(len(row) == 0 for row in self.levels_deg):
            raise ValueError("levels_deg needs one non-empty list for each input")
        if len(set(self.inputs)) < len(self.inputs):
            raise ValueError("an input is named twice")
        for rule in self.adjust:
            if rule.coordinate not in self.inputs:
                raise ValueError(f"adjust: coordinate {rule.coordinate!r} is not one of the inputs")
            # Levels are filled in from the first input on, so a rule can only look back.
            if rule.when.coordinate not in self.inputs[: self.inputs.index(rule.coordinate)]:
                condition = rule.when.coordinate
                raise ValueError(f"adjust: when.coordinate {condition!r} is not an input before {rule.coordinate!r}")
        return self


class Comparison(Strict):
    """What the whole chain (``stiffarm run``) and ``stiffarm sensitivity`` do beside the stages.

    Without a ``factorial``, a run takes the angles that matter to the model that it recommends.
    """

    sensitivity: SensitivityPlan
    constant: GlobalPlan = Field(alias="global")
    factorial: Factorial | None = None
