"""Parameters of a model that can be set free, by name.

Names: ``PLACE.ROW`` is a stiffness (``j2.rz``, also ``j2.stiffness``; ``base.rx``, ``tool.ty``), with rows tx, ty,
tz (N/m) and rx, ry, rz (N m/rad) in the place's axes; ``PLACE.ROW-ROW`` an entry of the compliance off the
diagonal; ``LINK.modulus`` (Pa) and ``LINK.wall`` (m, a factor of all its walls); ``bar.stiffness`` (N/m);
``JOINT.zero`` (rad), ``load.x|y|z`` (m: where the load acts, from the read point, flange axes),
``load.tilt_x|tilt_y`` (rad: the load's direction about the base axes), ``point.x|y|z`` (m: read and loaded point,
flange axes, of all readings: the model's tool point, and points that readings bring themselves); ``JOINT.law[k]`` the
coefficients of ln(stiffness) over joint angles (:mod:`fem.springs`); ``CODE.NAME`` a number of an effect that the
model has (``backlash:j2.gap``). What each kind is: :mod:`fem.free.kinds`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fem.effects.base import PlacedEffect
from fem.free.base import SHIFT, TURN, Kind, Parameter, Scale
from fem.free.kinds import KINDS, of_effect
from fem.model import ArmModel
from robots import InputError

__all__ = ["SHIFT", "TURN", "Kind", "Parameter", "Scale", "known_parameters", "parameter"]


def parameter(model: ArmModel, name: str, effects: Sequence[PlacedEffect] = ()) -> Parameter:
    """The parameter of that name with the model's value and the widest plausible range.

    Coefficients of laws are made by :func:`fem.free.laws.law_parameters`; ``effects``: those that the model has.

    Raises
    ------
    InputError
        No such place or number in this model.
    """
    place, _, what = name.partition(".")
    made = (kind.made(model, place, what) for kind in KINDS)
    found = next((p for p in made if p is not None), None) or of_effect(effects, name)
    if found is None:
        raise InputError("parameter", value=name, allowed="; ".join(known_parameters(model, effects)))
    return replace(found, name=name)


def known_parameters(model: ArmModel, effects: Sequence[PlacedEffect] = ()) -> list[str]:
    """The names that :func:`parameter` takes for this model, in words."""
    out = [words for kind in KINDS for words in kind.known(model)]
    for one in effects:
        names = [p.name for p in one.effect.parameters]
        if names:
            out.append(f"{one.effect.code}.{names[0] if len(names) == 1 else '{' + '|'.join(names) + '}'}")
    return out
