"""Robots with springs whose uncertainty is made up, for tests of what it does to the compliance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

import fem
from doe.certainty.propagation import ParameterUncertainty, parameter_uncertainty
from doe.model_file.uncertainty_table import FoundNumber, uncertainty_table
from fem import ArmModel
from fem.effects import build_arm, described_effects
from fem.free.parameters import described_variables, named_numbers
from robots import ModelDescription, load_description
from robots.library.models import parse_description, to_toml
from robots.schema.description import Calibration, CalibrationUncertainty, LogFourierLaw, TableLaw
from robots.schema.quantities import RotationalStiffness

SPRINGS = {"j1": 1.5e6, "j2": 9e5, "j3": 1.1e6, "j4": 2.4e5, "j5": 1.5e5, "j6": 1e5}
DOWN = np.array([0.0, 0.0, -1.0])


def sprung(name: str = "kr60-3", springs: Mapping[str, float] = SPRINGS) -> ModelDescription:
    """A bundled robot with constant springs, its other joints rigid."""
    given = load_description(name)

    def spring(joint: str) -> RotationalStiffness | None:
        k = springs.get(joint)
        return None if k is None else RotationalStiffness(value=k, unit="N m/rad", source="assumed")

    return given.model_copy(
        update={"joint": tuple(j.model_copy(update={"stiffness": spring(j.name)}) for j in given.joint)}
    )


def with_table(given: ModelDescription, table: CalibrationUncertainty | None, links: str = "beam") -> ModelDescription:
    origin = Calibration(
        scheme="global",
        load_path=given.load_path,
        links=links,
        data="made up",
        data_sha256="0" * 64,
        rms_mm=0.01,
        loads_N=(),
        uncertainty=table,
    )
    return parse_description(to_toml(given.model_copy(update={"calibration": origin})), "model.toml")


def table_of(
    given: ModelDescription,
    names: Sequence[str],
    correlated: float = 0.3,
    relative: float = 0.05,
    dof: float = 1e6,
    blind: np.ndarray | None = None,
) -> CalibrationUncertainty:
    """Standard deviations as a share of the variables (of 1 where these are logarithms), all equally correlated."""
    model = build_arm(given)
    effects = described_effects(given, model)
    numbers = named_numbers(model, names, effects)
    own = described_variables(given, numbers)
    mine = [numbers.parameters[k] for k in numbers.columns]
    sd = np.array([relative * (abs(u) if p.scale == "compliance" else 1.0) for p, u in zip(mine, own, strict=True)])
    V = np.outer(sd, sd) * (correlated + (1.0 - correlated) * np.eye(len(sd)))
    found = [
        FoundNumber(name, p.unit, p.scale, float(u), (math.nan, math.nan), "determined", dof, has_variance=True)
        for name, p, u in zip(names, mine, own, strict=True)
    ]
    made = uncertainty_table(found, V, np.zeros((0, len(names))) if blind is None else blind, "made up")
    assert made is not None
    return made


def known(given: ModelDescription) -> ParameterUncertainty:
    found = parameter_uncertainty(given)
    assert found is not None
    return found


def along(model: ArmModel, q: np.ndarray, d: np.ndarray = DOWN) -> np.ndarray:
    return np.asarray(1.0 / fem.directional_stiffness(model, q, d))


def with_laws(given: ModelDescription) -> ModelDescription:
    """Joint 2 with a table, joint 3 with a Fourier law."""
    table = TableLaw(
        kind="table",
        input="q2_deg",
        nodes_deg=(-120.0, -60.0, 0.0),
        stiffness_Nm_per_rad=(8e5, 1e6, 9e5),
        source="assumed",
    )
    waves = LogFourierLaw(kind="log-fourier", input="q3_deg", coefficients=(13.7, 0.2, -0.1), source="assumed")
    laws = {"j2": table, "j3": waves}
    joints = tuple(j.model_copy(update={"stiffness": laws[j.name]}) if j.name in laws else j for j in given.joint)
    return given.model_copy(update={"joint": joints})
