"""All effects that a model can have, by code; a user's own are checked before they are used.

Of these nothing may happen at zero amplitude, and plausible numbers must give something.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from fem.compiled.compliance import deflection
from fem.effects.base import Effect, PlacedEffect
from fem.effects.frames import frame_effects
from fem.effects.joint_laws import joint_laws
from fem.effects.lagging_laws import lagging_laws
from fem.effects.learned import learned_laws
from fem.effects.learned_parts import FAMILY, plain_reach
from fem.effects.load_paths import load_path, partial_load_path
from fem.effects.loose_parts import loose_parts
from fem.effects.observed import observed
from fem.effects.set_up import set_up_effects
from fem.effects.situation import plain_history
from fem.effects.sizes import usual
from fem.effects.structure import link_flexibility, structure, wrist_coupling
from fem.model import ArmModel, BarPart, build_model
from fem.statics.loads import LoadedPoses
from robots import InputError, LoadPath, ModelDescription, require_one_of

# A user's own effects: for a model, the effects that it can have.
Maker = Callable[[ArmModel], Iterable[Effect]]

# Poses and loads that a law is tried on. Two: a law that mixes up poses and parameters shows in its shapes.
TRIED = 3
LOADS = (-150.0, -650.0, 375.0)
# Displacements at zero amplitude must equal those without the effect, m and rad.
NOTHING = 1e-12


def checked_maker(make: Callable[[ArmModel], Any], where: str) -> Maker:
    """The maker of a user's effects whose results are checked; ``where`` names its file in messages."""
    last: list[tuple[ArmModel, list[Effect]]] = []

    def maker(model: ArmModel) -> list[Effect]:
        # One arm is asked for its effects many times; trying a law takes a few milliseconds.
        if not last or last[0][0] is not model:
            last[:] = [(model, _made(make, where, model))]
        return last[0][1]

    return maker


def _made(make: Callable[[ArmModel], Any], where: str, model: ArmModel) -> list[Effect]:
    try:
        given = make(model)
        effects = list(given) if isinstance(given, Iterable) else given
    except InputError as error:
        raise InputError(f"{where}: {error}", code="M012") from error
    except Exception as error:  # what it does is the user's affair
        raise InputError(
            f"{where}: effects(model) fails ({type(error).__name__}: {error})", code="M012", remedy="mend the file"
        ) from error
    if not isinstance(effects, list) or not all(isinstance(e, Effect) for e in effects):
        raise InputError(
            f"{where}: effects(model)",
            code="M012",
            value=type(given).__name__,
            allowed="a list of fem.effects.Effect",
            remedy="return the effects in a list",
        )
    out = [replace(effect, own=True) for effect in effects]
    for effect in out:
        try:
            _try(effect, model)
        except InputError as error:
            raise InputError(f"{where}: {error}", code="M012") from error
    return out


def _try(effect: Effect, model: ArmModel) -> None:
    """Ask the law at plausible numbers and at zero amplitude, on a few poses."""
    if not effect.code or effect.code != effect.code.strip():
        raise InputError("effect: code", code="M012", value=effect.code, allowed="a word such as my-effect:j2")
    middle = model.robot.limits.mean(axis=1)
    q = middle + np.linspace(0.0, 0.2, TRIED)[:, None] * np.diff(model.robot.limits, axis=1)[:, 0] / 2.0
    wrench = np.zeros((TRIED, 6))
    wrench[:, 2] = LOADS
    point = np.broadcast_to(model.robot.T_flange_tool[:3, 3], (TRIED, 3))
    at, history = LoadedPoses(q, wrench, point), plain_history(TRIED)
    history = replace(history, clock=np.linspace(0.0, 1.0, TRIED))
    plausible = np.array([p.grid[0] if p.role == "shape" else float(np.mean(p.size)) for p in effect.parameters])
    observed(model, at, [PlacedEffect(effect, plausible)], history)
    if effect.amplitudes:
        nothing = plausible.copy()
        nothing[effect.amplitudes] = 0.0
        left = observed(model, at, [PlacedEffect(effect, nothing)], history)
        if np.abs(left - deflection(model, q, wrench, point)).max() > NOTHING:
            raise InputError(
                f"law of effect {effect.code}: it acts although its amplitudes are zero",
                code="M012",
                remedy="make it proportional to its amplitudes, or make the number a shape",
            )


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
    of = usual(model, description)
    effects = [*structure(model, of), *wrist_coupling(model, of), *_of_links(model, description)]
    effects += _other_path(model, description)
    effects += [*joint_laws(model, of), *lagging_laws(model, of), *loose_parts(model, of)]
    effects += [*set_up_effects(model, of), *frame_effects(model)]
    for make in own:
        effects += list(make(model))
    out: dict[str, Effect] = {}
    for effect in effects:
        if effect.code in out:
            raise InputError(
                "effect", code="M011", value=effect.code, allowed="each code once", remedy="rename your own effect"
            )
        out[effect.code] = effect
    return out


def learned_among(model: ArmModel, codes: Iterable[str]) -> dict[str, Effect]:
    """Of some codes the laws that were learned; their reach stands in their numbers."""
    if not any(code.startswith(FAMILY) for code in codes):
        return {}
    return {effect.code: effect for effect in learned_laws(model, plain_reach(model))}


def effect_of(
    code: str, model: ArmModel, description: ModelDescription | None = None, own: Sequence[Maker] = ()
) -> Effect:
    """One effect by its code; raises InputError where the model cannot have it."""
    known = catalogue(model, description, own)
    known |= learned_among(model, [code])
    require_one_of("effect", code, known, code="M011")
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

    @cache
    def bar() -> BarPart | None:
        return model.bar or build_model(description, model.link_kind, "parallelogram").bar

    path: LoadPath = "parallelogram" if model.bar is None else "serial"
    return [load_path(path, bar), partial_load_path(path, bar)]
