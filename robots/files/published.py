"""Results that appear in a folder together: after a kill at any moment they are made whole by whoever opens it next.

A run writes into a hidden folder, its stage, whose lock says that it lives. A target that the run has made itself
is replaced by the stage in one rename. Else the files move one by one, by a journal that is on the disk before the
first of them moves and that goes after the last: whoever finds one there (:func:`heal`) moves the rest, or puts back
what has moved where that is impossible. What stood under a result's name is kept in ``previous/<time>/``.

Locks are those of the system on open folders (flock): they end with their process, however it ends, and leave no
file. Where there are none, stages that others left are not removed.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import json
import logging
import os
import re
import secrets
import shutil
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path, PurePosixPath
from typing import Any

from robots.errors import InputError
from robots.files.written import settle, sha256_of, write_whole, written_whole

JOURNAL = ".publishing.json"
FORM = "stiffarm-publishing/1"
# Results lie at most so many folders below the one that they were published into.
DEPTH = 3
_STAGE = ".partial-"
_BACKUP = re.compile(r"previous/\d{8}-\d{6}(-\d+)?")

_log = logging.getLogger("stiffarm")


class Stage:
    """A hidden folder for what a run writes into ``target``; beside it if ``fresh`` (the run has made it), else in it.

    It is locked as long as it is open. What killed runs have left there is put right first: results that were moving
    are moved on, stages are named in the log and removed.

    Raises
    ------
    OSError
        The folder cannot be made.
    InputError
        As of :func:`heal`.
    """

    def __init__(self, target: Path, *, fresh: bool) -> None:
        self.target, self._fresh = target, fresh
        heal(target)
        _remove_leftovers(target)
        self.path, self._lock = _locked_folder(target.parent, _beside(target)) if fresh else _locked_folder(target)

    def settle(self) -> None:
        """Wait until the disk holds all that has been written; for large files that takes a while."""
        for path in [*self.path.rglob("*"), self.path]:
            settle(path)

    def publish(self, sha256: Mapping[str, str]) -> None:
        """Make the stage's files, which are settled, the target's; ``sha256``: hashes of all of them by name.

        Raises
        ------
        OSError
            Something is in the way of a result, or the disk is full; the target is as it was before.
        InputError
            As of :func:`heal`.
        """
        if self._fresh:
            try:
                os.rename(self.path, self.target)  # onto the empty folder that the run has made
            except OSError:  # somebody has put something there, or the system does not do this
                inside = self.target / f"{_STAGE}{secrets.token_hex(6)}"
                os.rename(self.path, inside)
                self.path = inside
            else:
                settle(self.target.parent)
                return
        with _alone(self.target):
            _heal(self.target)
            moves = _planned(self.target, self.path.name, sha256)
            write_whole(self.path / JOURNAL, moves.text())
            os.replace(self.path / JOURNAL, self.target / JOURNAL)
            settle(self.target)
            try:
                moves.forward()
            except BaseException:
                moves.back()
                raise
            (self.target / JOURNAL).unlink()

    def close(self) -> None:
        """Remove what is left of it."""
        shutil.rmtree(self.path, ignore_errors=True)
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def heal(folder: Path) -> None:
    """Where a run was killed while its results moved into ``folder``: move the rest, or put back what has moved.

    Raises
    ------
    InputError
        Neither can be done (no access, no space), or the journal is none of this program.
    """
    if os.path.exists(folder / JOURNAL):  # of which a folder that one may not look into has none
        with _alone(folder):
            _heal(folder)


def heal_above(path: Path) -> None:
    """:func:`heal` the folder that a file was published into, if any; before the file is read."""
    for folder in list(path.absolute().parents)[:DEPTH]:
        heal(folder)


@dataclass(frozen=True)
class _Moves:
    """Files ``sha256`` (by name) on their way from ``stage`` into ``target``, those before them into ``backup``.

    Where a file is, the disk says; so both directions may be taken up anywhere: it is still in the stage, and the one
    before it in the backup or not yet; or it is in its place. ``made``: folders that are not there before.
    """

    target: Path
    stage: str
    backup: str
    sha256: Mapping[str, str]
    made: tuple[str, ...]

    def text(self) -> str:
        """The journal."""
        content = {
            "schema": FORM,
            "stage": self.stage,
            "backup": self.backup,
            "made": self.made,
            "sha256": dict(self.sha256),
        }
        return json.dumps(content, indent=1) + "\n"

    def forward(self) -> None:
        """Move all that has not moved."""
        for name in self.sha256:
            new, place, kept = self._paths(name)
            if os.path.lexists(new):
                # A link that leads nowhere is somebody's file too.
                if os.path.lexists(place) and not os.path.lexists(kept):
                    _keep(place, kept)
                place.parent.mkdir(parents=True, exist_ok=True)
                os.replace(new, place)
        for folder in {p.parent for name in self.sha256 for p in self._paths(name)[1:]}:
            if folder.is_dir():
                settle(folder)

    def back(self) -> None:
        """Put back all that has moved, and take the journal away."""
        for name, sha256 in reversed(list(self.sha256.items())):
            new, place, kept = self._paths(name)
            if not os.path.lexists(new) and place.is_file() and sha256_of(place) == sha256:
                new.parent.mkdir(parents=True, exist_ok=True)
                os.replace(place, new)
            if os.path.lexists(kept):
                if os.path.lexists(place):  # the same file twice, or a copy of it
                    kept.unlink()
                else:
                    os.replace(kept, place)
        shutil.rmtree(self.target / self.backup, ignore_errors=True)  # copies that went with them
        for folder in self.made:
            with contextlib.suppress(OSError):
                (self.target / folder).rmdir()
        (self.target / JOURNAL).unlink()

    def astray(self) -> list[str]:
        """Names whose place does not hold the file that belongs there."""
        places = ((name, self.target / name) for name in self.sha256)
        return [name for name, place in places if not place.is_file() or sha256_of(place) != self.sha256[name]]

    def _paths(self, name: str) -> tuple[Path, Path, Path]:
        return self.target / self.stage / name, self.target / name, self.target / self.backup / name


def _planned(target: Path, stage: str, sha256: Mapping[str, str]) -> _Moves:
    stem = f"previous/{dt.datetime.now(dt.UTC):%Y%m%d-%H%M%S}"
    names = (stem if n == 0 else f"{stem}-{n}" for n in count())
    backup = next(name for name in names if not os.path.lexists(target / name))
    folders = {p.as_posix() for name in sha256 for root in ("", backup) for p in PurePosixPath(root, name).parents}
    made = sorted((f for f in folders if not (target / f).exists()), key=len, reverse=True)
    return _Moves(target, stage, backup, dict(sorted(sha256.items())), tuple(made))


def _heal(folder: Path) -> None:
    """:func:`heal` for who has the folder's lock."""
    try:
        text = (folder / JOURNAL).read_text(encoding="utf-8")
    except FileNotFoundError:
        return
    except (OSError, ValueError) as error:
        raise _unhealed(folder, str(error)) from error
    moves = _read(folder, text)
    try:
        try:
            moves.forward()
            (folder / JOURNAL).unlink()
            done = "the rest has moved now"
            astray = moves.astray()
        except OSError as error:
            moves.back()
            done, astray = f"they are back where they were ({error})", []
    except OSError as error:
        raise _unhealed(folder, str(error)) from error
    shutil.rmtree(folder / moves.stage, ignore_errors=True)
    _log.warning("%s: a run was killed while its results moved into this folder; %s", folder, done)
    if astray:
        _log.warning("%s: changed or lost since then: %s; run it again", folder, ", ".join(astray))


def _read(folder: Path, text: str) -> _Moves:
    """The journal in a folder; it may be anybody's, so no name in it leads out of the folder."""
    try:
        found: dict[str, Any] = json.loads(text)
        sha256, made = dict(found["sha256"]), tuple(found["made"])
        right = found["schema"] == FORM and _BACKUP.fullmatch(found["backup"]) is not None
        right = right and found["stage"].startswith(_STAGE) and "/" not in found["stage"]
        right = right and all(_inside(name) for name in (*sha256, *made))
        moves = _Moves(folder, found["stage"], found["backup"], sha256, made)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise _unhealed(folder, f"{type(error).__name__}: {error}") from error
    if not right:
        raise _unhealed(folder, "it is none of this program")
    return moves


def _inside(name: str) -> bool:
    path = PurePosixPath(name)
    return not path.is_absolute() and ".." not in path.parts and "\\" not in name and "\0" not in name


def _unhealed(folder: Path, reason: str) -> InputError:
    return InputError(
        f"folder {folder} holds results of two runs: one was killed while they moved, and {JOURNAL} there cannot be "
        f"followed ({reason})",
        code="F010",
        remedy="check access rights and free space and try again, or choose another folder",
    )


def _keep(place: Path, kept: Path) -> None:
    """Put what stands in a result's place into the backup; a file stays in its place too until it is replaced."""
    for file in _files_named_in(place):
        copy = kept.parent / file
        # Those that are replaced themselves come there by themselves.
        if not copy.exists():
            copy.parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(place.parent / file, copy)
            except OSError:
                with written_whole(copy) as draft:
                    shutil.copy2(place.parent / file, draft)
    kept.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(place, kept, follow_symlinks=False)
    except (OSError, NotImplementedError):  # a folder, or a system without hard links
        os.replace(place, kept)


def _files_named_in(path: Path) -> list[Path]:
    """Surface files beside a model file that it refers to; they go where it goes, or it cannot be read there."""
    if path.suffix != ".toml" or not path.is_file():
        return []
    try:
        links = tomllib.loads(path.read_text(encoding="utf-8")).get("link", [])
        files = [Path(link["surface"]["file"]) for link in links if "surface" in link]
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):  # somebody's own file
        return []
    return [f for f in files if not f.is_absolute() and ".." not in f.parts and (path.parent / f).is_file()]


def _beside(target: Path) -> str:
    """What names of stages beside a target begin with; names may have 255 bytes."""
    return f"{_STAGE}{target.absolute().name[:50]}-"


def _remove_leftovers(target: Path) -> None:
    """Remove the stages of runs into ``target`` that nobody has locked, and say so."""
    beside = re.compile(re.escape(_beside(target)) + "[0-9a-f]{12}")
    for folder, pattern in ((target, re.compile(re.escape(_STAGE) + ".*")), (target.parent, beside)):
        try:
            found = [
                folder / e.name
                for e in os.scandir(folder)
                if pattern.fullmatch(e.name) and e.is_dir(follow_symlinks=False)
            ]
        except OSError:
            continue
        for stage in found:
            lock = _locked(stage, wait=False)
            if lock is not None:
                size = sum(p.lstat().st_size for p in stage.rglob("*") if p.is_file())
                shutil.rmtree(stage, ignore_errors=True)
                os.close(lock)
                _log.warning("removed what a killed run had left: %s (%.3g MB)", stage, size / 1e6)


def _locked_folder(place: Path, stem: str = _STAGE) -> tuple[Path, int | None]:
    """A new folder, locked unless the system has no locks; and the lock."""
    while True:
        path = place / f"{stem}{secrets.token_hex(6)}"
        path.mkdir()
        lock = _locked(path)
        if path.exists():
            return path, lock
        # Who cleans up may have come between: then it is gone.
        if lock is not None:
            os.close(lock)


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Wait for the folder's lock and hold it."""
    lock = _locked(folder)
    try:
        yield
    finally:
        if lock is not None:
            os.close(lock)


def _locked(folder: Path, *, wait: bool = True) -> int | None:
    """The lock of a folder as an open descriptor; None if somebody else has it (without ``wait``), or without locks."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:  # no access; and Windows opens no folders
        return None
    import fcntl  # which Windows does not have either

    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError:
        os.close(descriptor)
        return None
    return descriptor
