"""The shell of a described link: its parametric casing, or the prepared surface that takes its place."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

from meshes.beams import BeamMesh
from meshes.casings import casing_mesh
from meshes.prepared import REMEDY, check_fits, read_mesh, write_mesh
from meshes.shell_mesh import ShellMesh
from robots import InputError
from robots.files.reading import read_bytes
from robots.schema.description import Link, Surface

SCHEMA = "stiffarm-shell/1"
_KINDS = {"triangles": "iu", "quads": "iu", "thickness": "f"}
# Walls in the file and in the description are the same figure, but for the conversion of its unit.
SAME_WALL = 1e-6


def save_shell(mesh: ShellMesh, path: Path | str) -> str:
    """Write a shell mesh; see :func:`meshes.prepared.write_mesh`."""
    arrays = {key: value for key, value in asdict(mesh).items() if key != "interfaces"}
    return write_mesh(SCHEMA, arrays, mesh.interfaces, path)


def load_shell(path: Path | str, sha256: str | None = None, name: str | None = None) -> ShellMesh:
    """Read a shell mesh that :func:`save_shell` wrote.

    Parameters
    ----------
    sha256 : digest that the file's bytes must have, if given
    name : takes the place of the mesh's name in the file

    Raises
    ------
    InputError
        A file that is missing or cannot be read, what :func:`meshes.prepared.read_mesh` refuses, or a file that holds
        no valid mesh.
    """
    content = read_bytes(path, "shell file", remedy=REMEDY)
    fields, rings = read_mesh(content, f"shell file {path}", SCHEMA, _KINDS, sha256)
    try:
        return ShellMesh(**fields if name is None else fields | {"name": name}, interfaces=rings)
    except InputError as error:
        raise InputError(f"shell file {path} holds no valid mesh ({error})", code="F007", remedy=REMEDY) from error


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
    points = dict(zip(beam.interfaces, beam.interface_points, strict=True))
    check_fits(f"surface of link {link.name}, {link.surface.file}", mesh.nodes, mesh.interfaces, points, beam.axes)
    _check_wall(link.name, link.surface, mesh)
    return replace(
        mesh,
        youngs_modulus=beam.youngs_modulus,
        poissons_ratio=beam.poissons_ratio,
        interfaces={name: mesh.interfaces[name] for name in beam.interfaces},
    )


def _check_wall(link: str, surface: Surface, mesh: ShellMesh) -> None:
    least, most, wall = mesh.thickness.min(), mesh.thickness.max(), surface.wall.si
    if not least * (1.0 - SAME_WALL) <= wall <= most * (1.0 + SAME_WALL):
        raise InputError(
            f"wall of link {link}'s surface (mm)",
            code="L004",
            value=1e3 * wall,
            allowed=f"{1e3 * least:.6g} to {1e3 * most:.6g}, as in {surface.file}: the mid-surface depends on it",
            remedy="import the link's surface again with the new wall",
        )
