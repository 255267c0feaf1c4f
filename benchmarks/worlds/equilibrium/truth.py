"""The hidden arm: what the gauge would say in each row, without noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .arm import Arm, Vector
from .chain import DIRECTIONS, Chain, Law, beam
from .effect import Effect, Row, Site
from .laws import Extra, Moment

NOTHING = np.zeros(3)


@dataclass(frozen=True)
class Nuisance:
    """What is a little off in every set, and not meant to be found.

    Metres by which bodies sit elsewhere (joints + 1, 3), rad of joint zeros, factors on loads (by level) and
    on masses, compliance of the casing before the elbow as a share of the shoulder's, and the part of its sag under
    its own weight that the controller compensates.
    """

    shifts: tuple[tuple[float, float, float], ...]
    zeros: tuple[float, ...]
    loads: tuple[float, ...]
    weigh: float
    casing: float
    compensated: float


def none(arm: Arm, compensated: float = 1.0) -> Nuisance:
    """Nothing is off."""
    count = len(arm.joints)
    return Nuisance(((0.0, 0.0, 0.0),) * (count + 1), (0.0,) * count, (1.0,), 1.0, 0.0, compensated)


def draw_nuisance(rng: np.random.Generator, arm: Arm, levels: int, compensated: float) -> Nuisance:
    """Lengths within 1 mm, zeros 0.03 deg, loads 0.5 % in common and 0.1 % each, masses 5 %, casings up to 2 %."""
    count = len(arm.joints)
    shifts = rng.uniform(-1e-3, 1e-3, (count + 1, 3))
    common = 1 + 0.005 * rng.normal()
    return Nuisance(
        tuple((float(x), float(y), float(z)) for x, y, z in shifts),
        tuple(np.radians(0.03 * rng.normal(size=count)).tolist()),
        tuple((common * (1 + 0.001 * rng.normal(size=levels))).tolist()),
        float(1 + 0.05 * rng.normal()),
        float(rng.uniform(0.005, 0.02)),
        compensated,
    )


class Truth:
    """An arm with its springs, effects and nuisances.

    ``rigid`` joints do not give way (an effect may say otherwise). ``gravity`` False is for checks of the bare chain.
    """

    def __init__(
        self,
        site: Site,
        effects: Sequence[Effect] = (),
        rigid: Sequence[str] = (),
        nuisance: Nuisance | None = None,
        gravity: bool = True,
    ) -> None:
        self.site, self.arm, self.effects = site, site.arm, list(effects)
        self.nuisance = nuisance or none(site.arm)
        wanted = self._wanted()
        shares = [e.number("share") for e in effects if e.family in ("load-path", "partial-load-path")]
        self.chain = Chain(
            self.arm,
            wanted,
            np.array(self.nuisance.shifts),
            self.nuisance.weigh,
            shares[0] if shares else None,
        )
        if not gravity:
            self.chain.model.opt.gravity[:] = 0
        self.C = self._compliances(rigid)
        self.remembers = any(effect.remembers for effect in effects)
        self.timed = any(effect.timed for effect in effects)

    def _wanted(self) -> dict[str, tuple[str, ...]]:
        wanted: dict[str, set[str]] = {}
        for effect in self.effects:
            for place, directions in effect.freedoms(self.arm).items():
                wanted.setdefault(place, set()).update(directions)
        if self.nuisance.casing:
            wanted.setdefault(self._elbow(), set()).update(DIRECTIONS)
        return {place: tuple(directions) for place, directions in wanted.items()}

    def _elbow(self) -> str:
        return self.arm.names[2]

    def _compliances(self, rigid: Sequence[str]) -> Vector:
        where = self.chain.where
        C = np.zeros((self.chain.size, self.chain.size))
        for name, spring in self.site.springs.items():
            C[where[name], where[name]] = 0.0 if name in rigid else 1 / spring
        for effect in self.effects:
            effect.compliance(C, where, self.site)
        if self.nuisance.casing:
            elbow = self.arm.joints[2]
            bending = np.linalg.norm(elbow.position) * self.site.springs[self.arm.names[1]] / self.nuisance.casing
            turned = np.kron(np.eye(2), elbow.rotation)
            slots = [where[f"{elbow.name}.{direction}"] for direction in DIRECTIONS]
            tip = beam(elbow.position, float(bending), float(0.8 * bending), float(200 * bending))
            C[np.ix_(slots, slots)] += turned.T @ tip @ turned
        return C

    def _stand(self, table: Vector) -> Vector:
        """Angles of the hinges before anything gives way."""
        real = self.arm.real(table)
        for effect in self.effects:
            real = effect.angles(real, self.site)
        real = real + np.array(self.nuisance.zeros)
        if self.nuisance.compensated:
            self.chain.pose(real, np.zeros(self.chain.size))
            sag = self.chain.mix @ (self.C @ self.chain.torque(NOTHING, NOTHING))
            real = real - self.nuisance.compensated * sag[: len(real)]
        return np.asarray(real)

    def _law(self, table: Vector, moment: Moment, extras: Sequence[Extra]) -> Law:
        C = self.C
        factors: dict[int, float] = {}
        for effect in self.effects:
            for freedom, factor in effect.factors(table, moment, self.chain.where, self.site).items():
                factors[freedom] = factors.get(freedom, 1.0) * factor
        if factors:
            root = np.ones(len(C))
            root[list(factors)] = np.sqrt(list(factors.values()))
            C = C * np.outer(root, root)

        def law(torque: Vector) -> Vector:
            out = np.asarray(C @ torque)
            for extra in extras:
                out[extra.freedom] += extra.more(float(torque[extra.freedom]), moment)
            return out

        return law

    def readings(self, rows: Sequence[Row], held_out: bool = False) -> Vector:
        """Displacement (n, 3) in m as a gauge without noise has it: loaded less unloaded equilibrium.

        Rows of the same set-up follow one another. ``held_out`` leaves what fades with gauge and clock away.
        """
        effects = [e for e in self.effects if not (held_out and e.fading)]
        for effect in effects:
            effect.begin()
        moved = self._moved(rows, held_out)
        out = np.zeros((len(rows), 3))
        for i, (row, (position, displacement)) in enumerate(zip(rows, moved, strict=True)):
            reading = displacement
            for effect in effects:
                reading = effect.reading(reading, row, position)
            out[i] = reading
        return out

    def _moved(self, rows: Sequence[Row], held_out: bool) -> list[tuple[Vector, Vector]]:
        """Position and displacement of the point that is read, row by row."""
        extras = [x for e in self.effects if not (held_out and e.fading) for x in e.extras(self.chain.where, self.site)]
        out: list[tuple[Vector, Vector]] = []
        known: dict[bytes, tuple[Vector, Vector]] = {}
        last: Row | None = None
        start = np.zeros(self.chain.size)
        for row in rows:
            fresh = last is None or row.pose != last.pose or bool(np.any(row.angles != last.angles))
            key = np.concatenate([row.angles, self._load(row), row.point]).tobytes()
            if fresh:
                stand = self._stand(row.angles)
                loaded, read = self._levers(row)
                start = self._unloaded(stand, loaded, row, extras, start)
                base = self.chain.point(read)
            elif self.remembers and last is not None and row.repeat != last.repeat:
                start = self._go(stand, NOTHING, loaded, row, extras, start)
            if self.remembers or self.timed or key not in known:
                start = self._go(stand, self._load(row), loaded, row, extras, start)
                known[key] = (base, self.chain.point(read) - base)
            out.append(known[key])
            last = row
        return out

    def _go(
        self, stand: Vector, force: Vector, lever: Vector, row: Row, extras: Sequence[Extra], start: Vector
    ) -> Vector:
        law = self._law(row.angles, row.moment, extras)
        deflection, torque = self.chain.settle(stand, force, lever, law, start)
        for extra in extras:
            extra.keep(float(torque[extra.freedom]), row.moment)
        return deflection

    def _unloaded(self, stand: Vector, lever: Vector, row: Row, extras: Sequence[Extra], start: Vector) -> Vector:
        """Equilibrium before the load; what remembers has come to rest, which depends on it in turn."""
        before = replace(row.moment, progress=-1.0)
        law = self._law(row.angles, before, extras)
        for _ in range(4 if self.remembers else 1):
            start, torque = self.chain.settle(stand, NOTHING, lever, law, start)
            for extra in extras:
                extra.rest(float(torque[extra.freedom]), before)
        if self.remembers:
            start, _torque = self.chain.settle(stand, NOTHING, lever, law, start)
        return start

    def _levers(self, row: Row) -> tuple[Vector, Vector]:
        loaded, read = row.point, row.point
        for effect in self.effects:
            loaded, read = effect.lever(loaded, read)
        return loaded, read

    def _load(self, row: Row) -> Vector:
        loads = self.nuisance.loads
        force = row.force * loads[min(row.level, len(loads) - 1)]
        for effect in self.effects:
            force = effect.force(force, row)
        return np.asarray(force)
