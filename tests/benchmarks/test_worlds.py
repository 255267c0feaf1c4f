"""Sets of every world: complete folders, the same bytes by the same seed, sheets filled by the same truth."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import Any

import numpy as np
import oracles
import pytest

from benchmarks.worlds.shared import csv_text, key_in, sheet_rows
from robots import load_description

ROOT = Path(__file__).resolve().parents[2]
# What each stands on, and mm that a reading may be off by in the middle: noise, scatter, a gauge that is set up anew.
WORLDS = {
    "equilibrium": ("mujoco", 0.045),
    "frame": ("openseespy.opensees", 0.09),
    "motors": ("", 0.1),
    "screws": ("", 0.1),
    "shopfloor": ("pinocchio", 0.1),
}
KINDS = {"single": 1, "none": 0, "outside": 1, "pair": 2, "pairs": 2}


def world(name: str) -> Any:
    needed = WORLDS[name][0]
    if needed:
        oracles.load_apart(needed)
    return importlib.import_module(f"benchmarks.worlds.{name}.sets")


@pytest.fixture(scope="module", params=WORLDS)
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    out = tmp_path_factory.mktemp(request.param)
    assert len(world(request.param).make(out, 5, single=2, none=1, outside=1, pairs=1)) == 5
    return request.param, out


def rows_of(path: Path) -> list[dict[str, str]]:
    return sheet_rows(path.read_text(encoding="utf-8"))


def test_folders_are_as_the_study_wants_them(made: tuple[str, Path]) -> None:
    name, out = made
    for folder in sorted(out.iterdir()):
        key, rows, unseen = key_in(folder), rows_of(folder / "readings.csv"), rows_of(folder / "unseen.csv")
        assert (key["schema"], key["world"]) == ("stiffarm-study-key/1", name)
        assert len(key["effects"]) == KINDS[folder.name.split("-")[0]]
        assert len({effect["place"] for effect in key["effects"]}) == len(key["effects"]) or name == "equilibrium"
        assert key["effects"] or key["excess_chi2"] < 1e-4 or name == "equilibrium"
        assert len({row["pose"] for row in rows}) == key["tags"]["poses"]
        assert ("dx_mm" in rows[0]) == (key["tags"]["reads"] == "xyz")
        assert len({row["pose"] for row in unseen}) in (12, 40)
        times = [float(row["time_s"]) for row in rows if "time_s" in row]
        assert times == sorted(times)
        (model,) = folder.glob("model.*")
        arm = load_description(str(model))
        assert {joint.coordinate for joint in arm.joint} <= rows[0].keys() & unseen[0].keys()


@pytest.mark.slow
def test_the_same_seed_writes_the_same_bytes(made: tuple[str, Path], tmp_path: Path) -> None:
    name, out = made
    for folder in world(name).make(tmp_path, 5, single=1, none=1, outside=0, pairs=0):
        for path in folder.iterdir():
            assert path.read_bytes() == (out / folder.name / path.name).read_bytes(), path
    with pytest.raises(ValueError, match="there already"):
        world(name).make(tmp_path, 5, single=1, none=0, outside=0, pairs=0)


def test_a_sheet_is_filled_by_the_same_truth(made: tuple[str, Path]) -> None:
    """Held-out set-ups of a set as a sheet: what is read is near what is written there, each visit by its own noise."""
    name, out = made
    folder = next(out.glob("none-*"))
    asked = rows_of(folder / "unseen.csv")
    sheet = csv_text(asked)
    fill = world(name).fill
    first, second = fill(folder, sheet, 1), fill(folder, sheet, 2)
    assert first == fill(folder, sheet, 1) != second
    filled = sheet_rows(first)
    assert [(row["pose"], row["fz_N"]) for row in filled] == [(row["pose"], row["fz_N"]) for row in asked]
    off = [float(a["dz_mm"]) - float(b["dz_mm"]) for a, b in zip(filled, asked, strict=True)]
    assert np.median(np.abs(off)) < WORLDS[name][1]
    last = rows_of(folder / "readings.csv")[-1]
    assert float(filled[0].get("time_s", 1)) > float(last.get("time_s", 0))


def test_families_are_those_that_the_page_lists() -> None:
    page = (ROOT / "docs" / "how-to" / "effects.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`[^|]+) \|", page, re.M)
    listed = {code.split(":")[0] for row in rows for code in re.findall(r"`([^`]+)`", row)}
    for name, module, share in (("frame", "other_laws", 3), ("motors", "readings", 2)):
        laws = importlib.import_module(f"benchmarks.worlds.{name}.{module}")
        assert set(laws.KNOWN) == listed
        assert not set(laws.STRANGE) & listed
        late = [law for law in laws.STRANGE.values() if {"clock", "load history"} & set(law.axes)]
        assert len(late) >= max(len(laws.STRANGE) / share, 4)
