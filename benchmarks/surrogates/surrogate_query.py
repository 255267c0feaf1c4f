"""Queries of surrogates by compiled loops, against scikit-learn's pipeline and against numpy, in one run.

    python benchmarks/surrogates/surrogate_query.py [--poses 100000] [--rounds 9] [--json] [--write]

The compliance of the kr60-3 with rigid links along -Z, over four joint angles. The ways take turns, so that a busy
machine slows all of them; the least time of each counts: seconds of the processor for what runs on one thread, seconds
by the clock for the rest. Needs numba. ``--write`` writes docs/performance/queries.md.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path

import numpy as np
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import MinMaxScaler, PolynomialFeatures
from threadpoolctl import threadpool_limits

import fem
import robots
from benchmarks.asked import asked
from surrogate import fast, kernels
from surrogate.expansion import Expansion, Family

HERE = Path(__file__).resolve().parent
PAGE = HERE.parents[1] / "docs" / "performance" / "queries.md"
TEXT = HERE / "surrogate_query_page.md"
CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
INPUTS = slice(1, 5)
DEGREE, ORDER, RUNS = 6, 2, 4_000
# Poses that the pipeline takes at once where it is called in blocks: a design matrix of 0.8 MB.
PEER_BLOCK = 500
# What runs on several threads is timed so often in a round.
AGAIN = 25
# Of a way on several threads: what it would take if each had a processor to itself.
SHARED = ", processor time shared out"
# Coefficients this much smaller than the largest are rounding.
ZERO = 1e-12

Work = Callable[[], np.ndarray]


@dataclass(frozen=True)
class Row:
    """Least seconds for one pose; how far the answers are from the group's first, relative to the largest."""

    group: str
    way: str
    each: float
    differ: float


@dataclass(frozen=True)
class Result:
    """All that the page says."""

    poses: int
    few: int
    rounds: int
    kept: int
    load: float
    rows: list[Row]


def compliance(model: fem.ArmModel, Q: np.ndarray) -> np.ndarray:
    q = np.zeros((len(Q), model.robot.dof))
    q[:, INPUTS] = Q
    return np.asarray(1.0 / fem.directional_stiffness(model, q))


def polynomial(lower: np.ndarray, upper: np.ndarray, Q: np.ndarray, y: np.ndarray) -> Expansion:
    """Least squares in Legendre polynomials of total degree 6."""
    matrix = np.diag(np.sqrt(2.0 * np.arange(DEGREE + 1) + 1.0))
    degrees = tuple(range(1, DEGREE + 1))
    families = tuple(
        Family(0.5 * (a + b), 0.5 * (b - a), False, 0, degrees, matrix) for a, b in zip(lower, upper, strict=True)
    )
    terms = np.array([t for t in product(range(DEGREE + 1), repeat=len(lower)) if sum(t) <= DEGREE])
    return fitted(families, terms, Q, y)


def trigonometric(model: fem.ArmModel, k: int) -> Expansion:
    """Least squares in all products of harmonics up to order 2, from poses over full turns."""
    families = (Family(0.0, np.pi, True, ORDER, (), np.eye(2 * ORDER + 1)),) * k
    terms = np.array(list(product(range(2 * ORDER + 1), repeat=k)))
    Q = np.random.default_rng(3).uniform(-np.pi, np.pi, (RUNS, k))
    return fitted(families, terms, Q, compliance(model, Q))


def fitted(families: tuple[Family, ...], terms: np.ndarray, Q: np.ndarray, y: np.ndarray) -> Expansion:
    empty = Expansion(families, terms, np.zeros((len(terms), 1)))
    return Expansion(families, terms, np.linalg.lstsq(empty.design(Q), y, rcond=None)[0].reshape(len(terms), -1))


def without_zeros(e: Expansion) -> Expansion:
    kept = np.abs(e.coefficients[:, 0]) > ZERO * np.abs(e.coefficients).max()
    return Expansion(e.families, e.terms[kept], e.coefficients[kept])


def in_blocks(pipeline: Pipeline, Q: np.ndarray) -> np.ndarray:
    return np.concatenate([pipeline.predict(Q[i : i + PEER_BLOCK]) for i in range(0, len(Q), PEER_BLOCK)])


def peers(pipeline: Pipeline, Q: np.ndarray) -> dict[str, Work]:
    return {
        "scikit-learn pipeline": lambda: pipeline.predict(Q),
        "scikit-learn pipeline, in blocks": lambda: in_blocks(pipeline, Q),
    }


def compiled_on(threads: int) -> str:
    return f"stiffarm, compiled, {threads} thread{'s' if threads > 1 else ''}"


def ours(e: Expansion, Q: np.ndarray) -> dict[str, Work]:
    ways: dict[str, Work] = {"stiffarm, numpy": lambda: e(Q)}
    for threads in dict.fromkeys((1, CORES)):
        ways[compiled_on(threads)] = lambda threads=threads: fast.evaluate(e, Q, threads)
    return ways


def measure(poses: int, rounds: int) -> Result:
    model = fem.build_model(robots.load_description("kr60-3"), links="rigid")
    lower, upper = model.robot.limits[INPUTS].T
    rng = np.random.default_rng(0)
    training, Q = rng.uniform(lower, upper, (RUNS, len(lower))), rng.uniform(lower, upper, (poses, len(lower)))
    few = Q[: max(1, poses // 5)]
    y = compliance(model, training)
    matrix = y[:, None] * (1.0 + np.arange(36.0) / 36.0)
    poly, poly36 = (polynomial(lower, upper, training, v) for v in (y, matrix))
    trig = trigonometric(model, len(lower))
    sparse = without_zeros(trig)
    pipe, pipe36 = (
        make_pipeline(MinMaxScaler((-1, 1)), PolynomialFeatures(DEGREE), LinearRegression()).fit(training, v)
        for v in (y, matrix)
    )
    groups = {
        f"polynomial, {poly.n_terms} terms": peers(pipe, Q) | ours(poly, Q),
        f"trigonometric, {trig.n_terms} terms": ours(trig, Q),
        f"trigonometric, {sparse.n_terms} terms": ours(sparse, Q),
        f"polynomial, 36 entries, {poly36.n_terms} terms": peers(pipe36, few) | ours(poly36, few),
    }
    assert fast.backend() == "numba"
    rows = []
    for group, ways in groups.items():
        answers = [np.asarray(work()).reshape(len(work()), -1) for work in ways.values()]
        largest = np.abs(answers[0]).max()
        differ = [float(np.abs(a - answers[0]).max() / largest) for a in answers]
        least = rounds_of(ways, rounds)
        for way, gap in zip(ways, differ, strict=True):
            names = [way, way + SHARED] if way + SHARED in least else [way]
            rows += [Row(group, name, least[name] / len(answers[0]), gap) for name in names]
    return Result(poses, len(few), rounds, sparse.n_terms, os.getloadavg()[0], rows)


def rounds_of(ways: dict[str, Work], rounds: int) -> dict[str, float]:
    """Least seconds of each way; they take turns. Of several threads by the clock, and processor time shared out."""
    least: dict[str, float] = defaultdict(lambda: np.inf)
    for _ in range(rounds):
        for way, work in ways.items():
            # Threads more often: what else runs on the machine must leave all of them alone for once.
            for _ in range(AGAIN if "threads" in way else 1):
                start, begun = time.perf_counter(), time.process_time()
                work()
                spent, clock = time.process_time() - begun, time.perf_counter() - start
                if "threads" in way:
                    least[way] = min(least[way], clock)
                    least[way + SHARED] = min(least[way + SHARED], spent / CORES)
                else:
                    least[way] = min(least[way], spent)
    return least


def seconds(r: Result, group: str, way: str) -> float:
    return next(row.each for row in r.rows if row.group == group and row.way == way)


def groups_of(r: Result) -> list[str]:
    return list(dict.fromkeys(row.group for row in r.rows))


def table(r: Result) -> str:
    """Rows of the page; the scalar trigonometric surrogates are compared with the scalar polynomial pipeline."""
    lines = [
        "| surrogate | way | million poses/s | times as fast as scikit-learn | as numpy | differs by |",
        "|---|---|---|---|---|---|",
    ]
    groups = groups_of(r)
    for row in r.rows:
        peer = seconds(r, groups[-1] if row.group == groups[-1] else groups[0], "scikit-learn pipeline")
        plain = seconds(r, row.group, "stiffarm, numpy")
        gap = f"{row.differ:.0e}" if row.differ else "-"
        lines.append(
            f"| {row.group} | {row.way} | {1e-6 / row.each:.3g} | {peer / row.each:.3g} | {plain / row.each:.3g} "
            f"| {gap} |"
        )
    return "\n".join(lines)


def page(r: Result) -> str:
    """The whole page from its text and the measurement."""
    poly, trig, sparse, _ = groups_of(r)
    one, many = compiled_on(1), compiled_on(CORES)
    shared = many + SHARED if CORES > 1 else many
    return TEXT.read_text(encoding="utf-8").format(
        command="python benchmarks/surrogates/surrogate_query.py --write",
        poses=f"{r.poses:,}".replace(",", " "),
        few=f"{r.few:,}".replace(",", " "),
        rounds=r.rounds,
        again=AGAIN,
        runs=RUNS,
        block=PEER_BLOCK,
        kept=r.kept,
        table=table(r),
        load=f"{r.load:.1f}",
        cores=CORES,
        clock=", ".join(f"{1e-6 / seconds(r, group, many):.3g}" for group in (poly, trig, sparse)),
        shared=", ".join(f"{1e-6 / seconds(r, group, shared):.3g}" for group in (poly, trig, sparse)),
        ratio_clock=f"{seconds(r, poly, 'scikit-learn pipeline') / seconds(r, poly, many):.0f}",
        ratio_shared=f"{seconds(r, poly, 'scikit-learn pipeline') / seconds(r, poly, shared):.0f}",
        ratio_one=f"{seconds(r, poly, 'scikit-learn pipeline') / seconds(r, poly, one):.0f}",
        ratio_block=f"{seconds(r, poly, 'scikit-learn pipeline, in blocks') / seconds(r, poly, one):.0f}",
        kernel_block=kernels.BLOCK,
        many=fast.MANY,
        fewest=f"{fast.FEWEST:,}".replace(",", " "),
    )


def main() -> None:
    a = asked(__doc__, poses=100000, rounds=9, json=False, write=False)
    with threadpool_limits(1):
        result = measure(a.poses, a.rounds)
    if a.write:
        PAGE.write_text(page(result), encoding="utf-8")
    if a.json:
        json.dump(asdict(result), sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        sys.stdout.write(page(result))


if __name__ == "__main__":
    main()
