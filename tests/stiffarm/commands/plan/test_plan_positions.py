"""`plan --positions`: the answer, its table to fill in that calibrate reads, and bad input."""

from __future__ import annotations

from pathlib import Path

import pytest
from cli_runs import Outcome, run_here

from doe.absolute.table import read_absolute
from robots import load_robot

COMMON = ("--tracker", "3000,1000,1000", "--candidates", "60")
TARGETS = ("--target", "a:100,0,50", "--target", "b:-100,100,50,0,0,1")


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Outcome, Path]:
    out = tmp_path_factory.mktemp("plan") / "out"
    outcome = run_here("plan", "kr60-3", "--positions", "12", *COMMON, *TARGETS, "--out", out, "--json")
    assert outcome.code == 0, outcome.err
    return outcome, out


def test_what_the_poses_tell(planned: tuple[Outcome, Path]) -> None:
    c, out = planned[0].json, planned[1]
    assert c["poses"] == len(c["plan"]) == 12
    assert c["readings"] == sum(len(pose["targets"].split(", ")) for pose in c["plan"])
    assert c["narrower_than_random_poses"] > 1.0
    by_name = {one["name"]: one for one in c["parameters"]}
    assert by_name["j2.frame.x"]["sd"] < by_name["j2.frame.x"]["sd_before"]
    assert {"j1.zero", "j6.zero"} <= {one["name"] for one in c["not_separable_by_any_readings"]}
    assert (out / "report.html").is_file()


def test_the_filled_in_table_is_one_of_positions(planned: tuple[Outcome, Path], tmp_path: Path) -> None:
    head, *rows = (planned[1] / "positions_sheet.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == planned[0].json["readings"]
    file = tmp_path / "filled.csv"
    file.write_text("\n".join([head, *(row.replace(",,,", ",1.5,2.5,3.5") for row in rows)]) + "\n", encoding="utf-8")
    if rows[0].endswith(",,"):
        file.write_text("\n".join([head, *(row.removesuffix(",,") + "1.5,2.5,3.5" for row in rows)]), encoding="utf-8")
    data = read_absolute(file, load_robot("kr60-3"))
    assert len(data) == len(rows)
    assert set(data.target.names) <= {"a", "b"}


def test_lost_motion_asks_for_every_pose_from_either_side(tmp_path: Path) -> None:
    outcome = run_here(
        "plan",
        "kr60-3",
        "--positions",
        "12",
        *COMMON,
        *TARGETS,
        "--free",
        "geometry,reversal",
        "--out",
        tmp_path / "out",
        "--json",
    )
    assert outcome.code == 0, outcome.err
    first, second = outcome.json["plan"][0]["approaches"]
    assert first == second.translate(str.maketrans("+-", "-+"))
    head, *rows = (tmp_path / "out" / "positions_sheet.csv").read_text(encoding="utf-8").splitlines()
    assert "approach" in head.split(",")
    assert (
        len(rows)
        == outcome.json["readings"]
        == 2 * sum(len(pose["targets"].split(", ")) for pose in outcome.json["plan"])
    )
    filled = tmp_path / "filled.csv"
    filled.write_text("\n".join([head, *(row.removesuffix(",,") + "1.5,2.5,3.5" for row in rows)]), encoding="utf-8")
    data = read_absolute(filled, load_robot("kr60-3"))
    assert (data.approach.sum(axis=0) == 0.0).all()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--positions", "12", *TARGETS), "--tracker"),
        (("--positions", "12", *COMMON), "--target"),
        (("--positions", "12", *COMMON, "--target", "a"), "NAME:X,Y,Z"),
        (("--positions", "12", *COMMON, "--target", "a:1,2,3,0,0,0"), "direction"),
        (("--positions", "12", *COMMON, *TARGETS, "--target", "a:1,2,3"), "each name once"),
        (("--positions", "12", "--tracker", "near", *TARGETS), "--tracker"),
        (("--positions", "12", *COMMON, *TARGETS, "--payload", "x"), "KG,X,Y,Z"),
        (("--positions", "12", *COMMON, *TARGETS, "--loads", "100"), "--loads"),
        (("--positions", "12", "--poses", "3", *COMMON, *TARGETS), "--positions"),
        (("--poses", "3", "--tracker", "1,2,3"), "only with --positions"),
        (("--positions", "12", *COMMON, *TARGETS, "--free", "periodic"), "periodic"),
    ],
)
def test_bad_input_is_one_message(tmp_path: Path, more: tuple[str, ...], words: str) -> None:
    outcome = run_here("plan", "kr60-3", *more, "--out", tmp_path / "out")
    assert outcome.code == 2
    assert words in outcome.err
    assert not (tmp_path / "out").exists()
