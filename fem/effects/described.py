"""Effects in a model file: read, put into the arm, written, removed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from fem.effects.base import Effect, EffectParameter, PlacedEffect
from fem.effects.catalogue import Maker, catalogue, learned_among
from fem.effects.load_paths import load_path as load_path_effect
from fem.effects.observed import act
from fem.model import ArmModel, LinkKind, build_model
from robots import InputError, LoadPath, ModelDescription
from robots.errors import raise_any
from robots.schema.description import EffectNumber, EffectTable, FlangeCoupling
from robots.schema.units import check_magnitude, factor

LOAD_PATH = "load-path"
# So many times beyond its plausible range a number of a law is a slip; estimates search ten times, of pure numbers
# (powers above all) the range itself.
FAR, FAR_RATIO = 1e3, 10.0


def build_arm(
    description: ModelDescription,
    links: LinkKind = "beam",
    load_path: LoadPath | None = None,
    flanges: FlangeCoupling | None = None,
    own: Sequence[Maker] = (),
) -> ArmModel:
    """The arm of a description with its effects of stage "model"; what commands build.

    Arguments and errors as of :func:`fem.model.build_model`; a ``load_path`` given goes before the description's and
    before an effect ``load-path``. The other effects act on loads, parts and readings: :func:`reading_effects`.

    Raises
    ------
    InputError
        An effect that this model cannot have, or numbers that do not fit it.
    """
    if load_path is not None:
        description = with_load_path(description, load_path)
    model = build_plain(description, links, None, flanges)
    return with_model_effects(model, described_effects(description, model, own))


def build_plain(
    description: ModelDescription,
    links: LinkKind = "beam",
    load_path: LoadPath | None = None,
    flanges: FlangeCoupling | None = None,
) -> ArmModel:
    """The arm of a description without its effects, but with the load path that they ask for."""
    return build_model(description, links, load_path or path_of(description), flanges)


def with_model_effects(model: ArmModel, effects: Sequence[PlacedEffect]) -> ArmModel:
    """The arm with those of the effects in it that are of stage "model"."""
    for effect in effects:
        if effect.effect.stage == "model":
            model = act(effect, model, None)
    return model


def path_of(description: ModelDescription) -> LoadPath:
    """The load path of a description, with its effect ``load-path`` if it has one."""
    if all(table.code != LOAD_PATH for table in description.effect):
        return description.load_path
    return "serial" if description.load_path == "parallelogram" else "parallelogram"


def with_load_path(description: ModelDescription, load_path: LoadPath) -> ModelDescription:
    """The description of the arm with that load path: an effect that says otherwise is taken out."""
    if path_of(description) == load_path:
        return description
    return without_effect(description, LOAD_PATH).model_copy(update={"load_path": load_path})


def described_effects(
    description: ModelDescription, model: ArmModel, own: Sequence[Maker] = ()
) -> tuple[PlacedEffect, ...]:
    """The effects of a description with their numbers, in the order of the file.

    ``model``: built from the description (:func:`build_plain`, :func:`build_arm` or :func:`fem.model.build_model`).
    An amplitude that the file does not give is zero.

    Raises
    ------
    InputError
        A code or a parameter that this model does not have, a unit of another dimension, a value out of its range:
        all faults at once.
    """
    if not description.effect:
        return ()
    if model.load_path != path_of(description) and any(table.code == LOAD_PATH for table in description.effect):
        # Built without its effects: the others belong to the arm with the other load path.
        model = build_plain(description, model.link_kind)
    known = catalogue(model, description, own)
    known |= learned_among(model, [table.code for table in description.effect])
    if model.robot.parallelogram is not None:
        # The model has it already.
        known[LOAD_PATH] = load_path_effect(model.load_path, lambda: model.bar)
    faults: list[InputError] = []
    placed = []
    for table in description.effect:
        where = f"{description.name}: effect.{table.code}"
        if table.code not in known:
            faults.append(
                InputError(
                    f"{where}: this model has no such effect ({model.load_path} load path, {model.link_kind} links)",
                    code="M011",
                    allowed=codes_in_words(known),
                    remedy="correct or remove it; a code of your own needs the file with its law (--effect FILE.py)",
                )
            )
            continue
        effect = known[table.code]
        values = _values(effect, table, where, faults)
        if values is not None:
            placed.append(PlacedEffect(effect, np.array(values)))
    raise_any(f"effects of {description.name}", faults)
    return tuple(placed)


def reading_effects(
    description: ModelDescription, model: ArmModel, own: Sequence[Maker] = ()
) -> tuple[PlacedEffect, ...]:
    """The effects of a description that are no part of :func:`build_arm`'s model: on loads, parts and readings."""
    return tuple(e for e in described_effects(description, model, own) if e.effect.stage != "model")


def codes_in_words(codes: Iterable[str]) -> str:
    """Codes in one line: places of a family together, ``backlash:{j1|j2}``."""
    places: dict[str, list[str]] = {}
    for code in codes:
        family, _, place = code.partition(":")
        places.setdefault(family, []).append(place)
    out = []
    for family, found in places.items():
        named = [place for place in found if place]
        one = named[0] if len(named) == 1 else f"{{{'|'.join(named)}}}"
        out.append(f"{family}:{one}" if named else family)
    return ", ".join(out)


def effect_tables(
    placed: Sequence[PlacedEffect], source: str, notes: Mapping[str, str] | None = None
) -> tuple[EffectTable, ...]:
    """Effects as tables of a model file, in the units that they are shown in.

    ``notes``: by ``CODE.NAME``. A compliance of zero is left out: nothing of it acts.
    """
    said = notes or {}
    out = []
    for one in placed:
        numbers = {}
        for parameter in one.effect.parameters:
            value = one.by_name[parameter.name]
            if math.isinf(value) and parameter.scale == "compliance":
                continue
            numbers[parameter.name] = EffectNumber(
                value=value / factor(parameter.dimension, parameter.unit),
                unit=parameter.unit,
                source=source,
                note=said.get(f"{one.effect.code}.{parameter.name}"),
            )
        out.append(EffectTable(code=one.effect.code, parameters=numbers, note=one.effect.words))
    return tuple(out)


def with_effects(
    description: ModelDescription,
    placed: Sequence[PlacedEffect],
    source: str,
    notes: Mapping[str, str] | None = None,
    source_text: str = "diagnosis",
) -> ModelDescription:
    """The description with effects added, or replaced where it has one of that code; all else stays.

    ``source``: key of the description's sources; one that is not there is added as ``source_text``.
    """
    new = {table.code: table for table in effect_tables(placed, source, notes)}
    kept = [new.pop(table.code, table) for table in description.effect]
    data = description.model_dump(by_alias=True)
    data["effect"] = [table.model_dump() for table in (*kept, *new.values())]
    data["sources"] = {source: source_text, **data["sources"]}
    return ModelDescription.model_validate(data)


def without_effect(description: ModelDescription, code: str) -> ModelDescription:
    """The description without the effect of that code; the same if it has none."""
    kept = tuple(table for table in description.effect if table.code != code)
    return description.model_copy(update={"effect": kept})


def _values(effect: Effect, table: EffectTable, where: str, faults: list[InputError]) -> list[float] | None:
    """The numbers as the law takes them; faults are added to the list."""
    before, values = len(faults), []
    names = [p.name for p in effect.parameters]
    for name in table.parameters:
        if name not in names:
            allowed = ", ".join(names) or "none"
            faults.append(
                InputError(f"{where}.parameters: unknown parameter", code="M011", value=name, allowed=allowed)
            )
    for parameter in effect.parameters:
        place, number = f"{where}.parameters.{parameter.name}", table.parameters.get(parameter.name)
        if number is None:
            if parameter.role == "shape" and parameter.default is None:
                remedy = "add it (a table { value, unit, source })"
                faults.append(
                    InputError(f"{place}: this key is missing", code="M011", allowed=_range(parameter), remedy=remedy)
                )
            values.append(parameter.default or 0.0)
            continue
        try:
            values.append(parameter.amplitude(_si(parameter, number, place)))
        except InputError as fault:
            faults.append(fault)
    if effect.amplitudes and not table.parameters:
        remedy = "give one of them, or remove the effect"
        faults.append(
            InputError(f"{where}: no parameter is given", code="M011", allowed=", ".join(names), remedy=remedy)
        )
    return values if len(faults) == before else None


def _si(parameter: EffectParameter, number: EffectNumber, place: str) -> float:
    """The value in SI; raises InputError for a unit or a value that it cannot have."""
    try:
        scale = factor(parameter.dimension, number.unit)
    except ValueError as error:
        raise InputError(f"{place}: {error}", code="M011", remedy="correct the unit") from error
    if parameter.dimension == "compliance" and _kind(number.unit) != _kind(parameter.unit):
        raise InputError(f"{place}: unit", code="M011", value=number.unit, allowed=parameter.unit)
    value = number.value * scale
    low = parameter.lower if parameter.role == "shape" else 0.0
    must_be_positive = parameter.scale == "compliance" or (parameter.role == "shape" and low > 0.0)
    if must_be_positive and not value > 0.0:
        raise InputError(
            place, code="M011", value=number.value, allowed=f"greater than 0, plausible {_range(parameter)}"
        )
    if parameter.role == "shape" and not _within_reason(parameter, value):
        raise InputError(
            place, code="M011", value=number.value, allowed=f"not far from what is plausible, {_range(parameter)}"
        )
    if must_be_positive:
        try:
            check_magnitude(parameter.dimension, number.unit, number.value, positive=True)
        except ValueError as error:
            allowed = f"plausible {_range(parameter)}"
            raise InputError(f"{place}: {error}", code="M011", value=number.value, allowed=allowed) from error
    if not parameter.signed and low >= 0.0 and value < 0.0:
        raise InputError(place, code="M011", value=number.value, allowed=f"0 or more, plausible {_range(parameter)}")
    return value


def _within_reason(parameter: EffectParameter, value: float) -> bool:
    """Whether a law with this number, which it divides by or raises to, still gives figures."""
    far = FAR_RATIO if parameter.dimension == "ratio" else FAR
    least = parameter.lower / far if parameter.lower > 0.0 else 0.0
    return least <= abs(value) <= far * max(abs(parameter.lower), abs(parameter.upper))


def _kind(unit: str) -> str:
    return unit.replace("mm", "m")


def _range(parameter: EffectParameter) -> str:
    scale = factor(parameter.dimension, parameter.unit)
    return f"{parameter.lower / scale:.3g} to {parameter.upper / scale:.3g} {parameter.unit}".removesuffix(" 1")
