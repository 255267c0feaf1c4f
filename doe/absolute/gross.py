"""Readings that no scatter explains, each with what would explain it: a joint turned, another target, another row."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import f as fisher

from doe.absolute.chain import evaluate, samples
from doe.absolute.fit import Fit
from doe.absolute.readings import AbsoluteReadings
from robots.arrays import Array

# Chance of naming any reading at all where none is wrong.
CHANCE = 0.01
# An explanation leaves no more of the error than this share, and no more than so many standard deviations.
LEFT, NEAR = 0.1, 12.0
LISTED = 50
TURNS = (-np.pi, -np.pi / 2.0, np.pi / 2.0, np.pi)


@dataclass(frozen=True)
class Gross:
    """A reading far out: its ``line`` in the file, its ``distance`` m from where it should be, and the likely cause."""

    line: int
    row: int
    distance: float
    cause: str

    @property
    def words(self) -> str:
        """One sentence."""
        return f"line {self.line}: {1e3 * self.distance:.3g} mm from where the arm puts it; {self.cause}"


def gross(found: Fit) -> tuple[Gross, ...]:
    """Readings that Student's distribution with the tail found has no place for, the farthest first."""
    sigma, data = found.variances.sigma, found.data
    own = sigma**2 + np.nan_to_num(data.sigma) ** 2
    square = np.sum(found.residual**2, axis=1) / own
    tail = 1e6 if np.isinf(found.tail) else found.tail
    limit = 3.0 * float(fisher.isf(CHANCE / max(len(data), 1), 3.0, tail))
    far = np.flatnonzero(square > limit)
    far = far[np.argsort(-square[far])]
    return tuple(
        Gross(
            int(data.line[k]),
            int(k),
            float(np.linalg.norm(found.residual[k])),
            _cause(found, int(k), float(np.sqrt(own[k])), searched=i < LISTED),
        )
        for i, k in enumerate(far)
    )


def _cause(found: Fit, row: int, sigma: float, *, searched: bool) -> str:
    size = float(np.linalg.norm(found.residual[row]))
    best, cause = min(LEFT * size, max(NEAR * sigma, 0.002)), ""
    if searched:
        for words, distance in _tried(found, row):
            if distance < best:
                best, cause = distance, words
    return cause or "no single slip explains it: look for a dropped beam, or a pose that was not reached"


def _tried(found: Fit, row: int) -> Iterator[tuple[str, float]]:
    """What may have gone wrong, and how far off the reading would still be."""
    data, robot = found.data, found.model.robot
    one = data.take(np.array([row]))
    session = data.session.number[row]
    for j, name in enumerate(robot.joint_names):
        for turn in TURNS:
            q = one.q.copy()
            q[0, j] += turn
            yield (f"{name} turned by {np.degrees(turn):+.0f} deg would put it there", _distance(found, data, row, q=q))
    for t, name in enumerate(data.target.names):
        if t != data.target.number[row]:
            yield f"target {name} was there: the label is wrong", _distance(found, data, row, target=t)
    for step in (-1, 1):
        k = row + step
        if 0 <= k < len(data) and data.session.number[k] == session:
            yield (
                f"line {data.line[k]} has the angles that belong to it: the arm had not moved, or rows are shifted",
                _distance(found, data, row, q=data.q[k : k + 1]),
            )
    for a in range(3):
        flipped = data.position[row].copy()
        flipped[a] = -flipped[a]
        yield f"{'xyz'[a]} with the other sign would fit", _distance(found, data, row, position=flipped)


def _distance(
    found: Fit,
    data: AbsoluteReadings,
    row: int,
    q: Array | None = None,
    target: int | None = None,
    position: Array | None = None,
) -> float:
    part = data.take(np.array([row]))
    number = data.target.number[row] if target is None else target
    changed = replace(
        part, q=part.q if q is None else q, target=replace(data.target, number=np.array([number], dtype=np.int64))
    )
    sample = samples(found.model, changed, found.layout, found.start.nominal, found.u)[0]
    P, _ = evaluate(found.model, found.layout, sample, found.u, slopes=False)
    y = data.position[row] if position is None else position
    return float(np.linalg.norm(found.frames[data.session.number[row]].inside(y[None]) - P))
