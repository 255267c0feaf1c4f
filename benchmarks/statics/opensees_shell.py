"""OpenSees on our shell meshes: an independent code as oracle for tests and as rival for benchmarks.

OpenSees keeps one global model and prints as it likes, so it runs in a process of its own, which this file
starts as a script: arrays go there and back as .npz files. Needs the extra ``oracle`` (openseespy).
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robots.arrays import Array, Integers

if TYPE_CHECKING:  # the other process needs arrays only
    from meshes.shell_mesh import ShellMesh


ROOT = Path(__file__).resolve().parents[2]
TIME_LIMIT = 1800.0  # s
# Fastest first of what factorises once and keeps the factor; the others of the Linux wheel (UmfPack, BandSPD,
# ProfileSPD) take 2 to 10 times as long, SparseSPD crashes. Not every wheel has Mumps.
SYSTEMS = ("Mumps", "SuperLU")


@dataclass(frozen=True)
class OpenSeesRun:
    """Displacements (r, k + p, 6) of nodes, then points, under r loads; seconds by stage; the solver's name."""

    displacements: Array
    build_s: float
    solve_s: float
    system: str


def run_opensees(
    mesh: ShellMesh,
    element: str,
    fixed: Integers,
    loads: Array,
    points: Array | None = None,
    rings: Sequence[Integers] = (),
) -> OpenSeesRun:
    """Solve a shell mesh with OpenSees, linear and static.

    ``element``: ShellMITC4, ASDShellQ4 or ShellDKGQ for a mesh of quads, ShellDKGT or ASDShellT3 for triangles.
    ``points`` (p, 3) m are further nodes, each joined rigidly to the nodes of its ring. ``fixed``: freedoms at
    rest, six a node. ``loads`` (r, 6(k + p)). Elements, their membrane, bending and drilling are OpenSees' own.

    Raises
    ------
    RuntimeError
        OpenSees is missing, does not know the element, or fails.
    """
    points = np.zeros((0, 3)) if points is None else points
    cells = mesh.quads if len(mesh.quads) else mesh.triangles
    with tempfile.TemporaryDirectory() as folder:
        task, result = Path(folder) / "task.npz", Path(folder) / "result.npz"
        np.savez(
            task,
            nodes=np.vstack([mesh.nodes, points]),
            cells=cells,
            thickness=mesh.thickness,
            material=np.array([mesh.youngs_modulus, mesh.poissons_ratio]),
            fixed=fixed,
            loads=loads,
            joined=np.concatenate([np.zeros(0, np.int64), *rings]),
            joined_to=len(mesh.nodes) + np.repeat(np.arange(len(rings)), [len(ring) for ring in rings]),
        )
        done = subprocess.run(  # noqa: S603 - our own interpreter and file
            [sys.executable, str(Path(__file__).resolve()), element, str(task), str(result)],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=TIME_LIMIT,
            check=False,
        )
        if done.returncode or not result.exists():
            raise RuntimeError(f"OpenSees with {element} failed:\n{done.stdout[-1000:]}{done.stderr[-2000:]}")
        out = np.load(result)
        build_s, solve_s = out["seconds"].tolist()
        return OpenSeesRun(out["displacements"], build_s, solve_s, str(out["system"]))


def _main(element: str, task: str, result: str) -> None:
    import openseespy.opensees as ops

    given = np.load(task)
    start = time.perf_counter()
    _build(ops, element, given)
    system = _analysis(ops)
    seconds = [time.perf_counter() - start, 0.0]
    nodes, loads = len(given["nodes"]), given["loads"].reshape(len(given["loads"]), -1, 6)
    displacements = np.zeros((len(loads), nodes, 6))
    for case, load in enumerate(loads):
        start = time.perf_counter()
        _solve(ops, case + 1, load)
        seconds[1] += time.perf_counter() - start
        displacements[case] = [ops.nodeDisp(node) for node in range(1, nodes + 1)]
    np.savez(result, displacements=displacements, seconds=np.array(seconds), system=system)


def _solve(ops: Any, tag: int, load: Array) -> None:
    """Displacements under one load (k, 6), in place of the last one's."""
    if tag > 1:
        ops.remove("loadPattern", tag - 1)
        ops.reset()
    ops.pattern("Plain", tag, 1)
    for node in np.flatnonzero(load.any(axis=1)).tolist():
        ops.load(node + 1, *load[node].tolist())
    if ops.analyze(1) != 0:
        raise RuntimeError(f"no solution for load {tag}")


def _build(ops: Any, element: str, given: Any) -> None:
    """Nodes, elements, supports and rigid links; tags are our numbers plus one."""
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for tag, x in enumerate(given["nodes"].tolist(), 1):
        ops.node(tag, *x)
    walls, section = np.unique(given["thickness"], return_inverse=True)
    for tag, wall in enumerate(walls.tolist(), 1):
        ops.section("ElasticMembranePlateSection", tag, *given["material"].tolist(), wall, 0.0)
    for tag, (cell, wall) in enumerate(zip((given["cells"] + 1).tolist(), (section + 1).tolist(), strict=True), 1):
        ops.element(element, tag, *cell, wall)
    held = np.zeros((len(given["nodes"]), 6), dtype=int)
    held.reshape(-1)[given["fixed"]] = 1
    for node in np.flatnonzero(held.any(axis=1)).tolist():
        ops.fix(node + 1, *held[node].tolist())
    for node, point in zip(given["joined"].tolist(), given["joined_to"].tolist(), strict=True):
        ops.rigidLink("beam", point + 1, node + 1)


def _analysis(ops: Any) -> str:
    """One factorisation for all loads, with the fastest solver of this build; its name."""
    ops.constraints("Transformation")
    ops.numberer("RCM")
    for name in SYSTEMS:
        try:
            ops.system(name)
            break
        except ops.OpenSeesError:
            continue
    ops.test("NormUnbalance", 1.0, 1)
    ops.algorithm("Linear", "-factorOnce")
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")
    ops.timeSeries("Constant", 1)
    return name


if __name__ == "__main__":
    if len(sys.argv) == 4:
        _main(*sys.argv[1:])
    else:  # `make bench` runs every file of this folder
        sys.stdout.write("no benchmark of its own: condensation.py and the oracle tests start it\n")
