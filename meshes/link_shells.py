"""The shell of a described link: its parametric casing, or the prepared surface that takes its place.

Prepared shell meshes are on disk in NumPy's .npz with a schema version, no pickles.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshes.array_cache import from_npz, to_npz
from meshes.beams import BeamMesh
from meshes.casings import casing_mesh
from meshes.shell_mesh import ShellMesh
from robots import InputError
from robots.files.reading import read_bytes
from robots.files.written import write_whole
from robots.schema.description import Link, Surface

SCHEMA = "stiffarm-shell/1"
# NumPy's kind of each array's numbers.
_KINDS = {
    "schema": "U",
    "name": "U",
    "nodes": "f",
    "triangles": "iu",
    "quads": "iu",
    "thickness": "f",
    "youngs_modulus": "f",
    "poissons_ratio": "f",
    "interfaces": "U",
}
_REMEDY = "import the link's surface again, or put the file back that the model was written with"


def save_shell(mesh: ShellMesh, path: Path | str) -> str:
    """Write a shell mesh, whole or not at all; returns the SHA-256 of the file's bytes.

    Equal meshes give equal bytes. Errors of the system (no space, no access) are raised as they are.
    """
    path = Path(path)
    arrays: dict[str, NDArray[Any]] = {
        "schema": np.array(SCHEMA),
        "name": np.array(mesh.name),
        "nodes": np.asarray(mesh.nodes, dtype=np.float64),
        "triangles": np.asarray(mesh.triangles, dtype=np.int64),
        "quads": np.asarray(mesh.quads, dtype=np.int64),
        "thickness": np.asarray(mesh.thickness, dtype=np.float64),
        "youngs_modulus": np.array(mesh.youngs_modulus, dtype=np.float64),
        "poissons_ratio": np.array(mesh.poissons_ratio, dtype=np.float64),
        "interfaces": np.array(list(mesh.interfaces), dtype=np.str_),
    }
    arrays |= {f"ring_{i}": np.asarray(ring, dtype=np.int64) for i, ring in enumerate(mesh.interfaces.values())}
    content = to_npz(arrays)
    write_whole(path, content)
    return hashlib.sha256(content).hexdigest()


def load_shell(path: Path | str, sha256: str | None = None, name: str | None = None) -> ShellMesh:
    """Read a shell mesh that :func:`save_shell` wrote.

    Parameters
    ----------
    sha256 : digest that the file's bytes must have, if given
    name : takes the place of the mesh's name in the file

    Raises
    ------
    InputError
        The file is missing, cannot be read, is not the one with that digest, is damaged, of another schema
        version, or holds no valid mesh.
    """
    where = f"shell file {path}"
    content = read_bytes(path, "shell file", remedy=_REMEDY)
    found = hashlib.sha256(content).hexdigest()
    if sha256 is not None and found != sha256.lower():
        raise InputError(
            f"{where} has changed since the model was written, or is damaged: SHA-256",
            value=found,
            allowed=sha256,
            remedy=_REMEDY,
        )
    try:
        arrays = from_npz(content)
    except ValueError as error:
        raise InputError(f"{where} is damaged ({error})", remedy=_REMEDY) from error
    _check_arrays(where, arrays)
    names = [str(interface) for interface in arrays["interfaces"]]
    try:
        return ShellMesh(
            name=str(arrays["name"]) if name is None else name,
            nodes=arrays["nodes"].astype(np.float64),
            triangles=arrays["triangles"].astype(np.int64),
            quads=arrays["quads"].astype(np.int64),
            thickness=arrays["thickness"].astype(np.float64),
            youngs_modulus=float(arrays["youngs_modulus"]),
            poissons_ratio=float(arrays["poissons_ratio"]),
            interfaces={interface: arrays[f"ring_{i}"].astype(np.int64) for i, interface in enumerate(names)},
        )
    except InputError as error:
        raise InputError(f"{where} holds no valid mesh ({error})", remedy=_REMEDY) from error


def _check_arrays(where: str, arrays: dict[str, NDArray[np.generic]]) -> None:
    """Refuse files of another kind or version."""
    schema = arrays.get("schema")
    if schema is None or schema.ndim or schema.dtype.kind != "U" or str(schema) != SCHEMA:
        raise InputError(
            f"{where}: schema",
            value="none" if schema is None else str(schema),
            allowed=SCHEMA,
            remedy="import the link's surface again with this version of stiffarm",
        )
    count = arrays["interfaces"].size if "interfaces" in arrays else 0
    kinds = _KINDS | {f"ring_{i}": "iu" for i in range(count)}
    single = {"schema", "name", "youngs_modulus", "poissons_ratio"}
    wrong = [
        key
        for key, kind in kinds.items()
        if key not in arrays or arrays[key].dtype.kind not in kind or (arrays[key].ndim == 0) != (key in single)
    ]
    if wrong or arrays["interfaces"].ndim != 1 or len(set(arrays["interfaces"].tolist())) != count:
        raise InputError(
            f"{where} is damaged: arrays missing, or of the wrong kind", value=", ".join(wrong or ["interfaces"]),
            remedy=_REMEDY,
        )  # fmt: skip


# A ring's middle lies no further from its interface point than this many radii of the ring, or this share of the
# longest way between interfaces: joints stand off their casings, as wrist centres do beyond forearms (0.7 of the
# way in a Panda).
FARTHEST, STAND_OFF = 3.0, 0.75
# Walls in the file and in the description are the same figure, but for the conversion of its unit.
SAME_WALL = 1e-6
_AGAIN = "import the link's surface again for this model"


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
            remedy=_AGAIN,
        )
    points = beam.interface_points
    way = float(np.linalg.norm(points[:, None] - points[None], axis=2).max())
    for name, point in zip(beam.interfaces, points, strict=True):
        ring = mesh.nodes[mesh.interfaces[name]]
        middle = ring.mean(axis=0)
        # A joint's frame may be anywhere on its axis.
        apart = middle - point
        apart = apart - beam.axes[name] * (beam.axes[name] @ apart) if name in beam.axes else apart
        radius, distance = np.linalg.norm(ring - middle, axis=1).max(), np.linalg.norm(apart)
        limit = max(FARTHEST * radius, STAND_OFF * way)
        if distance > limit:
            raise InputError(
                f"{where}: the middle of ring {name} is {1e3 * distance:.4g} mm from the link's interface at "
                f"{np.round(point, 4).tolist()} m",
                allowed=f"at most {1e3 * limit:.4g} mm: {FARTHEST:g} radii of the ring or {STAND_OFF:g} of the link",
                remedy=f"{_AGAIN}: its geometry has changed since, or the file belongs to another link",
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
