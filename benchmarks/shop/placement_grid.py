"""Search for base positions against a fine grid of all of them, on three toolpaths.

    python benchmarks/shop/placement_grid.py [--step 0.02] [--json] [--write]

kr60-3 with rigid links. One evaluation is one base position looked at over the path, with all branches and 36 angles
gamma, the best of which is refined twice to 0.6 deg; the grid looks at its positions in the same way, at all points.
About its eight best positions that are not neighbours a ten times finer grid is laid.
``--write`` writes docs/validation/placement.md.
"""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

import fem
import robots
from benchmarks.asked import asked
from machining.cell import Cell, LinearAxis, Tool
from machining.cutting import ConstantForce
from machining.placement import Along, Goal, How, Placed, Problem, follow, place, space_of
from machining.placement.following import along
from machining.placement.search import Look, Looker
from machining.posture.drive import Drive
from machining.posture.points import GammaRange
from machining.task import ToolPath, tool_path
from robots import InputError
from robots.arrays import Array

HERE = Path(__file__).resolve().parent
PAGE = HERE.parents[1] / "docs" / "validation" / "placement.md"
TEXT = HERE / "placement_grid_page.md"
# Positions of the grid in one sweep.
CHUNK = 400
FEED = 0.05
# Best positions of the grid about which a finer one is laid.
ZOOMS = 8


@dataclass(frozen=True)
class Case:
    """A toolpath in a cell."""

    name: str
    path: ToolPath
    cell: Cell
    step: float


@dataclass(frozen=True)
class Row:
    """One placement of the table, in the report's units."""

    placement: str
    k_sf: float
    mean: float
    worst: float
    rms_um: float
    where: str


@dataclass(frozen=True)
class Result:
    """What one toolpath came to; merits are K_sf."""

    name: str
    points: int
    axes: str
    grid: int
    grid_merit: float
    grid_seconds: float
    search: int
    merit: float
    seconds: float
    rows: list[Row]

    @property
    def ratio(self) -> float:
        """How many times fewer positions the search looks at."""
        return self.grid / self.search

    @property
    def loss(self) -> float:
        """Share of the grid's best that the search misses; negative: the search is better."""
        return 1.0 - self.merit / self.grid_merit


def spindle() -> Array:
    T = np.eye(4)
    T[:3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    T[:3, 3] = 0.2, 0.0, 0.08
    return T


def at(x: float, y: float, z: float) -> Array:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def axis(name: str, direction: list[float], low: float, high: float) -> LinearAxis:
    return LinearAxis(name, np.array(direction), np.array([low, high]), speed=1.0, acceleration=2.0)


def pocket() -> ToolPath:
    """A flat pocket, 400 mm x 250 mm, in seven lines to and fro."""
    lines = [
        np.stack([np.linspace(-0.2, 0.2, 9)[:: 1 - 2 * (i % 2)], np.full(9, y), np.zeros(9)], axis=1)
        for i, y in enumerate(np.linspace(-0.125, 0.125, 7))
    ]
    return tool_path(np.vstack(lines), [0.0, 0.0, 1.0], feed=FEED)


def free_form() -> ToolPath:
    """A wave on a curved surface, 700 mm long, normals up to 24 deg from upright."""
    u = np.linspace(0.0, 1.0, 60)
    wave = 2.0 * np.pi * u
    points = np.stack([0.7 * (u - 0.5), 0.15 * np.sin(wave), 0.08 * np.cos(wave)], axis=1)
    normals = np.stack([0.35 * np.sin(wave), 0.25 * np.cos(0.5 * wave), np.ones(60)], axis=1)
    return tool_path(points, normals, feed=FEED)


def wing() -> ToolPath:
    """Along the skin of a wing-like part, 1.9 m long, over, and back 200 mm beside."""
    u = np.linspace(0.0, 1.0, 36)
    out = np.stack([1.9 * (u - 0.5), np.full(36, -0.1), 0.05 * np.sin(np.pi * u)], axis=1)
    back = out[::-1] + np.array([0.0, 0.2, 0.0])
    tilt = np.stack([-0.08 * np.cos(np.pi * u), np.full(36, -0.15), np.ones(36)], axis=1)
    other = tilt[::-1] * np.array([1.0, -1.0, 1.0])
    over = np.linspace(0.0, 1.0, 8)[1:-1, None]
    points = np.vstack([out, out[-1] + over * (back[0] - out[-1]), back])
    return tool_path(points, np.vstack([tilt, tilt[-1] + over * (other[0] - tilt[-1]), other]), feed=FEED)


def cases(step: float) -> list[Case]:
    tool = Tool(spindle())
    rail, cross = axis("rail", [1, 0, 0], -2.0, 2.0), axis("cross", [0, 1, 0], -0.8, 0.8)
    along = axis("rail", [0, 1, 0], -2.0, 2.0)
    long_part = at(1.1, 1.3, 0.6)
    long_part[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    return [
        Case(
            "flat pocket",
            pocket(),
            Cell("rail", T_world_part0=at(1.2, 0.2, 0.6), tool=tool, linear_axes=(rail,)),
            0.05 * step,
        ),
        Case(
            "free-form surface",
            free_form(),
            Cell("rail and cross", T_world_part0=at(1.2, 0.2, 0.6), tool=tool, linear_axes=(rail, cross)),
            step,
        ),
        Case(
            "wing-like part",
            wing(),
            Cell(
                "rail along the part",
                T_world_part0=long_part,
                tool=tool,
                linear_axes=(along, axis("lift", [0, 0, 1], -0.6, 0.6)),
            ),
            step,
        ),
    ]


def problem_of(case: Case, model: fem.ArmModel) -> Problem:
    force = ConstantForce(np.array([80.0, 40.0, -60.0]), "process")
    return Problem(model, space_of(case.cell), case.path, Goal("ksf", force), GammaRange(count=36), Drive())


def brute_force(problem: Problem, step: float) -> tuple[Look, int]:
    """Best position of a fine grid over all points of the path that can be driven, and how many there are."""
    size = problem.space.upper - problem.space.lower
    x = problem.space.grid(np.round(size / step).astype(int) + 1)
    looker = Looker(problem, lacking=False)
    rows = np.arange(problem.path.n)
    looks = [look for i in range(0, len(x), CHUNK) for look in looker.at(x[i : i + CHUNK], rows)]
    # Peaks against a limit are narrower than the grid: a ten times finer one about the best that are not neighbours.
    apart: list[Look] = []
    for look in sorted(looks, key=lambda look: look.rank, reverse=True):
        if len(apart) < ZOOMS and all(np.abs(look.x - other.x).max() > 1.5 * step for other in apart):
            apart.append(look)
    for look in apart if problem.space.d > 1 else []:
        fine = [np.linspace(-step, step, 21) + centre for centre in look.x]
        near = problem.space.inside(np.stack([g.ravel() for g in np.meshgrid(*fine)], axis=1))
        looks += looker.at(near, rows)
    for look in sorted(looks, key=lambda look: look.rank, reverse=True):
        e, table = problem.space.sites(look.x[None])
        try:
            follow(problem, e[0], float(table[0]), look.gamma)
        except InputError:
            continue
        return look, looker.count
    raise AssertionError("no position can be driven")


def row(name: str, problem: Problem, one: Along) -> Row:
    parts = []
    for axis, e in zip(problem.cell.linear_axes, one.e.T * 1e3, strict=True):
        parts.append(f"{axis.name} {e[0]:.0f}" + ("" if np.ptp(e) < 1e-3 else f" ({e.min():.0f} to {e.max():.0f})"))
    where = ", ".join(parts)
    return Row(name, one.k_sf, one.mean * 1e-3, one.worst * 1e-3, one.error_rms * 1e6, f"{where} mm")


def at_zero(problem: Problem) -> Along | None:
    """The axes at 0 with the best gamma that can be driven there: what a user has without placement. None: nothing."""
    x = np.zeros((1, problem.space.d))
    look = Looker(problem).at(x, np.arange(problem.path.n))[0]
    if not look.rank[0]:
        return None
    e, table = problem.space.sites(x)
    try:
        course = follow(problem, e[0], float(table[0]), look.gamma)
    except InputError:
        return None
    criterion = problem.goal.criterion
    assert criterion is not None
    return along(problem, np.repeat(e, problem.path.n, axis=0), float(table[0]), course, criterion)


def rows_of(placed: Placed, others: dict[str, Placed]) -> list[Row]:
    out = [] if placed.before is None else [row("before: axes at 0, gamma 0", placed.problem, placed.before)]
    usual = at_zero(placed.problem)
    if usual is not None:
        out.append(row("before: axes at 0, best gamma", placed.problem, usual))
    out.append(row("one position", placed.problem, placed.after))
    for name, other in others.items():
        out.append(row(name, other.problem, other.after))
    return out


def measure(case: Case, model: fem.ArmModel) -> Result:
    problem = problem_of(case, model)
    start = time.perf_counter()
    placed = place(problem)
    seconds = time.perf_counter() - start
    judged = replace(problem, goal=placed.problem.goal)
    start = time.perf_counter()
    best, count = brute_force(judged, case.step)
    grid_seconds = time.perf_counter() - start
    others = {
        "at most 3 positions": place(judged, How("steps", steps=3, anywhere=True)),
        "moving along the path": place(judged, How("moving")),
    }
    size = problem.space.upper - problem.space.lower
    names = ", ".join(f"{name} {length:g} m" for name, length in zip(problem.space.names, size, strict=True))
    return Result(
        case.name,
        problem.path.n,
        names,
        count,
        best.merit,
        grid_seconds,
        placed.evaluations,
        placed.after.merit,
        seconds,
        rows_of(placed, others),
    )


def page(results: list[Result]) -> str:
    head = "| toolpath | axes | grid | best K_sf | search | best K_sf | fewer by | loss |\n" + "|---" * 8 + "|\n"
    lines = [
        f"| {r.name} ({r.points} points) | {r.axes} | {r.grid} | {r.grid_merit:.4f} | {r.search} | {r.merit:.4f} "
        f"| {r.ratio:.0f} x | {100.0 * r.loss:.2f} % |"
        for r in results
    ]
    tables = []
    for r in results:
        tables.append(f"### {r.name.capitalize()}\n")
        tables.append(
            "| placement | K_sf | mean, N/mm | worst, N/mm | RMS error, um | base |\n|---|---|---|---|---|---|"
        )
        for x in r.rows:
            figures = f"{x.k_sf:.3g} | {x.mean:.0f} | {x.worst:.0f} | {x.rms_um:.1f}"
            tables.append(f"| {x.placement} | {figures} | {x.where} |")
        if not any("gamma 0" in x.placement for x in r.rows):
            other = "" if any("best gamma" in x.placement for x in r.rows) else ", nor with any other one gamma"
            tables.append(f"\nBefore: with the axes at 0 and gamma 0 the path cannot be driven{other}.")
        tables.append("")
    text = TEXT.read_text(encoding="utf-8")
    return text.replace("{{search}}", head + "\n".join(lines)).replace("{{tables}}", "\n".join(tables).rstrip())


def main() -> None:
    options = asked(__doc__, step=0.02, only=str, json=False, write=False)
    model = fem.build_model(robots.load_description("kr60-3"), links="rigid")
    results = []
    for case in cases(options.step):
        if options.only and options.only not in case.name:
            continue
        result = measure(case, model)
        results.append(result)
        if not options.json:
            print(
                f"{result.name}: grid {result.grid} ({result.grid_seconds:.0f} s) K_sf {result.grid_merit:.4f}; search "
                f"{result.search} ({result.seconds:.1f} s) K_sf {result.merit:.4f}; {result.ratio:.0f} times fewer, "
                f"loss {100.0 * result.loss:.2f} %",
                flush=True,
            )
            for x in result.rows:
                print(f"    {x}", flush=True)
    if options.json:
        print(json.dumps([asdict(r) | {"ratio": r.ratio, "loss": r.loss} for r in results], indent=2))
    if options.write:
        PAGE.write_text(page(results), encoding="utf-8")


if __name__ == "__main__":
    main()
