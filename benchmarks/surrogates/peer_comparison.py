"""Our surrogates and ready-made regressors on the same runs: error, time, size, and what their error bars are worth."""

from __future__ import annotations

import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from peers import PEERS, Estimator, OwnCandidate, OwnEstimator, Peer, PeerEstimator, Size, Variant

from robots.arrays import Array, Bools, Integers
from robots.errors import InputError

Progress = Callable[[int, int, str], None]
Clock = Callable[[], float]

QUERIES = 100_000
# Share of the runs that the choice of target and inputs is judged on.
_SET_ASIDE = 0.25
# What libraries raise when a fit cannot be had; anything else is a fault of ours and must be seen.
_REFUSALS = (InputError, ValueError, FloatingPointError, np.linalg.LinAlgError, MemoryError)
_QUERY_SECONDS = 3.0
_TRIAL_ROWS = 2000


@dataclass(frozen=True)
class Errors:
    """Relative errors of compliance, ``|predicted / true - 1|``, and the share of poses inside the 95 % bar."""

    n: int
    rms: float
    worst: float
    coverage: float | None = None


@dataclass(frozen=True)
class PeerResult:
    """One row of the comparison.

    Parameters
    ----------
    name, title : of the peer or own candidate
    own : whether it is ours
    chosen : target, inputs and kernel, as chosen on runs set aside; empty for ours
    n_train, n_runs : runs it was fitted on, and runs there were
    fit_s, choose_s : seconds of the last fit, and of the choice before it
    query_s, bar_query_s : seconds for 1e5 poses: values, and values with error bars (None: it has none)
    queries_timed : poses really timed; the seconds are scaled up from them
    uniform, boundary : errors on held-out poses (None: there were no such poses)
    size : bytes of its numbers
    messages : warnings of its library, and what else should be known
    refused : why there are no figures
    """

    name: str
    title: str
    own: bool
    chosen: str = ""
    n_train: int = 0
    n_runs: int = 0
    fit_s: float = 0.0
    choose_s: float = 0.0
    query_s: float = 0.0
    bar_query_s: float | None = None
    queries_timed: int = 0
    uniform: Errors | None = None
    boundary: Errors | None = None
    size: Size | None = None
    messages: tuple[str, ...] = ()
    refused: str | None = None


@dataclass(frozen=True)
class _Runs:
    Q: Array
    y: Array
    Q_test: Array
    y_test: Array
    boundary: Bools
    # The runs in random order: what is capped or set aside must fill the space, however the runs were sorted.
    order: Integers
    clock: Clock


def compare_with_peers(
    Q: Array,
    y: Array,
    Q_test: Array,
    y_test: Array,
    *,
    boundary: Bools | None = None,
    own: Mapping[str, OwnCandidate] | None = None,
    peers: Sequence[str] | None = None,
    most_runs: Mapping[str, int] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    clock: Clock = time.perf_counter,
) -> list[PeerResult]:
    """Fit everything on the same runs and judge it on the same held-out poses; ours first, then the peers' order.

    A peer's target (compliance or its logarithm), inputs (angles or their cosines and sines) and kernel are chosen by
    the RMS error on a quarter of the runs, then it is fitted anew; held-out poses have no part in it.

    Parameters
    ----------
    Q, y : (n, k) rad and (n,) m/N, runs to fit
    Q_test, y_test : (p, k), (p,) held-out runs
    boundary : (p,) which of these lie on the boundary; they are judged apart. None: none does
    own : name -> candidate of ours
    peers : names out of :data:`peers.PEERS`; None: all, those without their package as refused rows
    most_runs : other limits than the peers' own on the runs they are fitted on
    seed : order in which runs are capped and set aside
    progress : called with rows done, rows in all, and the name of the row that comes next (empty at the end)
    clock : what seconds are read from; on one thread of a busy machine ``time.process_time`` says more

    Raises
    ------
    ValueError
        Poses that are held out and fitted at once.
    """
    seen = {row.tobytes() for row in Q + 0.0}
    if any(row.tobytes() in seen for row in Q_test + 0.0):
        raise ValueError("held-out poses were fitted too; draw them apart from the fitted ones")
    flags = np.zeros(len(y_test), dtype=np.bool_) if boundary is None else boundary
    runs = _Runs(Q, y, Q_test, y_test, flags, np.random.default_rng(seed).permutation(len(y)), clock)
    limits = dict(most_runs or {})
    jobs: list[tuple[str, Callable[[], PeerResult]]] = [
        (name, partial(_own_row, name, c, runs)) for name, c in (own or {}).items()
    ]
    jobs += [
        (name, partial(_peer_row, name, runs, limits.get(name, PEERS[name].most_runs)))
        for name in (PEERS if peers is None else peers)
    ]
    out = []
    for done, (name, job) in enumerate(jobs):
        if progress is not None:
            progress(done, len(jobs), name)
        out.append(job())
    if progress is not None:
        progress(len(jobs), len(jobs), "")
    return out


def errors_of(predicted: Array, y: Array, interval: tuple[Array, Array] | None = None) -> Errors:
    """Figures of predictions (n,) against true compliances (n,), n at least 1."""
    error = np.abs(predicted / y - 1.0)
    inside = None if interval is None else float(np.mean((interval[0] <= y) & (y <= interval[1])))
    return Errors(len(y), float(np.sqrt(np.mean(error**2))), float(error.max()), inside)


def _own_row(name: str, candidate: OwnCandidate, runs: _Runs) -> PeerResult:
    estimator = OwnEstimator(candidate)
    row = _row(name, candidate.title, True, estimator, runs, None)
    if row.refused is not None:
        return row
    if candidate.fit_s is not None:
        row = replace(row, fit_s=candidate.fit_s)
    return row if candidate.n_train is None else replace(row, n_train=candidate.n_train(estimator.fitted))


def _peer_row(name: str, runs: _Runs, most: int | None) -> PeerResult:
    peer = PEERS[name]
    messages: list[str] = []
    start = runs.clock()
    try:
        variant = _choose(peer, runs, most, messages)
    except _REFUSALS as error:
        return PeerResult(name, peer.title, False, n_runs=len(runs.y), refused=_first_line(error))
    spent = runs.clock() - start
    rows = None
    if most is not None and most < len(runs.y):
        rows = runs.order[:most]
        messages.append(f"fitted on {most} of {len(runs.y)} runs: time grows with the cube of their number")
    return _row(name, peer.title, False, PeerEstimator(peer, variant), runs, rows, str(variant), spent, messages)


def _choose(peer: Peer, runs: _Runs, most: int | None, messages: list[str]) -> Variant:
    """The variant with the smallest RMS error on runs set aside."""
    if len(peer.variants) == 1:
        return peer.variants[0]
    n_aside = max(1, int(_SET_ASIDE * len(runs.order)))
    aside, rest = np.split(runs.order, [n_aside])
    limits = [m for m in (peer.runs_to_choose, most) if m is not None]
    rest = rest[: min(limits)] if limits else rest
    found: list[tuple[float, Variant]] = []
    refusals: list[str] = []
    for variant in peer.variants:
        estimator = PeerEstimator(peer, variant)
        try:
            # What a library says of a variant that is not taken is of no use to anyone.
            with _listening([]):
                estimator.fit(runs.Q[rest], runs.y[rest])
                rms = errors_of(estimator.predict(runs.Q[aside]), runs.y[aside]).rms
        except _REFUSALS as error:
            refusals.append(f"{variant} not possible: {_first_line(error)}")
            continue
        if np.isfinite(rms):
            found.append((rms, variant))
    if not found:
        raise InputError("; ".join(dict.fromkeys(refusals)) or "no variant gives finite values", code="S004")
    messages += refusals
    return min(found, key=lambda item: item[0])[1]


def _row(
    name: str,
    title: str,
    own: bool,
    estimator: Estimator,
    runs: _Runs,
    rows: Integers | None,
    chosen: str = "",
    choose_s: float = 0.0,
    messages: Sequence[str] = (),
) -> PeerResult:
    said = list(messages)
    Q, y = (runs.Q, runs.y) if rows is None else (runs.Q[rows], runs.y[rows])
    try:
        with _listening(said):
            start = runs.clock()
            estimator.fit(Q, y)
            fit_s = runs.clock() - start
            predicted, interval = estimator.predict(runs.Q_test), estimator.interval(runs.Q_test)
            query_s, timed = _query_seconds(estimator.predict, runs.Q_test, runs.clock)
            bar_query_s = None if interval is None else _query_seconds(estimator.interval, runs.Q_test, runs.clock)[0]
    except _REFUSALS as error:
        return PeerResult(name, title, own, n_runs=len(runs.y), messages=tuple(said), refused=_first_line(error))
    lost = np.count_nonzero(~np.isfinite(predicted))
    if lost:
        said.append(f"{lost} of {len(predicted)} values are not finite")
    below = np.count_nonzero(predicted <= 0.0)
    if below:
        said.append(f"{below} of {len(predicted)} compliances are zero or negative")
    parts = []
    for part in (~runs.boundary, runs.boundary):
        bar = None if interval is None else (interval[0][part], interval[1][part])
        parts.append(errors_of(predicted[part], runs.y_test[part], bar) if part.any() else None)
    return PeerResult(
        name=name,
        title=title,
        own=own,
        chosen=chosen,
        n_train=len(y),
        n_runs=len(runs.y),
        fit_s=fit_s,
        choose_s=choose_s,
        query_s=query_s,
        bar_query_s=bar_query_s,
        queries_timed=timed,
        uniform=parts[0],
        boundary=parts[1],
        size=estimator.size(),
        messages=tuple(said),
    )


def _query_seconds(query: Callable[[Array], object], Q: Array, clock: Clock) -> tuple[float, int]:
    """Seconds for 1e5 poses, and how many were timed: fewer where they would take long; the median of three."""
    poses = np.resize(Q, (QUERIES, Q.shape[1]))

    def spent(n: int) -> float:
        start = clock()
        query(poses[:n])
        return clock() - start

    # The first call also warms caches and compiles; only the second counts as a guess.
    spent(_TRIAL_ROWS)
    guess = max(spent(_TRIAL_ROWS), 1e-9)
    n = int(np.clip(_TRIAL_ROWS * _QUERY_SECONDS / 3.0 / guess, _TRIAL_ROWS, QUERIES))
    return float(np.median([spent(n) for _ in range(3)])) * QUERIES / n, n


@contextmanager
def _listening(said: list[str]) -> Iterator[None]:
    """Collect warnings, each kind once with its count."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            yield
        finally:
            counts = Counter(f"{w.category.__name__}: {_first_line(w.message)}" for w in caught)
            said += [text if n == 1 else f"{text} ({n} times)" for text, n in counts.items()]


def _first_line(thing: object) -> str:
    lines = str(thing).strip().splitlines()
    return lines[0].strip().rstrip(":") if lines else type(thing).__name__
