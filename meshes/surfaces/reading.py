"""Surface files, read into metres and the link's axes: STL, OBJ, PLY, and DAE with its unit and up axis.

Surfaces are arrays: corners (n, 3) and faces (m, 3), the outward sense of a face by its right hand.
"""

from __future__ import annotations

import importlib.util
import io
import re
from pathlib import Path

import numpy as np
import trimesh

from robots import InputError, require_one_of, require_positive
from robots.arrays import Array, Integers
from robots.files.reading import read_bytes

SUFFIXES = (".stl", ".obj", ".dae", ".ply")
STEP_SUFFIXES = (".step", ".stp")
# Extents of a casing over the distance of its interfaces; beyond, the unit of length is in doubt.
SPAN_RATIO = (0.5, 5.0)
SCALES = (0.001, 1000.0, 0.01, 100.0, 0.0254, 0.3048)
# Rows: x, y, z of a Z_UP file from those of another (COLLADA 1.4.1, up_axis: right, up and in axes).
UP = {"Y_UP": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), "X_UP": np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])}
# In any unit of length; an arm in micrometres stays far below.
LARGEST_COORDINATE = 1e9
# The asset with the up axis stands at the start of a DAE file.
_HEAD_BYTES = 1 << 18


def read_surface(path: Path, scale: float | None, heed_up_axis: bool = True) -> tuple[Array, Integers, list[str]]:
    """Corners in metres and faces of a STL, OBJ, DAE or PLY file; a scene's geometries where they stand in it.

    ``scale`` is metres for one unit of the file; None takes the file's own unit (DAE), else metres.
    ``heed_up_axis``: turn a DAE file that names X or Y its up axis until that is Z. Robot descriptions mean the
    coordinates as they stand, as RViz and MoveIt take them (ros-visualization/rviz issue 1045).

    Raises
    ------
    InputError
        File missing or unreadable, no triangles, numbers that are not finite, ``scale`` not positive.
    """
    require_one_of(f"surface {path.name}", path.suffix.lower(), SUFFIXES, code="L001")
    require_positive("scale (m for one unit of the file)", scale, code="L001")
    if path.suffix.lower() == ".dae" and importlib.util.find_spec("collada") is None:
        raise InputError(
            f"surface {path.name}: DAE files need the package pycollada",
            code="F013",
            remedy="install pycollada, or convert the file to STL",
        )
    data = read_bytes(path, "surface file")
    try:
        # From the bytes: a mesh that names other files (materials, pictures) gets none of them opened.
        with np.errstate(all="ignore"):  # whether the corners are numbers is checked below
            mesh = trimesh.load_mesh(io.BytesIO(data), file_type=path.suffix.lower().removeprefix("."), process=False)
            nodes = np.asarray(mesh.vertices, dtype=np.float64)
            faces = np.asarray(mesh.faces, dtype=np.int64)
    except Exception as error:  # the readers raise whatever their parsers do
        raise InputError(
            f"surface {path.name} cannot be read ({type(error).__name__}: {error})",
            code="L001",
            remedy="export it again",
        ) from error
    if not faces.size:
        raise InputError(
            f"surface {path.name} has no triangles", code="L001", remedy="export a surface, not points or curves"
        )
    if not 0 <= faces.min() <= faces.max() < len(nodes):
        raise InputError(
            f"surface {path.name}: triangles of corners that are not there", code="L001", remedy="export it again"
        )
    if not (np.abs(nodes) <= LARGEST_COORDINATE).all():
        raise InputError(
            f"surface {path.name}: corners that are not finite numbers",
            code="L001",
            allowed=f"at most {LARGEST_COORDINATE:g} in size",
            remedy="export it again",
        )
    notes = [f"read {len(faces)} triangles from {path.name}"]
    up = _up_axis(path, data)
    if up in UP:
        if heed_up_axis:
            nodes = nodes @ UP[up].T
        notes.append(f"up axis of the file {up[0]}: {'turned to Z' if heed_up_axis else 'not heeded, as in RViz'}")
    if scale is None:
        scale = float(trimesh.units.unit_conversion(mesh.units, "meters")) if mesh.units else 1.0
        notes.append(f"unit of the file {'from its header' if mesh.units else 'taken as the metre'}")
    if scale != 1.0:
        notes.append(f"coordinates multiplied by {scale:g}")
    return nodes * scale, faces, notes


def _up_axis(path: Path, data: bytes) -> str:
    """What a DAE file says of its up axis; empty for other files and where it says nothing."""
    if path.suffix.lower() != ".dae":
        return ""
    found = re.search(rb"<up_axis>\s*([XYZ]_UP)\s*</up_axis>", data[:_HEAD_BYTES])
    return found.group(1).decode() if found else ""


def check_scale(
    name: str, nodes: Array, points: Array, span: float | None, ratio: tuple[float, float] = SPAN_RATIO
) -> str:
    """Compare the surface's diagonal with the interfaces' distance (m); a line for the report.

    Raises
    ------
    InputError
        Diagonal over distance is outside ``ratio``; a factor that would mend it is named.
    """
    if span is None:
        span = float(np.linalg.norm(points[:, None] - points[None], axis=2).max())
    else:
        require_positive("expected span (m)", span, code="L002")
    diagonal = float(np.linalg.norm(np.ptp(nodes, axis=0)))
    low, high = ratio
    if span == 0.0:
        return "scale not checked: one interface and no expected span"
    if not low <= diagonal / span <= high:
        fits = [factor for factor in SCALES if low <= factor * diagonal / span <= high]
        remedy = f"multiply scale by {fits[0]:g} (--scale {fits[0]:g} if none was given)" if fits else "check both"
        raise InputError(
            f"scale of {name}: surface {diagonal:.4g} m across, interfaces {span:.4g} m apart",
            code="L002",
            value=f"ratio {diagonal / span:.4g}",
            allowed=f"{low:g} to {high:g}",
            remedy=remedy,
        )
    return f"scale: surface {diagonal:.4g} m across, interfaces {span:.4g} m apart"
