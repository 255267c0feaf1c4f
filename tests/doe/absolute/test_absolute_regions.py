"""Accuracy by region: what is put in is found, and evenly scattered errors make no region better."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from doe.absolute.calibrate import Positions, calibrate_positions
from doe.absolute.prediction import Predicted
from doe.absolute.readings import AbsoluteReadings
from doe.absolute.regions import accuracy_regions, where
from fem import ArmModel
from robots.arrays import Array


@pytest.fixture(scope="module")
def found(kr60: ArmModel, two_targets: AbsoluteReadings) -> Positions:
    return calibrate_positions(kr60, two_targets, ("zeros",), parts=2)


def scattered(c: Positions, factor: Array, seed: int) -> Positions:
    """The same with other errors at readings left out: normal, times a factor (n,)."""
    rng = np.random.default_rng(seed)
    error = 1e-4 * factor[:, None] * rng.normal(size=(len(factor), 3))
    return replace(c, left_out=Predicted(error, c.left_out.half95), gross=())


def test_regions_hold_all_readings_once_and_their_figures(found: Positions) -> None:
    r = accuracy_regions(found, edge=0.8)
    assert sum(one.readings for one in r.regions) == int(found.right.sum())
    d = found.distances()["before"]
    one = max(r.regions, key=lambda region: region.readings)
    inside = np.all((r.place >= one.low) & (r.place < one.high), axis=1)
    assert inside.sum() == one.readings
    assert one.before.largest == pytest.approx(d[inside].max())
    assert one.before.rms == pytest.approx(np.sqrt(np.mean(d[inside] ** 2)))
    assert one.before.mean == pytest.approx(d[inside].mean())
    np.testing.assert_allclose(one.high - one.low, 0.8)


def test_places_are_those_of_the_arm(found: Positions) -> None:
    r = accuracy_regions(found)
    data, frame = found.found.data, found.found.frames
    mine = data.session.number[found.right] == 1
    np.testing.assert_allclose(r.place[mine], frame[1].inside(data.position[found.right][mine]).T)


def test_a_region_that_is_worse_is_named(found: Positions) -> None:
    plain = scattered(found, np.ones(len(found.found.data)), 0)
    r = accuracy_regions(plain, edge=1.2)
    bad = max(r.regions, key=lambda region: region.readings)
    inside = np.all((r.place >= bad.low) & (r.place < bad.high), axis=1)
    worse = accuracy_regions(scattered(found, np.where(inside, 3.0, 1.0), 0), edge=1.2)
    told = {tuple(one.low): one.verdict for one in worse.regions}
    assert told[tuple(bad.low)] == "worse"
    assert where(bad) in worse.words


def test_even_scatter_seldom_makes_a_region_differ(found: Positions) -> None:
    alarms = 0
    for seed in range(12):
        r = accuracy_regions(scattered(found, np.ones(len(found.found.data)), seed), edge=1.2)
        alarms += any(one.verdict in ("better", "worse") for one in r.regions)
    # One in twenty by design: four or more of twelve come once in five hundred times.
    assert alarms <= 3


def test_what_targets_of_a_pose_share_makes_no_region_differ(found: Positions) -> None:
    """Eight targets at each pose with one error: shuffled one by one, three of four campaigns would have a region."""
    rows = np.repeat(np.arange(len(found.found.data)), 8)
    fits = {
        name: replace(fit, data=fit.data.take(rows), residual=fit.residual[rows])
        for name, fit in (("found", found.found), ("before", found.before))
    }
    alarms = 0
    for seed in range(12):
        even = scattered(found, np.ones(len(found.found.data)), seed).left_out
        many = replace(found, **fits, left_out=Predicted(even.error[rows], even.half95[rows]), gross=())
        alarms += any(one.verdict in ("better", "worse") for one in accuracy_regions(many, edge=1.2).regions)
    assert alarms <= 3


def test_a_single_region_is_told_from_nothing(found: Positions) -> None:
    r = accuracy_regions(found, edge=100.0)
    assert len(r.judged) <= 1 or r.edge == 100.0
    few = accuracy_regions(found, edge=0.05)
    assert {one.verdict for one in few.regions if one.readings < 6} == {"too few readings"}
    assert "too few" in few.words
