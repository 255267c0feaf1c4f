"""One input through one reader, with limits: a right answer or a clean user error, else a fault."""

from __future__ import annotations

import hashlib
import resource
import signal
import sys
import traceback
import types
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robots import InputError

from .samples import Sample

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("robots", "meshes", "fem", "doe", "surrogate", "machining", "rehearsal", "stiffarm")
# Readers answer small files in milliseconds; five seconds of the processor's time is a file that stops a shop.
SECONDS = 5.0
# By the clock, for what waits and does not reckon; a busy machine gives a process a tenth of its time.
WAITING_SECONDS = 30.0
# A file of 400 kB at most that takes more memory than this on top would take a machine down at a few megabytes.
MEMORY_BYTES = 700 * 2**20
# A terminal's scrollback; a message is read by a person.
LONGEST_MESSAGE = 30_000


class TooSlowError(BaseException):
    """The input took too long; no reader's ``except Exception`` may hide it."""


class WrongAnswerError(Exception):
    """A reader answered, and what it answered cannot be right."""


@dataclass(frozen=True)
class Fault:
    """What went wrong: ``kind`` (an exception's name, "too slow", ...), the project's innermost place, the words."""

    reader: str
    kind: str
    place: str
    words: str

    @property
    def signature(self) -> str:
        """The same for inputs that stumble over the same thing."""
        return hashlib.sha256(f"{self.reader}|{self.kind}|{self.place}".encode()).hexdigest()[:10]

    def __str__(self) -> str:
        return f"{self.reader}: {self.kind} at {self.place}: {self.words}"


def attempt(reader: str, run: Callable[[Path], object], sample: Sample, folder: Path) -> Fault | None:
    """Give a sample to a reader, as a file in ``folder``; None if it answered rightly or refused cleanly."""
    path = folder / f"input{sample.suffix}"
    path.write_bytes(sample.data)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            with _limited():
                run(path)
        except InputError as error:
            fault = _of_message(reader, str(error))
        except TooSlowError as error:
            fault = Fault(reader, "too slow", _place(error.__traceback__), f"more than {SECONDS:g} s")
        except MemoryError as error:
            fault = Fault(reader, "MemoryError", _place(error.__traceback__), "more memory than allowed")
        except WrongAnswerError as error:
            fault = Fault(reader, "wrong answer", str(error).split(":")[0], str(error)[:500])
        except (Exception, SystemExit) as error:
            fault = Fault(reader, type(error).__name__, _place(error.__traceback__), str(error)[:300])
        else:
            fault = None
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    if fault is None and grown > MEMORY_BYTES:
        fault = Fault(reader, "memory", "the whole reader", f"{grown / 2**20:.0f} MiB more")
    return fault or _of_warnings(reader, warned)


def _of_message(reader: str, text: str) -> Fault | None:
    if len(text) > LONGEST_MESSAGE:
        return Fault(reader, "endless message", "the error", f"{len(text)} characters: {' '.join(text[:100].split())}")
    odd = next((c for c in text if not c.isprintable() and c != "\n"), None)
    if odd is not None:
        return Fault(reader, "a message that steers the terminal", "the error", f"{odd!r} in {text[:200]!a}")
    return None


def _of_warnings(reader: str, warned: list[warnings.WarningMessage]) -> Fault | None:
    """Warnings of arithmetic anywhere, and any that project code raised: they reach the user's screen."""
    for item in warned:
        place = Path(item.filename)
        own = place.is_relative_to(ROOT) and place.relative_to(ROOT).parts[0] in PACKAGES
        if own or issubclass(item.category, RuntimeWarning):
            name = place.relative_to(ROOT) if own else place.name
            return Fault(reader, item.category.__name__, f"{name}:{item.lineno}", str(item.message)[:300])
    return None


@contextmanager
def _limited() -> Iterator[None]:
    def stop(_: int, __: types.FrameType | None) -> None:
        raise TooSlowError

    timers = {
        signal.SIGPROF: (signal.ITIMER_PROF, SECONDS),
        signal.SIGALRM: (signal.ITIMER_REAL, WAITING_SECONDS),
    }
    old = {number: signal.signal(number, stop) for number in timers}
    for timer, seconds in timers.values():
        # Once more each second: a destructor or a callback may swallow one.
        signal.setitimer(timer, seconds, 1.0)
    try:
        yield
    finally:
        for timer, _ in timers.values():
            signal.setitimer(timer, 0.0)
        for number, handler in old.items():
            signal.signal(number, handler)


def _place(trace: types.TracebackType | None) -> str:
    """The innermost frame of the project's packages, else the innermost of all."""
    frames = traceback.extract_tb(trace)
    own = [f for f in frames if _package(f.filename) in PACKAGES]
    frame = own[-1] if own else frames[-1] if frames else None
    if frame is None:
        return "nowhere"
    path = Path(frame.filename)
    name = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path.name
    return f"{name} {frame.name}"


def _package(file: str) -> str:
    path = Path(file)
    return path.relative_to(ROOT).parts[0] if path.is_relative_to(ROOT) else ""


def limit_memory(more: int) -> None:
    """Let this process take ``more`` bytes of address space on top of what it has; a Linux machine's only."""
    if not sys.platform.startswith("linux"):
        return
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    wanted = pages * resource.getpagesize() + more
    resource.setrlimit(resource.RLIMIT_AS, (wanted if hard < 0 else min(wanted, hard), hard))


def require(fact: bool | np.bool_, words: str) -> None:
    """Raise :class:`WrongAnswerError` unless the fact holds; what stands before a colon names the kind of fault."""
    if not fact:
        raise WrongAnswerError(words)


def require_finite(found: object, where: str, may_miss: frozenset[str] = frozenset(), depth: int = 0) -> None:
    """No NaN or infinity in any array or number of a result, however deep, but in the fields ``may_miss``."""
    if isinstance(found, float | np.floating | np.ndarray):
        array = np.asarray(found)
        if array.dtype.kind in "fc":
            require(np.isfinite(array).all(), f"{where} not finite: {str(found)[:80]}")
    elif is_dataclass(found) and not isinstance(found, type):
        for item in fields(found):
            if item.name not in may_miss:
                require_finite(getattr(found, item.name, None), f"{where}.{item.name}", may_miss, depth + 1)
    elif isinstance(found, dict):
        for key, value in found.items():
            if key not in may_miss:
                require_finite(value, f"{where}[{str(key)[:20]}]" if depth < 3 else where, may_miss, depth + 1)
    elif isinstance(found, tuple | list) and depth < 12:
        for value in found:
            require_finite(value, where, may_miss, depth + 1)


def same(a: Any, b: Any) -> bool:
    """Whether two arrays are equal, NaN where the other is NaN."""
    return bool(np.array_equal(np.asarray(a), np.asarray(b), equal_nan=True))
