"""`stiffarm readings`: layouts of instruments become tables that `calibrate` reads; nothing is written over unasked."""

from __future__ import annotations

from pathlib import Path

import pytest
from cli_runs import ROOT, Command, Outcome, tree

import stiffarm as sa
from doe.absolute.table import is_absolute, read_absolute
from doe.tables.reading import read_measurements
from robots import load_robot

HERE = ROOT / "docs" / "examples" / "readings"
ROBOT = load_robot("kr60-3")
# Each layout with the options that it needs, and the readings that come out.
LAYOUTS = {
    "leica": (("leica.csv", "leica_angles.xlsx"), (), 20),
    "faro": (("faro.txt",), (), 20),
    "api": (("api.csv",), (), 36),
    "spatialanalyzer": (
        ("spatialanalyzer.txt", "spatialanalyzer_angles.txt"),
        ("--names", "collection,pose,target,x_mm,y_mm,z_mm"),
        24,
    ),
    "polyworks": (("polyworks.txt",), ("--axes", "base", "--sigma-mm", "0.01"), 10),
    "dial gauge": (("dial_gauge.xlsx",), (), 9),
}
KEPT = {
    "leica": ("temperature_C", "time_s"),
    "faro": ("operator", "instrument", "time_s"),
    "api": ("operator", "target"),
    "spatialanalyzer": ("target",),
    "polyworks": ("Comment",),
    "dial gauge": ("operator", "temperature_C"),
}


def run(cli: Command, name: str, *more: str | Path) -> Outcome:
    files, options, _ = LAYOUTS[name]
    return cli("readings", *(HERE / file for file in files), *options, *more)


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts_of_instruments_become_tables(cli: Command, tmp_path: Path, name: str) -> None:
    out = tmp_path / "table.csv"
    outcome = run(cli, name, "--model", "kr60-3", "--out", out, "--json")
    assert outcome.code == 0, outcome.err
    made = outcome.json
    assert made["readings"] == LAYOUTS[name][2]
    assert {*KEPT[name], "q1_deg", "q6_deg"} <= {one["column"] for one in made["written"]}
    header = out.read_text(encoding="utf-8").splitlines()[0].split(",")
    if made["kind"] == "positions":
        assert is_absolute(header)
        assert len(read_absolute(out, ROBOT)) == made["readings"]
    else:
        assert read_measurements(out, ROBOT).n == made["readings"]
    # The mapping that was written reads the same file without any option.
    mapped = "--mapping", made["mapping"], "--model", "kr60-3", "--out", tmp_path / "again.csv"
    again = cli("readings", *(HERE / file for file in LAYOUTS[name][0]), *mapped)
    assert again.code == 0, again.err
    assert (tmp_path / "again.csv").read_bytes() == out.read_bytes()


@pytest.mark.slow
def test_the_deflections_of_the_gauge_are_those_of_the_arm(cli: Command, tmp_path: Path) -> None:
    out = tmp_path / "table.csv"
    assert run(cli, "dial gauge", "--out", out).code == 0
    outcome = cli("calibrate", "kr60-3", out, "--scheme", "global", "--links", "rigid", "--json", "--joints", "j2,j3")
    assert outcome.code == 0, outcome.err
    # The gauge of the made-up sheet reads to 0.001 mm.
    assert outcome.json["rms_mm"] < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", ["faro", "api"])
def test_positions_are_calibrated_at_once(cli: Command, tmp_path: Path, name: str) -> None:
    out = tmp_path / "table.csv"
    assert run(cli, name, "--out", out).code == 0
    outcome = cli("calibrate", "kr60-3", out, "--free", "zeros", "--links", "rigid", "--json")
    assert outcome.code == 0, outcome.err
    # The made-up tracker scatters by 0.02 mm along each axis, 0.035 mm in space.
    assert outcome.json["after"]["rms_mm"] < 0.05


def test_nothing_is_written_over_unasked(cli: Command, tmp_path: Path) -> None:
    out = tmp_path / "table.csv"
    out.write_text("mine", encoding="utf-8")
    before = tree(tmp_path)
    assert run(cli, "faro", "--out", out).code == 2
    assert tree(tmp_path) == before
    outcome = run(cli, "faro", "--out", out, "--replace", "--json")
    assert outcome.code == 0
    previous = Path(outcome.json["previous"])
    assert (previous / "table.csv").read_text(encoding="utf-8") == "mine"
    assert out.read_text(encoding="utf-8").startswith("pose,")


def test_without_out_it_only_says_what_it_would_make(cli: Command, tmp_path: Path) -> None:
    before = tree(tmp_path)
    outcome = run(cli, "api")
    assert outcome.code == 0
    assert "payload_kg" in outcome.err
    assert tree(tmp_path) == before


REFUSED = (
    "--column x|--column =q1|--column a=z_kg|--fill a|--rows 8|--rows 9-8|--rows 0-3|--sigma-mm 0|--sigma-mm nan|"
    "--mapping nowhere.toml|--model nowhere|--encoding ebcdic|--separator dot|--decimal dot|--kind angles|--header 99|"
    "--target ball|--sheet a|--column nothing=keep|--column a=keep --column a=ignore|--out no.txt|--out nowhere/t.csv|"
    "--out .|--units mm,,deg|--names a,,b"
)


@pytest.mark.parametrize("options", REFUSED.split("|"))
def test_options_that_cannot_be_are_refused(cli: Command, tmp_path: Path, options: str) -> None:
    file = tmp_path / "f.csv"
    file.write_bytes((HERE / "faro.txt").read_bytes())
    before = tree(tmp_path)
    outcome = cli("readings", file, *options.split(), *([] if "--out" in options else ["--out", "t.csv"]))
    assert outcome.code == 2, outcome.err
    assert "To fix it" in outcome.err or "allowed" in outcome.err
    assert "Traceback" not in outcome.err
    assert tree(tmp_path) == before


@pytest.mark.parametrize("content", ["", "no table\n", "a,b\n1,2\n", "\x00\x01", "pose,dz\nA,1\nB,2\n"])
def test_files_that_are_no_readings_are_refused(cli: Command, tmp_path: Path, content: str) -> None:
    (tmp_path / "f.csv").write_text(content, encoding="utf-8")
    before = tree(tmp_path)
    assert cli("readings", "f.csv", "--out", "t.csv").code == 2
    assert tree(tmp_path) == before


def test_the_table_that_is_read_is_not_written_over(cli: Command, tmp_path: Path) -> None:
    file = tmp_path / "f.csv"
    file.write_bytes((HERE / "faro.txt").read_bytes())
    assert cli("readings", file, "--out", file, "--replace").code == 2
    assert file.read_bytes() == (HERE / "faro.txt").read_bytes()


def test_other_commands_name_it(cli: Command, tmp_path: Path) -> None:
    file = tmp_path / "f.csv"
    for content in (
        "q2_deg;fz_N;dz_mm\n5;-100;-0,2\n",
        "Achse 2;Last;Messuhr\n5;100;-2\n",
        "q2_deg;fz_N;dz_mm\n5;-100\n",
        "Pr\u00fcf;x\n1;2\n",
    ):
        file.write_bytes(content.encode("latin-1"))
        outcome = cli("calibrate", "xr701", file)
        assert outcome.code == 2
        assert "stiffarm readings" in outcome.err, content
    text = tmp_path / "f.txt"
    text.write_text("q2_deg|dz_mm\n1|2\n", encoding="utf-8")
    assert "stiffarm readings" in cli("calibrate", "xr701", text).err


def test_in_python(tmp_path: Path) -> None:
    made = sa.convert_readings(HERE / "polyworks.txt", axes="base", sigma_mm=0.01, arm=sa.load("kr60-3", links="rigid"))
    assert len(made) == 10
    assert made.kind == "deflections"
    assert made.meanings["Mass hung [kg]"] == "hung kg"
    frame = made.to_frame()
    assert frame["fz_N"].max() < 0.0
    assert len(sa.read_readings(frame, sa.load("kr60-3", links="rigid"))) == 10
    table = made.save(tmp_path / "t.csv")
    assert table.read_text(encoding="utf-8").startswith("pose,")
    assert (tmp_path / "t.mapping.toml").is_file()
    with pytest.raises(sa.InputError, match="exists"):
        made.save(table)
    with pytest.raises(sa.InputError, match="axes base"):
        sa.convert_readings(HERE / "polyworks.txt")
    again = sa.convert_readings(
        [HERE / "polyworks.txt"], mapping=tmp_path / "t.mapping.toml", columns={"Comment": "ignore"}
    )
    assert "Comment" not in again.to_frame()
    assert "10 readings" in str(made)
