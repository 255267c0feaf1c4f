"""Cell, milling, option and placement files with numbers that nobody meant: one clear error."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from refusals import refuses

from machining.cell import read_cell
from machining.cutting.milling_file import read_milling
from machining.placement.file import SCHEMAS, read_placement
from machining.programs.formats import read_options

MILLING = """schema = "stiffarm-milling/1"
mill = {{ diameter_mm = {diameter}, teeth = {teeth}, helix_deg = {helix} }}
cut = {{ kind = "slot", axial_depth_mm = 1, feed_per_tooth_mm = 0.1 }}
material = {{ tc_N_per_mm2 = {tc}, te_N_per_mm = 1, rc_N_per_mm2 = 1, re_N_per_mm = 1, source = "s" }}
"""
RIGHT: dict[str, Any] = {"diameter": 10, "teeth": 2, "helix": 30, "tc": 800}
PLACEMENT: dict[str, Any] = {
    "schema": SCHEMAS[-1],
    "robot": "r",
    "cell": "c",
    "linear_axes": ["rail"],
    "turntable_deg": 0.0,
    "source_moves": 2,
    "points": {"move": [0, 1], "e1_mm": [0, 1], "gamma_deg": [0, 0], "q1_deg": [0, 1]},
}


@pytest.mark.parametrize(
    "change", [{"diameter": 1e308}, {"diameter": 1e-300}, {"teeth": 10**18}, {"helix": 89.999999}, {"tc": 1e308}]
)
def test_milling_files(tmp_path: Path, change: dict[str, Any]) -> None:
    file = tmp_path / "milling.toml"
    file.write_text(MILLING.format(**RIGHT))
    read_milling(file)
    file.write_text(MILLING.format(**RIGHT | change))
    refuses("F011", next(iter(change)), read_milling, file)


@pytest.mark.parametrize(
    "text",
    [
        "[part]\nposition_mm = [1e308, 0, 0]",
        '[[fixture]]\nname = "f"\nshape = { kind = "box", size_mm = [1e-300, 1, 1] }',
        '[[fixture]]\nname = "f"\nshape = { kind = "sphere", diameter_mm = 1e308 }',
        '[[linear_axis]]\nname = "x"\ndirection = [1, 0, 0]\nlimits_mm = [-1e300, 1e300]',
        "[robot]\nsafety_mm = 1e308",
    ],
)
def test_cell_files(tmp_path: Path, text: str) -> None:
    (tmp_path / "cell.toml").write_text(f'schema = "stiffarm-cell/1"\n{text}\n')
    refuses("F011", "cell.toml", read_cell, tmp_path / "cell.toml")


@pytest.mark.parametrize("text", ["rapid_mm_s = 1e308", "blend_mm = 1e308", "rotation_deg_s = 1e-300"])
def test_options(tmp_path: Path, text: str) -> None:
    (tmp_path / "post.toml").write_text(text)
    refuses("F011", text.split()[0], read_options, tmp_path / "post.toml")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"source_moves": 10**18}, "source_moves"),
        ({"source_moves": 1.5}, "source_moves"),
        ({"turntable_deg": 1e308}, "turntable_deg"),
        ({"turntable_deg": float("inf")}, "Infinity is not a number"),
        ({"turntable_deg": None}, "turntable_deg"),
        ({"points": PLACEMENT["points"] | {"move": [0, 0.5]}}, "move"),
        ({"points": PLACEMENT["points"] | {"q1_deg": [0, float("inf")]}}, "Infinity is not a number"),
        ({"points": PLACEMENT["points"] | {"e1_mm": [0, 1e300]}}, "e1_mm"),
    ],
)
def test_placements(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    file = tmp_path / "placement.json"
    file.write_text(json.dumps(PLACEMENT))
    assert read_placement(file).count == 2
    file.write_text(json.dumps(PLACEMENT | change))
    refuses("F005 F006", message, read_placement, file)
