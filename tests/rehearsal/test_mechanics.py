"""The generator's mechanics against closed forms and free bodies, and (slow) against the command line's own."""

from __future__ import annotations

import dataclasses
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from blind.design import campaign, poses
from blind.model_files import arm
from blind.sets import hidden, make
from blind.spec import SetSpec

from rehearsal import laws, nuisance
from rehearsal.arm import Section
from rehearsal.evaluate import Truth, exact
from rehearsal.kinematics import frames
from rehearsal.links import beam, link_compliances
from rehearsal.statics import bar_row, transfer

ROOT = Path(__file__).resolve().parents[2]
ROBOTS = ("xr701", "kr60-3")
CLEAN = {"noise_share": 0.0, "floor_um": 0.0, "resolution_um": 0.0, "setup_scatter": 0.0, "nuisance": False}


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
    theirs = np.array([[row[f"d{axis}_simulated_mm"] for axis in "xyz"] for row in json.loads(done.stdout)["readings"]])
    ours = 1e3 * exact(truth, r)
    if links == "rigid":
        # The command prints six digits: the same ones, but for a few that fall on the edge between two.
        printed = np.vectorize(lambda v: float(f"{v:.6g}"))(ours)
        assert np.mean(np.abs(theirs - printed) <= 1e-12) > 0.97
        np.testing.assert_allclose(theirs, ours, rtol=6e-6, atol=1e-8)
    else:
        # Shear areas and the elbow's node differ by percents of the links, which are a tenth of the whole.
        gap = np.linalg.norm(theirs - ours, axis=1) / np.linalg.norm(ours, axis=1)
        assert gap.max() < 0.01
