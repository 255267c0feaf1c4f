"""The command `index`: its figures are the model's, its files can be read, bad input is named."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command

import fem
from machining import INDICES, evaluate, translational
from robots import load_description
from stiffarm.commands.index.figures import MOST_POSES, ellipsoid_figure
from stiffarm.path_request import GAMMA
from stiffarm.request import FRAME
from stiffarm.session.parsing import frame_words
from stiffarm.session.task_options import gammas_of

POSE = "q1_deg=10,q2_deg=-60,q3_deg=40,q5_deg=40"
TOOL = "80,0,200,0,90,0"


def test_every_index_is_the_models(cli: Command) -> None:
    outcome = cli(
        "index",
        "kr60-3",
        "--links",
        "rigid",
        "--pose",
        POSE,
        "--tool",
        TOOL,
        "--force",
        "200,100,-50",
        "--normal",
        "0,3,4",
        "--json",
    )
    assert outcome.code == 0, outcome.err
    model = fem.build_model(load_description("kr60-3"), links="rigid")
    q = np.radians([[10.0, -60.0, 40.0, 0.0, 40.0, 0.0]])
    C = translational(model, q, np.array([0.08, 0.0, 0.2]))
    found = outcome.json["poses"][0]
    for name, index in INDICES.items():
        expected = float(evaluate(name, C, [0.0, 0.6, 0.8], [200.0, 100.0, -50.0])[0])
        key = name if index.degree == 0 else f"{name}_N_per_mm"
        # Six digits are printed.
        assert found[key] == pytest.approx(expected * (1e-3 if index.degree else 1.0), rel=1e-5), name
    axis = outcome.json["axes"][0]
    assert axis["stiffness_N_per_mm"] == found["weakest_N_per_mm"]
    assert np.linalg.norm([axis[name] for name in "xyz"]) == pytest.approx(1.0, abs=1e-5)


def test_without_a_force_its_indices_are_left_out_and_said(cli: Command) -> None:
    outcome = cli("index", "kr60-3", "--pose", POSE, "--json")
    assert outcome.json["not_computed"] == {"nspi": "needs a force", "rayleigh": "needs a force"}
    assert "nspi_N_per_mm" not in outcome.json["poses"][0]
    assert "needs --force" in cli("index", "kr60-3", "--pose", POSE).err


def test_a_load_changes_the_indices_as_the_model_says(cli: Command) -> None:
    outcome = cli("index", "kr60-3", "--links", "rigid", "--pose", POSE, "--load", "fx_N=-5000", "--json")
    found = outcome.json["poses"][0]
    model = fem.build_model(load_description("kr60-3"), links="rigid")
    q = np.radians([[10.0, -60.0, 40.0, 0.0, 40.0, 0.0]])
    tip = model.robot.T_flange_tool[:3, 3]
    plain, loaded = (
        float(evaluate("k_fs", translational(model, q, tip, w), [0.0, 0.0, 1.0])[0]) * 1e-3
        for w in (None, [-5000.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    )
    assert found["k_fs_N_per_mm"] == pytest.approx(loaded, rel=1e-5)
    assert abs(loaded / plain - 1.0) > 1e-3
    assert 0.0 < found["stiffness_share_taken_by_load"] < 0.2


@pytest.mark.slow
def test_files_hold_all_poses_of_a_table(cli: Command, tmp_path: Path) -> None:
    table = tmp_path / "poses.csv"
    table.write_text("pose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\na,10,-60,40,0,40,0\nb,0,-70,60,10,50,0\n")
    outcome = cli("index", "kr60-3", table, "--out", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    with (tmp_path / "out" / "index.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    content = json.loads((tmp_path / "out" / "index.json").read_text(encoding="utf-8"))
    assert [row["pose"] for row in rows] == ["a", "b"]
    assert float(rows[1]["k_fs_N_per_mm"]) == content["poses"][1]["k_fs_N_per_mm"]
    assert float(rows[1]["q3_deg"]) == 60.0
    assert (tmp_path / "out" / "ellipsoid.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--pose", POSE, "--normal", "0,0,0"), "--normal"),
        (("--pose", POSE, "--tool", "1,2"), "--tool"),
        (("--pose", POSE, "--force", "0,0,nan"), "--force"),
        (("--pose", "q2_deg=90"), "q2"),
        ((), "index needs poses"),
        (("--pose", POSE, "--load", "fz_N=-1e8"), "buckles"),
    ],
)
def test_bad_input_is_named(cli: Command, arguments: tuple[str, ...], words: str) -> None:
    outcome = cli("index", "kr60-3", *arguments)
    assert outcome.code == 2
    assert words in outcome.err.replace("\n", " ")


def test_frames_read_as_written() -> None:
    T = FRAME.of("10,20,30,90,0,90", "--tool")
    # About x by 90 deg, then about the fixed z by 90 deg: y -> z, and x -> y.
    np.testing.assert_allclose(T[:3, :3] @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(T[:3, :3] @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(T[:3, 3], [0.01, 0.02, 0.03])
    assert frame_words(T) == "10, 20, 30 mm; 90, 0, 90 deg"
    back = FRAME.of(frame_words(FRAME.of(TOOL, "--tool")).replace(" mm; ", ",").replace(" deg", ""), "--tool")
    np.testing.assert_allclose(back, FRAME.of(TOOL, "--tool"), atol=1e-9)


@pytest.mark.parametrize(("text", "count"), [("-180:180:5", 72), ("0:90:5", 19), ("0:10:10", 2)])
def test_ranges_of_gamma(text: str, count: int) -> None:
    gammas = gammas_of(GAMMA.read(text, "--gamma"))
    assert not isinstance(gammas, float)
    assert gammas.count == count


@pytest.mark.parametrize(
    "text", ["90:0:5", "0:400:5", "0:90:0", "0:90:-5", "0:90", "a:b:c", "0:90:inf", "0:10:20", "-180:180:0.1"]
)
def test_empty_ranges_of_gamma_are_refused(cli: Command, text: str, tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,1\n")
    outcome = cli("posture", "kr60-3", path, "--gamma", text)
    assert outcome.code == 2
    assert "--gamma" in outcome.err


def test_the_picture_refuses_more_poses_than_fit() -> None:
    from robots import InputError

    with pytest.raises(InputError, match="1 to 4"):
        ellipsoid_figure(np.stack([np.eye(3)] * (MOST_POSES + 1)), ["x"] * (MOST_POSES + 1), np.array([0.0, 0.0, 1.0]))


def test_with_links_that_give_way_the_papers_assumption_stands_beside(cli: Command) -> None:
    options = ("--pose", "q1_deg=10,q2_deg=-60,q3_deg=40,q5_deg=40", "--tool", "200,0,80,0,90,0", "--json")
    beam, rigid = (cli("index", "kr60-3", *options, "--links", links).json for links in ("beam", "rigid"))
    assert "rigid_links" not in rigid
    beside, beam, rigid = beam["rigid_links"][0], beam["poses"][0], rigid["poses"][0]
    assert beside.items() <= rigid.items()
    # As the documentation says: 364 and 385.5 N/mm.
    assert beam["k_fs_N_per_mm"] == pytest.approx(364.1, abs=0.05)
    assert rigid["k_fs_N_per_mm"] == pytest.approx(385.5, abs=0.05)
