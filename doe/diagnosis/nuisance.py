"""What every arm and every table is off by a little: it must not pass for an effect.

A drawing's lengths are right to a millimetre or so, joints' zeros to a few hundredths of a degree, weights to a few per
mille; an instrument that was set up anew on another day has another zero; links that a model holds rigid give way by a
few per cent of the deflection, and links whose walls were assumed by 40 % more or less than theirs. Each is a column of
the readings' change by one standard deviation, with a standard normal number to it, so that what they can explain
together is not held for anything that is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from doe.estimation.assumed_walls import WALL_SD
from doe.estimation.problem import Problem
from fem.effects.base import Effect, PlacedEffect
from fem.effects.situation import History
from fem.free.parameters import parameter
from fem.model import ArmModel
from robots.arrays import Array

# What a gauge may be off by from one session to another, m or rad: at least, and as a share of what was read.
OFFSET, OFFSET_SHARE = 3e-5, 0.05
# Share of that by which all sessions together are: a gauge that is off in all of them has a zero, which is an effect.
COMMON = 0.25
# Lengths, m; loads as shares, all in common and each weight by itself; rigid links as a share of the deflection.
LENGTH, LOADS, EACH_LOAD, LINK = 1e-3, 0.005, 0.001, 0.02
# Loads that differ by less (relative) are one weight.
SAME_LOAD = 0.005

# Readings (m,) that a model with effects predicts.
Read = Callable[[ArmModel, Sequence[PlacedEffect]], Array]


def nuisance(
    read: Read, model: ArmModel, p: Problem, history: History, known: Mapping[str, Effect], walls: Sequence[str]
) -> Array:
    """Columns (m, e): change of the readings by one standard deviation of each; ``walls``: links with assumed ones."""
    here = read(model, ())
    columns = [
        *_sessions(p, history),
        *_usual(read, model, known),
        *_lengths(read, model, here),
        *_loads(p, here),
        *_links(read, model, here, known),
        *_walls(read, model, here, walls),
    ]
    columns = [c for c in columns if np.abs(c).max(initial=0.0) > 0.0]
    return np.stack(columns, axis=1) if columns else np.zeros((len(p), 0))


def _sessions(p: Problem, history: History) -> Iterator[Array]:
    """What a session's readings are off by, component by component; what all are off by is mostly a gauge's zero."""
    session = history.session[p.row]
    count = int(session.max(initial=0)) + 1
    for component in np.unique(p.component) if count > 1 else ():
        mine = p.component == component
        sd = max(OFFSET, OFFSET_SHARE * float(np.sqrt(np.mean(p.value[mine] ** 2))))
        own = np.stack([np.where(mine & (session == k), sd, 0.0) for k in range(count)])
        middle = own.mean(axis=0)
        yield from own - middle
        yield COMMON * np.sqrt(count) * middle


def _usual(read: Read, model: ArmModel, known: Mapping[str, Effect]) -> Iterator[Array]:
    """Effects that every arm has to some degree."""
    for effect in known.values():
        if effect.usual > 0.0:
            ends = [read(model, (PlacedEffect(effect, np.array([x])),)) for x in (effect.usual, -effect.usual)]
            yield 0.5 * (ends[0] - ends[1])


def _lengths(read: Read, model: ArmModel, here: Array) -> Iterator[Array]:
    """Each axis, and the flange, somewhere else along each direction of the body before it."""
    robot = model.robot
    for body in range(1, robot.dof + 1):
        for k in range(3):
            if body < robot.dof:
                T = robot.T_pre.copy()
                T[body, k, 3] += LENGTH
                other = replace(robot, T_pre=T)
            else:
                flange = robot.T_last_flange.copy()
                flange[k, 3] += LENGTH
                other = replace(robot, T_last_flange=flange)
            yield read(replace(model, robot=other), ()) - here


def _loads(p: Problem, here: Array) -> Iterator[Array]:
    """All weights in common, and each by itself."""
    yield LOADS * here
    size = np.linalg.norm(p.free.at.wrench, axis=1)[p.row]
    order = np.argsort(size, kind="stable")
    step = np.diff(size[order], prepend=-np.inf) > SAME_LOAD * np.maximum(size[order], 1e-300)
    weight = np.empty(len(size), dtype=np.intp)
    weight[order] = np.cumsum(step) - 1
    if weight.max(initial=0) > 0:
        yield from (np.where(weight == k, EACH_LOAD * here, 0.0) for k in range(int(weight.max()) + 1))


def _links(read: Read, model: ArmModel, here: Array, known: Mapping[str, Effect]) -> Iterator[Array]:
    """Links that the model holds rigid, as described but no more than a few per cent of the deflection."""
    size = float(np.linalg.norm(here))
    for effect in known.values():
        if not effect.held_rigid:
            continue
        change = read(model, (PlacedEffect(effect, np.array([1.0])),)) - here
        most = float(np.linalg.norm(change))
        if most > 0.0:
            yield change * min(effect.parameters[0].size[0], LINK * size / most)


def _walls(read: Read, model: ArmModel, here: Array, names: Sequence[str]) -> Iterator[Array]:
    """Each link whose wall was assumed, softer by what is known of it."""
    for name in names:
        modulus = parameter(model, f"{name}.modulus")
        softer = modulus.kind.changed(modulus, (1.0 + WALL_SD) / modulus.value, model, {})
        yield read(softer, ()) - here
