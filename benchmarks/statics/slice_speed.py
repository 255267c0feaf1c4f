"""Processor time of the stiffest poses of a default slice, and by how much a denser search beats them.

    python benchmarks/statics/slice_speed.py [--write]

``--write`` writes docs/performance/slices.md. The times "before" are of the search that looked at every point by itself
(200 axes, 16 starts each), on the machine that this page was first written on.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from benchmarks.asked import asked
from stiffarm.commands.maps.request import SliceRequest
from stiffarm.request import FRAME
from stiffarm.session.inputs import read_model
from surrogate.maps import self_motion
from surrogate.maps.layouts import points_of
from surrogate.maps.poses import Extreme, shortfall

PAGE = Path(__file__).resolve().parents[2] / "docs" / "performance" / "slices.md"
# Arm, options, seconds before.
CASES: tuple[tuple[str, dict[str, str], float], ...] = (
    ("kr60-3", {}, 8.0),
    ("tx200", {}, 7.9),
    ("xr701", {}, 4.3),
    ("kr60-3", {"--pose": "softest"}, 7.5),
    ("kr60-3", {"--best-by": "worst"}, 10.4),
    ("kr60-3", {"--tool": "200,0,80,0,90,0"}, 14.9),
)
# Points that a denser search looks at.
CHECKED = 60
HEAD = """# Speed of slices of extreme poses

<!-- figures from: docs/performance/slices.md -->
The stiffest or softest pose at every point of a slice takes 0.4 to 1.4 s, 10 to 13 times less than searching each
point separately. A search four times as dense finds at most 0.03 % more, except with a tool beside the axis of joint
6: there 7 % of the points checked are short, the worst by 19 %.

Measured by `python benchmarks/statics/slice_speed.py --write`: processor seconds for the stiffest (or softest) pose at
every point of the default xz slice, without files and pictures. *Before*: every point separately. *numpy*: the same
search without numba. *Denser*: by how much a search with four times as many orientations beats the map, at {checked}
points: the worst and the share of points above 1e-4.

| arm | options | points, reached | s | before, s | times as fast | numpy, s | denser |
|---|---|---|---|---|---|---|---|
"""
TAIL = """
Each point passes its pose to its neighbours, whose search continues from there. A tool point beside the axis of joint 6
has three free motions instead of two, and more local optima.
"""


def row(robot: str, options: dict[str, str], before: float) -> str:
    given = read_model(robot, None, None)
    tool = FRAME.of(options["--tool"], "--tool") if "--tool" in options else None
    pose, best_by = options.get("--pose", "stiffest"), options.get("--best-by", "stiffness")
    engine = SliceRequest(values=("stiffness",), pose=pose, best_by=best_by, tool=tool).engine(given)
    rule, arm, points = engine.rule, engine.arm, points_of(engine.grid)
    assert isinstance(rule, Extreme)
    assert arm is not None
    rule.choose(arm, points[:: len(points) // 40])  # loads and compiles what it needs

    def timed() -> tuple[float, np.ndarray]:
        started = time.process_time()
        blocks = range(0, len(points), engine.size)
        q = np.concatenate([rule.choose(arm, points[i : i + engine.size]).q for i in blocks])
        return time.process_time() - started, q

    seconds, q = min((timed() for _ in range(3)), key=lambda one: one[0])
    there = np.flatnonzero(np.isfinite(q).all(axis=1))
    some = there[np.linspace(0, len(there) - 1, CHECKED).astype(int)]
    short = shortfall(rule, arm, points[some], q[some])
    compiled = self_motion.loops
    self_motion.loops = lambda: None  # type: ignore[assignment]
    plain, _ = timed()
    self_motion.loops = compiled
    words = " ".join(f"`{name} {value}`" for name, value in options.items()) or "-"
    worse = f"{100.0 * np.nanmax(short):.2g} %, {100.0 * np.mean(short > 1e-4):.0f} %"
    cells = (robot, words, f"{len(points)}, {len(there)}", f"{seconds:.2f}", f"{before:.1f}", f"{before / seconds:.0f}")
    return "| " + " | ".join((*cells, f"{plain:.1f}", worse)) + " |"


def main() -> None:
    wanted = asked(__doc__, write=False)
    text = HEAD.format(checked=CHECKED) + "\n".join(row(*case) for case in CASES) + "\n" + TAIL
    sys.stdout.write(text)
    if wanted.write:
        PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
