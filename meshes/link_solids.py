"""The solid of a described link: the prepared mesh of tetrahedra that the description names."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

from meshes.beams import BeamMesh
from meshes.prepared import REMEDY, check_fits, read_mesh, write_mesh
from meshes.solid_mesh import SolidMesh
from robots import InputError
from robots.files.reading import read_bytes
from robots.schema.description import Link

SCHEMA = "stiffarm-solid/1"


def save_solid(mesh: SolidMesh, path: Path | str) -> str:
    """Write a solid mesh; see :func:`meshes.prepared.write_mesh`."""
    arrays = {key: value for key, value in asdict(mesh).items() if key != "interfaces"}
    return write_mesh(SCHEMA, arrays, mesh.interfaces, path)


def load_solid(path: Path | str, sha256: str | None = None, name: str | None = None) -> SolidMesh:
    """Read a solid mesh that :func:`save_solid` wrote; arguments and errors as :func:`meshes.load_shell`."""
    content = read_bytes(path, "solid file", remedy=REMEDY)
    fields, rings = read_mesh(content, f"solid file {path}", SCHEMA, {"tetrahedra": "iu"}, sha256)
    try:
        return SolidMesh(**fields if name is None else fields | {"name": name}, interfaces=rings)
    except InputError as error:
        raise InputError(f"solid file {path} holds no valid mesh ({error})", code="F007", remedy=REMEDY) from error


def link_solid_mesh(link: Link, beam: BeamMesh) -> SolidMesh | None:
    """Solid mesh of a link, in its body's frame, None where it has none; ``beam`` is its beam mesh.

    Name and material are those of the beam mesh, so of the description.

    Raises
    ------
    InputError
        A file that :func:`load_solid` refuses, with interfaces other than the beam's, or seats away from the beam's
        interface points.
    """
    if link.solid is None:
        return None
    mesh = load_solid(link.solid.file, link.solid.sha256, beam.name)
    points = dict(zip(beam.interfaces, beam.interface_points, strict=True))
    check_fits(f"solid of link {link.name}, {link.solid.file}", mesh.nodes, mesh.interfaces, points, beam.axes)
    return replace(
        mesh,
        youngs_modulus=beam.youngs_modulus,
        poissons_ratio=beam.poissons_ratio,
        interfaces={name: mesh.interfaces[name] for name in beam.interfaces},
    )
