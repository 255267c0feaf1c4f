"""All effects that a model can have, by code."""

from __future__ import annotations

from collections.abc import Sequence

from fem.effects.base import Effect
from fem.effects.joint_laws import joint_laws
from fem.effects.own import Maker
from fem.effects.set_up import set_up_effects
from fem.effects.structure import link_flexibility, load_path, structure, wrist_coupling
from fem.model import ArmModel, build_model
from robots import InputError, ModelDescription

__all__ = ["Maker", "catalogue", "effect_of"]


def catalogue(
    model: ArmModel, description: ModelDescription | None = None, own: Sequence[Maker] = ()
) -> dict[str, Effect]:
    """Every effect of this model by its code, in the order of the catalogue, the user's ``own`` last.

    ``description``: what the model was built from; without it the other load path, and links that the model holds
    rigid, are left out.

    Raises
    ------
    InputError
        A code is given twice.
    """
    effects = [*structure(model), *wrist_coupling(model), *_of_links(model, description)]
    effects += _other_path(model, description)
    effects += [*joint_laws(model), *set_up_effects(model)]
    for make in own:
        effects += list(make(model))
    out: dict[str, Effect] = {}
    for effect in effects:
        if effect.code in out:
            raise InputError("effect", value=effect.code, allowed="each code once", remedy="rename your own effect")
        out[effect.code] = effect
    return out


def effect_of(
    code: str, model: ArmModel, description: ModelDescription | None = None, own: Sequence[Maker] = ()
) -> Effect:
    """One effect by its code; raises InputError where the model cannot have it."""
    known = catalogue(model, description, own)
    if code not in known:
        raise InputError("effect", value=code, allowed=", ".join(known))
    return known[code]


def _of_links(model: ArmModel, description: ModelDescription | None) -> list[Effect]:
    if model.link_kind != "rigid":
        return [link_flexibility(link, is_there=True) for link in model.links]
    if description is None or not description.link:
        return []
    beams = build_model(description, links="beam", load_path=model.load_path)
    return [link_flexibility(link, is_there=False) for link in beams.links]


def _other_path(model: ArmModel, description: ModelDescription | None) -> list[Effect]:
    if description is None or model.robot.parallelogram is None:
        return []
    other = build_model(description, model.link_kind, "serial" if model.bar is not None else "parallelogram")
    return [load_path(other)]
