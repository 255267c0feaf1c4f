"""Finished maps for the tests of the writers: known numbers at the points of a layout."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from surrogate.maps.data import Axis, Field, Layout, MapData

MM = 1e-3
ODD_METADATA = {
    "robot": "xr701",
    "note": "größer ≥ 1 <&> \"quoted\" 'too'\nsecond line",
    "load direction <&\"'>\n größe": "-Z",
    "units": "a name of the writer's own",
    "empty": "",
    "control\x01": "zero\x00byte, lone \udcff surrogate",
    "long": "x" * 100_000,
}


def box(nz=4, ny=3, nx=5, first=(-100.0, 50.0, 20.0), step=(10.0, 20.0, 30.0)):
    names, counts = "xyz", (nx, ny, nz)
    axes = [Axis(n, "mm", f + s * np.arange(c)) for n, f, s, c in zip(names, first, step, counts, strict=True)]
    return Layout("box", tuple(reversed(axes)))


def cylinder(phi, r=(100.0, 150.0, 300.0), z=(0.0, 50.0)):
    return Layout(
        "cylinder",
        (Axis("z", "mm", np.array(z)), Axis("phi", "deg", np.array(phi)), Axis("r", "mm", np.array(r))),
    )


def points_of(layout, held=7.0):
    """(n, 3) m; a sweep of joints is bent into space by a smooth map."""
    mesh = np.meshgrid(*(axis.values for axis in layout.axes), indexing="ij")
    value = {axis.name: m.ravel() for axis, m in zip(layout.axes, mesh, strict=True)}
    if layout.kind == "cylinder":
        phi = np.radians(value["phi"])
        value |= {"x": value["r"] * np.cos(phi), "y": value["r"] * np.sin(phi)}
    if layout.kind == "joints":
        a, b, c = [np.zeros(layout.n), np.zeros(layout.n), *value.values()][-3:]
        value = {"x": 5.0 * a + 0.01 * b**2, "y": 3.0 * b, "z": 2.0 * c + 0.02 * a * b}
    return np.column_stack([np.broadcast_to(value.get(name, held), layout.n) for name in "xyz"]) * MM


def finished(layout, reached=None, metadata=None, seed=0):
    """A map with a field, one of categories, shares and two joints, NaN where not reached."""
    rng = np.random.default_rng(seed)
    n = layout.n
    reached = np.ones(n, dtype=bool) if reached is None else reached
    hole = np.where(reached, 1.0, np.nan)
    worst = np.where(reached, rng.integers(0, 3, n), -1).astype(float)
    return MapData(
        layout=layout,
        points=points_of(layout),
        q=rng.uniform(-3.0, 3.0, (n, 2)) * hole[:, None],
        reached=reached,
        coordinates=("q2_deg", "q3real_deg"),
        fields={
            "stiffness_N_per_mm": Field(rng.uniform(200.0, 900.0, n) * hole, "N/mm", "stiffness along -Z"),
            "softest_part": Field(worst, "", "part that deflects most", ("link 2", "größte <&>", "base")),
            "isotropy": Field(rng.uniform(0.0, 1.0, n) * hole, "", "isotropy"),
        },
        parts=("link 2", "base"),
        shares=rng.uniform(0.0, 1.0, (n, 2)) * hole[:, None],
        metadata={"robot": "xr701"} if metadata is None else metadata,
    )


def arrays_of(data):
    """What a reader must find at each point: name -> values."""
    columns = {name: field.values for name, field in data.fields.items()}
    columns |= {f"share_of_{p.replace(' ', '_')}_percent": 100.0 * data.shares[:, i] for i, p in enumerate(data.parts)}
    return columns | {name: np.degrees(data.q[:, i]) for i, name in enumerate(data.coordinates)}


def mapped(data, folder: Path):
    """The same map with its arrays as memory maps of files."""

    def on_disk(name, values):
        np.save(folder / f"{name}.npy", values)
        return np.load(folder / f"{name}.npy", mmap_mode="r")

    fields = {k: Field(on_disk(k, f.values), f.unit, f.label, f.categories) for k, f in data.fields.items()}
    big = {k: on_disk(k, getattr(data, k)) for k in ("points", "q", "reached", "shares")}
    return MapData(data.layout, coordinates=data.coordinates, fields=fields, parts=data.parts, **big)


def with_junk(data):
    """The same map with numbers where the robot does not reach, as left over in an array that was not cleared."""
    for values in [*(field.values for field in data.fields.values()), data.q, data.shares]:
        values[~data.reached] = 1.0
    return data


KILL_PROGRAM = """
import os, signal, sys
from pathlib import Path
from map_file_cases import box, finished
from surrogate.maps import columns, {module}

data = finished(box())
{module}.{writer}(data, Path(sys.argv[1]))
calls = []
columns.ROWS_A_BLOCK = {module}.ROWS_A_BLOCK = 7
real = columns._where_reached

def killed(*args):
    calls.append(1)
    if len(calls) > 20:
        os.kill(os.getpid(), signal.SIGKILL)
    return real(*args)

columns._where_reached = killed
{module}.{writer}(finished(box(), seed=5), Path(sys.argv[1]))
"""


def killed_while_it_writes(module, writer, path: Path):
    """Write a map in another process, which is killed while it writes a second one in its place."""
    program = KILL_PROGRAM.format(module=module, writer=writer)
    here = Path(__file__).resolve().parent
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(here), str(here.parents[2])])}
    run = subprocess.run(  # noqa: S603 - our own interpreter with our own program
        [sys.executable, "-c", program, str(path)], cwd=here.parents[2], env=environment, check=False
    )
    return run.returncode


MEMORY_PROGRAM = """
import sys, threading, time
from pathlib import Path
import numpy as np
from surrogate.maps.data import Axis, Field, Layout, MapData
from surrogate.maps.{module} import {writer}

nz, folder = int(sys.argv[1]), Path(sys.argv[2])
axes = [Axis(name, "mm", 5.0 * np.arange(count)) for name, count in (("z", nz), ("y", 200), ("x", 250))]
layout = Layout("box", tuple(axes))

def anonymous():
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * int(next(line for line in lines if line.startswith("RssAnon")).split()[1])

def on_disk(name, columns, kind=float):
    shape = (layout.n, columns) if columns else (layout.n,)
    out = np.lib.format.open_memmap(folder / (name + ".npy"), "w+", kind, shape)
    rng = np.random.default_rng(0)
    for z in range(nz):
        rows = slice(50_000 * z, 50_000 * (z + 1))
        values = rng.uniform(0.1, 1.0, out[rows].shape)
        out[rows] = values < 0.9 if kind is bool else values
    return out

points = on_disk("points", 3)
for z in range(nz):
    rows = slice(50_000 * z, 50_000 * (z + 1))
    index = layout.indices(rows)
    points[rows] = 1e-3 * np.column_stack([axis.values[i] for axis, i in zip(axes, index)])[:, ::-1]
fields = {{f"f{{i}}": Field(on_disk(f"f{{i}}", 0), "N/mm", "f") for i in range(6)}}
parts = ("a", "b", "c", "d")
data = MapData(layout, points, on_disk("q", 6), on_disk("reached", 0, bool), tuple(f"q{{i}}_deg" for i in range(6)),
               fields, parts, on_disk("shares", len(parts)))
{writer}(MapData(Layout("box", tuple(Axis(a.name, "mm", a.values[:2]) for a in axes)), points[[0, 1, 250, 251, 50000,
         50001, 50250, 50251]], np.zeros((8, 6)), np.ones(8, dtype=bool), data.coordinates, {{}}),
         folder / "warm{suffix}")
before, peak, done = anonymous(), 0, threading.Event()

def watch():
    global peak
    while not done.is_set():
        peak = max(peak, anonymous())
        time.sleep(0.002)

watcher = threading.Thread(target=watch)
watcher.start()
start = time.perf_counter()
{writer}(data, folder / "map{suffix}")
seconds = time.perf_counter() - start
done.set()
watcher.join()
print(peak - before, seconds, (folder / "map{suffix}").stat().st_size)
"""


def memory_and_seconds(module, writer, suffix, layers, folder: Path):
    """Peak of a process's own memory (B) and time while it writes a box of 50 000 points a layer and 16 arrays."""
    folder.mkdir()
    root = Path(__file__).resolve().parents[3]
    program = MEMORY_PROGRAM.format(module=module, writer=writer, suffix=suffix)
    out = subprocess.run(  # noqa: S603 - our own interpreter with our own program
        [sys.executable, "-c", program, str(layers), str(folder)], cwd=root, capture_output=True, check=True, text=True
    )
    peak, seconds, size = out.stdout.split()
    return int(peak), float(seconds), int(size)
