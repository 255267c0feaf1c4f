"""The truth of a set, rebuilt from seed, sort and index alone: arm as built, effects, campaign, instrument."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .arms import Arm, arm
from .campaign import Campaign
from .chance import Chance
from .design import SORTS, Design, conducted, designed, level
from .excess import blocks, unexplained
from .families import BAR, CATALOGUE, OUTSIDE, PAIRED
from .instruments import Instrument, instrument
from .mechanics import Effect, World, readings, situation, spring_columns
from .screws import Array

DETECTABLE = 30.0
TRIES = 20


@dataclass(frozen=True)
class Truth:
    """All there is to know of a set; ``clean`` is the world without nuisance, ``free`` the springs the model has."""

    seed: int
    sort: str
    index: int
    design: Design
    arm: Arm
    campaign: Campaign
    effects: tuple[Effect, ...]
    excess: tuple[float, ...]
    both: float
    clean: World
    built: World
    instrument: Instrument
    nominal: Array
    free: tuple[int, ...]
    model_path: float
    beam: bool

    @property
    def axes(self) -> list[int]:
        """Which of x, y, z the gauge reads."""
        return [0, 1, 2] if self.design.reads == "xyz" else [2]

    def rng(self, *purpose: int) -> np.random.Generator:
        """A generator of this set for a purpose."""
        return np.random.default_rng([self.seed, SORTS.index(self.sort), self.index, *purpose])


def names_of(seed: int, sort: str, index: int, rng: np.random.Generator) -> list[str]:
    """Families that a set hides; of pairs the first draw."""
    if sort == "single":
        return [list(CATALOGUE)[level(seed, sort, 50, index, len(CATALOGUE))]]
    if sort == "outside":
        return [list(OUTSIDE)[level(seed, sort, 50, index, len(OUTSIDE))]]
    return [str(n) for n in rng.choice(PAIRED, 2, replace=False)] if sort == "pairs" else []


def as_built(world: World, d: Design, rng: np.random.Generator, share: dict[str, float], force: Array) -> World:
    """The world with nuisance: lengths 1 mm, zeros 0.03 deg, loads 0.5 % together and 0.1 % each, links."""
    a = world.arm
    sizes = sorted({round(float(f), 3) for f in np.linalg.norm(force, axis=1)})
    return World(
        arm=a.displaced(rng.normal(scale=1e-3, size=(a.size, 3)), rng.normal(scale=1e-3, size=3)),
        soft=world.soft,
        bar_path=world.bar_path,
        link_share=share,
        zeros=np.deg2rad(rng.normal(scale=0.03, size=a.size)),
        load_scale=1.0 + 0.005 * float(rng.normal()),
        load_errors={f: 0.001 * float(rng.normal()) for f in sizes},
    )


def link_shares(a: Arm, clean: World, c: Campaign, beam: bool, rng: np.random.Generator) -> dict[str, float]:
    """Share of each link's own beam in the truth: all of it and 3 % (beams), or 1 to 3 % of the deflection (rigid)."""
    if beam:
        return {link.name: float(1.0 + 0.03 * rng.normal()) for link in a.links}
    whole = World(a, np.zeros(a.size), clean.bar_path, {link.name: 1.0 for link in a.links}, np.zeros(a.size))
    part = float(np.mean(readings(whole, (), c) ** 2) / np.mean(readings(clean, (), c) ** 2)) ** 0.5
    wanted = rng.uniform(0.01, 0.03) / part
    return {link.name: float(wanted * rng.uniform(0.6, 1.4)) for link in a.links}


def excess_of(t: Truth, effects: Sequence[Effect], *, nuisance: bool = False) -> float:
    """Chi-square of effects beyond all springs of the model, with the true covariance; usually without nuisance."""
    seen = readings(t.built if nuisance else t.clean, effects, t.campaign)
    still = World(t.arm, np.zeros(t.arm.size), t.model_path, t.clean.link_share, np.zeros(t.arm.size))
    covariance, root = covariances(t, seen, t.campaign)
    fixed = readings(still, (), t.campaign) if t.beam else np.zeros_like(seen)
    columns = spring_columns(t.arm, t.campaign, t.model_path)[:, t.axes][:, :, list(t.free)]
    return unexplained(covariance, root, columns, (seen - fixed)[:, t.axes])


def covariances(t: Truth, seen: Array, c: Campaign) -> tuple[Array, Array]:
    """Covariance (n, axes, axes) of each reading's own noise, and the root (n, axes, groups) of what groups share."""
    s = situation(t.clean, (), c)
    full = float(np.linalg.norm(t.campaign.force, axis=1).max())
    own = t.instrument.covariance(seen, s.point, c.force, full)[:, t.axes][:, :, t.axes]
    part = seen[:, t.axes]
    groups = [np.zeros((*part.shape, 0))]
    if t.design.scatter > 0.0:
        groups.append(blocks(c.stay, t.design.scatter * part))
    if t.instrument.offset > 0.0:
        for axis in range(len(t.axes)):
            one = np.zeros_like(part)
            one[:, axis] = t.instrument.offset
            groups.append(blocks(c.session, one))
    return own, np.concatenate(groups, axis=2)


def _rigid(t: Truth, effects: Sequence[Effect]) -> Truth:
    """The truth with the effects' joints out of the model's springs."""
    gone = {e.softness[0] for e in effects if e.softness is not None}
    soft = t.clean.soft.copy()
    soft[list(gone)] = 0.0
    clean = World(t.arm, soft, t.clean.bar_path, t.clean.link_share, t.clean.zeros)
    free = tuple(j for j in t.free if j not in gone)
    return replace(t, clean=clean, free=free, effects=tuple(effects))


def _drawn(t: Truth, names: Sequence[str], rng: np.random.Generator) -> Truth:
    """The truth with effects of these families, and how far they stand out."""
    bare = situation(t.clean, (), t.campaign)
    chance = Chance(rng, t.arm, t.clean.soft, t.campaign, bare, t.model_path)
    families = CATALOGUE | OUTSIDE
    u = _rigid(t, [families[name](chance) for name in names])
    alone = tuple(excess_of(u, [e]) for e in u.effects)
    both = excess_of(u, u.effects) if len(alone) > 1 else (alone[0] if alone else excess_of(u, ()))
    return replace(u, excess=alone, both=both)


def truth(seed: int, sort: str, index: int) -> Truth:
    """The truth of set ``index`` of a sort."""
    rng = np.random.default_rng([seed, SORTS.index(sort), index, 0])
    names = names_of(seed, sort, index, rng)
    bar, links = bool(set(names) & set(BAR)), "link-flexibility" in names
    d = designed(seed, sort, index, bar, links, "turned-frame" in names)
    beam = links and bool(rng.random() < 0.5)
    a, c = arm(d.robot), conducted(d, rng)
    nominal = np.array([float(f"{k:.3g}") for k in a.springs])
    soft = 1.0 / (nominal * np.exp(rng.uniform(np.log(0.5), np.log(2.0), a.size)))
    free = tuple(range(a.size))
    if d.held:
        free = free[1:-1]
        soft[[0, -1]] = 0.0
    model_path = 0.0 if a.pin is None or (names == ["load-path"] and rng.random() < 0.5) else 1.0
    shares = {link.name: 1.0 for link in a.links} if beam else {}
    clean = World(a, soft, model_path, shares, np.zeros(a.size))
    gauge = instrument(d.noise, rng, 2.0)
    t = Truth(seed, sort, index, d, a, c, (), (), 0.0, clean, clean, gauge, nominal, free, model_path, beam)
    u = _drawn(t, names, rng)
    for _ in range(TRIES - 1):
        if sort != "pairs" or settled(u):
            break
        u = _drawn(t, names_of(seed, sort, index, rng), rng)
    built = as_built(u.clean, d, rng, link_shares(a, clean, c, beam, rng), c.force)
    return replace(u, built=built)


def settled(t: Truth) -> bool:
    """Whether both of a pair stand out alone, and are not at one and the same joint."""
    first, second = t.effects
    return min(t.excess) >= DETECTABLE and (first.place != second.place or first.place not in t.arm.joints)
