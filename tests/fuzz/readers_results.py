"""Readers of results that `compare` takes: JSON files of calibrations, diagnoses and placements, and maps' pages."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from robots import InputError
from stiffarm.commands.compare.command import CompareRequest, Comparison, answer
from stiffarm.commands.compare.map_page import page_of_both

from .mutate_forms import words as words_of
from .readers_arm import JSON
from .registry import Reader
from .samples import Sample
from .trial import require

_NUMBER = {"sd": 1.0, "unit": "N", "interval95": [28.0, 32.0], "plausible": [10, 80], "value": 30.0}
_SPRING = {"k_Nm_per_rad": 1e6, "interval95_Nm_per_rad": [9e5, 1.2e6]}
_FREE = {
    "name": "j2.stiffness",
    "unit": "N m/rad",
    "value": 1e6,
    "value_interval95": [9e5, None],
    "variable": "1/value",
    "sd_of_variable": 1e-7,
    "degrees_of_freedom": 20.0,
}
RESULTS: tuple[dict[str, Any], ...] = (
    {
        "schema": "stiffarm-diagnosis/2",
        "robot": "kr60-3",
        "verdict": "named",
        "springs": {"j2": _SPRING},
        "gap": {"before_mm": 0.2},
        "effects": [{"code": "payload", "parameters": {"force": _NUMBER}}],
        "readings": 90,
    },
    {"schema": "stiffarm-calibration/2", "robot": "kr60-3", "rms_mm": 0.1, "parameters": [_FREE]},
    {
        "schema": "stiffarm-placement/1",
        "robot": "tx200",
        "cell": "wing",
        "placements": {"recommended": {"K_sf": 1.0, "K_sf_95": [0.9, 1.1], "axes_mm": {}}},
    },
)
_MAP = {
    "kind": "slice",
    "n": 2,
    "axes": [],
    "fields": [{"name": "k"}],
    "reached": "AA==",
    "title": "map",
    "warning": "",
}
PAGE = (
    '<html><script>if (D.beside) go();</script><script type="application/json" id="data">'
    f"{json.dumps(_MAP)}</script></html>"
).encode()
HTML = words_of((b"<script", b"</script>", b'id="data"', b"<", b"&", b"{", b"}", b'"fields"', b"1e999", b"NaN"))


def _compared(path: Path) -> Comparison | None:
    """The file against a whole one of its kind, written as JSON and in words."""
    with tempfile.TemporaryDirectory() as folder:
        for number, content in enumerate(RESULTS):
            whole = Path(folder) / "whole.json"
            whole.write_text(json.dumps(content), encoding="utf-8")
            try:
                found = answer(CompareRequest(first=whole, others=(path,)))
            except InputError as error:
                if "allowed: things of one kind" in str(error) and number + 1 < len(RESULTS):
                    continue
                raise
            json.dumps(found.as_json, allow_nan=False)
            require(bool(found.answer), "comparison: no answer")
            for table in found.tables:
                table.texts()
            return found
    return None


def _page(path: Path) -> object:
    """The page with a whole one beside it, or none."""
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "map.html"
        whole.write_bytes(PAGE)
        return page_of_both(path, whole, "second"), page_of_both(whole, path, "second")


READERS: dict[str, Reader] = {
    "results file": Reader(lambda: [Sample(".json", json.dumps(c).encode()) for c in RESULTS], _compared, (JSON,)),
    "map's page": Reader(lambda: [Sample(".html", PAGE)], _page, (HTML,)),
}
