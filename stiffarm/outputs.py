"""Output folders that are never half-written and never lose what stood there before."""

from __future__ import annotations

import contextlib
import datetime as dt
import hashlib
import json
import platform
import shutil
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from robots import InputError
from robots.files import read_bytes, recorded
from stiffarm.interruption import tidied_by, undisturbed

_PACKAGES = ("stiffarm", "numpy", "scipy", "scikit-fem", "scikit-learn", "pyvista", "trimesh", "matplotlib")


class OutputFolder:
    """A folder of results, written whole or not at all.

    Everything is written into a hidden folder inside the target; on success the files move into place and
    files of the same name go to ``previous/<time>/`` first. On an error or Ctrl-C the hidden folder is
    removed and the target stays as it was, or is removed again if it was not there.

    Raises
    ------
    InputError
        On entry, if the folder cannot be made or written; at the end, if something stands in the way of a
        result (a file where a sub-folder belongs).
    """

    def __init__(self, target: Path, command: list[str], inputs: Mapping[str, Path | str], seed: int | None) -> None:
        self.target = target
        self._command, self._inputs, self._seed = command, inputs, seed
        self._timings: dict[str, float] = {}
        self._made: list[Path] = []
        self._stage: Path | None = None
        self._guard = contextlib.ExitStack()

    def __enter__(self) -> Self:
        self._started = time.monotonic()
        self._guard.enter_context(tidied_by(self._tidy))
        try:
            with undisturbed():
                self._make(self.target)
                self._stage = Path(tempfile.mkdtemp(prefix=".partial-", dir=self.target))
        except BaseException as error:
            self._close()
            if isinstance(error, OSError):
                raise InputError(
                    f"output folder {self.target} cannot be written ({error.strerror or error})",
                    remedy="choose another folder with --out",
                ) from error
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self.write_json("run.json", self._provenance())
                with undisturbed():
                    self._publish()
        finally:
            self._close()

    @property
    def stage(self) -> Path:
        """The hidden folder that holds the results until they are complete."""
        if self._stage is None:
            raise RuntimeError("an output folder is written inside its with block")
        return self._stage

    @contextlib.contextmanager
    def timed(self, step: str) -> Iterator[None]:
        """Record how long a step took, for run.json."""
        start = time.monotonic()
        yield
        self._timings[step] = round(time.monotonic() - start, 3)

    def path(self, name: str) -> Path:
        """Where to write a file of this name; sub-folders are made."""
        path = self.stage / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def write_text(self, name: str, text: str) -> None:
        """Write a text file."""
        self.path(name).write_text(text, encoding="utf-8")

    def write_json(self, name: str, content: Mapping[str, Any]) -> None:
        """Write a JSON file."""
        self.write_text(name, json.dumps(content, indent=2, allow_nan=False) + "\n")

    def _provenance(self) -> dict[str, Any]:
        return {
            "schema": "stiffarm-run/1",
            "command": self._command,
            "finished_utc": dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
            "versions": {name: _version(name) for name in _PACKAGES} | {"python": platform.python_version()},
            "platform": f"{sys.platform} {platform.machine()}",
            "inputs_sha256": {name: _digest(item) for name, item in self._inputs.items()},
            "files_read_sha256": {} if (ledger := recorded()) is None else ledger.sha256,
            "seed": self._seed,
            "timings_s": self._timings | {"total": round(time.monotonic() - self._started, 3)},
        }

    def _publish(self) -> None:
        """Move the files into place; if anything stops that, Ctrl-C too, put back what was moved."""
        backup = _free_name(self.target / "previous", dt.datetime.now(dt.UTC).strftime("%Y%m%d-%H%M%S"))
        moves: list[tuple[Path, Path]] = []
        copies: list[Path] = []
        try:
            for new in sorted(p for p in self.stage.rglob("*") if p.is_file()):
                name = new.relative_to(self.stage)
                place = self.target / name
                if place.exists():
                    for file in _files_named_in(place):
                        # Those that the new run replaces come by being moved.
                        copy = backup / name.parent / file
                        if not copy.exists():
                            copies.append(copy)
                            self._make(copy.parent)
                            shutil.copy2(place.parent / file, copy)
                    moves.append((place, backup / name))
                    self._move(*moves[-1])
                moves.append((new, place))
                self._move(*moves[-1])
        except BaseException as error:
            for source, place in reversed(moves):
                if place.exists() and not source.exists():
                    place.replace(source)
            for copy in copies:
                copy.unlink(missing_ok=True)
            if isinstance(error, OSError):
                raise InputError(
                    f"output folder {self.target} cannot take the results ({error})",
                    remedy="move away what is in the way there, or choose another folder with --out",
                ) from error
            raise

    def _move(self, source: Path, place: Path) -> None:
        self._make(place.parent)
        source.replace(place)

    def _make(self, folder: Path) -> None:
        """Make a folder and those above it, and remember which were not there."""
        self._made += [p for p in (folder, *folder.parents) if not p.exists()]
        folder.mkdir(parents=True, exist_ok=True)

    def _close(self) -> None:
        self._tidy()
        self._guard.close()

    def _tidy(self) -> None:
        """Remove the hidden folder, and of the folders that were made the ones that hold nothing."""
        if self._stage is not None:
            shutil.rmtree(self._stage, ignore_errors=True)
        for folder in sorted(self._made, key=lambda p: len(p.parts), reverse=True):
            with contextlib.suppress(OSError):
                folder.rmdir()


def _files_named_in(path: Path) -> list[Path]:
    """Surface files beside a model file that it refers to; they go where it goes, or it cannot be read there."""
    if path.suffix != ".toml":
        return []
    try:
        links = tomllib.loads(path.read_text(encoding="utf-8")).get("link", [])
        files = [Path(link["surface"]["file"]) for link in links if "surface" in link]
    except (OSError, ValueError, TypeError, KeyError, AttributeError):  # somebody's own file
        return []
    return [f for f in files if not f.is_absolute() and ".." not in f.parts and (path.parent / f).is_file()]


def _free_name(folder: Path, stem: str) -> Path:
    path, n = folder / stem, 1
    while path.exists():
        path, n = folder / f"{stem}-{n}", n + 1
    return path


def _digest(item: Path | str) -> str:
    """SHA-256 of a file as it was read in this command; a text that is a hash already stays as it is."""
    if not isinstance(item, Path):
        return item
    ledger = recorded()
    found = None if ledger is None else ledger.of(item)
    return hashlib.sha256(read_bytes(item, "input file")).hexdigest() if found is None else found


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # run from its sources
        return "unknown"
