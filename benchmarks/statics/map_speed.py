"""The full 6 x 6 compliance of a million poses: compiled, batched statics, direct stiffness, pinocchio; in one run.

    python benchmarks/statics/map_speed.py [--poses 1000000] [--rounds 5] [--json] [--write]

The ways take turns, so that a busy machine slows all of them; the least time of each counts: seconds of the processor
for what runs on one thread, seconds by the clock for the rest. Needs pinocchio and numba. ``--write`` writes
docs/performance/maps.md.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

import fem
from benchmarks.asked import asked
from benchmarks.shop.index_speed import Pinocchio, rounds_of
from fem.compiled.compliance import FEWEST, why_not_compiled
from fem.model import LinkKind
from fem.reference import direct
from fem.statics import flexibility
from robots import LoadPath, load_description
from robots.arrays import Array
from robots.threads import default_threads

HERE = Path(__file__).resolve().parent
PAGE = HERE.parents[1] / "docs" / "performance" / "maps.md"
TEXT = HERE / "map_speed_page.md"
Work = Callable[[], Array]

CASES: tuple[tuple[str, LoadPath, LinkKind], ...] = (
    ("xr701", "parallelogram", "beam"),
    ("xr701", "parallelogram", "rigid"),
    ("kr60-3", "serial", "beam"),
    ("kr60-3", "serial", "rigid"),
    ("tx200", "serial", "beam"),
    ("tx200", "serial", "rigid"),
)
# Poses that the slower ways are timed on.
BATCHED, PEER, DIRECT = 100_000, 20_000, 1_000
# Poses a block of a map that is written block by block.
MAP_BLOCK = 3_200
# Compliances about the joint axes, rad/(N m): the same in all arms, so that none is rigid.
SPRINGS = (2e-7, 4e-7, 5e-7, 2e-6, 2e-6, 4e-6)

ONE, TWO, BLOCKS = "compiled, 1 thread", "compiled, 2 threads", "compiled, 1 thread, in blocks"
NUMPY, STIFFNESS = "numpy", "batched direct stiffness"
BY_POSE, LOOP, STORED = (
    "pinocchio: Jacobian and numpy, pose by pose",
    "pinocchio: Jacobians in a loop, then numpy for all",
    "pinocchio: that numpy alone, Jacobians for nothing",
)


@dataclass(frozen=True)
class Way:
    """Least seconds over the rounds for ``count`` poses; how far C is off, of sqrt(C_ii C_jj)."""

    name: str
    seconds: float
    count: int
    differ: float

    @property
    def each(self) -> float:
        """Seconds a pose."""
        return self.seconds / self.count


@dataclass(frozen=True)
class Case:
    """One arm: what was measured."""

    robot: str
    path: str
    links: str
    ways: list[Way]

    def ratio(self, peer: str, ours: str) -> float:
        """How many times as fast ``ours`` is, a pose; NaN without that peer."""
        each = {w.name: w.each for w in self.ways}
        return each.get(peer, np.nan) / each[ours]


def arm(robot: str, path: LoadPath, links: LinkKind) -> fem.ArmModel:
    model = fem.build_model(load_description(robot), links=links, load_path=path)
    return model.with_springs(dict(zip(model.robot.joint_names, 1.0 / np.array(SPRINGS), strict=True)))


def poses(model: fem.ArmModel, n: int) -> Array:
    """Reachable poses, drawn at random with seed 0, n of them."""
    rng, found = np.random.default_rng(0), np.empty((0, model.robot.dof))
    while len(found) < n:
        q = rng.uniform(model.robot.limits[:, 0], model.robot.limits[:, 1], (n, model.robot.dof))
        found = np.concatenate([found, q[model.robot.reachable(q)]])
    return found[:n]


def in_blocks(model: fem.ArmModel, q: Array) -> Array:
    """A map that is used up block by block: one array for all blocks. The last block is the result."""
    out = np.empty((MAP_BLOCK, 6, 6))
    last = out
    for start in range(0, len(q), MAP_BLOCK):
        some = q[start : start + MAP_BLOCK]
        last = fem.compliance(model, some, threads=1, out=out[: len(some)])
    return last


class Peer(Pinocchio):
    """C = J K^-1 J^T with pinocchio's Jacobian, all six rows."""

    def pose_by_pose(self, theta: Array) -> Array:
        """(n, 6, 6), each pose in turn."""
        pin, model, data, tip, C = self.pin, self.model, self.data, self.tip, np.diag(SPRINGS)
        axes, out = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, np.empty((len(theta), 6, 6))
        for i in range(len(theta)):
            J = pin.computeFrameJacobian(model, data, theta[i], tip, axes)
            out[i] = J @ C @ J.T
        return out

    def jacobians(self, theta: Array) -> Array:
        """Jacobians (n, 6, dof) in a loop."""
        pin, model, data, tip = self.pin, self.model, self.data, self.tip
        axes, J = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, np.empty((len(theta), 6, 6))
        for i in range(len(theta)):
            J[i] = pin.computeFrameJacobian(model, data, theta[i], tip, axes)
        return J

    def loop_then_numpy(self, theta: Array) -> Array:
        """The products for all poses of a block at once; the last block is the result."""
        last = np.empty((0, 6, 6))
        for start in range(0, len(theta), MAP_BLOCK):
            last = compliance_of(self.jacobians(theta[start : start + MAP_BLOCK]))
        return last


def compliance_of(J: Array) -> Array:
    """(n, 6, 6) by blocks from Jacobians (n, 6, dof); the last block is the result."""
    last = np.empty((0, 6, 6))
    for start in range(0, len(J), MAP_BLOCK):
        some = J[start : start + MAP_BLOCK]
        last = (some * np.array(SPRINGS)) @ some.swapaxes(1, 2)
    return last


def difference(a: Array, b: Array) -> float:
    size = np.sqrt(np.einsum("nii->ni", b))
    return float((np.abs(a - b) / (size[:, :, None] * size[:, None, :])).max())


def measure(robot: str, path: LoadPath, links: LinkKind, n: int, rounds: int) -> Case:
    model = arm(robot, path, links)
    assert why_not_compiled(model) is None
    q = poses(model, n)
    jobs: dict[str, tuple[Work, int]] = {
        ONE: (partial(fem.compliance, model, q, threads=1), n),
        TWO: (partial(fem.compliance, model, q, threads=2), n),
        BLOCKS: (partial(in_blocks, model, q), n),
        NUMPY: (partial(flexibility.compliance, model, q[:BATCHED]), min(n, BATCHED)),
        STIFFNESS: (partial(direct.compliance, model, q[:DIRECT]), min(n, DIRECT)),
    }
    if links == "rigid" and path == "serial":
        peer = Peer(importlib.import_module("pinocchio"), model.robot, model.robot.T_flange_tool[:3, 3])
        theta = peer.theta(q[:PEER])
        J = peer.jacobians(theta)
        jobs |= {
            BY_POSE: (partial(peer.pose_by_pose, theta), len(theta)),
            LOOP: (partial(peer.loop_then_numpy, theta), len(theta)),
            STORED: (partial(compliance_of, J), len(theta)),
        }
    differ = {}
    for name, (work, count) in jobs.items():
        C = work()[-BATCHED:]  # the first run also loads and compiles what it needs
        differ[name] = difference(C, flexibility.compliance(model, q[count - len(C) : count]))
        assert differ[name] < 1e-6
    least = rounds_of({name: work for name, (work, _) in jobs.items()}, rounds, frozenset({TWO}))
    return Case(robot, path, links, [Way(k, least[k], count, differ[k]) for k, (_, count) in jobs.items()])


def table(case: Case) -> str:
    lines = ["| way | us a pose (s for 1e6) | compiled in blocks is so many times as fast | C differs by |"]
    lines.append("|---|---|---|---|")
    for w in case.ways:
        gap = "-" if w.differ == 0.0 else f"{w.differ:.0e}"
        lines.append(f"| {w.name} | {1e6 * w.each:.3g} | {case.ratio(w.name, BLOCKS):.3g} | {gap} |")
    return "\n".join(lines)


def summary(cases: list[Case]) -> str:
    peers = (NUMPY, STIFFNESS, BY_POSE, LOOP, STORED)
    lines = ["| arm | links | 1e6 poses, s | numpy | direct stiffness | pinocchio, pose by pose | in a loop | stored |"]
    lines.append("|---|---|---|---|---|---|---|---|")
    for case in cases:
        ratios = [case.ratio(peer, BLOCKS) for peer in peers]
        seconds = 1e6 * next(w.each for w in case.ways if w.name == BLOCKS)
        words = " | ".join("-" if np.isnan(r) else f"{r:.3g}" for r in ratios)
        lines.append(f"| {case.robot}, {case.path} | {case.links} | {seconds:.2g} | {words} |")
    return "\n".join(lines)


def page(cases: list[Case]) -> str:
    return TEXT.read_text(encoding="utf-8").format(
        command="python benchmarks/statics/map_speed.py --write",
        poses=f"{cases[0].ways[0].count:,}".replace(",", " "),
        batched=f"{BATCHED:,}".replace(",", " "),
        peer=f"{PEER:,}".replace(",", " "),
        direct=f"{DIRECT:,}".replace(",", " "),
        block=f"{MAP_BLOCK:,}".replace(",", " "),
        fewest=FEWEST,
        load=os.getloadavg()[0],
        cores=default_threads(),
        summary=summary(cases),
        tables="\n\n".join(f"### {c.robot}, {c.path}, {c.links} links\n\n{table(c)}" for c in cases),
    )


def main() -> None:
    a = asked(__doc__, poses=1000000, rounds=5, json=False, write=False)
    cases = [measure(*case, a.poses, a.rounds) for case in CASES]
    if a.write:
        PAGE.write_text(page(cases), encoding="utf-8")
    if a.json:
        json.dump([asdict(case) for case in cases], sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        sys.stdout.write(page(cases))


if __name__ == "__main__":
    main()
