"""Calibrated springs put back into a model description, with where they came from."""

from __future__ import annotations

import math
from collections.abc import Mapping

from doe.model_file.carried_on import carried_on
from doe.model_file.uncertainty_table import NO_COVARIANCE, NO_SPARE, constant_fit_table
from doe.published.constant import ConstantFit
from doe.tables.measurements import Measurements
from fem import ArmModel
from robots import ModelDescription
from robots.schema.description import Calibration, CalibrationUncertainty, Joint, LogPolynomialLaw
from robots.schema.quantities import RotationalStiffness

SOURCE_KEY = "calibrated"


def with_constant_springs(
    description: ModelDescription,
    model: ArmModel,
    fit: ConstantFit,
    data: Measurements,
    loads_N: tuple[float, ...],
) -> ModelDescription:
    """The description with constant springs; one that no reading moves keeps what it had."""
    springs: dict[str, RotationalStiffness | LogPolynomialLaw] = {}
    for estimate in fit.springs:
        if math.isnan(estimate.stiffness):
            continue
        low, high = estimate.interval
        upper = "no upper limit" if math.isinf(high) else f"{high:.3g}"
        note = f"{estimate.status}; 95 % interval {low:.3g} to {upper} N m/rad"
        springs[estimate.joint] = RotationalStiffness(
            value=float(estimate.stiffness), unit="N m/rad", source=SOURCE_KEY, note=note
        )
    found = model.with_springs({s.joint: s.stiffness for s in fit.springs if not math.isnan(s.stiffness)})
    sure = constant_fit_table(fit, carried_on(description, found, [f"{s.joint}.stiffness" for s in fit.springs]))
    notes = fit.remarks if sure is not None else (*fit.remarks, NO_SPARE)
    return _calibrated(description, model, springs, "global", data, loads_N, fit.rms_mm, notes, sure)


def with_spring_laws(
    description: ModelDescription,
    model: ArmModel,
    laws: Mapping[str, LogPolynomialLaw],
    data: Measurements,
    loads_N: tuple[float, ...],
    rms_mm: float,
    remarks: tuple[str, ...],
) -> ModelDescription:
    """The description with angle-dependent springs of the staged scheme, which has no covariance: a note says so."""
    springs = {joint: law.model_copy(update={"source": SOURCE_KEY}) for joint, law in laws.items()}
    notes = (*remarks, NO_COVARIANCE)
    return _calibrated(description, model, springs, "staged", data, loads_N, rms_mm, notes, None)


def _calibrated(
    description: ModelDescription,
    model: ArmModel,
    springs: Mapping[str, RotationalStiffness | LogPolynomialLaw],
    scheme: str,
    data: Measurements,
    loads_N: tuple[float, ...],
    rms_mm: float,
    notes: tuple[str, ...],
    uncertainty: CalibrationUncertainty | None,
) -> ModelDescription:
    joints: list[Joint] = [
        joint.model_copy(update={"stiffness": springs[joint.name]}) if joint.name in springs else joint
        for joint in description.joint
    ]
    source = f"{scheme} calibration on {data.source}, SHA-256 {data.sha256}"
    changed = description.model_copy(
        update={
            "joint": tuple(joints),
            "load_path": model.load_path,
            "sources": {**description.sources, SOURCE_KEY: source},
            "calibration": Calibration(
                scheme=scheme,
                load_path=model.load_path,
                links=model.link_kind,
                data=data.source,
                data_sha256=data.sha256,
                rms_mm=rms_mm,
                loads_N=loads_N,
                notes=notes,
                uncertainty=uncertainty,
            ),
        }
    )
    # Through the validator once more: a written file must be one that can be read.
    return ModelDescription.model_validate(changed.model_dump(by_alias=True))
