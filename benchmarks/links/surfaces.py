"""Outer surfaces of the links as a robot's visual meshes show them, in a URDF of three bodies; also spoilt ones.

    python -m benchmarks.links.surfaces FOLDER

``skin``: the outer skin alone, closed but for a window. ``open``: an opening of some 50 mm, and 1 % of the triangles
lost. ``bodies``: several bodies that overlap. ``decimated``: an eighth of the triangles, corners off their places.
``material``: all of the solid's surface, inside and outside, as a STL from CAD has it. The bodies before and after the
link are discs on its seats; ``small``: the one at the tip has 46 mm radius. The link's mass is what a maker would
publish.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import gmsh
import numpy as np
import pyvista
import trimesh
from numpy.typing import NDArray

from benchmarks.links.shapes import CASES, Case, Seat, Volumes, parts, skin, solid
from benchmarks.links.truth import read_truth

VARIANTS = ("skin", "open", "bodies", "decimated", "material", "small")
SPOILT = ("open", "bodies", "decimated")
SIZE_MM, AROUND = 40.0, 32
SMALL_MM, DISC_MM = 46.0, 60.0
SEED = 20

Surface = tuple[NDArray[np.float64], NDArray[np.int64]]


def surface_of(case: Case, variant: str) -> trimesh.Trimesh:
    """Triangles of a link's surface, mm."""
    make: Callable[[Case], Volumes] = {"bodies": parts, "material": solid}.get(variant, skin)
    nodes, faces = _triangles(case, make)
    if case.window is not None and variant != "material":
        faces = faces[~_floor(case, nodes, faces)]
    if variant == "open":
        faces = _holed(case, nodes, faces)
    mesh = trimesh.Trimesh(nodes, faces, process=False)
    if variant == "decimated":
        cells = np.hstack([np.full((len(faces), 1), 3), faces])
        done = pyvista.PolyData(nodes, cells.ravel()).decimate(0.875)
        mesh = trimesh.Trimesh(np.asarray(done.points), done.faces.reshape(-1, 4)[:, 1:], process=False)
    return mesh


def _triangles(case: Case, make: Callable[[Case], Volumes]) -> Surface:
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Verbosity", 1)
        gmsh.option.setNumber("Mesh.MeshSizeMax", SIZE_MM)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", AROUND)
        make(case)
        gmsh.model.mesh.generate(2)
        tags, nodes, _ = gmsh.model.mesh.getNodes()
        kinds, _, cells = gmsh.model.mesh.getElements(2)
        used, place = np.unique(cells[list(kinds).index(2)], return_inverse=True)
        order = np.argsort(tags)
        points = np.asarray(nodes).reshape(-1, 3)[order[np.searchsorted(tags[order], used)]]
        faces = place.reshape(-1, 3)
    finally:
        gmsh.finalize()
    mesh = trimesh.Trimesh(points, faces, process=False)
    trimesh.repair.fix_normals(mesh, multibody=True)
    faces = np.asarray(mesh.faces)
    if make is solid:
        # Hollows face inward: all bodies but the outer one.
        body = trimesh.graph.connected_component_labels(mesh.face_adjacency, node_count=len(faces))
        largest = np.argmax(np.bincount(body, mesh.area_faces))
        faces = np.where((body == largest)[:, None], faces, faces[:, ::-1])
    return np.asarray(mesh.vertices), faces


def _floor(case: Case, nodes: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Faces on the bottom of a window's pocket."""
    assert case.window is not None
    middle, size = (np.array(v) for v in case.window)
    along = int(np.argmin(size))
    inner = middle[along] - np.sign(middle[along]) * size[along] / 2.0
    corners = nodes[faces]
    flat = (np.abs(corners[:, :, along] - inner) < 1e-6).all(axis=1)
    across = [k for k in range(3) if k != along]
    return np.asarray(flat & (np.abs(corners.mean(axis=1) - middle)[:, across] < size[across] / 2.0).all(axis=1))


def _holed(case: Case, nodes: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Faces but for an opening halfway along the link, and one in a hundred anywhere."""
    middles = nodes[faces].mean(axis=1)
    halfway = (np.array(case.root.point) + np.array(case.tip.point)) / 2.0
    away = np.linalg.norm(middles - (halfway + np.array([0.0, 0.0, 100.0])), axis=1)
    # Of the few nearest triangles halfway up the link.
    gone = np.zeros(len(faces), dtype=bool)
    gone[np.argsort(away)[:4]] = True
    gone[np.random.default_rng(SEED).choice(len(faces), len(faces) // 100, replace=False)] = True
    return faces[~gone]


def urdf_of(case: Case, published_kg: float, mesh: str, tip_radius: float) -> str:
    """A disc on the root's seat, the link, and a disc on the tip's seat."""
    root, tip = case.root, case.tip
    way = " ".join(f"{1e-3 * (b - a):.9g}" for a, b in zip(root.point, tip.point, strict=True))
    disc_root, disc_tip = _disc(root, root.radius, root.point), _disc(tip, tip_radius, tip.point)
    return f"""<?xml version="1.0"?>
<robot name="link_{case.name}">
  <link name="stand">{disc_root}</link>
  <link name="arm">
    <inertial><mass value="{published_kg:.6g}"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="{mesh}" scale="0.001 0.001 0.001"/></geometry></visual>
  </link>
  <link name="hand">{disc_tip}</link>
  <joint name="first" type="revolute"><parent link="stand"/><child link="arm"/>{_axis(root)}</joint>
  <joint name="second" type="revolute"><parent link="arm"/><child link="hand"/>
    <origin xyz="{way}"/>{_axis(tip)}</joint>
</robot>
"""


def _axis(seat: Seat) -> str:
    limit = '<limit lower="-2" upper="2" effort="1000" velocity="1"/>'
    return f'<axis xyz="{" ".join(f"{abs(v):g}" for v in seat.outward)}"/>{limit}'


def _disc(seat: Seat, radius: float, origin: tuple[float, float, float]) -> str:
    middle = [1e-3 * (f + 0.5 * DISC_MM * o - p) for f, o, p in zip(seat.face, seat.outward, origin, strict=True)]
    turn = "0 1.5707963267948966 0" if seat.outward[0] else "1.5707963267948966 0 0"
    at = f'<origin xyz="{" ".join(f"{v:.9g}" for v in middle)}" rpy="{turn}"/>'
    size = f'<cylinder radius="{1e-3 * radius:g}" length="{1e-3 * DISC_MM:g}"/>'
    return f"<visual>{at}<geometry>{size}</geometry></visual>"


def write(case: Case, variant: str, folder: Path, published_kg: float) -> Path:
    """Write STL and URDF of a link into a folder of their own; returns the URDF's path."""
    here = folder / f"{case.name}_{variant}"
    here.mkdir(parents=True, exist_ok=True)
    surface_of(case, variant).export(here / "arm.stl")
    urdf = here / "link.urdf"
    urdf.write_text(urdf_of(case, published_kg, "arm.stl", SMALL_MM if variant == "small" else case.tip.radius))
    return urdf


def write_step(case: Case, path: Path) -> None:
    """The exact solid as STEP, mm."""
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Verbosity", 1)
        solid(case)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def main() -> None:
    """Write all links, whole and spoilt."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    truth = read_truth()
    for name, case in CASES.items():
        for variant in VARIANTS:
            print(write(case, variant, folder, truth[name]["published_kg"]))
        write_step(case, folder / f"{name}.step")


if __name__ == "__main__":
    main()
