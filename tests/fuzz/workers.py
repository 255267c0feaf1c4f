"""Worker processes of the attack: each takes its share of the numbers; one that dies or hangs is replaced."""

from __future__ import annotations

import multiprocessing as mp
import os
import shutil
import signal
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

# An alarm ends what Python runs (:mod:`.trial`); what sits in a library's own loop is killed after these.
HANG_SECONDS = 60.0
# Importing everything and making the seeds, on a busy machine.
START_SECONDS = 180.0
WORKER_MEMORY = 3 * 2**30


@dataclass(frozen=True)
class Finding:
    """A failing input: its number, reader and file, and what went wrong."""

    number: int
    reader: str
    suffix: str
    data: bytes
    signature: str
    words: str


@dataclass
class Tally:
    """What came of it: inputs that passed, the findings, one for each signature, and how many inputs they stand for."""

    passed: int = 0
    failed: int = 0
    findings: dict[str, Finding] = field(default_factory=dict)
    by_reader: dict[str, int] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)


@dataclass
class _Worker:
    process: Any
    pipe: Connection
    first: int
    at: int | None = None
    since: float = field(default_factory=time.monotonic)


def run(
    seed: int, count: int, seconds: float, processes: int, only: tuple[str, ...], said: Callable[[Tally, float], None]
) -> Tally:
    """Try inputs 0 to ``count`` - 1, or what fits into the time."""
    context = mp.get_context("fork")
    tally, begun, told = Tally(), time.monotonic(), 0.0
    running: dict[Connection, _Worker] = {}

    def start(first: int) -> None:
        mine, its = context.Pipe(duplex=False)
        job = (its, seed, first, count, processes, only, begun + seconds)
        process = context.Process(target=_work, args=job, daemon=True)
        process.start()
        its.close()
        running[mine] = _Worker(process, mine, first)

    for i in range(processes):
        start(i)
    while running:
        for ready in wait(list(running), timeout=1.0):
            worker = running[ready]  # type: ignore[index]
            try:
                message = worker.pipe.recv()
            except (EOFError, OSError):
                worker.process.join(10.0)
                if worker.process.exitcode != 0:
                    words = f"the process ended with {worker.process.exitcode}"
                    start(_died(worker, tally, seed, only, words) + processes)
                del running[ready]  # type: ignore[arg-type]
                continue
            _take(worker, message, tally)
        for pipe, worker in list(running.items()):
            limit = START_SECONDS if worker.at is None else HANG_SECONDS
            if time.monotonic() - worker.since > limit:
                os.kill(worker.process.pid, signal.SIGKILL)
                worker.process.join()
                del running[pipe]
                start(_died(worker, tally, seed, only, f"no answer for {limit:g} s") + processes)
        if time.monotonic() - told > 5.0:
            told = time.monotonic()
            said(tally, told - begun)
    return tally


def _take(worker: _Worker, message: tuple[Any, ...], tally: Tally) -> None:
    worker.since = time.monotonic()
    if message[0] == "at":
        worker.at = message[1]
        return
    _, passed, findings, by_reader, spent = message
    tally.passed += passed
    for finding in findings:
        tally.failed += 1
        tally.findings.setdefault(finding.signature, finding)
    for name, n in by_reader.items():
        tally.by_reader[name] = tally.by_reader.get(name, 0) + n
    for name, t in spent.items():
        tally.seconds[name] = tally.seconds.get(name, 0.0) + t


def _died(worker: _Worker, tally: Tally, seed: int, only: tuple[str, ...], words: str) -> int:
    """Record the input that a worker died of; the number of it."""
    if worker.at is None:
        raise RuntimeError(f"a worker did not come up: {words}")
    from .registry import turn

    name, sample = turn(_chosen(only), seed, worker.at)
    tally.failed += 1
    signature = f"died-{name.replace(' ', '-')}"
    tally.findings.setdefault(
        signature, Finding(worker.at, name, sample.suffix, sample.data, signature, f"{name}: {words}")
    )
    return worker.at


def _chosen(only: tuple[str, ...]) -> dict[str, Any]:
    from .registry import readers

    table = readers()
    return {name: reader for name, reader in table.items() if not only or name in only}


def _work(pipe: Connection, seed: int, first: int, count: int, step: int, only: tuple[str, ...], until: float) -> None:
    """Tell each number before it is tried, and what came of it; in a process of its own."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    silence()
    from .registry import turn
    from .trial import attempt, limit_memory

    table = _chosen(only)
    for reader in table.values():
        _ = reader.samples
    limit_memory(WORKER_MEMORY)
    base = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None  # noqa: S108 - thousands of small files, gone after
    folder = Path(tempfile.mkdtemp(prefix="stiffarm-fuzz-", dir=base))
    passed, findings, by_reader, spent, seen = 0, [], {}, {}, set()
    try:
        for k, number in enumerate(range(first, count, step)):
            if time.monotonic() > until:
                break
            pipe.send(("at", number))
            name, sample = turn(table, seed, number)
            begun = time.monotonic()
            fault = attempt(name, table[name].run, sample, folder)
            by_reader[name] = by_reader.get(name, 0) + 1
            spent[name] = spent.get(name, 0.0) + time.monotonic() - begun
            if fault is None:
                passed += 1
            else:
                data = b""  # the bytes of the first of a kind are enough
                if fault.signature not in seen:
                    seen.add(fault.signature)
                    data = smaller(name, table[name].run, sample, fault, folder)
                    pipe.send(("at", number))
                findings.append(Finding(number, name, sample.suffix, data, fault.signature, str(fault)))
            if k % 50 == 49:
                pipe.send(("done", passed, findings, by_reader, spent))
                passed, findings, by_reader, spent = 0, [], {}, {}
        pipe.send(("done", passed, findings, by_reader, spent))
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    pipe.close()
    # No clean-up of libraries that were fed nonsense.
    os._exit(0)


def smaller(name: str, run: Callable[[Path], object], sample: Any, fault: Any, folder: Path) -> bytes:
    """The sample's data, smaller where it fails in the same way; what is slow or large stays as it is."""
    from .samples import Sample
    from .shrink import shrunk
    from .trial import attempt

    if fault.kind in ("too slow", "MemoryError", "memory"):
        return bytes(sample.data)

    def fails(data: bytes) -> bool:
        found = attempt(name, run, Sample(sample.suffix, data), folder)
        return found is not None and found.signature == fault.signature

    return shrunk(sample.data, fails)


def silence() -> None:
    """What libraries print on their own belongs to no one here."""
    import logging

    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    logging.disable(logging.CRITICAL)
