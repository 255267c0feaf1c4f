"""A CLS file of 1e5 points through the whole chain: read, posture, points put in, written, read back, verified.

    python benchmarks/shop/post_chain.py [--sizes 10000,30000,100000] [--write]

kr60-3 with rigid links, gamma chosen from a full turn, in a cell with spindle, table and floor. Each size runs in a
process of its own, so that the memory is its own; so do `post` and `verify` with a million points. ``--write`` writes
docs/performance/toolpaths.md.
"""

from __future__ import annotations

import json
import os
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

from benchmarks.asked import asked

PAGE = Path(__file__).resolve().parents[2] / "docs" / "performance" / "toolpaths.md"
T = TypeVar("T")
# Processor time (s) and greatest memory (MB) of each command.
Costs = dict[str, tuple[float, float]]
KINDS: tuple[tuple[str, Literal["cartesian", "joint"]], ...] = (
    ("krl", "cartesian"),
    ("krl", "joint"),
    ("json", "joint"),
)
HEAD = """# A tool path through the whole chain

From a CLS file of {points:,} points to verified programs takes {seconds:.0f} s of processor time and at most
{peak:.1f} GB. Programs that were read back are within {off:.2g} um of the tool path. A path of a million points, with
one angle gamma and a JSON program, takes {million}. Memory grows with
the path, which is held as arrays: by {post:.1f} kB a move in `post` and {verify:.1f} kB in `verify`.

Written by `python benchmarks/shop/post_chain.py --write`: a CLS file is read, gamma chosen from a full turn, points
inserted where joint motion would leave the straight line, KRL programs (Cartesian and joint) and JSON written and
read back, and the program verified in a cell (continuous collision check). kr60-3, rigid links, one thread; processor
time, so that other work on the machine does not count. MB: resident memory after the stage.
"""
# What the commands are given for a path of 2,000 points, and of a million: its growth is that of memory.
FEW, MANY = 2_000, 1_000_000

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
    return {
        "points": n,
        "stages": stages,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6,
        "off_path_m": worst,
        "clean": found.clean,
    }


def _resident() -> float:
    """Resident memory, MB."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6


def command(arguments: list[str], folder: Path) -> tuple[float, float]:
    """Processor time (s) and greatest resident memory (MB) of one of the commands."""
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    with (folder / "said.txt").open("w") as said:
        run = subprocess.Popen(  # noqa: S603 - our own interpreter
            [sys.executable, "-m", "stiffarm", *arguments], cwd=folder, env=environment, stdout=said, stderr=said
        )
        _, status, used = os.wait4(run.pid, 0)
    if status != 0:
        raise SystemExit(f"{' '.join(arguments)}: {(folder / 'said.txt').read_text()}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / 1e6


def commands(n: int) -> Costs:
    """Processor time and memory of `post` and `verify` for a path of n points."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_cls(folder / "part.cls", n)
        (folder / "cell.toml").write_text(CELL)
        made = [
            "--cell",
            "cell.toml",
            "--gamma",
            "90",
            "--links",
            "rigid",
            "--format",
            "json",
            "--coordinates",
            "joint",
        ]
        return {
            "post": command(["post", "kr60-3", "part.cls", *made, "--out", "program"], folder),
            "verify": command(
                ["verify", "kr60-3", "program/json/part.json", "--cell", "cell.toml", "--out", "checked"], folder
            ),
        }


def page(results: list[dict[str, Any]], few: Costs, many: Costs) -> str:
    """The page's text."""
    last = results[-1]
    grown = {name: (many[name][1] - few[name][1]) / (MANY - FEW) * 1e3 for name in many}
    head = HEAD.format(
        points=last["points"],
        seconds=sum(s for _, s, _ in last["stages"]),
        peak=last["peak_mb"] * 1e-3,
        off=max(r["off_path_m"] for r in results) * 1e6,
        million=" and ".join(f"{s:.0f} s and {mb * 1e-3:.1f} GB in `{name}`" for name, (s, mb) in many.items()),
        **grown,
    )
    lines = [head, "| stage | " + " | ".join(f"{r['points']:,} points, s | MB" for r in results) + " |"]
    lines.append("| --- |" + " --- | --- |" * len(results))
    for row in zip(*(r["stages"] for r in results), strict=True):
        lines.append(f"| {row[0][0]} | " + " | ".join(f"{s:.1f} | {mb:.0f}" for _, s, mb in row) + " |")
    totals = [f"**{sum(s for _, s, _ in r['stages']):.1f}** | peak {r['peak_mb']:.0f}" for r in results]
    lines.append("| **all** | " + " | ".join(totals) + " |")
    lines += ["", "The commands, each from start to end, its report and tables included:", ""]
    lines += [f"| command | {FEW:,} points, s | MB | {MANY:,} points, s | MB |", "| --- | --- | --- | --- | --- |"]
    for name in many:
        figures = " | ".join(f"{s:.1f} | {mb:.0f}" for s, mb in (few[name], many[name]))
        lines.append(f"| `{name}` | {figures} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    arguments = asked(__doc__, sizes="10000,30000,100000", one=int, write=False)
    if arguments.one:
        print(json.dumps(chain(arguments.one)))
        return
    results = []
    for size in arguments.sizes.split(","):
        run = subprocess.run(  # noqa: S603 - our own interpreter
            [sys.executable, __file__, "--one", str(int(size))], capture_output=True, text=True, check=True
        )
        results.append(json.loads(run.stdout.splitlines()[-1]))
    text = page(results, commands(FEW), commands(MANY))
    print(text)
    if arguments.write:
        PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
