"""What the generator promises: noise as stated, seeds that reproduce, keys apart, sheets filled from one truth."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import re
import tomllib

import numpy as np
import pytest

from rehearsal.evaluate import exact
from rehearsal.kinematics import allowed
from rehearsal.noise import Noise

from . import outside
from .design import campaign, poses
from .imitation import best_imitation
from .model_files import LOADS, arm, free_joints
from .sets import hidden, make, more, truth_at
from .spec import SetSpec
from .study import codes, suite
from .table import from_sheet

ROBOTS = ("xr701", "kr60-3")
CLEAN = {"noise_share": 0.0, "floor_um": 0.0, "resolution_um": 0.0, "setup_scatter": 0.0, "nuisance": False}


def rows_of(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


# Noise and excess.


def test_whitening_undoes_the_covariance(rng: np.random.Generator) -> None:
    r = campaign(arm("xr701"), SetSpec(poses=2, repeats=1), rng)
    d = rng.normal(size=(len(r), 2)) * 1e-3
    noise = Noise(0.03, 3e-6, 1e-6, 0.015)
    root = noise.whiten(r, d, np.eye(2 * len(r)).reshape(len(r), 2, -1))
    flat, same = d.ravel(), np.repeat(r.setup, 2)
    V = np.diag(0.03**2 * flat**2 + 9e-12 + 1e-12 / 12)
    V += 0.015**2 * np.outer(flat, flat) * (same[:, None] == same)
    np.testing.assert_allclose(root @ V @ root.T, np.eye(len(flat)), atol=1e-9)


def test_readings_scatter_as_the_key_says() -> None:
    spec = SetSpec(setup_scatter=0.0, floor_um=3.0, repeats=20)
    truth, r, noise = hidden(spec, 1)
    clean = exact(truth, r)[:, 2]
    z = noise.read(r, exact(truth, r), np.random.default_rng(0))[:, 2]
    ratio = (z - clean) / np.hypot(0.03 * clean, 3e-6)
    # 3240 draws: the standard deviation's own is 1.2 %.
    assert np.std(ratio) == pytest.approx(1, abs=0.05)
    np.testing.assert_allclose(z * 1e6, np.round(z * 1e6), atol=1e-6)


def test_nothing_hidden_has_no_excess_and_an_effect_has() -> None:
    assert make(SetSpec(), 1).key["excess_chi2"] < 1e-6
    key = make(SetSpec(effects=("backlash:j3",)), 1).key
    assert key["detectable"]
    assert key["excess_chi2"] > 1000
    assert not make(SetSpec(effects=("gauge-scale",)), 1).key["detectable"]  # all springs at once


@pytest.mark.slow
def test_imitation_finds_what_a_catalogue_part_can_do_and_what_none_can() -> None:
    spec = SetSpec(effects=("base-tilt",), nuisance=False)
    truth, r, noise = hidden(spec, 2)
    free = free_joints(spec)
    code, left = best_imitation(truth.arm, free, "rigid", r, exact(truth, r), noise, [2])
    # Tilt of joint 1's bearing moves the tool point's height in the same way.
    assert code in ("base-tilt", "joint-tilt:j1")
    assert left < 1e-6 * make(spec, 2).key["excess_chi2"]
    for kind in outside.KINDS:
        key = make(SetSpec(effects=(kind,)), 2).key
        assert key["best_imitation"]["excess_chi2_left"] > 0.05 * key["excess_chi2"], kind


@pytest.mark.slow
@pytest.mark.parametrize("links", ["rigid", "beam"])
def test_nuisance_alone_stays_far_below_detectable_in_z(links: str) -> None:
    worst = max(make(SetSpec(links=links), s).key["excess_chi2_nuisance_alone_z"] for s in range(4))
    assert 0.1 < worst < 20


# Promises of the sets.


def test_same_seed_same_set_and_noise_apart_from_truth() -> None:
    spec = SetSpec(effects=("friction:j2",), poses=9)
    first, again = make(spec, 3), make(spec, 3)
    assert first.csv_text == again.csv_text
    assert first.key == again.key
    assert make(spec, 4).csv_text != first.csv_text
    louder = make(dataclasses.replace(spec, noise_share=0.1), 3)
    assert louder.key["truth"] == first.key["truth"]
    assert louder.key["springs_Nm_per_rad"] == first.key["springs_Nm_per_rad"]


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_every_code_makes_a_set_with_its_truth_in_the_key(robot: str) -> None:
    for code in [*codes(robot), *outside.KINDS]:
        links = "beam" if code.startswith("link-") else "rigid"
        made = make(SetSpec(robot=robot, effects=(code,), links=links, poses=6, repeats=1), 2)
        assert made.key["truth"][0]["code"] == code
        assert np.isfinite([float(row["dz_mm"]) for row in rows_of(made.csv_text)]).all()
        json.dumps(made.key, allow_nan=False)


def test_the_table_tells_nothing_but_readings() -> None:
    made = make(SetSpec(effects=("payload",), name="hush", reads="xyz", poses=2), 0)
    names = made.csv_text.splitlines()[0].split(",")
    joints = ["q1_deg", "q2_deg", "q3real_deg", "q4_deg", "q5_deg", "q6_deg"]
    readings = ["fx_N", "fy_N", "fz_N", "dx_mm", "dy_mm", "dz_mm"]
    assert names == ["pose", "step", "repeat", "phase", *joints, *readings]
    for text in (made.csv_text, made.model_toml):
        assert not re.search("payload_off|off-centre|weight_N|hush|excess|truth", text)
    words = set(re.findall(r"[a-z]+", "\n".join(made.csv_text.splitlines()[1:])))
    assert words == {"loading", "unloading"}


def test_poses_lie_within_what_the_robot_reaches(rng: np.random.Generator) -> None:
    for robot in ROBOTS:
        q = poses(arm(robot), 40, rng)
        assert allowed(arm(robot), q).all()
        # Space-filling: each joint's sample covers most of its range.
        assert (np.ptp(q, axis=0) > 0.5 * np.diff(arm(robot).limits, axis=1)[:, 0]).all()


def test_model_lacks_what_the_set_hides() -> None:
    data = tomllib.loads(make(SetSpec(effects=("joint-compliance:j5",), poses=2), 0).model_toml)
    assert [j["name"] for j in data["joint"] if "stiffness" in j] == ["j2", "j3", "j4"]
    for path, model, truth in (("own", "parallelogram", "serial"), ("other", "serial", "parallelogram")):
        made = make(SetSpec(effects=("load-path",), model_path=path, poses=9), 0)
        assert tomllib.loads(made.model_toml)["load_path"] == model
        assert made.key["truth"][0]["law"] == truth
        assert made.key["excess_chi2"] > 10


def test_a_sheet_is_filled_with_the_same_truth() -> None:
    spec = SetSpec(effects=("friction:j3",), poses=3, **CLEAN)
    made = make(spec, 5)
    rows = rows_of(made.csv_text)
    sheet = "\n".join(",".join(line.split(",")[:-1]) for line in made.csv_text.splitlines()) + "\n"
    filled = rows_of(more(spec, 5, sheet))
    assert [r["dz_mm"] for r in filled] == [r["dz_mm"] for r in rows]
    # Rows in any order are taken by `step`, and come back where they stood.
    lines = sheet.splitlines()
    mixed = rows_of(more(spec, 5, "\n".join([lines[0], *reversed(lines[1:])])))
    assert [r["dz_mm"] for r in reversed(mixed)] == [r["dz_mm"] for r in rows]
    d = truth_at(spec, 5, sheet)
    np.testing.assert_allclose(1e3 * d[:, 2], [float(r["dz_mm"]) for r in rows], atol=6e-4)  # printed digits


def test_extra_readings_have_fresh_noise_and_a_later_clock() -> None:
    spec = SetSpec(effects=("drift",), poses=3)
    sheet = "q2_deg,q3real_deg,fz_N\n10,80,-650\n10,80,-650\n20,90,-375\n"
    assert more(spec, 5, sheet, salt=1) == more(spec, 5, sheet, salt=1)
    assert more(spec, 5, sheet, salt=1) != more(spec, 5, sheet, salt=2)
    _, order, extra = from_sheet(arm("xr701"), sheet, 3, max(LOADS["xr701"]))
    assert order == [0, 1, 2]
    assert extra.setup.tolist() == [3, 3, 4]
    assert (extra.clock > 1).all()


def test_a_sheet_asks_for_the_axes_it_has_columns_for_and_for_forces_only() -> None:
    spec = SetSpec(poses=3)
    filled = rows_of(more(spec, 5, "pose,q2_deg,fz_N,mx_Nm,dx_mm,dz_mm,note\nN1,10,-650,0,,,by crane\n"))
    assert filled[0]["note"] == "by crane"
    assert float(filled[0]["dz_mm"]) < 0
    assert filled[0]["dx_mm"]
    assert "dy_mm" not in filled[0]
    with pytest.raises(ValueError, match="mx_Nm"):
        more(spec, 5, "q2_deg,fz_N,mx_Nm\n10,-650,5\n")


def test_unloading_alone_comes_down_from_the_largest_load() -> None:
    spec = SetSpec(effects=("friction:j3",), poses=3, **CLEAN)
    head = "q2_deg,q3real_deg,phase,fz_N\n"
    whole = truth_at(spec, 5, head + "10,80,loading,-650\n10,80,unloading,-375\n")
    alone = truth_at(spec, 5, head + "10,80,unloading,-375\n")
    np.testing.assert_allclose(alone[0], whole[1], rtol=1e-12)


def test_study_is_balanced_and_pairs_are_detectable() -> None:
    chosen = suite(46, 6, 12, 2, seed=1)
    groups = [spec.group for spec, _ in chosen]
    assert [groups.count(g) for g in ("single", "none", "outside", "pair")] == [46, 6, 12, 2]
    kinds = [spec.effects[0].split(":")[0] for spec, _ in chosen if spec.group == "single"]
    assert {kinds.count(k) for k in kinds} == {2}
    for spec, seed in chosen[-2:]:
        assert min(make(spec, seed).key["excess_chi2_each"].values()) >= 30
    assert suite(5, 1, 1, 0, seed=1)[0] == suite(5, 1, 1, 0, seed=1)[0]
