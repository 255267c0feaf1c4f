"""What a run's first screen says is missing: named effects with both errors; readings in doubt decide no headline."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from doe import bundled_data, read_measurements
from doe.tables.notes import ReadingNotes, bundled_notes
from robots import load_robot
from stiffarm.commands.run.doubts import Without
from stiffarm.commands.run.missing import Look, headlines


def look(
    verdict: str, codes: tuple[str, ...] = (), without: Without | None = None, title: str = "All readings"
) -> Look:
    effects = [SimpleNamespace(code=code) for code in codes]
    found: Any = SimpleNamespace(
        found=SimpleNamespace(verdict=verdict, effects=effects), unseen_rms_mm=(0.134, 0.077), in_model=effects
    )
    story: Any = None
    return Look(title, "diagnosis", found, story, {}, without)


@pytest.mark.parametrize(
    ("one", "value"),
    [
        (look("named", ("load-path",)), "load-path"),
        (look("named", ("load-path",), Without("named", ("load-path",), ("load-path",), "2")), "load-path"),
        (look("named", ("load-path",), Without("ambiguous", (), ("load-path",), "2")), "load-path"),
        (look("named", ("load-path",), Without("none", (), (), "2")), "not settled"),
        (look("unknown", (), Without("unknown", (), (), "2")), "unknown effect"),
        (look("unknown", (), Without("none", (), (), "2")), "not settled"),
        (look("none"), "nothing missing"),
    ],
)
def test_readings_in_doubt_decide_no_headline(one: Look, value: str) -> None:
    assert one.value == value
    assert ("without the readings in doubt" in one.label) == (one.without is not None)


def test_a_named_effect_stands_first_with_both_errors() -> None:
    serial, every = look("named", ("load-path",), title="The serial chain"), look("unknown")
    assert headlines((serial, every)) == (serial, every)
    assert "0.134 to 0.0770 mm" in serial.label
    unsure = look("named", ("load-path",), Without("none", (), (), "2"))
    assert headlines((unsure, every)) == (every,)


def test_doubts_of_the_bundled_readings_are_of_poses_and_loads_that_it_has() -> None:
    table = read_measurements(bundled_data("xr701"), load_robot("xr701"))
    held = [
        any(d.holds(*one) for d in bundled_notes("xr701").doubts)
        for one in zip(table.pose, table.loads_N.tolist(), strict=True)
    ]
    assert sum(held) == 8


def test_no_report_knows_a_robot() -> None:
    """What is known of one robot's readings stands beside them; only defaults and examples of commands name one."""
    commands = Path(__file__).parents[4] / "stiffarm" / "commands"
    files = [f for name in ("run", "diagnose", "sensitivity", "calibrate") for f in (commands / name).rglob("*.py")]
    text = {f: f.read_text(encoding="utf-8").lower() for f in files if f.name != "command.py"}
    assert [f.name for f, code in text.items() if "xr701" in code or "gotlih" in code] == []
    assert bundled_notes("fanuc-r2000ic") == ReadingNotes()
