"""Compiled evaluation against Expansion itself: same numbers, whatever the functions, the batch and the threads."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
import oracles
import pytest
from expansion_cases import KINDS, angles, expansion, family, size

from robots.errors import InputError
from robots.threads import compiled_loops
from surrogate import fast
from surrogate.expansion import Expansion, Family

# Compiling takes its time.
pytestmark = pytest.mark.slow

oracles.load("numba")

CASES = [
    *((kind,) * k for kind in KINDS for k in (1, 2, 3)),
    ("polynomial",) * 4,
    ("harmonic", "mixed", "periodic", "gaps"),
    ("periodic", "constant", "polynomial", "mixed", "harmonic"),
    ("gaps", "harmonic", "polynomial", "periodic", "mixed", "polynomial"),
]


@pytest.fixture(autouse=True)
def _always_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fast, "FEWEST", 0)


@pytest.fixture
def _without_numba(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setitem(sys.modules, "surrogate.kernels", None)
    monkeypatch.delattr("surrogate.kernels", raising=False)
    compiled_loops.cache_clear()
    yield
    compiled_loops.cache_clear()


def check(e: Expansion, Q: np.ndarray, found: np.ndarray) -> None:
    expected = e(Q)
    assert found.shape == expected.shape == (len(Q), e.n_outputs)
    # 2e-14 of the sum of all sizes: some hundred roundings. A wrong term is off by 1e-3 and more.
    assert (np.abs(found - expected) / size(e, Q)).max() < 2e-14


@pytest.mark.parametrize("m", [1, 3, 36])
@pytest.mark.parametrize("kinds", CASES, ids="-".join)
def test_the_sum_of_squares_is_that_of_the_outputs(kinds: tuple[str, ...], m: int, rng: np.random.Generator) -> None:
    e = expansion(kinds, m, rng)
    Q = angles(e, 300, rng)
    Q[7] = np.nan
    found, y = fast.sum_of_squares(e, Q), e(Q)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(y[:, 0]))
    # As in `check`: relative to the squares of the sizes of all sums.
    kept = np.arange(len(Q)) != 7
    off = np.abs(found - np.sum(y**2, axis=1))[kept]
    assert (off <= 1e-12 * np.sum(size(e, Q[kept]) ** 2, axis=1)).all()


@pytest.mark.parametrize("m", [1, 2, 3, 36])
@pytest.mark.parametrize("kinds", CASES, ids="-".join)
def test_the_same_as_the_expansion(kinds: tuple[str, ...], m: int, rng: np.random.Generator) -> None:
    for _ in range(3):
        e = expansion(kinds, m, rng)
        Q = angles(e, 300, rng)
        check(e, Q, fast.evaluate(e, Q))


@pytest.mark.parametrize("m", [1, 5])
@pytest.mark.parametrize("n", [0, 1, 2, 255, 256, 257, 4096, 4097, 9000])
def test_any_number_of_poses_and_threads(n: int, m: int, rng: np.random.Generator) -> None:
    e = expansion(("mixed", "polynomial", "harmonic"), m, rng)
    Q = angles(e, n, rng) if n else np.empty((0, 3))
    one = fast.evaluate(e, Q, threads=1)
    assert one.shape == (n, m)
    if n:
        check(e, Q, one)
    for threads in (2, 3, None):
        np.testing.assert_array_equal(fast.evaluate(e, Q, threads), one)
    # A pose has the same digits wherever it stands.
    np.testing.assert_array_equal(fast.evaluate(e, Q[::-1][: n // 2]), one[::-1][: n // 2])


def test_angles_in_any_layout(rng: np.random.Generator) -> None:
    e = expansion(("mixed", "polynomial"), 2, rng)
    Q = angles(e, 500, rng)
    expected = fast.evaluate(e, Q)
    wide = np.zeros((1000, 5))
    wide[::2, 1:4:2] = Q
    for same in (np.asfortranarray(Q), wide[::2, 1:4:2], Q[::-1][::-1], Q.tolist()):
        np.testing.assert_array_equal(fast.evaluate(e, same), expected)
    Q.flags.writeable = False
    np.testing.assert_array_equal(fast.evaluate(e, Q), expected)
    whole = np.arange(6).reshape(3, 2)
    check(e, whole.astype(float), fast.evaluate(e, whole))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("m", [1, 4])
def test_angles_that_are_not_finite_give_nan_and_spoil_no_other_pose(
    bad: float, m: int, rng: np.random.Generator
) -> None:
    # Of the second input only the constant counts: even so an angle that is not known is not passed over.
    families = (family("mixed", rng), family("polynomial", rng))
    e = Expansion(families, np.array([[1, 0], [2, 0], [2, 1]]), np.tile([[1.0], [1.0], [0.0]], m))
    Q = angles(e, 600, rng)
    good = fast.evaluate(e, Q)
    Q[7, 0] = Q[300, 1] = bad
    found = fast.evaluate(e, Q)
    assert np.isnan(found[[7, 300]]).all()
    rest = np.setdiff1d(np.arange(600), [7, 300])
    np.testing.assert_array_equal(found[rest], good[rest])


def test_very_large_angles_go_the_exact_way(rng: np.random.Generator) -> None:
    e = expansion(("harmonic", "periodic"), 1, rng)
    Q = angles(e, 50, rng)
    Q[3, 0], Q[9, 1] = 1e9, -1e7
    np.testing.assert_array_equal(fast.evaluate(e, Q)[[3, 9]], e(Q[[3, 9]]))
    Q = Q + rng.uniform(-9e4, 9e4, Q.shape)
    # 1e-9: an angle of 1e5 rad itself is rounded by 7e-12, and harmonics multiply that.
    np.testing.assert_allclose(fast.evaluate(e, Q), e(Q), atol=1e-9 * np.abs(size(e, Q)).max())


def test_cosine_and_sine_to_the_last_digits() -> None:
    f = Family(0.0, 1.0, False, 1, (), np.eye(3))
    e = Expansion((f,), np.array([[1], [2]]), np.eye(2))
    near = np.pi * np.arange(-8, 9) / 4.0
    x = np.concatenate([near, near + 1e-9, np.linspace(-20.0, 20.0, 5001), [0.0, 1e-200, -1e-17]])
    # 5e-16: twice the rounding of numbers up to 1.
    np.testing.assert_allclose(fast.evaluate(e, x[:, None]), np.stack([np.cos(x), np.sin(x)], axis=1), atol=5e-16)


def test_half_turns_go_to_the_same_side(rng: np.random.Generator) -> None:
    """A periodic family with polynomials jumps there, so that rounding must not decide otherwise."""
    f = Family(0.0, np.pi, True, 0, (1,), np.eye(2))
    e = Expansion((f,), np.array([[1]]), np.ones((1, 1)))
    x = np.pi * np.arange(-99.0, 100.0, 2.0)
    x = np.concatenate([x, np.nextafter(x, np.inf), np.nextafter(x, -np.inf)])
    np.testing.assert_allclose(fast.evaluate(e, x[:, None]), e(x[:, None]), atol=1e-12)


def test_coefficients_that_are_all_zero(rng: np.random.Generator) -> None:
    for m in (1, 4):
        e = Expansion((family("mixed", rng),) * 2, np.array([[0, 1], [3, 2]]), np.zeros((2, m)))
        np.testing.assert_array_equal(fast.evaluate(e, angles(e, 9, rng)), np.zeros((9, m)))


def test_few_poses_go_by_numpy(monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator) -> None:
    monkeypatch.setattr(fast, "FEWEST", 1_000_000)
    monkeypatch.setattr(fast, "_run", None)
    e = expansion(("mixed", "polynomial"), 2, rng)
    Q = angles(e, 100, rng)
    np.testing.assert_array_equal(fast.evaluate(e, Q), e(Q))


def test_with_numba() -> None:
    assert fast.backend() == "numba"


@pytest.mark.usefixtures("_without_numba")
def test_without_numba(rng: np.random.Generator) -> None:
    assert fast.backend() == "numpy"
    e = expansion(("mixed", "harmonic"), 2, rng)
    Q = angles(e, 400, rng)
    Q[5, 1] = np.inf
    found = fast.evaluate(e, Q, threads=2)
    assert np.isnan(found[5]).all()
    good = np.delete(np.arange(400), 5)
    check(e, Q[good], found[good])
    assert fast.evaluate(e, np.empty((0, 2))).shape == (0, 2)


@pytest.mark.parametrize("Q", [np.zeros(2), np.zeros((3, 3)), np.zeros((1, 2, 2)), np.empty(0)])
def test_angles_of_another_shape(Q: np.ndarray, rng: np.random.Generator) -> None:
    with pytest.raises(InputError, match=r"angles.*\(n, 2\)"):
        fast.evaluate(expansion(("mixed", "harmonic"), 1, rng), Q)


def test_less_than_one_thread(rng: np.random.Generator) -> None:
    with pytest.raises(InputError, match="threads"):
        fast.evaluate(expansion(("mixed",), 1, rng), np.zeros((2, 1)), threads=0)
