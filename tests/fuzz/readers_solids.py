"""Readers of solid links: prepared meshes, and STEP files where Netgen is installed (the extra `solid`)."""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path

import numpy as np

from meshes.link_solids import load_solid, save_solid
from meshes.solid_mesh import SolidMesh
from meshes.solids.tetrahedra import StepSolid, open_step

from .mutate_forms import arrays, words
from .registry import Reader
from .samples import Sample
from .trial import require, require_finite

NETGEN = importlib.util.find_spec("netgen") is not None
STEP = words(
    (
        b"#1",
        b"#99999",
        b"$",
        b"*",
        b"ENDSEC;",
        b"CLOSED_SHELL",
        b"CARTESIAN_POINT('',(0.,0.,0.))",
        b"1.E+308",
        b"-1.",
        b"'",
        b"(",
        b")",
        b".F.",
        b"SI_UNIT(.MILLI.,.METRE.)",
    )
)


def _solids() -> list[Sample]:
    """One tetrahedron of ten nodes."""
    corners = np.array([[0.0, 0, 0], [0.3, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    edges = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
    nodes = np.concatenate([corners, [(corners[i] + corners[j]) / 2 for i, j in edges]])
    ends = {"root": np.array([0, 2, 3]), "tip": np.array([1])}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "seed.npz"
        save_solid(SolidMesh("arm", nodes, np.arange(10)[None], 2.1e11, 0.3, ends), path)
        return [Sample(".npz", path.read_bytes())]


def _solid(path: Path) -> SolidMesh:
    mesh = load_solid(path)
    require_finite(mesh, "solid mesh")
    for elements in (mesh.tetrahedra, *mesh.interfaces.values()):
        low, high = elements.min(initial=0), elements.max(initial=0)
        require(low >= 0 and high < max(1, len(mesh.nodes)), "solid nodes: elements of nodes that are not there")
    return mesh


def _steps() -> list[Sample]:
    from netgen import occ

    bar = occ.Cylinder(occ.Pnt(0, 0, 0), occ.X, 30, 300)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "seed.step"
        (bar - occ.Box((-1, -5, -5), (301, 5, 5))).WriteStep(str(path))
        return [Sample(".step", path.read_bytes())]


def _step(path: Path) -> StepSolid:
    solid = open_step(path)
    require_finite((solid.extent, np.array([solid.area, solid.volume])), "STEP solid")
    require(solid.area > 0.0 and solid.volume > 0.0, "STEP solid: no area or no volume")
    return solid


READERS: dict[str, Reader] = {"solid file": Reader(_solids, _solid, (arrays,))}
if NETGEN:
    READERS["STEP file"] = Reader(_steps, _step, (STEP,), cost=30.0)
