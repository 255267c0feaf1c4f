"""`stiffarm export`: what it writes, what it says, what it refuses."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command, Outcome, run_here

from fem import build_model, deflection
from robots import content_hash, load_description, save_description
from robots.schema.description import Calibration
from stiffarm import __version__

POSE = "q1_deg=20,q2_deg=30,q3_deg=60,q5_deg=45"
POSE_DEG = [20.0, 30.0, 60.0, 0.0, 45.0, 0.0]
LOAD = "fz_N=-400,fx_N=100,my_Nm=20"
WRENCH = [100.0, 0.0, -400.0, 0.0, 20.0, 0.0]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Outcome, Path]:
    folder = tmp_path_factory.mktemp("export") / "out"
    outcome = run_here("export", "tx200", "--pose", POSE, "--load", LOAD, "--out", folder, "--json")
    assert outcome.code == 0, outcome.err
    return outcome, folder


def test_it_writes_the_input_and_what_it_is(exported: tuple[Outcome, Path]) -> None:
    outcome, folder = exported
    content = json.loads((folder / "export.json").read_text(encoding="utf-8"))
    assert outcome.json == content
    assert {p.name for p in folder.iterdir()} == {"arm.inp", "export.json", "run.json"}
    run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    assert run["inputs_sha256"] == {"model": content["model_sha256"]}
    assert content["pose_deg"] == dict(zip(content["pose_deg"], POSE_DEG, strict=True))
    assert content["load"]["fz_N"] == -400.0
    assert content["joints_without_spring"] == ["j1", "j2", "j3", "j4", "j5", "j6"]
    text = (folder / "arm.inp").read_text(encoding="ascii")
    assert text.count("\n*STEP\n") == 1
    assert f"** TOOL: node {content['tool_node']}: " in text
    for name in content["sets"]:
        assert f"SET={name}\n" in text or f"SET={name}," in text
        assert f"** {name}: " in text


def test_our_own_solution_stands_beside_it(exported: tuple[Outcome, Path]) -> None:
    outcome, folder = exported
    model = build_model(load_description("tx200"), links="shell")
    d = 1e3 * deflection(model, np.radians([POSE_DEG]), np.array(WRENCH))[0]
    # Six digits are written.
    assert list(outcome.json["stiffarm"].values()) == pytest.approx(d.tolist(), rel=1e-5)
    header = (folder / "arm.inp").read_text(encoding="ascii").split("*NODE")[0]
    assert all(set(kinds.values()) == {"rigid"} for kinds in outcome.json["flanges"].values())
    (line,) = [line for line in header.splitlines() if line.startswith("** displacement (mm):")]
    assert [float(v) for v in line.split(":")[1].split()] == pytest.approx(d[:3].tolist(), rel=1e-5)


@pytest.mark.slow
def test_flanges_by_choice(cli: Command) -> None:
    outcome = cli("export", "tx200", "--pose", POSE, "--links", "shell:distributing", "--out", "out", "--json")
    assert outcome.code == 0, outcome.err
    assert all(set(kinds.values()) == {"distributing"} for kinds in outcome.json["flanges"].values())
    assert "RIGID BODY" not in Path("out/arm.inp").read_text(encoding="ascii")


def test_the_header_tells_model_pose_units_and_load(exported: tuple[Outcome, Path]) -> None:
    outcome, folder = exported
    header = (folder / "arm.inp").read_text(encoding="ascii").split("*NODE")[0]
    said = header.replace("\n** ", " ")
    for words in (
        f"stiffarm {__version__}: tx200",
        f"model sha256 {outcome.json['model_sha256']}",
        "q1_deg = 20, q2_deg = 30, q3_deg = 60, q4_deg = 0, q5_deg = 45, q6_deg = 0",
        "Units: mm, N, MPa, rad",
        "force (100, 0, -400) N, moment (0, 20, 0) N m",
        "no spring is given for j1, j2, j3, j4, j5, j6",
    ):
        assert words in said
    assert outcome.json["model_sha256"] == content_hash(load_description("tx200"))


def test_the_same_command_writes_the_same_file(exported: tuple[Outcome, Path], tmp_path: Path) -> None:
    _, folder = exported
    again = tmp_path / "again"
    assert run_here("export", "tx200", "--pose", POSE, "--load", LOAD, "--out", again).code == 0
    digests = [hashlib.sha256((place / "arm.inp").read_bytes()).hexdigest() for place in (folder, again)]
    assert digests[0] == digests[1]


def test_people_are_told_how_to_go_on(exported: tuple[Outcome, Path]) -> None:
    err = exported[0].err
    assert "shell models of 5 links" in err
    assert "writing 5 links" in err
    assert "ccx arm" in err
    assert "dz_mm = " in err
    assert "note: no spring is given" in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--pose", POSE, "--links", "beam"], "shell"),
        (["--pose", POSE, "--links", "rigid"], "shell"),
        (["--pose", POSE, "--links", "shell:soft"], "shell:distributing"),
        ([], "exactly one"),
        (["--pose", POSE, "--pose", "q2_deg=1"], "exactly one"),
        (["--pose", "q2_deg=500"], "-120 to 120"),
        (["--pose", "q9_deg=0"], "q1_deg"),
        (["--pose", POSE, "--load", "fz_N=0"], "not zero"),
        (["--pose", POSE, "--load-path", "parallelogram"], "no parallelogram"),
    ],
)
def test_bad_input_ends_with_2_and_leaves_nothing(
    cli: Command, tmp_path: Path, arguments: list[str], words: str
) -> None:
    outcome = cli("export", "tx200", *arguments, "--out", "out")
    assert outcome.code == 2
    assert words in outcome.err
    assert "Traceback" not in outcome.err
    assert not (tmp_path / "out").exists()


def test_springs_calibrated_with_other_links_are_noted(cli: Command, tmp_path: Path) -> None:
    origin = Calibration(
        scheme="global", load_path="serial", links="beam", data="d.csv", data_sha256="0", rms_mm=0.1, loads_N=(100.0,)
    )
    description = load_description("tx200").model_copy(update={"calibration": origin})
    save_description(description, tmp_path / "model.toml")
    outcome = cli("export", tmp_path / "model.toml", "--pose", POSE, "--out", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    assert "calibrated with beam links" in outcome.err
    text = (tmp_path / "out" / "arm.inp").read_text(encoding="ascii")
    assert "** note: the springs were calibrated with beam links" in text


def test_a_hostile_title_stays_a_comment(cli: Command, tmp_path: Path) -> None:
    description = load_description("tx200").model_copy(update={"title": "x\n*STEP\n*INCLUDE,INPUT=/etc/passwd\nöl"})
    save_description(description, tmp_path / "model.toml")
    assert cli("export", tmp_path / "model.toml", "--pose", POSE, "--out", tmp_path / "out").code == 0
    text = (tmp_path / "out" / "arm.inp").read_text(encoding="ascii")
    assert not any(line.startswith("*INCLUDE") for line in text.splitlines())
