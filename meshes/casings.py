"""Parametric casings: the shell of a link, swept along its beam's centre line.

Corners and walls follow the beam mesh exactly: same centre line, same section dimensions (outer size less
one wall is the mid-surface), same material, same interfaces. So the beam and the shell of a link differ by
mechanics only: warping, ovalling, and the rigid rings at the interfaces. Openings and rims are the shell's
alone; the beam knows nothing of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from meshes.beams import BeamMesh, element_axes
from meshes.openings import SAME, Branch, Lines, divided, lines_of
from meshes.shell_mesh import ShellMesh
from robots import InputError, require_positive
from robots.arrays import Array, Bools, Integers
from robots.schema.description import Opening, Rim

# Elements around the section at the default size; tests/meshes measures what halving the size changes. The
# stress at the corners of openings is singular: there the error falls with the size only, not with its square.
AROUND = 32
AROUND_WITH_OPENINGS = 48
# A casing shorter than its section is wide still needs some rows of elements.
LEAST_ROWS = 4


@dataclass(frozen=True)
class _Tube:
    """One swept tube: rings of nodes (s, r, 3), thickness (s - 1, r) and which of its elements are there."""

    rings: Array
    thickness: Array
    kept: Bools


def casing_mesh(
    beam: BeamMesh, size: float | None = None, *, openings: Sequence[Opening] = (), rim: Rim | None = None
) -> ShellMesh:
    """Quad shell of a link whose sections, centre line and interfaces are those of its beam mesh.

    Each branch of the beam (root to tip, root to pin) becomes an open tube; at the root both end in the
    same interface. Kinks of the centre line are mitred.

    Parameters
    ----------
    size : element size aimed at, m; :func:`casing_size` unless given
    openings : rectangular holes in the walls of the branch from root to tip (boxes only), given by shares of the
        centre line and of the wall. Element lines lie on their edges
    rim : wall and length of a thicker rim at every interface; the mid-surface stays where it is

    Raises
    ------
    InputError
        ``size`` is not positive; a section that turns at a kink; openings that overlap, touch, or reach into a
        rim or into the mitre of a kink; edges of openings and rims nearer to one another than the wall is thick
        (equal shares are fine); rims longer than half a branch or thinner than the wall; openings in a tube.
    """
    if size is None:
        size = casing_size(beam, openings)
    require_positive(f"{beam.name}: element size (m)", size, code="L009")
    if openings and beam.kind != "box":
        raise InputError(f"{beam.name}: openings", code="L009", value=f"in a {beam.kind}", allowed="in boxes only")
    tubes = [
        _tube(beam, elements, size, lines_of(_described(beam, elements, name), () if i else openings, rim))
        for i, (elements, name) in enumerate(zip(_branches(beam), list(beam.interfaces)[1:], strict=True))
    ]
    nodes, quads, thickness, rings = [], [], [], []
    count = 0
    for tube in tubes:
        stations, around = tube.rings.shape[:2]
        number = count + np.arange(stations * around).reshape(stations, around)
        nodes.append(tube.rings.reshape(-1, 3))
        quads.append(_quads(number)[tube.kept.ravel()])
        thickness.append(tube.thickness[tube.kept])
        rings.append((number[0], number[-1]))
        count += stations * around
    used = np.unique(np.concatenate([q.ravel() for q in quads]))
    renumbered = np.full(count, -1)
    renumbered[used] = np.arange(used.size)
    names = list(beam.interfaces)
    interfaces = {names[0]: np.concatenate([first for first, _ in rings])}
    interfaces |= {name: last for name, (_, last) in zip(names[1:], rings, strict=True)}
    return ShellMesh(
        name=beam.name,
        nodes=np.vstack(nodes)[used],
        triangles=np.zeros((0, 3), dtype=np.int64),
        quads=renumbered[np.vstack(quads)],
        thickness=np.concatenate(thickness),
        youngs_modulus=beam.youngs_modulus,
        poissons_ratio=beam.poissons_ratio,
        interfaces={name: renumbered[ring] for name, ring in interfaces.items()},
    )


def casing_size(beam: BeamMesh, openings: Sequence[Opening] = ()) -> float:
    """Default element size, m: 32 elements around the largest section, 48 in a casing with openings.

    Halving it changes no entry of a bundled link's flexibility by 2 % of its class (tests/meshes).
    """
    return float(_perimeter(beam).max()) / (AROUND_WITH_OPENINGS if openings else AROUND)


def _branches(beam: BeamMesh) -> list[Integers]:
    """Runs of elements that start at the root node, each in order."""
    root = next(iter(beam.interfaces.values()))
    starts = np.flatnonzero(beam.elements[:, 0] == root)
    return np.split(np.arange(len(beam.elements)), starts[1:])


def _runs(beam: BeamMesh, elements: Integers) -> tuple[list[Integers], Array]:
    """Straight runs of a branch's elements, and the share of the centre line (r + 1,) where each begins and ends."""
    length, axes = element_axes(beam)
    along = axes[elements][:, :, 0]
    kinks = np.flatnonzero(np.einsum("ij,ij->i", along[1:], along[:-1]) < 1.0 - 1e-9) + 1
    runs = np.split(elements, kinks)
    ends = np.concatenate([[0.0], np.cumsum([length[run].sum() for run in runs])])
    return runs, ends / ends[-1]


def _described(beam: BeamMesh, elements: Integers, tip: str) -> Branch:
    """What the lines of openings and rims on a branch depend on."""
    dimensions = beam.dimensions[elements].reshape(-1, beam.dimensions.shape[-1])
    mid = (dimensions[:, :-1] - dimensions[:, -1:]).min(axis=0)
    sides = np.tile(mid, 2) if beam.kind == "box" else np.full(4, mid[0])
    return Branch(
        name=f"{beam.name}, root to {tip}",
        length=float(element_axes(beam)[0][elements].sum()),
        kinks=_kinks(beam, elements),
        sides=sides,
        wall=float(dimensions[:, -1].max()),
    )


def _kinks(beam: BeamMesh, elements: Integers) -> tuple[tuple[float, float], ...]:
    """Share of the centre line and reach of the mitre on the inner side (m) of each kink of a branch."""
    runs, ends = _runs(beam, elements)
    axes = element_axes(beam)[1]
    kinks = []
    for i, run in enumerate(runs[1:]):
        x, y, z = axes[run[0]].T
        before = axes[runs[i][0]][:, 0]
        bend = before - (before @ x) * x
        bend /= np.linalg.norm(bend)
        mid = beam.dimensions[run[0], 0, :-1] - beam.dimensions[run[0], 0, -1]
        across = mid[0] if beam.kind == "tube" else abs(bend @ y) * mid[0] + abs(bend @ z) * mid[1]
        kinks.append((float(ends[i + 1]), float(0.5 * across * np.tan(0.5 * np.arccos(before @ x)))))
    return tuple(kinks)


def _tube(beam: BeamMesh, elements: Integers, size: float, lines: Lines) -> _Tube:
    """Sweep the section along straight runs of elements; kinks between runs are mitred."""
    length, axes = element_axes(beam)
    runs, ends = _runs(beam, elements)
    around = _around(beam, size, lines)
    rings, walls, stations = [], [], []
    for i, run in enumerate(runs):
        x = axes[run[0]][:, 0]
        inner = _inner(lines, ends[i], ends[i + 1])
        holes = (lines.holes[:, :2] - ends[i]) / (ends[i + 1] - ends[i])
        pieces = np.concatenate([[0.0], inner, [1.0]])
        share = divided(pieces, length[run].sum(), size, holes, least=-(-LEAST_ROWS // len(runs)))
        station = np.concatenate([[0.0], np.cumsum(length[run])]) / length[run].sum()
        nodes = np.concatenate([beam.elements[run, 0], beam.elements[run[-1:], 1]])
        sections = np.concatenate([beam.dimensions[run, 0], beam.dimensions[run[-1:], 1]])
        centre, dimensions = _interpolate(share, station, beam.nodes[nodes]), _interpolate(share, station, sections)
        offset = np.einsum("ij,srj->sri", axes[run[0]][:, 1:], _outline(beam.kind, dimensions, around))
        # Spread up to the next opening or rim or over the whole run, so that rows next to a mitre do not fold over it.
        to, since = (inner[0], inner[-1]) if inner.size else (1.0, 0.0)
        fading, growing = np.clip(1.0 - share / to, 0.0, 1.0), np.clip((share - since) / (1.0 - since), 0.0, 1.0)
        for neighbour, weight in ((i - 1, fading), (i + 1, growing)):
            if 0 <= neighbour < len(runs):
                normal = x + axes[runs[neighbour][0]][:, 0]
                _check_twist(beam.name, axes[run[0]], axes[runs[neighbour][0]])
                offset = offset - weight[:, None, None] * (offset @ normal / (x @ normal))[:, :, None] * x
        first = 1 if i else 0
        rings.append((centre[:, None, :] + offset)[first:])
        walls.append(dimensions[first:, -1])
        stations.append((ends[i] + share * (ends[i + 1] - ends[i]))[first:])
    wall, along = np.concatenate(walls), np.concatenate(stations)
    middle = 0.5 * (along[1:] + along[:-1])
    thickness = lines.thickness(middle, 0.5 * (wall[1:] + wall[:-1]))
    number = np.repeat(np.arange(len(around)), [a.size - 1 for a in around])
    removed = lines.removed(middle, number, np.concatenate([0.5 * (a[1:] + a[:-1]) for a in around]))
    return _Tube(np.concatenate(rings), np.repeat(thickness[:, None], number.size, axis=1), ~removed)


def _inner(lines: Lines, start: float, end: float) -> Array:
    """Lines within a run, as shares of it; the run is the branch from share ``start`` to ``end``."""
    inner = (lines.along - start) / (end - start)
    return inner[(inner > SAME) & (inner < 1.0 - SAME)]


def _around(beam: BeamMesh, size: float, lines: Lines) -> tuple[Array, ...]:
    """Lines around the section: of each wall of a box from -0.5 to 0.5, or of a tube from 0 to 1."""
    mid = (beam.dimensions[..., :-1] - beam.dimensions[..., -1:]).reshape(-1, beam.dimensions.shape[-1] - 1)
    if beam.kind == "tube":
        count = max(8, int(np.ceil(np.pi * mid.max() / size)))
        return (np.arange(count + 1) / count,)
    return tuple(
        divided(breaks, float(width), size, lines.holes[lines.hole_walls == side, 2:], least=2)
        for side, (breaks, width) in enumerate(zip(lines.around, np.tile(mid.max(axis=0), 2), strict=True))
    )


def _check_twist(name: str, here: Array, there: Array) -> None:
    """Refuse a section that turns about the centre line at a kink: its rings would not meet."""
    across = np.cross(here[:, 0], there[:, 0])
    across /= np.linalg.norm(across)
    if not np.allclose(across @ here[:, 1:], across @ there[:, 1:], atol=1e-6):
        raise InputError(
            f"{name}: the section turns about the centre line at a kink",
            code="L009",
            remedy="choose beam_up in or at right angles to the plane of the centre line, never along it",
        )


def _interpolate(at: Array, stations: Array, values: Array) -> Array:
    """Interpolate the columns of ``values`` (s, k), given at the stations, linearly."""
    return np.stack([np.interp(at, stations, column) for column in values.T], axis=1)


def _perimeter(beam: BeamMesh) -> Array:
    mid = beam.dimensions[..., :-1] - beam.dimensions[..., -1:]
    return np.asarray(np.pi * mid[..., 0] if beam.kind == "tube" else 2.0 * mid.sum(axis=-1))


def _outline(kind: str, dimensions: Array, around: tuple[Array, ...]) -> Array:
    """Mid-line of the section at s stations, (s, r, 2): local width and height coordinates."""
    mid = dimensions[:, :-1] - dimensions[:, -1:]
    if kind == "tube":
        count = around[0].size - 1
        angle = 2.0 * np.pi * np.arange(count) / count
        unit = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return np.asarray(0.5 * mid[:, :1, None] * unit)
    low, right, top, left = (lines[:-1] for lines in around)
    unit = np.concatenate(
        [
            np.stack([low, np.full_like(low, -0.5)], axis=1),
            np.stack([np.full_like(right, 0.5), right], axis=1),
            np.stack([-top, np.full_like(top, 0.5)], axis=1),
            np.stack([np.full_like(left, -0.5), -left], axis=1),
        ]
    )
    return np.asarray(mid[:, None, :] * unit)


def _quads(number: Integers) -> Integers:
    """Quads of a closed tube from its node numbers (s, r)."""
    turned = np.roll(number, -1, axis=1)
    corners = [number[:-1], turned[:-1], turned[1:], number[1:]]
    return np.stack(corners, axis=-1).reshape(-1, 4)
