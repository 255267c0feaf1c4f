"""Laws of one place are weighed no finer than laws are known; levers are."""

from __future__ import annotations

import pytest

from doe.diagnosis.coarsening import coarsened
from doe.diagnosis.hypotheses import UNKNOWN
from fem import build_model
from fem.effects import Effect, catalogue
from robots import load_description

NONE: frozenset[str] = frozenset()
FRICTION, STICKING, ELSEWHERE = "friction:j2", "stick-slip:j2", "friction:j3"


@pytest.fixture(scope="module")
def known() -> dict[str, Effect]:
    description = load_description("xr701")
    return catalogue(build_model(description, "rigid"), description)


def one(code: str) -> frozenset[str]:
    return frozenset({code})


def test_laws_of_one_place_come_closer_as_they_explain_more(known: dict[str, Effect]) -> None:
    doubt = known[FRICTION].law_doubt
    assert doubt == known[STICKING].law_doubt > 0.0
    for gain in (10.0, 1000.0):
        sets = {NONE: 0.0, one(FRICTION): gain, one(STICKING): gain - 5.0, one(ELSEWHERE): gain - 5.0}
        out = coarsened(sets, known)
        assert out[one(FRICTION)] == gain
        assert gain - out[one(STICKING)] == pytest.approx(5.0 / (1.0 + doubt**2 * gain))
        assert out[one(ELSEWHERE)] == gain - 5.0  # another place has another lever


def test_beside_another_effect_they_are_judged_by_what_they_add(known: dict[str, Effect]) -> None:
    doubt = known[FRICTION].law_doubt
    with_tilt = {frozenset({code, "base-tilt"}): z for code, z in ((FRICTION, 500.0), (STICKING, 480.0))}
    out = coarsened({NONE: 0.0, one("base-tilt"): 400.0} | with_tilt, known)
    assert 500.0 - out[frozenset({STICKING, "base-tilt"})] == pytest.approx(20.0 / (1.0 + doubt**2 * 100.0))


def test_what_explains_nothing_and_what_is_unknown_stay_as_they_are(known: dict[str, Effect]) -> None:
    sets = {NONE: 0.0, one(FRICTION): -2.0, one(STICKING): -3.0, one(UNKNOWN): 1.0}
    assert coarsened(sets, known) == sets
