import builtins
import warnings

import numpy as np
import oracles
import peer_comparison
import peers
import pytest
from peer_comparison import PeerResult, compare_with_peers, errors_of
from peers import PEERS, OwnCandidate, Peer, PeerEstimator, Size, Variant

LOWER, UPPER = np.radians([-35.0, 40.0]), np.radians([45.0, 115.0])
PLAIN = Variant("compliance", "angles")


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    """Few poses are timed: seconds are judged by nobody here."""
    monkeypatch.setattr(peer_comparison, "QUERIES", 4000)


def poses(n, seed, k=2):
    return np.random.default_rng(seed).uniform(np.resize(LOWER, k), np.resize(UPPER, k), (n, k))


def arm(Q):
    """Compliance of a planar arm under a vertical load, m/N: squares of sums of cosines."""
    return 2e-7 + 1e-6 * np.cos(Q[:, 0]) ** 2 + 8e-7 * np.cos(Q.sum(axis=1)) ** 2


def sextic(Q):
    """Of total degree 6 in the angles."""
    return 1e-6 * (4.0 + Q[:, 0] ** 4 * Q[:, 1] ** 2 - 0.05 * Q[:, 1] ** 5 + Q[:, 0])


def compared(*names, n=120, f=arm, **options):
    Q, Q_test = poses(n, 1), poses(200, 2)
    return compare_with_peers(Q, f(Q), Q_test, f(Q_test), peers=names, **options)


def estimator(name, variant=PLAIN, f=arm, n=120):
    out = PeerEstimator(PEERS[name], variant)
    Q = poses(n, 1)
    with warnings.catch_warnings():
        # Of lengths and noise at their bounds.
        warnings.simplefilter("ignore")
        out.fit(Q, f(Q))
    return out


def test_polynomial_pipeline_is_exact_on_a_sextic():
    (row,) = compared("polynomial", f=sextic)
    assert row.chosen == "compliance, angles"
    # 1e-8: round-off times the condition of monomials in -1..1 (about 1e4 here), with room.
    assert row.uniform.worst < 1e-8


def test_over_a_full_turn_cosines_hold_an_arm_that_no_sextic_in_angles_does():
    Q, Q_test = (np.random.default_rng(i).uniform(-np.pi, np.pi, (300, 2)) for i in (1, 2))
    sextic_in_angles, ridge = compare_with_peers(Q, arm(Q), Q_test, arm(Q_test), peers=["polynomial", "ridge"])
    assert sextic_in_angles.uniform.worst > 0.1
    assert ridge.chosen == "compliance, cos-sin"
    # The arm is of degree 4 in cosines and sines. Ridge weights of 1e-10 and more keep it from round-off.
    assert ridge.uniform.worst < 1e-6


def test_ridge_takes_the_degree_that_two_runs_a_term_allow():
    def degree(n_runs, features="cos-sin"):
        return PEERS["ridge"].build(Variant("compliance", features), 4, n_runs).degree

    # 8 cosines and sines: 495 terms of degree 4, 1287 of degree 5, 3003 of degree 6.
    assert [degree(n) for n in (989, 990, 2573, 2574, 6006)] == [3, 4, 4, 5, 6]
    assert degree(10, "angles") == 6


@pytest.mark.parametrize("kernel", ["rbf", "matern-5/2"])
def test_gaussian_process_interpolates_and_equals_its_equations(kernel):
    fitted = estimator("gaussian-process", Variant("compliance", "angles", kernel))
    model = fitted._regressor.model
    Q, new = poses(120, 1), poses(20, 3)
    noise = np.exp(model.kernel_.theta[-1])
    # Four standard deviations of the noise it found: it passes each run as closely as it believes in it.
    np.testing.assert_allclose(fitted.predict(Q), arm(Q), atol=4.0 * np.sqrt(noise) * fitted._deviation)
    variance, *lengths = np.exp(model.kernel_.theta[:-1])
    X, x = fitted._scaled(Q), fitted._scaled(new)

    def covariance(a, b):
        d = np.sqrt((((a[:, None] - b[None]) / lengths) ** 2).sum(axis=2))
        s = np.sqrt(5.0) * d
        return variance * (np.exp(-0.5 * d**2) if kernel == "rbf" else (1.0 + s + s**2 / 3.0) * np.exp(-s))

    # 1e-10: scikit-learn's own jitter (alpha).
    K = covariance(X, X) + (noise + 1e-10) * np.eye(len(X))
    k = covariance(x, X)
    value = k @ np.linalg.solve(K, target_of(fitted, arm(Q)))
    deviation = np.sqrt(variance + noise - np.einsum("ij,ji->i", k, np.linalg.solve(K, k.T)))
    low, high = (fitted._compliance(value + sign * 1.959963984540054 * deviation) for sign in (-1.0, 1.0))
    # K's condition is variance over noise, up to 1e11: four digits are left of the bars, more of the values.
    np.testing.assert_allclose(fitted.predict(new), fitted._compliance(value), rtol=1e-6)
    np.testing.assert_allclose(fitted.interval(new), (low, high), rtol=1e-5)


def test_kriging_interpolates_and_equals_the_gaussian_process_of_its_lengths():
    oracles.load("smt")
    fitted = estimator("kriging", n=60)
    Q = poses(60, 1)
    np.testing.assert_allclose(fitted.predict(Q), arm(Q), rtol=1e-6)
    # By hand: ordinary kriging with SMT's correlation exp(-theta d^2) of standardised inputs.
    model = fitted._regressor.model
    x, theta = model.X_norma, model.optimal_theta
    new = poses(20, 3)
    at = (fitted._scaled(new) - model.X_offset) / model.X_scale

    def correlation(a, b):
        return np.exp(-(((a[:, None] - b[None]) ** 2) @ theta))

    R = correlation(x, x) + 100 * np.finfo(float).eps * np.eye(len(x))
    z = (target_of(fitted, arm(Q)) - model.y_mean) / model.y_std
    weights = np.linalg.solve(R, np.column_stack([z, np.ones(len(z))]))
    trend = weights[:, 0].sum() / weights[:, 1].sum()
    value = trend + correlation(at, x) @ (weights[:, 0] - trend * weights[:, 1])
    by_hand = fitted._compliance(model.y_mean + model.y_std * value)
    # R is ill-conditioned (smooth correlation, close points): 1e-14 of jitter is seen.
    np.testing.assert_allclose(fitted.predict(new), by_hand, rtol=1e-6)
    r = correlation(x, at)
    left = 1.0 - r.T @ weights[:, 1]
    share = 1.0 - np.einsum("ij,ij->j", r, np.linalg.solve(R, r)) + left**2 / weights[:, 1].sum()
    deviation = np.sqrt(model.optimal_par["sigma2"] * share) * fitted._deviation
    low, high = fitted.interval(new)
    # The share is what is left of 1 after cancelling nearly all of it.
    np.testing.assert_allclose(high - low, 2.0 * 1.959963984540054 * deviation, rtol=0.05)


def target_of(fitted, y):
    return (y - fitted._mean) / fitted._deviation


@pytest.mark.parametrize("name", [name for name in PEERS if name != "network"])
def test_figures_are_those_worked_out_by_hand(name):
    if name == "kriging":
        oracles.load("smt")
    Q, Q_test = poses(90, 1), poses(150, 2)
    boundary = np.arange(150) % 3 == 0
    (row,) = compare_with_peers(
        Q, arm(Q), Q_test, arm(Q_test), boundary=boundary, peers=[name], most_runs={"gaussian-process": 60}
    )
    assert row.refused is None
    parts = [p.strip() for p in row.chosen.split(",")]
    again = PeerEstimator(PEERS[name], Variant(*parts))
    rows = np.random.default_rng(0).permutation(90)[: row.n_train] if row.n_train < 90 else np.arange(90)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        again.fit(Q[rows], arm(Q[rows]))
        predicted, interval = again.predict(Q_test), again.interval(Q_test)
    for part, figures in ((~boundary, row.uniform), (boundary, row.boundary)):
        ratio = predicted[part] / arm(Q_test[part])
        assert figures.n == part.sum()
        assert figures.rms == pytest.approx(np.sqrt(np.mean((ratio - 1.0) ** 2)), rel=1e-9)
        assert figures.worst == pytest.approx(max(ratio.max() - 1.0, 1.0 - ratio.min()), rel=1e-9)
        if name in ("gaussian-process", "kriging"):
            inside = [a <= c <= b for a, b, c in zip(*interval, arm(Q_test), strict=True)]
            assert figures.coverage == np.array(inside)[part].mean()
            assert row.bar_query_s > 0.0
            assert row.size.bars > 0
        else:
            assert figures.coverage is None
            assert row.bar_query_s is None
            assert row.size.bars is None
    assert (row.n_train, row.n_runs) == (60 if name == "gaussian-process" else 90, 90)
    assert row.fit_s > 0.0
    assert row.query_s > 0.0


def test_sizes_are_counted():
    scaling = 8 * (2 * 2 + 2)
    # 28 terms of degree 6 in two angles, with an intercept; two exponents each.
    assert estimator("polynomial").size() == Size(8 * 29 + 28 * 2 + scaling)
    gp = estimator("gaussian-process", n=50).size()
    # Fitted runs, a weight each, and variance, two lengths, noise; the factor of the covariance for the bars.
    assert gp == Size(8 * (50 * 2 + 50 + 4) + scaling, 8 * 50 * 51 // 2)
    trees = estimator("boosting")
    nodes = sum(len(tree.nodes) for (tree,) in trees._regressor.model._predictors)
    assert trees.size() == Size(8 + 17 * nodes + scaling)


@pytest.mark.slow
def test_network_learns_an_arm():
    (row,) = compared("network", n=300)
    # A percent: it is no worse than what is published of such networks on smooth functions of two inputs.
    assert row.uniform.rms < 1e-2
    assert row.size == Size(
        8 * ((2 if "angles" in row.chosen else 4) * 64 + 64 + 64 * 64 + 64 + 64 + 1 + scaling_of(row))
    )


def scaling_of(row):
    return 2 * (2 if "angles" in row.chosen else 4) + 2


class Honest:
    """Knows the mean and the standard deviation of its target, and no more."""

    def fit(self, X, z):
        pass

    def predict(self, X):
        return np.zeros(len(X))

    def deviation(self, X):
        return np.ones(len(X))

    def size(self):
        return Size(0, 0)


@pytest.mark.parametrize("target", ["compliance", "log-compliance"])
def test_bars_of_an_honest_regressor_hold_95_percent(target):
    noise = 0.05 * np.random.default_rng(5).standard_normal((2, 20_000))
    y, y_test = 1e-6 * (np.exp(noise) if target == "log-compliance" else 1.0 + noise)
    peer = PeerEstimator(Peer("honest", lambda variant, k, n: Honest(), ()), Variant(target, "angles"))
    Q = poses(20_000, 1)
    peer.fit(Q, y)
    # 0.0015 is one standard deviation of the share over 2e4 draws; three of them, and 0.0016 for mean and deviation.
    assert errors_of(peer.predict(Q), y_test, peer.interval(Q)).coverage == pytest.approx(0.95, abs=0.006)


@pytest.mark.slow
def test_capped_runs_are_said_and_are_drawn_at_random():
    Q = poses(90, 1)
    Q = Q[np.argsort(Q[:, 0])]
    Q_test = poses(100, 2)
    (row,) = compare_with_peers(
        Q, arm(Q), Q_test, arm(Q_test), peers=["gaussian-process"], most_runs={"gaussian-process": 40}
    )
    assert row.n_train == 40
    assert any("fitted on 40 of 90 runs" in m for m in row.messages)
    # The first 40 of sorted runs leave half of the box empty: errors of 1e-1.
    assert row.uniform.worst < 1e-2


def test_poses_are_predicted_block_by_block_without_loss():
    fitted = estimator("gaussian-process", n=30)
    Q = poses(2001, 4)
    one_by_one = np.concatenate([fitted.predict(Q[i : i + 1]) for i in (0, 999, 1000, 1999, 2000)])
    # 1e-9: sums of another order, times the condition of the covariance.
    np.testing.assert_allclose(fitted.predict(Q)[[0, 999, 1000, 1999, 2000]], one_by_one, rtol=1e-9)


def test_query_times_are_scaled_to_all_poses(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(peer_comparison, "QUERIES", 100_000)

    def query(Q, seconds_per_pose):
        clock[0] += len(Q) * seconds_per_pose

    # Slow: the fewest poses are timed. Fast: all of them.
    for each, timed in ((1e-2, 2000), (1e-6, 100_000), (2e-5, 50_000)):
        seconds, n = peer_comparison._query_seconds(lambda Q, each=each: query(Q, each), poses(10, 1), lambda: clock[0])
        assert n == pytest.approx(timed, abs=1)
        assert seconds == pytest.approx(1e5 * each)


def test_own_candidates_come_first_and_are_judged_alike():
    seen = []

    def fit(Q, y):
        seen.append(len(Q))
        return float(y.mean())

    own = {
        "mean": OwnCandidate(
            "the mean",
            fit,
            lambda mean, Q: np.full(len(Q), mean),
            lambda mean: 8,
            lambda mean, Q: (np.full(len(Q), 0.5 * mean), np.full(len(Q), 2.0 * mean)),
        )
    }
    told = []
    rows = compared("polynomial", own=own, progress=lambda *what: told.append(what))
    assert [(r.name, r.own) for r in rows] == [("mean", True), ("polynomial", False)]
    assert told == [(0, 2, "mean"), (1, 2, "polynomial"), (2, 2, "")]
    assert seen == [120]
    mean, y = arm(poses(120, 1)).mean(), arm(poses(200, 2))
    assert rows[0].uniform.worst == pytest.approx(np.abs(mean / y - 1.0).max())
    assert rows[0].uniform.coverage == np.mean((y >= 0.5 * mean) & (y <= 2.0 * mean))
    assert rows[0].size == Size(8)


def test_an_own_candidate_fitted_before_says_what_it_took():
    own = OwnCandidate(
        "mean", lambda Q, y: 1e-6, lambda m, Q: np.full(len(Q), m), lambda m: 8, None, None, 12.5, lambda m: 77
    )
    (row,) = compared(own={"mean": own})
    assert (row.fit_s, row.n_train, row.n_runs) == (12.5, 77, 120)


class Crooked:
    """A regressor that warns, and gives values that nobody can use."""

    def __init__(self, values):
        self.values = values

    def fit(self, X, z):
        warnings.warn("did not converge\nsecond line", RuntimeWarning, stacklevel=1)
        warnings.warn("did not converge\nsecond line", RuntimeWarning, stacklevel=1)

    def predict(self, X):
        return np.resize(self.values, len(X))

    def deviation(self, X):
        return None

    def size(self):
        return Size(1)


def with_peer(monkeypatch, build):
    monkeypatch.setattr(peers, "PEERS", PEERS)
    table = {"crooked": Peer("crooked", build, (PLAIN,))}
    monkeypatch.setattr(peer_comparison, "PEERS", table)


def test_warnings_and_impossible_values_are_said(monkeypatch):
    with_peer(monkeypatch, lambda variant, k, n: Crooked([0.0, np.nan, -1e9, 0.0]))
    (row,) = compared("crooked")
    assert row.messages == (
        "RuntimeWarning: did not converge (2 times)",
        "50 of 200 values are not finite",
        "50 of 200 compliances are zero or negative",
    )
    assert np.isnan(row.uniform.rms)


def test_a_peer_that_fails_is_a_row_with_its_reason(monkeypatch):
    def build(variant, k, n):
        raise np.linalg.LinAlgError("not positive definite\nmore")

    with_peer(monkeypatch, build)
    Q, Q_test = poses(30, 1), poses(20, 2)
    (row,) = compare_with_peers(Q, arm(Q), Q_test, arm(Q_test))
    assert isinstance(row, PeerResult)
    assert row.refused == "not positive definite"
    assert row.uniform is None


def test_terms_that_outnumber_the_runs_are_refused():
    (row,) = compared("polynomial", n=30)
    assert row.refused is not None
    assert "28 terms, but 23 runs" in row.refused


def test_a_missing_package_is_named(monkeypatch):
    real = builtins.__import__

    def without_smt(name, *args, **kwargs):
        if name.split(".")[0] == "smt":
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without_smt)
    monkeypatch.setattr(peer_comparison, "PEERS", {name: PEERS[name] for name in ("kriging", "polynomial")})
    Q, Q_test = poses(60, 1), poses(50, 2)
    kriging, polynomial = compare_with_peers(Q, arm(Q), Q_test, arm(Q_test))
    assert "smt is not installed" in kriging.refused
    assert polynomial.refused is None


def test_errors_of_numbers():
    figures = errors_of(np.array([1.1, 2.0, 2.4]), np.array([1.0, 2.0, 3.0]))
    assert figures.worst == pytest.approx(0.2)
    assert figures.rms == pytest.approx(np.sqrt((0.01 + 0.04) / 3))


def test_poses_that_were_fitted_are_not_held_out():
    Q = poses(30, 1)
    with pytest.raises(ValueError, match="fitted too"):
        compare_with_peers(Q, arm(Q), Q[:20], arm(Q[:20]), peers=["polynomial"])
