"""Speed and memory of a link's condensation: against OpenSees, and against the bare sparse solver.

    python benchmarks/statics/condensation.py [--freedoms 50000] [--json]

The link is the xr701's forearm casing of quads: three interfaces with rigid rings, so twelve unit load cases.
Ours is everything from the mesh to the superelement. OpenSees gets the same mesh, rings and loads, and its fastest
solver; the clock runs from its first node to its last solution, not over its start or its output. It runs with
ShellMITC4, its fastest element, which knows no warp, and ASDShellQ4, which agrees with ours. The bare solver
factorises the same reduced matrix and solves the same twelve right sides, and does nothing else. The rivals take
turns, so that a busy machine slows all; medians are compared. Memory is the peak of a process of its own over what
it held before assembly.
"""

from __future__ import annotations

import importlib.util
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from opensees_shell import OpenSeesRun, run_opensees
from scipy.optimize import brentq

import fem
from benchmarks.asked import asked
from fem.elements import condensation
from fem.elements.assembly import assemble_shell, freedoms
from fem.elements.shell import couple, shell_superelement
from meshes.casings import casing_mesh
from meshes.shell_mesh import ShellMesh
from robots import load_description
from robots.arrays import Array

FREEDOMS = 50_000
MEMORY_FREEDOMS = (50_000, 200_000)
REPEATS = 5
OPENSEES_REPEATS = 3
OPENSEES_ELEMENTS = ("ShellMITC4", "ASDShellQ4")
# Solver by name: its module, what runs it bare, and what must be hidden for ours to choose it.
SOLVERS: dict[str, tuple[str, Callable[..., Array], tuple[str, ...]]] = {
    "pypardiso": ("pypardiso", condensation._pardiso, ()),
    "cholmod": ("sksparse", condensation._cholmod, ("pypardiso",)),
    "scipy": ("scipy", condensation._superlu, ("pypardiso", "sksparse")),
}


@dataclass(frozen=True)
class SolverRow:
    """Seconds with one solver (medians): mesh to matrix, all of ours, bare solver; ratio of the last two."""

    solver: str
    assembly_s: float
    ours_s: float
    bare_s: float
    ours_over_bare: float


@dataclass(frozen=True)
class OpenSeesRow:
    """Seconds of OpenSees (median), its own solver, ratios to ours, and how far its flexibility is from ours."""

    element: str
    system: str
    opensees_s: float
    opensees_over_ours: dict[str, float]
    largest_difference: float


@dataclass(frozen=True)
class MemoryRow:
    """Peak memory of a condensation over what the process held before, bytes a freedom."""

    solver: str
    freedoms: int
    bytes_per_freedom: float


def link(target: int) -> tuple[ShellMesh, Array]:
    """Forearm casing with about ``target`` freedoms and its interface points (3, 3) m."""
    model = fem.build_model(load_description("xr701"), "beam")
    beam = next(part.mesh for part in model.links if part.name == "forearm")

    def excess(size: float) -> float:
        return 6.0 * len(casing_mesh(beam, size).nodes) - target

    return casing_mesh(beam, brentq(excess, 0.003, 0.1, xtol=1e-5)), beam.interface_points


def installed() -> list[str]:
    return [name for name, (module, *_) in SOLVERS.items() if importlib.util.find_spec(module)]


@contextmanager
def only(solver: str) -> Iterator[None]:
    """Hide the solvers that ours would choose before this one."""
    hidden = SOLVERS[solver][2]
    kept = {name: sys.modules.get(name) for name in hidden}
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type]
    try:
        yield
    finally:
        for name, module in kept.items():
            sys.modules.pop(name)
            if module is not None:
                sys.modules[name] = module


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def opensees(mesh: ShellMesh, points: Array, element: str) -> OpenSeesRun:
    root, *rings = mesh.interfaces.values()
    first, cases = 6 * len(mesh.nodes), 6 * len(rings)
    loads = np.zeros((cases, first + cases))
    loads[:, first:] = np.eye(cases)
    return run_opensees(mesh, element, freedoms(root).ravel(), loads, points[1:], rings)


def race(mesh: ShellMesh, points: Array) -> tuple[list[SolverRow], list[OpenSeesRow]]:
    coupled = couple(mesh, points)
    free = np.setdiff1d(np.arange(coupled.stiffness.shape[0]), coupled.held)
    K = coupled.stiffness[free][:, free]
    relative = coupled.reading[6:].toarray() - coupled.transport @ coupled.reading[:6].toarray()
    b = relative[:, free].T.copy()
    times: dict[str, list[tuple[float, float, float]]] = {name: [] for name in installed()}
    runs: dict[str, list[OpenSeesRun]] = {element: [] for element in OPENSEES_ELEMENTS}
    for name in times:  # imports and a solver's look for its library are paid once a process
        _bare(name, K, b)
    for repeat in range(REPEATS):
        for name in times:
            times[name].append(_once(name, mesh, points, K, b))
        if repeat < OPENSEES_REPEATS and importlib.util.find_spec("openseespy"):
            for element in OPENSEES_ELEMENTS:
                runs[element].append(opensees(mesh, points, element))
    rows = []
    for name, measured in times.items():
        assembly, ours, bare = (statistics.median(column) for column in zip(*measured, strict=True))
        rows.append(SolverRow(name, assembly, ours, bare, statistics.median(t[1] / t[2] for t in measured)))
    flexibility = shell_superelement(mesh, points).flexibility
    return rows, [_compared(e, r, rows, flexibility) for e, r in runs.items() if r]


def _once(solver: str, mesh: ShellMesh, points: Array, K: Any, b: Array) -> tuple[float, float, float]:
    """Seconds of the assembly, of all of ours, and of the bare solver."""
    with only(solver):
        ours = seconds(lambda: shell_superelement(mesh, points))
    return seconds(lambda: assemble_shell(mesh)), ours, seconds(lambda: _bare(solver, K, b))


def _bare(solver: str, K: Any, b: Array) -> Array:
    return SOLVERS[solver][1](K, b)


def _compared(element: str, runs: list[OpenSeesRun], rows: list[SolverRow], flexibility: Array) -> OpenSeesRow:
    theirs = runs[0].displacements[:, -len(flexibility) // 6 :].reshape(flexibility.shape)
    scale = np.sqrt(np.diag(flexibility))
    difference = float(np.abs((theirs - flexibility) / np.outer(scale, scale)).max())
    median = statistics.median(run.build_s + run.solve_s for run in runs)
    return OpenSeesRow(element, runs[0].system, median, {r.solver: median / r.ours_s for r in rows}, difference)


def peak_memory(solver: str, target: int) -> MemoryRow:
    """Measure in a process of its own, which starts this file again."""
    done = subprocess.run(  # noqa: S603 - our own interpreter and file
        [sys.executable, str(Path(__file__).resolve()), "--peak", solver, str(target)],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    count, peak = done.stdout.split()
    return MemoryRow(solver, int(count), float(peak) / int(count))


def _print_peak(solver: str, target: int) -> None:
    import resource

    with only(solver):
        mesh, points = link(target)
        _bare(solver, sp.csc_array(np.eye(2)), np.ones((2, 1)))  # loads the solver's library
        # Pages in use now, as the peak so far includes what imports took and gave back.
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        before = pages * resource.getpagesize()
        shell_superelement(mesh, points)
    peak = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    sys.stdout.write(f"{6 * len(mesh.nodes)} {peak - before}\n")


def report(count: int, rows: list[SolverRow], others: list[OpenSeesRow], memory: list[MemoryRow]) -> str:
    lines = [f"xr701 forearm, quads, {count} freedoms, 12 load cases, {os.cpu_count()} cores, median of {REPEATS}"]
    for r in rows:
        lines.append(
            f"ours, {r.solver:10} {r.ours_s:6.2f} s (assembly {r.assembly_s:4.2f} s), bare solver {r.bare_s:6.2f} s: "
            f"ratio {r.ours_over_bare:4.2f}"
        )
    for o in others:
        ratios = ", ".join(f"{ratio:.1f} times ours with {solver}" for solver, ratio in o.opensees_over_ours.items())
        lines.append(
            f"OpenSees, {o.element} and {o.system}: {o.opensees_s:.1f} s, {ratios}; "
            f"flexibilities differ by up to {100 * o.largest_difference:.2f} %"
        )
    for m in memory:
        kilobytes = m.bytes_per_freedom / 1000
        lines.append(f"peak memory, {m.solver:10} {m.freedoms:7} freedoms: {kilobytes:4.1f} kB a freedom")
    return "\n".join(lines) + "\n"


def main() -> None:
    arguments = asked(__doc__, freedoms=FREEDOMS, json=False, peak={"nargs": 2, "metavar": ("SOLVER", "FREEDOMS")})
    if arguments.peak:
        _print_peak(arguments.peak[0], int(arguments.peak[1]))
        return
    mesh, points = link(arguments.freedoms)
    rows, others = race(mesh, points)
    memory = []
    if Path("/proc/self/statm").exists():
        memory = [peak_memory(name, target) for name in installed() for target in MEMORY_FREEDOMS]
    if arguments.json:
        head = {"link": "xr701 forearm", "freedoms": 6 * len(mesh.nodes), "repeats": REPEATS, "cores": os.cpu_count()}
        tail = {"opensees": [asdict(o) for o in others], "memory": [asdict(m) for m in memory]}
        json.dump({**head, "solvers": [asdict(r) for r in rows], **tail}, sys.stdout, indent=2)
        sys.stdout.write("\n")
        return
    sys.stdout.write(report(6 * len(mesh.nodes), rows, others, memory))


if __name__ == "__main__":
    main()
