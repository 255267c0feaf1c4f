"""The command `verify`: exit codes, files, words; programs are read from both neutral formats."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command, tree
from PIL import Image
from verify_cases import cell_file, program_at, program_file, verified

from machining.cell import arm_of
from machining.verification import verify
from stiffarm.commands.verify.picture import draw_offence
from stiffarm.commands.verify.words import sentence
from stiffarm.pages.style import save_png


def test_a_clean_program(cli: Command, tmp_path: Path) -> None:
    cell = cell_file(tmp_path)
    program = program_file(tmp_path, program_at(cell, 61, 0.15))
    before = tree(tmp_path)
    outcome = cli("verify", "kr60-3", program, "--cell", cell, "--json")
    assert outcome.code == 0, outcome.err
    content = outcome.json
    assert content["clean"] is True
    assert content["offences"] == []
    # The mill passes 20 mm over the clamp, 150 mm over its foot.
    assert content["least_distance_mm"] == pytest.approx(20.0, abs=0.2)
    assert set(content["least_distance_bodies"]) == {"mill", "clamp"}
    assert tree(tmp_path) == before


def test_a_joint_s_zero_error_moves_the_arm_closer(cli: Command, tmp_path: Path) -> None:
    cell = cell_file(tmp_path)
    program = program_file(tmp_path, program_at(cell, 11, 0.15))
    least = []
    for value in ("0", "0.3 deg"):
        outcome = cli("verify", "kr60-3", program, "--cell", cell, "--set", f"j2.zero={value}", "--json")
        least.append(outcome.json["least_distance_mm"])
    # Joint 2 turns about y, and the mill is about 1.2 m in front of it: 6 mm lower.
    assert least[0] - least[1] == pytest.approx(np.radians(0.3) * 1200.0, rel=0.2)
    outcome = cli("verify", "kr60-3", program, "--cell", cell, "--set", "j9.zero=1")
    assert outcome.code == 2
    assert "j9.zero" in outcome.err


@pytest.mark.slow
def test_a_collision_ends_with_1_and_its_line(cli: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The trial of OpenGL takes seconds; pictures with it are another test's.
    monkeypatch.setenv("STIFFARM_NO_GL", "1")
    cell = cell_file(tmp_path)
    program = program_file(tmp_path, program_at(cell, 61, 0.102))
    out = tmp_path / "out"
    outcome = cli("verify", "kr60-3", program, "--cell", cell, "--out", out)
    assert outcome.code == 1
    last = outcome.err.strip().splitlines()[-1]
    assert "must not run" in last
    assert "line 47" in last
    assert "collision" in last
    assert {p.name for p in out.iterdir()} == {
        "report.html",
        "replay.html",
        "verification.json",
        "verification.csv",
        "counts.csv",
        "nearest.csv",
        "axes.csv",
        "moves.csv",
        "run.json",
        "worst_offence.png",
        "clearance.png",
        "axis_speeds.png",
        "linearisation.png",
    }
    content = json.loads((out / "verification.json").read_text(encoding="utf-8"))
    (first, *_) = content["offences"]
    found = first["kind"], first["line"], first["body_1"], first["body_2"]
    assert found == ("collision", 47, "mill", "clamp")
    # The line of the program file: what stands there is the row of that move.
    row = program.read_text(encoding="utf-8").splitlines()[first["program_file_line"] - 1]
    assert json.loads(row.strip().rstrip(","))[0] == 47
    with (out / "verification.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == content["errors"] + content["warnings"]
    with (out / "moves.csv").open(encoding="utf-8") as stream:
        moves = list(csv.DictReader(stream))
    assert len(moves) == 61
    overlaps = [int(row["line"]) for row in moves if row["overlap"] == "1"]
    assert overlaps[0] == 47
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "may this program run?" in page
    assert "line 47" in page
    assert "plate &lt;b&gt;.nc" in page
    assert "<b>.nc" not in page
    assert not re.search(r'(src|href)="http', page)


def test_csv_and_json_say_the_same(cli: Command, tmp_path: Path) -> None:
    cell = cell_file(tmp_path)
    given = program_at(cell, 31, 0.102)
    said = {}
    for kind in ("json", "csv"):
        file = program_file(tmp_path, given, kind)
        outcome = cli("verify", "kr60-3", file, "--cell", cell, "--json", "--tolerance", "1")
        assert outcome.code == 1
        said[kind] = outcome.json
    row = program_file(tmp_path, given, "csv").read_text().splitlines()
    assert row[said["csv"]["offences"][0]["program_file_line"] - 1].startswith(f"{said['csv']['offences'][0]['line']},")
    for content in said.values():
        content.pop("source")
        content.pop("answer")
        for offence in content["offences"]:
            offence.pop("program_file_line")
            offence.pop("words")
    assert said["json"] == said["csv"]


@pytest.mark.slow
def test_options_change_the_demands(cli: Command, tmp_path: Path) -> None:
    cell = cell_file(tmp_path)
    program = program_file(tmp_path, program_at(cell, 61, 0.15))
    near = cli("verify", "kr60-3", program, "--cell", cell, "--json", "--safety", "25")
    assert near.code == 1
    assert {o["kind"] for o in near.json["offences"]} == {"clearance below the safety distance"}
    exact = cli("verify", "kr60-3", program, "--cell", cell, "--json", "--tolerance", "0.0001")
    assert {o["kind"] for o in exact.json["offences"]} == {"deviation from the path"}
    straight = cli(
        "verify", "kr60-3", program, "--cell", cell, "--json", "--tolerance", "0.0001", "--interpolation", "linear"
    )
    assert straight.code == 0, straight.err
    far = cli("verify", "kr60-3", program, "--cell", cell, "--json", "--singular", "0.99")
    assert {o["kind"] for o in far.json["offences"]} == {"singularity"}


def test_what_was_not_looked_at_is_said(cli: Command, tmp_path: Path) -> None:
    cell = cell_file(tmp_path)
    text = cell.read_text(encoding="utf-8")
    cell.write_text(re.sub(r"joint_\w+ = .*\n", "", text), encoding="utf-8")
    program = program_file(tmp_path, program_at(cell, 31, 0.15))
    outcome = cli("verify", "kr60-3", program, "--cell", cell, "--tolerance", "1")
    assert outcome.code == 0, outcome.err
    assert "not checked: Speeds of q1" in outcome.err
    assert "not checked: Accelerations of q1" in outcome.err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"program": "program.txt"}, "allowed: .csv or .json"),
        ({"--interpolation": "cubic"}, "joint, linear, mixed"),
        ({"--resolution": "0"}, "resolution"),
        ({"model": "xr701"}, "robot"),
        ({"--cell": "missing.toml"}, "missing.toml"),
    ],
)
def test_bad_input(cli: Command, tmp_path: Path, change: dict[str, str], words: str) -> None:
    cell = cell_file(tmp_path)
    program = program_file(tmp_path, program_at(cell, 5, 0.15))
    (tmp_path / "program.txt").write_text("DEF A()\nEND\n", encoding="utf-8")
    given: dict[str, str | Path] = {"model": "kr60-3", "program": program, "--cell": cell} | {
        k: tmp_path / v if k == "program" else v for k, v in change.items()
    }
    options = [text for k, v in given.items() if k.startswith("--") for text in (k, v)]
    outcome = cli("verify", given["model"], given["program"], *options)
    assert outcome.code == 2
    assert words in outcome.err
    assert "Traceback" not in outcome.err


@pytest.mark.slow
def test_the_picture_shows_the_pair_in_colour(tmp_path: Path) -> None:
    found = verified(tmp_path)
    path = tmp_path / "offence.png"
    save_png(draw_offence(found, found.errors[0], renderer="matplotlib"), path)
    pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)
    red, green, blue = np.moveaxis(pixels, 2, 0)
    # Vermillion: the mill, 8 mm of 550 mm wide; purple: the clamp. The squares of the legend have 400 pixels.
    assert ((red > 120) & (red > 1.8 * green) & (blue < 0.5 * green + 20)).sum() > 500
    assert ((red > 90) & (red > 1.3 * green) & (blue > 1.1 * green)).sum() > 1200


@pytest.mark.slow
def test_offences_without_bodies_are_drawn_at_the_tip(tmp_path: Path) -> None:
    found = verified(tmp_path, 5, 0.15)
    program = replace(found.program, q=found.program.q + np.radians([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
    moved = verify(program, arm_of("kr60-3"))
    assert moved.errors
    assert "the tip is elsewhere" in sentence(moved.errors[0])
    assert draw_offence(moved, moved.errors[0], renderer="matplotlib").axes


@pytest.mark.slow
def test_without_a_cell_the_frames_are_those_of_post(cli: Command, tmp_path: Path) -> None:
    rows = [f"{5 * i},0,0,0,0,1" for i in range(4)]
    (tmp_path / "line.csv").write_text("\n".join(["x_mm,y_mm,z_mm,nx,ny,nz", *rows]) + "\n", encoding="utf-8")
    frames = ("--tool", "200,0,80,0,90,0", "--part", "1200,200,600")
    made = cli(
        "post",
        "kr60-3",
        tmp_path / "line.csv",
        *frames,
        "--gamma",
        "-180:180:60",
        "--format",
        "json",
        "--out",
        tmp_path / "program",
    )
    assert made.code == 0, made.err
    (file,) = (tmp_path / "program" / "json").iterdir()
    assert cli("verify", "kr60-3", file, *frames).code == 0
    other = cli("verify", "kr60-3", file, "--tool", "210,0,80,0,90,0", "--part", "1200,200,600", "--json")
    assert other.code != 0
    both = cli("verify", "kr60-3", file, "--cell", tmp_path / "none.toml", "--tool", "1,2,3")
    assert (both.code, "one of the two" in both.err) == (2, True)
