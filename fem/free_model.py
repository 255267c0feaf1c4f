"""A model with numbers set free: displacements and their exact derivatives, for all loaded poses at once.

Stiffnesses, moduli and laws act at ports (:mod:`fem.ports`), where derivatives are exact; angles and points move
the poses and loads themselves, and their derivatives are central differences of the same formula (1e-9).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fem.effects.base import PlacedEffect
from fem.effects.history import History, plain_history
from fem.effects.observed import observed
from fem.effects.situation import Situation
from fem.free_effects import changed_effects, changed_model, step_of
from fem.laws import FreeLaw
from fem.loads import LoadedPoses, placed
from fem.model import ArmModel
from fem.parameters import GEOMETRIC, Parameter, own_compliance
from fem.ports import Port, port_of, ports
from fem.statics import deflection
from robots import InputError

__all__ = ["FreeModel", "LoadedPoses"]

Array = NDArray[np.float64]
Flexibility = Callable[[float], tuple[Array, Array]]

# Loaded poses of many runs that are worked on at once: some 10 MB.
ROWS = 4000
# Steps of the central differences: a third-order error below 1e-9 of the value, and round-off below that.
STEP = {"zero": 1e-4, "tilt": 1e-4, "load": 1e-4, "point": 1e-4}


@dataclass(frozen=True)
class FreeModel:
    """A model, the numbers set free, and the loaded poses at which it is asked.

    ``laws``: springs over angles whose coefficients are among the parameters. ``walls``: by link, the link's
    flexibility and its derivative with ln(wall) as functions of the wall (m). ``effects``: what the arm has beyond
    the model, none of it in ``model`` yet; ``history`` of the loaded poses, by default each a loading from zero.
    """

    model: ArmModel
    parameters: tuple[Parameter, ...]
    at: LoadedPoses
    laws: tuple[FreeLaw, ...] = ()
    walls: dict[str, Flexibility] = field(default_factory=dict)
    effects: tuple[PlacedEffect, ...] = ()
    history: History | None = None

    def __post_init__(self) -> None:
        codes = {e.effect.code for e in self.effects}
        lost = [p.name for p in self.parameters if p.kind == "effect" and p.place not in codes]
        if lost:
            raise InputError("parameter", value=lost[0], allowed=f"effects here: {', '.join(sorted(codes)) or 'none'}")
        seen = [(p.kind, p.place, p.index) for p in self.parameters]
        for k, (p, key) in enumerate(zip(self.parameters, seen, strict=True)):
            if key in seen[:k]:
                raise InputError(f"parameter {p.name}", value="given twice", allowed="each number once")
            clash = p.kind == "stiffness" and p.index == (5,) and any(law.joint == p.place for law in self.laws)
            if clash:
                raise InputError(f"parameter {p.name}", value="a constant and a law", allowed="one of them")
            if p.kind == "wall" and p.place not in self.walls:
                raise InputError(f"parameter {p.name}", value="no sections to vary", allowed="a link with a section")
            if p.kind == "wall" and any(
                other.kind == "modulus" and other.place == p.place for other in self.parameters
            ):
                raise InputError(
                    f"parameters {p.name} and {p.place}.modulus",
                    value="both free",
                    allowed="one of them: readings only see their product",
                )

    @property
    def start(self) -> Array:
        """The estimator's variables (p,) at the model's own values, clipped into their ranges."""
        inner = np.array([p.inner(p.value) for p in self.parameters])
        low, high = np.array([p.inner_bounds for p in self.parameters]).reshape(-1, 2).T
        return np.asarray(np.clip(inner, low, high))

    def evaluate(self, u: Array) -> tuple[Array, Array]:
        """Displacements (n, 6) and derivatives (n, 6, p) by the estimator's variables u (p,)."""
        if self.effects:
            value = self._observed(u)
            return value, self._differences(u, value)
        value, J = self._at_ports(u, self.moved(u))
        for k, p in enumerate(self.parameters):
            if p.kind in GEOMETRIC:
                h = STEP[p.kind]
                ends = [self._at_ports(_stepped(u, k, s * h), self.moved(_stepped(u, k, s * h)))[0] for s in (1, -1)]
                J[:, :, k] = (ends[0] - ends[1]) / (2.0 * h)
        return value, J

    def displacement(self, u: Array) -> Array:
        """Displacements (n, 6) alone, at a fraction of the work where angles or points are free."""
        if self.effects:
            return self._observed(u)
        return self._at_ports(u, self.moved(u))[0]

    def displacements(self, u: Array) -> Array:
        """Displacements (r, n, 6) for many sets of variables u (r, p): as many at once as memory serves best."""
        if self.effects or any(p.kind == "wall" for p in self.parameters):
            return np.array([self.displacement(one) for one in u]).reshape(len(u), len(self.at), 6)
        out, at = np.empty((len(u), len(self.at), 6)), self.at
        step = max(ROWS // max(len(at), 1), 1)
        for first in range(0, len(u), step):
            some = u[first : first + step]
            each, times = np.repeat(some, len(at), axis=0), (len(some), 1)
            tiled = LoadedPoses(np.tile(at.q, times), np.tile(at.wrench, times), np.tile(at.point, times))
            value = self._at_ports(each, self._moved(each, tiled))[0]
            out[first : first + step] = value.reshape(len(some), len(at), 6)
        return out

    @property
    def is_linear(self) -> bool:
        """Whether displacements are linear in all variables; of a user's own effects that is not known."""
        return all(p.is_linear for p in self.parameters) and not any(e.effect.own for e in self.effects)

    def take(self, rows: NDArray[np.intp]) -> tuple[FreeModel, NDArray[np.intp]]:
        """The same at some of the loaded poses (rising numbers), and which of the new ones these are.

        With effects whole load cycles stay: what was read before is what a memory remembers.
        """
        kept, history = rows, self.history
        if self.effects and history is not None:
            kept = np.flatnonzero(np.isin(history.cycle, history.cycle[rows]))
            history = history.take(kept)
        at = LoadedPoses(self.at.q[kept], self.at.wrench[kept], self.at.point[kept])
        return replace(self, at=at, history=history), np.searchsorted(kept, rows)

    def _observed(self, u: Array) -> Array:
        """Displacements (n, 6) with effects."""
        model = changed_model(self.model, self.parameters, self.laws, self.walls, u)
        effects = changed_effects(self.effects, self.parameters, u)
        moved = self.moved(u)
        start = self._start if moved is self.at else None
        return observed(model, moved, effects, self.history or plain_history(len(self.at)), start)

    @cached_property
    def _start(self) -> Situation:
        """Statics at the loaded poses as they are, for all numbers that leave them there."""
        situation = Situation(self.model, self.at, self.history or plain_history(len(self.at)))
        if any(e.effect.stage == "arm" and not e.effect.own for e in self.effects):
            _ = situation.places, situation.preload
        return situation

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
            fixed = STEP.get(p.kind)
            low, high = step_of(p, at, exact=False) if fixed is None else (at - fixed, at + fixed)
            ends = [self._observed(_stepped(u, k, end - at)) for end in (low, high)]
            J[:, :, k] = (ends[1] - ends[0]) / (high - low)
        return J

    def moved(self, u: Array) -> LoadedPoses:
        """The loaded poses with angles, points and loads as the parameters say."""
        return self._moved(u, self.at)

    def _moved(self, u: Array, at: LoadedPoses) -> LoadedPoses:
        """The same of any loaded poses (n), for variables (p,) or one set of them for each pose (n, p)."""
        shift = {kind: np.zeros((*u.shape[:-1], at.q.shape[1] if kind == "zero" else 3)) for kind in GEOMETRIC}
        for k, p in enumerate(self.parameters):
            if p.kind in GEOMETRIC:
                shift[p.kind][..., p.index[0]] += u[..., k]
        if not any(s.any() for s in shift.values()):
            return at
        moved = LoadedPoses(at.q + shift["zero"], at.wrench, at.point + shift["point"])
        return placed(self.model.robot, moved, shift["load"], shift["tilt"])

    @cached_property
    def _unmoved(self) -> tuple[dict[str, Port], Array]:
        return self._mechanics(self.at)

    def _mechanics(self, at: LoadedPoses) -> tuple[dict[str, Port], Array]:
        """Ports, and the displacement (n, 6) of the model as it is."""
        used = {p.place for p in self.parameters} | {law.joint for law in self.laws}
        as_it_is = deflection(self.model, at.q, at.wrench, at.point)
        return ports(self.model, at.q, at.wrench, at.point, used), as_it_is

    def _at_ports(self, u: Array, at: LoadedPoses) -> tuple[Array, Array]:
        """Displacements and derivatives by everything but geometry; u (p,), or (n, p) where no wall is free."""
        places, as_it_is = self._unmoved if at is self.at else self._mechanics(at)
        value = as_it_is.copy()
        # A parameter's derivatives lie together in memory: they are written one parameter at a time.
        J = np.zeros((len(self.parameters), len(at), 6)).transpose(1, 2, 0)
        for k, p in enumerate(self.parameters):
            v = u[..., k]
            if p.kind in ("stiffness", "coupling"):
                a, b = p.index[0], p.index[-1]
                J[:, :, k] = port_of(places, p.place).influence(a, b)
                change = v - own_compliance(self.model, p.place, a, b, at.q)
                value += change[:, None] * J[:, :, k]
            elif p.kind == "modulus":
                port = port_of(places, p.place)
                J[:, :, k] = p.value * _share(port)
                value += np.reshape(v - 1.0 / p.value, (-1, 1)) * J[:, :, k]
            elif p.kind == "wall":
                F, dF = self.walls[p.place](p.outer(float(v)))
                port = port_of(places, p.place)
                # The serial load path leaves the lever's pin, the last six rows, without load.
                s = len(port.distinct)
                J[:, :, k] = port.share(dF[:s, :s])
                value += port.share(F[:s, :s]) - _share(port)
        for law in self.laws:
            columns = slice(law.first, law.first + law.basis.size)
            basis = law.basis(at.q)
            compliance = np.exp(-np.sum(basis * u[..., columns], axis=1))
            influence = port_of(places, law.joint).influence(5, 5)
            value += (compliance - own_compliance(self.model, law.joint, 5, 5, at.q))[:, None] * influence
            J[:, :, columns] = -(compliance[:, None] * basis)[:, None, :] * influence[:, :, None]
        return value, J


def _share(port: Port) -> Array:
    assert port.flexibility is not None  # noqa: S101 - links and the bar have one
    return port.share(port.flexibility)


def _stepped(u: Array, k: int, h: float) -> Array:
    out = np.array(u, dtype=np.float64)
    out[k] += h
    return out
