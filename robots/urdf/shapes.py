"""Visual and collision shapes of a URDF's bodies, with their mesh files found on disk."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal
from urllib.parse import unquote

import numpy as np

from robots.arrays import Array
from robots.urdf.chain import Tree

Kind = Literal["visuals", "collisions"]


@dataclass(frozen=True)
class Primitive:
    """A solid about its own origin. ``size`` (m): box x, y, z; cylinder (along z) radius, length; sphere radius."""

    kind: Literal["box", "cylinder", "sphere"]
    size: tuple[float, ...]


@dataclass(frozen=True)
class Visual:
    """One shape of a body: a mesh file (absolute path) or a primitive, as it stands in the body's frame.

    A point x of the file is at ``T_body_visual @ (scale * x)``: ``scale`` (3,), negative where the URDF
    mirrors; ``T_body_visual`` (4, 4). ``link``: the URDF link it belongs to, which may be fixed to the body.
    """

    source: Path | Primitive
    scale: Array
    T_body_visual: Array
    link: str = ""


def visuals_of(
    tree: Tree, groups: dict[str, dict[str, Array]], urdf: Path, kind: Kind
) -> tuple[dict[str, tuple[Visual, ...]], tuple[tuple[str, str], ...]]:
    """Shapes by body, and for each mesh file that is not there its link and a note.

    ``groups``: body -> link -> T_body_link. Bodies without shapes are left out.
    """
    out: dict[str, tuple[Visual, ...]] = {}
    missing = []
    for body, group in groups.items():
        found = []
        for link, T_body_link in group.items():
            for shape in getattr(tree.links[link], kind):
                source, scale = _source(shape.geometry, urdf)
                if source is None:
                    name = shape.geometry.mesh.filename
                    missing.append((link, f"link {link}: mesh not found: {name}, a {kind[:-1]}{_hint(name)}"))
                    continue
                T = T_body_link if shape.origin is None else T_body_link @ shape.origin
                found.append(Visual(source, scale, np.asarray(T, dtype=np.float64), link))
        if found:
            out[body] = tuple(found)
    return out, tuple(missing)


def _source(geometry: Any, urdf: Path) -> tuple[Path | Primitive | None, Array]:
    one = np.ones(3)
    if geometry.mesh is not None:
        scale = one if geometry.mesh.scale is None else one * geometry.mesh.scale
        return find_mesh(geometry.mesh.filename, urdf), scale
    if geometry.box is not None:
        return Primitive("box", tuple(float(v) for v in geometry.box.size)), one
    if geometry.cylinder is not None:
        return Primitive("cylinder", (float(geometry.cylinder.radius), float(geometry.cylinder.length))), one
    return Primitive("sphere", (float(geometry.sphere.radius),)), one


def find_mesh(name: str, urdf: Path) -> Path | None:
    """The file behind a mesh's name: a path beside the URDF, ``file://``, or ``package://``; None if not there.

    A package is a folder of that name that the URDF lies in, or beside one of these, or one that
    ROS_PACKAGE_PATH or AMENT_PREFIX_PATH leads to.
    """
    scheme, mark, rest = name.partition("://")
    if not mark:
        candidates = iter([urdf.resolve().parent / name])
    elif scheme == "file":
        candidates = iter([Path(unquote(rest)), urdf.resolve().parent / unquote(rest).lstrip("/")])
    elif scheme in ("package", "model"):
        package, _, inside = rest.partition("/")
        candidates = (folder / inside for folder in _package_folders(package, urdf.resolve()))
    else:
        return None
    return next((path.resolve() for path in candidates if _is_file(path)), None)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a name longer than the file system takes
        return False


def _package_folders(package: str, urdf: Path) -> Iterator[Path]:
    ros, ament = (
        [Path(entry) for entry in os.environ.get(name, "").split(os.pathsep) if entry]
        for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
    )
    for folder in (*urdf.parents, *ros):
        if folder.name == package:
            yield folder
        yield folder / package
    yield from (folder / "share" / package for folder in ament)


def _hint(name: str) -> str:
    if not name.startswith("package://"):
        return ""
    package = name.removeprefix("package://").partition("/")[0]
    return f" (no folder {package} with that file above the URDF or on ROS_PACKAGE_PATH)"
