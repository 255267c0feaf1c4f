"""Made-up tables like the XR701's: same seed, same bytes; balanced; what is hidden is there; and what is counted."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from xr701_power import of_cell, page, power
from xr701_tables import CELLS, REAL, make, table

from benchmarks.diagnosis.study.sets import study_sets
from benchmarks.diagnosis.study.step import kind_of


@pytest.mark.slow
def test_same_seed_same_bytes_and_the_real_tables_layout(tmp_path: Path) -> None:
    for name in ("a", "b"):
        make(tmp_path / name, 3, 16)
    make(tmp_path / "c", 4, 1)
    texts = {n: [(tmp_path / n / f"table-{k:03d}/readings.csv").read_text() for k in (1, 16)] for n in ("a", "b")}
    assert texts["a"] == texts["b"]
    assert texts["a"][0] != (tmp_path / "c/table-001/readings.csv").read_text()
    real, made = ([row[:-1] for row in csv.reader(text.splitlines())] for text in (REAL.read_text(), texts["a"][0]))
    assert made == real
    sets = study_sets(tmp_path / "a")
    assert len(sets) == 16
    kinds = [kind_of(one, ("load-path",)) for one in sets]
    assert [kinds.count(kind) for kind in ("none", "single", "outside", "pair")] == [4, 4, 8, 0]
    assert {one.file.load_path for one in sets} == {"serial"}


@pytest.mark.slow
def test_what_is_hidden_is_in_the_readings() -> None:
    some = [table(0, k) for k in range(2 * len(CELLS))]
    load = np.abs([float(row["fz_N"]) for row in csv.DictReader(REAL.read_text().splitlines())])
    for t in some:
        path, serial, both = t.excess
        # Springs of the serial chain follow the serial arm, and do not follow the parallelogram.
        if t.path:
            assert path > 30.0
        if not t.short:
            assert both == pytest.approx(path)
            assert serial == pytest.approx(0.0, abs=1e-6)
        else:
            assert serial > 30.0
        assert len(t.odd) == (2 if CELLS[t.index % 8][1] else 0)
        assert (load[list(t.odd)] > 150.0).all()
        np.testing.assert_allclose(t.read * 1e5, np.round(t.read * 1e5), atol=1e-6)
        assert (t.read[load == 650.0] < -5e-4).all()
    assert some[0].odd == (9, 10)
    # Without the two odd ones, load over deflection hardly varies with the load; short readings stand out.
    plain = [t for t in some if not t.odd and not t.short]
    short = [t for t in some if not t.odd and t.short]
    ratio = [
        [np.mean(t.read[load == 150.0]) / np.mean(t.read[load == 650.0]) * 650 / 150 for t in x] for x in (plain, short)
    ]
    np.testing.assert_allclose(ratio[0], 1.0, atol=0.08)
    assert max(ratio[1]) < 0.92


def outcome(path: bool, odd: bool, **said: object) -> dict[str, object]:
    start = {
        "path": path,
        "odd": odd,
        "shortfall": False,
        "verdict": "none",
        "named": [],
        "path_probability": 0.1,
        "path_in_set95": False,
        "beyond_path": 0.2,
        "odd_lines": [],
        "truly_odd": [11, 12] if odd else [],
    }
    return start | said


def test_what_is_counted_of_tables() -> None:
    named = outcome(True, True, verdict="named", named=["load-path"], path_probability=0.97, odd_lines=[11, 12, 14])
    wrong = outcome(False, False, verdict="named", named=["friction:j2"], beyond_path=None)
    cells = power([named, outcome(True, False), wrong])
    assert cells["path hidden: all"]["path_named"]["count"] == 1
    assert cells["path hidden: two odd readings"]["odd_both_flagged"]["count"] == 1
    assert cells["path hidden: two odd readings"]["others_flagged"]["count"] == 1
    assert cells["path hidden: no more"]["odd_both_flagged"]["count"] == 0
    serial = cells["serial arm, nothing to find of the path: all"]
    assert (serial["another_name"]["count"], serial["path_named"]["count"]) == (1, 0)
    assert of_cell([wrong])["beyond_path_median"] is None
    assert "| path hidden: all | 2 | 1 (1 to 99 %)" in page(cells, {"verdict": "none"})
