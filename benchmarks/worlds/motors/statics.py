"""An arm that takes the shape of least energy under its own weight and a load, many set-ups at once.

Unknowns are small turns and slides of its joints and of whatever else gives way. Energy is that of the parts between
them less the work of dead forces, whose places move with the arm. To first order (``bent`` False) they stay where they
are, which is how a linear model counts.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .arms import Arm, G
from .materials import Law, Now, Spring
from .motors import ONE, at, cross, direct, origin, shift, then, turn

Array = NDArray[np.float64]
Air = dict[str, float]
STIFF = 1e13
ROUNDS, LET_GO = 80, 40


@dataclass(frozen=True)
class Freedom:
    """A turn about, or a slide along, a line that is fixed to a body; none of both has no body (-1)."""

    body: int
    through: Array = field(default_factory=lambda: np.zeros(3))
    way: Array = field(default_factory=lambda: np.zeros(3))
    slides: bool = False


@dataclass
class Part:
    """A law over a sum of unknowns."""

    over: dict[int, float]
    law: Law


@dataclass(frozen=True)
class Shape:
    """Where everything is: lines of the unknowns (B, N, 3), motors of the bodies (B, n + 1, 8)."""

    points: Array
    ways: Array
    bodies: Array


@dataclass(frozen=True)
class Pull:
    """Dead load in base axes and where it acts in the frame behind everything: all (B, 3)."""

    force: Array
    moment: Array
    point: Array


class Machine:
    """An arm at B poses, as effects change it; joint i is unknown i and part i."""

    def __init__(self, arm: Arm, q: Array, springs: Array, path: str, balance: float, air: Air, bent: bool) -> None:
        """Angles (B, n) in deg, springs (B, n) in N m/rad; ``air``: how the hall warms up."""
        n = len(arm.joints)
        self.arm, self.q, self.turned, self.bent, self.balance, self.air = arm, q, arm.rad(q), bent, balance, air
        self.freedoms = [Freedom(i + 1, way=arm.about[i]) for i in range(n)]
        self.parts = [Part({i: 1.0}, Spring(springs[:, i].copy())) for i in range(n)]
        if path == "parallelogram":
            self.parts[2].over[1] = 1.0  # The third drive turns the forearm against the carousel.
        self.spring = springs

    def free(self, body: int, through: Array, way: Array, law: Law, slides: bool = False) -> int:
        """Something on a body gives way, in its frame."""
        return self._part(Freedom(body, through, way / np.linalg.norm(way), slides), law)

    def behind(self, part: int, law: Law) -> int:
        """Something gives way in a row with a part."""
        i = self._part(Freedom(-1), law)
        self.parts[part].over[i] = -1.0
        return i

    def _part(self, freedom: Freedom, law: Law) -> int:
        self.freedoms.append(freedom)
        self.beside({len(self.freedoms) - 1: 1.0}, law)
        return len(self.freedoms) - 1

    def along(self, part: int) -> dict[int, float]:
        """What a joint's drive turns, without what gives way behind it."""
        return {i: by for i, by in self.parts[part].over.items() if self.freedoms[i].body >= 0}

    def beside(self, over: dict[int, float], law: Law) -> None:
        """Something more holds."""
        self.parts.append(Part(dict(over), law))

    def divide(self, share: float) -> None:
        """The third drive holds the forearm by the crank with a share of its stiffness, by the elbow with the rest."""
        k = self.spring[:, 2]
        self.parts[2] = Part({2: 1.0}, Spring((1 - share) * k))
        self.beside({1: 1.0, 2: 1.0}, Spring(share * k))

    def close(self) -> None:
        """After all effects: lines, first shape, weights."""
        N = len(self.freedoms)
        self.sums = np.array([[part.over.get(i, 0.0) for i in range(N)] for part in self.parts])
        self.body = np.array([f.body for f in self.freedoms])
        self.turns = np.array([f.body >= 0 and not f.slides for f in self.freedoms])
        order = sorted(range(N), key=lambda i: (self.body[i], i))
        rank = np.empty(N, dtype=int)
        rank[order] = np.arange(N)
        self.upstream = rank[:, None] <= rank[None, :]
        self.middles = self.arm.ends / 2
        held_by = np.append(np.arange(len(self.middles)), len(self.middles) - 1)
        self.carried = (self.body >= 0) & (self.body <= held_by[:, None])  # (bodies and tip, N)
        full = np.outer(self.arm.masses * G, [0, 0, -1.0])
        # Balancers follow the arm and carry a share of it; what stands beneath the arm still bears all.
        self.weight = (1 - self.balance) * full
        self.first = self.shape(np.zeros((len(self.q), N)))
        lever = self._levers(self.first, np.zeros((len(self.q), 3)))[:, :-1]
        self.held = self.balance * np.einsum("pc,bpnc->bn", full, lever) * (np.arange(N) >= len(self.arm.joints))

    def shape(self, x: Array) -> Shape:
        """At unknowns (B, N)."""
        B, n = len(self.q), len(self.arm.joints)
        points, ways = np.zeros((B, len(self.freedoms), 3)), np.zeros((B, len(self.freedoms), 3))
        here, bodies = np.tile(ONE, (B, 1)), []

        def place(i: int, f: Freedom, by: Array) -> Array:
            points[:, i], ways[:, i] = at(here, f.through), direct(here, f.way)
            return then(here, shift(by[:, None] * f.way) if f.slides else turn(f.way, f.through, by))

        for body in range(n + 1):
            if body:
                here = then(here, self.arm.fixed[body - 1])
                here = place(body - 1, self.freedoms[body - 1], self.turned[:, body - 1] + x[:, body - 1])
            for i, f in enumerate(self.freedoms):
                if i >= n and f.body == body:
                    here = place(i, f, x[:, i])
            bodies.append(here)
        return Shape(points, ways, np.stack(bodies, axis=1))

    def tip(self, shape: Shape, point: Array) -> Array:
        """Where a point (B, 3) behind the flange is."""
        return origin(then(shape.bodies[:, -1], shift(self.arm.flange + point)))

    def _levers(self, s: Shape, point: Array) -> Array:
        """What bodies' middles and the point move by for each unknown, (B, n + 2, N, 3)."""
        places = np.concatenate([at(s.bodies, self.middles[None]), self.tip(s, point)[:, None]], axis=1)
        arms = places[:, :, None] - s.points[:, None]
        ways = np.broadcast_to(s.ways[:, None], arms.shape)
        moves = np.where(self.turns[:, None], cross(ways, arms), ways)
        return np.asarray(moves * self.carried[:, :, None])

    def lever(self, point: Array) -> Array:
        """What the point moves by for each unknown, undeformed, (B, N, 3)."""
        return self._levers(self.first, point)[:, -1]

    def work(self, x: Array, pull: Pull) -> tuple[Array, Array]:
        """Slope (B, N) of what dead forces do, and how it changes (B, N, N)."""
        s = self.shape(x) if self.bent else self.first
        J = self._levers(s, pull.point)
        F = np.concatenate([np.broadcast_to(self.weight, (len(x), *self.weight.shape)), pull.force[:, None]], axis=1)
        slope = np.einsum("bpc,bpnc->bn", F, J) + self.held
        slope = slope + np.einsum("bc,bnc->bn", pull.moment, s.ways * self.turns[:, None])
        if not self.bent:
            return slope, np.zeros((len(x), x.shape[1], x.shape[1]))
        # Along a chain the lever of a later unknown turns about the line of an earlier one.
        turned = cross(F[:, :, None], s.ways[:, None]) * (self.carried & self.turns)[..., None]
        bend = np.einsum("bpkc,bplc->bkl", turned, J)
        return slope, np.where(self.upstream, bend, np.swapaxes(bend, 1, 2))

    def parts_pull(self, x: Array, kept: list[Array], now: Now) -> tuple[Array, Array]:
        """Torque and stiffness of all parts (B, P)."""
        y = x @ self.sums.T
        found = [part.law.pull(y[:, p], kept[p], now) for p, part in enumerate(self.parts)]
        return np.stack([f[0] for f in found], axis=1), np.stack([f[1] for f in found], axis=1)

    def rest(self, x: Array, pull: Pull, kept: list[Array], now: Now) -> tuple[Array, list[Array]]:
        """Shape of least energy near ``x`` (B, N), and memories where something let go. RuntimeError: none found."""
        for _ in range(LET_GO):
            x = self._least(x, pull, kept, now)
            y = x @ self.sums.T
            after = [part.law.snap(y[:, p], kept[p]) for p, part in enumerate(self.parts)]
            if all(a is b or np.array_equal(a, b) for a, b in zip(after, kept, strict=True)):
                return x, kept
            kept = after
        return x, kept

    def _least(self, x: Array, pull: Pull, kept: list[Array], now: Now) -> Array:
        """Newton's way, halved wherever what is out of balance would grow."""
        P, scale = self.sums, None
        work = self.work(x, pull)
        for _ in range(ROUNDS):
            torque, stiff = self.parts_pull(x, kept, now)
            out = torque @ P - work[0]
            H = np.einsum("bp,pi,pj->bij", stiff, P, P) - work[1]
            scale = 1 / np.sqrt(np.abs(np.einsum("bii->bi", H))) if scale is None else scale
            step = -scale * np.linalg.solve(H * scale[:, :, None] * scale[:, None], (out * scale)[..., None])[..., 0]
            if np.all(np.abs(step) < 1e-13 + 1e-11 * np.abs(x).max()):
                return np.asarray(x + step)
            size, part = np.linalg.norm(out * scale, axis=1), np.ones(len(x))
            for _ in range(14):
                work = self.work(x + part[:, None] * step, pull) if self.bent else work
                after = self.parts_pull(x + part[:, None] * step, kept, now)[0] @ P - work[0]
                worse = np.linalg.norm(after * scale, axis=1) > size * (1 - 1e-4 * part) + 1e-9
                if not np.any(worse):
                    break
                part = np.where(worse, part / 2, part)
            x = x + part[:, None] * step
        raise RuntimeError("no equilibrium")
