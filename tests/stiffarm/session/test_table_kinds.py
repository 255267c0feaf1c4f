"""Tables meant for another command: recognised by their first line, and the command that takes them is named."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import pytest
from cli_runs import ROOT, run_here

from stiffarm.session import table_kinds as kinds
from stiffarm.session.table_kinds import kind_of

LOADS = "fz_N,dz_mm"
TABLES = {
    "deflections": (f"pose,q1_deg,q2_deg,{LOADS}\nA,0,10,-100,-0.2\n", kinds.DEFLECTIONS),
    "sheet": (f"pose;q2_deg;q3real_deg;{LOADS.replace(',', ';')}\nA;0;77;-100;\n", kinds.DEFLECTIONS),
    "twists": ("joint,phase,q1_deg,q2_deg,fz_N,rz_mrad\nj1,loading,0,10,-100,0.1\n", kinds.TWISTS),
    "reflectors": (
        "joint,phase,q1_deg,fz_N,reading,arm,reflector,x0_mm\nj1,loading,0,-100,1,before,a,0\n",
        kinds.TWISTS,
    ),
    "pendant": ("q1_deg,q2_deg,x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,10,900,0,1000,0,90,0\n", kinds.PENDANT),
    "dh": ("joint,alpha_deg,a_mm,d_mm,theta_deg,lower_deg,upper_deg\nj1,0,0,800,0,-180,180\n", kinds.DH),
    "poses": ("pose,q1_deg,q2_deg\nA,0,10\n", kinds.POSES),
    "path": ("x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,1\n10,0,0,0,0,1\n", kinds.PATH),
    "motions": ("# stiffarm motions 1\nx_mm\n", kinds.PATH),
    "program": ("# stiffarm-program/2\nline\n", kinds.PROGRAM),
    "other": ("a,b\n1,2\n", None),
}
# Each command with its place for a file, and kinds that it refuses with the name of the command that takes them.
COMMANDS = {
    "calibrate kr60-3 FILE": ("twists", "pendant", "dh", "path", "program"),
    "diagnose kr60-3 FILE --holdout FILE": ("twists", "pendant"),
    "rehearse kr60-3 FILE": ("twists", "pendant"),
    "simulate kr60-3 FILE": ("twists", "path"),
    "identify kr60-3 FILE": ("pendant", "path"),
    "robots check kr60-3 FILE": ("twists", "deflections", "path"),
    "new arm --mdh FILE": ("pendant", "deflections"),
    "index kr60-3 FILE": ("path", "dh"),
    "posture kr60-3 FILE --gamma 0": ("deflections", "pendant", "poses"),
    "robots FILE": ("deflections", "twists", "dh"),
}
NAMED = {
    "deflections": "calibrate",
    "twists": "identify",
    "pendant": "robots check",
    "dh": "new",
    "path": "posture",
    "program": "verify",
    "poses": "index",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, (text, _) in TABLES.items():
        (tmp_path / f"{name}.csv").write_text(text, encoding="utf-8")
    return tmp_path


def test_kinds_by_the_first_line(folder: Path) -> None:
    found = {name: kind_of(folder / f"{name}.csv") for name in TABLES}
    assert found == {name: kind for name, (_, kind) in TABLES.items()}


def test_other_files(folder: Path) -> None:
    assert kind_of(ROOT / "robots" / "data" / "xr701.toml") is kinds.MODEL
    assert kind_of(ROOT / "doe" / "schemes" / "xr701.toml") is None
    (folder / "a.apt").write_text("GOTO/0,0,0\n")
    assert kind_of(folder / "a.apt") is kinds.PATH
    assert kind_of(folder / "nowhere.csv") is None
    (folder / "binary.csv").write_bytes(bytes(range(256)))
    assert kind_of(folder / "binary.csv") is None


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_names_the_one_that_takes_the_table(command: str, folder: Path) -> None:
    before = set(os.listdir(folder))
    for kind in COMMANDS[command]:
        file = folder / f"{kind}.csv"
        outcome = run_here(*shlex.split(command.replace("FILE", str(file))))
        assert outcome.code == 2, (kind, outcome.err)
        assert f"stiffarm {NAMED[kind]} " in outcome.err, (kind, outcome.err)
        assert len(outcome.err.strip().splitlines()) == 1
    assert set(os.listdir(folder)) == before


@pytest.mark.slow
def test_identify_names_what_calibrate_can_set_free() -> None:
    """The command line that it names runs: what is said to be told is told, and no more numbers than readings."""
    table = ROOT / "doe" / "data" / "xr701_gotlih.csv"
    outcome = run_here("identify", "xr701", table)
    assert outcome.code == 2
    line = outcome.err.split("`")[1]
    words = shlex.split(line)  # a folder whose name has a space in it is quoted
    assert words[:-1] == ["stiffarm", "calibrate", "MODEL", str(table), "--free"]
    again = run_here("calibrate", "xr701", *words[3:], "--links", "rigid", "--json")
    assert again.code == 0, again.err
    names = words[-1].split(",")
    assert 2 <= len(names) < 9
    assert set(names) <= {f"j{k}.{row}" for k in range(1, 7) for row in ("rx", "ry", "rz")}
