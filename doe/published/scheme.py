"""A calibration scheme as data: stages, levels, laws and the factorial, read from TOML."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, PositiveFloat, ValidationError, model_validator

from robots import InputError, InputErrors, Robot
from robots.files.reading import parse_toml, read_text
from robots.schema.quantities import Strict

# With fewer levels the neighbours of the best one are the whole grid, and nothing gets finer.
FEWEST_LEVELS = 4

# pydantic's error type -> (what the user reads instead of pydantic's words, remedy).
_WORDS = {
    "missing": ("this key is missing", "add it"),
    "extra_forbidden": ("unknown key", "check its spelling, or remove it"),
}


class SensitivityPlan(Strict):
    """Which springs are varied on which poses."""

    joints: tuple[str, ...] = Field(min_length=1)
    poses: tuple[str, ...] = Field(min_length=1)


class Stage(Strict):
    """One parametric study: these springs, on these poses, with this many levels each."""

    name: str
    joints: tuple[str, ...] = Field(min_length=1, max_length=3)
    poses: tuple[str, ...] = Field(min_length=1)
    levels: int = Field(ge=FEWEST_LEVELS, le=100)


class Law(Strict):
    """The joint coordinates a spring's regression depends on; ``symmetric_in`` adds mirrored points."""

    joint: str
    inputs: tuple[str, ...] = Field(min_length=1, max_length=3)
    symmetric_in: str | None = None

    @model_validator(mode="after")
    def _symmetry_is_an_input(self) -> Self:
        if self.symmetric_in is not None and self.symmetric_in not in self.inputs:
            raise ValueError(f"symmetric_in {self.symmetric_in!r} is not one of the inputs")
        return self


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


class Scheme(Strict):
    """A whole scheme file."""

    schema_version: Literal["stiffarm-scheme/1"] = Field(alias="schema")
    robot: str
    title: str
    source: str
    loads_N: tuple[float, ...] = ()  # noqa: N815
    gauge_mm: PositiveFloat = 0.01
    low_Nm_per_rad: PositiveFloat  # noqa: N815
    high_Nm_per_rad: PositiveFloat  # noqa: N815
    initial_Nm_per_rad: PositiveFloat  # noqa: N815
    regression_degree: int = Field(default=6, ge=0, le=10)
    sensitivity: SensitivityPlan
    stage: tuple[Stage, ...] = Field(min_length=1)
    law: tuple[Law, ...]
    constant: GlobalPlan = Field(alias="global")
    factorial: Factorial

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Self:
        if not self.low_Nm_per_rad < self.high_Nm_per_rad:
            raise ValueError("low_Nm_per_rad must be below high_Nm_per_rad")
        missing = sorted({j for s in self.stage for j in s.joints} - {law.joint for law in self.law})
        if missing:
            raise ValueError(f"no [[law]] for {', '.join(missing)}")
        for kind, names in (
            ("calibrated in two stages", [joint for stage in self.stage for joint in stage.joints]),
            ("given two laws", [law.joint for law in self.law]),
            ("the name of two stages", [stage.name for stage in self.stage]),
        ):
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise ValueError(f"{', '.join(twice)}: {kind}")
        return self

    def check_against(self, robot: Robot) -> None:
        """Raise InputError where the scheme names a joint or coordinate that the robot has not."""
        joints = [
            *self.sensitivity.joints,
            *self.constant.joints,
            *(law.joint for law in self.law),
            *(joint for stage in self.stage for joint in stage.joints),
        ]
        for joint in joints:
            if joint not in robot.joint_names:
                raise InputError(
                    f"scheme {self.title!r}: joint of {robot.name}",
                    value=joint,
                    allowed=", ".join(robot.joint_names),
                )
        for coordinate in [*self.factorial.inputs, *(name for law in self.law for name in law.inputs)]:
            if coordinate not in robot.coordinates:
                raise InputError(
                    f"scheme {self.title!r}: joint coordinate of {robot.name}",
                    value=coordinate,
                    allowed=", ".join(robot.coordinates),
                )


def bundled_scheme(robot: str) -> Scheme | None:
    """Return the scheme that comes with a bundled robot, or None."""
    file = resources.files("doe").joinpath("schemes", f"{robot}.toml")
    if not file.is_file():
        return None
    return parse_scheme(file.read_text(encoding="utf-8"), f"bundled scheme {robot}")


def load_scheme(path: Path) -> Scheme:
    """Read a scheme TOML.

    Raises
    ------
    InputError
        The file is missing, unreadable, or does not fit the schema (all faults at once).
    """
    return parse_scheme(read_text(path, "scheme file"), str(path))


def parse_scheme(text: str, where: str) -> Scheme:
    """Parse and validate a scheme; ``where`` names it in messages."""
    data = parse_toml(text, where)
    try:
        return Scheme.model_validate(data)
    except ValidationError as error:
        faults = [_fault(where, item) for item in error.errors()]
        raise (faults[0] if len(faults) == 1 else InputErrors(where, faults)) from error


def _fault(where: str, item: Any) -> InputError:
    message, remedy = _WORDS.get(
        item["type"], (str(item["msg"]).removeprefix("Value error, "), "correct it in the file")
    )
    value = item["input"]
    shown = value if isinstance(value, str | int | float | list) else None
    place = ".".join(map(str, item["loc"])) or "file"
    return InputError(f"{where}: {place}: {message}", value=shown, remedy=remedy)
