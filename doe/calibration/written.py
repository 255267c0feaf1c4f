"""What a calibration writes into the model file: where its numbers are from, and their joint covariance.

Errors of earlier stages go on into what later ones find. To first order a stage's error is
``e_s = own_s - S_s W_s^T sum_r W_r e_r``: its own, of covariance S_s, and what the errors e_r of numbers held from
earlier stages make of it through the whitened derivatives W of its readings (numbers found in sequence, "two-step
estimators": Newey & McFadden 1994, doi:10.1016/S1573-4412(05)80005-4, section 6).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from doe.calibration.run import Calibration, StageResult
from doe.certainty.uncertainty import ParameterEstimate
from doe.estimation.problem import Problem
from doe.model_file.uncertainty_table import NOTHING, CarriedOn, FoundNumber, carried_on, uncertainty_table
from doe.tables.measurements import Measurements
from fem.effects import LOAD_PATH
from fem.elements.walls import wall_flexibilities
from fem.free.model import FreeModel
from fem.free.parameters import NamedNumbers, Parameter, described_variables, named_numbers
from robots import ModelDescription
from robots.arrays import Array
from robots.schema.description import Calibration as Origin
from robots.schema.uncertainty import CalibrationUncertainty

SOURCE_KEY = "calibrated"
NO_COVARIANCE = (
    "no covariance of the springs is kept: studies pose by pose take the best of their levels, with no spare reading "
    "to judge their errors by (--scheme global gives one)"
)
NO_SPARE = "no covariance of the springs is kept: as many springs as readings leave nothing to judge their errors by"


def with_origin(
    found: Calibration, data: Measurements, loads_N: Sequence[float] = (), notes: Sequence[str] = ()
) -> ModelDescription:
    """The description that a calibration ends with, its table of covariances and its source.

    ``data``: the readings used; ``loads_N``: their loads as asked for, empty: all of these;
    ``notes``: remarks to keep.
    """
    scheme = "staged" if found.studies else "global"
    has_path = any(table.code == LOAD_PATH for table in found.description.effect)
    sure = calibration_table(found)
    why = () if sure is not None else (NO_COVARIANCE if found.studies else NO_SPARE,)
    changed = found.description.model_copy(
        update={
            # With an effect load-path the file keeps the path that it departs from.
            "load_path": found.description.load_path if has_path else found.model.load_path,
            "sources": {
                **found.description.sources,
                SOURCE_KEY: f"{scheme} calibration on {data.source}, SHA-256 {data.sha256}",
            },
            "calibration": Origin(
                scheme=scheme,
                load_path=found.model.load_path,
                links=found.model.link_kind,
                data=data.source,
                data_sha256=data.sha256,
                rms_mm=found.rms_mm,
                loads_N=tuple(loads_N) or data.levels_N,
                notes=(*notes, *why),
                uncertainty=sure,
            ),
        }
    )
    # Through the validator once more: a written file must be one that can be read.
    return ModelDescription.model_validate(changed.model_dump(by_alias=True))


def calibration_table(found: Calibration) -> CalibrationUncertainty | None:
    """Of a campaign's numbers, all stages; estimates are the calibrated model's own.

    Numbers of an earlier calibration that this one held stay in the covariance, and what their errors make of the
    new ones is added, as if their readings were others than these.
    """
    if not found.stages:
        return None
    last = {e.parameter.name: e for s in found.stages for e in s.certainty.estimates}
    # Until its origin is written anew the description has that of the calibration before.
    before = carried_on(found.description, found.model, tuple(last), found.effects)
    names, covariance, shares_readings = stage_covariance(found, before)
    named = named_numbers(found.model, names, found.effects)
    own = described_variables(found.description, named)
    units = [named.parameters[k] for k in named.columns]
    numbers = [
        _carried(before, k, units[k], own[k])
        if k < len(before.names)
        else _number(last[name], own[k], float(covariance[k, k]))
        for k, name in enumerate(names)
    ]
    note = "generalised least squares with estimated noise, priors included"
    if len(found.stages) > 1:
        note += "; later stages carry the errors of what earlier ones found"
    if shares_readings:
        note += ", taken as independent of their own though stages share readings"
    if any(s.study is not None for s in found.stages):
        note += "; stages by levels as least squares around the best levels"
    if before.names:
        note += f"; from an earlier calibration, readings taken as others than these: {', '.join(before.names)}"
    return uncertainty_table(numbers, covariance, _blind(found, names, before), note, before)


def stage_covariance(found: Calibration, before: CarriedOn = NOTHING) -> tuple[tuple[str, ...], Array, bool]:
    """Names (p,) of all numbers found, the covariance (p, p) of their variables, and whether stages share readings.

    Zero for those at bounds or that no reading moves with. A number that several stages find is the last one's.
    Stages' own errors are taken as independent of one another, which they are where no reading serves two of them.
    ``before``: numbers of an earlier calibration, held by all stages; they come first.
    """
    stages = found.stages
    mine_all = tuple(dict.fromkeys(e.parameter.name for s in stages for e in s.certainty.estimates))
    own = [s.certainty.covariance for s in stages]
    if len(stages) == 1 and not before.names:
        return mine_all, own[0], False
    names, c = (*before.names, *mine_all), len(before.names)
    numbers = named_numbers(found.model, names, found.effects)
    own = [before.covariance, *own]
    total = sum(len(V) for V in own)
    errors, done, first = np.zeros((len(names), total)), np.arange(len(names)) < c, c
    errors[:c, :c] = np.eye(c)
    for s, V in zip(stages, own[1:], strict=True):
        mine = np.array([names.index(e.parameter.name) for e in s.certainty.estimates], dtype=np.intp)
        held = np.flatnonzero(done & ~np.isin(np.arange(len(names)), mine))
        error = np.zeros((len(mine), total))
        error[:, first : first + len(mine)] = np.eye(len(mine))
        if held.size:
            W = _whitened(found, s, numbers)
            error -= V @ W[:, mine].T @ (W[:, held] @ errors[held])
        errors[mine] = error
        done[mine] = True
        first += len(mine)
    return names, np.asarray(errors @ block_diag(*own) @ errors.T), _share_readings(stages)


def _whitened(found: Calibration, s: StageResult, numbers: NamedNumbers) -> Array:
    """Derivatives (m, p) of a stage's readings by all numbers at the final model, with unit covariance."""
    p = s.estimate.problem
    walls = wall_flexibilities(found.description, found.model, numbers.parameters)
    free = FreeModel(found.model, numbers.parameters, p.free.at, numbers.laws, walls, found.effects, p.free.history)
    J = free.evaluate(numbers.u)[1][p.row, p.component]
    return np.asarray(s.estimate.covariance.whiten(np.ascontiguousarray(J[:, numbers.columns])))


def _share_readings(stages: tuple[StageResult, ...]) -> bool:
    """Whether a reading serves two stages."""
    keys = [_reading_keys(s.estimate.problem) for s in stages]
    return len(set[object]().union(*keys)) < sum(map(len, keys))


def _reading_keys(p: Problem) -> set[tuple[str, bytes]]:
    # Poses are compared by their labels: an angle found in between moves the loaded poses.
    rows = np.column_stack([np.linalg.norm(p.free.at.wrench[p.row, :3], axis=1), p.value, p.component])
    return {(p.poses[k], row.tobytes()) for k, row in zip(p.pose, np.round(rows, 9), strict=True)}


def _carried(before: CarriedOn, k: int, p: Parameter, own: float) -> FoundNumber:
    nan = math.nan
    return FoundNumber(
        before.names[k],
        p.unit,
        p.scale,
        own,
        (nan, nan),
        before.status[k],
        before.degrees_of_freedom[k],
        has_variance=True,
    )


def _number(e: ParameterEstimate, own: float, variance: float) -> FoundNumber:
    p = e.parameter
    has = e.status != "at bound" and not math.isnan(e.value) and variance > 0.0
    return FoundNumber(p.name, p.unit, p.scale, own, e.interval, e.status, e.degrees_of_freedom, has)


def _blind(found: Calibration, names: Sequence[str], before: CarriedOn) -> Array:
    """Directions that no reading of the last stage with these numbers determines, over all names."""
    last = {e.parameter.name: number for number, s in enumerate(found.stages) for e in s.certainty.estimates}
    rows = np.zeros((len(before.directions), len(names)))
    rows[:, : len(before.names)] = before.directions
    for number, s in enumerate(found.stages):
        mine = [e.parameter.name for e in s.certainty.estimates]
        now = np.array([last[name] == number for name in mine], dtype=np.bool_)
        more = np.zeros((len(s.certainty.null), len(names)))
        more[:, [names.index(name) for name in mine]] = np.where(now, s.certainty.null, 0.0)
        rows = np.vstack([rows, more])
    return rows
