"""Bands of estimated laws: closed forms for a table whose nodes are read one by one."""

from __future__ import annotations

import numpy as np
import pytest
from plain_problems import linear

from doe.certainty.uncertainty import certainty, law_band
from doe.estimation.estimate import estimate
from doe.estimation.noise import Noise
from fem.free.parameters import FreeLaw, TableBasis

NODES = np.array([-1.0, 0.0, 1.0, 2.0])
VALUES = np.array([12.0, 13.0, 13.5])
SD = 0.1


def _q(angles: list[float]) -> np.ndarray:
    return np.column_stack([np.zeros(len(angles)), angles])


@pytest.mark.parametrize("first", [0, 1])
def test_a_table_read_node_by_node(first: int) -> None:
    # Another number goes before the law's; no reading moves with the last node.
    A = np.zeros((3 + first, 4 + first))
    A[np.arange(3 + first), np.arange(3 + first)] = 1.0
    p = linear(A, np.concatenate([np.full(first, 7.0), VALUES]))
    e = estimate(p, (1e-6, 1e-6), fixed_noise=Noise((SD, SD)), robust=False)
    band = law_band(e, certainty(e), FreeLaw("j2", TableBasis(1, NODES), first), _q([-1.0, 0.0, -0.5, 0.25, 1.0, 1.5]))
    log_k = np.array([12.0, 13.0, 12.5, 13.125, 13.5])
    sd = SD * np.array([1.0, 1.0, np.sqrt(0.5), np.hypot(0.75, 0.25), 1.0])
    np.testing.assert_allclose(band.stiffness[:5], np.exp(log_k), rtol=1e-9)
    # 1.95996: the normal distribution's quantile, for the noise was given.
    np.testing.assert_allclose(band.high[:5], np.exp(log_k + 1.959964 * sd), rtol=1e-6)
    np.testing.assert_allclose(band.low[:5], np.exp(log_k - 1.959964 * sd), rtol=1e-6)
    assert np.isnan([band.stiffness[5], band.low[5], band.high[5]]).all()


def test_nodes_seen_only_together_are_told_where_they_are_one() -> None:
    # Only the spring half way between the first two nodes is read.
    p = linear(np.array([[0.5, 0.5, 0.0, 0.0]] * 3), np.array([12.4, 12.5, 12.6]))
    e = estimate(p, (1e-6, 1e-6), fixed_noise=Noise((SD, SD)), robust=False)
    band = law_band(e, certainty(e), FreeLaw("j2", TableBasis(1, NODES), 0), _q([-0.5, -0.75]))
    assert band.stiffness[0] == pytest.approx(np.exp(12.5), rel=1e-9)
    assert band.high[0] == pytest.approx(np.exp(12.5 + 1.959964 * SD / np.sqrt(3.0)), rel=1e-6)
    assert np.isnan(band.stiffness[1])
