"""Readers of experiments: measurement tables, tables of joint twists, calibration files."""

from __future__ import annotations

import io
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.diagnosis.study.sets import study_set
from doe import bundled_data, read_measurements, write_measurements
from doe.absolute.table import read_absolute
from doe.estimation.campaign import load_campaign
from doe.instruments.convert import convert
from doe.instruments.mapping_file import Settings, mapping_text, read_mapping
from doe.joint_twists import read_twists, write_twists
from doe.joint_twists.synthetic import Campaign, draw_poses, draw_truth, make_readings
from fem import ArmModel, build_model
from robots import forward_kinematics, load_description, load_robot
from robots.files.csv_text import write_rows
from robots.library.commented import commented_toml
from robots.library.dh import description_from_dh
from robots.library.models import parse_description
from robots.robot import robot_from
from stiffarm.commands.new.dh_table import read_dh
from stiffarm.commands.robots.pendant_table import read_pendant
from stiffarm.session.table_kinds import kind_of

from .mutate_tables import TABLE, WORKBOOK
from .readers_arm import JSON, TOML
from .registry import Reader
from .samples import Sample
from .trial import ROOT, require, require_finite

ROBOT = load_robot("kr60-3")

WIDE = """pose,repeat,phase,step,q1_deg,q2_deg,q3real_deg,q4_deg,q5_deg,q6_deg,fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm,\
dx_mm,dy_mm,dz_mm,rx_mrad,ry_mrad,rz_mrad,px_mm,py_mm,pz_mm,sigma_mm,who,time_s,session,temperature_C
A,1,loading,1,0,10,90,0,10,0,0,0,-100,0,0,1,0.1,-0.02,-0.21,,0.1,,0,0,200,0.01,anna,60,first,21
A,2,loading,2,0,10,90,0,10,0,0,0,-200,0,0,2,0.2,-0.04,-0.42,,0.2,,0,0,200,0.01,anna,120,first,
A,3,unloading,3,0,10,90,0,10,0,0,0,-100,0,0,1,0.11,-0.02,-0.23,,0.11,,0,0,200,0.01,bert,180,first,23
B,1,loading,4,30,-10,80,90,-10,45,0,100,0,0,0,0,,0.4,,,,,0,0,200,,bert,240,second,24
B,1,loading,5,30,-10,80,90,-10,45,0,200,0,0,0,0,,0.81,,,,,0,0,200,,bert,300,second,25
"""

CAMPAIGN = b"""schema = "stiffarm-calibration/1"
robot = "kr60-3"
title = "test"
source = "made up"
[noise]
gauge_mm = 0.01
robust = false
[[parameter]]
name = "j2.stiffness"
lower = 1e4
upper = 1e8
[parameter.prior]
value = 1e6
factor = 3.0
source = "the class"
[[parameter]]
name = "j3.stiffness"
[[law]]
kind = "fourier"
joint = "j4"
input = "q4_deg"
order = 2
spread = 0.5
[[law]]
kind = "table"
joint = "j5"
input = "q5_deg"
nodes_deg = [-90.0, 0.0, 90.0]
[[stage]]
name = "one"
parameters = ["j2.stiffness", "j3.stiffness"]
poses = ["A"]
loads_N = [100.0]
levels = 10
[[stage]]
name = "two"
parameters = ["j4.law", "j5.law"]
"""
POLYNOMIAL = b"""schema = "stiffarm-calibration/1"
robot = "kr60-3"
title = "test"
[[law]]
kind = "polynomial"
joint = "j2"
inputs = ["q2_deg", "q3_deg"]
degree = 2
"""


@cache
def _xr701() -> ArmModel:
    return build_model(load_description("xr701"), "beam")


@cache
def _tx200() -> ArmModel:
    return build_model(load_description("tx200"), "rigid")


@cache
def _kr60() -> ArmModel:
    return build_model(load_description("kr60-3"), "rigid")


def as_xlsx(csv: bytes) -> Sample:
    """A CSV as a workbook, numbers as numbers."""
    buffer = io.BytesIO()
    pd.read_csv(io.BytesIO(csv)).to_excel(buffer, index=False)
    return Sample(".xlsx", buffer.getvalue())


def _tables() -> list[Sample]:
    bundled = bundled_data("xr701").read_bytes()
    semicolons, tabs = (bundled.replace(b",", mark) for mark in (b";", b"\t"))
    return [Sample(".csv", data) for data in (bundled, WIDE.encode(), semicolons, tabs)]


def _workbooks() -> list[Sample]:
    return [as_xlsx(b"\n".join(bundled_data("xr701").read_bytes().splitlines()[:6])), as_xlsx(WIDE.encode())]


def _measurements(path: Path) -> object:
    robot = _xr701().robot
    found = read_measurements(path, robot)
    require_finite(found, "measurements", frozenset({"displacement", "point", "sigma", "step", "time", "temperature"}))
    require(
        not np.isinf(found.displacement).any() and not np.isinf(found.point).any(), "measurements: infinite readings"
    )
    require(found.used.any(axis=1).all(), "measurements: a row without a reading")
    require(bool(robot.reachable(found.q).all()), "measurements: a pose off the limits")
    copy = path.with_name("copy.csv")
    write_measurements(found, copy, robot)
    again = read_measurements(copy, robot)
    require(again.n == found.n and again.pose == found.pose, "measurements round trip: other rows")
    require(again.session == found.session, "measurements round trip: other sessions")
    for name in ("q", "wrench", "displacement", "point", "sigma", "step", "time", "temperature"):
        a, b = getattr(found, name), getattr(again, name)
        # 15 digits are written.
        require(np.allclose(a, b, rtol=1e-14, atol=0.0, equal_nan=True), f"measurements round trip: other {name}")
    return found


@cache
def _twist_csv() -> tuple[bytes, ...]:
    model, campaign = _tx200(), Campaign(poses=1)
    rng = np.random.default_rng(1)
    made = make_readings(model, draw_truth(model, rng), campaign, rng, poses=draw_poses(model, campaign, rng))
    out = []
    for joints in ((1,), (5,)):
        keep = np.flatnonzero(np.isin(made.joint, joints))[:12]
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "twists.csv"
            write_twists(made.select(np.isin(np.arange(made.n), keep)), path, model.robot)
            out.append(path.read_bytes())
    return tuple(out)


def _twists(path: Path) -> object:
    robot = _tx200().robot
    found = read_twists(path, robot)
    require_finite(found, "twists", frozenset({"twist", "sigma"}))
    require(not np.isinf(found.twist).any(), "twists: infinite readings")
    require((~np.isnan(found.twist)).any(axis=1).all(), "twists: a row without a reading")
    return found


def _campaign(path: Path) -> object:
    found = load_campaign(path)
    found.check_against((_xr701() if found.robot == "xr701" else _kr60()).robot)
    parameters, laws = found.free(_kr60())
    for p in parameters:
        require(p.lower <= p.upper, "calibration file: bounds in the wrong order")
        require_finite((p.lower, p.upper), "calibration file: bounds")
    return parameters, laws


def _campaigns() -> tuple[bytes, ...]:
    return CAMPAIGN, POLYNOMIAL, (ROOT / "doe/schemes/xr701.toml").read_bytes()


SET = b'{"schema": "stiffarm-study-set/1", "model": "kr60-3", "links": "rigid", "load_path": "serial"}'
KEY = b"""{"schema": "stiffarm-study-key/1", "world": "mine", "effects": [{"code": "friction:j2",
"axis": ["load history"], "place": "j2", "excess_chi2": 85.2}], "excess_chi2": 85.2,
"tags": {"reads": "z", "poses": 27, "scatter": 0.015}}"""


def _study(path: Path, name: str) -> object:
    """A set of a study with the file as its ``name``, in a folder where nothing else is wrong."""
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        for file, data in {"set.json": SET, "key.json": KEY, "readings.csv": b"", name: path.read_bytes()}.items():
            (here / file).write_bytes(data)
        found = study_set(here, "set")
        excess = [found.key.excess_chi2, *(e.excess_chi2 for e in found.key.effects)]
        require_finite([x for x in excess if x is not None], "study set: excess")
        require(all(e.code for e in found.key.effects), "study set: an effect without a name")
        return found


def _dh_tables() -> list[Sample]:
    head, rows = "joint,alpha_deg,a_mm,d_mm,theta_deg,lower_deg,upper_deg,sign", "j1,0,0,815,0,-185,185,1\nj2,-90,350,0"
    return [Sample(".csv", f"{head}\n{rows},0,-135,35,-1\nflange,0,0,170,90,,,\n".encode())]


def _dh_arm(path: Path) -> object:
    lines, flange = read_dh(path, "--mdh")
    made = description_from_dh(lines, flange, "modified", name="arm", title="arm", where=path.name, sha256="")
    require(parse_description(commented_toml(made), "written back") == made, "new model: another description")
    require_finite(forward_kinematics(robot_from(made), np.zeros((1, len(lines)))), "new model: kinematics")
    return made


def _pendant_tables() -> list[Sample]:
    row = "P1,10,-60,30,1,2,3,1500,20,900,180,-30,5\nP2,20,-70,40,1,2,3,,,,,,"
    return [Sample(".csv", f"pose,{','.join(ROBOT.coordinates)},x_mm,y_mm,z_mm,w_deg,p_deg,r_deg\n{row}\n".encode())]


def _pendant(path: Path) -> object:
    readings, _, _ = read_pendant(path, ROBOT)
    require_finite((readings.q, readings.position), "pendant readings")
    return readings


def _positions() -> list[Sample]:
    head = (
        f"{','.join(ROBOT.coordinates)},x_mm,y_mm,z_mm,session,target,payload_kg,payload_z_mm,rail_mm,sigma_mm,operator"
    )
    rows = "10,-60,30,1,2,3,1500,20,900,a,ball,5,100,0,0.02,anna\n20,-70,40,1,2,3,1400,30,850,b,ball,,,1500,,bert"
    return [Sample(".csv", f"{head}\n{rows}\n".encode())]


def _absolute(path: Path) -> object:
    data = read_absolute(path, ROBOT)
    loads = np.array([[one.kg, *one.centre] for one in data.payloads])
    require_finite((data.q, data.position, data.rail, loads), "absolute readings")
    require(len(data) == len(data.session.number) == len(data.target.number), "labels of all readings")
    require(bool(np.all(data.payload < len(data.payloads))), "payloads that are there")
    return data


# Rows without a load beside rows with one.
CYCLES = """Units: deg\nBy hand\n\nJ1\tJ2\tJ3\tMass hung [kg]\tGauge z [um]\tSigma [um]\tPhase\tTemp [\u00b0F]\tTime
10\t-60\t30\t0\t1002\t3\tloading\t70\t12.05.2026 09:00
10\t-60\t30\t20\t801\t3\tloading\t70\t12.05.2026 09:01
10\t-60\t30\t0\t998\t\tunloading\t70.5\t12.05.2026 09:02
20.001\t-70\t40\t20\t-\t3\tloading\t71\t12.05.2026 09:05
20\t-70\t40\t0\t5\t3\tloading\t71\t12.05.2026 09:06
20\t-70\t40\t10\t\u22122\t4\tloading\t71\t12.05.2026 09:07
"""


def _instruments(suffix: str) -> list[Sample]:
    folder = ROOT / "docs/examples/readings"
    names = ("api.csv", "faro.txt", "polyworks.txt") if suffix == ".csv" else ("dial_gauge.xlsx",)
    own = [Sample(suffix, CYCLES.encode("utf-16"))] if suffix == ".csv" else []
    return [*(Sample(suffix, (folder / name).read_bytes()) for name in names), *own]


def _axes_found(path: Path) -> object:
    return _converted(path, "found")


def _converted(path: Path, axes: str = "base") -> object:
    """The table has a number wherever it says so, and the readers of tables take it."""
    said = axes if b"before [mm]" in path.read_bytes() else None
    made = convert([path], Settings(axes=said, sigma_mm=0.01), ROBOT)
    require(bool(made.rows) and len(made.places) == len(made.rows), "conversion: rows")
    require(all(len(row) == len(made.header) for row in made.rows), "conversion: ragged rows")
    require(len(set(made.header)) == len(made.header), "conversion: a name twice")
    require_finite(list(made.ranges().values()), "conversion: ranges")
    copy = path.with_name("copy.csv")
    with copy.open("w", encoding="utf-8", newline="") as stream:
        write_rows(stream, [made.header, *made.rows])
    read = read_measurements(copy, ROBOT).n if made.kind == "deflections" else len(read_absolute(copy, ROBOT))
    require(read == len(made.rows), "conversion: other rows when read back")
    mapping = path.with_name("copy.toml")
    mapping.write_text(mapping_text(made.settings, made.source), encoding="utf-8")
    again = convert([path], read_mapping(mapping), ROBOT)
    require((again.header, again.rows) == (made.header, made.rows), "conversion: another table by its mapping")
    return made


MAPPING = b"""schema = "stiffarm-readings/1"
decimal = "comma"
sheets = ["A"]
header = 3
sigma_mm = 0.02
axes = "0,0,90"
[fill]
session = "day 1"
[columns]
"Z vor" = "z mm before"
X = "x um negated of ball"
"""


def _mapping(path: Path) -> object:
    found = read_mapping(path)
    copy = path.with_name("copy.toml")
    copy.write_text(mapping_text(found, "a file"), encoding="utf-8")
    require(read_mapping(copy) == found, "mapping file: another one written back")
    return found


def _told(path: Path) -> object:
    """What is no file of ours is left to its reader: nothing is raised."""
    return kind_of(path)


READERS: dict[str, Reader] = {
    "file": Reader(
        lambda: [*_tables(), *_dh_tables(), *_pendant_tables(), Sample(".json", SET)], _told, (*TABLE, JSON)
    ),
    "measurement file": Reader(_tables, _measurements, TABLE, cost=2.0),
    "measurement file: workbook": Reader(_workbooks, _measurements, WORKBOOK, cost=8.0),
    "measurement file: Denavit-Hartenberg": Reader(_dh_tables, _dh_arm, TABLE),
    "measurement file: pendant": Reader(_pendant_tables, _pendant, TABLE),
    "measurement file: positions": Reader(_positions, _absolute, TABLE),
    "readings file": Reader(lambda: _instruments(".csv"), _converted, TABLE, cost=6.0),
    "readings file: axes found": Reader(
        lambda: [s for s in _instruments(".csv") if b"before" in s.data], _axes_found, TABLE, cost=12.0
    ),
    "readings file: workbook": Reader(lambda: _instruments(".xlsx"), _converted, WORKBOOK, cost=12.0),
    "mapping file": Reader(lambda: [Sample(".toml", MAPPING)], _mapping, (TOML,)),
    "measurement file: joint twists": Reader(
        lambda: [Sample(".csv", data) for data in _twist_csv()], _twists, TABLE, cost=2.0
    ),
    "measurement file: workbook of joint twists": Reader(
        lambda: [as_xlsx(_twist_csv()[0])], _twists, WORKBOOK, cost=12.0
    ),
    "calibration file": Reader(lambda: [Sample(".toml", text) for text in _campaigns()], _campaign, (TOML,)),
    "study set": Reader(lambda: [Sample(".json", SET)], lambda path: _study(path, "set.json"), (JSON,)),
    "study set: key": Reader(lambda: [Sample(".json", KEY)], lambda path: _study(path, "key.json"), (JSON,)),
}
