"""Covariances in blocks against the whole matrix."""

from __future__ import annotations

import numpy as np
import pytest

from doe.estimation.blocks import Alike, Blocks

# Blocks of 1, 2, 3 and 6 readings, in no order.
POSE = np.array([3, 0, 3, 1, 3, 2, 1, 3, 2, 3, 2, 3])


@pytest.fixture
def blocks() -> Blocks:
    return Blocks.of(POSE)


def _noise(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(0.1, 3.0, len(POSE)), rng.normal(size=(len(POSE), 2)) * [1.0, 4.0]


def _whole(blocks: Blocks, variance: np.ndarray, common: np.ndarray) -> np.ndarray:
    return np.asarray(np.diag(variance) + (common @ common.T) * (blocks.number[:, None] == blocks.number))


@pytest.mark.parametrize("which", ["both", "first", "second", "none"])
def test_inverse_root_and_determinant_are_those_of_the_whole_matrix(blocks: Blocks, which: str) -> None:
    variance, common = _noise(1)
    common = common * {"both": [1.0, 1.0], "first": [1.0, 0.0], "second": [0.0, 1.0], "none": [0.0, 0.0]}[which]
    V = _whole(blocks, variance, common)
    of = blocks.covariance(variance, common)
    x = np.random.default_rng(2).normal(size=(len(POSE), 3))
    # Rounding times the condition number, some 1e3.
    np.testing.assert_allclose(of.solve(x), np.linalg.solve(V, x), rtol=1e-10, atol=1e-12)
    assert of.log_det == pytest.approx(np.linalg.slogdet(V)[1], rel=1e-12)
    np.testing.assert_allclose(of.inverse_diagonal, np.diag(np.linalg.inv(V)), rtol=1e-10)
    white = of.whiten(x)
    np.testing.assert_allclose(white.T @ white, x.T @ np.linalg.solve(V, x), rtol=1e-10, atol=1e-12)


def test_blocks_are_poses_and_components(blocks: Blocks) -> None:
    assert len(blocks) == 4
    assert blocks.most == 6
    x = np.random.default_rng(3).normal(size=(len(POSE), 2, 5))
    sums = blocks.add(x)
    for k in range(4):
        (number,) = set(blocks.number[k == POSE])
        np.testing.assert_allclose(sums[number], x[k == POSE].sum(axis=0), rtol=1e-14, atol=1e-14)


def test_a_common_part_far_above_the_white_one_loses_little(blocks: Blocks) -> None:
    variance, common = _noise(4)
    common = 100.0 * common
    V = _whole(blocks, variance, common)
    x = blocks.covariance(variance, common).solve(V)
    # Both columns at some 100 standard deviations: the 2 x 2 determinant of a single reading keeps eight digits or so.
    np.testing.assert_allclose(x, np.eye(len(POSE)), atol=1e-6)


@pytest.mark.parametrize("shared", [True, False])
def test_means_of_readings_that_are_alike_tell_all_of_columns_that_are_so(blocks: Blocks, shared: bool) -> None:
    """``X^T V^-1 y`` by the means, and ``P^T V^-1 P`` by their covariance, for columns X = P rows."""
    variance, common = _noise(5)
    alike = Alike.of(np.array([0, 1, 0, 0, 1, 2, 0, 1, 2, 0, 1, 1]), blocks)
    P = (alike.groups.number[:, None] == np.arange(len(alike.groups))).astype(float)
    assert 4 < P.shape[1] < len(POSE)
    common = common[alike.groups.first][alike.groups.number] if shared else np.zeros_like(common)
    of = blocks.covariance(variance, common)
    means = of.of_means(alike)
    assert means is not None
    assert of.of_means(alike) is means
    inverse = np.linalg.inv(_whole(blocks, variance, common))
    rng = np.random.default_rng(6)
    rows, y = rng.normal(size=(P.shape[1], 2)), rng.normal(size=(len(POSE), 3))
    # Rounding times the condition number, some 1e3.
    np.testing.assert_allclose(
        means.whiten(rows).T @ means.whiten(alike.mean(y, variance)), (P @ rows).T @ inverse @ y, rtol=1e-10, atol=1e-12
    )
    np.testing.assert_allclose(means.solve(np.eye(P.shape[1])), P.T @ inverse @ P, rtol=1e-10, atol=1e-12)
    np.testing.assert_array_equal(alike.once(P @ rows), rows)
    assert alike.once(y) is None


def test_readings_with_other_common_parts_have_no_means_of_their_own(blocks: Blocks) -> None:
    variance, common = _noise(7)
    alike = Alike.of(np.zeros(len(POSE), dtype=np.int64), blocks)
    assert blocks.covariance(variance, common).of_means(alike) is None
