"""Parametric casings: the shell of a link, swept along its beam's centre line.

Corners and walls follow the beam mesh exactly: same centre line, same section dimensions (outer size less
one wall is the mid-surface), same material, same interfaces. So the beam and the shell of a link differ by
mechanics only: warping, ovalling, and the rigid rings at the interfaces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshes.beams import BeamMesh, element_axes
from meshes.shell_mesh import ShellMesh
from robots import InputError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Elements around the section at the default size; tests/meshes measures what halving the size changes.
AROUND = 32
# A casing shorter than its section is wide still needs some rows of elements.
LEAST_ROWS = 4


@dataclass(frozen=True)
class _Branch:
    """One swept tube: rings of nodes (s, r, 3) and the wall at each (s,)."""

    rings: Array
    wall: Array


def casing_mesh(beam: BeamMesh, size: float | None = None) -> ShellMesh:
    """Quad shell of a link whose sections, centre line and interfaces are those of its beam mesh.

    Each branch of the beam (root to tip, root to pin) becomes an open tube; at the root both end in the
    same interface. Kinks of the centre line are mitred. ``size`` (m) is the element size aimed at; the
    default gives 32 elements around the largest section.

    Raises
    ------
    InputError
        The section leaves no mid-surface (walls that touch), or ``size`` is not positive.
    """
    if size is None:
        size = float(_perimeter(beam).max()) / AROUND
    branches = [_branch(beam, elements, size) for elements in _branches(beam)]
    nodes, quads, thickness, rings = [], [], [], []
    count = 0
    for branch in branches:
        stations, around = branch.rings.shape[:2]
        number = count + np.arange(stations * around).reshape(stations, around)
        nodes.append(branch.rings.reshape(-1, 3))
        quads.append(_quads(number))
        thickness.append(np.repeat(0.5 * (branch.wall[1:] + branch.wall[:-1]), around))
        rings.append((number[0], number[-1]))
        count += stations * around
    names = list(beam.interfaces)
    interfaces = {names[0]: np.concatenate([first for first, _ in rings])}
    interfaces |= {name: last for name, (_, last) in zip(names[1:], rings, strict=True)}
    return ShellMesh(
        name=beam.name,
        nodes=np.vstack(nodes),
        triangles=np.zeros((0, 3), dtype=np.int64),
        quads=np.vstack(quads),
        thickness=np.concatenate(thickness),
        youngs_modulus=beam.youngs_modulus,
        poissons_ratio=beam.poissons_ratio,
        interfaces=interfaces,
    )


def _branches(beam: BeamMesh) -> list[Indices]:
    """Runs of elements that start at the root node, each in order."""
    root = next(iter(beam.interfaces.values()))
    starts = np.flatnonzero(beam.elements[:, 0] == root)
    return np.split(np.arange(len(beam.elements)), starts[1:])


def _branch(beam: BeamMesh, elements: Indices, size: float) -> _Branch:
    """Sweep the section along straight runs of elements; kinks between runs are mitred."""
    length, axes = element_axes(beam)
    along = axes[elements][:, :, 0]
    kinks = np.flatnonzero(np.einsum("ij,ij->i", along[1:], along[:-1]) < 1.0 - 1e-9) + 1
    runs = np.split(elements, kinks)
    rows = np.array([max(int(np.ceil(length[run].sum() / size)), 1) for run in runs])
    rows = np.maximum(rows, -(-LEAST_ROWS // len(runs)))
    rings, walls = [], []
    for i, (run, count) in enumerate(zip(runs, rows, strict=True)):
        x = axes[run[0]][:, 0]
        share = np.linspace(0.0, 1.0, count + 1)
        station = np.concatenate([[0.0], np.cumsum(length[run])]) / length[run].sum()
        nodes = np.concatenate([beam.elements[run, 0], beam.elements[run[-1:], 1]])
        sections = np.concatenate([beam.dimensions[run, 0], beam.dimensions[run[-1:], 1]])
        centre, dimensions = _interpolate(share, station, beam.nodes[nodes]), _interpolate(share, station, sections)
        offset = np.einsum("ij,srj->sri", axes[run[0]][:, 1:], _outline(beam.kind, dimensions, _counts(beam, size)))
        # Spread over the whole run, so that the rows next to a mitre do not fold over it.
        for neighbour, weight in ((i - 1, 1.0 - share), (i + 1, share)):
            if 0 <= neighbour < len(runs):
                normal = x + axes[runs[neighbour][0]][:, 0]
                _check_twist(beam.name, axes[run[0]], axes[runs[neighbour][0]])
                offset = offset - weight[:, None, None] * (offset @ normal / (x @ normal))[:, :, None] * x
        first = 1 if i else 0
        rings.append((centre[:, None, :] + offset)[first:])
        walls.append(dimensions[first:, -1])
    return _Branch(np.concatenate(rings), np.concatenate(walls))


def _check_twist(name: str, here: Array, there: Array) -> None:
    """Refuse a section that turns about the centre line at a kink: its rings would not meet."""
    across = np.cross(here[:, 0], there[:, 0])
    across /= np.linalg.norm(across)
    if not np.allclose(across @ here[:, 1:], across @ there[:, 1:], atol=1e-6):
        raise InputError(
            f"{name}: the section turns about the centre line at a kink",
            remedy="choose beam_up in or at right angles to the plane of the centre line, never along it",
        )


def _interpolate(at: Array, stations: Array, values: Array) -> Array:
    """Interpolate the columns of ``values`` (s, k), given at the stations, linearly."""
    return np.stack([np.interp(at, stations, column) for column in values.T], axis=1)


def _perimeter(beam: BeamMesh) -> Array:
    mid = beam.dimensions[..., :-1] - beam.dimensions[..., -1:]
    return np.asarray(np.pi * mid[..., 0] if beam.kind == "tube" else 2.0 * mid.sum(axis=-1))


def _counts(beam: BeamMesh, size: float) -> tuple[int, ...]:
    """Elements around a tube, or along a box's width and height: the same for all stations."""
    mid = (beam.dimensions[..., :-1] - beam.dimensions[..., -1:]).reshape(-1, beam.dimensions.shape[-1] - 1)
    if beam.kind == "tube":
        return (max(8, int(np.ceil(np.pi * mid.max() / size))),)
    return tuple(max(2, int(np.ceil(side / size))) for side in mid.max(axis=0))


def _outline(kind: str, dimensions: Array, around: tuple[int, ...]) -> Array:
    """Mid-line of the section at s stations, (s, r, 2): local width and height coordinates."""
    mid = dimensions[:, :-1] - dimensions[:, -1:]
    if kind == "tube":
        angle = 2.0 * np.pi * np.arange(around[0]) / around[0]
        unit = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return np.asarray(0.5 * mid[:, :1, None] * unit)
    wide, high = (np.linspace(-0.5, 0.5, n + 1)[:-1] for n in around)
    low, far = np.full_like(wide, -0.5), np.full_like(high, 0.5)
    unit = np.concatenate(
        [
            np.stack([wide, low], axis=1),
            np.stack([far, high], axis=1),
            np.stack([-wide, -low], axis=1),
            np.stack([-far, -high], axis=1),
        ]
    )
    return np.asarray(mid[:, None, :] * unit)


def _quads(number: Indices) -> Indices:
    """Quads of a closed tube from its node numbers (s, r)."""
    turned = np.roll(number, -1, axis=1)
    corners = [number[:-1], turned[:-1], turned[1:], number[1:]]
    return np.stack(corners, axis=-1).reshape(-1, 4)
