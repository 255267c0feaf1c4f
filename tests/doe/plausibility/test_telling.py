"""Readings that tell nothing about the arm are known as such, and real ones are not taken for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses
from scipy.stats import binom
from table_cases import DOWN, THREE_WAYS, Arm, campaign, plain_arm, spoilt, table

from doe.estimation.problem import problem
from doe.plausibility.passive_arm import LEVEL, Told, refuse_telling_nothing, told_by
from doe.tables.loaded import select_loads
from doe.tables.measurements import Measurements
from doe.tables.reading import bundled_data, read_measurements

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
