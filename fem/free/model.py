"""A model with numbers set free: displacements and their exact derivatives, for all loaded poses at once.

Stiffnesses, moduli and laws act at ports (:mod:`fem.statics.ports`), where derivatives are exact; zero errors change
the robot, points and loads change the loaded poses, and their derivatives are central differences of the same formula
(1e-9). Each number acts as the model file that holds it will: laws over angles go by the coordinates, whatever the
zero errors, and tilts and offsets are added to those that the model has.

Effects depend on the springs (friction holds back a share of a spring's turn) and on one another, so with effects the
arm is built anew for each set of numbers, and derivatives are differences. Those by stiffnesses are exact: an arm is
statically determinate, so that loads and torques do not depend on its compliances, and every effect of the catalogue is
linear in them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fem.compiled.compliance import deflection
from fem.effects.base import PlacedEffect
from fem.effects.described import with_model_effects
from fem.effects.frames import turned_further
from fem.effects.observed import observed
from fem.effects.secant import StatedLoad, with_secants
from fem.effects.situation import History, plain_history
from fem.free.base import Flexibility, Given, Parameter, Shifts
from fem.free.parameters import AXIAL, FreeLaw, law_compliance
from fem.model import ArmModel
from fem.springs import ConstantSpring, LawSpring, SpringLaw, SumSpring
from fem.statics.loads import LoadedPoses, as_read, placed
from fem.statics.ports import Port, port_of, ports
from robots import InputError
from robots.arrays import Array, Indices
from robots.robot import with_zero_errors

__all__ = ["FreeModel", "LoadedPoses"]

# Loaded poses of many runs that are worked on at once: some 10 MB.
ROWS = 4000
# Steps of differences: a share of the range for what is linear, where any step is exact; else small enough for a
# third-order error below 1e-8, of what moves poses and loads (rad, m) below 1e-9 of the value.
LINEAR_STEP, STEP = 1e-2, 1e-4


@dataclass(frozen=True)
class FreeModel:
    """A model, the numbers set free, and the loaded poses at which it is asked.

    ``at``: loads as the model says that they act. ``laws``: springs over angles whose coefficients are among the
    parameters. ``walls``: by link, the link's flexibility and its derivative with ln(wall) as functions of the wall
    (m). ``effects``: what the arm has beyond the model, none of it in ``model`` yet; ``history`` of the loaded poses,
    by default each a loading from zero. ``stated``: the load at whose secants the effects of the arm act; None: they
    act at the loads as they are.
    """

    model: ArmModel
    parameters: tuple[Parameter, ...]
    at: LoadedPoses
    laws: tuple[FreeLaw, ...] = ()
    walls: dict[str, Flexibility] = field(default_factory=dict)
    effects: tuple[PlacedEffect, ...] = ()
    history: History | None = None
    stated: StatedLoad | None = None

    def __post_init__(self) -> None:
        codes = frozenset(e.effect.code for e in self.effects)
        given = Given(codes, frozenset((law.joint, law.row) for law in self.laws), frozenset(self.walls))
        seen = [(p.kind, p.place, p.index) for p in self.parameters]
        for k, (p, key) in enumerate(zip(self.parameters, seen, strict=True)):
            if key in seen[:k]:
                raise InputError(f"parameter {p.name}", code="M001", value="given twice", allowed="each number once")
            p.kind.check(p, self.parameters, given)

    @property
    def start(self) -> Array:
        """The estimator's variables (p,) at the model's own values, clipped into their ranges."""
        inner = np.array([p.inner(p.value) for p in self.parameters])
        low, high = np.array([p.inner_bounds for p in self.parameters]).reshape(-1, 2).T
        return np.asarray(np.clip(inner, low, high))

    def evaluate(self, u: Array) -> tuple[Array, Array]:
        """Displacements (n, 6) and derivatives (n, 6, p) by the estimator's variables u (p,)."""
        if self._acts:
            value = self._observed(u)
            return value, self._differences(u, value)
        value, J = self._placed(u)
        for k, p in enumerate(self.parameters):
            if p.kind.shifts is not None:
                ends = [self._placed(_stepped(u, k, s * STEP))[0] for s in (1, -1)]
                J[:, :, k] = (ends[0] - ends[1]) / (2.0 * STEP)
        return value, J

    def displacement(self, u: Array) -> Array:
        """Displacements (n, 6) alone, at a fraction of the work where angles or points are free."""
        if self._acts:
            return self._observed(u)
        return self._placed(u)[0]

    def displacements(self, u: Array) -> Array:
        """Displacements (r, n, 6) for many sets of variables u (r, p): as many at once as memory serves best."""
        if self._acts or self._one_at_a_time:
            return np.array([self.displacement(one) for one in u]).reshape(len(u), len(self.at), 6)
        out, at = np.empty((len(u), len(self.at), 6)), self.at
        step = max(ROWS // max(len(at), 1), 1)
        for first in range(0, len(u), step):
            some = u[first : first + step]
            each, times = np.repeat(some, len(at), axis=0), (len(some), 1)
            tiled = LoadedPoses(np.tile(at.q, times), np.tile(at.wrench, times), np.tile(at.point, times))
            value = self._at_ports(each, self._turned(each, self._moved(each, tiled, self.model)), self.model)[0]
            out[first : first + step] = value.reshape(len(some), len(at), 6)
        return out

    @property
    def is_linear(self) -> bool:
        """Whether displacements are linear in all variables; of a user's own effects that is not known."""
        return all(p.is_linear for p in self.parameters) and not any(e.effect.own for e in self.effects)

    def take(self, rows: Indices) -> tuple[FreeModel, Indices]:
        """The same at some of the loaded poses (rising numbers), and which of the new ones these are.

        With effects whole load cycles stay: what was read before is what a memory remembers.
        """
        kept, history = rows, self.history
        if self.effects and history is not None:
            kept = np.flatnonzero(np.isin(history.cycle, history.cycle[rows]))
            history = history.take(kept)
        at = LoadedPoses(self.at.q[kept], self.at.wrench[kept], self.at.point[kept])
        return replace(self, at=at, history=history), np.searchsorted(kept, rows)

    @property
    def _acts(self) -> bool:
        """Whether there is more between loads and readings than the arm: effects, or a frame that may be turned."""
        return bool(self.effects) or any(p.kind.shifts == "frame" for p in self.parameters)

    def _observed(self, u: Array) -> Array:
        """Displacements (n, 6) with effects."""
        arm = self._arm(u)
        model = changed_model(arm, self.parameters, self.laws, self.walls, u)
        effects = changed_effects(self.effects, self.parameters, u)
        if (turn := self._shift(u, "frame")).any():
            effects = turned_further(effects, turn)
            # Loads are turned before they are placed: what the variables add to their place is undone with the rest.
            offset, tilt = model.load_offset + self._shift(u, "load"), model.load_tilt + self._shift(u, "tilt")
            model = replace(model, load_offset=offset, load_tilt=tilt)
        moved = self._moved(u, self.at, arm)
        if self.stated is not None:
            at_load = with_secants(with_model_effects(model, effects), effects, self.stated)
            return deflection(at_load, moved.q, moved.wrench, moved.point)
        return observed(model, moved, effects, self.history or plain_history(len(self.at)))

    def _differences(self, u: Array, value: Array) -> Array:
        """Derivatives (n, 6, p) with effects: exact by what is linear, else good to some 1e-8."""
        J = np.zeros((len(self.parameters), len(self.at), 6)).transpose(1, 2, 0)
        trusted = not any(e.effect.own for e in self.effects)
        for k, p in enumerate(self.parameters):
            at = float(u[k])
            if p.is_linear and trusted:
                # Any two points of a straight line will do, and one is known.
                low, high = step_of(p, at, exact=True)
                end = high if high - at > at - low else low
                J[:, :, k] = (self._observed(_stepped(u, k, end - at)) - value) / (end - at)
                continue
            low, high = step_of(p, at, exact=False) if p.kind.shifts is None else (at - STEP, at + STEP)
            ends = [self._observed(_stepped(u, k, end - at)) for end in (low, high)]
            J[:, :, k] = (ends[1] - ends[0]) / (high - low)
        return J

    def _placed(self, u: Array) -> tuple[Array, Array]:
        """Displacements and derivatives as :meth:`_at_ports`, of the arm and loads that the variables u (p,) say."""
        arm = self._arm(u)
        return self._at_ports(u, self._moved(u, self.at, arm), arm)

    def _arm(self, u: Array) -> ArmModel:
        """The model whose joints' zeros are where the variables u (p,) say."""
        more = self._shift(u, "zero", self.model.robot.dof)
        return replace(self.model, robot=with_zero_errors(self.model.robot, more)) if more.any() else self.model

    def _shift(self, u: Array, what: Shifts, size: int = 3) -> Array:
        """What the variables u (p,) or (n, p) add to the model's own zero errors, point, load offset or tilt."""
        shift = np.zeros((*u.shape[:-1], size))
        for k, p in enumerate(self.parameters):
            if p.kind.shifts == what:
                shift[..., p.index[0]] += u[..., k]
        return shift

    def _moved(self, u: Array, at: LoadedPoses, arm: ArmModel) -> LoadedPoses:
        """Loaded poses (n) with points and loads as variables (p,), or a set of them for each pose (n, p), say."""
        point, offset, tilt = (self._shift(u, what) for what in ("point", "load", "tilt"))
        if arm is self.model and not (point.any() or offset.any() or tilt.any()):
            return at
        read = as_read(self.model, at)
        read = replace(read, point=read.point + point)
        return placed(arm.robot, read, self.model.load_offset + offset, self.model.load_tilt + tilt)

    def _turned(self, u: Array, at: LoadedPoses) -> LoadedPoses:
        """Loaded poses turned by their own zero errors (n, p): the same where nothing goes by the coordinates."""
        more = self._shift(u, "zero", self.model.robot.dof)
        return replace(at, q=at.q + more) if more.any() else at

    @cached_property
    def _one_at_a_time(self) -> bool:
        """Whether sets of variables make arms that differ by more than what acts at the ports."""
        if any(p.kind.has_sections for p in self.parameters):
            return True
        moved = {p.kind.shifts for p in self.parameters}
        loaded = bool(self.model.load_offset.any() or {"load", "tilt"} & moved)
        return "zero" in moved and (loaded or bool(self.laws) or _varies(self.model))

    @cached_property
    def _unmoved(self) -> tuple[dict[str, Port], Array]:
        return self._mechanics(self.at, self.model)

    def _mechanics(self, at: LoadedPoses, arm: ArmModel) -> tuple[dict[str, Port], Array]:
        """Ports, and the displacement (n, 6) of the model as it is."""
        used = {p.place for p in self.parameters} | {law.joint for law in self.laws}
        as_it_is = deflection(arm, at.q, at.wrench, at.point)
        return ports(arm, at.q, at.wrench, at.point, used), as_it_is

    def _at_ports(self, u: Array, at: LoadedPoses, arm: ArmModel) -> tuple[Array, Array]:
        """Displacements and derivatives by everything but geometry; u (p,), or (n, p) where no wall is free."""
        is_unmoved = at is self.at and arm is self.model
        places, as_it_is = self._unmoved if is_unmoved else self._mechanics(at, arm)
        value = as_it_is.copy()
        # A parameter's derivatives lie together in memory: they are written one parameter at a time.
        J = np.zeros((len(self.parameters), len(at), 6)).transpose(1, 2, 0)
        for k, p in enumerate(self.parameters):
            v = u[..., k]
            if p.kind.is_at_port:
                port = port_of(places, p.place)
                change, J[:, :, k] = p.kind.at_port(p, v, port, self.model, at.q, self.walls)
                value += change
        for law in self.laws:
            columns = slice(law.first, law.first + law.basis.size)
            basis = law.basis(at.q)
            compliance = np.exp(-np.sum(basis * u[..., columns], axis=1))
            influence = port_of(places, law.joint).influence(law.row, law.row)
            value += (compliance - law_compliance(self.model, law, at.q))[:, None] * influence
            J[:, :, columns] = -(compliance[:, None] * basis)[:, None, :] * influence[:, :, None]
        return value, J


def _varies(model: ArmModel) -> bool:
    """Whether a part of the arm goes by the joints' coordinates, or by where their zeros are."""
    return any(j.laws or j.housing.any() or not _is_constant(j.axial) for j in model.joints)


def _is_constant(spring: SpringLaw) -> bool:
    return isinstance(spring, ConstantSpring) or (isinstance(spring, SumSpring) and _is_constant(spring.spring))


def _stepped(u: Array, k: int, h: float) -> Array:
    out = np.array(u, dtype=np.float64)
    out[k] += h
    return out


def changed_model(
    model: ArmModel,
    parameters: Sequence[Parameter],
    laws: Sequence[FreeLaw],
    walls: Mapping[str, Flexibility],
    u: Array,
) -> ArmModel:
    """The model with stiffnesses, moduli, walls and laws at the estimator's variables u (p,)."""
    for p, v in zip(parameters, u.tolist(), strict=True):
        model = p.kind.changed(p, v, model, walls)
    for law in laws:
        coefficients = u[law.first : law.first + law.basis.size]
        spring = LawSpring(law.basis, coefficients)
        if law.row == AXIAL:
            model = model.with_joint(law.joint, axial=spring)
        else:
            joint = model.joints[model.robot.joint_names.index(law.joint)]
            others = [(row, one) for row, one in joint.laws if row != law.row]
            model = model.with_joint(law.joint, laws=(*others, (law.row, spring)))
    return model


def changed_effects(
    effects: Sequence[PlacedEffect], parameters: Sequence[Parameter], u: Array
) -> tuple[PlacedEffect, ...]:
    """The effects with those of their numbers that are free at the estimator's variables u (p,)."""
    values = {e.effect.code: e.values.copy() for e in effects}
    for p, v in zip(parameters, u.tolist(), strict=True):
        if p.kind.of_effect:
            # A stiffness acts as a compliance, which is its variable already.
            values[p.place][p.index[0]] = v if p.scale == "compliance" else p.outer(v)
    return tuple(replace(e, values=values[e.effect.code]) for e in effects)


def step_of(p: Parameter, u: float, *, exact: bool) -> tuple[float, float]:
    """Ends of the difference by one variable at u, within its range; ``exact``: readings are linear in it."""
    low, high = p.inner_bounds
    if p.scale == "compliance":
        # The range spans decades; its geometric middle is the size that a compliance usually has.
        size = max(abs(u), float(np.sqrt(low * high)))
        h = size if exact else STEP * size
    elif exact:
        h = LINEAR_STEP * (high - low)
    elif p.is_logarithm:
        h = STEP
    else:
        h = STEP * min(max(abs(u), 0.1 * high), high - low)
    return max(u - h, low), min(u + h, high)
