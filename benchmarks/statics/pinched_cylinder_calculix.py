"""Our quads against CalculiX's S8R on the pinched cylinder, at equal error.

    python benchmarks/statics/pinched_cylinder_calculix.py [--repeats 3] [--json]

The reference is 1.8248e-5 (tests/benchmarks/shell_problems.py). For each code the mesh is refined until its deflection
first lies within 2 %, then within 1 % of the reference; the times at those meshes are compared. Both codes get the
full cylinder: CalculiX's shells are solids inside, and symmetry conditions on their rotations give nonsense. So we do
eight times the work we need; our time for the eighth stands beside it. S8R has its mid-side nodes on the cylinder.

Ours is mesh, assembly and solution in this process, CalculiX's is its process alone: start, reading the input,
solution; the input is written, and one number printed, outside the clock. Start-up costs stand by themselves: our
imports, and CalculiX on eight elements. One thread each; the codes take turns, medians are compared.
"""

from __future__ import annotations

import os

from benchmarks.asked import asked

THREADS = 1
for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[_name] = str(THREADS)  # before NumPy is imported

import json  # noqa: E402
import statistics  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
import tempfile  # noqa: E402
import time  # noqa: E402
from collections.abc import Callable  # noqa: E402
from dataclasses import asdict, dataclass  # noqa: E402
from importlib.util import find_spec  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
for _folder in ("tests/fem", "tests/benchmarks"):
    sys.path.append(str(ROOT / _folder))

from calculix_runs import CCX, Printed, run_ccx  # noqa: E402
from shell_problems import Problem, pinched_cylinder  # noqa: E402

from benchmarks.statics.calculix.deck import PA_PER_MPA, Deck, number, with_middles  # noqa: E402
from fem.elements.assembly import freedoms  # noqa: E402
from meshes.shell_mesh import ShellMesh  # noqa: E402

RADIUS, HALF_LENGTH, WALL, E_MODULUS, POISSON = 300.0, 300.0, 3.0, 3e6, 0.3
REFERENCE = 1.8248e-5
# Elements a quarter of the circumference, and half of the length.
SIZES = (4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30, 32, 34, 36, 40, 44, 48)
ERRORS = (0.02, 0.01)


@dataclass(frozen=True)
class Row:
    """One error: sizes and deflection over reference where each code is first within it, seconds (medians)."""

    error: float
    our_size: int
    our_ratio: float
    our_s: float
    our_eighth_s: float
    ccx_size: int
    ccx_ratio: float
    ccx_s: float
    ccx_over_ours: float
    ccx_over_our_eighth: float


def full_cylinder(n: int) -> Problem:
    """The whole cylinder with two opposite unit forces, 4n x 2n quads; a node's number is ``i (2n + 1) + j``."""
    around, rows = 4 * n, 2 * n + 1
    i, j = (index.ravel() for index in np.meshgrid(np.arange(around), np.arange(rows), indexing="ij"))
    angle = 2.0 * np.pi * i / around
    nodes = np.stack([RADIUS * np.sin(angle), HALF_LENGTH * (j / n - 1.0), RADIUS * np.cos(angle)], axis=1)
    number_of = np.arange(around * rows).reshape(around, rows)
    beyond = np.roll(number_of, -1, axis=0)
    quads = np.stack([number_of[:, :-1], beyond[:, :-1], beyond[:, 1:], number_of[:, 1:]], axis=-1).reshape(-1, 4)
    mesh = ShellMesh(
        "pinched cylinder", nodes, np.zeros((0, 3), np.int64), quads, np.full(len(quads), WALL), E_MODULUS, POISSON, {}
    )
    ends, middle = np.flatnonzero((j == 0) | (j == 2 * n)), np.flatnonzero(j == n)
    fixed = np.concatenate([freedoms(ends)[:, [0, 2]].ravel(), freedoms(middle)[:, 1]])
    load = np.zeros(6 * len(nodes))
    under, opposite = number_of[0, n], number_of[2 * n, n]
    load[6 * under + 2], load[6 * opposite + 2] = -1.0, 1.0
    reading = np.zeros(6 * len(nodes))
    reading[6 * under + 2] = -1.0
    return Problem(mesh, np.unique(fixed), load, reading, REFERENCE)


def deck_of(problem: Problem) -> tuple[str, int]:
    """The full cylinder as an input of S8R, mid-side nodes on the cylinder; and the node to read."""
    mesh = with_middles(problem.mesh)
    nodes = mesh.nodes.copy()
    radius = np.hypot(nodes[:, 0], nodes[:, 2])
    nodes[:, [0, 2]] *= (RADIUS / radius)[:, None]
    deck = Deck()
    first = int(deck.nodes(nodes, "N", "the cylinder")[0])
    deck.elements("S8R", first + mesh.quads, "SHELL", "the cylinder")
    material = deck.material(PA_PER_MPA * E_MODULUS, POISSON)  # the problem has no units
    deck.section(f"*SHELL SECTION,ELSET=SHELL,MATERIAL={material}", number(WALL))
    for node, y in enumerate(nodes[:, 1].tolist(), first):
        for direction in (1, 3) if abs(abs(y) - HALF_LENGTH) < 1e-9 else (2,) if abs(y) < 1e-9 else ():
            deck.equation((node, direction), {})
    loaded = np.flatnonzero(problem.load)
    step = ["*CLOAD", *(f"{first + k // 6},{k % 6 + 1},{number(problem.load[k])}" for k in loaded.tolist())]
    under = first + int(np.flatnonzero(problem.reading)[0]) // 6
    deck.node_set([under], "UNDER", "under the force")
    return deck.text(["pinched cylinder"], [*step, "*NODE PRINT,NSET=UNDER", "U"]), under


def run_deck(n: int, folder: Path) -> tuple[float, Printed]:
    """Deflection over reference by CalculiX, and its run."""
    text, node = deck_of(full_cylinder(n))
    printed = run_ccx(text, folder, THREADS)
    return -float(printed.displacements[node][2]) / REFERENCE, printed


def first_within(error: float, ratio: Callable[[int], float]) -> tuple[int, float]:
    """The first size whose deflection is that near to the reference."""
    for n in SIZES:
        found = ratio(n)
        if abs(found - 1.0) <= error:
            return n, found
    raise RuntimeError(f"no mesh up to {SIZES[-1]} is within {error:.0%}")


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def compare(error: float, repeats: int, folder: Path) -> Row:
    ours, our_ratio = first_within(error, lambda n: full_cylinder(n).ratio())
    eighth, _ = first_within(error, lambda n: pinched_cylinder(n, "quad").ratio())
    theirs, their_ratio = first_within(error, lambda n: run_deck(n, folder)[0])
    text, _ = deck_of(full_cylinder(theirs))
    times = [
        (
            seconds(lambda: full_cylinder(ours).ratio()),
            seconds(lambda: pinched_cylinder(eighth, "quad").ratio()),
            run_ccx(text, folder, THREADS).seconds,
        )
        for _ in range(repeats)
    ]
    full_s, eighth_s, ccx_s = (statistics.median(column) for column in zip(*times, strict=True))
    return Row(error, ours, our_ratio, full_s, eighth_s, theirs, their_ratio, ccx_s, ccx_s / full_s, ccx_s / eighth_s)


def start_up(folder: Path, repeats: int) -> dict[str, float]:
    """What each code costs before it does anything, s (medians)."""
    imports = [sys.executable, "-c", "import fem.elements.assembly, fem.elements.condensation"]
    ours = [
        seconds(lambda: subprocess.run(imports, cwd=ROOT, check=True, timeout=120))  # noqa: S603 - our interpreter
        for _ in range(repeats)
    ]
    theirs = [run_deck(1, folder)[1].seconds for _ in range(repeats)]
    return {"our_start_s": statistics.median(ours), "ccx_start_s": statistics.median(theirs)}


def main() -> None:
    arguments = asked(__doc__, repeats=3, json=False)
    if CCX is None:
        sys.stdout.write("skipped: CalculiX (ccx) is not installed\n")
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        solver = run_deck(1, folder)[1].solver
        head = start_up(folder, arguments.repeats)
        rows = [compare(error, arguments.repeats, folder) for error in ERRORS]
    ours = next(module for module in ("pypardiso", "sksparse", "scipy") if find_spec(module))
    if arguments.json:
        content = {"threads": THREADS, "our_solver": ours, "ccx_solver": solver, **head}
        json.dump({**content, "rows": [asdict(row) for row in rows]}, sys.stdout, indent=2)
        sys.stdout.write("\n")
        return
    sys.stdout.write(f"full pinched cylinder, {THREADS} thread; our solver {ours}, CalculiX's {solver}\n")
    sys.stdout.write(f"start-up: our imports {head['our_start_s']:.2f} s, CalculiX {head['ccx_start_s']:.2f} s\n")
    for row in rows:
        sys.stdout.write(
            f"within {row.error:.0%}: ours n = {row.our_size} ({row.our_ratio:.4f}) {row.our_s:.2f} s, "
            f"an eighth of it {row.our_eighth_s:.3f} s; CalculiX n = {row.ccx_size} ({row.ccx_ratio:.4f}) "
            f"{row.ccx_s:.2f} s; ratio {row.ccx_over_ours:.1f}, to the eighth {row.ccx_over_our_eighth:.0f}\n"
        )


if __name__ == "__main__":
    main()
