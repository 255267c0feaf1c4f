"""Every reader of the project, by the kind of file it asks :mod:`robots.files.reading` for: how to call and check it.

A reader that is not here fails ``test_reader_registry.py``: whoever adds one adds its row, and the attack covers it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .mutate_bytes import Mutation, mutated
from .samples import Rng, Sample, chance, one


@dataclass(frozen=True)
class Reader:
    """How the attack feeds one reader.

    ``seeds``: files that it reads without a word, small ones; ``run``: reads a file and checks what came, or raises
    InputError; ``own``: mutations that know the kind of file; ``seal``: writes checksums anew, so that what lies
    behind them is reached; ``cost``: how many times slower than a quick one it is, so many times rarer is its turn.
    """

    seeds: Callable[[], Sequence[Sample]]
    run: Callable[[Path], object]
    own: tuple[Mutation, ...] = ()
    seal: Callable[[bytes], bytes] | None = None
    cost: float = 1.0
    _kept: list[Sample] = field(default_factory=list)

    @property
    def samples(self) -> list[Sample]:
        """The seeds, made once."""
        if not self._kept:
            self._kept.extend(self.seeds())
        return self._kept

    def draw(self, rng: Rng) -> Sample:
        """A mutated file."""
        seed = one(rng, self.samples)
        others = [sample.data for sample in self.samples if sample.suffix == seed.suffix]
        data = mutated(seed.data, rng, others, self.own)
        if self.seal is not None and chance(rng, 0.8):
            data = self.seal(data)
        return Sample(seed.suffix, data)


def readers() -> dict[str, Reader]:
    """All readers by kind; where a kind has several, what it holds follows after a colon. Imported late, for speed."""
    from . import readers_arm, readers_data, readers_results, readers_shop, readers_solids

    modules = (readers_arm, readers_data, readers_results, readers_shop, readers_solids)
    return {kind: reader for module in modules for kind, reader in module.READERS.items()}


def turn(table: dict[str, Reader], seed: int, number: int) -> tuple[str, Sample]:
    """The reader and the file of input ``number``: the same for the same seed on any machine."""
    rng = np.random.default_rng([seed, number])
    names = sorted(table)
    weights = np.cumsum([1.0 / table[name].cost for name in names])
    name = names[int(np.searchsorted(weights, rng.random() * weights[-1], side="right"))]
    return name, table[name].draw(rng)
