"""Output folders that are never half-written and never lose what stood there before."""

from __future__ import annotations

import contextlib
import datetime as dt
import platform
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from robots import InputError
from robots.files.published import Stage
from robots.files.reading import read_sha256, recorded
from robots.files.written import sha256_of, tidied_by
from stiffarm.session.interruption import undisturbed
from stiffarm.session.json_text import json_text

_PACKAGES = ("stiffarm", "numpy", "scipy", "scikit-fem", "scikit-learn", "pyvista", "trimesh", "matplotlib")


class OutputFolder:
    """A folder of results, written whole or not at all.

    Everything is written into a hidden folder (:class:`robots.files.published.Stage`); on success the files move into
    place and files of the same name go to ``previous/<time>/`` first. On an error or Ctrl-C the hidden folder is
    removed and the target stays as it was, or is removed again if it was not there. After a kill the next run into
    the folder finishes what was moving and removes the hidden folder.

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
        self._published: tuple[str, ...] = ()
        self._stage: Stage | None = None
        self._last: dict[str, Callable[[], None]] = {}
        self._guard = contextlib.ExitStack()

    def __enter__(self) -> Self:
        self._started = time.monotonic()
        self._guard.enter_context(tidied_by(self._tidy))
        try:
            with undisturbed():
                self._made = [p for p in (self.target, *self.target.parents) if not p.exists()]
                self.target.mkdir(parents=True, exist_ok=True)
                self._stage = Stage(self.target, fresh=bool(self._made))
        except BaseException as error:
            self._close()
            if isinstance(error, OSError):
                raise InputError(
                    f"output folder {self.target} cannot be written ({error.strerror or error})",
                    code="F008",
                    remedy="choose another folder with --out",
                ) from error
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                for write in self._last.values():
                    write()
                outputs = self._outputs()
                self.write_json("run.json", self._provenance() | {"outputs_sha256": outputs})
                self._publish(outputs | {"run.json": sha256_of(self.stage / "run.json")})
                self._published = tuple(outputs)
        finally:
            self._close()

    @property
    def stage(self) -> Path:
        """The hidden folder that holds the results until they are complete."""
        if self._stage is None:
            raise RuntimeError("an output folder is written inside its with block")
        return self._stage.path

    def contents(self) -> str:
        """What was written, in words: pages to begin with, other files by name, folders with their count of files."""
        first = ("index.html", "report.html")
        files = sorted((n for n in self._published if "/" not in n), key=lambda n: (n not in first, n))
        folders = Counter(n.partition("/")[0] for n in self._published if "/" in n)
        return ", ".join([*files, *(f"{name}/ ({count} files)" for name, count in sorted(folders.items()))])

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

    def at_end(self, name: str, write: Callable[[], None]) -> None:
        """Write a file of this name once all other results are there: a page that leads to them."""
        self._last[name] = write

    def names(self) -> list[str]:
        """The results so far and those still to come at the end, by name."""
        there = {p.relative_to(self.stage).as_posix() for p in self.stage.rglob("*") if p.is_file()}
        return sorted(there | self._last.keys())

    def write_text(self, name: str, text: str) -> None:
        """Write a text file."""
        self.write_parts(name, (text,))

    def write_parts(self, name: str, parts: Iterable[str]) -> None:
        """Write a text file whose parts are made one by one."""
        # Names of files that the locale cannot read are written with the bytes that they have.
        with self.path(name).open("w", encoding="utf-8", errors="surrogateescape") as file:
            file.writelines(parts)

    def write_json(self, name: str, content: Mapping[str, Any]) -> None:
        """Write a JSON file."""
        self.write_text(name, json_text(content))

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

    def _outputs(self) -> dict[str, str]:
        """SHA-256 of the results as they lie in the hidden folder, by name."""
        return {name: sha256_of(self.stage / name) for name in self.names()}

    def _publish(self, sha256: Mapping[str, str]) -> None:
        assert self._stage is not None  # noqa: S101 - it has been entered
        try:
            self._stage.settle()
            with undisturbed():
                self._stage.publish(sha256)
        except OSError as error:
            raise InputError(
                f"output folder {self.target} cannot take the results ({error})",
                code="F008",
                remedy="move away what is in the way there, or choose another folder with --out",
            ) from error

    def _close(self) -> None:
        self._tidy()
        self._guard.close()

    def _tidy(self) -> None:
        """Remove the hidden folder, and of the folders that were made the ones that hold nothing."""
        if self._stage is not None:
            self._stage.close()
        for folder in self._made:
            with contextlib.suppress(OSError):
                folder.rmdir()


def _digest(item: Path | str) -> str:
    """SHA-256 of a file as it was read in this command; a text that is a hash already stays as it is."""
    if not isinstance(item, Path):
        return item
    ledger = recorded()
    found = None if ledger is None else ledger.of(item)
    return read_sha256(item, "input file") if found is None else found


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # run from its sources
        return "unknown"
