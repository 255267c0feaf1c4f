"""Where a diagnosis sets out: readings, a model whose springs are fitted to them, and what it predicts for them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from doe.diagnosis.doubts import bends
from doe.diagnosis.nuisance import nuisance
from doe.estimation.assumed_walls import assumed_walls
from doe.estimation.blocks import Alike
from doe.estimation.estimate import estimate
from doe.estimation.problem import Problem, problem
from doe.estimation.repeats import repeated
from doe.tables.loaded import history_of
from doe.tables.measurements import Measurements
from fem.effects.base import Effect, PlacedEffect
from fem.effects.catalogue import Maker, catalogue
from fem.effects.learned import learned_laws
from fem.effects.learned_parts import Reach
from fem.effects.observed import observed, seen, spring_influences
from fem.effects.situation import History, Situation
from fem.effects.structure import joint_is_rigid
from fem.free.parameters import parameter
from fem.model import ArmModel
from robots import InputError, ModelDescription
from robots.arrays import Array, Bools

# Compliances, rad/(N m), to expect of joints of which nothing is known: axes 1 to 3, and the wrist's.
ARM, WRIST = 1.0 / 1.2e6, 1.0 / 3e5
# Resolution below which no gauge is believed, m and rad.
FLOOR = (5e-7, 5e-7)


@dataclass(frozen=True)
class Setting:
    """What a diagnosis works on: m read components of n loaded poses, a model whose springs are free.

    ``model``: as described, its springs at ``springs`` (s,) rad/(N m), those of the joints ``free``; ``known``: all
    effects that the model can have; ``accepted``: those that are taken to be there, with their numbers. ``typical``
    (s,): springs' compliances to expect; ``errors`` (m, e): change of the readings by errors that every model has.
    """

    description: ModelDescription
    model: ArmModel
    data: Problem
    history: History
    free: tuple[str, ...]
    springs: Array
    typical: Array
    errors: Array
    known: dict[str, Effect]
    accepted: tuple[PlacedEffect, ...] = ()

    @cached_property
    def unloading(self) -> Bools:
        """Whether a loaded pose (n,) was read on the way down."""
        return self.history.unloading(np.linalg.norm(self.data.free.at.wrench[:, :3], axis=1))

    @cached_property
    def arm(self) -> ArmModel:
        """The model with its springs at their values."""
        return with_compliances(self.model, self.free, self.springs)

    def read(self, model: ArmModel, effects: Sequence[PlacedEffect]) -> Array:
        """Readings (m,) that a model with effects predicts."""
        p = self.data
        return np.asarray(observed(model, p.free.at, effects, self.history)[p.row, p.component])

    @cached_property
    def seen(self) -> tuple[Array, Situation]:
        """Readings (n, 6) predicted with what is accepted, and the situation that a gauge's law is asked in."""
        return seen(self.arm, self.data.free.at, self.accepted, self.history)

    @cached_property
    def prediction(self) -> Array:
        """Readings (m,) predicted with what is accepted."""
        return np.asarray(self.seen[0][self.data.row, self.data.component])

    @cached_property
    def doubts(self) -> Array:
        """Change of the readings (m, d) by one standard deviation of what accepted effects' laws are off by.

        Each accepted effect's part of the readings may bend as :mod:`doe.diagnosis.doubts` says.
        """
        columns = [np.zeros((len(self.data), 0))]
        for number, placed in enumerate(self.accepted):
            doubt = placed.effect.law_doubt
            if doubt == 0.0:
                continue
            rest = [e for k, e in enumerate(self.accepted) if k != number]
            own = self.prediction - self.read(self.arm, rest)
            columns.append(doubt * own[:, None] * bends(placed.effect, self.data, self.situation, self.unloading))
        return np.hstack(columns)

    @cached_property
    def alike(self) -> Alike:
        """Repeats for which a law that has no clock predicts the same: one loaded pose, one phase, one prediction."""
        p = self.data
        told = np.unique(self.prediction, return_inverse=True)[1].reshape(-1)
        case = np.column_stack([p.replicate, p.free.at.distinct[1][p.row], told])
        return Alike.of(np.unique(case, axis=0, return_inverse=True)[1].reshape(-1), p.blocks)

    @property
    def residual(self) -> Array:
        """Read minus predicted (m,)."""
        return np.asarray(self.data.value - self.prediction)

    @cached_property
    def situation(self) -> Situation:
        """The arm as accepted so far, for laws that act on top; loads as the sheet says."""
        return Situation(self.arm, self.data.free.at, self.history)

    @cached_property
    def spring_columns(self) -> Array:
        """Derivatives (m, s) of the readings by the free springs' compliances."""
        p = self.data
        exact = spring_influences(self.arm, p.free.at, self.accepted, self.free, self.history)
        if exact is not None:
            return np.asarray(exact[p.row, p.component])
        columns = [self._slope(k) for k in range(len(self.free))]
        return np.stack(columns, axis=1) if columns else np.zeros((len(self.data), 0))

    def _slope(self, k: int) -> Array:
        step = max(0.2 * float(self.springs[k]), 1e-9)
        there = self.springs.copy()
        there[k] += step
        return (self.read(with_compliances(self.model, self.free, there), self.accepted) - self.prediction) / step

    def slope(self, effects: Callable[[float], Sequence[PlacedEffect]], step: float) -> Array:
        """Central difference (m,) of the readings by a number that effects have."""
        return (self.read(self.arm, effects(step)) - self.read(self.arm, effects(-step))) / (2.0 * step)

    def moved(self, springs: Array, accepted: Sequence[PlacedEffect]) -> Setting:
        """Copy with other numbers."""
        return replace(self, springs=springs, accepted=tuple(accepted))


def with_compliances(model: ArmModel, joints: Sequence[str], compliance: Array) -> ArmModel:
    """The model with other compliances (s,) rad/(N m) about some joints' axes; 0 is rigid."""
    return model.with_springs(
        {name: 1.0 / c if c > 0.0 else np.inf for name, c in zip(joints, compliance, strict=True)}
    )


def own_compliance(model: ArmModel, joint: str) -> float:
    """Compliance rad/(N m) about a joint's axis with all joints at zero."""
    spring = model.joints[model.robot.joint_names.index(joint)].axial
    return float(spring.compliance(np.zeros((1, model.robot.dof)))[0])


def free_springs(model: ArmModel, data: Measurements) -> tuple[str, ...]:
    """Joints whose springs are set free: those that have one; where none has, those that the readings see.

    Raises
    ------
    InputError
        No spring, and no reading that would see one.
    """
    names = model.robot.joint_names
    sprung = tuple(j.name for j in model.joints if not joint_is_rigid(j, model.robot.dof))
    wanted = sprung or names
    p = problem(model, data, [parameter(model, f"{name}.stiffness") for name in wanted])
    J = p.evaluate(p.free.start)[1]
    norm = np.linalg.norm(J, axis=0)
    seen = norm > 1e-6 * max(float(norm.max(initial=0.0)), 1e-300)
    if not seen.any():
        raise InputError(
            "no reading sees a joint's spring", code="C004", remedy="measure poses where the load has a lever"
        )
    return tuple(name for name, visible in zip(wanted, seen, strict=True) if visible)


def errors_of(s: Setting) -> Array:
    """Change of the readings (m, e) by one standard deviation of each error that every model and table has."""
    return nuisance(s.read, s.arm, s.data, s.history, s.known, assumed_walls(s.description, s.model))


def setting_of(
    description: ModelDescription,
    model: ArmModel,
    data: Measurements,
    *,
    accepted: Sequence[PlacedEffect] = (),
    own: Sequence[Maker] = (),
    free: Sequence[str] | None = None,
    history: History | None = None,
    known: dict[str, Effect] | None = None,
) -> Setting:
    """A model's springs fitted to readings, ready to be asked what is missing.

    ``history`` of the readings where these are part of a table; by default what they say themselves. ``known``: the
    catalogue where it has been worked out.

    Raises
    ------
    InputError
        No reading sees a joint's spring, or fewer readings than springs.
    """
    joints = tuple(free) if free is not None else free_springs(model, data)
    p = problem(model, data, [parameter(model, f"{name}.stiffness") for name in joints])
    found = estimate(p, FLOOR)
    declared = np.array([own_compliance(model, name) for name in joints])
    index = [model.robot.joint_names.index(name) for name in joints]
    usual = np.array([ARM if k < 3 else WRIST for k in index])
    typical = np.where(declared > 0.0, np.maximum(declared, found.u), np.maximum(usual, found.u))
    s = Setting(
        description,
        model,
        _by_visit(problem(model, data, ())),
        _history(data, history),
        joints,
        found.u,
        typical,
        np.zeros((len(p), 0)),
        {},
        tuple(accepted),
    )
    every = known or catalogue(model, description, own) | _learned(s)
    if not s.history.outlasts_cycles:
        every = {code: effect.without_stays() for code, effect in every.items()}
    s = replace(s, known=every)
    return replace(s, errors=errors_of(s))


def _learned(s: Setting) -> dict[str, Effect]:
    """Laws that could be learned of each place, over what was read there."""
    p, at = s.data, s.data.free.at
    force = np.linalg.norm(at.wrench[:, :3], axis=1)
    torque = np.array([np.abs(s.situation.torque(name)).max() for name in s.model.robot.joint_names])
    moment = np.abs(s.situation.places["base"].carried[3:5]).max()
    linear = np.abs(p.value[p.component < 3])
    reach = Reach(
        torque,
        np.stack([at.q.min(axis=0), at.q.max(axis=0)], axis=1),
        float(moment),
        float(force.max(initial=0.0)),
        float(linear.max(initial=0.0)),
        int(s.history.session.max(initial=0)) + 1,
    )
    return {effect.code: effect for effect in learned_laws(s.model, reach)}


def _by_visit(p: Problem) -> Problem:
    """The readings with set-ups as their repeats have them: where visits to one pose differ, each is its own."""
    told = repeated(p)
    if told is None or not told.apart:
        return p
    apart = replace(p, apart=True)
    apart.memory.update(p.memory)
    return apart


def _history(data: Measurements, history: History | None) -> History:
    """The readings' history; known as soon as some readings tell loading from unloading.

    A sheet of such readings is what a diagnosis asks for where the first ones did not: these count as loadings from
    zero beside it.
    """
    history = history or history_of(data)
    if history.is_known:
        return history
    down = history.unloading(np.linalg.norm(data.wrench[:, :3], axis=1))
    return replace(history, is_known=bool(down.any()))
