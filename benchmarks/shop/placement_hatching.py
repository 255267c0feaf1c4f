"""Pictures of base positions against brute force: whether shaded ones are barred and open ones are free.

    python benchmarks/shop/placement_hatching.py [--only NAME] [--step 1] [--write]

Three parts in cells with things to run into. At each position of the picture that `place` draws, all points of the path
are asked at angles gamma 1 deg apart, with every branch in every run of cuts: inverse kinematics, joint limits,
singularities, distance from everything. Nothing of the search is used. ``--write`` writes the section of
docs/validation/placement.md, and the same in its template.
"""

from __future__ import annotations

import re
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import placement_grid

import fem
import robots
from benchmarks.asked import asked
from machining.cell import Body, Cell, Fixture, arm_of, box, clearance, cylinder, read_cell, scene_of
from machining.cutting import ConstantForce
from machining.placement import Goal, Problem, follow, space_of, survey
from machining.placement.between import with_links
from machining.placement.confirming import confirmed
from machining.placement.study import MAP
from machining.posture.drive import Drive, singular_distance
from machining.posture.points import GammaRange
from machining.setup import Setup
from machining.toolpaths import read_given_path
from robots import InputError, Reason, inverse_kinematics
from robots.arrays import Array, Bools, Integers

HERE = Path(__file__).resolve().parent
EXAMPLE = HERE.parents[1] / "docs" / "examples" / "tx200_wing"
HEADING = "## The shading of the picture"
# Points of the path whose poses are solved at once.
CHUNK = 40


@dataclass(frozen=True)
class Result:
    """One picture: its open positions that brute force frees and that can be driven, its shaded ones that it bars.

    ``same_cause``: those that it bars for the cause that the picture gives.
    """

    name: str
    axes: str
    positions: int
    open: int
    open_free: int
    driven: int
    shaded: int
    shaded_barred: int
    same_cause: int
    causes: str
    seconds: float
    brute_seconds: float

    @property
    def row(self) -> str:
        """Of the page's table."""
        return (
            f"| {self.name} | {self.axes} | {self.positions} | {self.open_free} of {self.open} | {self.driven} "
            f"| {self.shaded_barred} of {self.shaded} | {self.same_cause} | {self.causes} |"
        )


def body(name: str, solid: object, x: float, y: float, z: float) -> Fixture:
    return Fixture(Body(name, (solid.moved(placement_grid.at(x, y, z)),)))  # type: ignore[attr-defined]


def problems() -> dict[str, Problem]:
    """The documented wing, and two parts of placement_grid.py with a bench, a post and a floor beside them."""
    wing = read_given_path(EXAMPLE / "wing.cls")
    cell = read_cell(EXAMPLE / "cell.toml")
    tx200 = robots.load_description("tx200")
    arm = fem.build_model(tx200, links="rigid")
    arm = arm.with_springs(dict.fromkeys(arm.robot.joint_names, 1e6))
    force = Goal("ksf", ConstantForce(np.array([0.0, 60.0, -80.0]), "process"))
    out = {"documented wing": with_links(_problem(arm, "tx200", cell, wing.path, force, wing.free), wing)}
    kr60 = fem.build_model(robots.load_description("kr60-3"), links="rigid")
    pocket, _, skin = placement_grid.cases(0.02)
    bodies = {
        "flat pocket, table and post": (
            pocket,
            (body("table", box([0.7, 0.6, 0.5]), 1.2, 0.2, 0.0), body("post", box([0.2, 0.2, 2.0]), 0.7, 0.75, 0.0)),
            {"linear_axes": (pocket.cell.linear_axes[0], placement_grid.axis("cross", [0, 1, 0], -0.8, 0.8))},
        ),
        "wing-like part, bench and mast": (
            skin,
            (body("bench", box([0.5, 2.2, 0.4]), 1.1, 1.3, 0.0), body("mast", cylinder(0.1, 2.5), 0.6, 0.6, -0.6)),
            {},
        ),
    }
    for name, (case, fixtures, more) in bodies.items():
        cutter = replace(case.cell.tool, cutter=(Body("mill", (cylinder(0.01, 0.06).moved(_down()),)),))
        cell = replace(case.cell, name=name, fixtures=fixtures, floor=-0.6, tool=cutter, safety=0.02, **more)
        force = Goal("ksf", ConstantForce(np.array([80.0, 40.0, -60.0]), "process"))
        out[name] = _problem(kr60, "kr60-3", cell, case.path, force, None)
    return out


def _down() -> Array:
    """Frame of the mill: at the tip, its z axis along the tool axis into the holder."""
    T = placement_grid.spindle()
    T[:3, :3] = T[:3, :3] @ np.diag([1.0, -1.0, -1.0])
    return T


def _problem(model: fem.ArmModel, robot: str, cell: Cell, path: object, goal: Goal, free: Bools | None) -> Problem:
    scene = scene_of(cell, arm_of(robot))
    return Problem(
        model,
        space_of(cell),
        path,
        goal,
        GammaRange(count=36),
        Setup(cell).drive(Drive()),
        scene=scene,  # type: ignore[arg-type]
        clearance=cell.safety,
        free=free,
    )


def runs_of(problem: Problem) -> list[Integers]:
    """Points of each run of cuts."""
    n = problem.path.n
    free = np.zeros(n - 1, dtype=bool) if problem.free is None else problem.free
    run = np.concatenate([[0], np.cumsum(free)])
    return [np.flatnonzero(run == k) for k in range(run[-1] + 1)]


def truth_of(problem: Problem, x: Array, gamma: Array) -> str:
    """Why a position is barred; of a program by its cuts, or with all of its moves: straight, so in one branch."""
    if problem.links is None:
        return brute_force(problem, x, gamma)
    why = brute_force(replace(problem, free=None), x, gamma)
    every = replace(problem, path=problem.links.whole.path, free=None)
    return why or ("between" if brute_force(every, x, gamma) else "")


def brute_force(problem: Problem, x: Array, gamma: Array) -> str:
    """Why a position is barred, at all points of the path, at all of the angles, with all branches; "" if it is not."""
    e, table = problem.space.sites(x[None])
    nearest = np.full(len(gamma), 4)
    for points in runs_of(problem):
        left = np.flatnonzero(nearest > 0)
        if not len(left):
            break
        rank, q = _run(problem, e[0], float(table[0]), points, gamma[left])
        for k, angle in enumerate(left):
            best = int(rank[k].max())
            for branch in np.flatnonzero(rank[k] == 4):
                best = _obstacles(problem, q[:, k, branch], e, table)
                if best == 4:
                    break
            nearest[angle] = min(nearest[angle], best)
    return ("reach", "limit", "singularity", "collision", "")[int(nearest.max())]


def _run(problem: Problem, e: Array, table: float, points: Integers, gamma: Array) -> tuple[Array, Array]:
    """Rank (g, 8) of each branch over a run: 0 out of reach, 1 beyond limits, 4 else; and its poses (m, g, 8, dof)."""
    rank, poses = np.full((len(gamma), 8), 4), []
    for start in range(0, len(points), CHUNK):
        some = points[start : start + CHUNK]
        task = problem.task_at(e, table, some)
        frames = task.tool_frames(gamma).reshape(-1, 4, 4)
        found = inverse_kinematics(problem.model.robot, frames, T_flange_tool=problem.cell.tool.T_flange_tool)
        reason = found.reason.reshape(len(some), len(gamma), 8)
        code = np.where(reason == Reason.FOUND, 4, np.where(reason == Reason.LIMITS, 1, 0))
        rank = np.minimum(rank, code.min(axis=0))
        poses.append(found.q.reshape(len(some), len(gamma), 8, -1))
        if not rank.any():
            break
    return rank, np.concatenate(poses)


def _obstacles(problem: Problem, q: Array, e: Array, table: Array) -> int:
    if (singular_distance(problem.model.robot, q) < problem.drive.singular_least).any():
        return 2
    assert problem.scene is not None
    # A few poses first: most of what collides does so over the whole run.
    for some in (q[:: max(1, len(q) // 4)], q):
        gap = clearance(problem.scene, some, e, table, within=problem.clearance + 1e-3).distance
        if (gap < problem.clearance).any():
            return 3
    return 4


def measure(name: str, problem: Problem, step: float) -> Result:
    start = time.process_time()
    picture = confirmed(survey(problem, MAP[problem.space.d]))
    seconds = time.process_time() - start
    gamma = np.radians(np.arange(-180.0, 180.0, step))
    start = time.process_time()
    truth = [truth_of(problem, look.x, gamma) for look in picture.grid]
    brute_seconds = time.process_time() - start
    for look, true in zip(picture.grid, truth, strict=True):
        if bool(look.why) != bool(true):
            print(f"    {name}: {problem.space.words(look.x)}: picture {look.why or 'open'}, truth {true or 'free'}")
    driven = sum(_drives(picture.problem, look.x, look.gamma) for look in picture.grid if not look.why)
    whys = [(look.why, true) for look, true in zip(picture.grid, truth, strict=True)]
    shaded = [pair for pair in whys if pair[0]]
    names = sorted({why for why, _ in shaded})
    size = problem.space.upper - problem.space.lower
    return Result(
        name=name,
        axes=", ".join(f"{axis} {length:g} m" for axis, length in zip(problem.space.names, size, strict=True)),
        positions=len(whys),
        open=len(whys) - len(shaded),
        open_free=sum(not why and not true for why, true in whys),
        driven=driven,
        shaded=len(shaded),
        shaded_barred=sum(bool(true) for _, true in shaded),
        same_cause=sum(why == true for why, true in shaded),
        causes=", ".join(f"{sum(why == one for why, _ in shaded)} {one}" for one in names),
        seconds=seconds,
        brute_seconds=brute_seconds,
    )


def _drives(problem: Problem, x: Array, gamma: float) -> bool:
    """Whether a course keeps joint steps and speeds as well, from point to point."""
    e, table = problem.space.sites(x[None])
    try:
        follow(problem, e[0], float(table[0]), gamma)
    except InputError:
        return False
    return True


def section(results: list[Result], step: float) -> str:
    """The section of the page."""
    head = "| part | axes | positions | open: brute force agrees | of these driven | shaded: brute force agrees "
    head += "| for the same cause | causes |\n" + "|---" * 8 + "|\n"
    agree = sum(r.open_free + r.shaded_barred for r in results)
    total = sum(r.positions for r in results)
    return (
        f"{HEADING}\n\nShaded means: no angle gamma and no branch takes the whole path from there, and why the nearest "
        f"posture does not. Brute\nforce agrees at {agree} of {total} positions of three pictures. "
        f"Run `python benchmarks/shop/placement_hatching.py --write`. At each position\nof the picture all points of "
        f"the path are asked at {360.0 / step:g} angles gamma {step:g} deg apart with all eight branches in each run "
        "of\ncuts, of the documented wing all moves of its program in one branch, with nothing of the search: inverse "
        "kinematics, joint limits, singularities, distance from the "
        'cell. "Driven": a\ncourse keeps joint speeds and steps from point to point as well. A cause is that of the '
        'posture that comes nearest; "between": its cuts are free, a move between them is not.\n\n'
        + head
        + "\n".join(r.row for r in results)
        + "\n\n"
    )


def main() -> None:
    options = asked(__doc__, step=1.0, only=str, write=False)
    results = []
    for name, problem in problems().items():
        if options.only and options.only not in name:
            continue
        results.append(measure(name, problem, options.step))
        print(f"{results[-1].row} {results[-1].seconds:.0f} s, brute {results[-1].brute_seconds:.0f} s", flush=True)
    if options.write:
        for file in (placement_grid.PAGE, placement_grid.TEXT):
            text = file.read_text(encoding="utf-8")
            without = re.sub(rf"{HEADING}\n.*?(?=\n## )\n", "", text, flags=re.S)
            before, after = without.split("## Before and after", 1)
            file.write_text(f"{before}{section(results, options.step)}## Before and after{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
