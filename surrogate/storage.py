"""Surrogate files: JSON with a checksum; numbers come back bit for bit.

A file is one object with one top-level key a line. ``content_sha256`` is the SHA-256 of the canonical JSON
(sorted keys, no spaces) of everything else, so an edit by hand is noticed.
"""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any, Literal, NoReturn

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from robots.errors import InputError, InputErrors
from surrogate.basis import Basis
from surrogate.model import SCHEMA, Couplings, ErrorFigures, Surrogate, Target

_REFIT = "fit the surrogate again (`stiffarm fit`); such files are not edited by hand"


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class _Domain(_Strict):
    lower_rad: list[float]
    upper_rad: list[float]


class _Coupling(_Strict):
    """A bound that is null is not there."""

    name: str
    factors: list[float]
    lower_rad: float | None
    upper_rad: float | None


class _Basis(_Strict):
    name: Literal["polynomial", "trigonometric"]
    degree: int
    terms: list[list[int]]
    recombination: list[list[list[float]]]


class _Scaling(_Strict):
    centre_rad: list[float]
    half_range_rad: list[float]


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
    condition_number: float


class _File(_Strict):
    schema_version: str = Field(alias="schema")
    robot: str
    model_hash: str
    load_direction: list[float] = Field(min_length=3, max_length=3)
    inputs: list[str]
    fixed_deg: dict[str, float]
    domain: _Domain
    couplings: list[_Coupling]
    target: Target
    basis: _Basis
    scaling: _Scaling
    coefficients: list[float]
    errors: _Errors
    notes: list[str]
    content_sha256: str


def save_surrogate(surrogate: Surrogate, path: str | Path) -> None:
    """Write a surrogate under a temporary name in the same folder, then rename it over ``path``."""
    path = Path(path)
    content = _content(surrogate)
    content["content_sha256"] = _checksum(content)
    lines = (f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in content.items())
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def load_surrogate(path: str | Path) -> Surrogate:
    """Read a surrogate; the prediction is bit for bit that of the one saved.

    Raises
    ------
    InputError
        Not a readable JSON object, another schema version, missing, unknown or unfit entries (all at once),
        NaN or infinite numbers, counts that do not fit together, or content that was changed by hand.
    """
    where = f"surrogate file {path}"
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"), parse_constant=_no_constant)
    except OSError as error:
        raise InputError(f"{where} cannot be read ({error})", remedy="check the path") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where} is not valid JSON ({error})", remedy=_REFIT) from error
    if not isinstance(data, dict):
        raise InputError(f"{where}", value=type(data).__name__, allowed="a JSON object", remedy=_REFIT)
    _check_version(where, data.get("schema"))
    try:
        file = _File.model_validate(data)
    except ValidationError as error:
        faults = [InputError(f"{where}: {'.'.join(map(str, item['loc']))}: {item['msg']}") for item in error.errors()]
        raise (faults[0] if len(faults) == 1 else InputErrors(where, faults)) from error
    try:
        surrogate = _surrogate(file)
    except InputError as error:
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
        "load_direction": [float(x) for x in s.load_direction],
        "inputs": list(s.inputs),
        "fixed_deg": {name: float(value) for name, value in s.fixed_deg.items()},
        "domain": {"lower_rad": s.lower.tolist(), "upper_rad": s.upper.tolist()},
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
        "basis": {
            "name": s.basis.name,
            "degree": s.basis.degree,
            "terms": s.basis.terms,
            "recombination": s.basis.recombination,
        },
        "scaling": {"centre_rad": s.basis.centre, "half_range_rad": s.basis.half_range},
        "coefficients": s.coefficients.tolist(),
        "errors": vars(s.errors),
        "notes": list(s.notes),
    }


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
    basis = Basis(
        file.basis.name,
        file.basis.degree,
        tuple(file.scaling.centre_rad),
        tuple(file.scaling.half_range_rad),
        tuple(tuple(row) for row in file.basis.terms),
        tuple(tuple(tuple(row) for row in matrix) for matrix in file.basis.recombination),
    )
    x, y, z = file.load_direction
    return Surrogate(
        robot=file.robot,
        model_hash=file.model_hash,
        load_direction=(x, y, z),
        inputs=tuple(file.inputs),
        fixed_deg=file.fixed_deg,
        lower=np.array(file.domain.lower_rad),
        upper=np.array(file.domain.upper_rad),
        couplings=couplings,
        basis=basis,
        target=file.target,
        coefficients=np.array(file.coefficients),
        errors=ErrorFigures(**file.errors.model_dump()),
        notes=tuple(file.notes),
        schema_version=file.schema_version,
    )


def _check_version(where: str, version: object) -> None:
    if version == SCHEMA:
        return
    family, _, own = SCHEMA.rpartition("/")
    number = str(version).removeprefix(f"{family}/")
    newer = number != str(version) and number.isdecimal() and int(number) > int(own)
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
