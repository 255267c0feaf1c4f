"""Strict scores: what is right, what is a wrong name, and what the table makes of it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.diagnosis.study.scores import Row, by_family, by_tag, reliability, scores, shrinkage

HIDDEN = Row(
    "s",
    "single",
    ("backlash:j2",),
    excess=200.0,
    tags={"reads": "z"},
    verdict="named",
    named=("backlash:j2",),
    found=("backlash:j2",),
    probability=0.97,
    set95=("backlash:j2",),
    before_mm=0.2,
    after_mm=0.02,
)
NOTHING = Row("n", "none", (), verdict="none", set95=("none",))
STRANGE = Row("o", "outside", ("other:sag:base",), ("clock",), ("base",), excess=90.0, verdict="unknown")


def counts(rows: list[Row]) -> dict[str, tuple[int, int]]:
    return {s.name: (s.share.count, s.share.of) for s in scores(rows)}


@pytest.mark.parametrize(
    ("change", "right", "exact", "named_right", "wrong"),
    [
        ({}, True, True, True, ()),
        ({"named": (), "verdict": "ambiguous"}, True, True, False, ()),
        # Tried on the way to "unknown": no answer, whatever it was.
        ({"named": (), "verdict": "unknown"}, False, False, False, ()),
        ({"named": (), "found": (), "verdict": "none"}, False, False, False, ()),
        ({"named": ("backlash:j3",), "found": ("backlash:j3",)}, True, False, True, ()),
        ({"named": ("friction:j2",), "found": ("friction:j2",)}, False, False, False, ("friction:j2",)),
        ({"named": ("backlash:j2", "payload"), "found": ("backlash:j2", "payload")}, True, True, False, ("payload",)),
        ({"named": (), "found": (), "verdict": "refused"}, False, False, False, ()),
    ],
)
def test_what_counts_as_right(
    change: dict[str, object], right: bool, exact: bool, named_right: bool, wrong: tuple[str, ...]
) -> None:
    r = replace(HIDDEN, **change)
    assert (r.is_right, r.is_exact, r.is_named_right, r.wrong_names) == (right, exact, named_right, wrong)


def test_the_table_counts_every_set_once() -> None:
    false_alarm = replace(NOTHING, verdict="named", named=("drift",), found=("drift",))
    dim = replace(HIDDEN, excess=10.0, verdict="none", named=(), found=())
    placed = replace(STRANGE, learned=(("clock", "base"),))
    rows = [HIDDEN, dim, NOTHING, false_alarm, STRANGE, placed, replace(STRANGE, verdict="named", named=("drift",))]
    got = counts(rows)
    assert got["right family leads, detectable"] == (1, 1)
    assert got["a wrong name, all sets"] == (2, 7)
    assert got['nothing hidden: anything but "none"'] == (1, 2)
    assert got["more effects named than there are, all sets"] == (1, 7)
    assert got["not detectable: none, ambiguous or rightly named"] == (1, 1)
    assert got["outside: unknown or learned"] == (2, 3)
    assert got["outside: the same with the right axis and place"] == (1, 3)
    assert shrinkage(rows)["single"] == (pytest.approx(0.1), 1)


def test_pairs_need_each_of_them_to_show() -> None:
    pair = Row(
        "p",
        "pair",
        ("payload", "friction:j2"),
        excess=500.0,
        each=(60.0, 300.0),
        verdict="ambiguous",
        found=("friction:j2", "payload"),
    )
    weak = replace(pair, each=(3.0, 300.0))
    half = replace(pair, found=("friction:j3",))
    got = counts([pair, weak, half, replace(pair, verdict="unknown")])
    assert got["pairs: one right"] == (2, 3)
    assert got["pairs: both right"] == (1, 3)


def test_stated_probabilities_are_put_beside_shares_right() -> None:
    wrong = replace(HIDDEN, named=("payload",), found=("payload",))
    (one,) = reliability([HIDDEN] * 3 + [wrong])
    assert (one.low, one.high, one.right.count, one.right.of) == (0.95, 0.99, 3, 4)
    assert one.stated == pytest.approx(0.97)
    assert one.holds
    (many,) = reliability([HIDDEN] * 30 + [wrong] * 30)
    assert not many.holds


def test_groups() -> None:
    other = replace(HIDDEN, hidden=("payload",), tags={"reads": "xyz", "loads_N": [1.0, 2.0], "day": None})
    assert [line[0] for line in by_family([HIDDEN, other])] == ["backlash", "payload"]
    assert [(tag, value) for tag, value, *_ in by_tag([HIDDEN, other])] == [("reads", "xyz"), ("reads", "z")]
