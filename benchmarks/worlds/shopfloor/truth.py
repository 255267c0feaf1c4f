"""The arm as it stands in the hall: geometry as built, springs, what is hidden, nuisances; and how the tool moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.worlds.shopfloor.arms import Floats, Robot
from benchmarks.worlds.shopfloor.beams import beams
from benchmarks.worlds.shopfloor.campaign import Timeline, air
from benchmarks.worlds.shopfloor.law import Hidden, Rig, Scene
from benchmarks.worlds.shopfloor.statics import postures, springs_only

# Joints behind which links bend a little: upper arm and forearm.
BENDING = (1, 2, 3)


@dataclass(frozen=True)
class Nuisance:
    """What is a little off in every hall: joint zeros (rad), links (rad/(N m) at three joints), loads (shares)."""

    zeros: Floats
    links: float
    all_loads: float
    each_load: float
    seed: int

    def weights(self, force: Floats) -> Floats:
        """Factor of each force, the same wherever the same weights hang, (n, 1)."""
        newtons = np.rint(np.linalg.norm(force, axis=1)).astype(int)
        one = {
            n: 1.0 + self.all_loads + self.each_load * float(np.random.default_rng([self.seed, n]).normal())
            for n in set(newtons.tolist())
        }
        return np.array([one[n] for n in newtons.tolist()])[:, None]


@dataclass(frozen=True)
class Truth:
    """All that decides what a gauge would show without noise.

    drawing is the arm of the model, built the one that stands; ``carried`` the share of the links' weight in the gears
    (0: balanced), ``mood`` the hall's temperature, ``links`` factors on the beams' flexibility (none: links are
    rigid), ``span`` how long the campaign took (s), ``warmth`` its mean.
    """

    drawing: Robot
    built: Robot
    compliance: Floats
    hidden: tuple[Hidden, ...]
    nuisance: Nuisance
    carried: float
    mood: tuple[float, float, float]
    links: tuple[float, ...] = ()
    span: float = 0.0
    warmth: float = 0.0

    def hides(self, family: str) -> bool:
        """Whether an effect of this family is hidden."""
        return any(h.law.family == family for h in self.hidden)

    def plain(self, hidden: Sequence[Hidden] | None = None) -> Truth:
        """The same without nuisances; ``hidden`` instead of all that is hidden."""
        n = self.nuisance
        kept = self.hidden if hidden is None else tuple(hidden)
        nothing = Nuisance(np.zeros_like(n.zeros), 0.0, 0.0, 0.0, n.seed)
        even = (1.0,) * len(self.links)
        return replace(self, built=self.drawing, nuisance=nothing, hidden=kept, links=even)


def _rig(truth: Truth, q: Floats, line: Timeline) -> Rig:
    force = line.force * truth.nuisance.weights(line.force)
    # An arm with a parallelogram has it, whatever the model says.
    rig = Rig(q + truth.nuisance.zeros, force, np.zeros(3), np.zeros(3), np.eye(3), truth.built.parallelogram)
    for h in truth.hidden:
        if h.law.rig is not None:
            rig = h.law.rig(rig, line, h.joint, h.sizes)
    return rig


def _scene(truth: Truth, rig: Rig, line: Timeline, fresh: bool) -> Scene:
    at = postures(truth.built, rig.q, rig.shift, rig.loop)
    beside = np.einsum("nij,j->ni", at.flange_axes, rig.arm_of_force)[line.pose]
    wrench = np.hstack([rig.force, np.cross(beside, rig.force)])
    n = len(line.kind)
    clock = np.full(n, truth.span / 2) if fresh else line.time
    warm = np.full(n, truth.warmth) if fresh else line.warm
    return Scene(
        truth.built,
        at,
        line,
        rig.q,
        wrench,
        np.einsum("nki,ni->nk", at.turns[line.pose], wrench),
        truth.carried * at.weight[line.pose],
        truth.compliance,
        clock,
        warm,
        air(clock, truth.mood),
        truth.span,
        fresh,
    )


def displacement(truth: Truth, q: Floats, line: Timeline, fresh: bool = False) -> Floats:
    """What a perfect gauge shows at the readings of a timeline, (n_reads, 3) m, in the table's axes.

    q : (n_pose, dof) rad, as the table has them. ``fresh``: slow things in their middle state, the gauge itself steady.
    """
    rig = _rig(truth, q, line)
    scene = _scene(truth, rig, line, fresh)
    d = springs_only(scene.at, line.pose, scene.wrench, truth.compliance)
    for k in BENDING if truth.nuisance.links else ():
        d = d + scene.part(k, np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]) * truth.nuisance.links)
    if truth.links:
        for beam, factor in zip(beams(truth.drawing.name), truth.links, strict=True):
            d = d + scene.part(beam.body, factor * beam.flexibility)
    for h in truth.hidden:
        if h.law.gives is not None:
            d = d + h.law.gives(scene, h.joint, h.sizes)
        if h.law.theta is not None:
            d = d + scene.turned(h.joint, h.law.theta(scene, h.joint, h.sizes))
    moved = (d - d[line.zero])[:, :3] @ rig.frame
    for h in truth.hidden:
        if h.law.reads is not None and not (fresh and (h.law.slow or not h.law.steady)):
            moved = h.law.reads(scene, moved, h.sizes)
    return np.asarray(moved[line.reads])
