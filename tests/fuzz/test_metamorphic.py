"""Changes of a table that must not matter, each by some engine; ``make fuzz`` tries all by all."""

from __future__ import annotations

from itertools import cycle

import pytest

from .metamorphic import CHANGES, CHECKS, ENGINES, Answer, compare, text_of

QUICK = [name for name in CHECKS if name.startswith("simulate")]
# Each change by an engine that fits something, what is no mere layout by several.
TURNS = [f"{engine}: {words}" for engine, words in zip(cycle(e for e in ENGINES if "cal" in e), CHANGES, strict=False)]
MORE = [
    name for name in CHECKS if name.endswith(("farther", "load", "repeats in two tables", "springs: labels renamed"))
]
# Of those of a diagnosis, which takes long, one here.
SLOW = {name for name in (*TURNS, *MORE) if not name.startswith("diagnose")} | {"diagnose: rows shuffled"}
SLOW = SLOW & {*CHECKS} - {*QUICK}


@pytest.mark.parametrize("name", [*QUICK, "calibrate, free springs: rows in two tables"])
def test_a_change_that_does_not_matter(name: str) -> None:
    assert CHECKS[name]() == []


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(SLOW))
def test_a_change_that_does_not_matter_at_length(name: str) -> None:
    assert CHECKS[name]() == []


def test_a_change_that_matters_is_told() -> None:
    def heavier(robot: object, rows: list[list[str]]) -> object:
        from .metamorphic import read

        k = rows[0].index("fz_N")
        return [read(robot, text_of([rows[0], *([*r[:k], repr(1.001 * float(r[k])), *r[k + 1 :]] for r in rows[1:])]))]  # type: ignore[arg-type]

    found = compare("calibrate, free springs", heavier)  # type: ignore[arg-type]
    assert any(words.startswith("j2.stiffness is") for words in found)


def test_words_and_names_count() -> None:
    from .metamorphic import _differences

    plain = Answer({"a": 1.0, "b low": 2.0}, ("none",))
    assert _differences(plain, plain, 0.0, 0.0) == []
    assert _differences(plain, Answer(plain.numbers, ("one",)), 0.0, 0.0)
    assert _differences(plain, Answer({"a": 1.0}, ("none",)), 0.0, 0.0)
    assert _differences(plain, Answer({"a": 1.0, "b low": 2.001}, ("none",)), 0.0, 1e-4)
    assert not _differences(plain, Answer({"a": 1.0, "b low": 2.001}, ("none",)), 0.0, 1e-2)
    assert len(ENGINES) == 5
