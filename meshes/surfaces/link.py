"""A link's shell mesh from surface files: repaired or wrapped, remeshed, on the mid-surface, interfaces found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from meshes.shell_mesh import ShellMesh
from meshes.surfaces.checks import SurfaceFault, census
from meshes.surfaces.reading import check_scale, read_surface
from meshes.surfaces.rings import Interface, Ring, choose_rings
from meshes.surfaces.routes import ImportSettings, Meshed, Repair, as_it_is, least_angle, offset_inward, wrapped
from meshes.surfaces.walls import boss_elements
from robots import InputError, require_one_of, require_positive
from robots.arrays import Array, Integers, finite

REPAIRS: tuple[Repair, ...] = ("auto", "none", "wrap")

# Has no type hints.
_triangles: Any = trimesh.triangles

POOR_ANGLE_DEG = 10.0
# Walls (m) nearer to each other than this have one mid-surface.
SAME_WALL = 2e-4
GOOD = "good"


@dataclass(frozen=True)
class ImportFigures:
    """What an import found and left.

    ``bodies``, ``open_edges``: of the files, after corners at one place are merged. ``wrapped``: whether the
    surface was wrapped. ``area_m2``: of the mid-surface. ``rings``: by interface. ``departure_m``: see
    :class:`meshes.surfaces.routes.Meshed`.
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


def import_surface(
    path: Path | str, interfaces: Mapping[str, Interface], settings: ImportSettings, scale: float | None = None
) -> ImportedLink:
    """Triangle shell on the mid-surface of a casing whose outer skin is in a STL, OBJ, DAE or PLY file.

    Parameters
    ----------
    path : the file, in the link's own frame
    interfaces : the root first
    scale : metres for one unit of the file (0.001 for mm); None takes the file's own unit, else metres

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
    nodes, faces, notes = read_surface(path, scale)
    return prepare_link(path.stem, nodes, faces, interfaces, settings, tuple(notes))


def prepare_link(
    name: str,
    nodes: Array,
    faces: Integers,
    interfaces: Mapping[str, Interface],
    settings: ImportSettings,
    notes: tuple[str, ...] = (),
) -> ImportedLink:
    """Triangle shell from a surface, nodes (n, 3) m and faces (m, 3), in the link's frame.

    ``interfaces``: the root first. ``notes``: of the reading, for the report. Errors as :func:`import_surface`.
    """
    _check_numbers(interfaces, settings)
    points = np.stack([interface.point for interface in interfaces.values()])
    surface = mid_surface(name, nodes, faces, points, settings, notes)
    return shell_on(surface, interfaces, surface.rings(interfaces), settings)


@dataclass(frozen=True)
class MidSurface:
    """A link's mid-surface under a wall of ``wall`` m, before anything is known of where it is held.

    ``bodies``, ``open_edges``, ``wrapped``: as in :class:`ImportFigures`. ``report``: lines so far.
    """

    name: str
    mesh: Meshed
    wall: float
    bodies: int
    open_edges: int
    wrapped: bool
    report: tuple[str, ...]

    def rings(self, interfaces: Mapping[str, Interface]) -> Rings:
        """Where it is held (:func:`meshes.surfaces.rings.choose_rings`)."""
        found, notes = choose_rings(interfaces, self.mesh.nodes, self.mesh.faces, self.mesh.size, self.name)
        return Rings(found, tuple(notes))

    def under(self, wall: float) -> MidSurface:
        """The mid-surface of a wall of another thickness (m); where elements would fold it stays, and says so."""
        deeper = 0.5 * (wall - self.wall)
        try:
            nodes, _ = offset_inward(self.name, self.mesh.nodes, self.mesh.faces, deeper)
        except SurfaceFault:
            return replace(self, report=(*self.report, f"mid-surface left {500 * self.wall:.3g} mm under the surface"))
        said = f"moved {1e3 * abs(deeper):.3g} mm {'inward' if deeper > 0 else 'outward'}, under a wall of "
        return replace(
            self, mesh=replace(self.mesh, nodes=nodes), wall=wall, report=(*self.report, f"{said}{1e3 * wall:.3g} mm")
        )


@dataclass(frozen=True)
class Rings:
    """Rings by interface, and notes on what was cut."""

    by_name: dict[str, Ring]
    notes: tuple[str, ...] = ()


def mid_surface(
    name: str, nodes: Array, faces: Integers, points: Array, settings: ImportSettings, notes: tuple[str, ...] = ()
) -> MidSurface:
    """Repair or wrap a surface, mesh it evenly and move it half a wall inward.

    ``points`` (i, 3) m: of the interfaces, that the surface's size is compared with. Errors as :func:`import_surface`.
    """
    report = [*notes, check_scale(name, nodes, points, settings.expected_span, settings.span_ratio)]
    bodies, open_edges = census(nodes, faces)
    report.append(f"as read: {bodies} {'body' if bodies == 1 else 'bodies'}, {open_edges} open edges")
    wrap = settings.repair == "wrap"
    if not wrap:
        try:
            done = as_it_is(name, nodes, faces, settings)
        except SurfaceFault as fault:
            if settings.repair == "none":
                raise
            report.append(f"not taken as it is: {fault.what}")
            wrap = True
    if wrap:
        done = wrapped(name, nodes, faces, settings)
    return MidSurface(name, done, settings.wall, bodies, open_edges, wrap, (*report, *done.report))


def shell_on(
    surface: MidSurface, interfaces: Mapping[str, Interface], rings: Rings, settings: ImportSettings
) -> ImportedLink:
    """The shell of a link with ``settings.wall``, thicker in its bosses, held at its rings."""
    if abs(settings.wall - surface.wall) > SAME_WALL:
        surface = surface.under(settings.wall)
    done, held = surface.mesh, rings.by_name
    report = [*surface.report, *rings.notes]
    report += [f"interface {key}: {ring.words}, {ring.nodes.size} nodes" for key, ring in held.items()]
    boss = boss_elements(done.nodes, done.faces, interfaces, held)
    if boss.any() and settings.boss != 1.0:
        thick = 1e3 * settings.boss * settings.wall
        report.append(f"bosses: walls of {thick:.3g} mm on {100 * boss.mean():.0f} % of the elements")
    mesh = ShellMesh(
        name=surface.name,
        nodes=done.nodes,
        triangles=done.faces,
        quads=np.zeros((0, 4), dtype=np.int64),
        thickness=np.where(boss, settings.boss * settings.wall, settings.wall),
        youngs_modulus=settings.youngs_modulus,
        poissons_ratio=settings.poissons_ratio,
        interfaces={key: ring.nodes for key, ring in held.items()},
    )
    angle = least_angle(done.nodes, done.faces)
    report.append(_quality(done.nodes, done.faces, angle))
    area = float(_triangles.area(mesh.triangle_corners).sum())
    figures = ImportFigures(
        surface.bodies,
        surface.open_edges,
        surface.wrapped,
        done.size,
        len(done.faces),
        angle,
        area,
        held,
        done.departure,
    )
    return ImportedLink(mesh, tuple(report), figures)


def _check_numbers(interfaces: Mapping[str, Interface], settings: ImportSettings) -> None:
    sizes = {"wall thickness (m)": settings.wall, "target size (m)": settings.target_size}
    sizes |= {"opening (m)": settings.opening}
    for what, value in sizes.items():
        require_positive(what, value, code="L011")
    require_one_of("repair", settings.repair, REPAIRS, code="L011")
    check_interfaces(interfaces)


def check_interfaces(interfaces: Mapping[str, Interface]) -> None:
    """Refuse interfaces that are none: no points, numbers that are not finite, no way to find a ring."""
    for name, one in interfaces.items():
        require_positive(f"interface radius {name} (m)", one.radius, code="L006")
    if not interfaces:
        raise InputError("no interface points", code="L006", remedy="name one point or more, the root first")
    for name, one in interfaces.items():
        finite(f"interface point {name}", one.point, (3,), "m")
        if one.axis is not None and not (one.axis.shape == (3,) and 0.0 < np.linalg.norm(one.axis) < np.inf):
            raise InputError(
                f"interface axis {name}", code="L006", value=one.axis.tolist(), allowed="three numbers, not all zero"
            )
    alone = [one for one in interfaces.values() if one.radius is None and one.axis is None]
    if len(interfaces) == 1 and alone:
        raise InputError(
            "one interface has no direction to cut along", code="L006", remedy="give its radius (--radius LINK.END=MM)"
        )


def quality_words(least_angle_deg: float) -> str:
    """The verdict on an imported mesh, which is closed, of one body and without folds: only its angle may be poor."""
    if least_angle_deg >= POOR_ANGLE_DEG:
        return GOOD
    return (
        f"POOR for one reason only, a minimum angle of {least_angle_deg:.1f} deg below {POOR_ANGLE_DEG:g}: stresses "
        f"near it are not to be trusted, displacements are"
    )


def _quality(nodes: Array, faces: Integers, least: float) -> str:
    mesh = trimesh.Trimesh(nodes, faces, process=False)
    edge = 1e3 * mesh.edges_unique_length
    return (
        f"quality {quality_words(least)}: {len(faces)} triangles, minimum angle {least:.1f} deg, "
        f"edges {edge.min():.4g} to {edge.max():.4g} mm, watertight {'yes' if mesh.is_watertight else 'NO'}, "
        f"bodies {mesh.body_count}, folds 0, area {mesh.area:.6g} m2"
    )
