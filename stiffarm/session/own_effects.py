"""A user's own effects: a Python file that is executed because the user names it, and checked."""

from __future__ import annotations

import importlib.machinery
import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fem.effects import Maker, checked_maker
from robots import InputError
from robots.files.reading import read_bytes


def own_effects(files: Sequence[Path] | None) -> tuple[Maker, ...]:
    """The makers of the effects in some files: each defines ``effects(model) -> list[Effect]``.

    The files are executed with all the rights of the user, as any Python program that they start; nothing else in this
    project runs code that came as data.

    Raises
    ------
    InputError
        A file that is not there, twice, fails, or does not define ``effects``.
    """
    found = list(files or ())
    twice = [str(file) for k, file in enumerate(found) if file.resolve() in [f.resolve() for f in found[:k]]]
    if twice:
        raise InputError("--effect", code="M012", value=twice[0], allowed="each file once", remedy="leave one out")
    return tuple(_maker(file) for file in found)


def own_files(files: Sequence[Path] | None) -> dict[str, Path | str]:
    """The files by name, to be hashed for run.json."""
    return {"effect" if k == 1 else f"effect_{k}": file for k, file in enumerate(files or (), start=1)}


class _AsRead(importlib.machinery.SourceFileLoader):
    """Executes the bytes that were hashed; a compiled copy beside the file is neither believed nor written."""

    source: bytes

    def get_data(self, path: str) -> bytes:
        if path != self.path:
            raise OSError(path)
        return self.source

    def set_data(self, path: str, data: Any, *, _mode: int = 0) -> None:
        pass


def _maker(file: Path) -> Maker:
    if not file.is_file() or file.suffix != ".py":
        raise InputError(
            "--effect", code="M012", value=str(file), allowed="an existing Python file (.py)", remedy="check the path"
        )
    loader = _AsRead(f"stiffarm_own_effect_{file.stem}", str(file))
    loader.source = read_bytes(file, "effect file")
    spec = importlib.util.spec_from_loader(loader.name, loader)
    if spec is None:
        raise InputError("--effect", code="M012", value=str(file), allowed="a Python file (.py)")
    module = importlib.util.module_from_spec(spec)
    try:
        loader.exec_module(module)
    except (Exception, SystemExit) as error:  # what the file does is the user's affair
        raise InputError(
            f"--effect {file}: the file fails ({type(error).__name__}: {error})", code="M012", remedy="mend the file"
        ) from error
    make = getattr(module, "effects", None)
    if not callable(make):
        raise InputError(
            f"--effect {file}: it defines no function 'effects'",
            code="M012",
            remedy="define effects(model) -> list[Effect]",
        )
    return checked_maker(make, f"--effect {file}")
