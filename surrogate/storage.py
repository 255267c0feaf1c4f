"""Surrogate files: JSON with a checksum; numbers come back bit for bit.

A file is one object with one top-level key a line. ``content_sha256`` is the SHA-256 of the canonical JSON
(sorted keys, no spaces) of everything else, so an edit by hand is noticed.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from pydantic import ConfigDict, Field

from robots import Robot
from robots.arrays import Array
from robots.errors import InputError
from robots.files.reading import parse_json, read_text
from robots.files.validated import validated
from robots.files.written import write_whole
from robots.schema.quantities import Strict
from surrogate.error_bars import ErrorBars, ParameterBars
from surrogate.expansion import Expansion, Family
from surrogate.model import SCHEMA, ErrorFigures, Factor, Quantity, Surrogate, Target
from surrogate.scope import Couplings

_REFIT = "fit the surrogate again (`stiffarm fit`); such files are not edited by hand"


class _Strict(Strict):
    model_config = ConfigDict(strict=True)


class _Domain(_Strict):
    lower_rad: list[float]
    upper_rad: list[float]


class _Coupling(_Strict):
    """A bound that is null is not there."""

    name: str
    factors: list[float]
    lower_rad: float | None
    upper_rad: float | None


class _Family(_Strict):
    centre_rad: float
    half_range_rad: float
    periodic: bool
    harmonics: int
    degrees: list[int]
    matrix: list[list[float]]


class _Expansion(_Strict):
    families: list[_Family]
    terms: list[list[int]]
    coefficients: list[list[float]]


class _Factor(_Strict):
    group: list[int]
    weights: list[_Expansion]


class _Bars(_Strict):
    leverage: _Expansion
    scale: _Expansion
    exponent: float
    quantile: float
    n_runs: int


class _Parameters(_Strict):
    gradients: _Expansion
    names: list[str]
    misfit: float
    undetermined: list[str]
    open_share: _Expansion | None


class _Quantity(_Strict):
    name: str
    unit: str
    label: str


class _Robot(_Strict):
    """The kinematics, by which near-singular poses are told."""

    coordinates: list[str]
    joint_names: list[str]
    T_pre: list[list[list[float]]]
    R_post: list[list[list[float]]]
    sign: list[float]
    offset: list[float]
    limits: list[list[float]]
    T_last_flange: list[list[float]]
    T_flange_tool: list[list[float]]


class _Errors(_Strict):
    basis: str
    degree: int
    target: str
    n_terms: int
    n_train: int
    n_test: int
    rms_relative: float
    p95_relative: float
    max_relative: float
    rms_interior: float
    max_interior: float
    coverage95: float
    condition_number: float
    matrix_rms: float | None
    matrix_max: float | None


class _File(_Strict):
    schema_version: str = Field(alias="schema")
    robot: str
    model_hash: str
    quantity: _Quantity
    load_direction: list[float] = Field(min_length=3, max_length=3)
    inputs: list[str]
    fixed_deg: dict[str, float]
    fixed_influence: dict[str, float]
    domain: _Domain
    periodic: list[bool]
    couplings: list[_Coupling]
    target: Target
    basis: str
    degree: int
    expansion: _Expansion
    factor: _Factor | None
    error_bars: _Bars | None
    parameters: _Parameters | None
    kinematics: _Robot | None
    errors: _Errors
    notes: list[str]
    content_sha256: str


def save_surrogate(surrogate: Surrogate, path: str | Path) -> None:
    """Write a surrogate, whole or not at all; a file that is there is replaced."""
    path = Path(path)
    content = _content(surrogate)
    content["content_sha256"] = _checksum(content)
    lines = (f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in content.items())
    write_whole(path, "{\n" + ",\n".join(lines) + "\n}\n")


def load_surrogate(path: str | Path) -> Surrogate:
    """Read a surrogate; the prediction is bit for bit that of the one saved.

    Raises
    ------
    InputError
        Not a readable JSON object, another schema version, missing, unknown or unfit entries (all at once),
        NaN or infinite numbers, counts that do not fit together, or content that was changed by hand.
    """
    where = f"surrogate file {path}"
    data = parse_json(read_text(path, "surrogate file"), where, remedy=_REFIT)
    if not isinstance(data, dict):
        raise InputError(f"{where}", value=type(data).__name__, allowed="a JSON object", remedy=_REFIT)
    _check_version(where, data.get("schema"))
    file = validated(_File, data, where, missing=_REFIT, remedy=_REFIT)
    try:
        surrogate = _surrogate(file)
    except (ValueError, OverflowError) as error:
        # Not only our own refusals: numpy's of rows of unlike length, or of whole numbers beyond 64 bits.
        raise InputError(f"{where}: {error}", remedy=_REFIT) from error
    if file.content_sha256 != _checksum(data):
        raise InputError(
            f"{where}: the content does not fit its checksum, so it was changed after it was written",
            remedy="take the original file, or " + _REFIT,
        )
    return surrogate


def _content(s: Surrogate) -> dict[str, Any]:
    c = s.couplings
    return {
        "schema": s.schema_version,
        "robot": s.robot,
        "model_hash": s.model_hash,
        "quantity": vars(s.quantity),
        "load_direction": [float(x) for x in s.load_direction],
        "inputs": list(s.inputs),
        "fixed_deg": {name: float(value) for name, value in s.fixed_deg.items()},
        "fixed_influence": {name: float(value) for name, value in s.fixed_influence.items()},
        "domain": {"lower_rad": s.lower.tolist(), "upper_rad": s.upper.tolist()},
        "periodic": list(s.periodic),
        "couplings": [
            {
                "name": c.names[j],
                "factors": c.matrix[j].tolist(),
                "lower_rad": _or_none(c.lower[j]),
                "upper_rad": _or_none(c.upper[j]),
            }
            for j in range(len(c.names))
        ],
        "target": s.target,
        "basis": s.basis,
        "degree": s.degree,
        "expansion": _written(s.expansion),
        "factor": None
        if s.factor is None
        else {"group": s.factor.group.tolist(), "weights": [_written(law) for law in s.factor.weights]},
        "error_bars": None
        if s.bars is None
        else vars(s.bars) | {"leverage": _written(s.bars.leverage), "scale": _written(s.bars.scale)},
        "parameters": None
        if s.parameters is None
        else {
            "gradients": _written(s.parameters.gradients),
            "names": list(s.parameters.names),
            "misfit": s.parameters.misfit,
            "undetermined": list(s.parameters.undetermined),
            "open_share": None if s.parameters.open_share is None else _written(s.parameters.open_share),
        },
        "kinematics": None if s.kinematics is None else _arm_written(s.kinematics),
        "errors": vars(s.errors),
        "notes": list(s.notes),
    }


def _written(e: Expansion) -> dict[str, Any]:
    return {
        "families": [
            {
                "centre_rad": f.centre,
                "half_range_rad": f.half_range,
                "periodic": f.periodic,
                "harmonics": f.harmonics,
                "degrees": list(f.degrees),
                "matrix": f.matrix.tolist(),
            }
            for f in e.families
        ],
        "terms": e.terms.tolist(),
        "coefficients": e.coefficients.tolist(),
    }


def _read(e: _Expansion) -> Expansion:
    families = tuple(
        Family(f.centre_rad, f.half_range_rad, f.periodic, f.harmonics, tuple(f.degrees), _matrix(f.matrix))
        for f in e.families
    )
    return Expansion(families, np.array(_even(e.terms), dtype=np.int64), _matrix(e.coefficients))


def _even(rows: list[list[Any]]) -> list[list[Any]]:
    if len({len(row) for row in rows}) > 1:
        raise InputError("surrogate: a matrix", allowed="rows of one length")
    return rows


def _matrix(rows: list[list[float]]) -> Array:
    return np.array(_even(rows), dtype=np.float64)


def _arm_written(robot: Robot) -> dict[str, Any]:
    arrays = ("T_pre", "R_post", "sign", "offset", "limits", "T_last_flange", "T_flange_tool")
    return {"coordinates": list(robot.coordinates), "joint_names": list(robot.joint_names)} | {
        name: getattr(robot, name).tolist() for name in arrays
    }


def _arm(name: str, file: _Robot) -> Robot:
    n = len(file.coordinates)
    shapes = {
        "T_pre": (n, 4, 4), "R_post": (n, 3, 3), "sign": (n,), "offset": (n,), "limits": (n, 2),
        "T_last_flange": (4, 4), "T_flange_tool": (4, 4),
    }  # fmt: skip
    arrays = {key: np.array(getattr(file, key), dtype=np.float64) for key in shapes}
    if any(arrays[key].shape != shape for key, shape in shapes.items()) or len(file.joint_names) != n:
        raise InputError("kinematics", allowed=f"arrays for {n} joints")
    turns = np.concatenate([arrays["T_pre"][:, :3, :3], arrays["R_post"]])
    if not np.allclose(turns @ turns.swapaxes(1, 2), np.eye(3), atol=1e-9) or not (np.abs(arrays["sign"]) == 1.0).all():
        raise InputError("kinematics", allowed="rotations, and signs of 1 or -1")
    return Robot(
        name=name,
        coordinates=tuple(file.coordinates),
        joint_names=tuple(file.joint_names),
        couplings=(),
        parallelogram=None,
        **arrays,
    )


def _factor(file: _Factor) -> Factor:
    return Factor(np.array(file.group, dtype=np.int64), tuple(_read(law) for law in file.weights))


def _surrogate(file: _File) -> Surrogate:
    k = len(file.inputs)
    if any(len(c.factors) != k for c in file.couplings):
        raise InputError("couplings: factors", allowed=f"{k} for each coupling, one for each input")
    couplings = Couplings(
        tuple(c.name for c in file.couplings),
        np.array([c.factors for c in file.couplings]).reshape(-1, k),
        np.array([-np.inf if c.lower_rad is None else c.lower_rad for c in file.couplings]),
        np.array([np.inf if c.upper_rad is None else c.upper_rad for c in file.couplings]),
    )
    x, y, z = file.load_direction
    factor, bars, parameters = file.factor, file.error_bars, file.parameters
    return Surrogate(
        robot=file.robot,
        model_hash=file.model_hash,
        quantity=Quantity(**file.quantity.model_dump()),
        load_direction=(x, y, z),
        inputs=tuple(file.inputs),
        fixed_deg=file.fixed_deg,
        fixed_influence=file.fixed_influence,
        lower=np.array(file.domain.lower_rad),
        upper=np.array(file.domain.upper_rad),
        couplings=couplings,
        periodic=tuple(file.periodic),
        basis=file.basis,
        degree=file.degree,
        target=file.target,
        expansion=_read(file.expansion),
        factor=None if factor is None else _factor(factor),
        errors=ErrorFigures(**file.errors.model_dump()),
        bars=None
        if bars is None
        else ErrorBars(_read(bars.leverage), _read(bars.scale), bars.exponent, bars.quantile, bars.n_runs),
        parameters=None
        if parameters is None
        else ParameterBars(
            _read(parameters.gradients),
            tuple(parameters.names),
            parameters.misfit,
            tuple(parameters.undetermined),
            None if parameters.open_share is None else _read(parameters.open_share),
        ),
        kinematics=None if file.kinematics is None else _arm(file.robot, file.kinematics),
        notes=tuple(file.notes),
        schema_version=file.schema_version,
    )


def _check_version(where: str, version: object) -> None:
    if version == SCHEMA:
        return
    family, _, own = SCHEMA.rpartition("/")
    number = str(version).removeprefix(f"{family}/")
    # Not more digits than a version has: int() refuses thousands of them.
    newer = number != str(version) and number.isdecimal() and len(number) < 10 and int(number) > int(own)
    raise InputError(
        f"{where}: schema" + (" is newer than this program" if newer else ""),
        value=str(version),
        allowed=SCHEMA,
        remedy="update stiffarm, or fit again with this version" if newer else _REFIT,
    )


def _checksum(content: dict[str, Any]) -> str:
    own = {key: value for key, value in content.items() if key != "content_sha256"}
    return hashlib.sha256(json.dumps(own, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number that may stand in such a file")
