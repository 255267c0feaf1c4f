"""A five-axis part with three tools from CAM to checked programs, by an installed wheel, in an empty folder."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[4]
EXAMPLE = ROOT / "docs" / "examples" / "kr60_bracket"
ARM = "kr60-3"
GAMMA = ("--gamma", "-180:180:10")
COMMANDS = ("spindle", "coolant", "tool", "optional stop")


class Shop:
    """An empty folder with the wheel's packages first on the path."""

    def __init__(self, folder: Path, packages: Path) -> None:
        self.folder = folder
        self.environment = {**os.environ, "PYTHONPATH": str(packages)}

    def __call__(self, *arguments: str, code: int = 0) -> str:
        done = subprocess.run(  # noqa: S603 - our own command
            [sys.executable, *arguments],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )
        assert done.returncode == code, done.stderr + done.stdout
        return done.stdout

    def stiffarm(self, *arguments: str, code: int = 0) -> str:
        return self("-m", "stiffarm", *arguments, code=code)

    def post(self, file: str, *more: str) -> dict[str, Any]:
        self.stiffarm("post", ARM, file, "--cell", "cell.toml", *GAMMA, *more)
        made = self.folder / more[more.index("--out") + 1] / "json" / f"{Path(file).stem}.json"
        return json.loads(made.read_text("utf-8"))


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Shop:
    place = tmp_path_factory.mktemp("walk")
    # From a copy: building leaves folders behind.
    packages = [path.name for path in ROOT.iterdir() if (path / "__init__.py").is_file() and path.name != "tests"]
    source = place / "source"
    for name in packages:
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    made = subprocess.run(  # noqa: S603
        [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(place), str(source)],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    if made.returncode and re.search("connection|index|resolve|network", made.stderr, re.IGNORECASE):
        pytest.skip("no package index, so no setuptools to build a wheel with")
    assert made.returncode == 0, made.stderr
    installed, folder = place / "packages", place / "empty"
    (wheel,) = place.glob("stiffarm-*.whl")
    shutil.unpack_archive(wheel, installed, "zip")
    folder.mkdir()
    shop = Shop(folder, installed)
    assert shop("-c", "import stiffarm; print(stiffarm.__file__)").startswith(str(installed))
    for file in EXAMPLE.glob("*.toml"):
        shutil.copy(file, folder)
    shop(str(EXAMPLE / "make_part.py"), str(folder))
    return shop


def commands(program: dict[str, Any]) -> list[tuple[str, object]]:
    """Commands in their order: what is switched to what, without places, which differ by a move."""
    out: list[tuple[str, object]] = []
    for event in program["events"]:
        if event["kind"] in COMMANDS:
            value = {"spindle": round(event.get("spindle_rpm") or 0.0), "coolant": event["text"]}.get(event["kind"])
            tool = event.get("tool")
            out.append((event["kind"], program["tools"][int(tool)]["number"] if event["kind"] == "tool" else value))
    return out


@pytest.mark.slow
@pytest.mark.parametrize("file", ["bracket.cls", "bracket.mpf"])
def test_from_cam_to_a_checked_program(shop: Shop, file: str) -> None:
    out = file.replace(".", "_")
    program = shop.post(file, "--format", "krl,sinumerik,json", "--out", out)
    assert [number for kind, number in commands(program) if kind == "tool"] == [1, 2, 3]
    assert commands(program) == [
        ("tool", 1),
        ("spindle", 8000),
        ("coolant", "flood"),
        ("coolant", "off"),
        ("spindle", 0),
        ("tool", 2),
        ("spindle", 12000),
        ("coolant", "mist"),
        ("coolant", "off"),
        ("spindle", 0),
        ("optional stop", None),
        ("tool", 3),
        ("spindle", 3000),
        ("coolant", "flood"),
        ("coolant", "off"),
        ("spindle", 0),
    ]
    krl = (shop.folder / out / "krl_cartesian" / "bracket_001.src").read_text("utf-8")
    order = re.findall(r"CHANGE_TOOL\(\d\)|^\$TOOL|\$OUT\[12\]=\w+|HALT", krl, re.MULTILINE)
    on, off = "$OUT[12]=TRUE", "$OUT[12]=FALSE"
    each = [[f"CHANGE_TOOL({k})", "$TOOL", on, off] for k in (1, 2, 3)]
    assert order == [*each[0], *each[1], "HALT", *each[2]]
    sinumerik = (shop.folder / out / "sinumerik_joint" / "BRACKET_001.SPF").read_text("utf-8")
    assert re.findall(r"^(T\d M6|M1|S\d+\S* M3|M5)$", sinumerik, re.MULTILINE) == [
        "T1 M6",
        "S8000.000 M3",
        "M5",
        "T2 M6",
        "S12000.000 M3",
        "M5",
        "M1",
        "T3 M6",
        "S3000.000 M3",
        "M5",
    ]
    said = shop.stiffarm("verify", ARM, f"{out}/json/bracket.json", "--cell", "cell.toml", "--json")
    found = json.loads(said)
    assert found["offences"] == []


@pytest.mark.slow
def test_both_dialects_lead_the_tools_alike(shop: Shop) -> None:
    """Cutting moves of both files end at the same points; rapid ones to holes differ by how their cycles enter."""
    ends = {}
    for file in ("bracket.cls", "bracket.mpf"):
        program = shop.post(file, "--format", "json", "--out", "same_" + file[-3:])
        at = {name: i for i, name in enumerate(program["columns"])}
        ends[file] = [
            (program["tools"][row[at["tool"]]]["number"], *(round(row[at[c]], 3) for c in ("x_mm", "y_mm", "z_mm")))
            for row in program["moves"]
            if not row[at["rapid"]] and not row[at["inserted"]]
        ]
    assert ends["bracket.cls"] == ends["bracket.mpf"]
    assert len(ends["bracket.cls"]) == 106


@pytest.mark.slow
def test_a_spindle_that_does_not_stop_is_found(shop: Shop) -> None:
    """The stop before the second tool is taken out of the program: it would be changed while it turns."""
    program = shop.post("bracket.cls", "--format", "json", "--out", "planted")
    stops = [e for e in program["events"] if e["kind"] == "spindle" and e["spindle_rpm"] == 0.0]
    program["events"].remove(stops[0])
    first = next(
        e["before_move"]
        for e in program["events"]
        if e["kind"] == "spindle" and round(e["spindle_rpm"] or 0.0) == 12000
    )
    column = program["columns"].index("spindle_rpm")
    for row in program["moves"][stops[0]["before_move"] : first]:
        row[column] = 8000.0
    (shop.folder / "spoilt.json").write_text(json.dumps(program), encoding="utf-8")
    said = shop.stiffarm("verify", ARM, "spoilt.json", "--cell", "cell.toml", "--json", code=1)
    found = json.loads(said)["offences"]
    assert [one["kind"] for one in found] == ["spindle, coolant or tool command"]


@pytest.mark.slow
def test_postures_for_all_tools_at_once(shop: Shop) -> None:
    said = shop.stiffarm("posture", ARM, "bracket.cls", "--cell", "cell.toml", *GAMMA, "--json")
    found = json.loads(said)
    assert found["courses"]
    assert found["tool_on_flange"].count("then") == 1  # The drill cuts nothing sideways.
    # The milling files that the cell names act, each where its tool is.
    assert found["surface_error"]
