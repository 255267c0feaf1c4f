"""What a diagnosis makes of the XR701's real readings, taken for a serial chain: at 650 N and at all loads.

    python benchmarks/diagnosis/xr701_serial.py [--write]

``--write`` writes benchmarks/diagnosis/results/xr701_serial.json, which docs/concepts/diagnosis.md and
docs/validation/xr701_tables.md have their figures from. It takes a minute or two.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from fanuc_nested import said

from benchmarks.asked import asked

PATH = "load-path"
COMMAND = ("diagnose", "xr701", "--load-path", "serial")
RESULTS = Path(__file__).parent / "results" / "xr701_serial.json"
# The third of the readings that the published scheme uses, and all of them.
RUNS = {"650 N": ("--loads", "650"), "all loads": ()}


def kept(content: dict[str, Any]) -> dict[str, Any]:
    """The figures that pages state, in their units; probabilities as shares."""
    named = [*content["effects"], *content["provisional"]]
    last = {c["code"]: c["probability"] for c in content["steps"][-1]["candidates"]}
    gap = content["gap"]
    return {
        "verdict": content["verdict"],
        "readings": content["readings"],
        "effects": {one["code"]: one["probability"] for one in named},
        "after_the_checks": content["stated_probability"],
        "last_look": last,
        "beyond_the_path": sum(p for code, p in last.items() if code not in ("none", PATH)),
        "rms_mm": {
            when: {key: value for key, value in gap[when].items() if key.endswith("_mm")}
            for when in ("before", "after")
        },
        "share_of_pose": {one["pose"]: one["share"] for one in content["where"]["pose"]},
        "odd_readings": [{key: one[key] for key in ("line", "load_N", "weight")} for one in content["outliers"]],
        "law_over_the_load": [
            {name: one["value"] for name, one in effect["parameters"].items()}
            for effect in named
            if effect["code"].startswith("learned-load")
        ],
        "not_testable": len(content["not_testable"]),
    }


def main() -> None:
    """Diagnose twice, and print or keep what came of it."""
    write = asked(__doc__, write=False).write
    text = json.dumps({name: kept(said(*COMMAND, *options)) for name, options in RUNS.items()}, indent=1) + "\n"
    if write:
        RESULTS.write_text(text, encoding="utf-8")
    else:
        sys.stdout.write(text)


if __name__ == "__main__":
    main()
