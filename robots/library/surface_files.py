"""Files of links' prepared meshes: found beside the model file, and copied along when a model is written."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

from robots.errors import InputError
from robots.files.reading import read_sha256
from robots.files.written import written_whole
from robots.schema.description import ModelDescription, PreparedMesh

FOLDER = "meshes"
_SUFFIX = ".npz"


def surface_file_name(link: str, sha256: str) -> str:
    """Name of a link's surface file in ``meshes/``; no name of a link leads out of that folder."""
    return f"{re.sub(r'[^A-Za-z0-9_.-]+', '_', link).strip('.')}-{sha256[:8]}{_SUFFIX}"


def with_absolute_surfaces(description: ModelDescription, folder: Path) -> ModelDescription:
    """The description with surface files as absolute paths, read as relative to ``folder``."""
    return _with_files(description, lambda _, surface: str(folder / surface.file))


def with_copied_surfaces(description: ModelDescription, folder: Path, undo: ExitStack) -> ModelDescription:
    """Copy the surface files into ``folder/meshes``; the description then holds their paths relative to the folder.

    ``undo`` gets what takes the copies back, for a model that cannot be written after all.

    Raises
    ------
    InputError
        A surface file is gone, cannot be read or copied, or is not the one that was prepared.
    """

    def copied(link: str, surface: PreparedMesh) -> str:
        source, meshes = Path(surface.file), folder / FOLDER
        found = _digest(link, source)
        if found != surface.sha256:
            raise InputError(
                f"surface file of link {link}, {source}, has changed since it was prepared: SHA-256",
                code="F007",
                value=found,
                allowed=surface.sha256,
                remedy="import the link again",
            )
        same = next((p for p in sorted(meshes.glob(f"*-{found[:8]}{_SUFFIX}")) if _digest(link, p) == found), None)
        if same is None:
            same = meshes / surface_file_name(link, found)
            _copy(link, source, same, undo)
        return same.relative_to(folder).as_posix()

    return _with_files(description, copied)


def _copy(link: str, source: Path, target: Path, undo: ExitStack) -> None:
    if target.exists():
        raise InputError(
            f"surface file {target} of link {link} exists with other content",
            code="F009",
            remedy="move it away, or choose another folder",
        )
    try:
        if not target.parent.is_dir():
            target.parent.mkdir()
            undo.callback(_if_possible, target.parent.rmdir)
        with written_whole(target) as draft:
            shutil.copyfile(source, draft)
    except OSError as error:
        raise InputError(
            f"surface file {target} of link {link} cannot be written ({error.strerror or error})",
            code="F008",
            remedy="choose another folder",
        ) from error
    undo.callback(_if_possible, target.unlink)


def _if_possible(remove: Callable[[], None]) -> None:
    with suppress(OSError):
        remove()


def _with_files(description: ModelDescription, name: Callable[[str, PreparedMesh], str]) -> ModelDescription:
    """The description with other names of the mesh files."""
    links = []
    for link in description.link:
        given = {"surface": link.surface, "solid": link.solid}
        update = {
            key: mesh.model_copy(update={"file": name(link.name, mesh)})
            for key, mesh in given.items()
            if mesh is not None
        }
        links.append(link.model_copy(update=update))
    return description.model_copy(update={"link": tuple(links)})


def _digest(link: str, path: Path) -> str:
    remedy = f"put it back beside the model file, or import the link again ({link})"
    return read_sha256(path, "surface file", remedy=remedy)
