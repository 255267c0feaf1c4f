"""Tables in other units look like other units; right ones never do, however odd arm, loads and poses are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses
from unit_arms import MISTYPED, made_up, scaled

from doe import Measurements, bundled_data, read_measurements
from doe.plausibility import units_check
from doe.plausibility.units_check import check_units, suspicions
from fem import ArmModel, build_model, deflection
from robots import ModelDescription, arm_class, load_description

SPRINGS = {"j1": 2.2e6, "j2": 9e5, "j3": 1.1e6, "j4": 6.4e4, "j5": 2.5e4, "j6": 2e4}


@pytest.fixture(scope="module")
def xr701() -> tuple[ModelDescription, ArmModel, Measurements]:
    description = load_description("xr701")
    model = build_model(description)
    return description, model, read_measurements(bundled_data("xr701"), model.robot)


@pytest.fixture(scope="module")
def kr60() -> tuple[ModelDescription, ArmModel, Measurements]:
    """Readings of the KR60 with 5 % noise, at poses near zero so that radians as degrees keep the limits too."""
    description = load_description("kr60-3")
    model = build_model(description)
    rng = np.random.default_rng(4)
    q = np.radians(rng.uniform([-60, -100, -60, -90, -90, -90], [60, 20, 60, 90, 90, 90], (24, 6)))
    wrench = np.tile([0.0, 0.0, -500.0, 0.0, 0.0, 0.0], (24, 1))
    d = deflection(model, q, wrench) * (1.0 + 0.05 * rng.normal(size=(24, 6)))
    d[:, 3:] = np.nan
    blank = np.full(24, np.nan)
    none = (None,) * 24
    data = Measurements(
        "kr60.csv",
        "0" * 64,
        q,
        wrench,
        d,
        np.full((24, 3), np.nan),
        blank,
        tuple(map(str, range(24))),
        none,
        none,
        blank,
        tuple(range(2, 26)),
        {},
        (),
    )
    return description, model, data


def test_the_bundled_readings_are_right(xr701) -> None:
    assert suspicions(*xr701) == ()
    assert check_units(*xr701) == ()


@pytest.mark.parametrize(
    ("mistyped", "words"),
    [
        ("micrometres", "deflections in micrometres"),
        ("1/100 mm", "deflections in dial divisions of 1/100 mm"),
        ("1/1000 inch", "deflections in thousandths of an inch"),
        ("cm", "deflections in centimetres"),
        ("inches", "deflections in inches"),
        ("metres", "deflections in metres"),
        ("kgf", "loads in kgf"),
    ],
)
def test_other_units_are_refused_by_their_name_and_taken_if_confirmed(xr701, mistyped: str, words: str) -> None:
    description, model, data = xr701
    table = MISTYPED[mistyped](data)
    info = refuses("T011", "", check_units, description, model, table)
    text = str(info)
    assert f"these look like {words}" in text
    assert "132.5 kg payload" in text
    assert "--confirm-units" in text
    (remark,) = check_units(description, model, table, confirm_units=True)
    assert words in remark


def test_springs_outside_are_named_with_their_class(xr701) -> None:
    """In kgf no reading is impossible by itself, but j3 is determined, and softer than any of its class."""
    description, model, data = xr701
    first = suspicions(description, model, MISTYPED["kgf"](data))[0]
    assert first.found.startswith("j3.stiffness = 7.7")
    assert first.allowed.startswith("1.44e+05 to 1.3e+07 N m/rad")


def test_what_stays_inside_the_class_cannot_be_told(xr701) -> None:
    """Pounds-force make springs 4.4 times softer, as those of other arms of the class are."""
    description, model, data = xr701
    assert suspicions(description, model, MISTYPED["lbf"](data)) == ()


def test_kilonewtons_and_micrometres_are_the_same_factor(xr701) -> None:
    description, model, data = xr701
    (found,) = suspicions(description, model, MISTYPED["kN"](data))
    assert set(found.looks_like) == {"deflections in micrometres", "loads in kN"}


def test_rotations_have_units_of_their_own(kr60) -> None:
    description, model, data = kr60
    rng = np.random.default_rng(0)
    d = deflection(model, data.q, data.wrench)
    d[:, 3:] *= 1.0 + 0.1 * rng.normal(size=(len(d), 3))
    right = replace(data, displacement=d)
    assert suspicions(description, model, right) == ()
    d = d.copy()
    d[:, 3:] *= 1e-3  # mrad typed as if they were rad
    (found,) = suspicions(description, model, replace(data, displacement=d))
    assert "rotations in radians" in found.looks_like
    assert "N/mrad" in found.found


@pytest.mark.parametrize("words", ["radians", "grads"])
def test_angles_in_another_unit_are_found_where_they_fit_far_better(kr60, words: str) -> None:
    description, model, data = kr60
    assert suspicions(description, model, data) == ()
    (found,) = suspicions(description, model, MISTYPED[words](data))
    assert found.looks_like == (f"joint angles in {words}",)


def test_angles_that_noise_cannot_tell_apart_are_left_alone(kr60) -> None:
    """Grads against degrees at 40 % noise: 10 % of an angle is lost in it."""
    description, model, data = kr60
    rng = np.random.default_rng(1)
    noisy = replace(data, displacement=data.displacement * (1.0 + 0.4 * rng.normal(size=data.displacement.shape)))
    assert suspicions(description, model, MISTYPED["grads"](noisy)) == ()


def test_readings_in_which_joint_1_is_rigid_are_right(xr701) -> None:
    """Models and synthetic readings often leave joint 1 out: sideways only what else gives way is read then."""
    description, _, data = xr701
    model = build_model(description)
    made = model.with_springs({"j2": 1.4e6, "j3": 1.2e6, "j4": 9e5, "j5": 5e5})
    wrench = np.roll(data.wrench, 1, axis=1)  # all loads sideways, along y
    wrench[:, 1] = np.where(np.arange(data.n) % 2, data.wrench[:, 2], 0.0)
    wrench[:, 2] = np.where(np.arange(data.n) % 2, 0.0, data.wrench[:, 2])
    wrench[:, 3] = 0.0
    d = deflection(made, data.q, wrench)
    table = replace(data, wrench=wrench, displacement=np.where(np.arange(6) < 3, d, np.nan))
    assert suspicions(description, model, table) == ()


def test_an_arm_out_of_its_class_that_no_unit_explains_is_remarked_only(xr701, monkeypatch: pytest.MonkeyPatch) -> None:
    odd = units_check.Suspicion((), "a stiffness", "another", times=5.0)
    monkeypatch.setattr(units_check, "suspicions", lambda *_: (odd,))
    (remark,) = check_units(*xr701)
    assert "no known units" in remark
    monkeypatch.setattr(units_check, "suspicions", lambda *_: (replace(odd, times=200.0),))
    refuses("T011", "no known units", check_units, *xr701)


def test_one_reading_is_judged_by_what_it_alone_says(xr701) -> None:
    description, model, data = xr701
    one = data.select(np.arange(data.n) == data.n - 1)
    assert suspicions(description, model, one) == ()
    assert suspicions(description, model, scaled(one, deflections=100.0))
    assert suspicions(description, model, scaled(one, deflections=1e-3))


def _refused(count: int, seed: int, *, edge: bool = False) -> list[int]:
    rng = np.random.default_rng(seed)
    arms = [made_up(rng, edge=edge) for _ in range(count)]
    return [i for i, m in enumerate(arms) if suspicions(m.description, m.model, m.data)]


def test_no_right_table_is_refused() -> None:
    assert _refused(20, 5) == []


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "edge"), [(0, False), (1, False), (1, True)])
def test_no_right_table_of_200_arms_is_refused(seed: int, edge: bool) -> None:
    """Springs anywhere within three times the class, or all at one end of that (edge)."""
    assert _refused(200, seed, edge=edge) == []


def test_a_narrower_class_would_refuse_right_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """The test above can fail: judged by a class of half its width, tables of its ends are refused."""
    before = made_up(np.random.default_rng(0), edge=True)  # arms are made up by the true class
    rng = np.random.default_rng(7)
    arms = [before, *(made_up(rng, edge=True) for _ in range(11))]
    monkeypatch.setattr(arm_class, "BEYOND_CLASS", 0.2)
    assert any(suspicions(m.description, m.model, m.data) for m in arms)


@pytest.mark.slow
def test_most_wrong_units_are_found_on_the_same_arms() -> None:
    """Rates on arms with springs anywhere in three times the class; lower bounds, 24 arms leave some 9 % of scatter."""
    rng = np.random.default_rng(0)
    arms = [made_up(rng) for _ in range(24)]
    least = {"micrometres": 0.91, "metres": 0.91, "kN": 0.91, "1/100 mm": 0.7, "1/1000 inch": 0.5, "inches": 0.15}
    for unit, rate in least.items():
        found = [any(s.is_certain for s in suspicions(m.description, m.model, MISTYPED[unit](m.data))) for m in arms]
        assert np.mean(found) >= rate, unit


def test_misfits_of_a_right_table_are_its_noise(kr60) -> None:
    """5 % noise, springs inside the class: the misfit as typed is that, and no scale does far better."""
    description, model, data = kr60
    m = units_check.misfits(model, data, arm_class.arm_class(description, model.robot), rotations=False)
    assert m is not None
    # Lateral components below SMALLEST of the median weigh less, so a little below 0.05.
    assert 0.02 < m.at(1.0) < 0.06
    assert m.best > 0.9 * m.free
