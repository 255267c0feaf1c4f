"""Bad input: exit code 2, one message that says what, where, what is allowed and what to do; nothing written."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from cli_runs import ROOT, Command, run_apart, tree

DATA = (ROOT / "doe" / "data" / "xr701_gotlih.csv").read_text(encoding="utf-8")
SCHEME = (ROOT / "doe" / "schemes" / "xr701.toml").read_text(encoding="utf-8")
MODEL = (ROOT / "robots" / "data" / "xr701.toml").read_text(encoding="utf-8")
BINARY = bytes(range(256)) * 16
POSES = "pose,q2_deg,q3real_deg\nA,5,77.5\nB,10,80\n"


def data(old: str, new: str) -> str:
    assert old in DATA
    return DATA.replace(old, new)


def scheme(old: str, new: str) -> str:
    assert old in SCHEME
    return SCHEME.replace(old, new)


def model(old: str, new: str) -> str:
    assert old in MODEL
    return MODEL.replace(old, new)


@dataclass(frozen=True)
class Case:
    """A command and what its message must say.

    ``file`` is the content of the file that the command names as ``FILE``; ``SURROGATE`` stands for a good
    surrogate and ``OTHER`` for a folder that exists.
    """

    command: str
    says: tuple[str, ...]
    file: str | bytes | Callable[[Path], str | bytes] | None = None
    suffix: str = ".csv"


TABLES = {
    "no deflection column": Case(
        "calibrate xr701 FILE --out out", ("row 1", "no deflection column", "dz_mm", "add"), data("dz_mm", "gauge")
    ),
    "no load column": Case("calibrate xr701 FILE --out out", ("row 1", "no load column", "fz_N"), data("fz_N", "load")),
    "no joint column": Case(
        "simulate xr701 FILE --out out",
        ("no joint column of xr701", "q3real_deg"),
        "fz_N,dz_mm\n-650,-1\n",
    ),
    "text in a number, each one named": Case(
        "calibrate xr701 FILE --out out",
        ("2 problem(s)", "row 2, column dz_mm: got 'soft'", "row 5, column dz_mm", "decimal point"),
        data(",-0.24", ",soft"),
    ),
    "decimal comma": Case(
        "calibrate xr701 FILE --out out", ("row 4", "'-0,35'", "write -0.35"), data(",-0.35", ',"-0,35"')
    ),
    "NaN": Case(
        "sensitivity xr701 FILE --out out", ("row 4, column dz_mm: got 'nan'", "empty cell"), data(",-0.35", ",nan")
    ),
    "infinite load": Case(
        "simulate xr701 FILE --out out", ("row 2, column fz_N: got '-inf'",), data(",-150,-0.24\n4", ",-inf,-0.24\n4")
    ),
    "wrong unit": Case(
        "calibrate xr701 FILE --out out", ("row 1", "'dz_m'", "dz_mm", "convert"), data("dz_mm", "dz_m")
    ),
    "duplicate row": Case(
        "calibrate xr701 FILE --out out",
        ("row 29", "repeats that of row 28", "repeat"),
        DATA + DATA.splitlines()[-1] + "\n",
    ),
    "contradicting row": Case(
        "calibrate xr701 FILE --out out", ("row 29", "contradicts that of row 28"), DATA + "77,45,115,0,0,-650,-2\n"
    ),
    "pose out of the limits": Case(
        "calibrate xr701 FILE --out out", ("row 4, pose 5", "q2_deg = -80", "-35 to 45 deg"), data("5,-35,", "5,-80,")
    ),
    "pose that the parallelogram does not reach": Case(
        "calibrate xr701 FILE --out out",
        ("row 4, pose 5", "forearm_deg = 30 is outside 65 to 190 deg"),
        data("5,-35,40,", "5,-35,115,"),
    ),
    "another robot's table": Case(
        "calibrate kr60-3 FILE --scheme global --out out", ("q3real_deg", "q3_deg", "robot that was measured"), DATA
    ),
    "empty": Case("calibrate xr701 FILE --out out", ("is empty", "first line holds the column names"), ""),
    "header only": Case("calibrate xr701 FILE --out out", ("no readings",), DATA.splitlines()[0]),
    "binary CSV": Case("calibrate xr701 FILE --out out", ("not UTF-8", "save it as"), BINARY),
    "binary XLSX": Case("calibrate xr701 FILE --out out", ("not a readable XLSX", "save it"), BINARY, ".xlsx"),
    "other suffix": Case("calibrate xr701 FILE --out out", (".csv or .xlsx",), DATA, ".txt"),
    "missing": Case("calibrate xr701 nowhere.csv --out out", ("does not exist", "nowhere.csv", "check the path")),
    "folder": Case("calibrate xr701 OTHER --out out", ("it is a folder",)),
    "none bundled": Case("calibrate kr60-3 --scheme global --out out", ("no measurements are bundled", "DATA")),
    "too few readings": Case(
        "calibrate xr701 FILE --scheme global --out out",
        ("1 reading(s) cannot determine 4 parameters", "set fewer free"),
        "\n".join(DATA.splitlines()[:2]),
    ),
}

SCHEMES = {
    "not TOML": Case("calibrate xr701 --scheme-file FILE --out out", ("not valid TOML", "line"), "[[[", ".toml"),
    "binary": Case("calibrate xr701 --scheme-file FILE --out out", ("cannot be read",), BINARY, ".toml"),
    "missing": Case("calibrate xr701 --scheme-file nowhere.toml --out out", ("'nowhere.toml'", "check the path")),
    "folder": Case("calibrate xr701 --scheme-file OTHER --out out", ("an existing file",)),
    "unknown pose": Case(
        "calibrate xr701 --scheme-file FILE --out out",
        ("'999'", "3, 4, 5, 39, 40, 41, 75, 76, 77"),
        scheme('["4", "40", "76"]', '["4", "40", "999"]'),
        ".toml",
    ),
    "unknown pose of the sensitivity": Case(
        "run xr701 --scheme-file FILE --points 2 --out out", ("999",), scheme('["5", "41", "77"]', '["999"]'), ".toml"
    ),
    "unknown joint": Case(
        "calibrate xr701 --scheme-file FILE --out out", ("'j9'", "j1, j2"), scheme("j5", "j9"), ".toml"
    ),
    "unknown coordinate": Case(
        "run xr701 --scheme-file FILE --out out", ("'q9_deg'", "q5_deg"), scheme("q4_deg", "q9_deg"), ".toml"
    ),
    "unknown and missing keys, both named": Case(
        "calibrate xr701 --scheme-file FILE --out out",
        ("2 problem(s)", "gauge_inch: unknown key", "title: this key is missing"),
        scheme("gauge_mm", "gauge_inch").replace('title = "Published staged scheme of the ACMA XR701"\n', ""),
        ".toml",
    ),
    "another robot's": Case(
        "calibrate xr701 --scheme-file FILE --out out",
        ("is for robot: got 'tx200'", "allowed: xr701"),
        scheme('robot = "xr701"', 'robot = "tx200"'),
        ".toml",
    ),
    "another robot's, global": Case(
        "calibrate xr701 --scheme global --scheme-file FILE --out out",
        ("is for robot: got 'tx200'",),
        scheme('robot = "xr701"', 'robot = "tx200"'),
        ".toml",
    ),
    "a load that was not measured": Case(
        "calibrate xr701 --scheme-file FILE --out out", ("900", "150, 375, 650"), scheme("[650]", "[900]"), ".toml"
    ),
    "none bundled": Case(
        "calibrate kr60-3 FILE --scheme staged --out out",
        ("no calibration scheme is bundled", "--scheme-file"),
        "q2_deg,q3_deg,q5_deg,fz_N,dz_mm\n-90,0,45,-500,-0.5\n",
    ),
}

MODELS = {
    "unknown robot": Case("simulate xr702 --out out", ("'xr702'", "kr60-3, tx200, xr701", "stiffarm robots")),
    "unknown robot to show": Case("robots xr702", ("'xr702'", "kr60-3, tx200, xr701")),
    "not TOML": Case("simulate FILE --out out", ("not valid TOML", "line 1"), "[[[", ".toml"),
    "a measurement table": Case("simulate FILE --out out", ("a table of tool deflections",), DATA),
    "binary": Case("map joints FILE --out out", ("cannot be read",), BINARY, ".toml"),
    "folder": Case("run OTHER --out out", ("path of a model TOML",)),
    "no unit known": Case(
        "fit FILE --out out", ("'furlong'", "m, mm", "wall.unit"), model('"mm"', '"furlong"'), ".toml"
    ),
    "negative mass": Case(
        "simulate FILE --out out",
        ("mass", "must be greater than 0"),
        re.sub(r"(?m)^(mass = \{ value = )", r"\1-", MODEL),
        ".toml",
    ),
    "without a parallelogram": Case(
        "simulate kr60-3 --pose q2_deg=-90 --load-path parallelogram --out out", ("parallelogram", "serial")
    ),
    "rigid all over": Case(
        "map joints xr701 --links rigid --points 2 --out out",
        ("xr701: nothing in this model deflects", "joint springs or flexible links", "--links beam"),
    ),
}

OPTIONS = {
    "--poses unknown": Case("sensitivity xr701 --poses 5,999 --out out", ("--poses: got '999'", "3, 4, 5")),
    "--poses empty": Case("sensitivity xr701 --poses , --out out", ("--poses", "at least one")),
    "--joints unknown": Case(
        "calibrate xr701 --scheme global --joints j2,j9 --out out", ("--joints: got 'j9'", "j1, j2, j3, j4, j5, j6")
    ),
    "--joints twice": Case("sensitivity xr701 --joints j2,j2 --out out", ("--joints", "'j2,j2'", "each once")),
    "--joints are coordinates": Case("sensitivity xr701 --joints q2_deg --out out", ("'q2_deg'", "j1, j2")),
    "--joints in the staged scheme": Case(
        "calibrate xr701 --joints j2 --out out", ("--joints: no option of --scheme staged", "--scheme global")
    ),
    "--low in the staged scheme": Case("calibrate xr701 --low 2e5 --out out", ("--low: no option of",)),
    "--spacing in the global one": Case(
        "calibrate xr701 --scheme global --spacing log --out out", ("--spacing: no option of --scheme global",)
    ),
    "--loads not measured": Case("calibrate xr701 --scheme global --loads 150,900 --out out", ("900", "150, 375, 650")),
    "--loads text": Case("calibrate xr701 --loads heavy --out out", ("--loads: got 'heavy'", "150,650")),
    "--loads negative": Case("calibrate xr701 --loads=-650 --out out", ("'-650'", "above 0 N")),
    "--loads NaN": Case("calibrate xr701 --loads nan --out out", ("'nan'",)),
    "--loads infinite": Case("calibrate xr701 --loads inf --out out", ("'inf'",)),
    "--scheme": Case("calibrate xr701 --scheme local --out out", ("--scheme: got 'local'", "staged, global")),
    "--spacing": Case("calibrate xr701 --spacing cubic --out out", ("--spacing: got 'cubic'", "log, linear")),
    "--links": Case("calibrate xr701 --links shelf --out out", ("--links: got 'shelf'", "beam")),
    "--links empty": Case("calibrate xr701 --links= --out out", ("--links= is empty", "leave it")),
    "--load-path": Case("sensitivity xr701 --load-path straight --out out", ("'straight'", "parallelogram, serial")),
    "--low above --high": Case("calibrate xr701 --scheme global --low 1e7 --out out", ("1e+07, 1e+06", "low < high")),
    "--high infinite": Case("calibrate xr701 --scheme global --high inf --out out", ("inf", "finite")),
    "--low NaN": Case("calibrate xr701 --scheme global --low nan --out out", ("nan",)),
    "--set without a value": Case("simulate xr701 --set j2.stiffness --out out", ("--set", "NAME=VALUE")),
    "--set of nothing there is": Case(
        "fit xr701 --set j2.stiffnes=1e6 --out out", ("'j2.stiffnes'", "Did you mean j2.stiffness")
    ),
    "--set in a rehearsal of nothing there is": Case(
        "rehearse kr60-3 --set j9.stiffness=1e6 --out out", ("'j9.stiffness'",)
    ),
    "--set twice": Case(
        "map joints xr701 --set j2.stiffness=1e6 --set j2.stiffness=2e6 --out out", ("j2.stiffness is given twice",)
    ),
    "--set in another unit": Case("run --set j2.stiffness=1GPa --out out", ("'1GPa'", "N m/rad")),
    "--set beyond any arm": Case("plan xr701 --poses 3 --set j2.stiffness=1 --out out", ("got '1'", "1000 to 1e+09")),
    "sensitivity --low zero": Case("sensitivity xr701 --low 0 --out out", ("--low, --high: got '0, 1e+06'",)),
    "sensitivity --high infinite": Case("sensitivity xr701 --high inf --json", ("inf", "finite")),
    "--pose text": Case(
        "simulate xr701 --pose q2_deg=abc,q3real_deg=80 --out out", ("--pose: q2_deg: got 'abc'", "as in")
    ),
    "--pose NaN": Case("simulate xr701 --pose q2_deg=nan,q3real_deg=80 --out out", ("q2_deg: got 'nan'", "finite")),
    "--pose name": Case("simulate xr701 --pose q2=5 --out out", ("'q2'", "q2_deg, q3real_deg")),
    "--pose two faults, both named": Case(
        "simulate xr701 --pose q2_deg=x,q9_deg=y --out out", ("2 problem(s)", "q2_deg: got 'x'", "q9_deg: got 'y'")
    ),
    "--pose twice": Case("simulate xr701 --pose q2_deg=5,q2_deg=6 --out out", ("q2_deg is given twice", "remove one")),
    "--pose out of the limits": Case(
        "simulate xr701 --pose q2_deg=80,q3real_deg=80 --out out", ("q2_deg = 80 is outside -35 to 45 deg", "keep")
    ),
    "--pose not reachable": Case(
        "simulate xr701 --pose q2_deg=-35,q3real_deg=115 --out out", ("forearm_deg = 30 is outside 65 to 190 deg",)
    ),
    "--pose that leaves out a joint that cannot be 0": Case(
        "simulate xr701 --pose q2_deg=5 --out out", ("q3real_deg = 0 is outside 40 to 115", "not given stands at 0")
    ),
    "--pose with a table": Case("simulate xr701 FILE --pose q3real_deg=80 --out out", ("not both",), DATA),
    "--load name": Case("simulate xr701 --pose q3real_deg=80 --load fz=1 --out out", ("--load", "'fz'", "fz_N")),
    "--load zero": Case("simulate xr701 --pose q3real_deg=80 --load fz_N=0 --out out", ("not zero",)),
    "--load empty": Case("simulate xr701 --pose q3real_deg=80 --load= --out out", ("--load= is empty",)),
    "--load beyond all reason": Case(
        "simulate xr701 --pose q3real_deg=80 --load fz_N=1e200 --out out", ("'fz_N=1e+200'", "1e+09 N")
    ),
    "--load with a table": Case("simulate xr701 --load fz_N=-100 --out out", ("--load", "only with --pose")),
    "--points 1": Case("map joints xr701 --points 1 --out out", ("--points", "greater than or equal to 2")),
    "--points 1 of the whole chain": Case("run xr701 --points 1 --out out", ("--points", "greater than or equal to 2")),
    "--points text": Case("run xr701 --points many --out out", ("--points", "integer")),
    "--seed negative": Case("fit xr701 --seed=-1 --out out", ("--seed", "greater than or equal to 0")),
    "--layers text": Case("map joints xr701 --layers up --out out", ("--layers: got 'up'", "-90,0,90")),
    "--layers out of the limits": Case(
        "map joints xr701 --layers 0,500 --out out", ("'0,500'", "q4_deg", "-200 to 200 deg")
    ),
    "--layers NaN": Case("map joints xr701 --layers nan --out out", ("'nan'",)),
    "--layers twice": Case("map joints xr701 --layers 0,0 --out out", ("each once",)),
    "--degree too large for --runs": Case(
        "fit xr701 --basis polynomial --degree 12 --runs 100 --out out",
        ("1820 terms", "100 runs", "add runs, lower the degree"),
    ),
    "--order too large for --runs": Case(
        "fit xr701 --basis trigonometric --runs 300 --out out", ("625 terms", "300 runs", "add runs, lower the degree")
    ),
    "--order too large for any runs": Case(
        "fit tx200 --basis trigonometric --inputs q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg --out out",
        ("terms of trigonometric 2 with 6 inputs: got 15625", "at most 6000", "take the basis factored"),
    ),
    "--order": Case("fit xr701 --order 0 --out out", ("--order", "greater than or equal to 1")),
    "--format": Case(
        "fit xr701 --format onnx,matlab --out out", ("--format: got 'matlab'", "onnx, c, python", "by commas")
    ),
    "--quantity": Case("fit xr701 --quantity hardness --out out", ("--quantity: got 'hardness'", "stiffness, k_fs")),
    "--quantity without its vector": Case(
        "fit xr701 --quantity k_fs --out out", ("--quantity k_fs without --normal", "add --normal 0,0,1")
    ),
    "--normal": Case("fit xr701 --quantity k_fs --normal 0,0,0 --out out", ("--normal", "not all zero")),
    "--normal in words": Case("fit xr701 --quantity k_fs --normal up --out out", ("--normal", "'up'")),
    "--basis factored of an index": Case(
        "fit xr701 --quantity k_fs --normal 0,0,1 --basis factored --out out",
        ("--basis factored with --quantity: got 'k_fs'", "allowed: stiffness", "adaptive"),
    ),
    "--degree": Case("fit xr701 --degree 99 --out out", ("--degree", "less than or equal to 12")),
    "--basis": Case("fit xr701 --basis cubic --out out", ("--basis: got 'cubic'", "polynomial, trigonometric")),
    "--inputs": Case("fit xr701 --inputs q2 --out out", ("--inputs: got 'q2'", "q2_deg")),
    "--inputs that leave out a joint that cannot be 0": Case(
        "fit xr701 --inputs q2_deg --out out", ("q3real_deg", "taken as 0", "40 to 115 deg", "--fixed q3real_deg=")
    ),
    "--fixed out of the limits": Case(
        "fit xr701 --inputs q2_deg --fixed q3real_deg=200 --out out", ("q3real_deg", "200", "40 to 115 deg")
    ),
    "--fixed is an input": Case("fit xr701 --inputs q2_deg --fixed q2_deg=0 --out out", ("--fixed", "'q2_deg'")),
    "--direction of two numbers": Case("fit xr701 --direction 0,1 --out out", ("'0,1'", "three finite numbers")),
    "--direction zero": Case("fit xr701 --direction 0,0,0 --out out", ("not all zero",)),
    "--direction NaN": Case("fit xr701 --direction nan,0,1 --out out", ("finite",)),
    "unknown option": Case("robots --colour", ("--colour",)),
    "unknown command": Case("polish xr701", ("polish",)),
    "no --out": Case("fit xr701", ("--out",)),
    "one argument too many": Case("robots xr701 kr60-3", ("kr60-3",)),
}

SURROGATES = {
    "missing": Case("query nowhere.json --pose q2_deg=5 --out out", ("nowhere.json", "check the path")),
    "folder": Case("query OTHER --pose q2_deg=5 --out out", ("cannot be read", "check the path")),
    "empty": Case("query FILE --pose q2_deg=5 --out out", ("not valid JSON",), "", ".json"),
    "binary": Case("query FILE --pose q2_deg=5 --out out", ("UTF-8",), BINARY, ".json"),
    "cut short": Case(
        "query FILE --pose q2_deg=5 --out out",
        ("not valid JSON", "fit the surrogate again"),
        lambda good: good.read_text(encoding="utf-8")[:2000],
        ".json",
    ),
    "other JSON": Case("query FILE --pose q2_deg=5 --out out", ("stiffarm-surrogate/2",), '{"a": 1}', ".json"),
    "from the future": Case(
        "query FILE --pose q2_deg=5 --out out",
        ("newer than this program", "update stiffarm"),
        lambda good: good.read_text(encoding="utf-8").replace("stiffarm-surrogate/2", "stiffarm-surrogate/3"),
        ".json",
    ),
    "from the past": Case(
        "query FILE --pose q2_deg=5 --out out",
        ("got 'stiffarm-surrogate/1'", "allowed: stiffarm-surrogate/2", "fit the surrogate again"),
        lambda good: good.read_text(encoding="utf-8").replace("stiffarm-surrogate/2", "stiffarm-surrogate/1"),
        ".json",
    ),
    "with an entry too many": Case(
        "query FILE --pose q2_deg=5 --out out",
        ("mine", "unknown key"),
        lambda good: good.read_text(encoding="utf-8").replace('"robot":', '"mine": 1, "robot":', 1),
        ".json",
    ),
    "with NaN": Case(
        "query FILE --pose q2_deg=5 --out out",
        ("not valid JSON", "NaN", "fit the surrogate again"),
        lambda good: re.sub(r'"n_train": \d+', '"n_train": NaN', good.read_text(encoding="utf-8")),
        ".json",
    ),
    "of another robot": Case(
        "query SURROGATE --pose q2_deg=5,q3real_deg=80 --model tx200 --out out",
        ("is of robot: got 'xr701'", "allowed: tx200", "fit one for it"),
    ),
    "of another model of the robot": Case(
        "query SURROGATE --pose q2_deg=5,q3real_deg=80 --model xr701 --out out",
        ("fitted to a model with hash: got", "allowed: ", "fit one for it"),
    ),
    "NaN in --pose": Case("query SURROGATE --pose q2_deg=nan,q3real_deg=80 --out out", ("q2_deg: got 'nan'",)),
    "a table in which no row can be answered": Case(
        "query SURROGATE FILE --out out",
        ("2 of 2 rows", "row 1: q2_deg = 85 deg (allowed -35 to 45 deg)", "--extrapolate"),
        "pose,q2_deg,q3real_deg\nA,85,77.5\nB,-90,80\n",
    ),
    "direction of a query": Case(
        "query SURROGATE --pose q2_deg=5,q3real_deg=80 --direction 0,0,0 --out out", ("--direction", "not all zero")
    ),
    "edited by hand": Case(
        "query FILE --pose q2_deg=5 --out out",
        ("checksum", "changed after it was written", "fit the surrogate again"),
        lambda good: re.sub(r'"n_train": \d+', '"n_train": 9999', good.read_text(encoding="utf-8")),
        ".json",
    ),
    "edited by hand, for a map": Case(
        "map joints xr701 --surrogate FILE --points 2 --out out",
        ("checksum",),
        lambda good: re.sub(r'"n_train": \d+', '"n_train": 9999', good.read_text(encoding="utf-8")),
        ".json",
    ),
    "of another robot, for a map": Case(
        "map joints tx200 --surrogate SURROGATE --points 2 --out out", ("is of robot: got 'xr701'", "allowed: tx200")
    ),
    "out of the domain": Case(
        "query SURROGATE --pose q2_deg=80,q3real_deg=80 --out out",
        ("q2_deg = 80 deg", "-35 to 45 deg", "--extrapolate"),
    ),
    "out of the couplings": Case(
        "query SURROGATE --pose q2_deg=-35,q3real_deg=115 --out out", ("forearm_deg", "--extrapolate")
    ),
    "no poses": Case("query SURROGATE --out out", ("--pose", "a table")),
    "poses twice": Case("query SURROGATE FILE --pose q2_deg=5 --out out", ("either",), POSES),
    "text in --pose": Case("query SURROGATE --pose q2_deg=abc --out out", ("q2_deg: got 'abc'",)),
    "--pose of another joint": Case("query SURROGATE --pose q1_deg=0 --out out", ("'q1_deg'", "q2_deg, q3real_deg")),
    "pose table missing": Case("query SURROGATE nowhere.csv --out out", ("'nowhere.csv'", "check the path")),
    "pose table a folder": Case("query SURROGATE OTHER --out out", ("existing CSV",)),
    "pose table empty": Case("query SURROGATE FILE --out out", ("is empty",), ""),
    "pose table binary": Case("query SURROGATE FILE --out out", ("not UTF-8",), BINARY),
    "pose table without joints": Case("query SURROGATE FILE --out out", ("no joint column", "q2_deg"), "a,b\n1,2\n"),
    "pose table with text and NaN, both named": Case(
        "query SURROGATE FILE --out out",
        ("2 problem(s)", "row 2, column q2_deg: got 'x'", "row 3, column q3real_deg: got 'nan'"),
        POSES.replace("5,77.5", "x,77.5").replace("10,80", "10,nan"),
    ),
    "pose table in radians": Case(
        "query SURROGATE FILE --out out", ("'q2_rad'", "allowed: q2_deg", "convert"), POSES.replace("q2_deg", "q2_rad")
    ),
    "pose table with a column twice": Case(
        "query SURROGATE FILE --out out", ("q2_deg stands there twice",), "q2_deg,q3real_deg,q2_deg\n1,80,2\n"
    ),
    "pose table with a cell too many": Case(
        "query SURROGATE FILE --out out", ("row 2", "3 cells", "2 cells"), "q2_deg,q3real_deg\n1,80,0\n"
    ),
}

GROUPS = {"table": TABLES, "scheme": SCHEMES, "model": MODELS, "option": OPTIONS, "surrogate": SURROGATES}
ALL = [pytest.param(case, id=f"{group}: {name}") for group, cases in GROUPS.items() for name, case in cases.items()]


@pytest.mark.parametrize("case", ALL)
def test_bad_input_is_refused(cli: Command, tmp_path: Path, fitted: Path, case: Case) -> None:
    good = fitted / "surrogate.json"
    (tmp_path / "folder").mkdir()
    names = {"FILE": f"file{case.suffix}", "OTHER": "folder", "SURROGATE": str(good)}
    if case.file is not None:
        content = case.file(good) if callable(case.file) else case.file
        assert content != good.read_text(encoding="utf-8"), "the change that makes it bad did not apply"
        file = tmp_path / names["FILE"]
        file.write_bytes(content) if isinstance(content, bytes) else file.write_text(content, encoding="utf-8")
    before = tree(tmp_path)
    outcome = cli(*(names.get(word, word) for word in case.command.split()))
    assert outcome.code == 2, outcome.err
    assert outcome.out == ""
    for words in case.says:
        assert words in outcome.err
    assert "Traceback" not in outcome.err
    assert "Warning" not in outcome.err
    assert tree(tmp_path) == before, "something was written"
    refusals = [line for line in outcome.err.splitlines() if line.startswith("stiffarm: ")]
    usage = "Usage:" in outcome.err
    assert len(refusals) == (0 if usage else 1), "one message, no more and no less"
    assert "More: stiffarm help" in " ".join(outcome.err.replace("│", " ").split()), "no code"


@pytest.mark.parametrize(
    "command",
    [
        "simulate xr701",
        "sensitivity xr701",
        "calibrate xr701",
        "fit xr701",
        "query SURROGATE --pose q2_deg=5,q3real_deg=80",
        "map joints xr701",
        "run xr701",
    ],
)
@pytest.mark.parametrize("place", ["a file in its place", "below a file", "name too long"])
def test_an_output_folder_that_cannot_be_is_named_before_any_work(
    cli: Command, tmp_path: Path, fitted: Path, command: str, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Permissions would not do: the tests may run as root.
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    out = {"a file in its place": "file", "below a file": "file/deep/er", "name too long": "x" * 300}[place]
    work = (
        *("commands.run.missing.looks", "commands.sensitivity.factorial.sensitivity_study"),
        *("commands.simulate.readings.simulate", "commands.fit.learning.learn"),
        *("commands.maps.command.mapped", "commands.calibrate.step.run_campaign"),
    )
    for name in work:
        monkeypatch.setattr(f"stiffarm.{name}", lambda *_, **__: pytest.fail("work was done for nothing"))
    words = command.replace("SURROGATE", str(fitted / "surrogate.json")).split()
    outcome = cli(*words, "--out", out)
    assert outcome.code == 2
    assert f"output folder {out} cannot be written" in outcome.err
    assert "choose another folder with --out" in outcome.err
    assert set(tree(tmp_path)) == {"file"}


@pytest.mark.slow
def test_bad_input_in_a_process_of_its_own(tmp_path: Path) -> None:
    """The exit code as the shell sees it, once for a message of ours and once for one of the parser's."""
    outcome = run_apart("calibrate", "xr701", "nowhere.csv", "--out", tmp_path / "out")
    assert (outcome.code, outcome.out) == (2, "")
    assert len(outcome.err.splitlines()) == 1
    outcome = run_apart("map", "joints", "xr701", "--points", "1", "--out", tmp_path / "out")
    assert (outcome.code, outcome.out) == (2, "")
    assert tree(tmp_path) == {}


@pytest.mark.usefixtures("blank", "quick_fit")
def test_a_surrogate_that_does_not_know_what_the_map_or_a_table_moves_is_refused(cli: Command, tmp_path: Path) -> None:
    options = ("--inputs", "q2_deg,q3real_deg", "--runs", "300", "--basis", "polynomial", "--degree", "3")
    assert cli("fit", "xr701", *options, "--out", "flat").code == 0
    # Joint 6 turns the tool about its own axis, which changes nothing; joint 5 does.
    (tmp_path / "poses.csv").write_text("q2_deg,q3real_deg,q5_deg,q6_deg\n1,80,0,7\n1,80,30,8\n", encoding="utf-8")
    outcome = cli("query", "flat/surrogate.json", "poses.csv")
    assert outcome.code == 2
    assert "row 3, column q5_deg: got '30'; allowed: 0, where the surrogate was fitted" in outcome.err
    assert "q6_deg" not in outcome.err
    outcome = cli("map", "joints", "xr701", "--surrogate", "flat/surrogate.json", "--points", "2", "--out", "out")
    assert outcome.code == 2
    assert all(word in outcome.err for word in ("only one value of", "'q5_deg, q4_deg'"))
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("blank", "quick_fit")
def test_a_surrogate_of_a_sideways_load_is_refused_for_the_map(cli: Command, tmp_path: Path) -> None:
    options = ("--direction", "1,0,0", "--runs", "300", "--basis", "polynomial", "--degree", "2")
    assert cli("fit", "xr701", *options, "--out", "side").code == 0
    outcome = cli("map", "joints", "xr701", "--surrogate", "side/surrogate.json", "--points", "2", "--out", "out")
    assert outcome.code == 2
    assert "load direction" in outcome.err
    assert not (tmp_path / "out").exists()


def test_debug_shows_where_bad_input_was_noticed(cli: Command) -> None:
    outcome = cli("simulate", "xr702", "--debug")
    assert outcome.code == 2
    assert "Traceback" in outcome.err
