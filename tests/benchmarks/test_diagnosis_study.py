"""A seeded part of the blind study: names found, no false alarms, strangers called strangers.

The whole study and its figures: ``benchmarks/diagnosis/diagnosis_study.py``, ``docs/validation/diagnosis_study.md``.
"""

from __future__ import annotations

import pytest
from diagnosis_cases import ABLATIONS, DETECTABLE, Row, SetSpec, family, run_set, suite
from scipy.stats import binom

SEED = 41
# Shares that the whole study reaches, less a few per cent: what a subset of this size must not fall short of.
RIGHT, ALARM, STRANGE = 0.88, 0.03, 0.85
# A count as low (or as high) as this has less than this probability if the shares hold.
RARE = 1e-3


def rows(single: int, none: int, outside: int, pairs: int) -> list[Row]:
    return [run_set(spec, seed, ABLATIONS["as it is"]) for spec, seed in suite(single, none, outside, pairs, seed=SEED)]


@pytest.mark.slow
def test_effects_are_named() -> None:
    seen = [r for r in rows(23, 0, 0, 0) if r.excess >= DETECTABLE]
    right = sum(bool(r.found) and family(r.found[0]) == family(r.effects[0]) for r in seen)
    assert len(seen) > 12
    assert binom.cdf(right, len(seen), RIGHT) > RARE, [(r.effects, r.found) for r in seen]


@pytest.mark.slow
def test_nothing_is_alarming_where_nothing_is_missing() -> None:
    alarms = sum(r.verdict != "none" for r in rows(0, 12, 0, 0))
    assert binom.sf(alarms - 1, 12, ALARM) > RARE


@pytest.mark.slow
def test_strangers_are_unknown() -> None:
    found = rows(0, 0, 12, 0)
    unknown = sum(r.verdict == "unknown" for r in found)
    assert binom.cdf(unknown, len(found), STRANGE) > RARE, [(r.effects, r.verdict, r.found) for r in found]


@pytest.mark.slow
def test_one_of_two_is_found_and_the_gap_shrinks() -> None:
    for r in rows(0, 0, 0, 4):
        assert {*map(family, r.found)} & {*map(family, r.effects)}, (r.effects, r.found)


@pytest.mark.slow
def test_a_large_effect_is_named_and_the_gap_shrinks() -> None:
    r = run_set(SetSpec(robot="kr60-3", effects=("payload",), poses=15, repeats=2), 4, ABLATIONS["as it is"])
    assert r.verdict == "named"
    assert r.found == ("payload",)
    # The study's aim for the median set: a fifth.
    assert r.after < 0.4 * r.before
