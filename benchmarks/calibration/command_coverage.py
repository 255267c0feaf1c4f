"""Do the intervals of `calibrate` hold the truth, and how often does it warn? Through the function that users call.

    python benchmarks/calibration/command_coverage.py [--repeats 100] [--write FOLDER]

Each repeat draws springs, poses and noise, writes a measurement table and calls ``stiffarm.read_readings`` and
``stiffarm.calibrate`` on it, as the command does; the arm and its readings are those of ``own_arm.py``. Counted are
intervals that hold the truth, their half widths beside those of plain least squares, and tables with each warning.
``--write benchmarks/calibration/results`` keeps ``command_coverage.json``; docs/validation/calibration_coverage.md
states its figures.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from own_arm import SPRINGS, Campaign, MASS_kg, PAYLOAD_kg, dh_table, read, write
from scipy.special import stdtrit

import stiffarm as sa
from benchmarks.asked import asked

# Springs are drawn around those of the arm: give or take 40 % (one standard deviation of the logarithm).
SPREAD = 0.4
CODES = ("drift", "not-proportional", "set-ups-differ", "sigma", "class")
DOWN = (1, 2, 3, 4)
CASES = {
    "white 6 um": Campaign(),
    "white 20 um": Campaign(noise=20e-6),
    "white 6 um, 2 repeats": Campaign(repeats=2),
    "white 150 um": Campaign(noise=150e-6),
    "eight set-ups": Campaign(poses=8),
    "Z alone": Campaign(read="z"),
    "up and down": Campaign(unload=True),
    "sigma_mm right": Campaign(sigma_mm=0.006),
    "set-ups 2 %": Campaign(setup=0.02),
    "set-ups 2 %, every way": Campaign(setup=0.02, every_way=True, repeats=2),
    "drift 60 um": Campaign(drift=60e-6, steps=True),
    "drift 20 um": Campaign(drift=20e-6, steps=True),
    "drift 60 um, set-ups 2 %": Campaign(drift=60e-6, setup=0.02, steps=True),
    "play 0.3 mrad": Campaign(play=0.3e-3, unload=True),
    "play 0.1 mrad": Campaign(play=0.1e-3),
    "play 0.3 mrad, one load": Campaign(play=0.3e-3, loads=(500.0,), repeats=3),
    "friction 60 N m": Campaign(friction=60.0, unload=True),
}
# Cases in which the springs are all there is, so that a warning is a false one.
RIGHT = tuple(name for name in CASES if name.split()[0] not in ("drift", "play", "friction"))


def arm(folder: Path) -> sa.Arm:
    """The arm as users make it of its table."""
    return sa.new_arm("mine", mdh=dh_table(folder / "dh.csv"), payload_kg=PAYLOAD_kg, mass_kg=MASS_kg).arm


def study(name: str, repeats: int, folder: Path) -> dict[str, Any]:
    """Counts of one case; the same for the same number of repeats."""
    c, mine = CASES[name], arm(folder)
    by_joint: dict[str, list[bool]] = {}
    statuses: list[str] = []
    widths: list[float] = []
    warned: dict[str, int] = dict.fromkeys(CODES, 0)
    tables = 0
    for seed in range(repeats):
        rng = np.random.default_rng([seed, *name.encode()])
        springs = SPRINGS * np.exp(SPREAD * rng.normal(size=6))
        r = read(c, rng, springs)
        file = write(c, r, folder / "readings.csv")
        found = sa.calibrate(mine, sa.read_readings(file, mine))
        codes = {doubt.code for doubt in found.found.doubts}
        tables += bool(codes)
        for code in codes:
            warned[code] += 1
        seen = (0, 1, 2, 3, 4, 5) if c.every_way else DOWN
        plain = dict(zip(seen, r.least_squares(seen)[1], strict=True)) if c.read == "xyz" else {}
        t = float(stdtrit(3 * len(r.q) - len(seen), 0.975))
        for one in found.parameters:
            statuses.append(one.status)
            low, high = one.interval95
            k = int(one.name[1]) - 1
            if one.status == "not identified":
                continue
            by_joint.setdefault(one.name[:2], []).append(bool(low <= springs[k] <= high))
            if k in plain and one.status == "determined":
                widths.append(0.5 * (1.0 / low - 1.0 / high) / (t * plain[k]))
    every = [one for joint in by_joint.values() for one in joint]
    return {
        "intervals": len(every),
        "inside": sum(every),
        "coverage": round(float(np.mean(every)), 4),
        "by_joint": {joint: round(float(np.mean(v)), 4) for joint, v in sorted(by_joint.items())},
        "half_width_over_least_squares": round(float(np.median(widths)), 3) if widths else None,
        "determined": round(statuses.count("determined") / len(statuses), 4),
        "tables": repeats,
        "tables_warned": tables,
        "warned": warned,
    }


def main() -> None:
    arguments = asked(__doc__, repeats=100, case=[*CASES], write=Path)
    rows: dict[str, Any] = {}
    with TemporaryDirectory() as folder:
        for name in arguments.case or CASES:
            rows[name] = study(name, arguments.repeats, Path(folder))
            sys.stderr.write(f"{name:28} {json.dumps(rows[name])}\n")
    right = [rows[name] for name in RIGHT if name in rows]
    content = {
        "command": f"python benchmarks/calibration/command_coverage.py --repeats {arguments.repeats}",
        "right_tables": sum(row["tables"] for row in right),
        "right_tables_warned": {code: sum(row["warned"][code] for row in right) for code in CODES},
        "cases": rows,
    }
    text = json.dumps(content, indent=1) + "\n"
    if arguments.write is None:
        sys.stdout.write(text)
    else:
        (arguments.write / "command_coverage.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
