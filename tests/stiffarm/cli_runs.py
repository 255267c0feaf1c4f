"""Running the command line in tests: in this process and in processes of their own."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from typer.testing import CliRunner

from stiffarm.cli import app

ROOT = Path(__file__).resolve().parents[2]
# What a robot's maker might call it, or an attacker.
HOSTILE_TITLE = "<script>alert('x')</script> & \"Arm $10\" $x_{ [/b]"
HOSTILE_NOTE = "<img src='https://example.org/x.png'> {{ 7 * 7 }} </details>"


@dataclass(frozen=True)
class Outcome:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """What stdout holds, which must be one JSON document and nothing else."""

        def refuse(name: str) -> None:
            raise ValueError(f"{name} is no JSON number")

        return json.loads(self.out, parse_constant=refuse)


Command = Callable[..., Outcome]


def row_of(rows: Sequence[Mapping[str, Any]], **labels: str) -> Mapping[str, Any]:
    """The row of a table of a result that has these labels."""
    return next(row for row in rows if all(row[key] == text for key, text in labels.items()))


def run_here(*arguments: str | Path) -> Outcome:
    """Run a command in this process: quick, and it may be monkeypatched."""
    result = CliRunner().invoke(app, [str(a) for a in arguments], prog_name="stiffarm")
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return Outcome(result.exit_code, result.stdout, result.stderr)


def environment(**more: str) -> dict[str, str]:
    """An environment in which another process sees this tree's packages."""
    return {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8", **more}


def start(
    arguments: Sequence[str | Path], env: Mapping[str, str] | None = None, stdout: int | IO[str] = subprocess.PIPE
) -> subprocess.Popen[str]:
    """Start a command as a process of its own, with Ctrl-C as a shell gives it to a command."""
    return subprocess.Popen(  # noqa: S603 - our own interpreter
        [sys.executable, "-m", "stiffarm", *map(str, arguments)],
        env=environment() if env is None else env,
        stdin=subprocess.DEVNULL,
        stdout=stdout,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        preexec_fn=heed_ctrl_c,
    )


def heed_ctrl_c() -> None:
    """Undo what a test run in the background may hand down: that SIGINT is ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def run_apart(*arguments: str | Path, env: Mapping[str, str] | None = None) -> Outcome:
    """Run a command as a user does."""
    process = start(arguments, env)
    out, err = process.communicate(timeout=600)
    return Outcome(process.returncode, out, err)


def tree(folder: Path) -> dict[str, str]:
    """Every file below a folder with the hash of its content, and every folder."""
    return {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() if p.is_file() else "folder"
        for p in folder.rglob("*")
    }


@dataclass(frozen=True)
class FullRun:
    """A whole ``stiffarm run`` and its folder."""

    outcome: Outcome
    folder: Path

    @property
    def results(self) -> Any:
        """results.json."""
        return json.loads((self.folder / "results.json").read_text(encoding="utf-8"))

    @property
    def report(self) -> str:
        """report.html."""
        return (self.folder / "report.html").read_text(encoding="utf-8")
