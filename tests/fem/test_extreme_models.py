"""Figures that a model file may hold one by one, and that no arm can have together: bad input, no figure."""

from __future__ import annotations

import numpy as np
import pytest

from fem.law_bases import FourierBasis
from fem.model import build_model
from fem.springs import WIDEST_LOG, LawSpring
from robots import InputError, load_description


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("coefficient", [1.01 * WIDEST_LOG, -1.01 * WIDEST_LOG, 1e30, -1e30])
def test_a_law_that_runs_away_gives_no_stiffness(coefficient: float) -> None:
    q = np.zeros((2, 3))
    with pytest.raises(InputError, match="stiffness of a joint by its law"):
        LawSpring(FourierBasis(1, 0), np.array([coefficient])).compliance(q)
    assert LawSpring(FourierBasis(1, 0), np.array([14.0])).compliance(q) == pytest.approx(np.exp(-14.0), rel=1e-15)


def test_a_link_that_cannot_be_solved_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def singular(*_: object) -> None:
        raise ArithmeticError("the stiffness matrix is singular")

    monkeypatch.setattr("fem.model.condense", singular)
    with pytest.raises(
        InputError, match=r"link pedestal: the stiffness matrix is singular.*far too small"
    ):
        build_model(load_description("xr701"), "beam")
