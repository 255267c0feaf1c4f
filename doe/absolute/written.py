"""What a calibration from positions writes into the model file: errors of joints, springs, and where they are from.

Errors are written with the values of the estimate, whether they are identified one by one or in combinations only: the
arm that the file describes is the one whose predictions were judged. A stiffness that has no value (a lower limit, or
nothing) is not written: the joint keeps what the model had, and everything else is what the readings say with that.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from doe.absolute.calibrate import Positions, check_no_worse
from doe.absolute.chain import evaluate, samples
from doe.absolute.fit import Fit
from doe.absolute.identified import Curve, Finding
from doe.absolute.known import known_springs
from doe.absolute.shrinkage import step_with
from doe.absolute.unknowns import Unknown
from doe.model_file.uncertainty_table import FoundNumber, uncertainty_table
from fem.free.base import Tables
from fem.free.parameters import parameter
from robots import ModelDescription
from robots.arrays import Array, in_blocks
from robots.files.validated import validated
from robots.joint_errors import COMPONENTS
from robots.schema.description import Calibration as Origin
from robots.schema.joint_errors import Positions as PositionsTable

SOURCE = "positions"
NOT_AN_ARM = "check units, signs and zeros of the table and the model: errors this large are of another arm"
RIGID_LINKS = "links count as rigid: their deflection is in the joints' springs"
NOT_HERE = ("payload", "mass", "rail", "growth", "drift", "reversal")
GEOMETRIC = ("frame", "zero", "ratio", "coupling")
IN_MODEL = (*GEOMETRIC, "spring")


@dataclass(frozen=True)
class Written:
    """A calibrated model: ``description``, and the ``fit`` that it has to the last digit.

    ``silent``: springs that were free and have no value, which the model keeps as it had them; ``elsewhere``: what was
    found and has no place in a model of an arm; ``moved_m``: RMS by which the silent springs' share moves predictions.
    """

    description: ModelDescription
    fit: Fit
    silent: tuple[str, ...]
    elsewhere: tuple[str, ...]
    moved_m: float

    @property
    def rms_m(self) -> float:
        """RMS distance of readings from this model, all of them."""
        return self.fit.rms_m

    @property
    def notes(self) -> tuple[str, ...]:
        """What whoever uses the model must know."""
        out = []
        if self.silent:
            out.append(
                f"no stiffness is written for {', '.join(self.silent)}: the readings give only limits. The model's "
                "other values were found without these springs, so they differ from the estimate within their "
                f"intervals; predictions change by {1e3 * self.moved_m:.2g} mm RMS"
            )
        if self.elsewhere:
            out.append(f"not in the model file, which cannot hold them: {', '.join(self.elsewhere)}")
        return tuple(out)


def written(c: Positions, before: ModelDescription) -> Written:
    """The calibrated model of a calibration of the arm ``before``.

    Raises
    ------
    InputError
        Errors that no arm has: the model is of another one.
    """
    silent = tuple(f.name for f in c.findings if f.name in _springs(c.found) and f.value is None)
    fit = with_springs_as_before(c.found, silent)
    check_no_worse(c.before, fit, c.gross)
    predicted = c.found.residual - fit.residual
    moved = float(np.sqrt(np.mean(np.sum(predicted**2, axis=1))))
    elsewhere = [one.name for one in c.found.moving.unknowns if one.kind in NOT_HERE]
    made = Written(before, fit, silent, tuple(elsewhere), moved)
    return replace(made, description=_description(c, before, made))


def _springs(found: Fit) -> set[str]:
    return {one.name for one in found.moving.unknowns if one.kind == "spring"}


def with_springs_as_before(found: Fit, names: tuple[str, ...]) -> Fit:
    """The estimate with some springs as the model had them, and all else as the readings then say."""
    if not names:
        return found
    own = {one.name: c for one, c in known_springs(found.model, ()).items()}
    places = found.moving.places(lambda one: one.name in names)
    wanted = np.array([own.get(found.moving.unknowns[k].name, 0.0) for k in places])
    u = found.u.copy()
    step = step_with(found.posterior, places, wanted - u[found.free[places]])
    u[found.free] += step
    stiff = found.layout.places(lambda one: one.kind == "spring")
    u[stiff] = np.maximum(u[stiff], 0.0)
    frames = tuple(f.moved(s.step(step)) for f, s in zip(found.frames, found.reduced.own, strict=True))
    moved = replace(found, u=u, frames=frames)
    return replace(moved, residual=residuals(moved))


def residuals(found: Fit) -> Array:
    """Residuals (n, 3) m of an estimate's readings in the arm's axes."""
    out = np.empty((len(found.data), 3))
    for s, frame in enumerate(found.frames):
        mine = np.flatnonzero(found.data.session.number == s)
        for some in in_blocks(len(mine), 4096):
            rows = mine[some]
            part = found.data.take(rows)
            part = replace(part, target=replace(found.data.target, number=found.data.target.number[rows]))
            (sample,) = samples(found.model, part, found.layout, found.start.nominal, found.u)
            P, _ = evaluate(found.model, found.layout, sample, found.u, slopes=False)
            out[rows] = (frame.inside(part.position) - P).T
    return out


def _description(c: Positions, before: ModelDescription, made: Written) -> ModelDescription:
    data: dict[str, Any] = before.model_dump(by_alias=True)
    source, text = _source(before, c)
    tables, found = Tables(data), {f.name: f for f in c.findings}
    values = {one.name: float(v) for one, v in zip(made.fit.layout.unknowns, made.fit.u, strict=True)}
    turned = {curve.joint: curve for curve in c.curves}
    freed = made.fit.moving.unknowns
    for one in freed:
        figure = partial(_figure, source, found.get(one.name))
        if one.kind == "spring" and one.name not in made.silent and values[one.name] > 0.0:
            p = parameter(made.fit.model, one.name)
            p.kind.put(p, 1.0 / values[one.name], tables, figure)
        elif one.kind in GEOMETRIC:
            _put_error(data, made.fit.model.robot.joint_names, one, values[one.name], figure)
    for j in sorted({i[0] for _, i in made.fit.moving.of("periodic")}):
        _put_curve(data["joint"][j], made.fit, j, turned[data["joint"][j]["name"]], source)
    data["sources"] = {**data["sources"], source: text}
    sure = [k for k, one in enumerate(freed) if one.kind in IN_MODEL and one.name not in made.silent]
    half = c.found.half[sure]
    data["positions"] = PositionsTable(
        parameters=tuple(freed[k].name for k in sure),
        covariance=tuple(map(tuple, (half @ half.T).tolist())),
        data=c.found.data.source,
        data_sha256=c.found.data.sha256,
        before_rms_mm=_rms_mm(c.distances()["before"]),
        rms_mm=_rms_mm(np.linalg.norm(made.fit.residual[c.right], axis=1)),
        left_out_rms_mm=_rms_mm(c.distances()["left out"]),
        notes=made.notes,
    ).model_dump()
    # Through the validator once more: a written file must be one that can be read.
    description = validated(ModelDescription, data, "calibrated model", remedy=NOT_AN_ARM)
    if any(one.kind == "spring" and one.name not in made.silent for one in freed):
        description = description.model_copy(update={"calibration": _origin(c, made)})
    return ModelDescription.model_validate(description.model_dump(by_alias=True))


def _rms_mm(d: Array) -> float:
    return 1e3 * float(np.sqrt(np.mean(d**2)))


def _source(before: ModelDescription, c: Positions) -> tuple[str, str]:
    """Key and words of the source of what is written; figures of another calibration keep theirs."""
    text = f"calibrated from positions {c.found.data.source}, SHA-256 {c.found.data.sha256}"
    key, number = SOURCE, 1
    while before.sources.get(key, text) != text:
        number += 1
        key = f"{SOURCE}-{number}"
    return key, text


def _figure(source: str, f: Finding | None, value: float, unit: str) -> dict[str, Any]:
    if f is None or math.isnan(f.interval95[0]):
        note = "not identified by itself: part of combinations that are, or next to what was assumed before"
    else:
        note = f"{f.status}; 95 % interval {f.interval95[0]:.4g} to {f.interval95[1]:.4g} {f.unit}"
    return {"value": float(value), "unit": unit, "source": source, "note": note}


def _put_error(data: dict[str, Any], names: tuple[str, ...], one: Unknown, u: float, figure: Any) -> None:
    joint = data["joint"][one.index[0]]
    error = joint.get("error") or {"turns_with": ()}
    match one.kind:
        case "zero":
            old = joint.get("zero_error")
            before = 0.0 if old is None else math.degrees(_si_angle(old))
            joint["zero_error"] = figure(before + math.degrees(u), "deg")
            return
        case "frame":
            error[COMPONENTS[one.index[1]]] = figure(one.factor * u, one.unit)
        case "ratio":
            error["ratio"] = figure(u, "1")
        case _:
            others = [t for t in error["turns_with"] if t["joint"] != names[one.index[1]]]
            error["turns_with"] = (*others, {"joint": names[one.index[1]], "factor": figure(u, "1")})
    joint["error"] = error


def _si_angle(figure: Mapping[str, Any]) -> float:
    return float(figure["value"]) * {"rad": 1.0, "deg": math.pi / 180.0, "mrad": 1e-3}[figure["unit"]]


def _put_curve(joint: dict[str, Any], fit: Fit, j: int, curve: Curve, source: str) -> None:
    of = [(order, phase, float(fit.u[k])) for k, (i, order, phase) in fit.layout.of("periodic") if i == j]
    waves = np.zeros((2, max(order for order, _, _ in of)))
    for order, phase, u in of:
        waves[phase, order - 1] = 1e3 * u
    error = joint["error"] = joint.get("error") or {"turns_with": ()}
    error["curve"] = {
        "sin_mrad": tuple(waves[0].tolist()),
        "cos_mrad": tuple(waves[1].tolist()),
        "identified_deg": curve.ranges_deg,
        "height_mrad": 1e3 * curve.height,
        "source": source,
    }


def _origin(c: Positions, made: Written) -> Origin:
    """Where the springs came from, with the covariance of those that have a value."""
    fit, data = made.fit, c.found.data
    by_name = {f.name: f for f in c.findings}
    places = [k for k, one in enumerate(fit.moving.unknowns) if one.kind == "spring"]
    numbers = []
    for k in places:
        one, f = fit.moving.unknowns[k], by_name[fit.moving.unknowns[k].name]
        has = f.value is not None
        numbers.append(
            FoundNumber(
                one.name,
                one.unit,
                "compliance",
                float(fit.u[fit.free[k]]),
                f.interval95,
                "determined" if has else "not identified",
                math.inf,
                has,
                None if has else "the readings give a lower limit at most; the model keeps what it had",
            )
        )
    half = c.found.half[places]
    sure = uncertainty_table(
        numbers,
        half @ half.T,
        np.zeros((0, len(places))),
        "positions of targets under the weight of links and payloads",
    )
    return Origin(
        scheme="positions",
        load_path=fit.model.load_path,
        links="rigid",
        data=data.source,
        data_sha256=data.sha256,
        rms_mm=_rms_mm(np.linalg.norm(fit.residual[c.right], axis=1)),
        loads_N=(),
        notes=(RIGID_LINKS, *made.notes),
        uncertainty=sure,
    )
