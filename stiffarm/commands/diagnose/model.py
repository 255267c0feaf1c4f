"""The model file that a diagnosis writes: springs as fitted, effects found, and where each number came from."""

from __future__ import annotations

from collections.abc import Mapping

from doe.calibration.written import calibration_table
from doe.certainty.uncertainty import ParameterEstimate
from doe.diagnosis.diagnose import State
from doe.diagnosis.findings.numbers import fitted_springs, numbers_of, uncertainty_of
from doe.model_file.applied import note_of
from fem.effects import LOAD_PATH, PlacedEffect, with_effects, without_effect
from robots import ModelDescription
from robots.quantities import significant
from robots.schema.description import Calibration as Origin
from robots.schema.description import CalibrationUncertainty
from robots.schema.quantities import RotationalStiffness
from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.commands.calibrate.words import bound_of
from stiffarm.commands.diagnose.step import Diagnosed

SPRING_SOURCE, EFFECT_SOURCE = "calibrated", "diagnosed"


def springs_of(d: Diagnosed) -> tuple[ParameterEstimate, ...]:
    """Springs of the new model: as `calibrate` finds them where nothing is added to the model, else as fitted with it.

    The same springs of the same model and readings have one value and one interval.
    """
    calibrated = _as_calibrated(d)
    return fitted_springs(d.found.after) if calibrated is None else calibrated.springs


def _as_calibrated(d: Diagnosed) -> Calibrated | None:
    """What `calibrate` finds; None where the model has effects, or a spring has no value that a file can hold."""
    if d.calibrated is None or d.found.after.setting.accepted:
        return None
    open_ = [s for s in d.calibrated.springs if s.status == "not identified" or bound_of(s) == "soft"]
    return None if open_ else d.calibrated


def described(d: Diagnosed) -> ModelDescription:
    """The new model: what was given, with springs fitted and effects found.

    Where the verdict is not certain, the effects in it are marked as provisional.
    """
    after = d.found.after
    description = _with_springs(d, after)
    placed = list(after.setting.accepted)
    if any(t.code == LOAD_PATH for t in description.effect) and any(e.effect.code == LOAD_PATH for e in placed):
        # The other path than the one of the effect is the file's own.
        description = without_effect(description, LOAD_PATH)
        placed = [e for e in placed if e.effect.code != LOAD_PATH]
    if placed:
        text = f"diagnosis on {d.used.source}, SHA-256 {d.used.sha256}"
        description = with_effects(description, placed, EFFECT_SOURCE, _notes(d, placed), text)
    data = description.model_dump(by_alias=True)
    data["sources"] = {
        **data["sources"],
        SPRING_SOURCE: f"fitted with the diagnosis on {d.used.source}, SHA-256 {d.used.sha256}",
    }
    data["calibration"] = Origin(
        scheme="diagnosis",
        load_path=d.given.model.load_path,
        links=d.given.model.link_kind,
        data=d.used.source,
        data_sha256=d.used.sha256,
        rms_mm=after.fit_rms_mm,
        loads_N=d.request.loads or d.used.levels_N,
        notes=_origin_notes(d),
        uncertainty=_uncertainty(d),
    ).model_dump()
    return ModelDescription.model_validate(data)


def _with_springs(d: Diagnosed, after: State) -> ModelDescription:
    springs = {
        e.parameter.place: None
        if bound_of(e)
        else RotationalStiffness(value=float(f"{e.value:.9g}"), unit="N m/rad", source=SPRING_SOURCE, note=note_of(e))
        for e in springs_of(d)
    }
    joints = [
        joint.model_copy(update={"stiffness": springs[joint.name]}) if joint.name in springs else joint
        for joint in d.given.description.joint
    ]
    has_path = any(table.code == LOAD_PATH for table in d.given.description.effect)
    path = d.given.description.load_path if has_path else d.given.model.load_path
    sources = {**d.given.description.sources, SPRING_SOURCE: "diagnosis"}
    update = {"joint": tuple(joints), "load_path": path, "sources": sources}
    return d.given.description.model_copy(update=update)


def _notes(d: Diagnosed, placed: list[PlacedEffect]) -> Mapping[str, str]:
    """By CODE.NAME: how sure, and whether the effect is provisional."""
    provisional = {f.code for f in d.found.provisional}
    codes = {e.effect.code for e in placed}
    out = {}
    for n in numbers_of(d.found.after):
        if n.code in codes:
            sure = "the best of the values tried"
            if n.sd is not None:
                sure = f"standard deviation {n.sd:.2g} {n.unit}".removesuffix(" 1")
            out[n.code_and_name] = ("provisional; " if n.code in provisional else "") + sure
    return out


def _origin_notes(d: Diagnosed) -> tuple[str, ...]:
    out = [f"verdict of the diagnosis: {d.found.verdict} ({d.found.reason})"]
    codes = ", ".join(f.code for f in d.found.provisional)
    if codes:
        out.append(f"provisional, these readings do not settle it: {codes}")
    out += [
        f"spring {s.parameter.place}: rigid fits best, at least {significant(s.interval[0])} N m/rad"
        for s in springs_of(d)
        if bound_of(s)
    ]
    return tuple(out)


def _uncertainty(d: Diagnosed) -> CalibrationUncertainty | None:
    """The covariance that belongs to the springs of the new model."""
    calibrated = _as_calibrated(d)
    return uncertainty_of(d.found.after) if calibrated is None else calibration_table(calibrated.found)
