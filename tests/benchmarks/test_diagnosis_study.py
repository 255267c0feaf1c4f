"""Single sets of the blind study: what is large is named, and nothing is named where nothing is missing.

How often either holds is a matter of many sets: ``benchmarks/diagnosis/diagnosis_study.py``,
``docs/validation/diagnosis_study.md``.
"""

from __future__ import annotations

import pytest
from diagnosis_cases import ABLATIONS, Row, SetSpec, run_set


def row(effects: tuple[str, ...]) -> Row:
    return run_set(SetSpec(robot="kr60-3", effects=effects, poses=15, repeats=1), 4, ABLATIONS["as it is"])


@pytest.mark.slow
def test_nothing_is_alarming_where_nothing_is_missing() -> None:
    r = row(())
    assert (r.verdict, r.found) == ("none", ())


@pytest.mark.slow
def test_a_large_effect_is_named_and_the_gap_shrinks() -> None:
    r = row(("payload",))
    assert r.verdict == "named"
    assert r.found == ("payload",)
    # The study's aim for the median set: a fifth.
    assert r.after < 0.4 * r.before
