"""Outer surfaces of the links as a robot's visual meshes show them, in a URDF of three bodies; also spoilt ones.

    python -m benchmarks.links.surfaces FOLDER

``skin``: the outer skin alone, closed but for a window. ``open``: an opening of some 50 mm, and 1 % of the triangles
lost. ``bodies``: several bodies that overlap. ``decimated``: an eighth of the triangles, corners off their places.
``material``: all of the solid's surface, inside and outside, as a STL from CAD has it. The bodies before and after the
link are discs on its seats; ``small``: the one at the tip has 46 mm radius. The link's mass is what a maker would
publish.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gmsh
import numpy as np
import pyvista
import trimesh
from numpy.typing import NDArray

from benchmarks.asked import asked

from .truth import read_truth

YOUNGS_MODULUS_PA, POISSONS_RATIO, DENSITY = 210e9, 0.3, 7850.0

occ: Any = gmsh.model.occ
Volumes = list[tuple[int, int]]
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Seat:
    """A round or rectangular plane face that a joint holds: the axis it stands across, and what is bolted to it.

    ``point``: where the joint's frame is, on its axis. ``face``: where the axis meets the seat. ``outward``: of the
    link. ``radius``: of the seat, and of the neighbour's flange as a rule.
    """

    point: Triple
    face: Triple
    outward: Triple
    radius: float


@dataclass(frozen=True)
class Case:
    """A link: its two seats, what a default import must know, and how its outer and inner solids are made.

    ``share``: of the casing in the mass that a maker would publish, 0.8 for a bare tube and 0.6 for a casting with
    drives. ``outer`` makes the overlapping volumes of the outer skin, ``cavity`` what is hollow in it. ``window``: cut
    through the wall: middle and size, of which the least goes through.
    """

    name: str
    words: str
    root: Seat
    tip: Seat
    share: float
    outer: Callable[[], Volumes]
    cavity: Callable[[], Volumes]
    wall: float
    window: tuple[Triple, Triple] | None = None


def solid(case: Case) -> Volumes:
    """The link itself, in gmsh's current model."""
    body = _cut(_fuse(case.outer()), case.cavity())
    if case.window is not None:
        body = _cut(body, [_box(*case.window)])
    occ.synchronize()
    return body


def skin(case: Case) -> Volumes:
    """The outer skin as a full solid; a window is a pocket as deep as the wall, whose floor is no part of the skin."""
    body = _fuse(case.outer())
    if case.window is not None:
        body = _cut(body, [_box(*case.window)])
    occ.synchronize()
    return body


def parts(case: Case) -> Volumes:
    """The outer skin as several bodies that overlap, as visual meshes often are; a window as in :func:`skin`."""
    volumes = case.outer()
    if case.window is not None:
        volumes = [body for volume in volumes for body in _cut([volume], [_box(*case.window)])]
    occ.synchronize()
    return volumes


def _box(middle: Triple, size: Triple) -> tuple[int, int]:
    corner = [m - s / 2.0 for m, s in zip(middle, size, strict=True)]
    return (3, int(occ.addBox(*corner, *size)))


def _cylinder(start: Triple, along: Triple, radius: float) -> tuple[int, int]:
    return (3, int(occ.addCylinder(*start, *along, radius)))


def _taper(length: float, half_root: float, half_tip: float, half_depth: float) -> tuple[int, int]:
    """A bar along x whose half height (z) goes from one value to the other."""
    corners = [(0.0, -half_root), (length, -half_tip), (length, half_tip), (0.0, half_root)]
    points = [occ.addPoint(x, -half_depth, z) for x, z in corners]
    lines = [occ.addLine(one, other) for one, other in zip(points, points[1:] + points[:1], strict=True)]
    face = occ.addPlaneSurface([occ.addCurveLoop(lines)])
    return next(entity for entity in occ.extrude([(2, face)], 0.0, 2.0 * half_depth, 0.0) if entity[0] == 3)


def _fuse(volumes: Volumes) -> Volumes:
    return list(occ.fuse(volumes[:1], volumes[1:])[0])


def _cut(body: Volumes, tools: Volumes) -> Volumes:
    return list(occ.cut(body, tools)[0])


# (a): 150 wide (y), 200 high (z), 800 long.
def _tube() -> Volumes:
    return [_box((250.0, 0.0, 0.0), (500.0, 150.0, 200.0)), _box((625.0, 0.0, 0.0), (350.0, 150.0, 200.0))]


def _tube_hollow() -> Volumes:
    return [_box((400.0, 0.0, 0.0), (784.0, 134.0, 184.0))]


# (b), (c), (e): wall of the barrel, of the drums, half width of the drums, half depth of the barrel.
BARREL, DRUM, HALF_DRUM, HALF_BARREL = 8.0, 20.0, 100.0, 80.0
HALF_ROOT, HALF_TIP, LENGTH, R_ROOT, R_TIP = 130.0, 95.0, 1000.0, 180.0, 130.0


def _drums(wall: float) -> Volumes:
    half = HALF_DRUM - wall
    ends = ((0.0, R_ROOT), (LENGTH, R_TIP))
    return [_cylinder((x, -half, 0.0), (0.0, 2.0 * half, 0.0), radius - wall) for x, radius in ends]


def _barrel(wall: float) -> tuple[int, int]:
    # Walls of 8 are measured at right angles to the tapering sides.
    slant = (1.0 + ((HALF_ROOT - HALF_TIP) / LENGTH) ** 2) ** 0.5
    return _taper(LENGTH, HALF_ROOT - wall * slant, HALF_TIP - wall * slant, HALF_BARREL - wall)


def _casting() -> Volumes:
    return [*_drums(0.0), _barrel(0.0)]


def _casting_hollow() -> Volumes:
    return _fuse([*_drums(DRUM), _barrel(BARREL)])


def _casting_ribbed_hollow() -> Volumes:
    # Web and diaphragm end in the drums' walls, 160 and 110 around the axes inside.
    web = _box(((165.0 + 885.0) / 2.0, 0.0, 0.0), (885.0 - 165.0, BARREL, 4.0 * HALF_ROOT))
    diaphragm = _box((500.0, 0.0, 0.0), (BARREL, 4.0 * HALF_BARREL, 4.0 * HALF_ROOT))
    return _cut(_casting_hollow(), _fuse([web, diaphragm]))


# (d): wall of the tube, of the drum; lengths along the tube.
TUBE, CROSS, FLANGE, REACH, HALF_CROSS = 6.0, 15.0, 40.0, 600.0, 85.0
R_TUBE, R_CROSS, R_FLANGE = 70.0, 85.0, 105.0


def _forearm() -> Volumes:
    flange = _cylinder((0.0, 0.0, 0.0), (FLANGE, 0.0, 0.0), R_FLANGE)
    tube = _cylinder((0.0, 0.0, 0.0), (REACH, 0.0, 0.0), R_TUBE)
    return [flange, tube, _cylinder((REACH, -HALF_CROSS, 0.0), (0.0, 2.0 * HALF_CROSS, 0.0), R_CROSS)]


def _forearm_hollow() -> Volumes:
    half = HALF_CROSS - CROSS
    tube = _cylinder((FLANGE, 0.0, 0.0), (REACH - FLANGE, 0.0, 0.0), R_TUBE - TUBE)
    return _fuse([tube, _cylinder((REACH, -half, 0.0), (0.0, 2.0 * half, 0.0), R_CROSS - CROSS)])


_BACK, _FRONT, _SIDE = (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)
_DRUM_ROOT = Seat((0.0, 0.0, 0.0), (0.0, -HALF_DRUM, 0.0), _SIDE, R_ROOT)
_DRUM_TIP = Seat((LENGTH, 0.0, 0.0), (LENGTH, -HALF_DRUM, 0.0), _SIDE, R_TIP)


def _casting_case(name: str, words: str, cavity: Callable[[], Volumes], window: tuple[Triple, Triple] | None) -> Case:
    return Case(name, words, _DRUM_ROOT, _DRUM_TIP, 0.6, _casting, cavity, BARREL, window)


CASES: dict[str, Case] = {
    case.name: case
    for case in (
        Case(
            "a",
            "box tube 150 x 200 x 800, wall 8, end plates",
            Seat((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), _BACK, 75.0),
            Seat((800.0, 0.0, 0.0), (800.0, 0.0, 0.0), _FRONT, 75.0),
            0.8,
            _tube,
            _tube_hollow,
            8.0,
        ),
        _casting_case("b", "casting 1000 long, cross bosses R180 and R130 20 thick, wall 8", _casting_hollow, None),
        _casting_case("c", "the same with web and diaphragm", _casting_ribbed_hollow, None),
        Case(
            "d",
            "forearm tube R70, wall 6, solid root flange of 40, cross boss R85 15 thick",
            Seat((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), _BACK, R_FLANGE),
            Seat((REACH, 0.0, 0.0), (REACH, HALF_CROSS, 0.0), (0.0, 1.0, 0.0), R_CROSS),
            0.8,
            _forearm,
            _forearm_hollow,
            TUBE,
        ),
        _casting_case(
            "e",
            "as (b) with an open back of 550 x 150",
            _casting_hollow,
            ((500.0, HALF_BARREL - BARREL / 2.0, 0.0), (550.0, BARREL, 150.0)),
        ),
    )
}


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
    folder = asked(__doc__, "folder").folder
    truth = read_truth()
    for name, case in CASES.items():
        for variant in VARIANTS:
            print(write(case, variant, folder, truth[name]["published_kg"]))
        write_step(case, folder / f"{name}.step")


if __name__ == "__main__":
    main()
