"""Long commands killed at random moments: the folder is as before, or new, or healed by whoever opens it next.

``python -m tests.fuzz.kills --count 100`` by itself. Half of the kills hit when results are on their way. Most are
kills that no process can answer (SIGKILL), the others what Ctrl-C and a scheduler send (SIGINT, SIGTERM): these must
leave one line, the agreed exit code and the folder as it was before, or new.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import logging
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
JOURNAL = ".publishing.json"
LINE = "stiffarm: stopped by the user; no half-written files are left"
# A command that takes longer than this hangs.
PATIENCE_S = 600.0
# Share of the kills that aim at the moves, and the time after they have begun in which they come.
AIMED, MOVES_S = 0.5, 0.01
# Share of the kills into a folder that is not there yet.
FRESH = 0.25
SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGKILL, signal.SIGINT, signal.SIGTERM)

# "{out}" is the folder of results, "{work}" one that stays between kills; a name's file must come out the same after
# all the kills as without any.
COMMANDS: dict[str, tuple[tuple[str, ...], str]] = {
    "calibrate": (("calibrate", "xr701", "--scheme", "global", "--out", "{out}"), "calibration.csv"),
    "map": (
        (
            "map",
            "joints",
            "kr60-3",
            "--points",
            "9",
            "--values",
            "stiffness",
            "--no-pictures",
            "--work",
            "{work}",
            "--out",
            "{out}",
        ),
        "map.csv",
    ),
    "diagnose": (("diagnose", "xr701", "--out", "{out}"), ""),
    "fit": (("fit", "kr60-3", "--out", "{out}"), "surrogate.json"),
    "plan": (("plan", "xr701", "--poses", "2", "--out", "{out}"), ""),
    "run": (("run", "xr701", "--points", "4", "--out", "{out}"), ""),
}


@dataclass(frozen=True)
class Subject:
    """A command whose uninterrupted run is known: its results in ``old``, and how long it took."""

    name: str
    arguments: tuple[str, ...]
    lasting: str
    old: Path
    seconds: float


def run(count: int, seed: int, out: Path) -> list[str]:
    """Kill ``count`` commands; what was wrong, in words. Folders of failures stay in ``out``."""
    logging.getLogger("stiffarm").setLevel(logging.ERROR)  # leftovers are expected here
    draw = random.Random(seed)  # noqa: S311 - no secret hangs on it
    failures: list[str] = []
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="stiffarm-kills-") as folder:
        base = Path(folder)
        names = list(COMMANDS)[: max(1, min(len(COMMANDS), count))]
        for number, name in enumerate(names):
            share = count // len(names) + (number < count % len(names))
            subject = _subject(name, base)
            for trial in range(share):
                wrong = _kill(subject, base / f"{name}-{trial}", draw)
                if wrong:
                    kept = out / f"{name}-{trial}"
                    shutil.rmtree(kept, ignore_errors=True)
                    with contextlib.suppress(OSError):
                        shutil.copytree(base / f"{name}-{trial}", kept, symlinks=True)
                    failures.append(f"{name}, kill {trial}: {wrong}; see {kept}")
                shutil.rmtree(base / f"{name}-{trial}", ignore_errors=True)
            failures += [f"{name}, after all kills: {wrong}" for wrong in _afterwards(subject, base)]
            print(f"kills: {name}, {share} times, {len(failures)} failed so far", file=sys.stderr, flush=True)
    return failures


def _subject(name: str, base: Path) -> Subject:
    arguments, lasting = COMMANDS[name]
    old = base / f"{name}-old"
    begun = time.monotonic()
    process = _start(arguments, old, base / f"{name}-work-old", base)
    _, err = process.communicate(timeout=PATIENCE_S)
    if process.returncode != 0:
        raise RuntimeError(f"{name} does not run even without a kill: {err}")
    (old / "mine.txt").write_text("a user's own file", encoding="utf-8")
    return Subject(name, arguments, lasting, old, time.monotonic() - begun)


def _start(arguments: tuple[str, ...], out: Path, work: Path, base: Path) -> subprocess.Popen[str]:
    words = [word.format(out=out, work=work) for word in arguments]
    return subprocess.Popen(  # noqa: S603 - our own interpreter
        [sys.executable, "-m", "stiffarm", *words],
        env={**os.environ, "PYTHONPATH": str(ROOT), "STIFFARM_CACHE": str(base / "cache")},
        cwd=base,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def _kill(subject: Subject, place: Path, draw: random.Random) -> str | None:
    """Kill the command once; what is wrong afterwards, None if nothing is."""
    place.mkdir()
    target, fresh, how = place / "out", draw.random() < FRESH, draw.choice(SIGNALS)
    if not fresh:
        shutil.copytree(subject.old, target, symlinks=True)
    process = _start(subject.arguments, target, place.parent / f"{subject.name}-work", place.parent)
    if draw.random() < AIMED:
        _until(process, lambda: any(_moving(target)))
        time.sleep(draw.random() * MOVES_S)
    else:
        moment = time.monotonic() + draw.uniform(0.0, subject.seconds)
        if how != signal.SIGKILL:
            _until(process, lambda: _heeds(process.pid))
        _until(process, lambda: time.monotonic() > moment)
    process.send_signal(how)
    _, err = process.communicate(timeout=PATIENCE_S)
    wrong = _ending(process.returncode, how, err)
    return wrong or _folder(subject, target, fresh, how, process.returncode)


def _moving(target: Path) -> Iterator[Path]:
    """Signs that results are on their way: the record of a run is written last, the journal after it."""
    yield from target.glob(JOURNAL)
    for stage in (*target.glob(".partial-*"), *target.parent.glob(".partial-*")):
        yield from stage.glob("run.json")


def _heeds(pid: int) -> bool:
    """Whether a process has its handlers: before, Python itself is starting, and answers as it likes."""
    try:
        status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    except OSError:  # gone, or another system
        return True
    caught = int(status.partition("SigCgt:")[2].split()[0], 16)
    return bool(caught >> (signal.SIGTERM - 1) & 1)


def _until(process: subprocess.Popen[str], condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while process.poll() is None and not condition():
        if time.monotonic() > end:
            process.kill()
            raise RuntimeError("the command hangs")
        time.sleep(0.0005)


def _ending(code: int, how: signal.Signals, err: str) -> str | None:
    expected = -how if how == signal.SIGKILL else 128 + how
    if code not in (0, expected):
        return f"exit code {code} after {how.name}, not {expected}: {err[-500:]}"
    if "Traceback" in err or "KeyboardInterrupt" in err:
        return f"a traceback after {how.name}: {err[-500:]}"
    if code == 128 + how and (err.splitlines()[-1:] != [LINE] or err.count(LINE) != 1):
        return f"not one line after {how.name}: {err[-500:]}"
    return None


def _folder(subject: Subject, target: Path, fresh: bool, how: signal.Signals, code: int) -> str | None:
    from robots.files.published import Stage, heal

    left = [p.name for p in (*target.glob(".partial-*"), *target.parent.glob(".partial-*"), *target.glob(JOURNAL))]
    if left and how != signal.SIGKILL:
        return f"{', '.join(left)} left after {how.name}"
    heal(target)
    if target.is_dir():
        Stage(target, fresh=False).close()
    left = [p.name for p in (*target.rglob(".*"), *target.parent.glob(".partial-*"))]
    if left:
        return f"{', '.join(left)} left after healing"
    found = _tree(target)
    old = {} if fresh else _tree(subject.old)
    if code != 0 and found == old:
        return None
    return _new(found, old, target)


def _new(found: dict[str, str], old: dict[str, str], target: Path) -> str | None:
    """What is wrong with a folder that holds a new run's results, None if nothing is."""
    if not (target / "run.json").is_file():
        return f"neither old nor new: {sorted(set(found) ^ set(old))[:5]}"
    listed = json.loads((target / "run.json").read_text(encoding="utf-8"))["outputs_sha256"]
    mixed = [name for name, sha256 in listed.items() if found.get(name) != sha256]
    if mixed:
        return f"results of two runs: {', '.join(mixed[:5])}"
    backups = {name.split("/", 2)[2]: sha256 for name, sha256 in found.items() if name.startswith("previous/")}
    replaced = {name: sha256 for name, sha256 in old.items() if name in {*listed, "run.json"}}
    lost = [name for name, sha256 in replaced.items() if backups.get(name) != sha256]
    if lost:
        return f"earlier results lost: {', '.join(lost[:5])}"
    kept = {name: sha256 for name, sha256 in old.items() if name not in replaced}
    gone = [name for name, sha256 in kept.items() if found.get(name) != sha256]
    return f"files of somebody else lost: {', '.join(gone[:5])}" if gone else None


def _afterwards(subject: Subject, base: Path) -> Iterator[str]:
    """The command once more, with what the kills have left in cache and work folder: it must tell the same."""
    target = base / f"{subject.name}-last"
    process = _start(subject.arguments, target, base / f"{subject.name}-work", base)
    _, err = process.communicate(timeout=PATIENCE_S)
    if process.returncode != 0:
        yield f"exit code {process.returncode}: {err[-500:]}"
    elif "damaged" in err:
        yield f"what was kept is damaged: {err[-500:]}"
    elif subject.lasting and (target / subject.lasting).read_bytes() != (subject.old / subject.lasting).read_bytes():
        yield f"{subject.lasting} differs from that of a run without kills"


def _tree(folder: Path) -> dict[str, str]:
    return {
        p.relative_to(folder).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in folder.rglob("*")
        if p.is_file()
    }


def main() -> int:
    """Exit 0 if no kill left anything wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.kills", description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=list(COMMANDS), action="append")
    parser.add_argument("--out", type=Path, default=Path("out/kills"))
    a = parser.parse_args()
    for name in [n for n in COMMANDS if a.only and n not in a.only]:
        del COMMANDS[name]
    failures = run(a.count, a.seed, a.out)
    for words in failures:
        print(f"FAILED {words}")
    print(f"kills: {a.count - len(failures)} passed, {len(failures)} failed")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
