"""A world with something hidden: its truth is drawn, it makes readings, and it judges what these could show."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rehearsal import nuisance
from rehearsal.arm import Arm
from rehearsal.effects import DRAWS, Context
from rehearsal.evaluate import Truth, exact
from rehearsal.excess import excess_chi2
from rehearsal.kinematics import frames
from rehearsal.noise import Noise
from rehearsal.possible import NOTHING, split, sprung
from rehearsal.readings import Readings
from rehearsal.statics import joint_rows
from robots.arrays import Array, Bools

# True springs are the model's times a factor from here to its inverse.
SPRING_FACTOR = 2.0
# Each weight's own error, beside the scale that all share.
WEIGHT_ERROR = 0.001
# Lever (m) and load (N) of the arms that the sizes of effects are for, and how far sizes go with an arm's own.
USUAL_LEVER, USUAL_LOAD = 2.2, 600.0
SIZES = (1e-3, 4.0)
# Law of a kind: from a context its plain values.
Draw = Callable[[Context], dict[str, Any]]


def stream(seed: int, part: int) -> np.random.Generator:
    """Each part of a world draws from numbers of its own: more noise never moves the truth."""
    return np.random.default_rng([seed, part])


def spring_factors(dof: int, seed: int) -> Array:
    """Factors (dof,) of true springs over the model's."""
    low = 1 / SPRING_FACTOR
    return np.exp(stream(seed, 2).uniform(np.log(low), np.log(SPRING_FACTOR), dof))


def torques(arm: Arm, q: Array, wrench: Array) -> tuple[float, ...]:
    """80 % quantile (dof,) of the joints' torques, N m, at poses (n, dof) under wrenches (6,) or (n, 6)."""
    rows = joint_rows(arm, frames(arm, q))
    tau = np.abs(rows @ wrench) if wrench.ndim == 1 else np.abs(np.einsum("nji,ni->nj", rows, wrench))
    return tuple(np.maximum(np.quantile(tau, 0.8, axis=0), 1.0 if wrench.ndim == 1 else 1e-3))


def upright(arm: Arm) -> float:
    """Coordinate of joint 2, rad, at which the part behind it stands upright; 0 for an arm of one joint."""
    if arm.dof < 2:
        return 0.0
    q = np.zeros((3, arm.dof))
    q[:, 1] = 0.0, np.pi / 2, np.pi
    z = frames(arm, q).origins[:, min(3, arm.dof), 2]
    middle = (z[0] + z[2]) / 2
    return float(np.arctan2(z[1] - middle, z[0] - middle))


@dataclass(frozen=True)
class World:
    """An arm as its model has it, the truth, and the readings that are taken of it.

    ``code``: what is hidden; ``read`` (n, 3): which axes each reading has.
    """

    arm: Arm
    code: str
    truth: Truth
    readings: Readings
    noise: Noise
    read: Bools

    def measured(self) -> Array:
        """What the gauge reads (n, 3) m, NaN where nothing is read."""
        d = self.noise.read(self.readings, exact(self.truth, self.readings), stream(self.truth.seed, 5))
        return np.where(self.read, d, np.nan)

    def without_noise(self, readings: Readings) -> Array:
        """The exact displacements (n, 3) m for other readings."""
        return exact(self.truth, readings)

    def excess(self) -> float:
        """Rise of chi-square by the hidden effect alone, which springs cannot take up."""
        clean = dataclasses.replace(self.truth, nuisance=nuisance.nothing(self.arm))
        d = exact(clean, self.readings)
        return excess_chi2(
            self.arm, sprung(self.arm), self.truth.links, self.readings, d, self.noise, [0, 1, 2], self.read
        )[0]


def hide(
    arm: Arm,
    code: str,
    readings: Readings,
    noise: Noise,
    *,
    seed: int,
    links: str = "rigid",
    read: Bools | None = None,
    ranges: tuple[Array, Array] | None = None,
) -> World:
    """A world with ``code`` hidden in it, or nothing; the same for the same seed.

    ``ranges`` (dof,) N m/rad: of springs that the model does not give, where it gives none; ``read`` (n, 3): axes read.
    """
    q, size = readings.q, np.linalg.norm(readings.force, axis=1)
    largest = float(size.max(initial=0.0))
    way = readings.wrench * np.divide(largest, size, out=np.zeros_like(size), where=size > 0.0)[:, None]
    context = Sizes.of(arm, torques(arm, q, way), largest)
    springs = true_springs(arm, seed, ranges)
    effects: list[dict[str, Any]] = []
    if code != NOTHING:
        effects = drawn(arm, (code,), springs, context, seed)
    truth = Truth(arm, 1 / springs, links, nuisance.draw(arm, stream(seed, 3), WEIGHT_ERROR), tuple(effects), seed)
    return World(arm, code, truth, readings, noise, np.ones((len(q), 3), dtype=bool) if read is None else read)


def true_springs(arm: Arm, seed: int, ranges: tuple[Array, Array] | None = None) -> Array:
    """Springs (dof,) N m/rad, infinite where rigid: the model's times factors; drawn where it has none at all."""
    own = np.array([np.inf if k is None else k for k in arm.stiffness])
    if np.isfinite(own).any() or ranges is None:
        return np.asarray(own * spring_factors(arm.dof, seed))
    low, high = ranges
    return np.asarray(np.exp(stream(seed, 2).uniform(np.log(low), np.log(high))))


@dataclass(frozen=True)
class Sizes:
    """How large effects are in an arm: torques by joint (N m), joint 2's upright, and scales (see ``Context``)."""

    torque: tuple[float, ...]
    upright: float
    stiff: float = 1.0
    heavy: float = 1.0
    long: float = 1.0

    @classmethod
    def of(cls, arm: Arm, torque: tuple[float, ...], largest: float) -> Sizes:
        """Sizes that go with an arm's reach and its largest load, N."""
        long, heavy = (
            float(np.clip(own / usual, *SIZES)) for own, usual in ((arm.reach, USUAL_LEVER), (largest, USUAL_LOAD))
        )
        return cls(torque, upright(arm), float(np.clip(heavy * long, *SIZES)), heavy, long)


def drawn(
    arm: Arm,
    codes: Sequence[str],
    springs: Array,
    sizes: Sizes,
    seed: int,
    *,
    laws: Sequence[str] = (),
    more: dict[str, Draw] | None = None,
    own: bool = True,
) -> list[dict[str, Any]]:
    """Plain values of each hidden effect; a joint that the model lacks gets its spring in ``springs`` (dof,).

    ``laws``: names of the truth's laws wanted, by effect; ``more``: draws of kinds that no catalogue has; ``own``: a
    joint that is hidden keeps the spring that it has in ``springs``, if any.
    """
    known, out = {**DRAWS, **(more or {})}, []
    for k, code in enumerate(codes):
        kind, where = split(code)
        if kind not in known:
            raise ValueError(f"unknown effect {code!r}; there are {[*known]}")
        wanted = laws[k] if k < len(laws) else ""
        seen = springs if own or kind != "joint-compliance" else np.full_like(springs, np.inf)
        context = Context(
            arm,
            where,
            stream(seed, 10 + k),
            sizes.torque,
            tuple(seen),
            sizes.upright,
            wanted,
            sizes.stiff,
            sizes.heavy,
            sizes.long,
        )
        values = known[kind](context)
        out.append({"code": code, "kind": kind, "where": where, **values})
        if kind == "joint-compliance":
            springs[context.joint] = values["k_Nm_per_rad"]
    return out
