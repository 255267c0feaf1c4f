"""Prepared surface files of links: found beside the model file, and copied along when a model is written."""

from __future__ import annotations

import contextlib
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from robots.errors import InputError
from robots.files.reading import read_sha256
from robots.files.written import written_whole
from robots.schema.description import ModelDescription, Surface

FOLDER = "meshes"
_SUFFIX = ".npz"


def surface_file_name(link: str, sha256: str) -> str:
    """Name of a link's surface file in ``meshes/``; no name of a link leads out of that folder."""
    return f"{re.sub(r'[^A-Za-z0-9_.-]+', '_', link).strip('.')}-{sha256[:8]}{_SUFFIX}"


def with_absolute_surfaces(description: ModelDescription, folder: Path) -> ModelDescription:
    """The description with surface files as absolute paths, read as relative to ``folder``."""
    return _with_files(description, lambda _, surface: str(folder / surface.file))


class SurfaceCopies:
    """Copies of surface files in ``folder/meshes``, taken back if the block that writes the model fails."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._made: list[Path] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            return
        for path in reversed(self._made):
            with contextlib.suppress(OSError):
                path.rmdir() if path.is_dir() else path.unlink()

    def of(self, description: ModelDescription) -> ModelDescription:
        """Copy the surface files; the description then holds their paths relative to the folder.

        Raises
        ------
        InputError
            A surface file is gone, cannot be read or copied, or is not the one that was prepared.
        """
        return _with_files(description, self._copy)

    def _copy(self, link: str, surface: Surface) -> str:
        source = Path(surface.file)
        found = _digest(link, source)
        if found != surface.sha256:
            raise InputError(
                f"surface file of link {link}, {source}, has changed since it was prepared: SHA-256",
                value=found,
                allowed=surface.sha256,
                remedy="import the link again",
            )
        meshes = self._folder / FOLDER
        same = next((p for p in sorted(meshes.glob(f"*-{found[:8]}{_SUFFIX}")) if _digest(link, p) == found), None)
        if same is None:
            same = meshes / surface_file_name(link, found)
            self._write(link, source, same)
        return same.relative_to(self._folder).as_posix()

    def _write(self, link: str, source: Path, target: Path) -> None:
        if target.exists():
            raise InputError(
                f"surface file {target} of link {link} exists with other content",
                remedy="move it away, or choose another folder",
            )
        try:
            if not target.parent.is_dir():
                target.parent.mkdir()
                self._made.append(target.parent)
            with written_whole(target) as draft:
                shutil.copyfile(source, draft)
        except OSError as error:
            raise InputError(
                f"surface file {target} of link {link} cannot be written ({error.strerror or error})",
                remedy="choose another folder",
            ) from error
        self._made.append(target)


def _with_files(description: ModelDescription, name: Callable[[str, Surface], str]) -> ModelDescription:
    """The description with other names of the surface files."""
    links = tuple(
        link
        if link.surface is None
        else link.model_copy(
            update={"surface": link.surface.model_copy(update={"file": name(link.name, link.surface)})}
        )
        for link in description.link
    )
    return description.model_copy(update={"link": links})


def _digest(link: str, path: Path) -> str:
    remedy = f"put it back beside the model file, or import the link again ({link})"
    return read_sha256(path, "surface file", remedy=remedy)
