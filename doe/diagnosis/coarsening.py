"""Laws of one place, weighed no finer than laws are known.

Friction, stick-slip and slip of one gear all keep some of the twist on the way down; which of them follows the readings
best is a matter of a few per cent of what they explain, and no law is right to that. Their evidences grow apart with
the readings all the same. So what one law of a place lags behind the best one there is tempered by what laws are off
by, as a share of what they explain (a power posterior: Miller and Dunson 2019, doi:10.1080/01621459.2018.1469995).
Between places nothing is tempered: there it is levers that differ, and these are known.
"""

from __future__ import annotations

from collections.abc import Mapping

from doe.diagnosis.hypotheses import UNKNOWN
from fem.effects.base import Effect

# How many times the log evidence that laws may be off by halves what tells them apart: ``doubt`` squared of what they
# explain.
HALVES = 1.0


def coarsened(sets: Mapping[frozenset[str], float], known: Mapping[str, Effect]) -> dict[frozenset[str], float]:
    """Log evidences of sets of effects, those that differ in the law of one place only closer together.

    The best law of each place, beside the same others, stays as it is.
    """
    peers: dict[tuple[frozenset[str], str], list[tuple[frozenset[str], str]]] = {}
    for key in sets:
        for code in key - {UNKNOWN}:
            if known[code].place:
                peers.setdefault((key - {code}, known[code].place), []).append((key, code))
    out = dict(sets)
    for (others, _), some in peers.items():
        if len(some) < 2 or others not in sets:
            continue
        best, _ = max(some, key=lambda one: sets[one[0]])
        gain = max(sets[best] - sets[others], 0.0)
        for key, code in some:
            doubt = max(known[code].law_doubt, *(known[c].law_doubt for c in best - others))
            tempered = (sets[best] - sets[key]) / (1.0 + gain * doubt**2 / HALVES)
            # A set has several members: the closest of its peers counts.
            out[key] = max(out[key], sets[best] - tempered)
    return out
