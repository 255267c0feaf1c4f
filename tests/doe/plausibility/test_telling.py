"""Readings that tell nothing about the arm are known as such, and real ones are not taken for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses, refuses_each
from scipy.stats import binom
from table_cases import DOWN, THREE_WAYS, Arm, campaign, plain_arm, spoilt, table, with_springs

from doe.estimation.problem import problem
from doe.plausibility.passive_arm import LEVEL, Told, refuse_frozen, refuse_telling_nothing, told_by
from doe.tables.joined import join
from doe.tables.loaded import select_loads
from doe.tables.measurements import Measurements
from doe.tables.reading import bundled_data, read_measurements
from fem import deflection

SPOILT = ("rows flipped", "cells flipped", "random", "shuffled")
# Layouts of campaigns as they are measured: poses, loads (N), directions of the load, components read.
LAYOUTS = (
    {"poses": 9},
    {"poses": 9, "loads": (375.0,), "ways": THREE_WAYS, "components": (0, 1, 2)},
    {"poses": 5, "ways": DOWN, "components": (0, 1, 2)},
    {"poses": 27, "loads": (300.0, 600.0)},
    {"poses": 15, "loads": (375.0,)},
)
ROBOTS = ("kr60-3", "xr701", "tx200")
NOISES = (0.0, 0.1, 0.2, 0.3)


def told(data: Measurements, robot: str = "kr60-3") -> Told:
    return told_by(problem(plain_arm(robot), data, ()))


def real(seed: int) -> tuple[Measurements, str]:
    robot = ROBOTS[seed % 3]
    made = campaign(seed, robot=robot, noise=NOISES[seed % 4], **LAYOUTS[seed % 5])  # type: ignore[arg-type]
    return made, robot


def wrong(seeds: range, how: str) -> int:
    """Spoilt campaigns that are taken for deflections of the arm."""
    found = 0
    for seed in seeds:
        data, robot = real(seed)
        found += told(spoilt(data, how, seed), robot).anything
    return found


def test_readings_with_noise_up_to_a_third_are_taken() -> None:
    for seed in range(60):
        data, robot = real(seed)
        assert told(data, robot).anything, (seed, robot, told(data, robot))


@pytest.mark.parametrize("how", SPOILT[:3])
def test_flipped_and_random_readings_tell_nothing(how: str) -> None:
    # One table in a hundred may pass by chance: three of twenty would be one in a thousand studies like this.
    assert wrong(range(20), how) <= binom.isf(1e-3, 20, LEVEL)


@pytest.mark.slow
def test_rates_on_sixty_campaigns() -> None:
    refused = 0
    for seed in range(60):
        data, robot = real(seed)
        refused += not told(data, robot).anything
    passed = {how: wrong(range(60), how) for how in SPOILT[:3]}
    # Those of one load read much the same everywhere in whatever order, and that much they tell.
    several = [seed for seed in range(60) if len(LAYOUTS[seed % 5].get("loads", "several")) > 1]  # type: ignore[arg-type]
    shuffled = sum(wrong(range(seed, seed + 1), "shuffled") for seed in several)
    assert refused == 0
    assert all(count <= binom.isf(1e-3, 60, LEVEL) for count in passed.values()), passed
    assert shuffled <= 0.1 * len(several), (shuffled, len(several))


def test_the_published_readings_are_taken_at_every_load_and_path(arm: Arm) -> None:
    for path in ("parallelogram", "serial"):
        model = arm(load_path=path)
        data = read_measurements(bundled_data("xr701"), model.robot)
        for loads in ((), (150.0,), (375.0,), (650.0,)):
            found = told_by(problem(model, select_loads(data, loads), ()))
            assert found.anything
            assert found.scatter < 0.25


@pytest.mark.parametrize("how", [*SPOILT, "upside down"])
def test_the_published_readings_spoilt_are_refused(arm: Arm, how: str) -> None:
    model = arm()
    data = spoilt(read_measurements(bundled_data("xr701"), model.robot), how, seed=1)
    p = problem(model, data, ())
    assert told_by(p).scatter > 0.5
    caught = refuses("T013", "tell nothing about the arm", refuse_telling_nothing, p, data.source)
    assert caught.remedy
    assert data.source in str(caught)


def test_noise_above_half_of_the_readings_passes_where_they_follow_loads_and_poses() -> None:
    found = told(campaign(3, poses=27, noise=0.7))
    assert found.scatter > 0.5
    assert found.anything
    assert max(found.by_sign, found.by_order) <= LEVEL


def test_the_order_of_the_rows_makes_no_difference() -> None:
    data = spoilt(campaign(1, noise=0.2, components=(0, 1, 2)), "random")
    other = np.random.default_rng(5).permutation(data.n)
    turned = table(plain_arm("kr60-3"), data.q[other], data.wrench[other], data.displacement[other])
    first, again = told(data), told(turned)
    assert (first.by_sign, first.by_order) == (again.by_sign, again.by_order)
    assert first.scatter == pytest.approx(again.scatter, rel=1e-9)  # sums in another order


def test_loads_and_readings_in_other_units_make_no_difference() -> None:
    data = spoilt(campaign(2, noise=0.2), "shuffled")
    a, b = told(data), told(replace(data, wrench=1e3 * data.wrench, displacement=1e-2 * data.displacement))
    assert (a.anything, a.by_sign, a.by_order) == (b.anything, b.by_sign, b.by_order)


def test_a_single_reading_cannot_be_judged_and_is_taken() -> None:
    one = campaign(0, poses=1, loads=(300.0,))
    found = told(one)
    assert found.anything
    assert np.isnan(found.scatter)


def test_repeats_of_one_set_up_need_no_order() -> None:
    one = campaign(0, poses=1, loads=(300.0,) * 12, noise=0.3)
    assert told(one).anything
    assert not told(spoilt(one, "rows flipped")).anything


# ------------------------------------------------------------
# A gauge that stands still is found; columns that are right to stand still are not

MODEL = plain_arm("kr60-3")


def set_to(data: Measurements, value: float, component: int | None = None) -> Measurements:
    read = data.displacement.copy()
    columns = slice(None) if component is None else component
    read[:, columns] = np.where(np.isnan(read[:, columns]), np.nan, value)
    return replace(data, displacement=read)


def test_readings_that_are_all_zero_are_refused() -> None:
    for data in (campaign(0), campaign(0, components=(0, 1, 2)), campaign(0, poses=1, loads=(300.0,))):
        caught = refuses("T013", "every reading is 0", refuse_frozen, MODEL, set_to(data, 0.0))
        assert "touches" in str(caught.remedy)


def test_readings_that_are_all_the_same_are_refused(arm: Arm) -> None:
    model = arm()
    data = read_measurements(bundled_data("xr701"), model.robot)
    for loads in ((), (150.0,), (375.0,), (650.0,)):
        caught = refuses(
            "T013",
            "column dz_mm reads the same in all",
            refuse_frozen,
            model,
            set_to(select_loads(data, loads), -0.37e-3),
        )
        assert caught.value == "-0.37 mm"


def test_the_same_under_loads_of_which_one_is_twice_the_other_is_refused() -> None:
    refuses(
        "T013", "in all 2 set-ups", refuse_frozen, MODEL, set_to(campaign(0, poses=1, loads=(300.0, 600.0)), -0.512e-3)
    )


@pytest.mark.parametrize("component", [0, 1, 2])
@pytest.mark.parametrize("value", [0.0, 0.123e-3])
def test_a_column_that_stands_while_the_others_move_is_named(component: int, value: float) -> None:
    data = campaign(4, ways=THREE_WAYS, components=(0, 1, 2), noise=0.05)
    refuse_frozen(MODEL, data)
    refuses(
        "T013", f"column d{'xyz'[component]}_mm reads the same", refuse_frozen, MODEL, set_to(data, value, component)
    )


def test_rotations_that_stand_while_the_point_moves_are_named() -> None:
    data = campaign(4, ways=THREE_WAYS, components=(0, 1, 2, 3, 4, 5))
    refuse_frozen(MODEL, data)
    stood = data
    for component in (3, 4, 5):
        stood = set_to(stood, 0.0, component)
    caught = refuses_each("T013", "", refuse_frozen, MODEL, stood)
    assert [f"column r{axis}_mrad" in str(e) for axis, e in zip("xyz", caught.errors, strict=True)] == [True] * 3


def test_the_file_of_a_joined_table_is_named() -> None:
    first, second = (replace(campaign(k), source=f"{k}.csv", sha256=str(k)) for k in (1, 2))
    refuses("T013", r"2\.csv: column dz_mm", refuse_frozen, MODEL, join([first, set_to(second, -0.4e-3)]))


def test_what_does_not_move_across_the_plane_of_the_links_is_right() -> None:
    """In a plane all three columns are read; the one across is 0 to the last digit."""
    model = with_springs("kr60-3", np.random.default_rng(0))
    q = np.zeros((8, 6))
    q[:, 1], q[:, 2] = np.radians(np.linspace(-90.0, -10.0, 8)), np.radians(np.linspace(-60.0, 30.0, 8))
    wrench = np.tile([0.0, 0.0, -400.0, 0.0, 0.0, 0.0], (8, 1))
    read = np.where(np.arange(6) < 3, np.round(deflection(model, q, wrench), 9), np.nan)
    read[:, 1] = 0.0
    refuse_frozen(MODEL, table(model, q, wrench, read))


def test_the_same_at_angles_that_turn_the_whole_arm_is_right() -> None:
    model = with_springs("kr60-3", np.random.default_rng(1))
    q = np.tile(np.radians([0.0, -60.0, 20.0, 30.0, 40.0, 0.0]), (7, 1))
    q[:, 0] = np.radians(np.linspace(-90.0, 90.0, 7))
    wrench = np.tile([0.0, 0.0, -400.0, 0.0, 0.0, 0.0], (7, 1))
    read = np.full((7, 6), np.nan)
    read[:, 2] = np.round(deflection(model, q, wrench)[:, 2], 6)
    assert np.ptp(read[:, 2]) == 0.0
    refuse_frozen(MODEL, table(model, q, wrench, read))


def test_the_same_by_the_gauge_s_last_digit_is_right(arm: Arm) -> None:
    """Tenths of a millimetre: nine poses under one load may well read the same."""
    model = arm()
    data = select_loads(read_measurements(bundled_data("xr701"), model.robot), (150.0,))
    refuse_frozen(model, set_to(data, -0.3e-3))


def test_the_same_under_loads_that_hardly_differ_is_right() -> None:
    """By a tenth, and noise does the rest."""
    refuse_frozen(MODEL, set_to(campaign(0, poses=1, loads=(300.0, 330.0)), -0.512e-3))


def test_one_set_up_read_many_times_is_right() -> None:
    refuse_frozen(MODEL, set_to(campaign(0, poses=1, loads=(300.0,) * 9), -0.512e-3))
    for seed in range(6):
        one = campaign(seed, poses=1, loads=(300.0,) * 3, components=(0, 2))
        refuse_frozen(MODEL, set_to(one, 3.0e-3, 0))
