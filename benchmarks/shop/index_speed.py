"""k_fs over path points x gamma, with inverse kinematics, limits and all branches, against pinocchio, in one run.

    python benchmarks/shop/index_speed.py [--points 400] [--gammas 144] [--rounds 9] [--json] [--write]

kr60-3 with rigid links and a spindle. The ways take turns, so that a busy machine slows all of them; the least time of
each counts: seconds of the processor for what runs on one thread, seconds by the clock for the rest. Needs pinocchio
and numba. ``--write`` writes docs/performance/indices.md.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import fem
from benchmarks.asked import asked
from benchmarks.shop.index_flops import ARCTANGENT, flops, operations_of_target
from machining.posture.path import optimise_path
from machining.posture.points import GammaRange, best_postures, sweep_gamma
from machining.stiffness import compiled as fast_index
from machining.stiffness.distribution import distribution
from machining.stiffness.objective import Objective
from machining.task import Task, tool_path
from robots import Robot, load_description
from robots.arrays import Array


def rigid_arm() -> fem.ArmModel:
    return fem.build_model(load_description("kr60-3"), links="rigid")


def curved_task(n: int) -> Task:
    """A path of 0.7 m whose normals tilt along it, in front of the arm; a spindle across the flange."""
    u = np.linspace(0.0, 1.0, n)
    wave = 2.0 * np.pi * u
    points = np.stack([0.7 * (u - 0.5), 0.15 * np.sin(wave), 0.08 * np.cos(wave)], axis=1)
    normals = np.stack([0.35 * np.sin(wave), 0.25 * np.cos(0.5 * wave), np.ones(n)], axis=1)
    place, tool = np.eye(4), np.eye(4)
    place[:3, 3] = 1.2, 0.2, 0.6
    tool[:3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    tool[:3, 3] = 0.2, 0.0, 0.08
    return Task(tool_path(points, normals), tool, place)


class Pinocchio:
    """The same arm in pinocchio; ``theta`` (n, 6) rad are its angles."""

    def __init__(self, pin: Any, robot: Robot, tip: Array) -> None:
        self.pin, self.model = pin, pin.Model()
        before = np.eye(4)
        for i in range(robot.dof):
            self.model.addJoint(i, pin.JointModelRZ(), pin.SE3(before @ robot.T_pre[i]), f"j{i + 1}")
            before[:3, :3] = robot.R_post[i]
        T = before @ robot.T_last_flange
        T[:3, 3] += T[:3, :3] @ tip
        self.tip = self.model.addFrame(pin.Frame("tip", robot.dof, 0, pin.SE3(T), pin.FrameType.OP_FRAME))
        self.data = self.model.createData()
        self.sign, self.offset = robot.sign, robot.offset

    def theta(self, q: Array) -> Array:
        """Angles of joint coordinates q."""
        return np.asarray(self.sign * q + self.offset)

    def one_by_one(self, theta: Array, normal: Array, compliance: Array) -> Array:
        """Jacobian, C_tt = J K^-1 J^T and k_fs of each pose in turn."""
        pin, model, data, tip, C = self.pin, self.model, self.data, self.tip, np.diag(compliance)
        axes, out = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, np.empty(len(theta))
        for i in range(len(theta)):
            J = pin.computeFrameJacobian(model, data, theta[i], tip, axes)[:3]
            out[i] = 1.0 / np.linalg.norm(J @ C @ J.T @ normal[i])
        return out

    def jacobians_first(self, theta: Array, normal: Array, compliance: Array) -> Array:
        """Jacobians in a loop, the rest for all poses at once and without forming C_tt."""
        pin, model, data, tip = self.pin, self.model, self.data, self.tip
        axes, J = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, np.empty((len(theta), 3, 6))
        for i in range(len(theta)):
            J[i] = pin.computeFrameJacobian(model, data, theta[i], tip, axes)[:3]
        torque = (normal[:, None, :] @ J)[:, 0] * compliance
        return np.asarray(1.0 / np.linalg.norm((J @ torque[:, :, None])[:, :, 0], axis=1))

    def newton(self, theta: Array) -> tuple[Array, float]:
        """Angles found again from some 0.2 rad off each, by Newton's method, NaN where not; mean iterations."""
        pin, model, data, tip = self.pin, self.model, self.data, self.tip
        out, steps = np.full_like(theta, np.nan), 0
        for i in range(len(theta)):
            pin.framesForwardKinematics(model, data, theta[i])
            goal, q = data.oMf[tip].copy(), theta[i] + 0.2 * np.cos(np.arange(6) + i)
            for _ in range(30):
                pin.framesForwardKinematics(model, data, q)
                error = pin.log6(data.oMf[tip].actInv(goal)).vector
                steps += 1
                if np.abs(error).max() < 1e-9:
                    out[i] = q
                    break
                J = pin.computeFrameJacobian(model, data, q, tip, pin.ReferenceFrame.LOCAL)
                q = q + np.linalg.solve(J, error)
        return out, steps / len(theta)


HERE = Path(__file__).resolve().parent
PAGE = HERE.parents[1] / "docs" / "performance" / "indices.md"
TEXT = HERE / "index_speed_page.md"
# Poses that the peers are timed on.
SOME, FEW = 10_000, 200
CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

Work = Callable[[], object]


@dataclass(frozen=True)
class Way:
    """Least seconds over the rounds, for so many targets (ours) or poses (peers)."""

    name: str
    seconds: float
    count: int
    differ: float

    @property
    def each(self) -> float:
        """Seconds for one."""
        return self.seconds / self.count


@dataclass(frozen=True)
class Result:
    """All that the page says. A pose is a branch that reaches its target; valid ones keep the joint limits."""

    targets: int
    poses: int
    valid: int
    ours: list[Way]
    peers: list[Way]
    jobs: list[tuple[str, float, float]]
    iterations: float
    operations: dict[str, float]
    peak: dict[int, float]


@contextmanager
def compiled(threads: int | None) -> Iterator[None]:
    """Sweeps by compiled code on so many threads, None: by numpy, whatever their size."""
    kept = fast_index.kernels, fast_index.threads
    if threads is None:
        fast_index.kernels = lambda: None  # type: ignore[assignment]
    else:
        fast_index.threads = lambda: threads
    try:
        yield
    finally:
        fast_index.kernels, fast_index.threads = kept


def under(threads: int | None, work: Work) -> Work:
    def run() -> object:
        with compiled(threads):
            return work()

    return run


def rounds_of(ways: dict[str, Work], rounds: int, by_clock: frozenset[str] = frozenset()) -> dict[str, float]:
    """Least seconds of each way, of the processor or by the clock; they take turns."""
    least = dict.fromkeys(ways, np.inf)
    for _ in range(rounds):
        for name, work in ways.items():
            clock = time.perf_counter if name in by_clock else time.process_time
            start = clock()
            work()
            least[name] = min(least[name], clock() - start)
    return least


def measure(points: int, gammas: int, rounds: int) -> Result:
    model, task, objective, grid = rigid_arm(), curved_task(points), Objective(), GammaRange(count=gammas)
    sweep = sweep_gamma(model, task, objective, grid.angles)
    with compiled(None):
        plain = sweep_gamma(model, task, objective, grid.angles)
    compliance = fast_index.axial_compliance(model)
    assert compliance is not None
    assert (sweep.reason == plain.reason).all()
    peer = Pinocchio(importlib.import_module("pinocchio"), model.robot, task.tip)
    pick = np.random.default_rng(0).permutation(int(sweep.valid.sum()))[:SOME]
    theta = peer.theta(sweep.q[sweep.valid])[pick]
    normal, value = task.normals[np.nonzero(sweep.valid)[0]][pick], sweep.value[sweep.valid][pick]
    found, iterations = peer.newton(theta[:FEW])
    assert np.isfinite(found).all()

    def one_by_one() -> np.ndarray:
        return peer.one_by_one(theta, normal, compliance)

    def jacobians_first() -> np.ndarray:
        return peer.jacobians_first(theta, normal, compliance)

    def sweep_of() -> object:
        return sweep_gamma(model, task, objective, grid.angles)

    threads = dict.fromkeys((1, CORES))
    ways = {f"compiled, {t} thread{'s' if t > 1 else ''}": under(t, sweep_of) for t in threads}
    ways["numpy, 1 thread"] = under(None, sweep_of)
    ours = list(ways)
    ways |= {
        "Jacobian and numpy, pose by pose": one_by_one,
        "Jacobians in a loop, then numpy for all": jacobians_first,
        "Newton's method for the angles": lambda: peer.newton(theta[:FEW]),
    }
    for work in ways.values():
        work()
    least = rounds_of(ways, rounds, frozenset({f"compiled, {CORES} threads"}))
    off = float(np.nanmax(np.abs(sweep.value / plain.value - 1.0)))
    differ = [float(np.abs(work() / value - 1.0).max()) for work in (one_by_one, jacobians_first)]
    counts = [SOME, SOME, FEW]
    peers = [Way(n, least[n], c, d) for n, c, d in zip(list(ways)[-3:], counts, [*differ, np.nan], strict=True)]
    return Result(
        sweep.gamma.size,
        int(np.isfinite(sweep.q).all(axis=3).sum()),
        int(sweep.valid.sum()),
        [Way(n, least[n], sweep.gamma.size, 0.0 if "numpy" in n else off) for n in ours],
        peers,
        jobs(max(3, rounds // 3)),
        iterations,
        operations_of_target(),
        {t: matmul_peak(t) for t in threads},
    )


def jobs(rounds: int) -> list[tuple[str, float, float]]:
    """What users wait for: name, seconds compiled, seconds with numpy, both on one thread."""
    model, task, many = rigid_arm(), curved_task(200), curved_task(1500)
    work: dict[str, Work] = {
        "map, 1500 points x 72 gamma": lambda: distribution(model, many, Objective(), GammaRange().angles),
        "`best_postures`, 200 points x 72 gamma": lambda: best_postures(model, task, Objective()),
        "`best_postures`, 1500 points x 72 gamma": lambda: best_postures(model, many, Objective()),
        "`optimise_path`, 200 points x 72 gamma": lambda: optimise_path(model, task),
    }
    ways = {f"{t} {name}": under(t, job) for name, job in work.items() for t in (1, None)}
    least = rounds_of(ways, rounds)
    return [(name, least[f"1 {name}"], least[f"None {name}"]) for name in work]


def matmul_peak(threads: int) -> float:
    """Flop/s of a product of large matrices."""
    A = np.random.default_rng(0).normal(size=(1200, 1200))
    by_clock = frozenset({"matmul"}) if threads > 1 else frozenset()
    with threadpool_limits(threads):
        return 2.0 * len(A) ** 3 / rounds_of({"matmul": lambda: A @ A}, 8, by_clock)["matmul"]


def table(r: Result) -> str:
    """Rows of the page."""
    lines = ["| way | million poses/s | times as fast as pose by pose | as Jacobians in a loop | k_fs differs by |"]
    lines.append("|---|---|---|---|---|")
    slow, loop = r.peers[0].each, r.peers[1].each
    rows = [(f"stiffarm, {w.name}", w.seconds / r.poses, w.differ) for w in r.ours]
    rows += [(f"pinocchio: {w.name}", w.each, w.differ) for w in r.peers]
    for name, each, differ in rows:
        gap = "-" if np.isnan(differ) or differ == 0.0 else f"{differ:.0e}"
        lines.append(f"| {name} | {1e-6 / each:.3g} | {slow / each:.3g} | {loop / each:.3g} | {gap} |")
    return "\n".join(lines)


def page(r: Result) -> str:
    """The whole page from its text and the measurement."""
    one = r.ours[0]
    job_rows = [f"| {name} | {fast:.3g} | {slow:.3g} | {slow / fast:.3g} |" for name, fast, slow in r.jobs]
    per_target = flops(r.operations)
    words = ", ".join(f"{count:.0f} {name}" for name, count in sorted(r.operations.items(), key=lambda x: -x[1]))
    peak_one = r.peak[1]
    return TEXT.read_text(encoding="utf-8").format(
        command="python benchmarks/shop/index_speed.py --write",
        targets=f"{r.targets:,}".replace(",", " "),
        poses=f"{r.poses:,}".replace(",", " "),
        valid=f"{r.valid:,}".replace(",", " "),
        table=table(r),
        jobs="\n".join(job_rows),
        per_pose=f"{r.peers[0].each * r.poses / one.seconds:.0f}",
        per_pose_loop=f"{r.peers[1].each * r.poses / one.seconds:.0f}",
        same_job=f"{r.peers[0].each * r.valid / one.seconds:.0f}",
        same_job_loop=f"{r.peers[1].each * r.valid / one.seconds:.0f}",
        newton=f"{r.peers[2].each * r.valid / one.seconds:.0f}",
        newton_us=f"{1e6 * r.peers[2].each:.0f}",
        iterations=f"{r.iterations:.0f}",
        fewest=fast_index.FEWEST,
        operations=words,
        arctangent=ARCTANGENT,
        flops=f"{per_target:.0f}",
        flops_pose=f"{per_target * r.targets / r.poses:.0f}",
        peak=f"{peak_one / 1e9:.0f}",
        limit=f"{1e-6 * peak_one / (per_target * r.targets / r.poses):.0f}",
        reached=f"{1e-6 * r.poses / one.seconds:.1f}",
        share=f"{100.0 * per_target / one.each / peak_one:.0f}",
    )


def main() -> None:
    a = asked(__doc__, points=400, gammas=144, rounds=9, json=False, write=False)
    result = measure(a.points, a.gammas, a.rounds)
    if a.write:
        PAGE.write_text(page(result), encoding="utf-8")
    if a.json:
        json.dump(asdict(result), sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        sys.stdout.write(page(result))


if __name__ == "__main__":
    main()
