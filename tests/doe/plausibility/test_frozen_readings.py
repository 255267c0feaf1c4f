"""A gauge that stands still is found; columns that are right to stand still are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses
from table_cases import THREE_WAYS, Arm, campaign, plain_arm, table, with_springs

from doe.plausibility.passive_arm import refuse_frozen
from doe.tables.joined import join
from doe.tables.loaded import select_loads
from doe.tables.measurements import Measurements
from doe.tables.reading import bundled_data, read_measurements
from fem import deflection
from robots import InputErrors

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
    with pytest.raises(InputErrors) as caught:
        refuse_frozen(MODEL, stood)
    assert [f"column r{axis}_mrad" in str(e) for axis, e in zip("xyz", caught.value.errors, strict=True)] == [True] * 3


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
