"""Accuracy by region of the workspace: cubes in the arm's base frame, and which differ by more than chance.

Chance is what shuffling the poses over the regions gives, each with all of its readings: the RMS of a region counts as
better or worse than the rest where, of all regions at once, fewer than one shuffle in twenty has any that far off.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from doe.absolute.calibrate import Positions
from doe.certainty.folds import pose_numbers
from robots.arrays import Array, Indices, Integers

Verdict = Literal["better", "as elsewhere", "worse", "too few readings"]
# Edges that are tried, m; the first with so many readings in the regions of most readings is taken, else the largest.
EDGES_m = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.75, 1.0)
ENOUGH = 10
# Fewer readings than this say nothing of a region.
LEAST = 6
SHUFFLES, CHANCE = 400, 0.05


@dataclass(frozen=True)
class Accuracy:
    """Mean, RMS and largest of distances, m."""

    mean: float
    rms: float
    largest: float

    @staticmethod
    def of(d: Array) -> Accuracy:
        """Of distances (n,) m, one or more."""
        return Accuracy(float(d.mean()), float(np.sqrt(np.mean(d**2))), float(d.max()))


@dataclass(frozen=True)
class Region:
    """A cube from ``low`` to ``high`` (3,) m in the arm's base frame with so many ``readings``.

    ``before``, ``after``, ``left_out``: how far off the arm is there as described, calibrated, and at readings that the
    calibration had not seen; ``verdict``: of the last.
    """

    low: Array
    high: Array
    readings: int
    before: Accuracy
    after: Accuracy
    left_out: Accuracy
    verdict: Verdict


@dataclass(frozen=True)
class Regions:
    """All regions that were read, by cubes of ``edge`` m; wrong readings are left aside.

    ``place`` (n, 3) m: where readings are in the base frame; ``before``, ``left_out`` (n,) m: their distances.
    """

    edge: float
    regions: tuple[Region, ...]
    place: Array
    before: Array
    left_out: Array

    @property
    def judged(self) -> tuple[Region, ...]:
        """Regions with enough readings, the most accurate first."""
        enough = (r for r in self.regions if r.verdict != "too few readings")
        return tuple(sorted(enough, key=lambda r: r.left_out.rms))

    @property
    def words(self) -> str:
        """What it says, in a sentence or two."""
        judged = self.judged
        cubes = f"{len(judged)} regions of {1e3 * self.edge:g} mm"
        differ = [r for r in judged if r.verdict != "as elsewhere"]
        if len(judged) < 2:
            return "too few readings to tell regions apart"
        if not differ:
            return f"{cubes}: none is more accurate than the rest by more than chance"
        out = cubes
        for verdict, which in (("better", judged[0]), ("worse", judged[-1])):
            count = sum(r.verdict == verdict for r in judged)
            if count and which.verdict == verdict:
                out += (
                    f"; {count} {'is' if count == 1 else 'are'} {verdict} than the rest by more than chance, the "
                    f"{'most' if verdict == 'better' else 'least'} accurate at {where(which)}: "
                    f"{1e3 * which.left_out.rms:.3f} mm RMS"
                )
        return out


def where(r: Region) -> str:
    """A region's ranges in mm."""
    return ", ".join(
        f"{a} {1e3 * low:.0f} to {1e3 * high:.0f}" for a, low, high in zip("xyz", r.low, r.high, strict=True)
    )


def accuracy_regions(c: Positions, *, edge: float | None = None, seed: int = 0) -> Regions:
    """Accuracy by region; ``edge`` m of the cubes: by default as small as readings allow."""
    data, right = c.found.data, c.right
    place = np.empty((len(data), 3))
    for s, frame in enumerate(c.found.frames):
        mine = data.session.number == s
        place[mine] = frame.inside(data.position[mine]).T
    before, after, out = (d for d in c.distances().values())
    place = place[right]
    edge = edge or _edge(place)
    cell, which = np.unique(np.floor(place / edge).astype(np.int64), axis=0, return_inverse=True)
    which = which.reshape(-1)
    verdicts = _verdicts(out, which, pose_numbers(data.q[right]), np.random.default_rng(seed))
    made = []
    for k, corner in enumerate(cell):
        mine = which == k
        made.append(
            Region(
                corner * edge,
                (corner + 1) * edge,
                int(mine.sum()),
                Accuracy.of(before[mine]),
                Accuracy.of(after[mine]),
                Accuracy.of(out[mine]),
                verdicts[k],
            )
        )
    return Regions(edge, tuple(made), place, before, out)


def _edge(place: Array) -> float:
    for edge in EDGES_m:
        _, which, counts = np.unique(
            np.floor(place / edge).astype(np.int64), axis=0, return_inverse=True, return_counts=True
        )
        # Regions at the rim hold few readings at any size: asked is what most readings have around them.
        if np.median(counts[which.reshape(-1)]) >= ENOUGH:
            return edge
    return EDGES_m[-1]


def _verdicts(d: Array, which: Integers, pose: Integers, rng: np.random.Generator) -> list[Verdict]:
    """Of each region, by shuffling poses (n,) with their distances d (n,) over the regions (n,) of others."""
    counts = np.bincount(which)
    enough = counts >= LEAST
    if enough.sum() < 2:
        return ["as elsewhere" if e and len(counts) > 1 else "too few readings" for e in enough]

    def logs(at: Integers) -> Array:
        inside = np.maximum(np.bincount(at, minlength=len(counts)), 1)
        return np.asarray(0.5 * np.log(np.maximum(np.bincount(at, d**2, len(counts)) / inside, 1e-300)))

    null = np.array([logs(which[_shuffled(pose, rng)]) for _ in range(SHUFFLES)])
    centre, spread = null.mean(axis=0), np.maximum(null.std(axis=0), 1e-12)
    farthest = np.abs((null - centre) / spread)[:, enough].max(axis=1)
    limit = float(np.quantile(farthest, 1.0 - CHANCE))
    off = (logs(which) - centre) / spread
    out: list[Verdict] = []
    for e, x in zip(enough, off, strict=True):
        out.append(
            "too few readings" if not e else "better" if x < -limit else "worse" if x > limit else "as elsewhere"
        )
    return out


def _shuffled(pose: Integers, rng: np.random.Generator) -> Indices:
    """For each reading (n,) the one whose place it takes: that of another pose, in turn where this has fewer."""
    each = np.bincount(pose)
    order, first = np.argsort(pose, kind="stable"), np.cumsum(each) - each
    rank = np.empty(len(pose), dtype=np.intp)
    rank[order] = np.arange(len(pose)) - first[pose[order]]
    other = rng.permutation(len(each))[pose]
    return np.asarray(order[first[other] + rank % each[other]])
