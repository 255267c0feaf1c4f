"""What a default import makes of the links' outer surfaces and masses, over the truth, by direction.

    python -m benchmarks.links.surfaces FOLDER
    python -m benchmarks.links.compare FOLDER [--cases b,d] [--variants skin,open] [--links shell] [--page PAGE.md]
        [--csv FILE.csv] [--import=--wall-mm=8]

Each URDF goes through ``stiffarm import`` as a user's would, and the model that it writes through ``build_model``. The
ratio of both flexibilities is taken along the truth's principal directions, where rotations count as lengths at the
link's own; ``worst`` is over all loads, not only those six.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from benchmarks.links.surfaces import CASES, VARIANTS
from benchmarks.links.truth import directions, read_truth
from fem import build_model
from robots import load_description

# Of warnings in the table.
LONGEST = 160


@dataclass(frozen=True)
class Ratio:
    """Flexibility over truth: along six principal directions (softest last), and the extremes over all loads."""

    along: NDArray[np.float64]
    worst: tuple[float, float]

    @property
    def mean(self) -> float:
        """Geometric mean over the directions."""
        return float(np.exp(np.log(self.along).mean()))

    def __str__(self) -> str:
        return f"{self.mean:.2f} ({self.along.min():.2f} to {self.along.max():.2f})"


def ratio_to_truth(C: NDArray[np.float64], name: str) -> Ratio:
    """A link's flexibility (6, 6) at its tip, in its own frame, over the truth's."""
    case, truth = CASES[name], np.array(read_truth()[name]["flexibility"])
    length = 1e-3 * math.dist(case.root.point, case.tip.point)
    values, vectors = directions(truth, length)
    scale = np.diag([1.0, 1.0, 1.0, length, length, length])
    along = np.einsum("ij,ik,kj->j", vectors, scale @ C @ scale, vectors) / values
    extremes = scipy.linalg.eigh(scale @ C @ scale, scale @ truth @ scale, eigvals_only=True)
    return Ratio(along, (float(extremes[0]), float(extremes[-1])))


@dataclass(frozen=True)
class Outcome:
    """Of one import: ratio or None where it was refused, warnings or the refusal, seconds."""

    name: str
    ratio: Ratio | None
    words: tuple[str, ...]
    seconds: float


def imported(urdf: Path, name: str, links: str, options: list[str]) -> Outcome:
    """Import a URDF in a process of its own and compare its link with the truth."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "model"
        command = [sys.executable, "-m", "stiffarm", "import", str(urdf), "--out", str(out), *options]
        done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
        if done.returncode:
            return Outcome(urdf.parent.name, None, (f"refused: {done.stderr.strip()}",), time.perf_counter() - start)
        found = json.loads((out / "import.json").read_text())
        warnings = tuple(line for link in found["links"] for line in link["warnings"])
        model = build_model(load_description(str(out / "model.toml")), links=links)  # type: ignore[arg-type]
    ratio = ratio_to_truth(model.links[0].element.flexibility, name)
    return Outcome(urdf.parent.name, ratio, warnings, time.perf_counter() - start)


def table(outcomes: list[Outcome]) -> str:
    """Markdown."""
    lines = ["| link | flexibility over truth | over all loads | said |", "|---|---|---|---|"]
    for one in outcomes:
        said = " ".join("; ".join(one.words).split())
        said = said if len(said) <= LONGEST else f"{said[:LONGEST]} ..."
        ratio = "-" if one.ratio is None else str(one.ratio)
        worst = "-" if one.ratio is None else "{:.2f} to {:.2f}".format(*one.ratio.worst)
        lines.append(f"| {one.name} | {ratio} | {worst} | {said.replace('|', '/')} |")
    return "\n".join(lines) + "\n"


def as_csv(outcomes: list[Outcome]) -> str:
    """The same for pages to be checked against: of each link the mean and the extremes, and what it is warned of."""
    lines = ["link,mean,least,most,least_over_all_loads,most_over_all_loads,said"]
    for one in outcomes:
        r, said = one.ratio, '"' + " ".join(" ".join(one.words).split()).replace('"', "'") + '"'
        figures = (
            ("",) * 5 if r is None else tuple(f"{x:.4f}" for x in (r.mean, r.along.min(), r.along.max(), *r.worst))
        )
        lines.append(",".join((one.name, *figures, said)))
    return "\n".join(lines) + "\n"


def main() -> None:
    """Import, compare, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", default=",".join(CASES))
    parser.add_argument("--variants", default=",".join(VARIANTS))
    parser.add_argument("--links", default="shell")
    parser.add_argument("--page", type=Path, help="file for the table")
    parser.add_argument("--csv", type=Path, help="file for the figures")
    parser.add_argument(
        "--import", dest="options", action="append", default=[], help="option of import, --import=--x=y"
    )
    given = parser.parse_args()
    outcomes = []
    for variant in given.variants.split(","):
        for name in given.cases.split(","):
            one = imported(given.folder / f"{name}_{variant}" / "link.urdf", name, given.links, given.options)
            outcomes.append(one)
            print(f"{one.name}: {one.ratio or 'refused'}, {one.seconds:.0f} s", *one.words, sep="\n  ", flush=True)
    print(table(outcomes))
    if given.page is not None:
        given.page.write_text(table(outcomes))
    if given.csv is not None:
        given.csv.write_text(as_csv(outcomes))


if __name__ == "__main__":
    main()
