"""The generator against closed forms and free bodies, its promises, and (slow) the command line's own mechanics."""

from __future__ import annotations

import ast
import csv
import dataclasses
import io
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from . import laws, nuisance, outside
from .arm import Section, arm
from .design import campaign, poses
from .effects import codes
from .evaluate import Truth, exact
from .kinematics import allowed, frames
from .links import beam, link_compliances, transfer
from .noise import Noise
from .sets import hidden, make, more, truth_at
from .spec import SetSpec
from .statics import bar_row
from .study import suite
from .table import from_sheet

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
ROBOTS = ("xr701", "kr60-3")
CLEAN = {"noise_share": 0.0, "floor_um": 0.0, "resolution_um": 0.0, "setup_scatter": 0.0, "nuisance": False}


def rows_of(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def truth_with(robot: str, compliance: list[float], *effects: dict) -> Truth:
    a = arm(robot)
    return Truth(a, np.array(compliance), "rigid", nuisance.nothing(a), effects, 0)


# Closed forms. Tolerances are round-off of a few hundred operations.


def test_parallelogram_springs_have_the_levers_of_the_closed_form(rng: np.random.Generator) -> None:
    r = campaign(arm("xr701"), SetSpec(poses=5, repeats=1), rng)
    q2, forearm = r.q[:, 1], r.q[:, 1] + np.pi - r.q[:, 2]
    dz = exact(truth_with("xr701", [0, 1e-6, 0, 0, 0, 0]), r)[:, 2]
    np.testing.assert_allclose(dz, r.force[:, 2] * 1e-6 * (1.10 * np.sin(q2)) ** 2, rtol=1e-11)
    # Joint 3 at straight wrist, q4 = 0: the lever is the forearm's and the wrist's length, both along the forearm.
    straight = dataclasses.replace(r, q=r.q * [1, 1, 1, 0, 0, 1])
    dz = exact(truth_with("xr701", [0, 0, 1e-6, 0, 0, 0]), straight)[:, 2]
    np.testing.assert_allclose(dz, r.force[:, 2] * 1e-6 * (1.55 * np.sin(forearm)) ** 2, rtol=1e-11)


def test_serial_spring_has_the_lever_from_its_axis_to_the_load(rng: np.random.Generator) -> None:
    r = campaign(arm("kr60-3"), SetSpec(robot="kr60-3", poses=5, repeats=1), rng)
    at = frames(arm("kr60-3"), r.q)
    # Joint 2 sits 0.35 m from joint 1's axis, in the arm's plane.
    out = np.stack([np.cos(r.q[:, 0]), np.sin(r.q[:, 0])], 1)
    lever = np.einsum("ni,ni->n", out, at.tool[:, :2]) - 0.35
    dz = exact(truth_with("kr60-3", [0, 1e-6, 0, 0, 0, 0]), r)[:, 2]
    np.testing.assert_allclose(dz, r.force[:, 2] * 1e-6 * lever**2, rtol=1e-10)


def test_reach_is_the_published_one() -> None:
    upright = frames(arm("kr60-3"), np.radians([[0, -90, 0, 0, 0, 0]]))
    np.testing.assert_allclose(upright.tool[0], [0.35 + 0.820 + 0.170, 0, 0.815 + 0.850 + 0.145], atol=1e-12)
    pose = frames(arm("xr701"), np.radians([[0, 0, 90, 0, 0, 0]]))
    np.testing.assert_allclose(pose.tool[0], [0.35 + 1.25 + 0.30, 0, 0.80 + 1.10], atol=1e-12)


def test_cantilever_bends_and_shears_as_timoshenko_says() -> None:
    box = Section("box", 0.2, 0.3, 0.01)
    points = np.array([[[0, 0, 0], [1.5, 0, 0.0]]])
    C = beam(points, np.array([[0, 0, 1.0]]), (box, box), (2e11, 0.3), np.eye(6)[None])
    inertia, G = (0.2 * 0.3**3 - 0.18 * 0.28**3) / 12, 2e11 / 2.6
    assert C[0, 0, 2, 2] == pytest.approx(1.5**3 / (3 * 2e11 * inertia), rel=1e-12)
    assert C[1, 0, 2, 2] == pytest.approx(1.5 / (G * 2 * 0.01 * 0.29), rel=1e-12)
    assert C[0, 0, 4, 2] == pytest.approx(-(1.5**2) / (2 * 2e11 * inertia), rel=1e-12)


def test_bar_force_balances_the_forearm_about_the_elbow(rng: np.random.Generator) -> None:
    a = arm("xr701")
    at = frames(a, poses(a, 4, rng))
    w = rng.normal(size=(4, 6))
    elbow, pin = at.origins[:, 3], at.origins[:, 3] + at.rotations[:, 3] @ a.bar.pin
    along = (elbow - at.origins[:, 2]) / 1.10
    pull = -along * np.einsum("ni,ni->n", bar_row(a, at), w)[:, None]
    moment = np.einsum("nij,nj->ni", transfer(elbow, at.tool), w)[:, 3:] + np.cross(pin - elbow, pull)
    np.testing.assert_allclose(np.einsum("ni,ni->n", moment, at.axes[:, 2]), 0, atol=1e-12)


@pytest.mark.parametrize("robot", ROBOTS)
def test_link_compliance_is_symmetric_and_never_negative(robot: str, rng: np.random.Generator) -> None:
    at = frames(arm(robot), poses(arm(robot), 3, rng))
    for C in link_compliances(arm(robot), at).values():
        total = C.sum(0)
        np.testing.assert_allclose(total, np.swapaxes(total, 1, 2), atol=1e-14 * np.abs(total).max())
        assert np.linalg.eigvalsh(total).min() > -1e-12 * np.abs(total).max()


# Laws and histories.


def test_play_follows_up_and_down_at_its_slip_torque() -> None:
    tau = np.array([[0, 50, 200, 300, 250, 120, 0.0]])
    theta = laws.play(tau, np.array([[1e-6]]), {"slip_Nm": [100], "weights": [1], "stuck_share": 0})
    np.testing.assert_allclose(theta[0] * 1e6, [0, 0, 100, 200, 200, 200, 100], atol=1e-9)


def test_jenkins_and_bouc_wen_return_above_their_way_out_and_end_parallel_to_the_spring() -> None:
    tau = np.array([[0, 300, 600, 900, 600, 300.0]])
    c = np.array([[1e-6]])
    for law, p in (
        (laws.play, {"slip_Nm": [40, 100, 160], "weights": [0.3, 0.4, 0.3], "stuck_share": 0.1}),
        (laws.bouc_wen, {"slip_Nm": 100, "stuck_ratio": 8, "n": 1.6, "b": 0.7}),
    ):
        theta = law(tau, c, p)[0] * 1e6
        # With 100 N m of friction the loop is nearly 200 N m wide (less what had not slipped yet).
        assert 120 < theta[4] - theta[2] <= 200 * 1.001
        assert theta[3] - theta[2] == pytest.approx(300, rel=0.02)


def test_gap_closes_at_its_torque_and_a_preload_shifts_it() -> None:
    p = {"gap_rad": 5e-4, "closing_Nm": 10.0, "preload_Nm": 0.0}
    theta = laws.gap(np.array([[-20.0, 5, 20]]), np.array([[0.0]]), p)
    np.testing.assert_allclose(theta[0], [-5e-4, 2.5e-4, 5e-4])
    theta = laws.gap(np.array([[-20.0, 20]]), np.array([[0.0]]), p | {"preload_Nm": 10.0})
    np.testing.assert_allclose(theta[0], [-1e-3, 0])


def test_slopes_have_kinks_where_they_say() -> None:
    p = {"factors": [1, 0.5, 0.25], "breaks_Nm": [10, 20]}
    theta = laws.slopes(np.array([[10.0, -20, 40]]), np.array([[1.0]]), p)
    np.testing.assert_allclose(theta[0], [10, -15, 20])


def test_only_friction_reads_otherwise_when_coming_down() -> None:
    for code, loop in (("friction:j3", True), ("hardening:j3", False), ("payload", False)):
        truth, r, _ = hidden(SetSpec(effects=(code,)), 4)
        d = exact(truth, r)[:, 2].reshape(-1, 6)
        assert bool(np.abs(d[:, 4] - d[:, 1]).max() > 1e-6) is loop


def test_friction_of_a_cycle_does_not_pass_to_the_next() -> None:
    truth, r, _ = hidden(SetSpec(effects=("friction:j3",)), 4)
    d = exact(truth, r)[:, 2].reshape(27, 3, 6)
    np.testing.assert_array_equal(d[:, 0], d[:, 2])


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
    _, order, extra = from_sheet(arm("xr701"), sheet, 3)
    assert order == [0, 1, 2]
    assert extra.setup.tolist() == [3, 3, 4]
    assert (extra.clock > 1).all()


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


def test_no_code_is_shared_with_the_packages_under_test() -> None:
    theirs = {"robots", "meshes", "fem", "doe", "surrogate", "machining", "stiffarm"}
    for path in HERE.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                names = [str(node.module)]
            assert not theirs & {name.split(".")[0] for name in names}, path.name
            # One dot only: nothing beside this folder.
            assert not (isinstance(node, ast.ImportFrom) and node.level > 1), path.name


# The command line as the other witness.


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("links", ["rigid", "beam"])
def test_command_line_simulates_the_same(robot: str, links: str, tmp_path: Path) -> None:
    spec = SetSpec(robot=robot, links=links, reads="xyz", load_axes="xyz", poses=8, repeats=1, **CLEAN)
    made = make(spec, 7)
    truth, r, _ = hidden(spec, 7)
    text = made.model_toml
    blocks = re.split(r"(?m)^(?=\[\[joint\]\])", text)
    for k, block in enumerate(blocks):
        found = re.search(r'(?m)^name = "j(\d)"', block)
        if block.startswith("[[joint]]") and found and "stiffness" in block:
            value = float(1 / truth.compliance[int(found[1]) - 1])
            spring = f'stiffness = {{ value = {value!r}, unit = "N m/rad", source = "assumed" }}'
            blocks[k] = re.sub(r"(?m)^stiffness = .*$", spring, block)
    (tmp_path / "m.toml").write_text("".join(blocks), encoding="utf-8")
    (tmp_path / "d.csv").write_text(made.csv_text, encoding="utf-8")
    run = [sys.executable, "-m", "stiffarm", "simulate", str(tmp_path / "m.toml"), str(tmp_path / "d.csv"), "--json"]
    done = subprocess.run(  # noqa: S603 - our own interpreter with constant arguments
        [*run, "--links", links], cwd=ROOT, capture_output=True, encoding="utf-8", check=True, timeout=120
    )
    theirs = np.array([[row[f"d{axis}_mm_simulated"] for axis in "xyz"] for row in json.loads(done.stdout)["readings"]])
    ours = 1e3 * exact(truth, r)
    scale = np.linalg.norm(ours, axis=1, keepdims=True)
    # Rigid: six printed digits. Beam: shear areas differ, the links are a tenth of the whole.
    assert np.abs((theirs - ours) / scale).max() < (2e-6 if links == "rigid" else 0.01)
