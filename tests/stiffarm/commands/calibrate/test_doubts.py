"""What `calibrate` says against its own answer: drift, what no springs explain, refuted sigmas, an odd size.

The arm and its readings are those of benchmarks/calibration/own_arm.py: plain numpy, and no code of the program.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_runs import Outcome, run_here
from command_coverage import study
from own_arm import SPRINGS, Campaign, MASS_kg, PAYLOAD_kg, dh_table, read, write

import stiffarm as sa
from doe.certainty.doubts import drift, left_in_groups, order_of_rows

PLAY = Campaign(play=0.3e-3, unload=True)
DRIFT = Campaign(drift=60e-6, steps=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the model of the arm."""
    out = tmp_path_factory.mktemp("doubts")
    done = run_here(
        "new",
        "mine",
        "--mdh",
        dh_table(out / "dh.csv"),
        "--payload-kg",
        PAYLOAD_kg,
        "--mass-kg",
        MASS_kg,
        "--out",
        out / "arm",
    )
    assert done.code == 0, done.err
    return out


def _table(folder: Path, campaign: Campaign, name: str = "readings", seed: int = 1, **units: float) -> Path:
    return write(campaign, read(campaign, np.random.default_rng(seed)), folder / f"{name}.csv", **units)


def _calibrated(folder: Path, table: Path, *more: str) -> Outcome:
    return run_here("calibrate", folder / "arm" / "mine.toml", table, *more, "--json")


def _doubts(outcome: Outcome) -> dict[str, dict[str, Any]]:
    assert outcome.code == 0, outcome.err
    return {one["code"]: one for one in outcome.json["doubts"]}


def test_readings_of_springs_alone_raise_no_doubt(folder: Path) -> None:
    for seed, campaign in enumerate([Campaign(), Campaign(setup=0.03), replace(PLAY, play=0.0), Campaign(noise=15e-5)]):
        assert _doubts(_calibrated(folder, _table(folder, campaign, seed=10 + seed))) == {}, campaign


# --- what springs do not explain ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("campaign", "code"),
    [
        (PLAY, "not-proportional"),
        (replace(PLAY, loads=(15.0, 40.0, 70.0)), "not-proportional"),
        (Campaign(play=0.1e-3), "not-proportional"),
        (Campaign(friction=60.0, unload=True), "not-proportional"),
        (replace(PLAY, loads=(200.0, 500.0)), "not-proportional"),
        (Campaign(play=0.3e-3, loads=(500.0,), repeats=3), "set-ups-differ"),
    ],
)
def test_play_and_friction_are_no_springs(folder: Path, campaign: Campaign, code: str) -> None:
    table = _table(folder, campaign)
    outcome = _calibrated(folder, table)
    doubts = _doubts(outcome)
    assert code in doubts
    assert doubts[code]["p_value"] < 1e-4
    assert f"`stiffarm diagnose {folder / 'arm' / 'mine.toml'} {table}`" in outcome.json["what_next"]


def test_the_warning_stands_first_on_screen_on_the_page_and_in_the_model(folder: Path) -> None:
    table, out = _table(folder, PLAY), folder / "out"
    done = run_here("calibrate", folder / "arm" / "mine.toml", table, "--out", out)
    assert done.code == 0, done.err
    said = done.out + done.err
    assert said.index("warning: the springs alone do not explain") < said.index("j2.stiffness")
    assert "The springs alone do not explain" in (out / "report.html").read_text(encoding="utf-8").split("<h2")[0]
    assert "springs alone do not explain" in (out / "model.toml").read_text(encoding="utf-8")
    assert json.loads((out / "calibration.json").read_text(encoding="utf-8"))["doubts"][0]["factor"] > 10.0


def test_the_command_that_is_named_runs(folder: Path) -> None:
    table = _table(folder, replace(PLAY, poses=8))
    outcome = _calibrated(folder, table, "--loads", "100,300")
    assert len(_doubts(outcome)) == 1
    command = outcome.json["what_next"].split("`")[1].split()
    assert command[-2:] == ["--loads", "100,300"]
    done = run_here(*command[1:], "--folds", "0", "--next", "0", "--json")
    assert done.code == 0, done.err


@pytest.mark.slow
def test_what_the_model_has_already_is_no_doubt(folder: Path) -> None:
    """The same readings by the model that `diagnose` made of them, play included."""
    table, out = _table(folder, replace(PLAY, loads=(60.0, 200.0, 500.0))), folder / "diagnosed"
    done = run_here("diagnose", folder / "arm" / "mine.toml", table, "--folds", "0", "--next", "0", "--out", out)
    assert done.code == 0, done.err
    after = run_here("calibrate", out / "model.toml", table, "--free", "j2.stiffness,j3.stiffness", "--json")
    assert "not-proportional" not in _doubts(after)


# --- drift --------------------------------------------------------------------------------------------------


def test_a_drift_is_said_with_what_it_does_to_the_springs(folder: Path) -> None:
    for campaign in (DRIFT, replace(DRIFT, steps=False), replace(DRIFT, setup=0.02)):
        outcome = _calibrated(folder, _table(folder, campaign))
        doubts = _doubts(outcome)
        assert "drift" in doubts, campaign
        assert "dz" in doubts["drift"]["words"]
        assert doubts["drift"]["factor"] > 1.0


def test_springs_with_the_drift_free_are_nearer_to_the_truth(folder: Path) -> None:
    arm = sa.load(folder / "arm" / "mine.toml")
    off = []
    for seed in range(5):
        readings = sa.read_readings(_table(folder, replace(DRIFT, drift=2e-4), seed=seed), arm)
        e = sa.calibrate(arm, readings).found.found.stages[0].estimate
        assert e.problem.when is not None
        found = drift(e, e.problem.when.clock, (3e-6, 3e-6))
        assert found is not None
        assert np.ptp(found.size[e.problem.component == 2]) == pytest.approx(2e-4, rel=0.1)
        off.append(np.abs(np.array([found.u, e.u]) * SPRINGS[1:5] - 1.0))
    free, plain = np.mean(off, axis=0)
    assert (free[[1, 3]] < 0.5 * plain[[1, 3]]).all()


def test_rows_sorted_by_pose_are_no_clock() -> None:
    rng = np.random.default_rng(3)
    q = rng.normal(size=(40, 2))
    assert np.isfinite(order_of_rows(np.repeat(q, 3, axis=0))).all()
    assert np.isnan(order_of_rows(q[np.argsort(q[:, 0])])).all()


# --- sigmas -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("repeats", [1, 3])
@pytest.mark.parametrize("sigma_mm", [20.0, 1e-6])
def test_sigmas_far_from_what_is_seen_are_refused_everywhere(folder: Path, sigma_mm: float, repeats: int) -> None:
    table = _table(folder, Campaign(noise=148e-6, sigma_mm=sigma_mm, repeats=repeats))
    for command in ("calibrate", "diagnose", "run"):
        out = folder / f"refused-{command}"
        done = run_here(command, folder / "arm" / "mine.toml", table, "--out", out)
        assert done.code == 2, (command, done.err)
        assert "sigma_mm" in done.err
        assert "--confirm-units" in done.err
        assert not out.exists()


def test_confirmed_sigmas_are_taken_and_refuted(folder: Path) -> None:
    for sigma_mm in (20.0, 1e-3):
        table = _table(folder, Campaign(noise=148e-6, sigma_mm=sigma_mm))
        doubts = _doubts(_calibrated(folder, table, "--confirm-units"))
        assert doubts["sigma"]["factor"] == pytest.approx(0.148 / sigma_mm, rel=0.25)
    absurd = _calibrated(folder, _table(folder, Campaign(noise=148e-6, sigma_mm=1e-6)), "--confirm-units")
    assert absurd.code == 2
    assert "--confirm-units" not in absurd.err


@pytest.mark.parametrize(("sigma_mm", "repeats"), [(0.02, 1), (0.02, 3), (0.3, 1), (0.3, 3), (1.0, 3)])
def test_sigmas_that_readings_refute_are_said_where_the_interval_stands(
    folder: Path, sigma_mm: float, repeats: int
) -> None:
    table = _table(folder, Campaign(noise=148e-6, sigma_mm=sigma_mm, repeats=repeats))
    calibrated = _doubts(_calibrated(folder, table))
    assert list(calibrated) == ["sigma"]
    assert calibrated["sigma"]["factor"] == pytest.approx(0.148 / sigma_mm, rel=0.15)


def test_one_load_leaves_the_springs_to_judge_a_sigma(folder: Path) -> None:
    table = _table(folder, Campaign(noise=148e-6, sigma_mm=0.02, loads=(500.0,)))
    assert "sigma_mm or the model is refuted" in _doubts(_calibrated(folder, table))["sigma"]["words"]


def test_right_sigmas_are_not_refuted(folder: Path) -> None:
    for seed in range(5):
        for repeats in (1, 2):
            campaign = Campaign(sigma_mm=0.006, repeats=repeats, poses=12)
            assert _doubts(_calibrated(folder, _table(folder, campaign, seed=seed))) == {}


def test_repeats_that_agree_to_the_digit_tell_no_scatter(folder: Path) -> None:
    """Noise of 1 um, read to 10 um and stated as what rounding leaves: most repeats are the same."""
    campaign = Campaign(noise=1e-6, sigma_mm=0.003, repeats=3)
    made = read(campaign, np.random.default_rng(2))
    table = write(campaign, replace(made, moved=np.round(made.moved, 5)), folder / "rounded.csv")
    assert "sigma" not in _doubts(_calibrated(folder, table))


@pytest.mark.slow
def test_diagnose_and_run_say_so_too(folder: Path) -> None:
    table, model = _table(folder, Campaign(noise=148e-6, sigma_mm=0.02)), folder / "arm" / "mine.toml"
    done = run_here("diagnose", model, table, "--folds", "0", "--next", "0", "--json")
    assert [one["code"] for one in done.json["doubts"]] == ["sigma"]
    done = run_here("run", model, table, "--no-rehearse", "--out", folder / "run")
    assert done.code == 0, done.err
    assert "warning: sigma_mm is refuted" in done.out + done.err
    assert "sigma_mm is refuted" in (folder / "run" / "report.html").read_text(encoding="utf-8")


def test_what_is_left_in_groups_is_that_of_least_squares_group_by_group() -> None:
    rng = np.random.default_rng(0)
    group = rng.integers(0, 5, 60)
    one, x, y = np.ones(60), rng.normal(size=60), rng.normal(size=60)
    left, freedom = left_in_groups(y, group, [one, x])
    for k in range(5):
        A, mine = np.column_stack([one, x])[group == k], y[group == k]
        np.testing.assert_allclose(left[group == k], mine - A @ np.linalg.lstsq(A, mine, rcond=None)[0], atol=1e-12)
    assert freedom == 60 - 10


# --- size for the class ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("units", "way", "times"),
    [
        ({"loads": 1.0 / 4.448}, "soft", 4.448),
        ({"deflections": 4.0}, "soft", 4.0),
        ({"deflections": 0.2}, "stiff", 5.0),
    ],
)
def test_units_wrong_by_few_times_make_an_arm_soft_or_stiff_for_its_class(
    folder: Path, units: dict[str, float], way: str, times: float
) -> None:
    # An arm from the middle of its class, 0.3 to 0.5e6 N m/rad in the main joints.
    middle = read(Campaign(), np.random.default_rng(1), SPRINGS * 0.5)
    table = write(Campaign(), middle, folder / "units.csv", **units)
    doubts = _doubts(_calibrated(folder, table))
    assert doubts["class"]["words"].startswith(f"{way} for its class by a factor of")
    assert doubts["class"]["factor"] == pytest.approx(times, rel=0.3)
    assert doubts["class"]["p_value"] < 0.05
    assert _doubts(_calibrated(folder, write(Campaign(), middle, folder / "right.csv"))) == {}


@pytest.mark.parametrize("robot", ["xr701", "fanuc-r2000ic"])
def test_bundled_readings_are_of_their_class(robot: str) -> None:
    arm = sa.load(robot)
    readings = sa.read_readings(sa.bundled(robot), arm)
    joints = ["j2.stiffness", "j3.stiffness"]
    assert "class" not in {one.code for one in sa.calibrate(arm, readings, free=joints).found.doubts}
    softer = replace(readings, table=replace(readings.table, displacement=4.448 * readings.table.displacement))
    found = sa.calibrate(arm, softer, free=joints)
    assert any(text.startswith("soft for its class by a factor of") for text in found.warnings)


def test_springs_that_the_model_states_are_a_narrower_class() -> None:
    arm = sa.load("kr60-3")
    rng = np.random.default_rng(5)
    poses = [f"q{k}_deg" for k in range(1, 7)]
    import pandas as pd

    q = rng.uniform(-30.0, 30.0, (12, 6)) + np.array([0.0, -60.0, 30.0, 0.0, 30.0, 0.0])
    data = pd.DataFrame(q, columns=poses).assign(fz_N=-300.0, dz_mm=-0.3, pose=range(12))
    shown = sa.read_readings(data, arm)
    from doe.plausibility.units_check import class_doubt
    from doe.tables.loaded import simulate

    for times, said in ((1.0, False), (3.0, True)):
        table = replace(
            shown.table, displacement=times * np.where(shown.table.used, simulate(arm.model, shown.table), np.nan)
        )
        assert (class_doubt(arm.description, arm.model, table) is not None) == said


# --- intervals ------------------------------------------------------------------------------------------------


def test_half_widths_of_white_noise_are_those_of_least_squares(tmp_path: Path) -> None:
    """The gauge's digit, 10 um, is no standard deviation: with it they were 1.7 times as wide at 6 um of noise."""
    row = study("white 6 um", 12, tmp_path)
    assert 0.95 < row["half_width_over_least_squares"] < 1.12
    assert row["inside"] >= 40  # of 48; by chance fewer once in 10,000 runs
