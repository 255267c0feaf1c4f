"""A CLS file of 1e5 points through the whole chain: read, posture, points put in, written, read back, verified.

    python benchmarks/shop/post_chain.py [--sizes 10000,30000,100000] [--write]

kr60-3 with rigid links, gamma chosen from a full turn, in a cell with spindle, table and floor. Each size runs in a
process of its own, so that the memory is its own. ``--write`` writes docs/performance/toolpaths.md.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np

PAGE = Path(__file__).resolve().parents[2] / "docs" / "performance" / "toolpaths.md"
T = TypeVar("T")
KINDS: tuple[tuple[str, Literal["cartesian", "joint"]], ...] = (
    ("krl", "cartesian"),
    ("krl", "joint"),
    ("json", "joint"),
)
HEAD = """# A tool path through the whole chain

<!-- figures from: benchmarks/shop/results/million_points.toml docs/performance/toolpaths.md -->
From a CLS file of 100,000 points to verified programs takes 21 s of processor time and at most 708 MB. Programs
that were read back are within 0.005 um of the tool path. A million points work too: `post` in 86 s and 3.8 GB,
`verify` in 101 s and 3.2 GB (one angle gamma, JSON). Memory grows with the path: it is held as arrays.

Written by `python benchmarks/shop/post_chain.py --write`: a CLS file is read, gamma chosen from a full turn, points
inserted where joint motion would leave the straight line, KRL programs (Cartesian and joint) and JSON written and
read back, and the program verified in a cell (continuous collision check). kr60-3, rigid links, one thread; processor
time, so that other work on the machine does not count. MB: resident memory after the stage.
"""

CELL = """
schema = "stiffarm-cell/1"
[tool]
position_mm = [200, 0, 80]
rpy_deg = [0, 90, 0]
[[tool.body]]
name = "spindle"
shape = { kind = "cylinder", diameter_mm = 90, length_mm = 150 }
position_mm = [150, 0, 80]
rpy_deg = [0, -90, 0]
[robot]
joint_speed_deg_s = [128, 102, 128, 260, 245, 322]
safety_mm = 5
[part]
position_mm = [1200, 200, 600]
[floor]
height_mm = 0
[[fixture]]
name = "table"
shape = { kind = "box", size_mm = [900, 600, 60] }
position_mm = [1200, 200, 400]
"""


def write_cls(path: Path, n: int) -> None:
    """A surface in rows that wander, its tool axis tilting along them; some 0.15 mm from point to point at 1e5."""
    u = np.linspace(0.0, 1.0, n)
    w = 80.0 * np.pi * u
    points = np.stack([300 * (u - 0.5) + 40 * np.sin(w), 120 * np.sin(0.37 * w), 15 * np.cos(0.2 * w)], axis=1)
    tilt = 0.1 * np.sin(0.05 * w)
    with path.open("w") as file:
        file.write(
            "TOOL PATH/SURF,TOOL,MILL10\nUNITS/MM\nTLDATA/MILL,10.0,1.0,75.0,0,0\nLOADTL/1\nSPINDL/RPM,9000,CLW\n"
        )
        file.write("RAPID\nGOTO/-150,0,60,0,0,1\nFEDRAT/MMPM,3000\n")
        for p, t in zip(points, tilt, strict=True):
            file.write(f"GOTO/{p[0]:.4f},{p[1]:.4f},{p[2]:.4f},{np.sin(t):.9f},0.0,{np.cos(t):.9f}\n")
        file.write("RAPID\nGOTO/0,0,80,0,0,1\nFINI\n")


def chain(n: int) -> dict[str, Any]:
    """Run the chain; seconds of processor time and resident megabytes after each stage."""
    import fem
    from machining import Drive, GammaRange
    from machining.cell import arm_of, parse_cell
    from machining.programs.formats import round_trip, write_program
    from machining.programs.posting import PostSettings, post
    from machining.toolpaths import read_toolpath
    from machining.verification import Demands, verify
    from robots import load_description

    stages: list[tuple[str, float, float]] = []

    def stage(name: str, work: Callable[[], T]) -> T:
        started = time.process_time()
        out = work()
        stages.append((name, time.process_time() - started, _resident()))
        return out

    model = fem.build_model(load_description("kr60-3"), links="rigid")
    with tempfile.TemporaryDirectory() as folder:
        where = Path(folder)
        write_cls(where / "part.cls", n)
        cell, arm = parse_cell(CELL, "cell", where), arm_of("kr60-3")
        stages.append(("start", 0.0, _resident()))
        wall = time.perf_counter()
        motions = stage("read", lambda: read_toolpath(where / "part.cls"))
        settings = PostSettings(gamma=GammaRange(), drive=Drive(speed=cell.joint_speed))
        posted = stage("posture and points put in", lambda: post(model, cell, motions, settings))
        worst = 0.0
        for name, kind in KINDS:
            written = write_program(posted.program, name, kind)
            stage(f"write {name} {kind}", partial(written.save, where.joinpath))
            texts = {file.name: (where / file.name).read_text(encoding="utf-8") for file in written.files}
            back = partial(round_trip, posted.program, texts, name, kind)
            worst = max(worst, stage(f"read back {name} {kind}", back).tip)
        found = stage("verify", lambda: verify(posted.program, arm, Demands()))
        wall = time.perf_counter() - wall
    return {
        "points": n,
        "moves": posted.program.n,
        "stages": stages,
        "wall_s": wall,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6,
        "off_path_m": worst,
        "clean": found.clean,
    }


def _resident() -> float:
    """Resident memory, MB."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6


def page(results: list[dict[str, Any]]) -> str:
    """The page's text."""
    lines = [HEAD, "| stage | " + " | ".join(f"{r['points']:,} points, s | MB" for r in results) + " |"]
    lines.append("| --- |" + " --- | --- |" * len(results))
    for row in zip(*(r["stages"] for r in results), strict=True):
        lines.append(f"| {row[0][0]} | " + " | ".join(f"{s:.1f} | {mb:.0f}" for _, s, mb in row) + " |")
    totals = [f"**{sum(s for _, s, _ in r['stages']):.1f}** | peak {r['peak_mb']:.0f}" for r in results]
    lines.append("| **all** | " + " | ".join(totals) + " |")
    off = max(r["off_path_m"] for r in results) * 1e6
    lines.append(f"\nPrograms read back are within {off:.2g} um of the tool path.")
    lines.append(f"In wall-clock time the largest took {results[-1]['wall_s']:.0f} s.")
    if len(results) > 1:
        a, b = results[-2:]
        more = (b["peak_mb"] - a["peak_mb"]) / (b["moves"] - a["moves"]) * 1e3
        lines.append(f"Memory grows by {more:.1f} kB per move.")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="10000,30000,100000")
    parser.add_argument("--one", type=int, help="run this size only, and print JSON")
    parser.add_argument("--write", action="store_true", help="write docs/performance/toolpaths.md")
    arguments = parser.parse_args()
    if arguments.one:
        print(json.dumps(chain(arguments.one)))
        return
    results = []
    for size in arguments.sizes.split(","):
        run = subprocess.run(  # noqa: S603 - our own interpreter
            [sys.executable, __file__, "--one", str(int(size))], capture_output=True, text=True, check=True
        )
        results.append(json.loads(run.stdout.splitlines()[-1]))
    text = page(results)
    print(text)
    if arguments.write:
        PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
