"""How long commands take to start: processor time, as a ratio to `python -c "import numpy"` in the same run.

``python benchmarks/start_time.py`` prints a table; ``--write`` puts it into docs/performance/start.md. Each command is
a process of its own; the least of some runs counts, which other work on the machine disturbs least. A ratio to a named
peer stays comparable between machines. OMP_NUM_THREADS=1.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.asked import asked

ROOT = next(folder for folder in Path(__file__).resolve().parents if (folder / "pyproject.toml").is_file())
PAGE = ROOT / "docs" / "performance" / "start.md"
PEER = ("-c", "import numpy")
POSE = "q2_deg=5,q3real_deg=77.5"
WHY = (
    "A command imports only what it uses: packages load a module when one of its names is first used, and the list of\n"
    "commands needs none of them. `tests/stiffarm/session/test_start.py` checks which modules each command loads."
)
COMMANDS = (
    ("--help",),
    ("--version",),
    ("robots",),
    ("query", "SURROGATE", "--pose", POSE),
    ("simulate", "xr701", "--pose", POSE, "--load", "fz_N=-650"),
    ("index", "kr60-3", "--pose", "q1_deg=10,q2_deg=-60,q3_deg=40,q5_deg=40", "--tool", "200,0,80,0,90,0"),
)


def processor_time(arguments: tuple[str, ...], runs: int) -> float:
    """Least user and system time (s) of a Python process with these arguments."""
    return min(_one(arguments) for _ in range(runs))


def _one(arguments: tuple[str, ...]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(  # noqa: S603 - our own interpreter
        [sys.executable, *arguments], check=True, capture_output=True, cwd=ROOT, env=environment()
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (after.ru_utime - before.ru_utime) + (after.ru_stime - before.ru_stime)


def environment() -> dict[str, str]:
    return {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}


def table(runs: int) -> list[str]:
    """Lines of a table: each command with its time and its ratio to the peer."""
    peer = processor_time(PEER, runs)
    lines = ["| command | processor time, s | times `import numpy` |", "|---|---|---|"]
    lines.append(f'| `python -c "import numpy"` | {peer:.2f} | 1 |')
    with tempfile.TemporaryDirectory() as folder:
        _one(("-m", "stiffarm", "fit", "xr701", "--runs", "512", "--out", folder))
        for command in COMMANDS:
            arguments = [str(Path(folder) / "surrogate.json") if word == "SURROGATE" else word for word in command]
            seconds = processor_time(("-m", "stiffarm", *arguments), runs)
            words = " ".join(command).replace("SURROGATE", "surrogate.json")
            lines.append(f"| `stiffarm {words}` | {seconds:.2f} | {seconds / peer:.1f} |")
    return lines


def main() -> None:
    options = asked(__doc__, runs=5, write=False)
    text = "\n".join(table(options.runs))
    print(text)
    if options.write:
        PAGE.write_text(
            "# How long commands take to start\n\n"
            "`stiffarm --help` takes three times the processor time of `import numpy`, a query eight times, one pose "
            "with `simulate` or\n`index` nine to ten times.\n"
            "\nMeasured by `python benchmarks/start_time.py --write`: user and "
            f"system time of a process, least of {options.runs} runs.\n\n{text}\n\n{WHY}\n",
            encoding="utf-8",
        )


if __name__ == "__main__":
    main()
