"""Two ways from a surface to even triangles on its mid-surface: as it is, with its own edges, or wrapped."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import trimesh

from meshes.surfaces.checks import SurfaceFault, crossings, repair_surface
from meshes.surfaces.reading import SPAN_RATIO
from meshes.surfaces.remesh import remesh, sharp_density
from robots import InputError
from robots.arrays import Array, Integers

if TYPE_CHECKING:
    from meshes.surfaces.wrap import Method, Wrap
from meshes.surfaces.remesh import normals, unit
from robots.arrays import Bools

Repair = Literal["auto", "none", "wrap"]

# Has no type hints.
_triangles: Any = trimesh.triangles

# Elements beyond this come from a target size in the wrong unit.
MOST_ELEMENTS = 400_000
# What a link gets where no size is given: its condensation takes seconds.
USUAL_ELEMENTS = 10_000
# Length of sharp edges times size over area: visual meshes with more (a plain box has 0.1) are full of details
# that elements of the size cannot follow; meshing them as they are fails late, or leaves poor elements.
MOST_DETAIL, FEW_FACES = 0.25, 500
# Half the least distance of two sides of a wrapped part, in sizes, and whether to keep edges: one after the other
# until a mesh is good. More detail is lost, and edges are rounded, only where the surface asks for it.
ATTEMPTS = ((0.25, True), (0.5, True), (0.5, False))
WRAPPED_ANGLE_DEG = 8.0
# Below, a triangle has no area worth the name, and no shell is made of it.
USELESS_ANGLE_DEG = 0.1
# Triangles of a wrap over those wanted, to begin remeshing with.
START = 1.5
# Of the departure that is taken: walls that got lost weigh more than openings that are spanned. Where no closing width
# is as good, all of it.
LOST_WALLS = 0.5
# Directions in which the faces around a node say less than this about the mid-surface are left alone.
LEAST_SHARE = 0.03
# No node moves further than this many half walls: a right-angled corner needs 1.73.
FARTHEST = 2.5


@dataclass(frozen=True)
class ImportSettings:
    """How a surface becomes a shell.

    ``wall`` m: thickness everywhere. ``youngs_modulus`` Pa, ``poissons_ratio``. ``target_size`` m: edge length
    aimed at; None gives some ten thousand elements, never smaller than the wall. ``repair``: "none" takes the
    surface as it is, with small repairs, or refuses it; "wrap" wraps it; "auto" wraps what "none" refuses.
    ``opening`` m and ``wrap``: see :func:`meshes.surfaces.wrap.wrap_surface`; with None the smallest opening that
    gives one casing near the original, by :mod:`meshes.surfaces.trials`. ``expected_span`` m, that the
    surface should span; None takes the interfaces' largest distance. ``span_ratio``: the surface's diagonal
    over that span, least and most. ``boss``: walls of bosses around joints across the link, over ``wall``.
    """

    wall: float
    youngs_modulus: float
    poissons_ratio: float
    target_size: float | None = None
    repair: Repair = "auto"
    opening: float | None = None
    wrap: Literal["auto", "alpha", "grid"] = "auto"
    expected_span: float | None = None
    span_ratio: tuple[float, float] = SPAN_RATIO
    boss: float = 1.0


@dataclass(frozen=True)
class Meshed:
    """A mid-surface: nodes (n, 3) m, faces (m, 3), element size (m), lines for the report.

    ``departure`` (m) from the original: the value that 95 % of the surfaces keep, and the worst; NaN if unknown.
    ``off`` (n,) m: by node, how far it is from the original, as over an opening that was closed; empty if unknown.
    """

    nodes: Array
    faces: Integers
    size: float
    report: tuple[str, ...]
    departure: tuple[float, float] = (float("nan"), float("nan"))
    off: Array = field(default_factory=lambda: np.zeros(0))


def usual_size(area: float, wall: float) -> float:
    """Element size (m) that gives ``USUAL_ELEMENTS`` equilateral triangles on ``area`` m^2, at least the wall."""
    return max(wall, float(np.sqrt(area / (np.sqrt(0.1875) * USUAL_ELEMENTS))))


def as_it_is(name: str, nodes: Array, faces: Integers, settings: ImportSettings) -> Meshed:
    """Mesh a closed skin with its own edges; SurfaceFault where it has no clean one."""
    size = settings.target_size or usual_size(float(_triangles.area(nodes[faces]).sum()), settings.wall)
    nodes, faces, report = repair_surface(name, nodes, faces, 2.0 * np.pi * size)
    _check_room(name, nodes, faces, size, settings.wall)
    detail = sharp_density(nodes, faces) * size
    if settings.repair == "auto" and detail > MOST_DETAIL and len(faces) > FEW_FACES:
        raise SurfaceFault(
            f"surface {name} has {detail:.2g} m of sharp edges for each strip of elements a metre long",
            code="L005",
            allowed=f"up to {MOST_DETAIL:g}",
            remedy="let the import wrap it, or choose a smaller target size",
        )
    skin, cells = remesh(nodes, faces, size)
    _refuse_crossings(name, skin, cells, "crosses itself", "separate the parts in the program it came from")
    report.append(f"remeshed from {len(faces)} to {len(cells)} triangles of {1e3 * size:.4g} mm")
    middle, fewer = offset_inward(name, skin, cells, 0.5 * settings.wall)
    _refuse_crossings(name, middle, cells, "has places thinner than the wall", "give the wall's true thickness")
    report.append(f"nodes moved inward by half the wall, {500 * settings.wall:.4g} mm, to the mid-surface")
    if fewer:
        report.append(f"{fewer} nodes moved less, where elements would have folded")
    return Meshed(middle, cells, size, tuple(report))


def wrapped(name: str, nodes: Array, faces: Integers, settings: ImportSettings) -> Meshed:
    """Wrap any surface and mesh the wrap's mid-surface; where no opening is asked for, the width is found by trial."""
    # Brings VTK with it, which only wrapping needs.
    from meshes.surfaces.trials import by_trial, methods
    from meshes.surfaces.wrap import check_method, wrap_surface

    check_method(settings.wrap)
    size = settings.target_size
    if size is None:
        # Files may hold much more than the skin, so its area is that of a coarse wrap.
        coarse = max(settings.wall, float(np.linalg.norm(np.ptp(nodes, axis=0))) / 40.0)
        trial = wrap_surface(name, nodes, faces, coarse, settings.opening)
        size = usual_size(float(_triangles.area(trial.nodes[trial.faces]).sum()), settings.wall)
    if settings.opening is None:

        def attempt(width: float, method: Method, most: float, lost: float) -> Meshed:
            return _casing(name, nodes, faces, settings.wall, size, width, method, most, lost * most)

        try:
            done, failed = by_trial(name, size, settings.wrap, partial(attempt, lost=LOST_WALLS))
        except InputError:
            done, failed = by_trial(name, size, settings.wrap, partial(attempt, lost=1.0))
    else:
        method, failed = methods(settings.wrap)[0], ()
        done = _casing(name, nodes, faces, settings.wall, size, settings.opening, method)
    tried = (f"closing width {trial}: not taken" for trial in failed)
    return replace(done, report=(*tried, *done.report))


def _casing(
    name: str,
    nodes: Array,
    faces: Integers,
    wall: float,
    size: float,
    opening: float,
    method: Method,
    most: float = np.inf,
    lost: float = np.inf,
) -> Meshed:
    """Mid-surface of a wrap, meshed; SurfaceFault where there is none, or it is over ``most`` m off.

    ``lost`` m: the same of what the wrap sees of the original and the mid-surface has not.
    """
    from meshes.surfaces.trials import TooFar, warning
    from meshes.surfaces.wrap import departure, middle_surface, off_original, original_seen, wrap_surface

    wrap = wrap_surface(name, nodes, faces, size, opening, method)
    _check_room(name, wrap.nodes, wrap.faces, size, wall, wrap.offset)
    fine, notes = middle_surface(name, wrap, wall, size, ATTEMPTS[0][0] * size)
    # Before remeshing, which takes most of the time.
    original = original_seen(wrap, nodes[faces], size)
    off = departure(original, fine, wall, size)
    if off.middling > most or off.lost > lost:
        raise TooFar(name, off, most)
    middle, cells, notes, edges = _remeshed(name, wrap, fine, notes, wall, size)
    off = departure(original, (middle, cells), wall, size)
    if off.middling > most or off.lost > lost:
        raise TooFar(name, off, most)
    report = (
        *wrap.notes,
        f"mid-surface {500 * wall:.4g} mm inside the original, remeshed to {len(cells)} triangles of "
        f"{1e3 * size:.4g} mm, edges {'kept' if edges else 'rounded'}",
        *notes,
        f"details lost and openings bridged: 95 % of what is seen is off by less than {1e3 * off.middling:.3g} mm, "
        f"all of it by less than {1e3 * off.worst:.3g} mm",
    )
    report = (*warning(off, size), *report)
    return Meshed(middle, cells, size, report, (off.middling, off.worst), off_original(original, middle, wall))


def _remeshed(
    name: str, wrap: Wrap, fine: tuple[Array, Integers], notes: tuple[str, ...], wall: float, size: float
) -> tuple[Array, Integers, tuple[str, ...], bool]:
    """Even triangles on a mid-surface, by the first of the attempts that is good; whether edges were kept."""
    from meshes.surfaces.distance_grid import thinned
    from meshes.surfaces.wrap import middle_surface

    done = ATTEMPTS[0][0]
    start = thinned(*fine, int(START * _elements(*fine, size)))
    for margin, edges in ATTEMPTS:
        if margin != done:
            fine, notes = middle_surface(name, wrap, wall, size, margin * size)
            start, done = thinned(*fine, int(START * _elements(*fine, size))), margin
        middle, cells = remesh(*fine, size, edges, start)
        if least_angle(middle, cells) > WRAPPED_ANGLE_DEG and not len(crossings(middle, cells)):
            return middle, cells, notes, edges
    _refuse_crossings(name, middle, cells, "crosses itself even wrapped", "choose a smaller target size")
    if not least_angle(middle, cells) > USELESS_ANGLE_DEG:
        raise SurfaceFault(
            f"surface {name}: wrapped, it leaves triangles without area",
            code="L005",
            remedy="choose another target size",
        )
    return middle, cells, notes, edges


def _elements(nodes: Array, faces: Integers, size: float) -> float:
    """How many equilateral triangles of that size have the surface's area."""
    return float(_triangles.area(nodes[faces]).sum() / (np.sqrt(0.1875) * size**2))


def _check_room(name: str, nodes: Array, faces: Integers, size: float, wall: float, offset: float = 0.0) -> None:
    """Refuse target sizes out of all proportion, and skins that enclose the wall instead of the casing.

    ``offset`` m: how far the skin lies outside the casing's own.
    """
    mesh = trimesh.Trimesh(nodes, faces, process=False)
    elements = _elements(nodes, faces, size)
    if not 50.0 <= elements <= MOST_ELEMENTS:
        raise InputError(
            f"target size for {name} (m)",
            code="L005",
            value=size,
            allowed=f"50 to {MOST_ELEMENTS} elements, not {elements:.3g}",
        )
    room = 2.0 * (mesh.volume / mesh.area - offset)
    # A plain tube has a quarter of its width more than this; two sides of a wall have exactly the wall.
    if room < 2.0 * wall:
        raise SurfaceFault(
            f"surface {name} encloses {room:.3g} m on average between its sides (2 volume / area)",
            code="L004",
            value=f"wall {wall:.3g} m",
            allowed="a wall below half of it",
            remedy="if the file holds both sides of the casing's wall, export the outer skin alone, closed, or let "
            "the import close wider openings",
        )


def _refuse_crossings(name: str, nodes: Array, faces: Integers, what: str, remedy: str) -> None:
    pairs = crossings(nodes, faces)
    if len(pairs):
        place = np.round(nodes[faces[pairs[0, 0]]].mean(axis=0), 4).tolist()
        raise SurfaceFault(
            f"surface {name} {what}: {np.unique(pairs).size} triangles, the first near {place} m",
            code="L003",
            remedy=remedy,
        )


def least_angle(nodes: Array, faces: Integers) -> float:
    """Smallest angle of all triangles, deg."""
    return float(np.rad2deg(_triangles.angles(nodes[faces]).min()))


def offset_inward(name: str, nodes: Array, faces: Integers, depth: float) -> tuple[Array, int]:
    """Move nodes (n, 3) so that the planes of the faces around each move inward by ``depth`` m, outward if negative.

    Least squares over the faces, weighted by angle, so that sharp edges and corners keep the wall on all their
    sides. Nodes of elements that would fold move less; their number comes with the new nodes.

    Raises
    ------
    SurfaceFault
        Elements fold even so.
    """
    normal = unit(normals(nodes, faces))
    weight = _triangles.angles(nodes[faces])[:, :, None]
    matrix, side = np.zeros((len(nodes), 3, 3)), np.zeros((len(nodes), 3))
    np.add.at(matrix, faces, weight[..., None] * (normal[:, :, None] * normal[:, None, :])[:, None])
    np.add.at(side, faces, -depth * weight * normal[:, None])
    values, axes = np.linalg.eigh(matrix)
    inverse = np.where(values > LEAST_SHARE * values[:, -1:], 1.0 / np.maximum(values, 1e-300), 0.0)
    move = np.einsum("nij,nj,nkj,nk->ni", axes, inverse, axes, side)
    move *= np.minimum(1.0, FARTHEST * abs(depth) / np.maximum(np.linalg.norm(move, axis=1), 1e-300))[:, None]
    less = np.zeros(len(nodes), dtype=bool)
    for _ in range(5):
        folded = _folded(nodes, nodes + move, faces)
        if not folded.any():
            return nodes + move, int(less.sum())
        worst = np.unique(faces[folded])
        less[worst] = True
        move[worst] *= 0.5
    raise SurfaceFault(
        f"surface {name}: {int(folded.sum())} elements fold on the way to the mid-surface",
        code="L004",
        value=f"inward by {depth:.4g} m",
        remedy="smooth sharp details, or choose a larger target size or a thinner wall",
    )


def _folded(before: Array, after: Array, faces: Integers) -> Bools:
    """Faces (m,) that turned by more than 60 deg or with an edge that all but vanished or turned round."""
    tilted = np.einsum("ij,ij->i", unit(normals(after, faces)), unit(normals(before, faces))) < 0.5
    old, new = (np.roll(nodes[faces], -1, axis=1) - nodes[faces] for nodes in (before, after))
    return np.asarray(tilted | ((old * new).sum(axis=2) < 0.1 * (old**2).sum(axis=2)).any(axis=1))
