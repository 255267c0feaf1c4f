"""A link's shell mesh from surface files: repaired or wrapped, remeshed, on the mid-surface, interfaces found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from meshes.shell_mesh import ShellMesh
from meshes.surface_checks import SurfaceFault, census, crossings, repair_surface
from meshes.surface_offset import offset_inward
from meshes.surface_reading import SPAN_RATIO, check_scale, read_surface
from meshes.surface_remesh import remesh
from meshes.surface_rings import Interface, Ring, choose_rings
from robots import InputError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Repair = Literal["auto", "none", "wrap"]
REPAIRS: tuple[Repair, ...] = ("auto", "none", "wrap")

# Has no type hints.
_triangles: Any = trimesh.triangles

# Elements beyond this come from a target size in the wrong unit.
MOST_ELEMENTS = 400_000
# What a link gets where no size is given: its condensation takes seconds.
USUAL_ELEMENTS = 10_000
POOR_ANGLE_DEG = 10.0


@dataclass(frozen=True)
class ImportFigures:
    """What an import found and left.

    ``bodies``, ``open_edges``: of the files, after corners at one place are merged. ``wrapped``: whether the
    surface was wrapped. ``area_m2``: of the mid-surface. ``rings``: by interface. ``departure_m``: 95 % of the
    surfaces are nearer than this to where they should be, and the farthest is; NaN where not wrapped.
    """

    bodies: int
    open_edges: int
    wrapped: bool
    size_m: float
    triangles: int
    minimum_angle_deg: float
    area_m2: float
    rings: dict[str, Ring]
    departure_m: tuple[float, float]


@dataclass(frozen=True)
class ImportedLink:
    """Shell mesh of a link and what was done to get it, one line a change or figure."""

    mesh: ShellMesh
    report: tuple[str, ...]
    figures: ImportFigures


@dataclass(frozen=True)
class ImportSettings:
    """How a surface becomes a shell.

    ``wall`` m: thickness everywhere. ``youngs_modulus`` Pa, ``poissons_ratio``. ``target_size`` m: edge length
    aimed at; None gives some ten thousand elements, never smaller than the wall. ``repair``: "none" takes the
    surface as it is, with small repairs, or refuses it; "wrap" wraps it; "auto" wraps what "none" refuses.
    ``opening`` m and ``wrap``: see :func:`meshes.surface_wrap.wrap_surface`. ``expected_span`` m, that the
    surface should span; None takes the interfaces' largest distance. ``span_ratio``: the surface's diagonal
    over that span, least and most.
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


def import_surface(
    path: Path | str,
    *,
    scale: float | None = None,
    target_size: float | None = None,
    wall: float,
    youngs_modulus: float,
    poissons_ratio: float,
    interface_points: Mapping[str, ArrayLike],
    interface_radius: Mapping[str, float] | None = None,
    interface_axes: Mapping[str, ArrayLike] | None = None,
    expected_span: float | None = None,
    repair: Repair = "auto",
    opening: float | None = None,
) -> ImportedLink:
    """Triangle shell on the mid-surface of a casing whose outer skin is in a STL, OBJ, DAE or PLY file.

    Parameters
    ----------
    path : the file, in the link's own frame
    scale : metres for one unit of the file (0.001 for mm); None takes the file's own unit, else metres
    interface_points : point (3,) m of each interface, the root first
    interface_radius : by name, m
    interface_axes : joint axis (3,) at an interface, by name; see :func:`meshes.surface_rings.choose_rings`
    target_size, wall, youngs_modulus, poissons_ratio, expected_span, repair, opening : see :class:`ImportSettings`

    Limits: one wall thickness; what is seen of the skin from outside counts, and of holes smaller than two target
    sizes across nothing is seen; details smaller than the target size are lost.

    Raises
    ------
    InputError
        Bad numbers, unreadable file, wrong scale, a surface that cannot be taken (with ``repair="none"``: an
        open, self-crossing or degenerate one, or several bodies), a wall that the casing has no room for, no ring
        at an interface, rings that share nodes.
    """
    path = Path(path)
    settings = ImportSettings(
        wall, youngs_modulus, poissons_ratio, target_size, repair, opening, expected_span=expected_span
    )
    interfaces = _interfaces(interface_points, interface_radius or {}, interface_axes or {})
    nodes, faces, notes = read_surface(path, scale)
    return prepare_link(path.stem, nodes, faces, interfaces, settings, tuple(notes))


def _interfaces(
    points: Mapping[str, ArrayLike], radius: Mapping[str, float], axes: Mapping[str, ArrayLike]
) -> dict[str, Interface]:
    for what, given in (("interface radius", radius), ("interface axis", axes)):
        unknown = sorted(set(given) - set(points))
        if unknown:
            raise InputError(f"{what} {unknown[0]}", allowed=f"for {', '.join(points)}")
    as_array = {name: np.asarray(point, dtype=np.float64) for name, point in points.items()}
    return {
        name: Interface(
            point,
            None if name not in axes else np.asarray(axes[name], dtype=np.float64),
            radius=radius.get(name),
        )
        for name, point in as_array.items()
    }


def prepare_link(
    name: str,
    nodes: Array,
    faces: Indices,
    interfaces: Mapping[str, Interface],
    settings: ImportSettings,
    notes: tuple[str, ...] = (),
) -> ImportedLink:
    """Triangle shell from a surface, nodes (n, 3) m and faces (m, 3), in the link's frame.

    ``interfaces``: the root first. ``notes``: of the reading, for the report. Errors as :func:`import_surface`.
    """
    _check_numbers(interfaces, settings)
    points = np.stack([interface.point for interface in interfaces.values()])
    report = [*notes, check_scale(name, nodes, points, settings.expected_span, settings.span_ratio)]
    bodies, open_edges = census(nodes, faces)
    report.append(f"as read: {bodies} {'body' if bodies == 1 else 'bodies'}, {open_edges} open edges")
    wrapped = settings.repair == "wrap"
    if not wrapped:
        try:
            middle, rings, more = _as_it_is(name, nodes, faces, interfaces, settings)
        except SurfaceFault as fault:
            if settings.repair == "none":
                raise
            report.append(f"not taken as it is: {fault.what}")
            wrapped = True
    if wrapped:
        middle, rings, more = _wrapped(name, nodes, faces, interfaces, settings)
    report += more.report
    report += [f"interface {key}: {ring.words}, {ring.nodes.size} nodes" for key, ring in rings.items()]
    mesh = ShellMesh(
        name=name,
        nodes=middle[0],
        triangles=middle[1],
        quads=np.zeros((0, 4), dtype=np.int64),
        thickness=np.full(len(middle[1]), float(settings.wall)),
        youngs_modulus=settings.youngs_modulus,
        poissons_ratio=settings.poissons_ratio,
        interfaces={key: ring.nodes for key, ring in rings.items()},
    )
    angle = float(np.rad2deg(_triangles.angles(middle[0][middle[1]]).min()))
    report.append(_quality(*middle, angle))
    area = float(_triangles.area(middle[0][middle[1]]).sum())
    figures = ImportFigures(bodies, open_edges, wrapped, more.size, len(middle[1]), angle, area, rings, more.departure)
    return ImportedLink(mesh, tuple(report), figures)


@dataclass(frozen=True)
class _Done:
    """How a surface was meshed: lines of the report, element size, departure from the original (m)."""

    report: list[str]
    size: float
    departure: tuple[float, float] = (float("nan"), float("nan"))


def usual_size(area: float, wall: float) -> float:
    """Element size (m) that gives ``USUAL_ELEMENTS`` equilateral triangles on ``area`` m^2, at least the wall."""
    return max(wall, float(np.sqrt(area / (np.sqrt(0.1875) * USUAL_ELEMENTS))))


def _as_it_is(
    name: str, nodes: Array, faces: Indices, interfaces: Mapping[str, Interface], settings: ImportSettings
) -> tuple[tuple[Array, Indices], dict[str, Ring], _Done]:
    """Mesh a closed skin with its own edges; SurfaceFault where it has no clean one."""
    size = settings.target_size or usual_size(float(_triangles.area(nodes[faces]).sum()), settings.wall)
    nodes, faces, report = repair_surface(name, nodes, faces, 2.0 * np.pi * size)
    _check_room(name, nodes, faces, size, settings.wall)
    skin, cells = remesh(nodes, faces, size)
    _refuse_crossings(name, skin, cells, "crosses itself", "separate the parts in the program it came from")
    report.append(f"remeshed from {len(faces)} to {len(cells)} triangles of {1e3 * size:.4g} mm")
    rings, shrunk = choose_rings(interfaces, skin, cells, size)
    middle, fewer = offset_inward(name, skin, cells, 0.5 * settings.wall)
    _refuse_crossings(name, middle, cells, "has places thinner than the wall", "give the wall's true thickness")
    report.append(f"nodes moved inward by half the wall, {500 * settings.wall:.4g} mm, to the mid-surface")
    if fewer:
        report.append(f"{fewer} nodes moved less, where elements would have folded")
    return (middle, cells), rings, _Done([*report, *shrunk], size)


def _wrapped(
    name: str, nodes: Array, faces: Indices, interfaces: Mapping[str, Interface], settings: ImportSettings
) -> tuple[tuple[Array, Indices], dict[str, Ring], _Done]:
    """Wrap any surface and mesh the wrap's mid-surface; edges are rounded by up to an element."""
    # Brings VTK with it, which only wrapping needs.
    from meshes.surface_wrap import departure, middle_surface, wrap_surface

    size = settings.target_size
    if size is None:
        # Files may hold much more than the skin, so its area is that of a coarse wrap.
        coarse = max(settings.wall, float(np.linalg.norm(np.ptp(nodes, axis=0))) / 40.0)
        trial = wrap_surface(name, nodes, faces, coarse, settings.opening)
        size = usual_size(float(_triangles.area(trial.nodes[trial.faces]).sum()), settings.wall)
    wrap = wrap_surface(name, nodes, faces, size, settings.opening, settings.wrap)
    _check_room(name, wrap.nodes, wrap.faces, size, settings.wall)
    fine, cells, notes = middle_surface(name, wrap, settings.wall, size)
    middle, cells = remesh(fine, cells, size, keep_edges=False)
    _refuse_crossings(name, middle, cells, "crosses itself even wrapped", "choose a smaller target size")
    rings, shrunk = choose_rings(interfaces, middle, cells, size)
    off = departure(wrap, nodes[faces], (middle, cells), settings.wall, size)
    report = [
        *wrap.notes,
        f"mid-surface {500 * settings.wall:.4g} mm inside the original, remeshed to {len(cells)} triangles of "
        f"{1e3 * size:.4g} mm, edges rounded",
        *notes,
        f"departure from the original: 95 % within {1e3 * off[0]:.3g} mm, at most {1e3 * off[1]:.3g} mm",
    ]
    return (middle, cells), rings, _Done([*report, *shrunk], size, off)


def _check_numbers(interfaces: Mapping[str, Interface], settings: ImportSettings) -> None:
    sizes = {"wall thickness (m)": settings.wall, "target size (m)": settings.target_size}
    sizes |= {"opening (m)": settings.opening}
    sizes |= {f"interface radius {name} (m)": one.radius for name, one in interfaces.items()}
    for what, value in sizes.items():
        if value is not None and not 0.0 < value < np.inf:
            raise InputError(what, value=value, allowed="greater than 0")
    if settings.repair not in REPAIRS:
        raise InputError("repair", value=settings.repair, allowed=", ".join(REPAIRS))
    if not interfaces:
        raise InputError("no interface points", remedy="name one point or more, the root first")
    for name, one in interfaces.items():
        if one.point.shape != (3,) or not np.isfinite(one.point).all():
            raise InputError(f"interface point {name} (m)", value=one.point.tolist(), allowed="three finite numbers")
        if one.axis is not None and not (one.axis.shape == (3,) and 0.0 < np.linalg.norm(one.axis) < np.inf):
            raise InputError(f"interface axis {name}", value=one.axis.tolist(), allowed="three numbers, not all zero")
    alone = [one for one in interfaces.values() if one.radius is None and one.axis is None]
    if len(interfaces) == 1 and alone:
        raise InputError("one interface has no direction to cut along", remedy="give its interface_radius")


def _check_room(name: str, nodes: Array, faces: Indices, size: float, wall: float) -> None:
    """Refuse target sizes out of all proportion, and skins that enclose the wall instead of the casing."""
    mesh = trimesh.Trimesh(nodes, faces, process=False)
    elements = mesh.area / (np.sqrt(0.1875) * size**2)
    if not 50.0 <= elements <= MOST_ELEMENTS:
        raise InputError(
            f"target size for {name} (m)", value=size, allowed=f"50 to {MOST_ELEMENTS} elements, not {elements:.3g}"
        )
    room = 2.0 * mesh.volume / mesh.area
    # A plain tube has a quarter of its width more than this; two sides of a wall have exactly the wall.
    if room < 2.0 * wall:
        raise InputError(
            f"surface {name} encloses {room:.3g} m on average between its sides (2 volume / area)",
            value=f"wall {wall:.3g} m",
            allowed="a wall below half of it",
            remedy="if the file holds both sides of the casing's wall, export the outer skin alone, closed, or wrap "
            "it with an opening wider than its holes",
        )


def _refuse_crossings(name: str, nodes: Array, faces: Indices, what: str, remedy: str) -> None:
    pairs = crossings(nodes, faces)
    if len(pairs):
        place = np.round(nodes[faces[pairs[0, 0]]].mean(axis=0), 4).tolist()
        raise SurfaceFault(
            f"surface {name} {what}: {np.unique(pairs).size} triangles, the first near {place} m", remedy=remedy
        )


def _quality(nodes: Array, faces: Indices, least: float) -> str:
    mesh = trimesh.Trimesh(nodes, faces, process=False)
    edge = mesh.edges_unique_length
    poor = " (POOR: stresses near it are not to be trusted)" if least < POOR_ANGLE_DEG else ""
    return (
        f"quality: {len(faces)} triangles, minimum angle {least:.1f} deg{poor}, edges {1e3 * edge.min():.4g} to "
        f"{1e3 * edge.max():.4g} mm, watertight {'yes' if mesh.is_watertight else 'NO'}, "
        f"bodies {mesh.body_count}, folds 0, area {mesh.area:.6g} m2"
    )
