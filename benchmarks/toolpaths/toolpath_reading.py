"""Time and memory of reading a CLSF file against a plain loop of ``float(split)``.

``python benchmarks/toolpaths/toolpath_reading.py [points ...]`` (default 100000 and 1000000) writes a five-axis file of
that many GOTO, reads it with each way in a process of its own, and prints seconds, peak memory above the start, and
ratios.
"""

from __future__ import annotations

import math
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def write(path: Path, points: int) -> None:
    """A spiral with a turning tool axis, a feed change every 50 points and a rapid move every 1000."""
    with path.open("w", encoding="ascii") as file:
        file.write("TOOL PATH/SPIRAL,TOOL,B10\nTLDATA/MILL,10.0,5.0,75.0,0.0,0.0\nLOAD/TOOL,1\nSPINDL/RPM,8000,CLW\n")
        for i in range(points):
            angle = 1e-3 * i
            if i % 1000 == 0:
                file.write("RAPID\n")
            if i % 50 == 0:
                file.write(f"FEDRAT/MMPM,{1000 + i % 700}.0\n")
            x, y, z = 100 * math.cos(angle), 100 * math.sin(angle), 1e-4 * i
            j, k = math.sin(0.3 * math.sin(angle)), math.cos(0.3 * math.sin(angle))
            file.write(f"GOTO/{x:.4f},{y:.4f},{z:.4f},0.0000000,{j:.7f},{k:.7f}\n")
        file.write("END-OF-PATH\n")


def loop(path: Path) -> int:
    """What a script of ten lines does: coordinates only, no state, no checks."""
    points = []
    with path.open(encoding="ascii") as file:
        for line in file:
            if line.startswith("GOTO/"):
                points.append([float(v) for v in line[5:].split(",")])
    return len(points)


def read(path: Path) -> int:
    from machining.toolpaths import read_toolpath

    return read_toolpath(path).n


def gcode(path: Path) -> int:
    """The same points as G1 blocks."""
    return read(path)


def child(way: str, path: Path) -> None:
    """Run one way and print points, seconds, MiB above the memory before."""
    import machining.toolpaths  # noqa: F401 - so that the peak is that of the reading

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    count = {"loop": loop, "read": read, "gcode": gcode}[way](path)
    seconds = time.perf_counter() - start
    print(count, seconds, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024.0)


def as_gcode(source: Path, target: Path) -> None:
    with source.open(encoding="ascii") as file, target.open("w", encoding="ascii") as out:
        out.write("G21 G90 G94\nS8000 M3\nG0 X0 Y0 Z50\nG1 F1000\n")
        for line in file:
            if line.startswith("GOTO/"):
                x, y, z = line[5:].split(",")[:3]
                out.write(f"X{x} Y{y} Z{z}\n")
        out.write("M30\n")


def run(way: str, path: Path) -> tuple[int, float, float]:
    """Best of three by time, each in a fresh process."""
    results = []
    for _ in range(3):
        command = [sys.executable, __file__, "--child", way, str(path)]
        out = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()  # noqa: S603
        results.append((int(out[0]), float(out[1]), float(out[2])))
    return min(results, key=lambda result: result[1])


def main(sizes: list[int]) -> None:
    print(
        f"{'points':>9} {'file MiB':>9} {'way':>6} {'s':>7} {'MiB':>7} {'B/point':>8} {'time/loop':>10} {'mem/loop':>9}"
    )
    for points in sizes:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "spiral.cls"
            write(path, points)
            blocks = Path(folder) / "spiral.nc"
            as_gcode(path, blocks)
            peer = run("loop", path)
            for way, file in (("loop", path), ("read", path), ("gcode", blocks)):
                count, seconds, memory = peer if way == "loop" else run(way, file)
                assert count in (points, points + 1), (way, count)
                size = file.stat().st_size / 2**20
                print(
                    f"{points:>9} {size:>9.1f} {way:>6} {seconds:>7.2f} {memory:>7.1f} {memory * 2**20 / points:>8.0f} "
                    f"{seconds / peer[1]:>10.2f} {memory / peer[2]:>9.2f}"
                )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2], Path(sys.argv[3]))
    else:
        main([int(v) for v in sys.argv[1:]] or [100_000, 1_000_000])
