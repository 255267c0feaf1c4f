"""What can be compared: calibrations, diagnoses, maps and placements, by their result folders or files."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

from doe.estimation.differences import Figure
from robots import InputError, ModelDescription, load_description
from robots.constants import NORMAL_95
from robots.files.reading import parse_json, read_text
from robots.schema.uncertainty import CalibrationUncertainty

Kind = Literal["calibration", "diagnosis", "map", "placement"]
# The file that tells what a folder holds; the first that is there counts.
FILES: Final[dict[str, Kind]] = {
    "calibration.json": "calibration",
    "diagnosis.json": "diagnosis",
    "placement.json": "placement",
    "index_map.json": "map",
    "map.json": "map",
}
SCHEMAS: Final[dict[str, Kind]] = {
    "stiffarm-calibration": "calibration",
    "stiffarm-diagnosis": "diagnosis",
    "stiffarm-placement": "placement",
    "stiffarm-map": "map",
    "stiffarm-index-map": "map",
}
# What a folder of `stiffarm run` has: its calibrated model first.
RUN: Final = ("model.toml", "results.json")
MAPS: Final = (".vtu", ".vti", ".vtp")
# Beyond this it is no figure of an arm, and squares overflow.
LARGEST: Final = 1e60
# Units by the ends of keys.
UNITS: Final = {"_N_per_mm": "N/mm", "_um": "um", "_deg": "deg"}
ALLOWED: Final = (
    "a results folder of run, calibrate, diagnose, map or place, its JSON file, a calibrated model.toml or a map"
)


@dataclass(frozen=True, eq=False)
class Source:
    """One of the things compared.

    ``name``: what it is called here; ``file``: what was read first; ``content``: of its JSON file, empty without one;
    ``model``: the calibrated model beside it, or itself; ``page``: the map's page, if there is one; ``of_run``: it is a
    folder of `stiffarm run`, which stands for the calibration in it.
    """

    name: str
    kind: Kind
    robot: str
    file: Path
    content: Mapping[str, Any]
    model: ModelDescription | None = None
    page: Path | None = None
    of_run: bool = False

    @property
    def uncertainty(self) -> CalibrationUncertainty | None:
        """What its calibrated model says of how well its numbers are known."""
        return None if self.model is None or self.model.calibration is None else self.model.calibration.uncertainty

    @property
    def data(self) -> str:
        """SHA-256 of the readings that it rests on; empty where that is not known."""
        if self.kind == "diagnosis":
            return str(self.content.get("data_sha256", ""))
        if self.model is not None and self.model.calibration is not None:
            return str(self.model.calibration.data_sha256 or "")
        return ""


def read_source(path: Path, number: int) -> Source:
    """What a path holds; ``number``: of the argument, for messages.

    Raises
    ------
    InputError
        Nothing is there, or nothing that can be compared.
    """
    what = f"argument {number}"
    if path.is_dir():
        found = next((path / name for name in FILES if (path / name).is_file()), None)
        if found is None and all((path / name).is_file() for name in RUN):
            return replace(read_source(path / RUN[0], number), name=str(path), of_run=True)
        if found is None:
            raise InputError(
                what, code="A012", value=str(path), allowed=ALLOWED, remedy="name the folder given as --out, or a file"
            )
        return _of_json(found, str(path), FILES[found.name])
    if not path.is_file():
        raise InputError(what, code="A012", value=str(path), allowed=ALLOWED, remedy="check the path")
    suffix = path.suffix.lower()
    if suffix in MAPS:
        return Source(str(path), "map", "", path, {}, page=_there(path.parent / "map.html"))
    if suffix == ".toml":
        model = load_description(path)
        if model.calibration is None:
            raise InputError(
                f"{path} is not calibrated: nothing says how well its figures are known",
                code="A012",
                allowed=ALLOWED,
                remedy="compare the results of `stiffarm calibrate`",
            )
        return Source(str(path), "calibration", model.name, path, {}, model)
    if suffix == ".json":
        return _of_json(path, str(path), _kind(path, what))
    raise InputError(what, code="A012", value=str(path), allowed=ALLOWED, remedy="name one of these")


def _kind(path: Path, what: str) -> Kind:
    content = _content(path)
    known = SCHEMAS.get(str(content.get("schema", "")).partition("/")[0]) if isinstance(content, dict) else None
    if known is None and isinstance(content, dict) and {"stages", "rms_mm", "robot"} <= content.keys():
        known = "calibration"
    if known is None:
        raise InputError(what, code="A012", value=str(path), allowed=ALLOWED, remedy="name one of these")
    return known


def _of_json(path: Path, name: str, kind: Kind) -> Source:
    content = _content(path)
    if not isinstance(content, dict):
        raise InputError(
            f"{path} is no results file of stiffarm", code="A012", allowed=ALLOWED, remedy="name one of these"
        )
    ending = f"{kind}.json"
    is_ours = path.name.endswith(ending)
    own = _there(path.with_name(f"{path.name.removesuffix(ending)}model.toml")) if is_ours else None
    model = load_description(own) if own is not None and kind in ("calibration", "diagnosis") else None
    if kind == "map":
        return _of_map(path.parent, name)
    return Source(name, kind, str(content.get("robot", "")), path, content, model)


def _of_map(folder: Path, name: str) -> Source:
    """A map by the file that holds its arrays."""
    found = sorted(p for p in folder.iterdir() if p.suffix.lower() in MAPS)
    if not found:
        raise InputError(
            f"{name} holds no map as .vtu, .vti or .vtp",
            code="A012",
            allowed="a map's arrays in one of these files",
            remedy="make the map again with --format vtu",
        )
    return Source(name, "map", "", found[0], {}, page=_there(folder / "map.html"))


def _content(path: Path) -> Any:
    return parse_json(read_text(path, "results file"), str(path))


def _there(path: Path) -> Path | None:
    return path if path.is_file() else None


def check_alike(some: list[Source]) -> None:
    """Refuse things of different kinds, or of different robots.

    Raises
    ------
    InputError
        Naming both.
    """
    first = some[0]
    for other in some[1:]:
        if other.kind != first.kind:
            raise InputError(
                f"{first.name} is a {first.kind}, {other.name} a {other.kind}",
                code="A012",
                allowed="things of one kind",
                remedy="compare like with like",
            )
        if first.robot and other.robot and other.robot != first.robot:
            raise InputError(
                f"{first.name} is of {first.robot}, {other.name} of {other.robot}",
                code="A012",
                allowed="one robot",
                remedy="compare results of one robot",
            )
    names = [s.name for s in some]
    if len({str(s.file.resolve()) for s in some}) < len(names):
        raise InputError(
            "the same results twice",
            code="A012",
            value=", ".join(names),
            allowed="different ones",
            remedy="leave one of them out",
        )


def figures_of(s: Source) -> list[Figure]:
    """The numbers of a calibration, a diagnosis or a placement.

    Raises
    ------
    TypeError, ValueError
        Something else stands where a number should, or one that nothing of ours has.
    """
    found = _figures(s)
    for f in found:
        numbers = [v for v in (f.value, f.low, f.high) if v is not None]
        if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in (*numbers, f.sd, f.freedom)):
            raise TypeError(f.name)
        if not all(isinstance(text, str) for text in (f.name, f.unit, f.variable)):
            raise TypeError(f.name)
        # NaN fails too. A standard deviation that is not known is NaN.
        if not all(abs(v) <= LARGEST for v in numbers) or abs(f.sd) > LARGEST or not f.freedom > 0.0 or f.sd < 0.0:
            raise ValueError(f.name)
    return found


def _figures(s: Source) -> list[Figure]:
    if s.kind == "placement":
        return _placement(s.content)
    if s.kind == "diagnosis":
        return [*_springs(s.content.get("springs", {})), *_effects(s.content)]
    if s.content:
        rows = s.content.get("parameters")
        if not isinstance(rows, list):
            # Files of version 1 have them by stage.
            rows = [n for one in s.content.get("stages", []) for n in one.get("numbers", [])]
        found = {n["name"]: _estimate(n) for n in rows}
        return list(found.values()) or _springs(s.content.get("springs", {}))
    return [] if s.uncertainty is None else _described(s.uncertainty)


def _estimate(n: Mapping[str, Any]) -> Figure:
    low, high = n.get("value_interval95", n.get("interval95")) or (None, None)
    sd = n.get("sd_of_variable")
    return Figure(
        n["name"],
        n["unit"],
        n["value"],
        low,
        high,
        n.get("variable", "value"),
        math.nan if sd is None else float(sd),
        float(n.get("degrees_of_freedom") or math.inf),
    )


def _springs(springs: Mapping[str, Any]) -> list[Figure]:
    out = []
    for joint, one in springs.items():
        low, high = one["interval95_Nm_per_rad"]
        out.append(_by_interval(f"{joint}.stiffness", "N m/rad", one["k_Nm_per_rad"], low, high, "1/value"))
    return out


def _by_interval(
    name: str, unit: str, value: float | None, low: float | None, high: float | None, variable: str = "value"
) -> Figure:
    """A number whose interval tells how well it is known."""
    sd = math.nan
    if value is not None and low is not None and high is not None:
        ends = (1.0 / low, 1.0 / high) if variable == "1/value" and low > 0.0 and high > 0.0 else (low, high)
        sd = abs(ends[1] - ends[0]) / (2.0 * NORMAL_95)
    return Figure(name, unit, value, low, high, variable, sd)


def _effects(content: Mapping[str, Any]) -> list[Figure]:
    out = []
    for one in (*content.get("effects", []), *content.get("learned", []), *content.get("provisional", [])):
        for name, p in one["parameters"].items():
            low, high = p["interval95"] or (None, None)
            out.append(
                replace(
                    _by_interval(f"{one['code']}.{name}", p["unit"], p["value"], low, high),
                    sd=math.nan if p["sd"] is None else float(p["sd"]),
                )
            )
    return out


def _placement(content: Mapping[str, Any]) -> list[Figure]:
    out = []
    rows = content.get("placements", [])
    # By their names in files of version 1.
    rows = [{"placement": name, **one} for name, one in rows.items()] if isinstance(rows, dict) else rows
    for one in rows:
        for key, value in one.items():
            if not isinstance(value, int | float):
                continue
            end, unit = next(((end, unit) for end, unit in UNITS.items() if key.endswith(end)), ("", ""))
            interval = one.get(f"{key.removesuffix(end)}_interval95{end}", one.get(f"{key}_95"))
            low, high = interval if isinstance(interval, list) and len(interval) == 2 else (None, None)
            out.append(_by_interval(f"{one['placement']}.{key}", unit, float(value), low, high))
    return out


def _described(u: CalibrationUncertainty) -> list[Figure]:
    """Numbers of a model file, with their standard deviations."""
    out = []
    for k, (name, unit, variable) in enumerate(zip(u.parameters, u.unit, u.variable, strict=True)):
        value, low, high = u.interval95(k)
        out.append(
            Figure(
                name,
                unit,
                None if u.status[k] == "not identified" else value,
                low,
                high if math.isfinite(high) else None,
                variable,
                math.sqrt(u.covariance[k][k]),
                u.degrees_of_freedom[k],
            )
        )
    return out + [Figure(n.name, n.unit, None, n.low, n.high) for n in u.undetermined]
