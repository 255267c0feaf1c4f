"""What goes into portable surrogates: parts that fit together, texts that stay where they belong, the reference."""

from __future__ import annotations

import re

import numpy as np
import pytest
from expansion_cases import expansion
from portable_cases import HOSTILE, portable, reference
from refusals import refuses

from surrogate.expansion import Expansion, Family
from surrogate.model import Factor
from surrogate.portable import Portable
from surrogate.portable.words import comment, identifier, string, with_unit
from surrogate.scope import Couplings


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("xr701", "xr701"),
        ("KR 60-3 / k_fs", "KR_60_3_k_fs"),
        ("7axis", "surrogate_7axis"),
        ("__x__", "x"),
        ("", "surrogate"),
        ("*/", "surrogate"),
        ("é", "e"),
        ("a" * 100, "a" * 40),
    ],
)
def test_identifiers(text: str, name: str) -> None:
    assert identifier(text) == name


def test_names_with_units() -> None:
    assert with_unit("compliance", "m/N") == "compliance_m_per_N"
    assert with_unit("k_fs", "N/mm") == "k_fs_N_per_mm"
    assert with_unit("share", "") == "share"
    assert with_unit("worst */ direction", "µm / N") == "worst_direction_um_per_N"


@pytest.mark.parametrize("text", HOSTILE)
def test_comments_and_strings_hold_no_way_out(text: str) -> None:
    for line in [*comment(text), string(text)[1:-1]]:
        assert re.fullmatch(r"[ -~]*", line)
        assert not re.search(r"\\|\?\?", line)
    assert not re.search(r"\*/|/\*", "".join(comment(text)))
    assert '"' not in string(text)[1:-1]


def law(k: int, m: int) -> Expansion:
    return expansion(("mixed",) * k, m, np.random.default_rng(1))


def factor(*group: int, laws: tuple[Expansion, ...] = ()) -> Factor:
    return Factor(np.array(group), laws)


def some(**changes: object) -> Portable:
    return portable("identity", ("mixed", "polynomial"), 2, np.random.default_rng(0), **changes)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"link": "square"}, "link"),
        ({"link": "factor"}, "factor"),
        ({"inputs": ("a",)}, "inputs"),
        ({"inputs": ("a", "a")}, "coordinates"),
        ({"lower": [0.0]}, "domain"),
        ({"lower": [9.0, 9.0], "upper": [1.0, 1.0]}, "domain"),
        ({"upper": [np.nan, 1.0]}, "domain"),
        ({"couplings": Couplings.none(3)}, "couplings"),
        ({"errors": {"rms": np.nan}}, "errors"),
        ({"fixed_deg": {"q1_deg": np.inf}}, "fixed_deg"),
        ({"factor": factor(-1, -1)}, "factor"),
        ({"link": "squares"}, "factor"),
        ({"link": "squares", "factor": factor(-1)}, "numbers of a factor"),
        ({"link": "factor", "factor": factor(-1, -1)}, "numbers of a factor"),
        ({"link": "squares", "factor": factor(0, 0, laws=(law(1, 1),))}, "functions of the 2 inputs"),
    ],
)
def test_parts_that_do_not_fit(changes: dict[str, object], word: str) -> None:
    refuses("F007 S001", word, some, **changes)


def test_reference_itself() -> None:
    f = Family(0.0, 1.0, False, 0, (1,), np.eye(2))
    e = Expansion((f, f), np.array([[0, 1], [1, 0]]), np.array([[2.0], [3.0]]))
    sums = Couplings(("sum",), [[1.0, 1.0]], [-1.0], [1.0])
    p = some(expansion=e, lower=[-1.0, -1.0], upper=[1.0, 2.0], couplings=sums, link="exp")
    Q = np.array([[0.5, 0.25], [1.5, -1.0], [0.9, 1.9], [np.nan, 0.0], [1.0 + 5e-10, 0.0]])
    values, status = reference(p, Q)
    assert status.tolist() == [0, 1, 2, 3, 0]
    np.testing.assert_allclose(values[[0, 4], 0], np.exp([2.0, 3.0]), rtol=1e-8)
    assert np.isnan(values[[1, 2, 3]]).all()
    steep = Expansion((f, f), e.terms, 1e3 * e.coefficients)
    p = some(expansion=steep, lower=-np.ones(2), upper=np.ones(2), couplings=Couplings.none(2), link="exp")
    values, status = reference(p, np.array([[0.9, 0.9], [-0.9, -0.9]]))
    assert status.tolist() == [3, 0]  # exp(4500) is no number, exp(-4500) is 0
    assert np.isnan(values[0, 0])
    assert values[1, 0] == 0.0


def test_reference_of_weighted_rows() -> None:
    f = Family(0.0, 1.0, False, 0, (1,), np.eye(2))
    rows = np.arange(12.0).reshape(1, 12)
    e = Expansion((f,), np.array([[1]]), rows)
    law = Expansion((f,), np.array([[0], [1]]), np.array([[np.log(2.0)], [1.0]]))
    changes = {"inputs": ("q",), "lower": [-1.0], "upper": [1.0], "couplings": Couplings.none(1)}
    changes |= {"expansion": e}
    x, w = 0.5, 2.0 * np.exp(0.5)
    C, _ = reference(some(link="factor", factor=factor(-1, 0, laws=(law,)), **changes), np.array([[x]]))
    a, b = x * rows.reshape(2, 6)
    np.testing.assert_allclose(C[0], np.outer(a, a) + w * np.outer(b, b), rtol=1e-14)
    y, _ = reference(some(link="squares", factor=factor(0, *(-1,) * 11, laws=(law,)), **changes), np.array([[x]]))
    weights = np.r_[w, np.ones(11)]
    np.testing.assert_allclose(y, [[np.sum(weights * (x * rows[0]) ** 2)]], rtol=1e-14)
