"""Flexibility of the links as solids: gmsh's quadratic tetrahedra in CalculiX (C3D10), nothing of stiffarm.

    python -m benchmarks.links.truth --ccx /usr/bin/ccx [--cases a,b] [--sizes 24,16,12]

CalculiX gives the stiffness matrix of the free body (SOLVER=MATRIXSTORAGE); the root's seat is fixed, the tip's seat
rigid, and its point's motion for six unit loads follows from one factorisation. On (a) six steps of CalculiX itself
with *RIGID BODY gave the same to seven digits. Meshes of several sizes show how far the figures are from converged.
Writes benchmarks/links/truth.json.
"""

from __future__ import annotations

import json
import math
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gmsh
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from benchmarks.asked import asked
from benchmarks.links.surfaces import CASES, DENSITY, POISSONS_RATIO, YOUNGS_MODULUS_PA, Case, Seat, solid

TRUTH = Path(__file__).with_name("truth.json")
SIZES_MM = (24.0, 16.0, 12.0)
# Of gmsh's and CalculiX's ten-noded tetrahedron: the last two middle nodes are swapped.
CCX_ORDER = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]


@dataclass(frozen=True)
class SolidMesh:
    """Nodes (n, 3) mm, ten-noded tetrahedra (e, 10) in CalculiX's order, nodes of both seats, volume (mm^3)."""

    nodes: NDArray[np.float64]
    tetrahedra: NDArray[np.int64]
    root: NDArray[np.int64]
    tip: NDArray[np.int64]
    volume: float


def mesh_of(case: Case, size: float) -> SolidMesh:
    """Quadratic tetrahedra of ``size`` mm, curved with the surface."""
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Verbosity", 1)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 24)
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.option.setNumber("Mesh.HighOrderOptimize", 1)
        gmsh.option.setNumber("Mesh.Optimize", 1)
        body = solid(case)
        if len(body) != 1:
            raise RuntimeError(f"{case.name}: {len(body)} bodies")
        volume = gmsh.model.occ.getMass(*body[0])
        gmsh.model.mesh.generate(3)
        tags, nodes, _ = gmsh.model.mesh.getNodes()
        kinds, _, elements = gmsh.model.mesh.getElements(3)
        tetrahedra = np.asarray(elements[list(kinds).index(11)]).reshape(-1, 10)
        used, place = np.unique(tetrahedra, return_inverse=True)
        order = np.argsort(tags)
        points = np.asarray(nodes).reshape(-1, 3)[order[np.searchsorted(tags[order], used)]]
        cells = place.reshape(-1, 10)[:, CCX_ORDER]
        return SolidMesh(points, cells, _on(points, case.root), _on(points, case.tip), float(volume))
    finally:
        gmsh.finalize()


def _on(points: NDArray[np.float64], seat: Seat) -> NDArray[np.int64]:
    """Nodes of a seat's face; the other seat may lie in the same plane."""
    away = points - np.array(seat.face)
    found = np.flatnonzero(
        (np.abs(away @ np.array(seat.outward)) < 1e-6) & (np.linalg.norm(away, axis=1) < 2 * seat.radius)
    )
    if found.size < 20:
        raise RuntimeError("no nodes on a seat")
    return found


def deck(mesh: SolidMesh) -> str:
    """CalculiX input of the free body in mm, N, MPa, whose stiffness matrix is to be stored."""
    lines = ["*NODE, NSET=NALL"]
    lines += [f"{i + 1}, {x:.9g}, {y:.9g}, {z:.9g}" for i, (x, y, z) in enumerate(mesh.nodes)]
    lines.append("*ELEMENT, TYPE=C3D10, ELSET=EALL")
    lines += [f"{i + 1}, " + ", ".join(str(n + 1) for n in cell) for i, cell in enumerate(mesh.tetrahedra)]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{1e-6 * YOUNGS_MODULUS_PA:.9g}, {POISSONS_RATIO:.9g}"]
    lines += ["*DENSITY", f"{1e-12 * DENSITY:.9g}", "*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL"]
    # Density and the number of modes are asked for, and play no part.
    lines += ["*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "10", "*END STEP"]
    return "\n".join(lines) + "\n"


def stiffness(mesh: SolidMesh, ccx: str) -> sp.csc_array:
    """CalculiX's stiffness matrix of the free body, three freedoms a node in turn, N/mm."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "link.inp").write_text(deck(mesh))
        done = subprocess.run(  # noqa: S603
            [ccx, "-i", "link"], cwd=folder, capture_output=True, text=True, check=False
        )
        if not (Path(folder) / "link.sti").is_file() or "*ERROR" in done.stdout:
            raise RuntimeError(done.stdout[-2000:])
        rows = np.fromfile(Path(folder) / "link.sti", sep=" ").reshape(-1, 3)
        freedoms = (Path(folder) / "link.dof").read_text().split()
    if freedoms != [f"{node}.{way}" for node in range(1, len(mesh.nodes) + 1) for way in (1, 2, 3)]:
        raise RuntimeError("freedoms are not in the order of the nodes")
    i, j = (rows[:, k].astype(np.int64) - 1 for k in (0, 1))
    upper = sp.coo_array((rows[:, 2], (i, j)), shape=(len(freedoms),) * 2).tocsc()
    return sp.csc_array(upper + sp.triu(upper, 1).T if (i <= j).all() else upper + sp.tril(upper, -1).T)


def flexibility(mesh: SolidMesh, tip: Seat, ccx: str) -> NDArray[np.float64]:
    """Motion of the tip's point (m, rad) for unit forces and moments there (N, N m), the root's seat fixed (6, 6).

    The tip's seat moves as a rigid body: its nodes' freedoms are those of the point.
    """
    K = stiffness(mesh, ccx)
    held = np.zeros(len(mesh.nodes), dtype=bool)
    held[mesh.root] = held[mesh.tip] = True
    free = np.flatnonzero(np.repeat(~held, 3))
    # Rotations are of a metre's arm, so that all six freedoms are of one size.
    arm = 1e-3 * (mesh.nodes[mesh.tip] - np.array(tip.point))
    rigid = np.zeros((3 * len(arm), 6))
    for k, turn in enumerate(np.eye(3)):
        rigid[k::3, k] = 1.0
        rigid[:, 3 + k] = np.cross(turn, arm).ravel()
    T = sp.csc_array(
        (
            rigid.ravel(),
            (np.repeat((3 * mesh.tip[:, None] + np.arange(3)).ravel(), 6), np.tile(np.arange(6), 3 * len(arm))),
        ),
        shape=(K.shape[0], 6),
    )
    inner, across, outer = K[free][:, free], (K @ T)[free].toarray(), (T.T @ K @ T).toarray()
    condensed = outer - across.T @ _solve(inner, across)
    C = np.linalg.inv(1e3 * condensed)  # N/mm and N to N/m and N m per m of arm
    return np.asarray(C)


def _solve(matrix: sp.csc_array, right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solution of a definite system by MKL where it is installed, else by SciPy."""
    try:
        import pypardiso
    except ImportError:
        from scipy.sparse.linalg import splu

        return np.asarray(splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(right))
    return np.asarray(pypardiso.spsolve(matrix.tocsr(), right))


def directions(C: NDArray[np.float64], length: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Principal flexibilities (6,) and directions (6, 6, columns) with rotations made lengths by the link's own."""
    scale = np.diag([1.0, 1.0, 1.0, length, length, length])
    values, vectors = np.linalg.eigh(scale @ C @ scale)
    return values, vectors


def truth_of(case: Case, sizes: tuple[float, ...], ccx: str) -> dict[str, Any]:
    """The figures of a link at all mesh sizes, the finest as its truth."""
    length = 1e-3 * math.dist(case.root.point, case.tip.point)
    rows: list[dict[str, Any]] = []
    C = np.zeros((6, 6))
    before: NDArray[np.float64] | None = None
    for size in sizes:
        start = time.perf_counter()
        mesh = mesh_of(case, size)
        raw = flexibility(mesh, case.tip, ccx)
        C = 0.5 * (raw + raw.T)
        row: dict[str, Any] = {"size_mm": size, "tetrahedra": len(mesh.tetrahedra), "nodes": len(mesh.nodes)}
        if before is not None:
            _, vectors = directions(C, length)
            scale = np.diag([1.0, 1.0, 1.0, length, length, length])
            change = np.einsum("ij,ik,kj->j", vectors, scale @ (C - before) @ scale, vectors)
            row["change_percent"] = [round(float(v), 3) for v in 100.0 * change / directions(C, length)[0]]
        rows.append(row)
        before = C
        asymmetry = float(np.abs(raw - raw.T).max() / np.abs(raw).max())
        if asymmetry > 1e-6:
            raise RuntimeError(f"{case.name}: the flexibility is not symmetric, {asymmetry:.1e}")
        print(case.name, row, f"asymmetry {asymmetry:.1e}, {time.perf_counter() - start:.0f} s", flush=True)
    kg = 1e-9 * mesh.volume * DENSITY
    return {
        "words": case.words,
        "casing_kg": round(kg, 4),
        "published_kg": round(kg / case.share, 4),
        "share_of_casing": case.share,
        "root": {"point_mm": case.root.point, "face_mm": case.root.face, "outward": case.root.outward},
        "tip": {"point_mm": case.tip.point, "face_mm": case.tip.face, "outward": case.tip.outward},
        "meshes": rows,
        "flexibility": [[float(f"{v:.6e}") for v in line] for line in C],
    }


def read_truth() -> dict[str, Any]:
    """What :func:`main` wrote: links by name."""
    return dict(json.loads(TRUTH.read_text()))


def main() -> None:
    """Solve the links and write what came out; links not asked for stay as they are."""
    given = asked(__doc__, ccx="ccx", cases=",".join(CASES), sizes=",".join(f"{v:g}" for v in SIZES_MM))
    sizes = tuple(float(v) for v in given.sizes.split(","))
    done = read_truth() if TRUTH.is_file() else {}
    for name in given.cases.split(","):
        done[name] = truth_of(CASES[name], sizes, given.ccx)
        TRUTH.write_text(json.dumps({key: done[key] for key in sorted(done)}, indent=1) + "\n")


if __name__ == "__main__":
    main()
