"""Quadratic tetrahedra in a STEP file's solid, or inside a closed surface, by Netgen (the optional extra `solid`).

Netgen (LGPL 2.1) brings OpenCASCADE along, which reads STEP in mm whatever the file's unit.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshes.apart import ApartError, run_apart
from meshes.solid_mesh import outer_faces, untangled, with_middles
from meshes.surfaces.checks import SurfaceFault, crossings, material_surface
from meshes.surfaces.remesh import NearestOn, remesh, surface_to_stay_on
from robots import InputError, require_positive
from robots.arrays import Array, Integers
from robots.files.reading import read_bytes

EXTRA = "install the optional extra: pip install 'stiffarm[solid]'"
MM = 1e-3
# What a link gets where no size is given: its condensation takes seconds. Elements for each h^2 of the surface of a
# casing, and for each h^3 of a block, as Netgen makes them.
USUAL_ELEMENTS, PER_AREA, PER_VOLUME = 25_000, 4.5, 8.5
MOST_ELEMENTS = 300_000
# Elements around a radius of a STEP file's curved faces, and how fast elements may grow.
CURVATURE, GRADING = 2.0, 0.5
# A middle node of an edge moves by at most this share of it.
FARTHEST = 0.15
TIMEOUT_S = 600.0
# Netgen's tetrahedra are left-handed; its middles come by edges 01, 02, 03, 12, 13, 23.
RIGHT_HANDED = [1, 0, 2, 3, 4, 5, 7, 8, 6, 9]

# What a STEP file holds; with a size also its first solid meshed. It runs in a process of its own: OpenCASCADE ends its
# process on spoilt files.
_STEP = """
import sys
import numpy as np
from netgen.occ import OCCGeometry
_, target, path, *sizes = sys.argv[1:]
shape = OCCGeometry(path).shape
solids, faces = list(shape.solids), list(shape.faces)
made = {"counts": np.array([len(solids), len(faces)])}
if len(solids) == 1:
    made["sizes"] = np.array([sum(float(face.mass) for face in solids[0].faces), float(solids[0].mass)])
    made["extent"] = np.array([list(corner) for corner in solids[0].bounding_box])
if sizes:
    size, grading, curvature = map(float, sizes)
    mesh = OCCGeometry(solids[0]).GenerateMesh(maxh=size, grading=grading, curvaturesafety=curvature)
    mesh.SecondOrder()
    made["cells"] = mesh.Elements3D().NumPy()["nodes"].astype(np.int64)
    made["nodes"] = np.asarray(mesh.Coordinates(), dtype=np.float64)
np.savez(target, **made)
"""

# Tetrahedra inside a closed surface; apart too, for Netgen writes what it meets on the screen.
_FILL = """
import sys
import numpy as np
import netgen.meshing as ng
source, target, size, grading = sys.argv[1:]
given = np.load(source, allow_pickle=False)
mesh = ng.Mesh(dim=3)
mesh.AddPoints(given["nodes"])
face = mesh.Add(ng.FaceDescriptor(surfnr=1, domin=1, domout=0, bc=1))
mesh.AddElements(dim=2, index=face, data=given["faces"], base=0)
mesh.GenerateVolumeMesh(ng.MeshingParameters(maxh=float(size), grading=float(grading)))
cells = mesh.Elements3D().NumPy()["nodes"].astype(np.int64)
np.savez(target, cells=cells, nodes=np.asarray(mesh.Coordinates(), dtype=np.float64))
"""


def require_netgen(what: str) -> None:
    """Raise InputError where Netgen is not installed."""
    if importlib.util.find_spec("netgen") is None:
        raise InputError(f"{what} needs the package netgen-mesher", code="F013", remedy=EXTRA)


def usual_size(area: float, volume: float) -> float:
    """Element size (m) for the usual number of elements: in thin walls by area (m^2), in blocks by volume (m^3)."""
    return max(float(np.sqrt(PER_AREA * area / USUAL_ELEMENTS)), float(np.cbrt(PER_VOLUME * volume / USUAL_ELEMENTS)))


@dataclass(frozen=True)
class StepSolid:
    """The one solid of a STEP file: metres for Netgen's unit, area (m^2), volume (m^3), extent (2, 3) m."""

    path: Path
    metre: float
    area: float
    volume: float
    extent: Array

    @property
    def name(self) -> str:
        """The file's name."""
        return self.path.name


def open_step(path: Path, scale: float | None = None) -> StepSolid:
    """Read a STEP file with one solid.

    ``scale``: metres for one mm of the file, where its unit is not what it says; None takes the file's own.

    Raises
    ------
    InputError
        No Netgen, file missing or unreadable, no solid or several.
    """
    require_netgen(f"STEP file {path.name}")
    require_positive("scale (m for one unit of the file)", scale, code="L008")
    content = read_bytes(path, "STEP file")
    if not content.lstrip().startswith(b"ISO-10303-21"):
        raise InputError(
            f"STEP file {path.name} is none",
            code="L008",
            value=content[:20].decode("latin-1"),
            allowed="ISO-10303-21 first",
            remedy="export it as STEP (AP203, AP214 or AP242)",
        )
    try:
        found = run_apart(_STEP, (str(path.absolute()),), {}, TIMEOUT_S)
    except ApartError as error:
        raise InputError(
            f"STEP file {path.name} cannot be read ({error})", code="L008", remedy="export it again"
        ) from error
    solids, faces = (int(number) for number in found["counts"])
    if solids != 1:
        raise InputError(
            f"STEP file {path.name}: solids",
            code="L008",
            value=solids or f"none, {faces} loose faces",
            allowed="one",
            remedy="unite the bodies that are cast or welded together, and export the link's structure alone"
            if solids
            else "export a solid body, not surfaces",
        )
    metre = MM if scale is None else scale
    area, volume = (float(number) for number in found["sizes"])
    extent = metre * found["extent"].astype(np.float64)
    if not (np.isfinite([area, volume]).all() and area > 0.0 and volume > 0.0 and np.isfinite(extent).all()):
        raise InputError(
            f"STEP file {path.name}: its solid's volume (mm3) and area (mm2)",
            code="L008",
            value=f"{volume:.4g} and {area:.4g}",
            allowed="above 0",
            remedy="heal it in the program it came from, and export it again",
        )
    return StepSolid(path, metre, area * metre**2, volume * metre**3, extent)


def mesh_step(solid: StepSolid, size: float | None) -> tuple[Array, Integers, float, list[str]]:
    """Nodes (k, 3) m, ten-noded tetrahedra (e, 10), their size (m) and notes.

    ``size`` m; None gives some 25,000 elements.

    Raises
    ------
    InputError
        A solid that Netgen cannot mesh, far too many elements.
    """
    size = usual_size(solid.area, solid.volume) if size is None else size
    _check_count(solid.name, size, solid.area, solid.volume)
    arguments = (str(solid.path.absolute()), repr(size / solid.metre), repr(GRADING), repr(CURVATURE))
    try:
        made = run_apart(_STEP, arguments, {}, TIMEOUT_S)
    except ApartError as error:
        raise InputError(
            f"STEP file {solid.name}: Netgen cannot mesh its solid ({error})",
            code="L008",
            remedy="heal it in the program it came from, or choose another element size",
        ) from error
    nodes, cells = _used(solid.name, made["cells"].astype(np.int64), made["nodes"].astype(np.float64))
    notes = [
        f"read one solid of {solid.volume:.6g} m3 from {solid.name}",
        f"meshed with {len(cells)} tetrahedra of {1e3 * size:.4g} mm",
    ]
    return untangled(solid.metre * nodes, cells), cells, size, notes


def in_surface(
    name: str, nodes: Array, faces: Integers, size: float | None
) -> tuple[Array, Integers, float, list[str]]:
    """As :func:`mesh_step`, inside a closed surface, nodes (n, 3) m and faces (m, 3); hollows in it stay hollow.

    Middle nodes of the skin are put back onto the surface, so that elements follow its curvature.

    Raises
    ------
    InputError
        No Netgen, an open, self-crossing or non-manifold surface, several bodies, far too many elements.
    """
    require_netgen(f"solid {name}")
    nodes, faces, notes = material_surface(name, nodes, faces)
    corners = nodes[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area, volume = 0.5 * float(np.linalg.norm(normal, axis=1).sum()), float((corners[:, 0] * normal).sum() / 6.0)
    size = usual_size(area, volume) if size is None else size
    _check_count(name, size, area, volume)
    skin, cells = remesh(nodes, faces, size)
    pairs = crossings(skin, cells)
    if len(pairs):
        raise SurfaceFault(
            f"surface {name} crosses itself: {np.unique(pairs).size} triangles, the first near "
            f"{np.round(skin[cells[pairs[0, 0]]].mean(axis=0), 4).tolist()} m",
            code="L003",
            remedy="separate the parts in the program it came from, or choose a smaller element size",
        )
    try:
        # In mm: Netgen takes lengths below 1e-6 for zero.
        given: dict[str, NDArray[Any]] = {"nodes": skin / MM, "faces": cells.astype(np.int32)}
        made = run_apart(_FILL, (repr(size / MM), repr(GRADING)), given, TIMEOUT_S)
    except ApartError as error:
        raise SurfaceFault(
            f"surface {name}: Netgen cannot fill it with tetrahedra ({error})",
            code="L008",
            remedy="repair the surface in the program it came from, or choose another element size",
        ) from error
    points, tetrahedra = _used(name, made["cells"].astype(np.int64), made["nodes"].astype(np.float64))
    points, tetrahedra = with_middles(MM * points, tetrahedra)
    points = untangled(_onto(points, tetrahedra, surface_to_stay_on(nodes, faces, size)), tetrahedra)
    notes.append(f"remeshed from {len(faces)} to {len(cells)} triangles of {1e3 * size:.4g} mm")
    notes.append(f"filled with {len(tetrahedra)} tetrahedra")
    return points, tetrahedra, size, notes


def _onto(nodes: Array, tetrahedra: Integers, target: NearestOn) -> Array:
    """Nodes with the middles of the skin's edges on the surface, where it is near."""
    skin, _ = outer_faces(tetrahedra)
    sides = np.stack([skin[:, [0, 1, 3]], skin[:, [1, 2, 4]], skin[:, [2, 0, 5]]], axis=1).reshape(-1, 3)
    start, end, middle = sides[np.unique(sides[:, 2], return_index=True)[1]].T
    way = target.nearest(nodes[middle]) - nodes[middle]
    length = np.linalg.norm(nodes[end] - nodes[start], axis=1)
    near = np.linalg.norm(way, axis=1) <= FARTHEST * length
    moved = nodes.copy()
    moved[middle[near]] += way[near]
    return moved


def _check_count(name: str, size: float, area: float, volume: float) -> None:
    count = max(PER_AREA * area / size**2, PER_VOLUME * volume / size**3)
    if count > MOST_ELEMENTS:
        raise InputError(
            f"element size for {name} (mm)",
            code="L005",
            value=1e3 * size,
            allowed=f"at most {MOST_ELEMENTS} tetrahedra, not some {count:.3g}",
            remedy="choose a larger element size, or look at the file's unit of length",
        )


def _used(name: str, cells: Integers, nodes: Array) -> tuple[Array, Integers]:
    """Netgen's nodes and tetrahedra, right-handed, of four or ten nodes, nodes that none of them uses left out."""
    raw = cells - 1
    if not len(raw):
        raise InputError(
            f"solid {name}: Netgen made no tetrahedra", code="L008", remedy="choose a smaller element size"
        )
    order = RIGHT_HANDED if raw.shape[1] >= len(RIGHT_HANDED) and (raw[:, 9] >= 0).all() else RIGHT_HANDED[:4]
    used, place = np.unique(raw[:, order], return_inverse=True)
    return nodes[used], place.reshape(-1, len(order))
