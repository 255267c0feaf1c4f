"""Load cycles from a table's phases and steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from doe import Measurements
from doe.tables.loaded import history_of

NAN = float("nan")
Row = tuple[str, int | None, float, str | None, float]


def table(*rows: Row) -> Measurements:
    """Rows of pose, repeat, fz in N, phase, step."""
    n = len(rows)
    wrench = np.zeros((n, 6))
    wrench[:, 2] = [r[2] for r in rows]
    return Measurements(
        "t.csv",
        "",
        np.zeros((n, 2)),
        wrench,
        np.zeros((n, 6)),
        np.full((n, 3), NAN),
        np.full(n, NAN),
        tuple(r[0] for r in rows),
        tuple(r[1] for r in rows),
        tuple(r[3] for r in rows),
        np.array([r[4] for r in rows]),
        tuple(range(2, n + 2)),
        {},
        (),
    )


def test_phases_order_a_cycle_by_its_loads() -> None:
    h = history_of(
        table(
            ("A", 1, -300.0, "unloading", NAN),
            ("A", 1, -600.0, "loading", NAN),
            ("A", 1, -300.0, "loading", NAN),
            ("A", 1, -600.0, "unloading", NAN),
            ("B", 1, -300.0, "loading", NAN),
        )
    )
    assert h.is_known
    np.testing.assert_array_equal(h.cycle, [0, 0, 0, 0, 1])
    np.testing.assert_array_equal(h.order, [3, 1, 0, 2, 0])
    assert np.isnan(h.clock).all()


def test_a_repeat_starts_unloaded_and_the_play_is_that_of_its_cycle() -> None:
    rows: list[Row] = []
    for repeat, top in ((1, 6.0), (2, 4.0)):
        rows += [("A", repeat, -f, p, NAN) for f, p in ((2.0, "loading"), (top, "loading"), (3.0, "unloading"))]
    m = table(*rows)
    x = -m.wrench[:, 2]
    # Play of width 1: max(x - 1, 0) up, min(largest - 1, x + 1) down.
    np.testing.assert_allclose(history_of(m).play(x, 1.0), [1.0, 5.0, 4.0, 1.0, 3.0, 3.0])


def test_steps_go_before_phases_and_tell_time() -> None:
    h = history_of(
        table(
            ("A", None, -600.0, None, 12.0),
            ("A", None, -300.0, None, 11.0),
            ("A", None, -300.0, None, 13.0),
            ("B", None, -300.0, None, 1.0),
        )
    )
    assert h.is_known
    np.testing.assert_array_equal(h.cycle, [0, 0, 0, 1])
    np.testing.assert_array_equal(h.order, [1, 0, 2, 0])
    np.testing.assert_allclose(h.clock, [11 / 12, 10 / 12, 1.0, 0.0])


def test_steps_that_begin_anew_in_every_cycle_are_no_clock() -> None:
    rows: list[Row] = [(p, None, -f, None, s) for p in "AB" for s, f in ((1.0, 300.0), (2.0, 600.0), (3.0, 300.0))]
    h = history_of(table(*rows))
    assert h.is_known
    np.testing.assert_array_equal(h.order, [0, 1, 2, 0, 1, 2])
    assert np.isnan(h.clock).all()


def test_one_step_for_different_loads_is_no_order() -> None:
    h = history_of(table(("A", None, -300.0, "loading", 5.0), ("A", None, -600.0, "loading", 5.0)))
    assert h.is_known
    np.testing.assert_array_equal(h.order, [0, 1])
    assert not history_of(table(("A", None, -300.0, None, 5.0), ("A", None, -600.0, None, 5.0))).is_known


def test_readings_at_one_time_share_their_place() -> None:
    h = history_of(
        table(("A", None, -300.0, None, 1.0), ("A", None, -300.1, None, 1.0), ("A", None, -600.0, None, 2.0))
    )
    np.testing.assert_array_equal(h.order, [0, 0, 1])


def test_without_phase_and_step_each_reading_is_alone() -> None:
    h = history_of(table(("A", None, -300.0, None, NAN), ("A", None, -600.0, None, NAN)))
    assert not h.is_known
    np.testing.assert_array_equal(h.cycle, [0, 1])
    # One pose that does not say so is enough for the whole not to be known; the others keep their cycles.
    mixed = history_of(
        table(("A", 1, -300.0, "loading", NAN), ("A", 1, -600.0, "loading", NAN), ("B", 1, -9.0, None, NAN))
    )
    assert not mixed.is_known
    np.testing.assert_array_equal(mixed.cycle, [0, 0, 1])


def test_other_directions_and_points_are_other_cycles() -> None:
    m = table(*[("A", 1, -300.0, "loading", NAN)] * 4)
    wrench = m.wrench.copy()
    wrench[1] = [0, 300.0, 0, 0, 0, 0]
    wrench[2] = [0, 0, 300.0, 0, 0, 0]
    point = m.point.copy()
    point[3] = [0.1, 0, 0]
    h = history_of(replace(m, wrench=wrench, point=point))
    assert len(set(h.cycle.tolist())) == 4


def test_steps_lead_through_zero_to_the_other_side() -> None:
    h = history_of(table(("A", 1, -300.0, None, 1.0), ("A", 1, 300.0, None, 2.0), ("A", 1, -300.0, None, 3.0)))
    np.testing.assert_array_equal(h.cycle, [0, 0, 0])
    np.testing.assert_allclose(h.play(np.array([3.0, -3.0, 3.0]), 1.0), [2.0, -2.0, 2.0])


def test_a_moment_alone_has_a_size() -> None:
    m = table(*[("A", 1, 0.0, "loading", NAN)] * 2)
    wrench = np.zeros((2, 6))
    wrench[:, 5] = [200.0, 100.0]
    np.testing.assert_array_equal(history_of(replace(m, wrench=wrench)).order, [1, 0])
