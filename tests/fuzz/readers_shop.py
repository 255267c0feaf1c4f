"""Readers of the shop floor: tool paths, cells, cuts, placements, programs, templates, requests to a server."""

from __future__ import annotations

import json
import shutil
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fem import build_model
from machining import read_path
from machining.cell import parse_cell, read_cell
from machining.cutting.milling_file import read_milling
from machining.placement.file import Placement, placement_content, read_placement
from machining.programs.formats import (
    FORMATS,
    changed_since,
    parse_options,
    read_options,
    read_program,
    round_trip,
    write_program,
)
from machining.programs.program import JointProgram
from machining.programs.write_options import WriteOptions
from machining.service import Session
from machining.toolpaths import ReadOptions, read_toolpath
from machining.toolpaths.tables import read_motions, write_motions
from robots import load_description

from .mutate_bytes import Mutation
from .mutate_forms import APT, GCODE, words
from .mutate_tables import TABLE
from .readers_arm import JSON, TOML, texts
from .registry import Reader
from .samples import Sample
from .trial import ROOT, require, require_finite

# The programs that the tests of the shop floor share, and what these share with other tests.
sys.path += [str(ROOT / "tests" / "machining"), str(ROOT / "tests")]
from program_cases import PLAIN, busy, program_of

SAMPLES = ROOT / "tests" / "machining" / "toolpath_samples"
EXAMPLES = ROOT / "docs" / "examples"
READ = ReadOptions(units="mm", unknown_motion="report", frames="written", rotary="table-AC", max_moves=200_000)
# NaN stands for "not given" there; of an event, for "has none".
_MISSING = frozenset({"feed", "spindle", "diameter", "corner_radius", "length", "limits", "value"})

CELL = b"""schema = "stiffarm-cell/1"
name = "milling cell"
allowed_contacts = [["table", "pedestal"]]
[robot]
position_mm = [0, 0, 500]
z_axis = [0, 0, 1]
x_axis = [0, 1, 1]
joint_speed_deg_s = [128, 102, 128, 260, 245, 322]
joint_acceleration_deg_s2 = 400
safety_mm = 20
home_deg = [0, -90, 0, 0, 90, 0]
[tool]
position_mm = [0, 0, 450]
rpy_deg = [0, 90, 0]
[[tool.body]]
name = "cutter"
cutter = true
position_mm = [0, 0, 300]
shape = { kind = "cylinder", diameter_mm = 16, length_mm = 150 }
[part]
position_mm = [1500, 0, 700]
shape = { kind = "sphere", diameter_mm = 200 }
[[fixture]]
name = "table"
position_mm = [1500, 0, 0]
shape = { kind = "box", size_mm = [800, 1200, 700] }
[floor]
[[linear_axis]]
name = "rail"
direction = [0, 2, 0]
limits_mm = [-1000, 3000]
speed_mm_s = 1500
compliance_um_per_N = [0.01, 0.02, 0.03]
carriage = { position_mm = [0, 0, 300], shape = { kind = "box", size_mm = [900, 900, 200] } }
[turntable]
point_mm = [1500, 0, 0]
axis = [0, 0, 1]
endless = true
speed_deg_s = 90
[commands]
spindle_clockwise = 12
spindle_speed = "aoSpeed"
spindle_full_rpm = 24000
coolant_flood = "doFlood"
optional_stop = 3
tool_change = "CHANGE_TOOL"
"""
MILLING = b"""schema = "stiffarm-milling/1"
[mill]
diameter_mm = 12
teeth = 3
[cut]
kind = "down"
axial_depth_mm = 2
radial_depth_mm = 4
feed_per_tooth_mm = 0.05
instant = "generating"
[material]
tc_N_per_mm2 = 800
te_N_per_mm = 12
rc_N_per_mm2 = 300
re_N_per_mm = 10
source = "shop"
relative_sd = 0.1
[plunge]
chip_N_per_mm2 = 900
edge_N_per_mm = 20
source = "shop"
"""
OPTIONS = b"""schema = "stiffarm-post/1"
name = "wing"
rapid = "joint"
rapid_mm_s = 300
default_feed_mm_min = 1000
blend_mm = 0.05
moves_per_file = 100
source_lines = true
tool_name = "tBall"
[decimals]
length = 4
angle = 6
[krl]
tool = 3
[abb]
tool_mass_kg = 12.5
tool_centre_mm = [0, 0, 80]
[sinumerik]
axes = ["A1", "A2", "A3", "A4", "A5", "A6"]
feed = "per_minute"
[arm]
sign = [1, -1, 1, 1, -1, 1]
offset_deg = [0, 90, 0, 0, 0, 0]
base = { position_mm = [0, 0, 100], rpy_deg = [0, 0, 90] }
"""
CURVE = b"""x_mm;y_mm;z_mm;nx;ny;nz;tx;ty;tz;feed_mm_per_min
0;0;0;0;0;1;0;0.1;1;1000
10;0;1;0;0;1;0;0.1;1;
20;5;1;0;0.1;1;0;0.1;1;500
"""


def _toolpath(path: Path) -> object:
    found = read_toolpath(path, options=READ)
    require_finite(found, "motions", _MISSING)
    _checked_motions(found)
    return found


def _checked_motions(found: Any) -> None:
    require(np.allclose(np.linalg.norm(found.axes, axis=1), 1.0, atol=1e-9), "motions axes: not of length 1")
    for name in ("feed", "spindle"):
        require(not np.isinf(getattr(found, name)).any(), f"motions: infinite {name}")
    require((found.feed[~np.isnan(found.feed)] > 0).all(), "motions feed: not positive")
    for name, table in (("tool", found.tools), ("operation", found.operations)):
        index = getattr(found, name)
        require(((index >= 0) & (index < max(1, len(table)))).all(), f"motions {name}: of none in the table")


def _motions(path: Path) -> object:
    found = read_motions(path)
    require_finite(found, "motions", _MISSING)
    _checked_motions(found)
    return found


@cache
def _neutral() -> Sample:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motions.csv"
        write_motions(path, read_toolpath(SAMPLES / "nx.cls"))
        return Sample(".csv", path.read_bytes())


def _path(path: Path) -> object:
    found = read_path(path)
    require_finite(found, "path", frozenset({"feed"}))
    return found


def _milling(path: Path) -> object:
    found = read_milling(path)
    require_finite(found, "milling")
    return found


def _cell(path: Path) -> object:
    found = read_cell(path)
    require_finite(found, "cell", frozenset({"limits"}))
    return found


def _placements() -> list[Sample]:
    n = 4
    whole = Placement(
        "kr60-3",
        "cell",
        ("rail",),
        np.linspace(0, 1, n)[:, None],
        0.1,
        np.linspace(0, 1, n),
        ("q1_deg", "q2_deg"),
        np.zeros((n, 2)),
        np.array([0, 2, 3, 5]),
        7,
    )
    return [Sample(".json", json.dumps(placement_content(whole)).encode())]


def _placement(path: Path) -> object:
    found = read_placement(path)
    require_finite(found, "placement")
    at = {"travels": found.at_moves(), "gamma": found.gamma_at_moves(), "joints": found.joints_at_moves()}
    for name, values in at.items():
        require(len(values) == found.count, f"placement {name}: not one for each move")
        require_finite(values, f"placement {name}")
    return found


def _options(path: Path) -> object:
    found = read_options(path)
    require_finite(found.model_dump(), "options")
    return found


def _options_seeds() -> list[Sample]:
    import tomllib

    return [Sample(".toml", OPTIONS), Sample(".json", json.dumps(tomllib.loads(OPTIONS.decode())).encode())]


@cache
def _program(robot: str = "kr60-3") -> JointProgram:
    return busy(6) if robot == "kr60-3" else program_of(robot, 6)


def _programs() -> list[Sample]:
    texts_of = {name: write_program(_program(), name).texts() for name in ("json", "csv")}
    return [Sample(f".{name}", next(iter(files.values())).encode()) for name, files in texts_of.items()]


def _read_program(path: Path) -> object:
    program = _program()
    found = read_program(path, program.robot, program.cell)
    require_finite(found.q, "program joints")
    require_finite(found.T_part_tool, "program frames")
    require_finite((found.travel, found.table, found.gamma), "program axes")
    _checked_program(found)
    return found


def _checked_program(found: JointProgram) -> None:
    m = found.motions
    require_finite(m, "program motions", _MISSING)
    require(not np.isinf(m.feed).any() and not np.isinf(m.spindle).any(), "program motions: infinite feed or spindle")


_CONTROLLERS = [(name, kind) for name, f in FORMATS.items() if not f.neutral for kind in f.kinds]


def _written_options(name: str) -> tuple[JointProgram, WriteOptions]:
    robot = "tx200" if name == "val3" else "kr60-3"
    return _program(robot), parse_options({} if name in ("krl", "val3") else {"arm": PLAIN}, "options")


@cache
def _controller_files(name: str, kind: Any) -> dict[str, str]:
    program, options = _written_options(name)
    return write_program(program, name, kind, options).texts()


def _controller_seeds() -> list[Sample]:
    return [
        Sample(f".{name}.{kind}.{i}", text.encode())
        for name, kind in _CONTROLLERS
        for i, text in enumerate(_controller_files(name, kind).values())
    ]


def _read_back(path: Path) -> object:
    """A controller's program with one file changed: the comparison refuses it, or says by how much it is off."""
    _, name, kind, number = path.name.split(".")
    files = dict(_controller_files(name, kind))
    files[list(files)[int(number)]] = path.read_bytes().decode("utf-8", errors="replace")
    program, options = _written_options(name)
    trip = round_trip(program, files, name, kind, options)  # type: ignore[arg-type]
    if trip.within(1e-6):
        require_finite(trip, "read back")
    return trip


def _records() -> list[Sample]:
    return [Sample(".json", b'{"programs": {"krl": {"sha256": {"a.src": "0123", "b.dat": "4567"}}}}')]


TEMPLATES = ROOT / "machining" / "programs" / "templates"
JINJA = (
    b"{% for i in range(10**9) %}x{% endfor %}",
    b"{{ 7 * 7 }}",
    b"{% include 'krl/main.j2' %}",
    b"{% import 'x' as y %}",
    b"{{ o }}",
    b"{{ undefined }}",
    b"{% macro a() %}{{ a() }}{% endmacro %}{{ a() }}",
    b"{{ 'x' * 10**9 }}",
    b"{{ ''.__class__ }}",
    b"{% if %}",
    b"{{",
    b"{{ 10**10**8 }}",
    b"{{ [0] * 10**9 }}",
    b"{{ 1 / 0 }}",
    b"{{ '%0999999999d' % 1 }}",
    b"{{ 'x'.rjust(10**9) }}",
    b"{% set x = namespace() %}",
)


def _templates() -> list[Sample]:
    return [Sample(f".{p.parent.name}.{p.name}", p.read_bytes()) for p in sorted(TEMPLATES.glob("*/*.j2"))]


def _template(path: Path) -> object:
    """A shop's own template in the place of a bundled one: a program that reads back, or a refusal."""
    _, name, file, ending = path.name.split(".")
    folder = path.parent / "templates"
    shutil.rmtree(folder, ignore_errors=True)
    (folder / name).mkdir(parents=True)
    shutil.copyfile(path, folder / name / f"{file}.{ending}")
    kind = FORMATS[name].kinds[0]
    program, options = _written_options(name)
    written = write_program(program, name, kind, options, folder).texts()
    return round_trip(program, written, name, kind, options)


@cache
def _session() -> Session:
    # Equal springs: the bundled arm has none, and nothing would give way.
    model = build_model(load_description("kr60-3"), "rigid")
    cell = (EXAMPLES / "serve" / "cell.toml").read_text(encoding="utf-8")
    sprung = model.with_springs(dict.fromkeys(model.robot.joint_names, 1e6))
    return Session(sprung, parse_cell(cell, "cell", EXAMPLES / "serve"))


_POSE = [10.0, -80.0, 40.0, 15.0, 60.0, 20.0]
_AT = {"point_mm": [0, 0, 0], "tool_axis": [0.1, 0.2, 1]}
REQUESTS: tuple[dict[str, Any], ...] = (
    {"do": "hello"},
    {"do": "ping"},
    {"do": "fk", "q_deg": _POSE},
    {"do": "stiffness", "q_deg": _POSE, "direction": [0, 0, 1]},
    {"do": "deflection", "q_deg": [_POSE, _POSE], "force_N": [0, 0, -100]},
    {"do": "ik", **_AT, "gamma_deg": 10},
    {"do": "ik", "T": np.eye(4).tolist()},
    {"do": "set", "force_N": [0, 0, -100], "direction": [0, 0, 1], "travel_mm": [100]},
    {"do": "set", "reset": True, "part": {"position_mm": [1500, 0, 700], "rpy_deg": [0, 0, 10]}},
    {"do": "batch", "requests": [{"do": "ping"}, {"do": "fk", "q_deg": _POSE}]},
    {"do": "clearance", "q_deg": _POSE},
    {"do": "best_angle", **_AT},
    {"do": "quit"},
)


def _requests() -> list[Sample]:
    return [Sample(".json", json.dumps({"id": i, **request}).encode()) for i, request in enumerate(REQUESTS)]


def _serve(path: Path) -> object:
    session = _session()
    session.state, session.stopped = session.start, False
    for line in path.read_bytes().split(b"\n")[:5]:
        answer = session.answer(line)
        require(answer.endswith(b"\n") and answer.count(b"\n") == 1, "serve: an answer of more than one line")
        said = json.loads(answer, parse_constant=_no_constant)
        _no_internal_error(said)
    return None


def _no_constant(name: str) -> None:
    require(False, f"serve: {name} in an answer")


def _no_internal_error(said: Any) -> None:
    for one in [said, *said.get("answers", [])]:
        if not one.get("ok"):
            words = str(one["error"]["what"])
            kind = words.split(":")[1].strip() if "internal error" in words and ":" in words else ""
            require("internal error" not in words, f"serve internal error {kind}: {words[:300]}")


APT_WORDS, GCODE_WORDS = words(APT), words(GCODE)
PROGRAM: tuple[Mutation, ...] = (
    words(
        (
            b"END",
            b"ENDPROC",
            b"LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}",
            b"MoveL [[1,2,3],[1,0,0,0]]",
            b"PTP {A1 0}",
            b"G1 A1=1e308",
        )
    ),
)
_APT_FILES = sorted(path for path in SAMPLES.iterdir() if path.is_file() and path.suffix != ".nc")
_WING, _SLOT = EXAMPLES / "tx200_wing" / "cell.toml", EXAMPLES / "kr60_posture" / "milling.toml"
COMMAS = CURVE.replace(b";", b",")

READERS: dict[str, Reader] = {
    "tool path file: APT": Reader(lambda: texts(*_APT_FILES), _toolpath, (APT_WORDS,)),
    "tool path file: G-code": Reader(lambda: texts(*sorted(SAMPLES.glob("*.nc"))), _toolpath, (GCODE_WORDS,)),
    "tool path file: motions": Reader(lambda: [_neutral()], _motions, TABLE),
    "tool path file": Reader(lambda: [Sample(".csv", CURVE), Sample(".csv", COMMAS)], _path, TABLE),
    "tool path file: any": Reader(lambda: [Sample(".csv", COMMAS), _neutral()], _toolpath, TABLE),
    "cell file": Reader(lambda: [Sample(".toml", CELL), *texts(_WING)], _cell, (TOML,), cost=2.0),
    "milling file": Reader(lambda: [Sample(".toml", MILLING), *texts(_SLOT)], _milling, (TOML,)),
    "placement": Reader(_placements, _placement, (JSON,)),
    "options": Reader(_options_seeds, _options, (TOML, JSON)),
    "program": Reader(_programs, _read_program, (JSON, *TABLE), cost=2.0),
    "post.json": Reader(_records, lambda path: changed_since(path, path.parent / "krl" / "a.src"), (JSON,)),
    "controller program": Reader(_controller_seeds, _read_back, PROGRAM, cost=2.0),
    "template": Reader(_templates, _template, (words(JINJA),), cost=10.0),
    "request to a server": Reader(_requests, _serve, (JSON,), cost=3.0),
}
