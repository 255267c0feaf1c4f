"""A file with two tools, drilling, plunges and commands: from CAM to programs that switch the spindle as it says."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from cli_runs import Command, row_of

CELL = """schema = "stiffarm-cell/1"
[tool]
position_mm = [200, 0, 80]
rpy_deg = [0, 90, 0]
[robot]
joint_speed_deg_s = [128, 102, 128, 260, 245, 322]
[part]
position_mm = [1200, 200, 600]
[commands]
spindle_clockwise = 1
coolant_flood = 3
tool_change = "CHANGE_TOOL"
"""
NX = """TOOL PATH/ROUGH,TOOL,MILL
UNITS/MM
TLDATA/MILL,16,0,75,0,0
LOAD/TOOL,1
SPINDL/RPM,4000,CLW
COOLNT/FLOOD
RAPID
GOTO/0,0,30,0,0,1
FEDRAT/600,MMPM
GOTO/0,0,0
GOTO/20,0,0
GOTO/20,10,0
SPINDL/OFF
OPSTOP
END-OF-PATH
TOOL PATH/HOLES,TOOL,DRILL
TLDATA/DRILL,6,0,50
LOAD/TOOL,2
SPINDL/RPM,1500,CLW
RAPID
GOTO/5,5,10
CYCLE/DRILL,RAPTO,3,FEDTO,-10,MMPM,100,DWELL,0.5
GOTO/5,5,0
CYCLE/OFF
END-OF-PATH
"""
RIGID = ("--links", "rigid")


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    cell, cls = tmp_path / "cell.toml", tmp_path / "part.cls"
    cell.write_text(CELL)
    cls.write_text(NX)
    return cell, cls


@pytest.mark.slow
def test_a_tools_program_does_what_the_file_says_and_a_missing_stop_is_found(
    cli: Command, files: tuple[Path, Path], tmp_path: Path
) -> None:
    cell, cls = files
    out = tmp_path / "out"
    outcome = cli(
        "post",
        "kr60-3",
        cls,
        "--cell",
        cell,
        *RIGID,
        "--gamma",
        "65",
        "--tool-number",
        "1",
        "--format",
        "krl,json",
        "--out",
        out,
    )
    assert outcome.code == 0, outcome.err
    content = json.loads((out / "post.json").read_text(encoding="utf-8"))
    assert content["commands"] == {"operation": 1, "tool": 1, "spindle": 2, "coolant": 2, "optional stop": 1}
    undefined = row_of(content["programs"], program="krl_joint")["undefined_commands"]
    assert [(one["what"], one["first_line"]) for one in undefined] == [("spindle_speed", 5), ("optional_stop", 14)]
    text = (out / "krl_cartesian" / "part_001.src").read_text(encoding="utf-8")
    words = [line for line in text.splitlines() if line.startswith(("$OUT", "CHANGE", "HALT"))]
    assert words == ["CHANGE_TOOL(1)", "$OUT[1]=TRUE", "$OUT[3]=TRUE", "$OUT[1]=FALSE", "$OUT[3]=FALSE"]
    program = out / "json" / "part.json"
    assert cli("verify", "kr60-3", program, "--cell", cell).code == 0
    data = json.loads(program.read_text(encoding="utf-8"))
    data["events"] = [e for e in data["events"] if e.get("spindle_rpm") != 0.0]
    program.write_text(json.dumps(data), encoding="utf-8")
    found = cli("verify", "kr60-3", program, "--cell", cell, "--json")
    assert found.code == 1
    assert [o["kind"] for o in found.json["offences"]] == ["spindle, coolant or tool command"]


@pytest.mark.slow
def test_a_cutting_force_and_a_plunge_do_not_stop_posture(cli: Command, files: tuple[Path, Path]) -> None:
    cell, cls = files
    asked = ("posture", "kr60-3", cls, "--cell", cell, *RIGID, "--gamma", "60:70:5", "--json")
    force = ("--force", "0,50,0", "--force-axes", "process")
    outcome = cli(*asked, *force, "--operation", "rough")
    assert outcome.code == 0, outcome.err
    assert outcome.json["path_points"] == 3
    assert "plunge" in outcome.err


@pytest.mark.parametrize("command", ["posture", "place", "post"])
@pytest.mark.parametrize(
    ("choice", "says"),
    [
        ((), "--tool-number or --operation"),
        (("--operation", "MILLING"), "'ROUGH', 'HOLES'"),
        (("--tool-number", "3"), "allowed: 1, 2"),
    ],
)
def test_a_choice_is_asked_for_and_named(
    cli: Command, files: tuple[Path, Path], tmp_path: Path, command: str, choice: tuple[str, ...], says: str
) -> None:
    cell, cls = files
    more = {"post": ("--out", tmp_path / "no"), "place": ("--force", "1,0,0")}.get(command, ())
    outcome = cli(command, "kr60-3", cls, "--cell", cell, *RIGID, *more, *choice)
    assert outcome.code == 2
    assert says in outcome.err
    assert not (tmp_path / "no").exists()
