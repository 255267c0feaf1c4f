"""How many times as fast as the usual alternative: one table from the pages that measured it.

``python benchmarks/performance_ratios.py`` prints the page; ``--write`` puts it into docs/performance/index.md. Nothing
is measured here: each ratio is read from a row of the page that its own benchmark wrote, named in the table's last
columns. A row or a sentence that is no longer there is an error, so that no ratio outlives its measurement.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.asked import asked

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE = DOCS / "performance" / "index.md"


@dataclass(frozen=True)
class Ratio:
    """One line of the table.

    ``column`` begins a heading of a table of ``page``; ``rows`` are words that all stand in a row, and the ratio is
    the least to the greatest of the rows found. ``parts``: of several figures in a cell the first over the second.
    ``sentence`` instead is a pattern whose group is the ratio.
    """

    what: str
    peer: str
    page: str
    command: str
    column: str = ""
    rows: tuple[str, ...] = ()
    parts: tuple[int, int] | None = None
    sentence: str = ""


CALIBRATION = ("performance/calibration.md", "benchmarks/calibration/calibration_speed.py")
PUBLIC_CALIBRATION = ("performance/calibration.md", "benchmarks/calibration/public_calibration.py")
SCIPY = "`scipy.optimize.least_squares`, numerical derivatives"
MAPS = ("performance/maps.md", "benchmarks/statics/map_speed.py")
INDICES = ("performance/indices.md", "benchmarks/shop/index_speed.py")
QUERIES = ("performance/queries.md", "benchmarks/surrogates/public_query.py")
PIPELINE = "scikit-learn's pipeline of the sixth degree, without intervals"
BEFORE, DIAGNOSIS = (
    "stiffarm before (39cd3a33)",
    (
        "performance/diagnosis.md",
        "python -m benchmarks.worlds.screws make SETS --seed 77 --single 10 --none 0 --outside 0 --pairs 0`, "
        "then `python -m benchmarks.diagnosis.study SETS",
    ),
)
PINCHED = ("validation/calculix.md", "benchmarks/statics/pinched_cylinder_calculix.py")

FASTER = (
    Ratio(
        "`calibrate`, 1000 set-ups of Z: with noise, outliers, intervals, poses left out",
        f"{SCIPY}, without them",
        *PUBLIC_CALIBRATION,
        "times as fast",
        ("1000 set-ups, Z |",),
    ),
    Ratio(
        "`calibrate`, 1000 set-ups of X, Y and Z",
        f"{SCIPY}, without them",
        *PUBLIC_CALIBRATION,
        "times as fast",
        ("1000 set-ups, XYZ |",),
    ),
    Ratio(
        "`calibrate`, 20 000 set-ups of Z",
        f"{SCIPY}, without them",
        *PUBLIC_CALIBRATION,
        "times as fast",
        ("20000 set-ups, Z |",),
    ),
    Ratio("Sobol screening, 12 288 runs", "one model run after another", *CALIBRATION, "ratio", ("Sobol",)),
    Ratio(
        "calibration from 10 000 positions",
        SCIPY,
        "validation/positions.md",
        "benchmarks/absolute/position_speed.py",
        sentence=r"for 10000 poses, (\d+) times as long",
    ),
    Ratio(
        "diagnosis of 27 poses, repeats: processor time",
        BEFORE,
        *DIAGNOSIS,
        "processor time",
        ("four repeats",),
        parts=(0, 1),
    ),
    Ratio("the same: memory", BEFORE, *DIAGNOSIS, "largest memory", ("four repeats",), parts=(0, 1)),
    Ratio(
        "diagnosis of 27 poses, no repeats: processor time",
        BEFORE,
        *DIAGNOSIS,
        "processor time",
        ("no repeats",),
        parts=(0, 1),
    ),
    Ratio("the same: memory", BEFORE, *DIAGNOSIS, "largest memory", ("no repeats",), parts=(0, 1)),
    Ratio("6 x 6 compliance of a million poses", "numpy, batched", *MAPS, "numpy", ("beam",)),
    Ratio("6 x 6 compliance of a million poses", "direct stiffness, batched", *MAPS, "direct stiffness", ("beam",)),
    Ratio("the same, rigid links", "pinocchio's Jacobian, pose by pose", *MAPS, "pinocchio, pose", ("rigid", "serial")),
    Ratio(
        "the same, rigid links",
        "pinocchio's Jacobians stored in a loop, then numpy",
        *MAPS,
        "in a loop",
        ("rigid", "serial"),
    ),
    Ratio("the same, rigid links", "that numpy alone, Jacobians for nothing", *MAPS, "stored", ("rigid", "serial")),
    Ratio(
        "k_fs over points, gamma and branches, 1 thread",
        "pinocchio's Jacobian and numpy, pose by pose",
        *INDICES,
        "times as fast as pose by pose",
        ("compiled, 1 thread",),
    ),
    Ratio(
        "k_fs over points, gamma and branches, 1 thread",
        "pinocchio's Jacobians stored in a loop, then numpy",
        *INDICES,
        "as Jacobians in a loop",
        ("compiled, 1 thread",),
    ),
    Ratio("map of an index, 1500 points x 72 gamma", "numpy", *INDICES, "ratio", ("map, 1500",)),
    Ratio(
        "stiffest or softest pose at every point of a slice",
        "our earlier search, each point separately; recorded, not run again",
        "performance/slices.md",
        "benchmarks/statics/slice_speed.py",
        "times as fast",
        ("%",),
    ),
    Ratio("`Surrogate.query` with 95 % intervals: polynomial", PIPELINE, *QUERIES, "times as fast", ("polynomial |",)),
    Ratio("the same of a calibrated arm", PIPELINE, *QUERIES, "times as fast", ("calibrated arm |",)),
    Ratio("the same, factored basis", PIPELINE, *QUERIES, "times as fast", ("factored |",)),
    Ratio(
        "base positions evaluated until the best is found",
        "a fine grid of all",
        "validation/placement.md",
        "benchmarks/shop/placement_grid.py",
        sentence=r"with (\d+ to \d+) times fewer evaluations",
    ),
    Ratio(
        "all indices of a pose from the service",
        "`stiffarm index`, a process a pose",
        "performance/service.md",
        "benchmarks/shop/serve_speed.py",
        sentence=r"takes [\d.]+ s, (\d+) times as long",
    ),
    Ratio("pinched cylinder within 1 % of the reference", "CalculiX, S8R", *PINCHED, "ratio", ("1 % |",)),
)
SLOWER = (
    Ratio(
        "`calibrate`, 20 000 set-ups of X, Y and Z",
        f"{SCIPY}, without noise, intervals and poses left out",
        *PUBLIC_CALIBRATION,
        sentence=r"with X, Y and Z it takes ([\d.]+) times as long",
    ),
    Ratio(
        "`ik` asked of the service over a pipe: eight branches, limits, reasons",
        "pinocchio in the asking process: one branch, no limits",
        "performance/service.md",
        "benchmarks/shop/serve_speed.py",
        sentence=r"over the pipe takes ([\d.]+) times that",
    ),
    Ratio(
        "`stiffarm --help`",
        '`python -c "import numpy"`',
        "performance/start.md",
        "benchmarks/start_time.py",
        "times `import numpy`",
        ("--help",),
    ),
    Ratio(
        "`stiffarm query`, one pose",
        '`python -c "import numpy"`',
        "performance/start.md",
        "benchmarks/start_time.py",
        "times `import numpy`",
        ("stiffarm query",),
    ),
    Ratio(
        "`stiffarm simulate`, one pose",
        '`python -c "import numpy"`',
        "performance/start.md",
        "benchmarks/start_time.py",
        "times `import numpy`",
        ("stiffarm simulate",),
    ),
)

# The pages behind the table: file, title, what it answers.
DETAILS = (
    (
        "calibration",
        "Calibration and screening",
        "A calibration, its intervals and a screening, compared with plain least squares.",
    ),
    ("diagnosis", "A diagnosis", "Processor time and memory of a diagnosis, compared with the previous version."),
    (
        "indices",
        "Indices over planes and angles",
        "k_fs at every point, angle and branch, compared with Jacobians from pinocchio.",
    ),
    (
        "maps",
        "Maps",
        "A million poses with the full 6 x 6 compliance, compared with numpy, direct stiffness and pinocchio.",
    ),
    (
        "slices",
        "Slices of extreme poses",
        "The stiffest pose at every point, compared with searching each point separately.",
    ),
    ("queries", "Queries of a surrogate", "Queries per second, compared with scikit-learn."),
    ("toolpaths", "A tool path of 1e5 points", "Seconds and memory from the CLS file to verified programs."),
    ("start", "Starting", "Processor time until a command answers, compared with `import numpy`."),
    ("service", "The service for postprocessors", "Milliseconds per answer, compared with one process per point."),
)


HEAD = """# Performance

How many times as fast stiffarm is as the usual alternative. Each ratio was measured in one run with its peer, unless
its row says otherwise. The times, all from one machine, are on the pages behind the table.
"""
NOTE = """A range covers the rows of its page: several arms, or several cases. For memory the ratio is how many times
less, for base positions how many times fewer. Rows with *before* compare stiffarm with its earlier self; all others
with a program that anyone can install, or with the plain method.
"""


def tables(text: str) -> Iterable[list[list[str]]]:
    """Tables of a page, each as rows of cells; the first row is the heading."""
    for block in re.findall(r"(?:^\|.*\n?)+", text, re.MULTILINE):
        rows = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in block.splitlines()]
        yield [rows[0], *rows[2:]]


def ratio(r: Ratio, text: str) -> str:
    """What the page says: its own words, or the least to the greatest of its rows in two figures."""
    if not r.sentence:
        values = ratios(r, text)
        return " to ".join(dict.fromkeys(_two(x) for x in (min(values), max(values))))
    found = re.search(r.sentence, " ".join(text.split()))
    if found is None:
        raise SystemExit(f"{r.page}: no sentence '{r.sentence}'")
    return found[1]


def ratios(r: Ratio, text: str) -> list[float]:
    """The figures of the rows that are meant."""
    out: list[float] = []
    for heading, *rows in tables(text):
        column = next((k for k, cell in enumerate(heading) if cell.startswith(r.column)), None)
        if column is not None:
            out += [value for row in rows if _meant(r, row) for value in _figures(r, row[column])]
    if not out:
        raise SystemExit(f"{r.page}: no row with {r.rows} under '{r.column}'")
    return out


def _meant(r: Ratio, row: list[str]) -> bool:
    line = f"| {' | '.join(row)} |"
    return all(word in line for word in r.rows)


def _figures(r: Ratio, cell: str) -> list[float]:
    """Figures of a cell, thousands closed up: one or a range; of ``parts`` the first over the second."""
    figures = [float(x) for x in re.findall(r"\d+(?:\.\d+)?", re.sub(r"(?<=\d) (?=\d{3}\b)", "", cell))]
    if r.parts is not None:
        return [figures[r.parts[0]] / figures[r.parts[1]]]
    return figures


def _two(x: float) -> str:
    rounded = float(f"{x:.2g}")
    return f"{rounded:.0f}" if rounded >= 10 else f"{rounded:.1f}"


def lasts(text: str) -> str:
    """How far the page says that its ratios repeat."""
    said = re.search(r"to within a (\w+)", " ".join(text.split()))
    return f"a {said[1]}" if said else "not stated"


def lines(rows: Iterable[Ratio], heading: str) -> list[str]:
    out = [f"| what | against | {heading} | repeats to within | measured on | repeat |", "|---|---|---|---|---|---|"]
    for r in rows:
        text = (DOCS / r.page).read_text(encoding="utf-8")
        title = re.findall(r"^# (.+)$", text, re.MULTILINE)[0]
        link = r.page.removeprefix("performance/") if r.page.startswith("performance/") else f"../{r.page}"
        command = r.command if r.command.startswith("python") else f"python {r.command}"
        out.append(f"| {r.what} | {r.peer} | {ratio(r, text)} | {lasts(text)} | [{title}]({link}) | `{command}` |")
    return out


def page() -> str:
    """docs/performance/index.md."""
    out = [HEAD]
    out += [*lines(FASTER, "times as fast"), ""]
    out += [NOTE]
    out += ["## Where it takes longer", "", *lines(SLOWER, "times as long"), ""]
    out += ["## The pages behind it", "", "| page | what it answers |", "|---|---|"]
    out += [f"| [{title}]({name}.md) | {answers} |" for name, title, answers in DETAILS]
    out += ["", "Written by `python benchmarks/performance_ratios.py --write` from those pages.", ""]
    out += ["```{toctree}", ":hidden:", "", *(name for name, *_ in DETAILS), "```", ""]
    return "\n".join(out)


def main() -> None:
    if asked(__doc__, write=False).write:
        PAGE.write_text(page(), encoding="utf-8")
    else:
        sys.stdout.write(page())


if __name__ == "__main__":
    main()
