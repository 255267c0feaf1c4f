"""Distance fields on a regular grid, and surfaces as their contours: closed, free of crossings, by construction.

A field is an array over the grid's points, negative inside. A contour of the distance to a surface is that
surface moved; parts too thin to be moved vanish instead of folding, and bodies that touch become one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv
import trimesh
from scipy import ndimage
from scipy.spatial import KDTree
from vtkmodules.vtkImagingStencil import vtkImageStencilToImage, vtkPolyDataToImageStencil

from meshes.shell_mesh import used_only
from robots import InputError
from robots.arrays import Array, Bools, Integers

# 300 bytes a point on the way to a contour.
MOST_POINTS = 12_000_000
# Rounding to the grid moves a sample by up to half a cell's diagonal, in steps.
_ROUNDED = 0.87


@dataclass(frozen=True)
class Grid:
    """Points ``origin + step * (i, j, k)``, all below ``shape``; m."""

    origin: Array
    shape: tuple[int, int, int]
    step: float


def grid_around(name: str, points: Array, step: float, margin: float) -> Grid:
    """Grid over the bounds of ``points`` (p, 3) and ``margin`` m beyond.

    Raises
    ------
    InputError
        More than ``MOST_POINTS`` points.
    """
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    shape = np.ceil((high - low) / step) + 1.0
    if not shape.prod() <= MOST_POINTS:
        raise InputError(
            f"surface {name}: a grid of {1e3 * step:.3g} mm over {np.round(high - low, 3).tolist()} m",
            code="L005",
            value=f"{shape.prod():.3g} points",
            allowed=f"up to {MOST_POINTS:.3g}",
            remedy="choose a larger target size, and look for stray parts far from the casing",
        )
    a, b, c = (int(n) for n in shape)
    return Grid(low, (a, b, c), step)


def sample(corners: Array, spacing: float) -> Array:
    """Points (p, 3) on triangles (m, 3, 3), corners among them, about ``spacing`` m apart at most."""
    edge = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    # Rows run along the longest edge, so that slivers cost no more than their area.
    lead = (np.argmax(edge, axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(corners, lead[:, :, None], axis=1), 1, 0)
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.maximum(edge.max(axis=1), 1e-300)
    face, share = _lattice(height, spacing)
    start, end = (p[face] + share[:, None] * (c[face] - p[face]) for p in (a, b))
    row, share = _lattice(np.linalg.norm(end - start, axis=1), spacing)
    return np.asarray(start[row] + share[:, None] * (end - start)[row])


def _lattice(length: Array, spacing: float) -> tuple[Integers, Array]:
    """Split each length evenly: the length (p,) that each point belongs to and its share 0 to 1 of it."""
    count = np.ceil(length / spacing).astype(np.int64) + 1
    owner = np.repeat(np.arange(len(count)), count)
    place = np.arange(owner.size) - np.repeat(np.cumsum(count) - count, count)
    return owner, place / np.maximum(count[owner] - 1, 1)


def distance(grid: Grid, points: Array, low: float, high: float) -> Array:
    """Distance (of the grid's shape) m from each grid point to the nearest of ``points`` (p, 3), all on the grid.

    Exact between ``low`` and ``high``, elsewhere within a step. Against a surface
    with samples a apart it is too large by up to a^2 / (4 distance).
    """
    free = np.ones(grid.shape, dtype=bool)
    free[tuple(np.rint((points - grid.origin) / grid.step).astype(np.int64).T)] = False
    field = np.asarray(ndimage.distance_transform_edt(free, sampling=grid.step), dtype=np.float64)
    near = (field >= low - _ROUNDED * grid.step) & (field <= high + _ROUNDED * grid.step)
    # Many points are almost equally near: large leaves save half the time.
    field[near] = KDTree(points, leafsize=30).query(grid.origin + grid.step * np.argwhere(near), workers=-1)[0]
    return field


def enclosed(grid: Grid, nodes: Array, faces: Integers) -> Bools:
    """Which grid points a closed surface encloses."""
    stencil = vtkPolyDataToImageStencil()
    stencil.SetInputData(pv.PolyData.from_regular_faces(nodes, faces.astype(int)))
    stencil.SetOutputOrigin(*grid.origin)
    stencil.SetOutputSpacing(*[grid.step] * 3)
    stencil.SetOutputWholeExtent(*np.stack([np.zeros(3, int), np.array(grid.shape) - 1], axis=1).ravel().tolist())
    # The default also takes in points just outside.
    stencil.SetTolerance(0.0)
    image = vtkImageStencilToImage()
    image.SetInputConnection(stencil.GetOutputPort())
    image.SetInsideValue(1.0)
    image.SetOutsideValue(0.0)
    image.Update()
    values: Any = pv.wrap(image.GetOutput()).active_scalars
    return np.asarray(values).reshape(grid.shape, order="F") > 0.5


def contour(grid: Grid, field: Array) -> tuple[Array, Integers]:
    """Closed surface where ``field`` is zero, facing towards larger values.

    Raises
    ------
    ValueError
        The field is not positive on the grid's boundary: the surface would be open.
    """
    rim = [field[0], field[-1], field[:, 0], field[:, -1], field[:, :, 0], field[:, :, -1]]
    if min(side.min() for side in rim) <= 0.0:
        raise ValueError("the field must be positive on the grid's boundary")
    # A zero at a grid point would give triangles without area; single precision must tell the corners apart.
    least = 1e-3 * grid.step
    image = pv.ImageData(dimensions=grid.shape, spacing=(grid.step,) * 3, origin=tuple(grid.origin))
    image["field"] = np.where(np.abs(field) < least, least, field).ravel(order="F")
    surface: Any = image.contour([0.0], scalars="field", method="flying_edges", compute_normals=False)
    if not surface.n_cells:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    nodes, faces = np.asarray(surface.points, dtype=np.float64), np.asarray(surface.regular_faces, dtype=np.int64)
    return nodes, faces if signed_volume(nodes, faces) > 0.0 else faces[:, ::-1].copy()


def signed_volume(nodes: Array, faces: Integers) -> float:
    """Volume m^3 that a closed surface encloses; negative where it faces inward."""
    a, b, c = np.moveaxis(nodes[faces], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def bodies(nodes: Array, faces: Integers) -> list[tuple[Array, Integers]]:
    """Bodies of a surface that hang together by edges, the largest area first."""
    mesh = trimesh.Trimesh(nodes, faces, process=False)
    parts = trimesh.graph.connected_components(mesh.face_adjacency, nodes=np.arange(len(faces)))
    parts = sorted(parts, key=lambda part: -float(mesh.area_faces[part].sum()))
    return [used_only(nodes, faces[part]) for part in parts]


def thinned(nodes: Array, faces: Integers, count: int) -> tuple[Array, Integers] | None:
    """About ``count`` triangles in place of more, where they are needed most; None where that tears the surface."""
    if count >= len(faces):
        return None
    whole: Any = pv.PolyData.from_regular_faces(nodes, faces.astype(int))
    less = whole.decimate(1.0 - count / len(faces), volume_preservation=True)
    nodes, faces = np.asarray(less.points, dtype=np.float64), np.asarray(less.regular_faces, dtype=np.int64)
    mesh = trimesh.Trimesh(nodes, faces, process=False)
    return used_only(nodes, faces) if mesh.is_watertight and mesh.is_winding_consistent else None
