"""A calibration as a file: which parameters are free, in which ranges, with which priors, in which stages.

docs/reference/calibration_files.md describes the format, which is one for all: parameters at once, stages of least
squares, level studies, and the published scheme of level studies pose by pose with a regression over the angle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from doe.estimation.study_plan import Comparison, RegressionChoice, SpringRange
from fem import ArmModel
from fem.effects.base import PlacedEffect
from fem.free.parameters import FreeLaw, Parameter, law_parameters, parameter, polynomial_basis
from fem.springs import Basis, FourierBasis, TableBasis
from robots import InputError, Robot
from robots.files.reading import parse_toml, read_text
from robots.files.validated import validated
from robots.schema.quantities import Strict

SCHEMA: Literal["stiffarm-calibration/1"] = "stiffarm-calibration/1"
# With fewer levels the neighbours of the best one are the whole grid, and nothing gets finer.
FEWEST_LEVELS, MOST_RUNS = 4, 20_000


class Prior(Strict):
    """What is known before: a value within a ``factor`` (positive numbers) or give or take ``sd``, one deviation."""

    value: float
    factor: float | None = Field(default=None, gt=1.0)
    sd: PositiveFloat | None = None
    source: str

    @model_validator(mode="after")
    def _one_width(self) -> Self:
        if (self.factor is None) == (self.sd is None):
            raise ValueError("a prior needs exactly one of 'factor' and 'sd'")
        return self


class Freed(Strict):
    """A number set free: its name, and its range and prior where they are not the usual ones (SI, deg for angles)."""

    name: str
    lower: float | None = None
    upper: float | None = None
    prior: Prior | None = None


class PolynomialChoice(Strict):
    """ln k as a polynomial of total degree ``degree`` in joint coordinates."""

    kind: Literal["polynomial"]
    joint: str
    inputs: tuple[str, ...] = Field(min_length=1, max_length=3)
    degree: int = Field(default=6, ge=0, le=6)
    spread: PositiveFloat = 1.0


class FourierChoice(Strict):
    """ln k as a Fourier series of one joint coordinate."""

    kind: Literal["fourier"]
    joint: str
    input: str
    order: int = Field(default=2, ge=1, le=6)
    spread: PositiveFloat = 1.0


class TableChoice(Strict):
    """ln k linear between nodes of one joint coordinate."""

    kind: Literal["table"]
    joint: str
    input: str
    nodes_deg: tuple[float, ...] = Field(min_length=2, max_length=20)


LawChoice = Annotated[PolynomialChoice | FourierChoice | TableChoice | RegressionChoice, Field(discriminator="kind")]


class NoiseChoice(Strict):
    """The gauge's resolution, and whether outliers may lose weight."""

    gauge_mm: PositiveFloat = 0.01
    gauge_mrad: PositiveFloat = 0.01
    robust: bool = True

    @property
    def floor(self) -> tuple[float, float]:
        """Least standard deviation of a reading (m, rad): what rounding to the gauge's digit leaves, digit / sqrt(12).

        The whole digit would be 3.5 times too much: intervals of readings finer than it would be as much too wide.
        """
        return self.gauge_mm * 1e-3 / math.sqrt(12.0), self.gauge_mrad * 1e-3 / math.sqrt(12.0)


class Stage(Strict):
    """One stage: these numbers, on these poses and loads (none named: all), others held where they are.

    ``levels``: a parametric study over that many levels of each number instead of least squares; ``refine``: go on
    with finer levels around the best one. Laws of the kind "regression" are studied at each pose by itself.
    """

    name: str
    parameters: tuple[str, ...] = Field(min_length=1)
    poses: tuple[str, ...] = ()
    loads_N: tuple[PositiveFloat, ...] = ()  # noqa: N815
    levels: int | None = Field(default=None, ge=FEWEST_LEVELS, le=100)
    refine: bool = True

    @model_validator(mode="after")
    def _not_too_many(self) -> Self:
        if self.levels is not None and self.levels ** len(self.parameters) > MOST_RUNS:
            raise ValueError(f"{self.levels} levels of {len(self.parameters)} numbers are more than {MOST_RUNS} runs")
        return self


class Campaign(Strict):
    """A whole calibration file; without stages everything is estimated at once."""

    schema_version: Literal["stiffarm-calibration/1"] = Field(alias="schema")
    robot: str
    title: str
    source: str = "assumed"
    loads_N: tuple[PositiveFloat, ...] = ()  # noqa: N815
    noise: NoiseChoice = NoiseChoice()
    springs: SpringRange = SpringRange()
    parameter: tuple[Freed, ...] = ()
    law: tuple[LawChoice, ...] = ()
    stage: tuple[Stage, ...] = ()
    compare: Comparison | None = None

    @model_validator(mode="after")
    def _names_fit(self) -> Self:
        names = self.names
        if not names:
            raise ValueError("nothing is set free: add a [[parameter]] or a [[law]]")
        twice = sorted({n for n in names if names.count(n) > 1})
        if twice:
            raise ValueError(f"{', '.join(twice)}: set free twice")
        for stage in self.stage:
            unknown = [n for n in stage.parameters if n not in names]
            if unknown:
                raise ValueError(f"stage {stage.name!r}: {', '.join(unknown)} is not among the numbers set free")
            _check_levels(stage, [f"{law.joint}.law" for law in self.regressions])
        used = [n for stage in self.stage for n in stage.parameters]
        again = sorted({n for n in (f"{law.joint}.law" for law in self.regressions) if used.count(n) > 1})
        if again:
            raise ValueError(f"{', '.join(again)}: studied in two stages")
        left = [n for n in names if (self.stage or self.regressions) and n not in used]
        if left:
            raise ValueError(f"no stage estimates {', '.join(left)}")
        labels = [stage.name for stage in self.stage]
        if len(set(labels)) < len(labels):
            raise ValueError("two stages have the same name")
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Names of everything that is set free."""
        return (*(p.name for p in self.parameter), *(f"{law.joint}.law" for law in self.law))

    @property
    def regressions(self) -> tuple[RegressionChoice, ...]:
        """Laws through springs that are found pose by pose."""
        return tuple(law for law in self.law if isinstance(law, RegressionChoice))

    @property
    def beside(self) -> Comparison:
        """What the whole chain does beside the stages; InputError where the file does not say."""
        if self.compare is None:
            raise InputError(
                f"{self.title!r} has no [compare] tables",
                code="C002",
                allowed="[compare.sensitivity] and [compare.global], as a rule [compare.factorial] too",
                remedy="add them (docs/reference/calibration_files.md), or only calibrate (--campaign)",
            )
        return self.compare

    def check_against(self, robot: Robot) -> None:
        """Raise InputError where a regression or a comparison names a joint or coordinate that the robot has not."""
        joints = [law.joint for law in self.regressions]
        coordinates = [name for law in self.regressions for name in law.inputs]
        if self.compare is not None:
            joints += [*self.compare.sensitivity.joints, *self.compare.constant.joints]
            coordinates += () if self.compare.factorial is None else self.compare.factorial.inputs
        for what, names, known in (
            ("joint", joints, robot.joint_names),
            ("joint coordinate", coordinates, robot.coordinates),
        ):
            for name in names:
                if name not in known:
                    where = f"calibration file {self.title!r}: {what} of {robot.name}"
                    raise InputError(where, code="C002", value=name, allowed=", ".join(known))

    def free(
        self, model: ArmModel, only: tuple[str, ...] | None = None, effects: Sequence[PlacedEffect] = ()
    ) -> tuple[tuple[Parameter, ...], tuple[FreeLaw, ...]]:
        """Parameters and laws of this campaign (or of the numbers named) for a model with ``effects``.

        Raises
        ------
        InputError
            A number, joint or coordinate that this model does not have.
        """
        out: list[Parameter] = []
        laws: list[FreeLaw] = []
        for freed in self.parameter:
            if only is None or freed.name in only:
                out.append(_parameter(model, freed, effects))
        for law in self.law:
            if not isinstance(law, RegressionChoice) and (only is None or f"{law.joint}.law" in only):
                basis = _basis(model, law)
                spread = 1.0 if law.kind == "table" else law.spread
                laws.append(FreeLaw(law.joint, basis, len(out)))
                out += law_parameters(model, law.joint, basis, spread)
        return tuple(out), tuple(laws)


def _check_levels(stage: Stage, regressions: Sequence[str]) -> None:
    """Laws through springs found pose by pose need levels, and other laws have none."""
    studied = [n for n in stage.parameters if n in regressions]
    if studied and (stage.levels is None or not stage.poses or len(studied) < len(stage.parameters)):
        raise ValueError(
            f"stage {stage.name!r}: {', '.join(studied)} (regression) needs 'levels' and 'poses', and a stage to itself"
        )
    if not studied and stage.levels is not None and any(n.endswith(".law") for n in stage.parameters):
        raise ValueError(f"stage {stage.name!r}: a law of this kind has no levels; leave 'levels' out")


def bundled_campaign(robot: str) -> Campaign | None:
    """Return the published calibration that comes with a bundled robot, or None."""
    file = resources.files("doe").joinpath("schemes", f"{robot}.toml")
    if not file.is_file():
        return None
    return parse_campaign(file.read_text(encoding="utf-8"), f"bundled calibration file {robot}")


def load_campaign(path: Path) -> Campaign:
    """Read a calibration file.

    Raises
    ------
    InputError
        The file is missing, unreadable, or does not fit the schema (all faults at once).
    """
    return parse_campaign(read_text(path, "calibration file"), str(path))


def parse_campaign(text: str, where: str) -> Campaign:
    """Parse and validate a calibration file; ``where`` names it in messages."""
    data = parse_toml(text, where)
    if data.get("schema") == "stiffarm-scheme/1":
        raise InputError(
            f"{where}: schema",
            code="F006",
            value="stiffarm-scheme/1",
            allowed=SCHEMA,
            remedy="write it as a calibration file: each [[law]] with kind = 'regression', stages with parameters = "
            "['j2.law'] for joints = ['j2'], bounds under [springs], gauge_mm under [noise], the rest under [compare]; "
            "docs/reference/calibration_files.md shows one",
        )
    return validated(Campaign, data, where)


def campaign_of(robot: str, names: tuple[str, ...]) -> Campaign:
    """The campaign that estimates some numbers at once, as ``--free`` asks for."""
    return Campaign(
        schema=SCHEMA, robot=robot, title=f"{len(names)} numbers at once", parameter=tuple(Freed(name=n) for n in names)
    )


def _parameter(model: ArmModel, freed: Freed, effects: Sequence[PlacedEffect]) -> Parameter:
    p = parameter(model, freed.name, effects)
    angle = math.pi / 180.0 if p.unit == "rad" else 1.0
    lower = p.lower if freed.lower is None else freed.lower * angle
    upper = p.upper if freed.upper is None else freed.upper * angle
    if (lower, upper) != (p.lower, p.upper):
        p = p.between(lower, upper)
    if freed.prior is None:
        return p
    mean = freed.prior.value * angle
    if p.scale == "linear":
        if freed.prior.sd is None:
            raise InputError(
                f"prior of {p.name}", code="M002", value="factor", allowed="sd: this number may be zero or negative"
            )
        return replace(p, prior=(mean, freed.prior.sd * angle))
    if freed.prior.factor is None or not mean > 0.0:
        raise InputError(
            f"prior of {p.name}", code="M002", value=freed.prior.value, allowed="a value above 0 with a factor above 1"
        )
    return replace(p, prior=(math.log(mean), math.log(freed.prior.factor)))


def _basis(model: ArmModel, law: PolynomialChoice | FourierChoice | TableChoice) -> Basis:
    if isinstance(law, PolynomialChoice):
        return polynomial_basis(model, law.inputs, law.degree)
    column = model.robot.coordinate_index(law.input)
    if isinstance(law, FourierChoice):
        return FourierBasis(column, law.order)
    nodes = np.radians(law.nodes_deg)
    if not np.all(np.diff(nodes) > 0.0):
        raise InputError(
            f"nodes of the law of {law.joint} (deg)", code="C002", value=law.nodes_deg, allowed="rising numbers"
        )
    return TableBasis(column, nodes)
