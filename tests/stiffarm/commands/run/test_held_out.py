"""Readings held out of the whole chain: every variant predicts them, and the report says which does best."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command

from doe import Measurements, read_measurements, write_measurements
from doe.estimation.campaign import bundled_campaign, campaign_of
from fem import deflection
from fem.arm import Arm
from robots import InputError
from stiffarm.commands.calibrate.step import Request, calibrate
from stiffarm.commands.run import held_out
from stiffarm.session import inputs

POSES = ((12.0, 60.0, 30.0, 40.0), (-20.0, 75.0, -60.0, -50.0))


def _made_up(given: Arm, like: Measurements, springs: dict[str, float]) -> Measurements:
    """Readings of dz at two other poses under 650 N, by the robot with these springs."""
    q = np.zeros((2, 6))
    q[:, 1:5] = np.radians(POSES)
    wrench = np.tile([0.0, 0.0, -650.0, 0.0, 0.0, 0.0], (2, 1))
    moved = np.full((2, 6), np.nan)
    moved[:, 2] = deflection(given.model.with_springs(springs), q, wrench)[:, 2]
    some = like.select(np.arange(like.n) < 2)
    return replace(some, q=q, wrench=wrench, displacement=moved, pose=("H1", "H2"), source="held.csv")


@pytest.fixture(scope="module")
def given() -> Arm:
    return inputs.read_model("xr701", None, None)


def test_a_variant_predicts_what_it_would_do_itself(given: Arm, data_file: Path) -> None:
    table = read_measurements(data_file, given.robot)
    springs_free = campaign_of("xr701", ("j2.stiffness", "j3.stiffness", "j4.stiffness", "j5.stiffness"))
    springs = {e.parameter.place: e.value for e in calibrate(given, table, Request(springs_free, (650.0,))).springs}
    own, softer = (
        held_out.of_variants([calibrate(given, table, Request(springs_free, (650.0,)), holdout=kept)])
        for kept in (_made_up(given, table, springs), _made_up(given, table, springs | {"j3": springs["j3"] / 2.0}))
    )
    # Its own deflections: rounding.
    assert own["constant, parallelogram"].rms_mm < 1e-9
    assert softer["constant, parallelogram"].rms_mm > 0.1
    assert held_out.payload(softer)["readings"] == 2
    assert "constant, parallelogram predicts them best" in held_out.sentences(softer)[0]
    # A diagnosed model is no variant, and may do better than all of them.
    assert "diagnosed predicts them best, to 0.050 mm" in held_out.sentences(softer, {"diagnosed": 0.05})[0]
    assert held_out.sentences(held_out.of_variants([])) == ()


@pytest.mark.slow
def test_laws_of_studies_say_which_poses_are_beyond_them(given: Arm, data_file: Path) -> None:
    table, scheme = read_measurements(data_file, given.robot), bundled_campaign("xr701")
    assert scheme is not None
    kept = _made_up(given, table, {"j2": 1.4e6, "j3": 8e5, "j4": 8e5, "j5": 1e9})
    staged = calibrate(given, table, Request(scheme, scheme.loads_N), holdout=kept).holdout
    assert staged is not None
    # Both are within the 80 deg of q2 and 75 of q3real that were read; with q2 = 60 deg none is.
    assert staged.beyond == ()
    assert np.isfinite(staged.rms_mm)
    assert np.isnan(staged.expected).all()
    far = replace(kept, q=kept.q + np.radians([0.0, 48.0, 0.0, 0.0, 0.0, 0.0]))
    beyond = calibrate(given, table, Request(scheme, scheme.loads_N), holdout=far).holdout
    assert beyond is not None
    assert beyond.beyond == ("H1",)


def test_poses_that_were_seen_are_refused(given: Arm, data_file: Path) -> None:
    table = read_measurements(data_file, given.robot)
    with pytest.raises(InputError, match="poses that are in"):
        calibrate(given, table, Request(campaign_of("xr701", ("j2.stiffness",))), holdout=table)


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit", "quick_diagnoses")
def test_the_whole_chain_judges_by_readings_held_out(cli: Command, given: Arm, data_file: Path, tmp_path: Path) -> None:
    table = read_measurements(data_file, given.robot)
    held = _made_up(given, table, {"j2": 1.4e6, "j3": 8e5, "j4": 8e5, "j5": 1e9})
    write_measurements(held, tmp_path / "held.csv", given.robot)
    outcome = cli("run", "xr701", "--holdout", "held.csv", "--points", "3", "--no-rehearse", "--out", "o")
    assert outcome.code == 0, outcome.err
    result = json.loads((tmp_path / "o" / "results.json").read_text(encoding="utf-8"))
    rms = result["holdout"]["rms_mm"]
    assert set(rms) == set(result["variants"])
    # Made by constant springs close to the calibrated ones, on the load path the arm has.
    assert min(rms, key=lambda name: rms[name]) == "constant, parallelogram"
    page = (tmp_path / "o" / "report.html").read_text(encoding="utf-8")
    assert "held-out RMS (mm)" in page
    assert "constant, parallelogram predicts them best" in page
