"""Surrogate files: JSON with a checksum; numbers come back bit for bit.

A file is one object with one top-level key a line. ``content_sha256`` is the SHA-256 of the canonical JSON
(sorted keys, no spaces) of everything else, so an edit by hand is noticed.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, GetPydanticSchema, create_model
from pydantic_core.core_schema import no_info_after_validator_function

from fem.statics.stated import StatedAt
from robots import Robot
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


def _even(rows: list[list[float]]) -> list[list[float]]:
    if len({len(row) for row in rows}) > 1:
        raise InputError("surrogate: a matrix", code="F007", allowed="rows of one length")
    return rows


# How a file holds arrays and tuples: as lists.
_Matrix = Annotated[list[list[float]], AfterValidator(_even)]
_Terms = Annotated[list[list[int]], AfterValidator(_even)]
_Texts = Annotated[list[str], AfterValidator(tuple)]


def _table(kind: type[Any], **own: Any) -> GetPydanticSchema:
    """A table with the fields of a dataclass, read as that; ``own``: types of fields that a file holds otherwise."""
    hints = get_type_hints(kind)
    columns: dict[str, Any] = {f.name: (own.get(f.name, hints[f.name]), ...) for f in fields(kind)}
    table = create_model(kind.__name__, __base__=_Strict, **columns)

    def made(found: BaseModel) -> Any:
        return kind(**{name: getattr(found, name) for name in columns})

    return GetPydanticSchema(lambda _, handler: no_info_after_validator_function(made, handler(table)))


_FAMILY = _table(
    Family,
    centre=Annotated[float, Field(alias="centre_rad")],
    half_range=Annotated[float, Field(alias="half_range_rad")],
    degrees=Annotated[list[int], AfterValidator(tuple)],
    matrix=_Matrix,
)
_Families = Annotated[list[Annotated[Family, _FAMILY]], AfterValidator(tuple)]
_Sum = Annotated[Expansion, _table(Expansion, families=_Families, terms=_Terms, coefficients=_Matrix)]
_Rows = Annotated[
    Factor,
    _table(
        Factor,
        group=Annotated[list[int], AfterValidator(np.array)],
        weights=Annotated[list[_Sum], AfterValidator(tuple)],
    ),
]
_Bars = Annotated[ErrorBars, _table(ErrorBars, leverage=_Sum, scale=_Sum)]
_Parameters = Annotated[
    ParameterBars,
    _table(ParameterBars, gradients=_Sum, names=_Texts, undetermined=_Texts, open_share=_Sum | None),
]


class _Domain(_Strict):
    lower_rad: list[float]
    upper_rad: list[float]


class _Coupling(_Strict):
    """A bound that is null is not there."""

    name: str
    factors: list[float]
    lower_rad: float | None
    upper_rad: float | None


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


class _File(_Strict):
    schema_version: str = Field(alias="schema")
    robot: str
    model_hash: str
    quantity: Annotated[Quantity, _table(Quantity)]
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
    expansion: _Sum
    factor: _Rows | None
    error_bars: _Bars | None
    parameters: _Parameters | None
    kinematics: _Robot | None
    errors: Annotated[ErrorFigures, _table(ErrorFigures)]
    # Files of version 0.1 say nothing of it.
    at_load: Annotated[StatedAt, _table(StatedAt, effects=_Texts, not_linear=_Texts, left_out=_Texts)] | None = None
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
        raise InputError(f"{where}", code="F007", value=type(data).__name__, allowed="a JSON object", remedy=_REFIT)
    _check_version(where, data.get("schema"))
    file = validated(_File, data, where, missing=_REFIT, remedy=_REFIT)
    try:
        surrogate = _surrogate(file)
    except (ValueError, OverflowError) as error:
        # Not only our own refusals: numpy's of rows of unlike length, or of whole numbers beyond 64 bits.
        raise InputError(f"{where}: {error}", code="F007", remedy=_REFIT) from error
    if file.content_sha256 != _checksum(data):
        raise InputError(
            f"{where}: the content does not fit its checksum, so it was changed after it was written",
            code="F007",
            remedy="take the original file, or " + _REFIT,
        )
    return surrogate


def _content(s: Surrogate) -> dict[str, Any]:
    c, arm = s.couplings, s.kinematics
    return {
        "schema": s.schema_version,
        "robot": s.robot,
        "model_hash": s.model_hash,
        "quantity": _plain(s.quantity),
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
        "expansion": _plain(s.expansion),
        "factor": _plain(s.factor),
        "error_bars": _plain(s.bars),
        "parameters": _plain(s.parameters),
        "kinematics": None if arm is None else {name: _plain(getattr(arm, name)) for name in _Robot.model_fields},
        "errors": _plain(s.errors),
        "at_load": _plain(s.at_load),
        "notes": list(s.notes),
    }


def _plain(value: Any) -> Any:
    """Dataclasses, arrays and tuples as JSON holds them."""
    if is_dataclass(value):
        named = {"centre": "centre_rad", "half_range": "half_range_rad"} if isinstance(value, Family) else {}
        return {named.get(f.name, f.name): _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    return value.tolist() if isinstance(value, np.ndarray) else value


def _arm(name: str, file: _Robot) -> Robot:
    n = len(file.coordinates)
    shapes = {
        "T_pre": (n, 4, 4),
        "R_post": (n, 3, 3),
        "sign": (n,),
        "offset": (n,),
        "limits": (n, 2),
        "T_last_flange": (4, 4),
        "T_flange_tool": (4, 4),
    }
    arrays = {key: np.array(getattr(file, key), dtype=np.float64) for key in shapes}
    if any(arrays[key].shape != shape for key, shape in shapes.items()) or len(file.joint_names) != n:
        raise InputError("kinematics", code="F007", allowed=f"arrays for {n} joints")
    turns = np.concatenate([arrays["T_pre"][:, :3, :3], arrays["R_post"]])
    if not np.allclose(turns @ turns.swapaxes(1, 2), np.eye(3), atol=1e-9) or not (np.abs(arrays["sign"]) == 1.0).all():
        raise InputError("kinematics", code="F007", allowed="rotations, and signs of 1 or -1")
    return Robot(
        name=name,
        coordinates=tuple(file.coordinates),
        joint_names=tuple(file.joint_names),
        couplings=(),
        parallelogram=None,
        controller=None,
        errors=None,
        **arrays,
    )


def _surrogate(file: _File) -> Surrogate:
    k = len(file.inputs)
    if any(len(c.factors) != k for c in file.couplings):
        raise InputError("couplings: factors", code="F007", allowed=f"{k} for each coupling, one for each input")
    couplings = Couplings(
        tuple(c.name for c in file.couplings),
        np.array([c.factors for c in file.couplings]).reshape(-1, k),
        np.array([-np.inf if c.lower_rad is None else c.lower_rad for c in file.couplings]),
        np.array([np.inf if c.upper_rad is None else c.upper_rad for c in file.couplings]),
    )
    x, y, z = file.load_direction
    return Surrogate(
        robot=file.robot,
        model_hash=file.model_hash,
        quantity=file.quantity,
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
        expansion=file.expansion,
        factor=file.factor,
        errors=file.errors,
        bars=file.error_bars,
        parameters=file.parameters,
        kinematics=None if file.kinematics is None else _arm(file.robot, file.kinematics),
        at_load=file.at_load,
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
        code="F006",
        value=str(version),
        allowed=SCHEMA,
        remedy="update stiffarm, or fit again with this version" if newer else _REFIT,
    )


def _checksum(content: dict[str, Any]) -> str:
    own = {key: value for key, value in content.items() if key != "content_sha256"}
    return hashlib.sha256(json.dumps(own, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
