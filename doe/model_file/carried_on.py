"""What a model file knew of other numbers before a calibration: kept where these are held and still the same."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from fem import ArmModel
from fem.effects import PlacedEffect
from fem.free.parameters import Kind, Parameter, described_variables, named_numbers
from robots import InputError, ModelDescription
from robots.arrays import Array
from robots.schema.uncertainty import CalibrationUncertainty, NumberStatus, UndeterminedNumber

# A file's numbers are written with nine digits or more.
SAME = 1e-6


@dataclass(frozen=True)
class CarriedOn:
    """Numbers of an earlier calibration that this one held, with their covariance (p, p) then.

    ``status``, ``degrees_of_freedom`` (p): theirs; ``undetermined``: those that had no variance. ``lost``: names of
    the earlier calibration that are not carried on though nothing new is known of them.
    """

    names: tuple[str, ...] = ()
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    status: tuple[NumberStatus, ...] = ()
    degrees_of_freedom: tuple[float, ...] = ()
    directions: Array = field(default_factory=lambda: np.zeros((0, 0)))
    undetermined: tuple[UndeterminedNumber, ...] = ()
    lost: tuple[str, ...] = ()


NOTHING = CarriedOn()


def carried_on(
    before: ModelDescription, model: ArmModel, found: Sequence[str], effects: Sequence[PlacedEffect] = ()
) -> CarriedOn:
    """The numbers of ``before``'s calibration that the ``found`` ones do not replace and that ``model`` still has.

    ``model``: after the calibration, without ``effects``. Nothing is carried on to a model of other links or with
    another load path: there the numbers mean something else.
    """
    origin = before.calibration
    old = None if origin is None else origin.uncertainty
    if origin is None or old is None:
        return NOTHING
    new = [_key(model, name, effects) for name in found]
    alike = (origin.links, origin.load_path) == (model.link_kind, model.load_path)
    kept = [
        k for k, name in enumerate(old.parameters)
        if alike and _is_held(model, name, effects, new) and _is_same(before, model, effects, old, k)
    ]  # fmt: skip
    open_then = tuple(u for u in old.undetermined if alike and _is_held(model, u.name, effects, new))
    gone = [n for k, n in enumerate(old.parameters) if k not in kept and _is_held(model, n, effects, new)]
    directions = np.array(old.undetermined_directions).reshape(-1, len(old.parameters))[:, kept]
    return CarriedOn(
        names=tuple(old.parameters[k] for k in kept),
        covariance=np.array(old.covariance).reshape(len(old.parameters), -1)[np.ix_(kept, kept)],
        status=tuple(old.status[k] for k in kept),
        degrees_of_freedom=tuple(old.degrees_of_freedom[k] for k in kept),
        directions=directions[directions.any(axis=1)],
        undetermined=open_then,
        lost=tuple(gone),
    )


def _named(model: ArmModel, name: str, effects: Sequence[PlacedEffect]) -> Parameter | None:
    try:
        numbers = named_numbers(model, (name,), effects)
    except InputError:
        return None
    return numbers.parameters[int(numbers.columns[0])]


def _key(model: ArmModel, name: str, effects: Sequence[PlacedEffect]) -> tuple[Kind, str, tuple[int, ...]] | None:
    p = _named(model, name, effects)
    return None if p is None else (p.kind, p.place, p.index)


def _is_held(
    model: ArmModel,
    name: str,
    effects: Sequence[PlacedEffect],
    new: Sequence[tuple[Kind, str, tuple[int, ...]] | None],
) -> bool:
    """Whether the model has the number and nothing new is known of it, nor of a law in its place."""
    p = _named(model, name, effects)
    if p is None or (p.kind, p.place, p.index) in new:
        return False
    # The law of a row has index (row, k), that about the axis (k,): what it replaces is the whole law, or the spring.
    laws = {(one[1], one[2][:-1]) for one in new if one is not None and one[0].of_law}
    return ((p.place, p.index[:-1]) if p.kind.of_law else (p.spring_of, ())) not in laws


def _is_same(
    before: ModelDescription,
    model: ArmModel,
    effects: Sequence[PlacedEffect],
    old: CalibrationUncertainty,
    k: int,
) -> bool:
    """Whether the model's own number is the one that the covariance belongs to."""
    own = float(described_variables(before, named_numbers(model, (old.parameters[k],), effects))[0])
    return abs(own - old.estimate[k]) <= SAME * max(abs(own), abs(old.estimate[k]))
