"""Absolute readings as arrays: where targets stood in the tracker's frame, and at which angles."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from robots.arrays import Array, Bools, Indices, Integers


@dataclass(frozen=True)
class Labels:
    """What readings belong to: ``number`` (n,) into ``names``."""

    names: tuple[str, ...]
    number: Integers

    @staticmethod
    def of(words: tuple[str, ...]) -> Labels:
        """Numbers in the order in which the words come."""
        names = tuple(dict.fromkeys(words))
        place = {name: k for k, name in enumerate(names)}
        return Labels(names, np.array([place[w] for w in words], dtype=np.int64))

    def take(self, rows: Indices) -> Labels:
        """Some of the readings, with the names that are left."""
        return Labels.of(tuple(self.names[k] for k in self.number[rows]))


@dataclass(frozen=True)
class Payload:
    """A load that the flange carries: ``kg`` and its centre (3,) m in the flange frame."""

    kg: float
    centre: Array


@dataclass(frozen=True)
class AbsoluteReadings:
    """n positions of targets.

    ``q`` (n, dof) rad; ``position`` (n, 3) m in the frame of the reading's session; ``session``: a stay of tracker and
    base, with a frame of its own; ``target``: a point fixed to the flange, the same in all sessions; ``payload``: which
    of ``payloads`` the flange carried; ``rail`` (n,) m, zero without a rail; ``sigma`` (n,) m as given, NaN where none
    was; ``line`` (n,): where the reading stands in its file. ``time`` (n,): when it was read, in s, or in steps where
    only their order is known; ``temperature`` (n,) deg C; empty where the table does not say. ``approach`` (n, dof): 1
    where a joint last turned the positive way before it stopped, -1 the negative way, 0 where that is not known.
    """

    source: str
    sha256: str
    q: Array
    position: Array
    session: Labels
    target: Labels
    payload: Integers
    payloads: tuple[Payload, ...]
    rail: Array
    sigma: Array
    line: Integers
    notes: tuple[str, ...] = ()
    time: Array = field(default_factory=lambda: np.zeros(0))
    temperature: Array = field(default_factory=lambda: np.zeros(0))
    approach: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def __len__(self) -> int:
        return len(self.q)

    @property
    def has_rail(self) -> bool:
        """Whether the base was moved along a rail."""
        return bool(np.ptp(self.rail) > 0.0) if len(self) else False

    def take(self, rows: Indices | Bools) -> AbsoluteReadings:
        """Some of the readings, in that order."""
        k: Indices = np.arange(len(self))[rows]
        return AbsoluteReadings(
            self.source,
            self.sha256,
            self.q[k],
            self.position[k],
            self.session.take(k),
            self.target.take(k),
            self.payload[k],
            self.payloads,
            self.rail[k],
            self.sigma[k],
            self.line[k],
            self.notes,
            *(x[k] if len(x) else x for x in (self.time, self.temperature, self.approach)),
        )
