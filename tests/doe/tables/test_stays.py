"""Stays at a pose: load cycles one right after the other at one pose, by the clock of a table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from doe.estimation.problem import problem
from doe.tables.loaded import history_of
from doe.tables.measurements import Measurements
from fem import build_model
from robots import load_description

MODEL = build_model(load_description("kr60-3"), "rigid")
# Pose, repeat, load: two cycles in A, one in B, A again.
ROWS = [(p, r, load) for p, r in (("A", 1), ("A", 2), ("B", 1), ("A", 3)) for load in (100.0, 200.0)]


def table(rows: list[tuple[str, int, float]], time: np.ndarray | None = None) -> Measurements:
    n = len(rows)
    wrench, d = np.zeros((n, 6)), np.full((n, 6), np.nan)
    wrench[:, 2] = [-load for _, _, load in rows]
    d[:, 2] = [-1e-6 * load for _, _, load in rows]
    names = sorted({pose for pose, _, _ in rows})
    q = np.array([[0.1, -0.5 - 0.1 * names.index(pose), 0.9, 0.0, 0.3, 0.0] for pose, _, _ in rows])
    return Measurements(
        source="made up",
        sha256="",
        q=q,
        wrench=wrench,
        displacement=d,
        point=np.full((n, 3), np.nan),
        sigma=np.full(n, np.nan),
        pose=tuple(p for p, _, _ in rows),
        repeat=tuple(r for _, r, _ in rows),
        phase=("loading",) * n,
        step=np.full(n, np.nan),
        row_numbers=tuple(range(2, n + 2)),
        extra={},
        notes=(),
        time=np.arange(n) * 60.0 if time is None else time,
    )


def test_cycles_one_after_the_other_at_one_pose_are_one_stay() -> None:
    h = history_of(table(ROWS))
    np.testing.assert_array_equal(h.stay, [0, 0, 0, 0, 1, 1, 2, 2])
    np.testing.assert_array_equal(h.fresh, [True, True, False, False, False, False, False, False])


def test_without_a_clock_each_cycle_is_a_stay_of_its_own() -> None:
    h = history_of(table(ROWS, np.full(len(ROWS), np.nan)))
    np.testing.assert_array_equal(h.stay, h.cycle)
    assert not h.fresh.any()


def test_first_cycles_that_differ_are_no_repeats_of_the_later_ones() -> None:
    rows = [(f"P{p}", r, load) for p in range(4) for r in (1, 2, 3) for load in (100.0, 200.0)]
    data = table(rows)
    scatter = 1e-6 * np.random.default_rng(1).standard_normal(len(rows))
    first = np.array([r == 1 for _, r, _ in rows])
    d = data.displacement.copy()
    d[:, 2] += scatter
    alike = problem(MODEL, replace(data, displacement=d), ()).replicate
    assert len(np.unique(alike)) == 8
    d[:, 2] -= 3e-5 * first
    apart = problem(MODEL, replace(data, displacement=d), ()).replicate
    assert len(np.unique(apart)) == 16
    assert not set(apart[first]) & set(apart[~first])
