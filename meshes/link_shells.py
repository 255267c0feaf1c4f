"""The shell of a described link: its parametric casing, or the prepared surface that takes its place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from meshes.beams import BeamMesh
from meshes.casings import casing_mesh
from meshes.shell_files import load_shell
from meshes.shell_mesh import ShellMesh
from robots import InputError
from robots.schema.description import Link, Surface

# A ring's middle lies no further from its interface point than this many radii of the ring, or this share of the
# longest way between interfaces: joints stand off their casings, as wrist centres do beyond forearms (0.7 of the
# way in a Panda).
FARTHEST, STAND_OFF = 3.0, 0.75
# Walls in the file and in the description are the same figure, but for the conversion of its unit.
SAME_WALL = 1e-6
_REMEDY = "import the link's surface again for this model"


def link_shell_mesh(link: Link, beam: BeamMesh) -> ShellMesh:
    """Shell mesh of a link, in its body's frame; ``beam`` is its beam mesh.

    A prepared surface takes name and material from the beam mesh, so from the description; openings and rims that
    the description has for the casing play no part then.

    Raises
    ------
    InputError
        A casing that cannot be meshed; a surface file that :func:`meshes.load_shell` refuses, with interfaces
        other than the beam's, rings away from the beam's interface points, or another wall than the description
        says.
    """
    if link.surface is None:
        return casing_mesh(beam, openings=link.opening, rim=link.rim)
    mesh = load_shell(link.surface.file, link.surface.sha256, beam.name)
    _check_interfaces(link.name, link.surface, mesh, beam)
    _check_wall(link.name, link.surface, mesh)
    return replace(
        mesh,
        youngs_modulus=beam.youngs_modulus,
        poissons_ratio=beam.poissons_ratio,
        interfaces={name: mesh.interfaces[name] for name in beam.interfaces},
    )


def _check_interfaces(link: str, surface: Surface, mesh: ShellMesh, beam: BeamMesh) -> None:
    where = f"surface of link {link}, {surface.file}"
    if set(mesh.interfaces) != set(beam.interfaces):
        raise InputError(
            f"{where}: interfaces",
            value=", ".join(mesh.interfaces) or "none",
            allowed=f"exactly {', '.join(beam.interfaces)}",
            remedy=_REMEDY,
        )
    points = beam.interface_points
    way = float(np.linalg.norm(points[:, None] - points[None], axis=2).max())
    for name, point in zip(beam.interfaces, points, strict=True):
        ring = mesh.nodes[mesh.interfaces[name]]
        middle = ring.mean(axis=0)
        radius, distance = np.linalg.norm(ring - middle, axis=1).max(), np.linalg.norm(middle - point)
        limit = max(FARTHEST * radius, STAND_OFF * way)
        if distance > limit:
            raise InputError(
                f"{where}: the middle of ring {name} is {1e3 * distance:.4g} mm from the link's interface at "
                f"{np.round(point, 4).tolist()} m",
                allowed=f"at most {1e3 * limit:.4g} mm: {FARTHEST:g} radii of the ring or {STAND_OFF:g} of the link",
                remedy=f"{_REMEDY}: its geometry has changed since, or the file belongs to another link",
            )


def _check_wall(link: str, surface: Surface, mesh: ShellMesh) -> None:
    least, most, wall = mesh.thickness.min(), mesh.thickness.max(), surface.wall.si
    if not least * (1.0 - SAME_WALL) <= wall <= most * (1.0 + SAME_WALL):
        raise InputError(
            f"wall of link {link}'s surface (mm)",
            value=1e3 * wall,
            allowed=f"{1e3 * least:.6g} to {1e3 * most:.6g}, as in {surface.file}: the mid-surface depends on it",
            remedy="import the link's surface again with the new wall",
        )
